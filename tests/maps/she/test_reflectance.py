"""Samples of reflected light against sums over the light's directions, with GGX written again."""

from functools import cache

import numpy as np
import pytest

from shrm_cli.maps.she.reflectance import sample_reflectance
from shrm_cli.probe.lighting import Lighting, project
from shrm_cli.probe.open import open_probe
from tests import ggx, oracles

RINGS = 4, 3, 1


def mirror_directions(normals, views):
    return 2 * np.sum(normals * views, axis=1, keepdims=True) * normals - views


def brute_force(samples, roughness, light, radiance, weights):
    """E_0, E_1 and the light around R, each (S, 3), by sums over all directions of light."""
    base, tail = ggx.reflected(roughness, samples.normals, samples.views, light, radiance)
    # The light around R: N = V = R, and divided by what a white light gives there.
    axes = mirror_directions(samples.normals, samples.views)
    with_white = np.concatenate([radiance, weights[:, None]], axis=1)
    around = ggx.reflected(roughness, axes, axes, light, with_white)[0]
    return base, tail, around[:, :3] / around[:, 3:]


def errors(samples, *arguments):
    """Relative RMS of each, for samples of one roughness."""
    found = *samples.reflected[0], samples.mirrored[0]
    return [
        np.linalg.norm(one - other) / np.linalg.norm(other)
        for one, other in zip(found, brute_force(samples, *arguments), strict=True)
    ]


def lit(coefficients, order=32):
    """Lighting of a probe that has nothing more, up to the order that prefiltering asks for."""
    padded = np.zeros(((order + 1) ** 2, 3))
    padded[: len(coefficients)] = coefficients
    return Lighting(padded, np.zeros(3))


@cache
def coarse(path):
    """A real probe's directions, radiance times solid angle, solid angles: 128 x 256 pixels.

    Each is a mean of 4 x 4 of the file's, in their mean direction.
    """
    image = open_probe(path).image().astype(float)
    height, width = image.shape[:2]
    edges = np.cos(np.pi * np.arange(height + 1) / height)
    weights = np.repeat((edges[:-1] - edges[1:])[:, None] * 2 * np.pi / width, width, axis=1)

    def blocks(values):
        return values.reshape(128, height // 128, 256, width // 256, -1).sum(axis=(1, 3))

    light = blocks(oracles.latlong_pixels(width, height) * weights[..., None])
    light /= np.linalg.norm(light, axis=-1, keepdims=True)
    radiance = blocks(image * weights[..., None])
    return light.reshape(-1, 3), radiance.reshape(-1, 3), blocks(weights).ravel()


@pytest.mark.parametrize(
    ("roughness", "bounds"),
    [(0.45, (1e-3, 3e-3, 1e-3)), (0.7, (1e-3, 3e-3, 1e-3)), (1.0, (1e-3, 3e-3, 2e-3))],
)
def test_light_of_few_frequencies_is_reflected_exactly(rng, roughness, bounds):
    """The harmonics of the light that there is are all that is needed of the lobe."""
    coefficients = rng.normal(size=(49, 3))
    samples = sample_reflectance(lit(coefficients), [roughness], *RINGS)
    light, weights = oracles.sphere_rule(140)
    radiance = oracles.real_harmonics(6, light) @ coefficients * weights[:, None]
    for found, bound in zip(
        errors(samples, roughness, light, radiance, weights), bounds, strict=True
    ):
        assert found < bound


@pytest.mark.parametrize(
    ("name", "roughness", "bounds"),
    [
        ("forest", 0.45, (0.004, 0.015, 0.001)),
        ("forest", 0.6, (0.002, 0.007, 0.001)),
        ("forest", 1.0, (0.003, 0.015, 0.001)),
        # A sun, which order 32 smears: most where the lobe is sharpest, at grazing views, and
        # the tail is made of these.
        ("city", 0.45, (0.05, 0.4, 0.005)),
        ("city", 0.8, (0.01, 0.18, 0.004)),
    ],
)
def test_real_light_is_reflected_up_to_its_truncation(real_probes, name, roughness, bounds):
    path = real_probes / f"{name}.exr"
    samples = sample_reflectance(project(open_probe(path), 32), [roughness], *RINGS)
    for found, bound in zip(errors(samples, roughness, *coarse(path)), bounds, strict=True):
        assert found < bound


def test_errors_of_real_light_fall_with_its_order(real_probes):
    path = real_probes / "city.exr"
    light = project(open_probe(path), 64).coefficients
    known = coarse(path)
    samples = [
        sample_reflectance(lit(light[: (order + 1) ** 2], 64), [0.45], *RINGS)
        for order in (8, 16, 32, 64)
    ]
    base = brute_force(samples[0], 0.45, *known)[0]
    found = [np.linalg.norm(each.reflected[0, 0] - base) for each in samples]
    assert np.all(np.array(found[:-1]) > 1.8 * np.array(found[1:])), found


def test_constant_light_is_reflected_by_the_albedo(rng):
    colour = np.array([0.5, 1.0, 2.0])
    coefficients = np.zeros((9, 3))
    coefficients[0] = colour * np.sqrt(4 * np.pi)
    samples = sample_reflectance(lit(coefficients), [0.5, 0.9], *RINGS)
    assert samples.mirrored == pytest.approx(np.broadcast_to(colour, samples.mirrored.shape))
    cosines = np.sum(samples.normals * samples.views, axis=1)
    for k in rng.choice(len(cosines), 5, replace=False):
        for at, roughness in enumerate(samples.roughness):
            albedo = ggx.moments(roughness, cosines[k], 300, 300)[:, 0]
            expected = albedo[:, None] * colour
            assert samples.reflected[at, :, k] == pytest.approx(expected, abs=2e-3)


def test_several_roughnesses_are_each_one_alone(rng):
    light = lit(rng.normal(size=(25, 3)))
    both = sample_reflectance(light, [0.4, 0.8], *RINGS)
    assert both.roughness == (0.4, 0.8)
    for at, roughness in enumerate(both.roughness):
        alone = sample_reflectance(light, [roughness], *RINGS)
        np.testing.assert_array_equal(alone.normals, both.normals)
        np.testing.assert_allclose(alone.reflected[0], both.reflected[at], rtol=0, atol=1e-12)
        np.testing.assert_allclose(alone.mirrored[0], both.mirrored[at], rtol=0, atol=1e-12)


@pytest.mark.parametrize("rings", [(4, 3, 1), (8, 6, 1), (6, 4, 5)])
def test_pairs_fill_both_spheres(rings):
    samples = sample_reflectance(lit(np.ones((4, 3))), [0.6], *rings)
    count = rings[0] * (3 * rings[0] // 2) * rings[1] * rings[2]
    assert samples.normals.shape == samples.views.shape == (count, 3)
    assert samples.reflected.shape == (1, 2, count, 3)
    assert samples.mirrored.shape == (1, count, 3)
    assert samples.weights.sum() == pytest.approx(1, abs=1e-14)
    assert samples.weights.min() > 0
    assert np.all(np.sum(samples.normals * samples.views, axis=1) > 0)
    mirrors = mirror_directions(samples.normals, samples.views)
    # Exact in R to the degree that the directions on a ring resolve.
    harmonics = oracles.real_harmonics(3 * rings[0] // 2 - 1, mirrors)[:, 1:]
    assert np.abs(samples.weights @ harmonics).max() < 1e-13
    # And in the angle between both, to the degree of Gauss's rule.
    cosines = np.sum(mirrors * samples.views, axis=1)
    for degree in range(1, 2 * rings[1]):
        legendre = np.polynomial.legendre.Legendre.basis(degree)(cosines)
        assert abs(samples.weights @ legendre) < 1e-13


def test_views_are_even_over_the_sphere():
    """Exactly where they run around each R; nearly, with one on each ring, by golden turns."""
    around = sample_reflectance(lit(np.ones((4, 3))), [0.6], 6, 4, 5)
    harmonics = oracles.real_harmonics(4, around.views)[:, 1:]
    assert np.abs(around.weights @ harmonics).max() < 1e-13
    single = sample_reflectance(lit(np.ones((4, 3))), [0.6], 8, 6, 1)
    harmonics = oracles.real_harmonics(6, single.views)[:, 1:]
    # As many random ones of equal weight have a deviation of 0.28 / sqrt(576) = 0.012.
    assert np.sqrt(np.mean((single.weights @ harmonics) ** 2)) < 0.012
    assert np.abs(single.weights @ harmonics).max() < 0.03


def test_no_two_pairs_are_alike():
    samples = sample_reflectance(lit(np.ones((4, 3))), [0.6], 8, 6, 1)
    pairs = np.round(np.concatenate([samples.normals, samples.views], axis=1), 6)
    assert len(np.unique(pairs, axis=0)) == len(pairs)
