"""Cabral's maps: an icosahedron, its triangles, and areas by Girard's theorem."""

from itertools import combinations

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from shrm_cli.maps.explicit.views import TRIANGLES, VERTICES, Cabral
from tests import oracles
from tests.brute_force import unit
from tests.maps.scenes import girard, make_shrm, normals_of, rms

VIEWS = unit(np.random.default_rng(11), 500)
FACES = [tuple(sorted(face)) for face in ConvexHull(VERTICES).simplices]
EDGES = sorted({pair for face in FACES for pair in combinations(face, 2)})
CENTER = np.array([0.0, 0.0, 1.0])


def dense(views):
    """Weights of all twelve images, shape (..., 12)."""
    indices, weights = Cabral.blend(CENTER, views, 12)
    return np.sum(np.eye(12)[indices] * weights[..., None], axis=-2)


def hit(view):
    """The face that a ray from the middle goes through (Moeller and Trumbore 1997)."""
    hits = []
    for face in FACES:
        a, b, c = VERTICES[list(face)]
        across = np.cross(view, c - a)
        scale = across @ (b - a)
        u = -(across @ a) / scale
        along = np.cross(-a, b - a)
        v = (along @ view) / scale
        if (along @ (c - a)) / scale > 0 and min(u, v, 1 - u - v) >= 0:
            hits.append(face)
    assert len(hits) == 1
    return hits[0]


def test_vertices_are_those_of_an_icosahedron():
    np.testing.assert_allclose(np.linalg.norm(VERTICES, axis=1), 1, atol=1e-15)
    cosines = VERTICES @ VERTICES.T
    for row in cosines:
        expected = [-1] + 5 * [-1 / np.sqrt(5)] + 5 * [1 / np.sqrt(5)] + [1]
        np.testing.assert_allclose(np.sort(row), expected, atol=1e-15)
    np.testing.assert_array_equal(Cabral.sample_views(12), VERTICES)


def test_triangles_are_the_faces_of_the_hull():
    assert TRIANGLES.shape == (20, 3)
    assert sorted(tuple(sorted(face)) for face in TRIANGLES) == sorted(FACES)
    assert len(EDGES) == 30
    for a, b in EDGES:
        assert VERTICES[a] @ VERTICES[b] == pytest.approx(1 / np.sqrt(5), abs=1e-15)
    for a, b, c in VERTICES[TRIANGLES]:  # counter-clockwise from outside
        assert np.cross(b - a, c - a) @ (a + b + c) > 0


def test_weights_are_those_of_a_mean():
    for views in (VIEWS, VERTICES, -VERTICES, VERTICES[TRIANGLES].sum(axis=1)):
        indices, weights = Cabral.blend(CENTER, views, 12)
        assert indices.shape == weights.shape == (len(views), 3)
        assert weights.min() >= 0
        np.testing.assert_allclose(weights.sum(axis=-1), 1, atol=1e-15)


@pytest.mark.slow
def test_the_triangle_is_the_one_of_the_view():
    indices, _ = Cabral.blend(CENTER, VIEWS, 12)
    assert [tuple(sorted(face)) for face in indices] == [hit(view) for view in VIEWS]


@pytest.mark.slow
@pytest.mark.proof
def test_weights_are_ratios_of_areas():
    expected = np.zeros((len(VIEWS), 12))
    for row, view in zip(expected, VIEWS, strict=True):
        face = list(hit(view))
        for k in range(3):
            b, c = (VERTICES[face[(k + j) % 3]] for j in (1, 2))
            row[face[k]] = girard(view, b, c) / girard(*VERTICES[face])
    np.testing.assert_allclose(dense(VIEWS), expected, atol=1e-12)


def test_a_vertex_has_its_own_image():
    np.testing.assert_allclose(dense(VERTICES), np.eye(12), atol=1e-12)


def test_the_middle_of_a_face_is_the_mean_of_its_corners():
    for face in FACES:
        middle = VERTICES[list(face)].sum(axis=0)
        expected = np.isin(np.arange(12), face) / 3
        np.testing.assert_allclose(dense(middle / np.linalg.norm(middle)), expected, atol=1e-12)


@pytest.mark.parametrize("share", [0.0, 0.02, 0.3, 0.5, 0.9])
def test_no_seam_at_the_edges(share):
    """On both sides of an edge the same weights, of its two ends alone."""
    for a, b in EDGES:
        on = (1 - share) * VERTICES[a] + share * VERTICES[b]
        across = np.cross(VERTICES[a], VERTICES[b])
        sides = np.stack([on - 1e-10 * across, on, on + 1e-10 * across])
        sides /= np.linalg.norm(sides, axis=-1, keepdims=True)
        weights = dense(sides)
        assert np.abs(weights - weights[1]).max() < 1e-8
        ends = [a, b]
        assert np.delete(weights, ends, axis=1).max() < 1e-8
        if share == 0.5:
            np.testing.assert_allclose(weights[:, ends], 0.5, atol=1e-8)


def test_equal_views_reflect_what_their_triangle_does():
    """Radiance for a view each is the mean, by areas, of that of three distant views."""
    shrm = make_shrm(size=8)
    made = Cabral.from_shrm(shrm)
    rng = np.random.default_rng(12)
    texels = oracles.cube_texels(8).reshape(-1, 3)
    chosen = rng.permutation(len(texels))[:60]
    views = unit(rng, 60)
    coefficients = shrm.coefficients.reshape(len(texels), 9, 3)
    expected = np.zeros((60, 3))
    for value, texel, view in zip(expected, chosen, views, strict=True):
        face = list(hit(view))
        for k in range(3):
            b, c = (VERTICES[face[(k + j) % 3]] for j in (1, 2))
            weight = girard(view, b, c) / girard(*VERTICES[face])
            harmonics = oracles.real_harmonics(2, VERTICES[face[k]])
            value += weight * harmonics @ coefficients[texel]
    found = made.radiance(normals_of(texels[chosen], views), views)
    np.testing.assert_allclose(found, expected, atol=1e-11 * rms(expected))
