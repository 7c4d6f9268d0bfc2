"""Neighbours on the sphere, against all pairs of points."""

import numpy as np
import pytest

from shrm_cli.lights.pixels import SpherePixels, clusters, near
from shrm_cli.sphere.grid.base import grid_class
from tests import oracles

GRIDS = {"latlong": (40, "center"), "cube": (20, "center"), "angular": (48, "center")}


@pytest.mark.parametrize("name", list(GRIDS))
def test_areas_add_up_and_directions_are_unit(name):
    pixels = SpherePixels(grid_class(name)(*GRIDS[name]))
    numbers = np.arange(np.prod(pixels.grid.shape))
    assert pixels.areas(numbers).sum() == pytest.approx(4 * np.pi, rel=1e-6)
    used = pixels.areas(numbers) > 0
    directions = pixels.directions(numbers)
    expected = pixels.grid.directions().reshape(-1, 3)
    np.testing.assert_allclose(directions[used], expected[used], atol=1e-6)


@pytest.mark.parametrize("name", list(GRIDS))
@pytest.mark.parametrize("radius", [0.05, 0.4, 2.0, np.pi])
def test_a_cap_has_all_its_pixels(rng, name, radius):
    pixels = SpherePixels(grid_class(name)(*GRIDS[name]))
    numbers = np.arange(np.prod(pixels.grid.shape))
    numbers = numbers[pixels.areas(numbers) > 0]
    directions = pixels.directions(numbers)
    for axis in (*oracles.random_directions(rng, 4), np.array([0, 1.0, 0]), np.array([0, 0, -1.0])):
        expected = numbers[np.linalg.norm(directions - axis, axis=1) <= 2 * np.sin(radius / 2)]
        assert set(expected) <= set(pixels.within(axis, radius))


def test_near_is_what_all_pairs_say(rng):
    points, others = oracles.random_directions(rng, 500), oracles.random_directions(rng, 300)
    gaps = np.linalg.norm(points[:, None] - others, axis=-1)
    for reach in (0.02, 0.1, 0.5):
        np.testing.assert_array_equal(near(points, others, reach), gaps.min(axis=1) <= reach)
    assert not near(points, others[:0], 0.1).any()


def test_clusters_join_what_touches(rng):
    """Points within the reach belong together; those of different lumps, far apart, do not."""
    lumps = np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, -1], [-0.6, 0, 0.8]])
    label = rng.integers(0, 4, 800)
    points = lumps[label] + rng.normal(scale=0.03, size=(800, 3))
    found = clusters(points, 0.1)
    assert len(set(found)) == 4
    assert all(len(set(found[label == k])) == 1 for k in range(4))
    chain = np.stack([np.linspace(-1, 1, 400), np.zeros(400), np.zeros(400)], axis=1)
    assert set(clusters(chain, 0.006)) == {0}
    assert len(set(clusters(chain[::10], 0.006))) == 40
