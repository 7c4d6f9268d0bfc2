"""The cells of a pyramid of lights against sums over the pixels of each."""

import numpy as np
import pytest

from shrm_cli.probe.open import as_probe
from shrm_cli.probe.source import Pyramid
from shrm_cli.vocabulary import LUMINANCE
from tests import brute_force
from tests.oracles import cube_texels


def directions_of(shape):
    if shape == "cube":
        return cube_texels(64).reshape(384, 64, 3)
    return brute_force.latlong_samples(100)[0].reshape(100, 200, 3)


@pytest.mark.proof
@pytest.mark.parametrize("shape", ["latlong", "cube"])
def test_cells_hold_the_light_of_their_pixels(shape):
    """Their centroids, spreads and radii too; 100 rows are no multiple of a cell."""
    expected = directions_of(shape)
    rng = np.random.default_rng(2)
    image = rng.uniform(0, 1, expected.shape) ** 8
    image[40:70, 10:30] = 0
    image[33, 12] = 900
    made = Pyramid.of(as_probe(image.astype(np.float32)), dtype=np.float64)
    assert made.pixels == image.shape[0] * image.shape[1]
    pixels = made.levels[0]
    lit = pixels.light.any(axis=1)
    assert lit.sum() == image.any(axis=-1).sum()
    # Every pixel is there once, in its direction.
    places = {tuple(np.round(each, 6)) for each in expected[image.any(axis=-1)]}
    assert {tuple(np.round(each, 6)) for each in pixels.directions[lit]} == places
    for count, level in enumerate(made.levels[1:], start=1):
        light = pixels.light.reshape(-1, 4**count, 3)
        members = pixels.directions.reshape(-1, 4**count, 3)
        np.testing.assert_allclose(level.light, light.sum(axis=1), atol=1e-12)
        weights = (light @ LUMINANCE)[..., None]
        moment = np.sum(weights * members, axis=1)
        for cell in np.flatnonzero(np.linalg.norm(moment, axis=1) > 1e-6):
            axis = moment[cell] / np.linalg.norm(moment[cell])
            chords = np.sum((members[cell] - axis) ** 2, axis=-1)
            np.testing.assert_allclose(level.directions[cell], axis, atol=1e-9)
            assert level.spread[cell] == pytest.approx(weights[cell, :, 0] @ chords, abs=1e-9)
            angle = 2 * np.arcsin(np.sqrt(chords.max()) / 2)
            assert level.radii[cell] == pytest.approx(angle, abs=1e-6)


def test_the_largest_cells_are_some_hundred():
    for height in (100, 128, 512):
        image = np.ones((height, 2 * height, 3), np.float32)
        assert 200 <= len(Pyramid.of(as_probe(image)).levels[-1].light) <= 1100
