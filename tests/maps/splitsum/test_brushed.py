"""Brushed surfaces under split sums, against sums of the lobe over lights."""

import numpy as np
import pytest

from shrm_cli.brdf.environment.environment_brdf import lobe_moments
from shrm_cli.brdf.environment.taps import taps
from shrm_cli.maps.splitsum.roughness import blend, level_numbers, level_roughnesses
from shrm_cli.maps.splitsum.split_sum import BrushedSplitSum, equal_roughness
from shrm_cli.probe.probe import Probe
from shrm_cli.vocabulary import LEVEL_MAPPINGS, NO_TAPS, TAP_COUNTS
from tests import brushed_ggx
from tests.brute_force import unit
from tests.makers import prefilter_split_sum

LOCAL = np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 1]])
VIEWS = np.array([[0.48, 0.0, 0.877], [0.35, 0.4, 0.847], [0.1, -0.86, 0.5], [0.6, 0.52, 0.608]])
VIEWS /= np.linalg.norm(VIEWS, axis=1, keepdims=True)


def alphas_of(roughness, anisotropy):
    return roughness**2 + (1 - roughness**2) * anisotropy**2, roughness**2


@pytest.mark.parametrize("anisotropy", [0.3, 0.6, 0.9])
@pytest.mark.parametrize("count", TAP_COUNTS)
def test_taps_have_the_mean_direction_of_the_lobe(anisotropy, count):
    """An even lobe about the mirror direction is two to ten times as far from it."""
    alphas = alphas_of(0.5, anisotropy)
    light, _ = brushed_ggx.directions(300)
    distances = []
    for view in VIEWS:
        value, _ = brushed_ggx.lobe(alphas, LOCAL, view, light)
        mean = value @ light / value.sum()
        found = taps(alphas, view, count)
        assert found.weights.sum() == pytest.approx(1)
        # The mean of a tap's lobe is shorter than its axis, by as much as the level is wide.
        short = np.array([_length(each) for each in found.roughness])
        tapped = (found.weights * short) @ found.directions
        mirror = _length(0.5) * (2 * view[2] * LOCAL[2] - view)
        distances.append([np.linalg.norm(each - mean) for each in (tapped, mirror)])
    ours, even = np.sqrt(np.mean(np.square(distances), axis=0))
    assert ours < min(0.07, even / 2)


def _length(roughness):
    """The length of the mean direction of a level's lobe: that of an even surface that is seen
    along its normal.
    """
    light, _ = brushed_ggx.directions(200)
    value, _ = brushed_ggx.lobe((roughness**2,) * 2, LOCAL, LOCAL[2], light)
    return value @ light[:, 2] / value.sum()


@pytest.mark.parametrize(("roughness", "anisotropy"), [(0.5, 0.3), (0.5, 0.6), (0.7, 0.6)])
def test_an_even_surface_of_equal_roughness_reflects_as_much(roughness, anisotropy):
    alphas = alphas_of(roughness, anisotropy)
    light, part = brushed_ggx.directions(400)
    for view in VIEWS:
        value, tail = brushed_ggx.lobe(alphas, LOCAL, view, light)
        truth = value.sum() * part, value @ tail * part
        for kind, sort, known in zip(("total", "bias"), (0, 1), truth, strict=True):
            even = float(equal_roughness(kind, alphas, view))
            found = lobe_moments(even, view[2:])[sort, 0, 0]
            assert found == pytest.approx(known, abs=0.03 if kind == "total" else 0.005)


def test_moments_are_those_of_the_lobe_that_is_written_out():
    light, part = brushed_ggx.directions(400)
    value, tail = brushed_ggx.lobe((0.25, 0.25), LOCAL, VIEWS[1], light)
    known = [value.sum() * part, value @ tail * part]
    np.testing.assert_allclose(lobe_moments(0.5, VIEWS[1][2:])[:, 0, 0], known, atol=1e-3)


@pytest.fixture(scope="module")
def lit():
    """A probe of a few bright spots on a slope of grey, and its split sum."""
    rng = np.random.default_rng(5)
    spots = unit(rng, 12)
    rows = np.arange(64)
    y, phi = np.cos((rows + 0.5) / 64 * np.pi), np.pi - (np.arange(128) + 0.5) / 64 * np.pi
    sine = np.sqrt(1 - y**2)
    grid = np.stack(
        [
            sine[:, None] * np.sin(phi), np.broadcast_to(y[:, None], (64, 128)),
            sine[:, None] * np.cos(phi),
        ],
        axis=-1,
    )  # fmt: skip
    image = 0.3 + 0.2 * grid[..., 1:2] + np.zeros(3)
    for spot, color in zip(spots, rng.random((12, 3)) * 8, strict=True):
        image += np.exp((grid @ spot - 1) * 60)[..., None] * color
    image = image.astype(np.float32)
    probe = Probe.from_array(image, layout="latlong", name="spots")
    areas = np.repeat(np.sin((rows + 0.5) / 64 * np.pi) * np.pi**2 / 64**2, 128)
    return (
        prefilter_split_sum(probe).map,
        grid.reshape(-1, 3),
        image.reshape(-1, 3) * areas[:, None],
    )


F0 = np.array([0.9, 0.5, 0.1])


def surfaces():
    """Normals, tangents and views at generic angles, none grazing."""
    rng = np.random.default_rng(2)
    normals, views = unit(rng, 80), unit(rng, 80)
    views *= np.sign(np.sum(normals * views, axis=1))[:, None]
    keep = np.sum(normals * views, axis=1) > 0.1
    normals, views = normals[keep], views[keep]
    tangents = np.cross(normals, unit(rng, len(normals)))
    return normals, tangents / np.linalg.norm(tangents, axis=1, keepdims=True), views


def brute_force(lit, alphas, points):
    """What GGX of some alphas reflects: sums over the light's directions."""
    _, light, radiance = lit
    truth = np.empty(points[0].shape)
    for k, (n, t, v) in enumerate(zip(*points, strict=True)):
        value, tail = brushed_ggx.lobe(alphas, np.stack([t, np.cross(n, t), n]), v, light)
        truth[k] = F0 * (value @ radiance) + (1 - F0) * ((value * tail) @ radiance)
    return truth


def relative(found, truth):
    return np.sqrt(np.mean((found - truth) ** 2) / np.mean(truth**2))


@pytest.mark.parametrize(
    ("roughness", "anisotropy", "bars"),
    [(0.5, 0.3, (0.09, 0.08, 0.07)), (0.5, 0.6, (0.1, 0.08, 0.07)), (0.7, 0.9, (0.12, 0.12, 0.1))],
)
def test_taps_are_far_nearer_to_the_truth_than_an_even_surface(lit, roughness, anisotropy, bars):
    made, points = lit[0], surfaces()
    truth = brute_force(lit, alphas_of(roughness, anisotropy), points)
    even = made.shaded(roughness, F0, taps=NO_TAPS)
    ignored = relative(even.radiance(points[0], points[2]), truth)
    for count, bar in zip(TAP_COUNTS, bars, strict=True):
        shown = BrushedSplitSum(made, roughness, tuple(F0), anisotropy, count)
        assert relative(shown.brushed_radiance(*points), truth) < min(bar, ignored / 2)


@pytest.mark.parametrize(("roughness", "bar"), [(0.3, 0.08), (0.5, 0.055), (0.8, 0.045)])
def test_surfaces_that_are_not_brushed_are_looked_up_where_their_lobes_lie(lit, roughness, bar):
    made, points = lit[0], surfaces()
    truth = brute_force(lit, alphas_of(roughness, 0), points)
    engine, found = (
        relative(made.shaded(roughness, F0, taps=taps).radiance(points[0], points[2]), truth)
        for taps in (NO_TAPS, None)
    )
    assert found < min(bar, engine / 2)


def test_tangents_run_around_the_vertical_by_default(lit):
    shown = BrushedSplitSum(lit[0], 0.5, (1.0, 1.0, 1.0), 0.6)
    normal, view = np.array([0.6, 0.0, 0.8]), np.array([0.0, 0.0, 1.0])
    around = np.array([0.8, 0.0, -0.6])
    found = shown.radiance(normal, view)
    np.testing.assert_allclose(found, shown.brushed_radiance(normal, around, view))
    assert np.abs(found / shown.brushed_radiance(normal, [0.0, 1.0, 0.0], view) - 1).max() > 0.05


@pytest.mark.parametrize("mapping", LEVEL_MAPPINGS)
def test_many_roughnesses_are_mixed_as_one_is(mapping):
    levels = level_roughnesses(6, mapping)
    rough = np.array([[0.05, 0.3, 0.77], [0.9999, 1.0, levels[2]]])
    for found, each in zip(level_numbers(rough, levels, mapping).flat, rough.flat, strict=True):
        low, weight = blend(float(each), levels, mapping)
        assert found == pytest.approx(low + weight, abs=1e-12)
