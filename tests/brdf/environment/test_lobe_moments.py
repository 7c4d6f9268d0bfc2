"""Moments of GGX's lobe against sums over a million directions of light, written out again."""

import numpy as np
import pytest

from shrm_cli.brdf.environment.environment_brdf import (
    LobeMoments,
    lobe_moments,
    mean_vectors,
    whole_lobe,
)
from shrm_cli.errors import MapError
from tests import ggx
from tests.brute_force import unit
from tests.makers import environment_brdf

GRAZING, ALONG = 0.02, 1.0


@pytest.mark.parametrize(
    ("roughness", "cosines"),
    [
        (0.05, [GRAZING, 0.6]),
        (0.3, [GRAZING, 0.35]),
        (1.0, [GRAZING, 0.4, ALONG]),
    ],
)
@pytest.mark.slow
def test_they_are_sums_of_a_million_samples(roughness, cosines):
    found = lobe_moments(roughness, cosines)
    assert found.shape == (2, 3, len(cosines))
    for k, cosine in enumerate(cosines):
        expected = ggx.moments(roughness, cosine)
        assert np.abs(found[..., k] - expected).max() < 1e-5, cosine


@pytest.mark.parametrize("roughness", [0.0, 0.03, 0.2, 0.7, 1.0])
def test_the_first_ones_are_the_environment_brdf(roughness):
    cosines = np.concatenate([[1e-5, 1e-3], np.linspace(0.02, 1, 9)])
    base, tail = lobe_moments(roughness, cosines)[:, 0]
    scale, bias = environment_brdf(roughness, cosines)
    np.testing.assert_allclose(base, scale + bias, rtol=0, atol=1e-12)
    np.testing.assert_allclose(tail, bias, rtol=0, atol=1e-12)


def test_roughness_1_seen_along_the_normal_has_a_closed_form():
    """D is 1 / pi, and the integral ``2 pi / pi * c / (2 (c + 1))`` times 1 and c, over c = N.L."""
    base = lobe_moments(1.0, [1.0])[0, :, 0]
    assert base == pytest.approx([1 - np.log(2), np.log(2) - 0.5, 0.0], abs=1e-9)


def test_a_mirror_is_the_limit_of_smooth_surfaces():
    cosines = np.linspace(0.1, 1, 10)
    mirror = np.stack([np.ones(10), cosines, np.sqrt(1 - cosines**2)])
    mirror = np.stack([mirror, mirror * (1 - cosines) ** 5])
    for roughness, tolerance in [(0.0, 1e-14), (1e-6, 1e-6), (0.01, 1e-4), (0.03, 3e-4)]:
        np.testing.assert_allclose(lobe_moments(roughness, cosines), mirror, rtol=0, atol=tolerance)


def test_views_from_below_count_as_grazing():
    grazing = lobe_moments(0.4, [1e-5])
    below = lobe_moments(0.4, [-0.3, 0.0])
    assert below == pytest.approx(np.repeat(grazing, 2, axis=-1), rel=1e-12)
    assert np.array_equal(LobeMoments(0.4).at(-0.3), LobeMoments(0.4).at(0.0))


@pytest.mark.parametrize("roughness", [-0.1, 1.01, float("nan")])
def test_roughness_has_a_range(roughness):
    with pytest.raises(MapError, match=r"outside 0 \.\. 1"):
        lobe_moments(roughness, [0.5])
    with pytest.raises(MapError, match=r"outside 0 \.\. 1"):
        LobeMoments(roughness).at(0.5)


@pytest.mark.parametrize("roughness", [0, 0.02, 0.05, 0.1, 0.4, 1])
def test_the_table_of_one_roughness_is_fine_enough(rng, roughness):
    """Where V nears N too: T.L vanishes there like a square root."""
    cosines = np.concatenate([rng.uniform(0, 1, 300), 10 ** rng.uniform(-5, 0, 300)])
    cosines = np.concatenate([cosines, 1 - 10 ** rng.uniform(-9, -1, 198), [0.0, 1.0]])
    found = LobeMoments(roughness).at(cosines.reshape(20, 40))
    assert found.shape == (2, 3, 20, 40)
    expected = lobe_moments(roughness, cosines)
    assert np.abs(found.reshape(2, 3, -1) - expected).max() < 2e-5


@pytest.mark.parametrize("f0", [0.0, 0.04, 1.0])
def test_the_whole_lobe_has_schlicks_term(f0):
    """Summed again, with the term inside the integral."""
    roughness, cosine = 0.5, 0.2
    base, tail = ggx.moments(roughness, cosine)
    expected = f0 * (base - tail) + tail
    albedo, mean = whole_lobe(lobe_moments(roughness, [cosine, 0.7]), f0)
    assert (albedo.shape, mean.shape) == ((2,), (2, 2))
    assert albedo[0] == pytest.approx(expected[0], abs=1e-5)
    assert mean[:, 0] == pytest.approx(expected[1:] / expected[0], rel=1e-4)
    assert np.all(np.hypot(*mean) < 1)


def test_what_reflects_nothing_has_a_mean_all_the_same():
    """A mirror of f0 = 0 seen along its normal: its albedo is 0, and its mean that of a mirror."""
    albedo, mean = whole_lobe(lobe_moments(0.0, [1.0, 0.5]), 0.0)
    assert albedo == pytest.approx([0, 1 / 32], abs=1e-15)
    assert mean == pytest.approx(np.array([[1, 0.5], [0, np.sqrt(0.75)]]), abs=1e-12)


@pytest.mark.parametrize("roughness", [0.0, 0.02, 0.05, 0.3, 1.0])
@pytest.mark.parametrize("f0", [0.0, 0.04, 1.0])
def test_means_are_never_longer_than_1(roughness, f0):
    """Nor those from the table, where a smooth surface of f0 = 0 reflects next to nothing."""
    cosines = np.concatenate([np.linspace(0, 1, 2001), 1 - np.logspace(-12, -1, 500)])
    albedo, mean = whole_lobe(LobeMoments(roughness).at(cosines), f0)
    assert np.hypot(*mean).max() <= 1 + 1e-15
    assert albedo.min() >= 0


def test_mean_vectors_are_those_of_lights_in_the_world(rng):
    """Against sums of ``L f_DV N.L`` over directions of the world, for views in any azimuth."""
    light = unit(rng, 400_000)
    normals = unit(rng, 3)
    views = normals + 0.7 * unit(rng, 3)
    views /= np.linalg.norm(views, axis=1, keepdims=True)
    cosines = np.sum(normals * views, axis=1)
    for roughness in (0.6, 1.0):
        _, mean = whole_lobe(lobe_moments(roughness, cosines), 1.0)
        found = mean_vectors(mean, normals, views)
        for k in range(3):
            value, _ = ggx.lobe(roughness, normals[k], views[k], light)
            # Monte Carlo: a few thousandths of noise, and no two axes alike.
            assert found[k] == pytest.approx(value @ light / value.sum(), abs=0.01)


def test_mean_vectors_along_the_normal_and_at_grazing(rng):
    normals = unit(rng, 4)
    tangents = np.cross(normals, unit(rng, 4))
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    along = mean_vectors(np.array([[0.8] * 4, [0.0] * 4]), normals, normals)
    assert along == pytest.approx(0.8 * normals, abs=1e-15)
    grazing = mean_vectors(np.array([[0.1] * 4, [0.9] * 4]), normals, tangents)
    assert grazing == pytest.approx(0.1 * normals - 0.9 * tangents, abs=1e-12)


def test_mean_vectors_of_a_mirror_are_its_mirror_directions(rng):
    normals, views = unit(rng, 50), unit(rng, 50)
    views *= np.sign(np.sum(normals * views, axis=1, keepdims=True))
    cosines = np.sum(normals * views, axis=1, keepdims=True)
    moments = LobeMoments(0.0).at(cosines[:, 0])
    _, mean = whole_lobe(moments, 1.0)
    expected = 2 * cosines * normals - views
    assert mean_vectors(mean, normals, views) == pytest.approx(expected, abs=1e-5)
