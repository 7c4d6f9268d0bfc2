"""Lat-longs of a material for one viewer, against look-ups one by one with angles of our own."""

import math

import numpy as np
import pytest

from shrm_cli.convert.plain import LEAST_COSINE, ignores_views, lookup_of, one_view
from shrm_cli.errors import ArgumentError
from shrm_cli.render.camera import Viewer
from tests.render.materials import Painted, furnace, spot, under_random_light

VIEW = Viewer(35, 20)
PIXELS = [(0, 0), (3, 17), (7, 31), (11, 2), (15, 20), (8, 15), (5, 9)]


def direction(row, column, height):
    """OpenEXR's definition: longitude falls from pi to -pi, and 0 is +Z, pi/2 is +X."""
    latitude = math.pi / 2 - math.pi * (row + 0.5) / height
    longitude = math.pi - 2 * math.pi * (column + 0.5) / (2 * height)
    across = math.cos(latitude)
    return np.array(
        [across * math.sin(longitude), math.sin(latitude), across * math.cos(longitude)]
    )


@pytest.mark.parametrize("frame", ["global", "local"])
def test_over_the_mirror_direction(frame):
    found = under_random_light(frame=frame)
    view = VIEW.direction
    picture = one_view(found, view, 16, "reflection")
    assert picture.shape == (16, 32, 3)
    assert picture.dtype == np.float32
    for row, column in PIXELS:
        total = direction(row, column, 16) + view
        normal = total / math.sqrt(total @ total)
        expected = found.radiance(normal, view)
        np.testing.assert_allclose(picture[row, column], expected, rtol=1e-4, atol=1e-5)


def test_over_the_normal():
    found = under_random_light()
    view = VIEW.direction
    picture = one_view(found, view, 16, "normal")
    seen = 0
    for row, column in PIXELS:
        normal = direction(row, column, 16)
        cosine = normal @ view
        if cosine < LEAST_COSINE:  # the nearest point of the silhouette, seen from its middle
            across = normal - cosine * view
            normal = across / math.sqrt(across @ across) + LEAST_COSINE * view
        else:
            seen += 1
        expected = found.radiance(normal, view)
        np.testing.assert_allclose(picture[row, column], expected, rtol=1e-4, atol=1e-5)
    assert 2 <= seen <= len(PIXELS) - 2


def test_hidden_normals_get_what_the_silhouette_shows():
    picture = one_view(Painted(np.asarray), VIEW.direction, 32, "normal")
    cosines = picture @ VIEW.direction
    assert cosines.min() == pytest.approx(LEAST_COSINE, abs=1e-6)
    np.testing.assert_allclose(np.linalg.norm(picture, axis=-1), 1, atol=1e-6)
    whole = one_view(Painted(np.asarray), VIEW.direction, 32, "normal", everywhere=True)
    np.testing.assert_allclose(whole[3, 5], direction(3, 5, 32), atol=1e-6)
    assert (whole @ VIEW.direction).min() < -0.99
    visible = whole @ VIEW.direction > 2 * LEAST_COSINE
    np.testing.assert_array_equal(picture[visible], whole[visible])


@pytest.mark.parametrize("view", [Viewer(0, 0), Viewer(100, -40), Viewer(0, 90)])
def test_a_lamp_is_where_it_is(view):
    """Over R a lamp is in its own direction, for all views; over N half way to the viewer."""
    lamp = np.array([0.6, 0.48, 0.64])
    half = lamp + view.direction
    wanted = {"reflection": lamp, "normal": half / np.linalg.norm(half)}
    for by, expected in wanted.items():
        picture = one_view(spot(lamp), view.direction, 64, by)
        row, column = np.unravel_index(np.argmax(picture[..., 1]), (64, 128))
        assert direction(row, column, 64) @ expected > math.cos(math.pi / 64)


def test_border_pixels_lie_on_the_poles_and_the_seam():
    picture = one_view(Painted(np.asarray), [0, 1, 0], 9, "normal", True, "border")
    np.testing.assert_allclose(picture[0], np.tile([0, 1, 0], (18, 1)), atol=1e-7)
    np.testing.assert_allclose(picture[4, 0], [0, 0, -1], atol=1e-6)
    np.testing.assert_allclose(picture[4, -1], [0, 0, -1], atol=1e-6)


def test_the_coordinates_that_the_page_gives_to_compositors():
    """docs/lookdev.md: u from the left, v from below, of a direction in world axes."""
    for row, column in PIXELS:
        x, y, z = direction(row, column, 16)
        u = 0.5 - math.atan2(x, z) / (2 * math.pi)
        v = 0.5 + math.asin(y) / math.pi
        assert (u * 32, (1 - v) * 16) == pytest.approx((column + 0.5, row + 0.5))


def test_what_is_looked_up_by_default():
    assert lookup_of(under_random_light()) == "reflection"
    assert lookup_of(under_random_light("lambertian", order_p=0)) == "normal"
    assert ignores_views(under_random_light("lambertian", order_p=0))
    assert not ignores_views(under_random_light())
    assert not ignores_views(furnace([1, 1, 1]))  # about R, which follows the view


def test_a_direction_of_another_kind_is_refused():
    with pytest.raises(ArgumentError, match="half"):
        one_view(furnace([1, 1, 1]), [0, 0, 1], 8, "half")
