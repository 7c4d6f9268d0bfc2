"""Sums of cores over a lat-long against sums over all of its pixels, direction by direction."""

import numpy as np
import pytest
from scipy.special import betainc

from shrm_cli.brdf.environment.lobe import GgxLobe
from shrm_cli.maps.splitsum.core import LobeCore, sum_core
from shrm_cli.progress import using
from shrm_cli.sphere.cube import cube_directions
from tests.brute_force import unit
from tests.maps.splitsum.test_split_sum import latlong_pixels, normalised_lobe


def noise_with_a_sun(height):
    image = np.random.default_rng(5).uniform(0, 2, (height, 2 * height, 3))
    image[height // 3, height // 5] = 1e4
    image[0, 3] = 1e3  # beside the pole
    return image


def expected_sums(image, roughness, angle, directions):
    where, light = latlong_pixels(image)
    result = np.empty((len(directions), 3))
    for k, direction in enumerate(directions):
        square = np.sum((where - direction) ** 2, axis=1) / 4
        x = np.sqrt(square) / np.sin(angle / 2)
        near = x < 1
        lobe = normalised_lobe(roughness, 1 - 2 * square[near], square[near])
        result[k] = (lobe * (1 - betainc(8, 4, x[near]))) @ light[near]
    return result


def light_of(image):
    return latlong_pixels(image)[1].reshape(image.shape)


@pytest.mark.parametrize(
    ("roughness", "degrees", "height"),
    [(0.05, 3.7, 128), (0.1, 6.0, 64), (0.3, 80.0, 16), (0.4, 89.0, 2)],
)
@pytest.mark.parametrize(("size", "sampling"), [(6, "center"), (7, "center"), (8, "border")])
def test_every_texel_of_a_cube(roughness, degrees, height, size, sampling):
    """Edges and corners, poles and texels on planes of symmetry among them."""
    image = noise_with_a_sun(height)
    core = LobeCore(GgxLobe(roughness=roughness), np.radians(degrees))
    directions = cube_directions(size, sampling)
    found = sum_core(core, light_of(image), directions)
    assert found.shape == directions.shape
    expected = expected_sums(image, roughness, core.angle, directions.reshape(-1, 3))
    scale = np.abs(expected).max(axis=-1, keepdims=True) + expected.mean()
    assert np.abs((found.reshape(-1, 3) - expected) / scale).max() < 1e-5


def test_directions_anywhere(rng):
    """Those of no cube, beside both poles and the seam; the sun is in the lobes of some."""
    image = noise_with_a_sun(64)
    pole = np.array([0.0, 1.0, 0.0])
    sun = latlong_pixels(image)[0].reshape(64, 128, 3)[21, 12]
    seam = np.array([[1e-9, 0.1, -1.0], [-1e-9, 0.1, -1.0], [0.0, -0.2, -1.0], [-0.03, 0.0, -1.0]])
    near = [center + 0.05 * unit(rng, 8) for center in (pole, -pole, sun)]
    directions = np.concatenate([unit(rng, 40), [pole, -pole, sun], seam, *near])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    core = LobeCore(GgxLobe(roughness=0.1), np.radians(6))
    found = sum_core(core, light_of(image), directions)
    expected = expected_sums(image, 0.1, core.angle, directions)
    scale = np.abs(expected).max(axis=-1, keepdims=True) + 1
    assert np.abs((found - expected) / scale).max() < 1e-5


def test_a_cube_is_folded_into_a_sixteenth_and_progress_ends(rng):
    told = []
    core = LobeCore(GgxLobe(roughness=0.1), 0.1)
    with using(lambda *at: told.append(at)):
        sum_core(core, light_of(noise_with_a_sun(32)), cube_directions(16))
    # A quarter of a side's texels, and half of a quarter of the top's with its diagonal.
    assert told[-1] == (64 + 36, 64 + 36)
    assert [done for done, _ in told] == sorted(done for done, _ in told)
