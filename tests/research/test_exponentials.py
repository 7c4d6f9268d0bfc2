"""Tests of what `make tables` says of SH exponentials, on few of its cases, and of its tools."""

import numpy as np
import pytest

from research import exponentials
from research.glossy_truth import Light, Sphere, light_of, mirror_means, reflect, sphere
from research.irradiance import latlong_pixels
from research.page_engines import exponentials as exponentials_page
from research.split_sum import ROUGHNESSES as LEVELS
from research.split_sum import (
    PaperSplitSum,
    octahedral_corners,
    octahedral_directions,
    prefilter,
    source_of,
)
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.probe.open import open_probe
from shrm_cli.reference import Reference
from shrm_cli.sphere.quadrature import spiral_directions
from tests.conftest import ROOT

PROBES = "forest", "studio", "sunrise"
ROUGHNESSES = 0.5, 0.6, 0.75, 1.0
FRONT = (0, 0, 1)


@pytest.fixture(scope="module")
def scene(real_probes):
    probes = [open_probe(real_probes / f"{name}.exr") for name in PROBES]
    return exponentials.Scene.of(probes, ROUGHNESSES, [sphere(FRONT, 16), sphere((-1, 0, 0), 16)])


def test_our_fit_wins_against_the_exact_split_sum(scene):
    ours = scene.errors(exponentials.exponentials(scene))
    exact = scene.errors(exponentials.exact_split_sum(scene))
    contest = exponentials.Contest.of("default", ours, exact)
    assert contest.front.shape == (2, len(ROUGHNESSES), len(PROBES))
    for ratios in (contest.front, contest.six):
        assert exponentials.share(ratios) >= 0.75
        assert exponentials.geometric_mean(ratios) <= 0.55


def test_exponentials_of_all_probes_at_once_are_those_of_each(scene):
    found = exponentials.exponentials(scene)(1, 0.04)
    single = exponentials.fitted(scene.probes[2]).shaded(ROUGHNESSES[1], (0.04,) * 3)
    expected = single.radiance(scene.normals, scene.views)
    np.testing.assert_allclose(found[:, 6:], expected, rtol=1e-9)


@pytest.mark.slow
def test_every_split_sum_reflects_a_uniform_light_exactly():
    furnace = open_probe(ROOT / "probes" / "furnace.exr")
    uniform = exponentials.Scene.of([furnace], ROUGHNESSES, [sphere(FRONT, 12)])
    methods = [exponentials.exact_split_sum(uniform)]
    methods += [exponentials.paper_split_sum(uniform, filtered) for filtered in (False, True)]
    for f0 in exponentials.F0:
        for k in range(len(ROUGHNESSES)):
            for method in methods:
                np.testing.assert_allclose(method(k, f0), uniform.exact(k, f0), rtol=5e-3)


def test_page_says_what_the_results_are():
    ratios = np.full((2, len(ROUGHNESSES), 3), 0.5)
    ratios[0, 0, 0] = 0.25
    contest = exponentials.Contest("default", ratios, 1 / ratios)
    results = exponentials.Results(
        PROBES, ROUGHNESSES, (contest,) * 2, (contest,), (contest,) * 3, contest
    )
    page = exponentials_page(results, "picture.png", PROBES)
    assert "| studio | 100%, 0.50 | 0%, 2.00 |" in page
    words = " ".join(page.split())
    assert f"4 alphas r^2, r evenly from 0.5 to 1; {ratios.size} cases" in words
    assert "100.0% of the cases from the front and 0.0% of those with six pictures" in words
    assert max(len(line) for line in page.split("\n") if not line.startswith(("|", "!"))) <= 100


@pytest.fixture(scope="module")
def shipped():
    return open_probe(ROOT / "probes" / "studio.exr")


@pytest.mark.parametrize("f0", [1.0, 0.04])
def test_truth_is_that_of_another_integration(shipped, f0):
    ball = sphere((0.48, 0.6, 0.64), 8)
    base, tail = reflect(ball, light_of([shipped]), [0.25])[:, 0]
    reference = Reference(shipped, parse_spec(f"ggx:roughness=0.5,f0={f0}"), 128, exact=True)
    expected = reference.radiance(ball.normals, ball.views)
    np.testing.assert_allclose(f0 * base + (1 - f0) * tail, expected, rtol=2e-3)


def test_mirror_means_are_reflections_seen_along_the_normal(shipped):
    light = light_of([shipped])
    directions = spiral_directions(20)
    uniform = Light(light.directions, np.repeat(latlong_pixels(128)[1], 256)[:, None])
    ball = Sphere(directions, directions, np.ones((1, 20), bool))
    expected = reflect(ball, light, [0.3])[0, 0] / reflect(ball, uniform, [0.3])[0, 0]
    np.testing.assert_allclose(mirror_means(directions, light, [0.3])[0], expected, rtol=2e-3)


@pytest.mark.parametrize("filtered", [False, True])
def test_samples_of_the_papers_split_sum_have_the_mean_of_their_lobe(filtered):
    """The mean of light 1 + a.L over a lobe D N.L is 1 + c a.N, with c the lobe's mean cosine."""
    alpha, axis = 0.5, np.array([0.2, -0.3, 0.6])
    directions, _ = latlong_pixels(64)
    source = source_of([np.repeat(1 + directions @ axis[:, None], 3, axis=-1)])
    cosines = (np.arange(4000) + 0.5) / 4000
    lobe = cosines / (1 - (1 - alpha**2) * (1 + cosines) / 2) ** 2
    kept = (lobe @ cosines) / lobe.sum()
    normals = np.concatenate([spiral_directions(60), np.eye(3), -np.eye(3)])
    found = prefilter(source, normals, alpha, filtered)
    np.testing.assert_allclose(found[:, 0], 1 + kept * (normals @ axis), atol=5e-3)


def test_levels_of_the_papers_split_sum_are_mixed():
    directions, _ = latlong_pixels(32)
    source = source_of([1 + directions * [0.2, -0.3, 0.6]])
    wanted = spiral_directions(20)
    levels = [prefilter(source, wanted, roughness**2, True) for roughness in LEVELS[2:4]]
    roughness = 0.75 * LEVELS[2] + 0.25 * LEVELS[3]
    found = PaperSplitSum(source, wanted, True).at(roughness)
    np.testing.assert_allclose(found, 0.75 * levels[0] + 0.25 * levels[1], atol=0.01)
    # No level is as smooth as roughness 0.1, so the first level is taken.
    smooth = PaperSplitSum(source, wanted, True).at(0.1)
    np.testing.assert_allclose(smooth, prefilter(source, wanted, LEVELS[0] ** 2, True), atol=0.01)


def test_octahedral_maps_are_filtered_across_their_edges():
    """The weighted mean of the four texels is the direction itself, even at -Z and at the rim."""
    around = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    rim = np.stack([np.cos(around), np.sin(around), np.full(24, -1e-3)], axis=1)
    seams = np.concatenate([rim, [[0.01, 0.0, -1.0], [0, -1, -3], [2, 0, -1], [0, 0, 1]]])
    wanted = np.concatenate([spiral_directions(200), seams])
    wanted = wanted / np.linalg.norm(wanted, axis=1, keepdims=True)
    for size, tolerance in ((32, 0.04), (128, 0.01)):
        texels, weights = octahedral_corners(wanted, size)
        corners = octahedral_directions(texels.ravel(), size).reshape(-1, 4, 3)
        assert np.linalg.norm(corners - wanted[:, None], axis=-1).max() < 8 / size
        found = np.einsum("nkc,nk->nc", corners, weights)
        np.testing.assert_allclose(found, wanted, atol=tolerance)
