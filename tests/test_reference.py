"""Angular integration against sums that share no code with it."""

from importlib import import_module

import numpy as np
import pytest

from shrm_cli import settings
from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.lobe import lobe_tail
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.probe import source
from shrm_cli.probe.open import open_probe
from shrm_cli.probe.options import ReadOptions
from shrm_cli.probe.resample import to_grid
from shrm_cli.reference import Reference
from shrm_cli.sphere.grid.latlong import LatLong
from tests import brute_force
from tests.cli.helpers import polynomial_light, write_exr
from tests.oracles import cube_texels, latlong_pixels, turn

HEIGHT = 36  # not a multiple of a tile
POINTS = 150
SPECS = {
    **{f"microfacet:sigma={sigma}": brute_force.microfacet(sigma) for sigma in (0.05, 0.2, 0.5)},
    **{f"phong:exponent={s}": brute_force.phong(s) for s in (8, 64, 512)},
    "lambertian": lambda r, v, light: np.maximum(light @ half(r, v), 0) / np.pi,
}


def half(reflection, view):
    return (reflection + view) / np.linalg.norm(reflection + view)


class Coloured(Brdf):
    """About the normal, with light from below too, and another lobe in every channel."""

    name = "coloured"
    summary = source = "this test"
    center = "normal"
    includes_cosine = True
    has_horizon = False

    def evaluate(self, light, view):
        cosine = np.sum(light * view, axis=-1)
        height = 2 + light[..., 2] + 0 * cosine
        return np.stack([height, (1 + cosine) ** 2 * height, 1 + cosine**4], axis=-1)


def coloured(normal, view, light):
    height, cosine = 2 + light @ normal, light @ view
    return np.stack([height, (1 + cosine) ** 2 * height, 1 + cosine**4], axis=-1)


@pytest.fixture(scope="module")
def image():
    """Noise under a strong sun: nothing in it is smooth, grey or symmetric."""
    values = np.random.default_rng(3).uniform(0, 2, (HEIGHT, 2 * HEIGHT, 3))
    values[9, 20] = 300, 200, 100
    return values.astype(np.float32)


@pytest.fixture(scope="module")
def probe(image, tmp_path_factory):
    return open_probe(write_exr(tmp_path_factory.mktemp("probe") / "noise.exr", image))


@pytest.fixture(scope="module")
def lights(image):
    """Directions and radiance times Fejer's weights, written out again as a sine series."""
    directions, _ = brute_force.latlong_samples(HEIGHT)
    theta = np.pi * (np.arange(HEIGHT) + 0.5) / HEIGHT
    odd = np.arange(1, HEIGHT, 2)
    rows = 4 / HEIGHT * np.sin(theta) * (np.sin(np.outer(theta, odd)) / odd).sum(axis=1)
    assert rows.sum() == pytest.approx(2)
    weights = np.repeat(rows * np.pi / HEIGHT, 2 * HEIGHT)
    return directions, image.reshape(-1, 3) * weights[:, None]


@pytest.fixture(scope="module")
def pairs():
    """Generic mirror directions, views and normals."""
    rng = np.random.default_rng(8)
    reflections, views = brute_force.unit(rng, POINTS), brute_force.unit(rng, POINTS)
    normals = reflections + views
    return reflections, views, normals / np.linalg.norm(normals, axis=1)[:, None]


def truth(rho_hat, reflections, views, lights, angle=np.pi, center=None):
    """Sums over all lights within an angle of R, or of other centres."""
    directions, light = lights
    rows = []
    for k, (reflection, view) in enumerate(zip(reflections, views, strict=True)):
        axis = reflection if center is None else center[k]
        inside = np.arccos(np.clip(directions @ axis, -1, 1)) <= angle
        rows.append((rho_hat(reflection, view, directions) * inside) @ light)
    return np.array(rows)


def relative_rms(found, expected):
    return np.sqrt(np.sum((found - expected) ** 2) / np.sum(expected**2))


@pytest.mark.parametrize("spec", SPECS)
def test_integral_against_brute_force(probe, lights, pairs, spec):
    reflections, views, normals = pairs
    expected = truth(SPECS[spec], reflections, views, lights)
    single = Reference(probe, parse_spec(spec), exact=True).radiance(normals, views)
    assert single.dtype == np.float64
    assert relative_rms(single, expected) < 1e-4
    double = Reference(probe, parse_spec(spec), dtype=np.float64, exact=True).radiance(
        normals, views
    )
    np.testing.assert_allclose(double, expected, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("spec", SPECS)
def test_truncated_lobe_and_its_tail(probe, lights, pairs, spec):
    reflections, views, normals = pairs
    brdf = parse_spec(spec)
    centers = normals if brdf.center == "normal" else reflections
    truncated = Reference(probe, brdf, tolerance=0.1, dtype=np.float64, exact=True)
    inside = truncated.radiance(normals, views)
    expected = truth(SPECS[spec], reflections, views, lights, truncated.angle, centers)
    np.testing.assert_allclose(inside, expected, rtol=1e-9, atol=1e-12)
    tail = Reference(probe, lobe_tail(brdf, truncated.angle), dtype=np.float64, exact=True)
    whole = truth(SPECS[spec], reflections, views, lights)
    np.testing.assert_allclose(inside + tail.radiance(normals, views), whole, rtol=1e-9, atol=1e-12)
    assert relative_rms(inside, whole) > 0.005
    single = Reference(probe, brdf, tolerance=0.1, exact=True).radiance(normals, views)
    assert relative_rms(single, expected) < 1e-4


def test_coloured_brdf_about_the_normal_without_a_horizon(probe, lights, pairs):
    _, views, normals = pairs
    directions, light = lights
    expected = [
        np.sum(coloured(normal, view, directions) * light, axis=0)
        for normal, view in zip(normals, views, strict=True)
    ]
    found = Reference(probe, Coloured(), exact=True).radiance(normals, views)
    np.testing.assert_allclose(found, expected, rtol=1e-5)
    narrow = Reference(probe, Coloured(), tolerance=0.5, dtype=np.float64, exact=True)
    expected = [
        np.sum(coloured(normal, view, directions) * light
               * (directions @ normal >= np.cos(narrow.angle))[:, None], axis=0)
        for normal, view in zip(normals, views, strict=True)
    ]  # fmt: skip
    np.testing.assert_allclose(narrow.radiance(normals, views), expected, rtol=1e-9)


@pytest.mark.parametrize("tolerance", [None, 0.02])
@pytest.mark.parametrize("spec", ["microfacet:sigma=0.2", "phong:exponent=64"])
@pytest.mark.slow
def test_cuts_change_nothing(probe, pairs, monkeypatch, spec, tolerance):
    _, views, normals = (each[:20] for each in pairs)
    brdf = parse_spec(spec)

    def answers():
        made = Reference(probe, brdf, tolerance=tolerance, dtype=np.float64, exact=True)
        return made.radiance(normals, views), made.zonal_radiance(normals, 0.7)

    usual = answers()
    for cuts in [(2, (1, 1), 1, 20), (3, (5, 5), 7, 2**12), (64, (99, 99), 2**20, 2**20)]:
        names = "_TILE_ROWS", "_GROUP_SIZES", "_POINTS_AT_ONCE", "SAMPLES_AT_ONCE"
        for name, value in zip(names, cuts, strict=True):
            module = "probe.source" if name == "_TILE_ROWS" else "reference"
            monkeypatch.setattr(import_module(f"shrm_cli.{module}"), name, value)
        for found, expected in zip(answers(), usual, strict=True):
            np.testing.assert_allclose(found, expected, rtol=1e-10)


def test_far_tiles_are_left_out(probe, pairs, monkeypatch):
    _, views, normals = pairs
    seen = []
    brdf = parse_spec("phong:exponent=512")
    transfer = type(brdf).transfer

    def counted(self, light, view):
        seen.append(light.size // 3)
        return transfer(self, light, view)

    monkeypatch.setattr(type(brdf), "transfer", counted)
    made = Reference(probe, brdf, tolerance=0.01, exact=True)
    seen.clear()
    made.radiance(normals, views)
    # A cap is 0.45 % of the sphere; here, tiles and groups are far larger than it is.
    assert 0 < sum(seen) < 0.4 * POINTS * HEIGHT * 2 * HEIGHT
    monkeypatch.setattr(source, "_TILE_ROWS", 1)
    monkeypatch.setattr(import_module("shrm_cli.reference"), "_GROUP_SIZES", (1, 1))
    made = Reference(probe, brdf, tolerance=0.01, exact=True)
    seen.clear()
    made.radiance(normals, views)
    assert 0 < sum(seen) < 0.03 * POINTS * HEIGHT * 2 * HEIGHT


def test_threads_change_nothing_at_all(probe, pairs):
    _, views, normals = pairs
    made = Reference(probe, parse_spec("microfacet:sigma=0.3"), exact=True)
    results = []
    for count in (1, 2, 5):
        with settings.using(threads=count):
            results.append(made.radiance(normals, views))
    np.testing.assert_array_equal(results[1], results[0])
    np.testing.assert_array_equal(results[2], results[0])


def test_shapes_are_broadcast(probe, pairs):
    _, views, normals = pairs
    made = Reference(probe, parse_spec("microfacet:sigma=0.3"), dtype=np.float64, exact=True)
    grid = made.radiance(normals[:6].reshape(2, 3, 1, 3), views[:4])
    assert grid.shape == (2, 3, 4, 3)
    single = made.radiance(normals[4], views[2])
    assert single.shape == (3,)
    np.testing.assert_allclose(grid[1, 1, 2], single, rtol=1e-10)
    assert made.radiance(np.empty((0, 3)), views[0]).shape == (0, 3)
    assert made.zonal_radiance(normals[:6].reshape(2, 3, 3), 0.4).shape == (2, 3, 3)


def brushed_ward(tangent, normal, light, view, ax, ay):
    """Ward's lobe times the cosine, from vectors in world axes, of lights (n, 3) and one view."""
    across = np.cross(normal, tangent)
    x, y, z = (light @ axis + view @ axis for axis in (tangent, across, normal))
    slope = ((x / ax) ** 2 + (y / ay) ** 2) / z**2
    lobe = np.exp(-slope) * (x * x + y * y + z * z) / (np.pi * ax * ay * z**4)
    cosine = light @ normal
    return np.where((cosine > 0) & (view @ normal > 0), lobe * cosine, 0.0)


def test_brush_marks_follow_the_tangents(probe, lights, pairs):
    _, views, normals = pairs
    tangents = np.cross(brute_force.unit(np.random.default_rng(21), POINTS), normals)
    tangents /= np.linalg.norm(tangents, axis=1)[:, None]
    directions, light = lights
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        expected = np.array(
            [
                np.nan_to_num(brushed_ward(tangent, normal, directions, view, 0.5, 0.2)) @ light
                for tangent, normal, view in zip(tangents, normals, views, strict=True)
            ]
        )
    made = Reference(probe, parse_spec("ward:ax=0.5,ay=0.2"), dtype=np.float64, exact=True)
    found = made.brushed_radiance(normals, tangents, views)
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12)
    assert relative_rms(made.radiance(normals, views), expected) > 0.05


def test_fibres_run_along_the_tangents(probe, pairs):
    _, views, normals = pairs
    made = Reference(probe, parse_spec("kajiya-kay"), dtype=np.float64, exact=True)
    tangents = np.cross(normals, [0.6, 0.0, 0.8])
    tangents /= np.linalg.norm(tangents, axis=1)[:, None]
    expected = made.central_radiance(tangents, views)
    np.testing.assert_array_equal(made.brushed_radiance(normals, tangents, views), expected)


@pytest.mark.parametrize("tolerance", [None, 0.05])
@pytest.mark.parametrize("theta_o", [0.6, 2.4])
@pytest.mark.parametrize("spec", ["microfacet:sigma=0.3", "phong:exponent=8", "lambertian"])
def test_zonal_radiance_is_the_mean_over_the_azimuth(
    probe, lights, pairs, spec, theta_o, tolerance
):
    """At 2.4 rad the horizon cuts into the microfacet lobe."""
    centers = pairs[0][:5]
    brdf = parse_spec(spec)
    made = Reference(probe, brdf, tolerance=tolerance, dtype=np.float64, exact=True)
    phi = 2 * np.pi * (np.arange(720) + 0.5) / 720
    expected = []
    for center in centers:
        x = np.cross(center, [0.36, 0.48, 0.8])
        x /= np.linalg.norm(x)
        ring = np.cos(phi)[:, None] * x + np.sin(phi)[:, None] * np.cross(center, x)
        views = np.cos(theta_o) * center + np.sin(theta_o) * ring
        normals = center + views if brdf.center == "reflection" else np.tile(center, (720, 1))
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        expected.append(made.radiance(normals, views).mean(axis=0))
    np.testing.assert_allclose(made.zonal_radiance(centers, theta_o), expected, rtol=2e-3)


def test_zonal_radiance_of_a_coloured_brdf(probe, lights, pairs):
    """The means of L.V and (L.V)^2 over the azimuth are c c' and c^2 c'^2 + s^2 s'^2 / 2."""
    centers = pairs[0][:5]
    directions, light = lights
    found = Reference(probe, Coloured(), dtype=np.float64, exact=True).zonal_radiance(centers, 0.8)
    cosine = directions @ centers.T
    product = np.cos(0.8) * cosine
    square = product**2 + np.sin(0.8) ** 2 * (1 - cosine**2) / 2
    for channel, lobe in enumerate([2 + cosine, (1 + 2 * product + square) * (2 + cosine)]):
        np.testing.assert_allclose(found[:, channel], lobe.T @ light[:, channel], rtol=1e-5)


def smooth_probe(folder, grid):
    """The same light on one of the grids."""
    if grid == "latlong":
        return open_probe(write_exr(folder / "l.exr", image_of(latlong_pixels(128, 64))))
    if grid == "border":
        pixels = image_of(latlong_pixels(128, 64, "border"))
        return open_probe(write_exr(folder / "b.exr", pixels), ReadOptions(sampling="border"))
    if grid == "cube":
        return open_probe(
            write_exr(folder / "c.exr", image_of(cube_texels(32).reshape(192, 32, 3)))
        )
    at = (2 * np.arange(96) + 1) / 96 - 1
    radius = np.hypot(at, at[:, None])
    angle = np.pi * np.minimum(radius, 1)
    scale = np.sin(angle) / radius
    ball = np.stack([-scale * at, -scale * at[:, None], np.cos(angle)], axis=-1)
    return open_probe(write_exr(folder / "a.exr", image_of(ball)), ReadOptions(layout="angular"))


def image_of(directions):
    return polynomial_light(directions).astype(np.float32)


@pytest.mark.parametrize("grid", ["latlong", "border", "cube", "angular"])
def test_all_grids_hold_the_same_light(tmp_path, pairs, grid):
    reflections, views, normals = (each[:20] for each in pairs)
    directions, weights = brute_force.sphere_rule(200)
    exact = directions, polynomial_light(directions) * weights[:, None]
    expected = truth(brute_force.microfacet(0.4), reflections, views, exact)
    made = Reference(smooth_probe(tmp_path, grid), parse_spec("microfacet:sigma=0.4"))
    assert relative_rms(made.radiance(normals, views), expected) < 5e-3


@pytest.mark.parametrize("mirror", [False, True])
def test_turned_and_mirrored_probes(probe, pairs, lights, mirror):
    reflections, views, normals = pairs
    turned = open_probe(probe.paths[0], ReadOptions(yaw=70, mirror=mirror))
    matrix = turn("y", np.radians(70)) @ np.diag([-1 if mirror else 1, 1, 1])
    directions, light = lights
    expected = truth(
        brute_force.microfacet(0.2), reflections, views, (directions @ matrix.T, light)
    )
    found = Reference(turned, parse_spec("microfacet:sigma=0.2"), exact=True).radiance(
        normals, views
    )
    assert relative_rms(found, expected) < 1e-5


def test_reduced_source_is_the_averaged_probe(probe, image, pairs, tmp_path):
    _, views, normals = pairs
    brdf = parse_spec("microfacet:sigma=0.3")
    turned = open_probe(probe.paths[0], ReadOptions(yaw=25))
    reduced = Reference(turned, brdf, source_height=12, exact=True)
    assert reduced.source.pixels == 12 * 24
    small = open_probe(write_exr(tmp_path / "small.exr", to_grid(turned, LatLong(12))))
    expected = Reference(small, brdf, exact=True).radiance(normals, views)
    np.testing.assert_allclose(reduced.radiance(normals, views), expected, rtol=1e-6)
    whole = Reference(turned, brdf, exact=True)
    assert whole.source.pixels == image.shape[0] * image.shape[1]
    assert 1e-3 < relative_rms(expected, whole.radiance(normals, views)) < 0.3


def test_black_probe(tmp_path, pairs):
    _, views, normals = pairs
    black = open_probe(write_exr(tmp_path / "black.exr", np.zeros((8, 16, 3), np.float32)))
    made = Reference(black, parse_spec("microfacet"))
    assert not made.radiance(normals, views).any()
    assert not made.zonal_radiance(normals, 1.0).any()


def test_progress_counts_points(probe, pairs):
    _, views, normals = pairs
    calls = []
    made = Reference(
        probe, parse_spec("lambertian"), progress=lambda done, total: calls.append((done, total))
    )
    made.radiance(normals, views)
    done = [call[0] for call in calls]
    assert len(calls) > 2
    assert done == sorted(done)
    assert calls[-1] == (POINTS, POINTS)


def test_errors_of_a_brdf_come_through(probe, pairs):
    class Broken(Coloured):
        def evaluate(self, light, view):
            raise ZeroDivisionError("broken")

    with pytest.raises(ZeroDivisionError, match="broken"):
        Reference(probe, Broken()).radiance(pairs[2], pairs[1])
