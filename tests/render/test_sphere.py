"""Pictures of spheres against mirror geometry, constants and each other."""

import numpy as np
import pytest

from shrm_cli.files.image import write_image
from shrm_cli.probe.open import open_probe
from shrm_cli.render import sphere
from shrm_cli.render.camera import Viewer, pixel_centers, sphere_coverage
from shrm_cli.render.sphere import render_background, render_sphere
from tests.oracles import cube_texels, latlong_pixels
from tests.render.materials import Painted, furnace, spot, under_random_light

VIEWS = [(0, 0), (90, 0), (180, 0), (37, 25), (-140, -60), (0, 90), (60, -90)]


def frame(azimuth, elevation):
    """Right, up and direction of a viewer, written out again."""
    a, e = np.radians(azimuth), np.radians(elevation)
    right = np.array([np.cos(a), 0, -np.sin(a)])
    up = np.array([-np.sin(a) * np.sin(e), np.cos(e), -np.cos(a) * np.sin(e)])
    return right, up, np.array([np.sin(a) * np.cos(e), np.sin(e), np.cos(a) * np.cos(e)])


@pytest.mark.parametrize(("azimuth", "elevation"), VIEWS)
def test_pixels_show_their_normals(azimuth, elevation):
    size, radius = 40, 18
    right, up, direction = frame(azimuth, elevation)
    picture = render_sphere(Painted(lambda n: n), Viewer(azimuth, elevation), size)
    assert picture.dtype == np.float32
    for row, column in [(20, 20), (8, 20), (20, 8), (30, 25), (13, 28)]:
        x, y = (column + 0.5 - 20) / radius, (20 - row - 0.5) / radius
        normal = x * right + y * up + np.sqrt(1 - x * x - y * y) * direction
        np.testing.assert_allclose(picture[row, column], normal, atol=1e-6)


@pytest.mark.parametrize(("azimuth", "elevation"), VIEWS)
@pytest.mark.parametrize("offset", [(0.5, 0.1), (-0.4, 0.35), (0.2, -0.6), (0.0, 0.0)])
def test_highlight_is_where_the_mirror_direction_meets_the_light(azimuth, elevation, offset):
    right, up, direction = frame(azimuth, elevation)
    light = offset[0] * right + offset[1] * up
    light = light + np.sqrt(1 - light @ light) * direction
    size = 101
    picture = render_sphere(spot(light), Viewer(azimuth, elevation), size)[..., 1]
    row, column = np.unravel_index(np.argmax(picture), picture.shape)
    # A mirror shows the light where the normal halves the angle between light and viewer.
    half = (light + direction) / np.linalg.norm(light + direction)
    assert abs(column + 0.5 - size / 2 - 0.45 * size * (half @ right)) < 0.75
    assert abs(size / 2 - row - 0.5 - 0.45 * size * (half @ up)) < 0.75


@pytest.mark.parametrize("size", [16, 31, 128])
def test_furnace_is_a_constant_disc_with_covered_edges(size):
    picture = render_sphere(furnace((0.25, 1, 4)), Viewer(10, 20), size)
    coverage = sphere_coverage(size, *pixel_centers(size, 0, size))[..., None]
    np.testing.assert_allclose(picture, coverage * [0.25, 1, 4], rtol=1e-5)
    assert ((coverage > 0.3) & (coverage < 0.7)).any()


def test_silhouette_blends_with_the_background():
    size = 64
    behind = np.random.default_rng(1).random((size, size, 3)).astype(np.float32)
    original = behind.copy()
    picture = render_sphere(furnace((5, 5, 5)), Viewer(), size, behind)
    np.testing.assert_array_equal(behind, original)
    np.testing.assert_array_equal(picture[0], behind[0])
    np.testing.assert_allclose(picture[32, 32], 5, rtol=1e-6)
    # Brute force: an eighth of a pixel apart.
    steps = (np.arange(64) + 0.5) / 64
    for row, column in [(3, 32), (10, 13), (32, 3), (32, 60), (51, 53), (60, 40)]:
        x = column + steps[None, :] - size / 2
        y = row + steps[:, None] - size / 2
        covered = (x * x + y * y < (0.45 * size) ** 2).mean()
        expected = covered * 5 + (1 - covered) * behind[row, column]
        np.testing.assert_allclose(picture[row, column], expected, atol=0.02)


@pytest.mark.parametrize("spec", ["microfacet:sigma=.3", "lambertian", "phong:exponent=8"])
@pytest.mark.parametrize("view", [(0, 0), (25, 50), (0, 90)])
def test_local_and_global_maps_make_one_picture(spec, view):
    order_p = 2 if spec.startswith("microfacet") else 0
    shown = [
        render_sphere(under_random_light(spec, frame, order_p=order_p), Viewer(*view), 48)
        for frame in ("global", "local")
    ]
    assert np.abs(shown[0]).max() > 0.1
    np.testing.assert_allclose(shown[1], shown[0], atol=1e-5)


@pytest.mark.parametrize(("spec", "order_p"), [("lambertian", 0), ("microfacet:sigma=.3", 2)])
def test_a_pixel_is_the_radiance_of_its_normal(spec, order_p):
    """Whatever the map is centred on; the map is asked for this one view alone."""
    material = under_random_light(spec, order_p=order_p)
    picture = render_sphere(material, Viewer(), 65)
    normal = np.array([16 / 29.25, 0, np.sqrt(1 - (16 / 29.25) ** 2)])
    expected = material.radiance(normal[None, :], np.array([[0, 0, 1.0]]))[0]
    np.testing.assert_allclose(picture[32, 48], expected, rtol=1e-5)


def test_negative_radiance_is_kept():
    picture = render_sphere(furnace((-0.5, 0, 1)), Viewer(), 16)
    np.testing.assert_allclose(picture[8, 8], [-0.5, 0, 1], atol=1e-6)


class Room:
    def radiance(self, directions):
        return 2 + directions


def test_batches_of_rows_change_nothing(monkeypatch):
    material = under_random_light()
    batches = []

    def note(done, total):
        batches.append((done, total))

    whole = render_sphere(material, Viewer(30, 40), 60, progress=note)
    behind = render_background(Room(), Viewer(30, 40), 60)
    assert batches == [(60, 60)]
    monkeypatch.setattr(sphere, "_PIXELS_AT_ONCE", 7 * 60)
    batches.clear()
    in_parts = render_sphere(material, Viewer(30, 40), 60, progress=note)
    np.testing.assert_allclose(in_parts, whole, atol=1e-6)
    np.testing.assert_array_equal(render_background(Room(), Viewer(30, 40), 60), behind)
    assert batches == [(min(7 * k, 60), 60) for k in range(1, 10)]


def test_fine_stripes_on_the_rim_are_averaged():
    """Near the silhouette one pixel spans many reflections: point samples would be 0 or 2."""
    stripes = Painted(lambda n: np.repeat(1 + np.sign(np.sin(3000 * n[:, 2:])), 3, axis=1))
    picture = render_sphere(stripes, Viewer(), 128)[64, 120:121]
    assert ((picture > 0.2) & (picture < 1.8)).all()


def test_samples_off_the_sphere_count_only_where_none_is_on_it():
    places = np.array([0.95, 1.0, 1.06])  # within, on the silhouette, and all beyond it
    x, y, weights = sphere._rim_samples(places, np.zeros(3), 10.0)
    off = (np.hypot(x, y) > 1 - 0.5 * sphere._INSIDE / 10) | (weights == 0)
    np.testing.assert_allclose(weights.sum(axis=1), 1)
    assert (np.hypot(x, y) <= 1).all()
    assert not off[0].any()
    assert 0 < np.count_nonzero(weights[1]) < weights.shape[1]
    assert len(np.unique(weights[1])) == 2
    assert (weights[2] == 1 / weights.shape[1]).all()


def test_pixels_on_the_rim_are_means_of_what_they_cover(monkeypatch):
    """Of rings that grow finer than pixels there, beside 32 x 32 samples of each."""
    rings = Painted(lambda n: np.repeat(1 + np.sin(60 * n[:, 2:]), 3, axis=1))
    found = render_sphere(rings, Viewer(), 64)
    monkeypatch.setattr(sphere, "_SAMPLES", 32)
    off = np.abs(found - render_sphere(rings, Viewer(), 64))
    rim = off[off > 1e-9]
    assert rim.size > 1000
    assert np.sqrt(np.mean(rim**2)) < 0.08


def lit_room(directions):
    """Smooth surroundings without symmetry, at least 0.5."""
    x, y, z = np.moveaxis(directions, -1, 0)
    return np.stack([1.5 + x, 1.5 + y + 0.3 * x * z, 1.5 + z], axis=-1).astype(np.float32)


@pytest.fixture(scope="module")
def rooms(tmp_path_factory):
    """The same surroundings as a lat-long and as a cube."""
    folder = tmp_path_factory.mktemp("rooms")
    write_image(folder / "latlong.exr", lit_room(latlong_pixels(256, 128)), "float")
    write_image(folder / "cube.exr", lit_room(cube_texels(64).reshape(384, 64, 3)), "float")
    return [open_probe(folder / f"{name}.exr") for name in ("latlong", "cube")]


@pytest.mark.parametrize(("azimuth", "elevation"), VIEWS)
def test_background_has_each_side_in_its_place(rooms, azimuth, elevation):
    latlong, cube = (render_background(room, Viewer(azimuth, elevation), 32) for room in rooms)
    right, up, direction = frame(azimuth, elevation)
    half = np.tan(np.radians(25)) * 31 / 32
    for row, column, x, y in [(0, 0, -1, 1), (0, 31, 1, 1), (31, 0, -1, -1), (31, 31, 1, -1)]:
        ray = half * (x * right + y * up) - direction
        expected = lit_room(ray / np.linalg.norm(ray))
        np.testing.assert_allclose(latlong[row, column], expected, atol=2e-3)
    np.testing.assert_allclose(cube, latlong, atol=2e-3)


@pytest.mark.parametrize("size", [16, 33, 128])
def test_normals_face_the_viewer_up_to_the_silhouette(size):
    """On it, at N.V = 0, BRDFs have no value: the picture is its coverage."""

    class White:
        def radiance(self, normals, views):
            return np.repeat(np.where(normals @ views > 1e-3, 1.0, 0.0)[:, None], 3, axis=1)

    picture = render_sphere(White(), Viewer(30, 10), size)
    coverage = sphere_coverage(size, *pixel_centers(size, 0, size))
    np.testing.assert_allclose(picture, np.repeat(coverage[..., None], 3, axis=-1), atol=1e-6)
