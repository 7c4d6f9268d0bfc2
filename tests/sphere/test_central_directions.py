"""Central directions and the way back to normals."""

import numpy as np
import pytest

from shrm_cli.sphere.directions import bisector, central_directions, horizontal_tangents
from tests import oracles
from tests.brute_force import unit


def test_central_directions(rng):
    normals, views = unit(rng, 20), unit(rng, 20)
    mirrored = 2 * np.sum(normals * views, axis=1, keepdims=True) * normals - views
    assert central_directions("reflection", normals, views) == pytest.approx(mirrored)
    assert central_directions("normal", normals, views) is normals
    tangents = central_directions("tangent", normals, views)
    assert np.abs(tangents[:, 1]).max() == 0
    assert np.abs(np.sum(tangents * normals, axis=1)).max() < 1e-15
    assert np.linalg.norm(tangents, axis=1) == pytest.approx(1)


def test_tangents_run_around_the_up_axis():
    """From +Z, seen from outside with +Y up, to the right, which is +X."""
    normals = np.array([[0, 0, 1], [1, 0, 0], [0, 0, -1], [0, 1, 0], [0, -1, 0.0]])
    expected = [[1, 0, 0], [0, 0, -1], [-1, 0, 0], [1, 0, 0], [1, 0, 0]]
    assert np.array_equal(horizontal_tangents(normals), expected)


@pytest.mark.parametrize("size", [3, 5])
@pytest.mark.parametrize("sampling", ["center", "border"])
@pytest.mark.parametrize("view", [[0, 0, 1], [1, 0, 0], [0, -1, 0], [0.6, 0, -0.8]])
def test_normals_mirror_the_view_into_the_reflection(view, sampling, size):
    """Some texels look straight away from a view on an axis: R = -V."""
    texels, view = oracles.cube_texels(size, sampling).reshape(-1, 3), np.array(view, dtype=float)
    normals = bisector(texels, view)
    assert np.linalg.norm(normals, axis=-1) == pytest.approx(1)
    cosine = np.sum(normals * view, axis=-1, keepdims=True)
    assert 2 * cosine * normals - view == pytest.approx(texels, abs=2e-6)
    grazing = np.linalg.norm(texels + view, axis=-1) < 1e-6
    assert np.abs(cosine[grazing]).max(initial=0) < 1e-12
    if 0 in view[:2] and sampling == "border" and abs(view).max() == 1:
        assert grazing.any()
