import numpy as np
import pytest
from hypothesis import given

from shrm_cli.sphere.grid import latlong
from tests import oracles
from tests.oracles import EPS
from tests.sphere.strategies import directions

SAMPLINGS = ["center", "border"]


def test_latlong_landmarks():
    """Border-sampled 5 x 3: the seam -Z, then +X, the centre +Z, -X, the seam again."""
    found = latlong.latlong_directions(5, 3, "border")
    horizon = [(0, 0, -1), (1, 0, 0), (0, 0, 1), (-1, 0, 0), (0, 0, -1)]
    np.testing.assert_allclose(found[1], horizon, atol=2 * EPS)
    np.testing.assert_allclose(found[0], [(0, 1, 0)] * 5, atol=2 * EPS)
    np.testing.assert_allclose(found[2], [(0, -1, 0)] * 5, atol=2 * EPS)


@pytest.mark.parametrize("sampling", SAMPLINGS)
@pytest.mark.parametrize(("width", "height"), [(8, 4), (10, 5), (64, 32), (7, 2)])
def test_latlong_directions_against_openexr(width, height, sampling):
    np.testing.assert_allclose(
        latlong.latlong_directions(width, height, sampling),
        oracles.latlong_pixels(width, height, sampling),
        atol=8 * EPS,
    )


def test_latlong_axes_are_those_of_the_longitude():
    """In the image's own axes, whose x, y, z are world +Z, +X, +Y."""
    own = oracles.latlong_pixels(12, 7)[..., [2, 0, 1]]
    np.testing.assert_allclose(own, oracles.latlong_pixels(12, 7) @ latlong.AXES.T)


@pytest.mark.parametrize("sampling", SAMPLINGS)
@pytest.mark.parametrize(("width", "height"), [(8, 4), (31, 15), (2, 1)])
def test_latlong_pixel_to_direction_and_back(width, height, sampling):
    s, t = latlong.latlong_coordinates(7 * latlong.latlong_directions(width, height, sampling))
    rows = oracles.positions(height, sampling)
    np.testing.assert_allclose(t, np.transpose([rows] * width), atol=8 * EPS)
    inside = np.abs(rows) < 1 - 1e-9  # at the poles every column is the same
    # The two ends are the same meridian.
    wrapped = np.abs(s - oracles.positions(width, sampling))[inside]
    np.testing.assert_allclose(np.minimum(wrapped, 2 - wrapped), 0, atol=8 * EPS)


@given(directions())
def test_latlong_direction_to_position_and_back(direction):
    s, t = latlong.latlong_coordinates(direction)
    assert -1 <= s <= 1
    assert -1 <= t <= 1
    latitude, longitude = -t * np.pi / 2, -s * np.pi
    back = [
        np.sin(longitude) * np.cos(latitude),
        np.sin(latitude),
        np.cos(longitude) * np.cos(latitude),
    ]
    np.testing.assert_allclose(back, direction, atol=8 * EPS)


def test_a_latlong_that_is_not_turned_is_not_copied(rng):
    """Those of 8192 x 4096 pixels took 1.2 GB beside the image."""
    image = rng.random((8, 16, 3))
    assert latlong.LatLong(8).turned(image, np.eye(3)) is image
