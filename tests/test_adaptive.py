"""Adaptive sums over a probe against the full ones, and against what they say of themselves."""

from importlib import import_module

import numpy as np
import pytest

from shrm_cli import adaptive, settings
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.probe.open import as_probe
from shrm_cli.probe.source import Pyramid, Source
from shrm_cli.reference import Reference
from shrm_cli.vocabulary import LUMINANCE, SEEN_FLOOR
from tests import brute_force

ROWS = 256
POINTS, FEW = 96, 16
CUTS = 4
"""Into so many parts each side of a pixel is cut that is large beside a lobe, for full sums."""
ANALYTIC = [
    "lambertian",
    "ggx:roughness=0.3",
    "ward:ax=0.3,ay=0.1",
    "kajiya-kay",
    "phong:exponent=512",
    "ashikhmin-shirley:nu=1000,nv=10,specular=0.5/0.7/0.9,diffuse=0.5",
]
NARROW = ["ggx:roughness=0.1", "0.04*ggx:roughness=0.1+0.94*ggx:roughness=0.5"]
MEASURED = ["rgl/cc_ibiza_sunset_rgb.bsdf", "cornell/krylon_blue.brdf"]
PROBES = ["sun", "studio", "noise", "lamps"]
REAL = ["city", "studio", "interior", "night"]


def pixels(name):
    """A light that was made: a gradient with a small sun, boxes in the dark, noise, or lamps."""
    rng = np.random.default_rng(5)
    height = np.linspace(1, -1, ROWS)[:, None, None]
    image = np.zeros((ROWS, 2 * ROWS, 3)) + 0.01
    if name == "sun":
        image += np.where(height > 0, 0.3 + height, 0.15) * (0.6, 0.8, 1.0)
        image[60:62, 101:103] = 9000, 8000, 6000
    elif name == "studio":
        image[40:90, 30:80] = 20
        image[100:160, 300:310] = 12, 9, 6
        image[200:, :] += 0.2
    elif name == "noise":
        image += rng.uniform(0, 2, image.shape) ** 3
    else:
        where = rng.integers(0, ROWS, 12), rng.integers(0, 2 * ROWS, 12)
        image[where] = rng.uniform(50, 2000, (12, 3))
    return image.astype(np.float32)


@pytest.fixture(scope="module")
def made():
    return {name: as_probe(pixels(name)) for name in PROBES}


@pytest.fixture(scope="module")
def pairs():
    """Normals that a viewer sees, some of them near the silhouette."""
    rng = np.random.default_rng(8)
    view = np.array([0.48, 0.6, 0.64])
    normals = brute_force.unit(rng, 4 * POINTS)
    return normals[normals @ view > 0.03][:POINTS], view


def cut(image, cuts):
    """An image whose pixels are cut into parts that are as bright as they are."""
    return np.repeat(np.repeat(image, cuts, axis=0), cuts, axis=1)


def errors_of(probe, brdf, pairs, rows=None, whole=None):
    """Relative errors of the luminance, and what is stated of them."""
    adaptive = Reference(probe, brdf, rows)
    exact = Reference(probe if whole is None else whole, brdf, rows, exact=True)
    assert (type(adaptive.source), type(exact.source)) == (Pyramid, Source)
    found, expected = (each.radiance(*pairs) @ LUMINANCE for each in (adaptive, exact))
    assert exact.error is None
    least = SEEN_FLOOR * expected.mean()
    return np.abs(found - expected) / np.maximum(expected, least), adaptive.error


@pytest.mark.proof
@pytest.mark.parametrize("spec", ANALYTIC)
@pytest.mark.parametrize("name", PROBES)
def test_adaptive_sums_are_within_a_percent(made, pairs, name, spec):
    errors, stated = errors_of(made[name], parse_spec(spec), pairs)
    assert np.percentile(errors, 95) < min(0.01, stated)
    assert 1e-5 < stated < 0.03
    assert errors.max() < 0.05


@pytest.mark.proof
@pytest.mark.parametrize("spec", NARROW)
@pytest.mark.parametrize("name", PROBES)
def test_pixels_that_are_large_beside_a_lobe_are_cut(made, pairs, name, spec):
    """As if the probe had pixels enough, which then take four to thirty-six times the memory."""
    some, brdf = (pairs[0][:FEW], pairs[1]), parse_spec(spec)
    errors, stated = errors_of(made[name], brdf, some, whole=as_probe(cut(pixels(name), CUTS)))
    assert np.percentile(errors, 95) < 0.012
    assert errors.max() < 0.02
    assert 1e-3 < stated < 0.03


@pytest.mark.proof
def test_a_pixel_alone_in_the_dark_is_no_point():
    """A lobe of twice its size sees it as it is, about the mirror direction and beside it."""
    image = np.zeros((ROWS, 2 * ROWS, 3), np.float32)
    image[40, 300] = 1000
    probe, whole = (as_probe(each) for each in (image, cut(image, 8)))
    sun = probe.grid.directions()[40, 300] @ probe.matrix.T
    view = np.array([0.48, 0.6, 0.64])
    beside = sun + np.linspace(0, 0.02, 9)[:, None] * np.cross(sun, view)
    normals = beside / np.linalg.norm(beside, axis=1)[:, None] + view
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    brdf = parse_spec("ggx:roughness=0.1")
    found = Reference(probe, brdf).radiance(normals, view)
    points, expected = (
        Reference(each, brdf, exact=True).radiance(normals, view) for each in (probe, whole)
    )
    np.testing.assert_allclose(found, expected, rtol=0.01)
    assert np.abs(points / expected - 1).max() > 0.05


def test_pixels_as_points_are_no_truth_for_lobes_narrower_than_they_are(made, pairs):
    some, brdf = (pairs[0][:FEW], pairs[1]), parse_spec("ggx:roughness=0.1")
    points, cut_up = (Reference(made["lamps"], brdf, exact=exact) for exact in (True, False))
    wrong = points.radiance(*some) @ LUMINANCE / (cut_up.radiance(*some) @ LUMINANCE)
    assert np.percentile(np.abs(wrong - 1), 95) > 0.05


@pytest.mark.parametrize(
    ("rows", "roughness"), [(16, 0.3), pytest.param(64, 0.3, marks=pytest.mark.proof), (16, 0.8)]
)
def test_pixels_of_coarse_probes_are_areas(pairs, rows, roughness):
    """Beside a sum over parts of them: as points, a lamp of 16 rows made errors of 38 %, and 84 %
    under wide lobes, where it crosses the horizon."""
    image = np.full((rows, 2 * rows, 3), 0.02, np.float32)
    image[rows // 4, rows // 2 + 1] = 200 * (rows / 16) ** 2
    brdf = parse_spec(f"ggx:roughness={roughness}")
    expected = Reference(as_probe(cut(image, 512 // rows)), brdf, exact=True)
    expected = expected.radiance(*pairs) @ LUMINANCE
    truth, points = (Reference(as_probe(image), brdf, exact=exact) for exact in (False, True))
    least = np.maximum(expected, SEEN_FLOOR * expected.mean())
    errors, of_points = (
        np.abs(each.radiance(*pairs) @ LUMINANCE - expected) / least for each in (truth, points)
    )
    assert np.percentile(errors, 95) < truth.error < 0.01
    assert errors.max() < 0.02
    assert np.percentile(of_points, 95) > 0.01
    assert of_points.max() > 0.08


@pytest.mark.parametrize("rows", [16, 64, 128])
@pytest.mark.parametrize("spec", ["ggx:roughness=0.05,f0=1", "ggx:roughness=0.1,f0=1"])
def test_even_light_is_reflected_evenly_however_narrow_the_lobe(pairs, rows, spec):
    """A mirror in a furnace was .05 to 17 times as bright as it, and said to be right to .01 %."""
    rng = np.random.default_rng(4)
    views = brute_force.unit(rng, POINTS)
    normals = brute_force.unit(rng, POINTS)
    normals *= np.sign(np.sum(normals * views, axis=1))[:, None]
    some = np.sum(normals * views, axis=1) > 0.5  # where the facets do not hide each other
    white = Reference(as_probe(np.ones((rows, 2 * rows, 3), np.float32)), parse_spec(spec))
    found = white.radiance(normals[some], views[some])
    assert np.percentile(np.abs(found - 1), 95) < max(white.error, 0.005)
    assert np.abs(found - 1).max() < 0.015


def test_smooth_light_of_few_pixels_goes_on_between_them(pairs):
    """Its pixels were seen in a mirror, as grain, where a map shows the light itself."""
    directions = as_probe(np.ones((16, 32, 3), np.float32)).grid.directions()
    image = 2 + directions @ [0.5, 0.9, -0.3] + (directions @ [0.8, 0.0, 0.6]) ** 3
    image = np.repeat(image[..., None], 3, axis=-1).astype(np.float32)
    normals, view = pairs
    mirrored = 2 * (normals @ view)[:, None] * normals - view
    expected = 2 + mirrored @ [0.5, 0.9, -0.3] + (mirrored @ [0.8, 0.0, 0.6]) ** 3
    truth = Reference(as_probe(image), parse_spec("phong:exponent=100000"))
    found = truth.radiance(normals, np.broadcast_to(view, normals.shape))[:, 0]
    np.testing.assert_allclose(found / expected, 1, atol=0.02)


def test_wide_lobes_see_a_lamp_rise(pairs):
    """The horizon crosses a bright pixel: it is not all there, or all gone."""
    image = np.zeros((16, 32, 3), np.float32)
    image[4, 17] = 200
    brdf, lamp = parse_spec("lambertian"), as_probe(image).grid.directions()[4, 17]
    across = np.cross(lamp, [0.0, 1.0, 0.0]) / np.linalg.norm(np.cross(lamp, [0.0, 1.0, 0.0]))
    tilt = np.pi / 2 + np.linspace(-0.15, 0.07, 12)[:, None]
    normals = np.cos(tilt) * lamp + np.sin(tilt) * across
    whole = Reference(as_probe(cut(image, 64)), brdf, exact=True)
    found, expected = (
        each.radiance(normals, normals)[:, 0] for each in (Reference(as_probe(image), brdf), whole)
    )
    np.testing.assert_allclose(found, expected, rtol=0.03, atol=2e-3 * expected.max())


@pytest.mark.proof
@pytest.mark.parametrize("material", [*MEASURED, "ggx:roughness=0.2"])
@pytest.mark.parametrize("name", REAL)
def test_real_light_on_measured_materials(shared, pairs, name, material):
    spec = material if ":" in material else str(shared / "brdf" / material)
    probe = as_probe(shared / "probes" / f"{name}.exr")
    some = pairs[0][:24], pairs[1]
    errors, stated = errors_of(probe, parse_spec(spec), some, ROWS)
    assert np.percentile(errors, 95) < min(0.01, stated) < 0.03


def test_few_cells_are_enough(made, monkeypatch):
    brdf = parse_spec("ggx:roughness=0.3")
    transfer, seen = type(brdf).transfer, []

    def counted(self, light, view):
        seen.append(light.size // 3)
        return transfer(self, light, view)

    # The points of a part of a sphere's picture that is 1/16 of it, of 128 x 128 pixels.
    x, y = np.meshgrid(np.arange(16) / 64, np.arange(16) / 64)
    normals = np.stack([x, y, np.sqrt(1 - x * x - y * y)], axis=-1)
    truth = Reference(made["sun"], brdf)
    monkeypatch.setattr(import_module("shrm_cli.reference"), "_ADAPTIVE_SIZES", (32, 32))
    monkeypatch.setattr(type(brdf), "transfer", counted)
    truth.radiance(normals, [0, 0, 1])
    assert sum(seen) / 256 < 0.06 * 2 * ROWS**2


@pytest.mark.parametrize(("widths", "nodes"), [(0.3, 10), (1.3, 3)])
def test_pixels_are_cut_for_those_points_that_need_it(made, widths, nodes):
    """All of them near a core that may hide in one, else those over which the lobe is bent.

    A core of .3 of half of a pixel takes ten nodes along it, which are five of each of its halves.
    """
    pyramid = Pyramid.of(made["noise"], None, np.float64)  # the cosines of so narrow a lobe
    level, above = pyramid.levels[:2]
    width = widths * np.pi / (2 * ROWS)
    angles = 0.6 * np.arange(8) + 0.3
    centers = np.stack([np.cos(angles), np.zeros(8), np.sin(angles)], axis=-1)
    sizes = []

    def evaluate(cosines, which):
        sizes.append(cosines[0, 0].size)
        values = 0.5 ** ((1 - cosines[:, 0]) * 2 / width**2)  # half of the peak at the width
        return np.broadcast_to(values[..., None], (*values.shape, 3))

    points = adaptive.Points(
        centers[None], evaluate, [], centers, (width, 0.2), np.zeros(8, np.float32)
    )
    parents = np.flatnonzero((above.directions @ centers.T).max(axis=1) > np.cos(0.25))
    cells = adaptive.quarters(parents)
    directions, light = level.directions[cells], level.light[cells]
    values, weights = points.transfer(directions), light @ LUMINANCE
    coarse = points.transfer(above.directions[parents])
    sizes.clear()
    found = points.of_pixels(level, cells, values, coarse, weights, values[0] @ weights)
    near = directions @ centers.T
    own = near > np.cos(0.2) if widths < 0.5 else near > np.cos(3.5 * width)
    assert nodes**2 * own.sum() < sum(sizes) < 1.6 * nodes**2 * own.sum()
    everywhere, sides = np.ones((8, len(cells)), dtype=bool), adaptive.pixel_sides(level, cells)
    truth = points._over_pixels(everywhere, directions, sides, light, 6)
    np.testing.assert_allclose(found, truth, rtol=5e-3)


def test_wide_terms_are_not_evaluated_as_finely_as_narrow_ones(made, pairs):
    """The base under a coat is summed apart from it, and both together are right."""
    coated = parse_spec("coated:roughness=0.2,base=(ggx:roughness=0.7)")
    (_, narrow), (_, wide) = coated.terms
    counts = {"narrow": 0, "wide": 0}

    def count(term, name):
        evaluate = term.evaluate

        def counted(light, view):
            counts[name] += light.size // 3
            return evaluate(light, view)

        term.evaluate = counted

    for term, name in ((narrow, "narrow"), (wide, "wide")):
        count(term, name)
    some, calls = (pairs[0][:FEW], pairs[1]), []
    truth = Reference(made["lamps"], coated, progress=lambda *call: calls.append(call))
    counts.update(narrow=0, wide=0)
    found = truth.radiance(*some) @ LUMINANCE
    assert 0 < counts["wide"] < counts["narrow"] / 2
    assert calls == sorted(calls)
    assert calls[-1] == (2 * FEW, 2 * FEW)
    expected = Reference(made["lamps"], coated, exact=True).radiance(*some) @ LUMINANCE
    errors = np.abs(found - expected) / np.maximum(expected, SEEN_FLOOR * expected.mean())
    assert np.percentile(errors, 95) < min(0.01, truth.error)


def test_truncated_lobes_and_means_over_the_azimuth(made, pairs):
    normals, view = pairs[0][: 2 * FEW], pairs[1]
    brdf = parse_spec("microfacet:sigma=0.2")
    for tolerance in (None, 0.05):
        adaptive, exact = (
            Reference(made["sun"], brdf, tolerance=tolerance, exact=exact)
            for exact in (False, True)
        )
        for call in (
            lambda made: made.radiance(normals, view),
            lambda made: made.zonal_radiance(normals, 0.7),
            lambda made: made.central_radiance(normals, view),
        ):
            found, expected = (call(each) @ LUMINANCE for each in (adaptive, exact))
            errors = np.abs(found - expected) / np.maximum(expected, 0.02 * expected.mean())
            assert np.percentile(errors, 95) < min(0.01, adaptive.error)


def test_brushed_surfaces(made, pairs):
    normals, view = pairs
    tangents = np.cross(normals, [0.6, 0.0, 0.8])
    tangents /= np.linalg.norm(tangents, axis=1)[:, None]
    for spec in ("ward:ax=0.4,ay=0.1", "kajiya-kay"):
        adaptive, exact = (
            Reference(made["studio"], parse_spec(spec), exact=exact) for exact in (False, True)
        )
        found, expected = (
            each.brushed_radiance(normals, tangents, view) @ LUMINANCE for each in (adaptive, exact)
        )
        errors = np.abs(found - expected) / np.maximum(expected, 0.02 * expected.mean())
        assert np.percentile(errors, 95) < min(0.01, adaptive.error)


def test_threads_change_nothing_at_all(made, pairs):
    truth = Reference(made["lamps"], parse_spec("ggx:roughness=0.3"))
    results = []
    for count in (1, 2, 5):
        with settings.using(threads=count):
            results.append(truth.radiance(*pairs))
    np.testing.assert_array_equal(results[1], results[0])
    np.testing.assert_array_equal(results[2], results[0])


def test_narrow_rings_and_small_probes_are_summed_in_full(made):
    """Fibres reflect in a cone all around the tangent: all of it would be cut to pixels."""
    fibres = Reference(made["sun"], parse_spec("kajiya-kay:exponent=10000"))
    assert isinstance(fibres.source, Source)
    assert fibres.error is None
    small = Reference(made["sun"], parse_spec("ggx"), 64)
    assert small.source.pixels == 64 * 128
    assert isinstance(small.source, Source)


def test_black_light(pairs):
    truth = Reference(as_probe(np.zeros((ROWS, 2 * ROWS, 3), np.float32)), parse_spec("ggx"))
    assert isinstance(truth.source, Pyramid)
    assert not truth.radiance(*pairs).any()
    assert truth.error == 0


def test_stated_error_follows_what_is_allowed(made, pairs, monkeypatch):
    """With a seventh of what may be left, less is left, and less is stated."""
    brdf = parse_spec("ggx:roughness=0.5")
    usual, stated = errors_of(made["noise"], brdf, pairs)
    monkeypatch.setattr(import_module("shrm_cli.adaptive"), "ALLOWED", 0.003)
    finer, less = errors_of(made["noise"], brdf, pairs)
    assert less < 0.4 * stated
    assert finer.mean() < 0.5 * usual.mean()
