"""Points of smooth surfaces above coarse triangles, beside surfaces of which a formula is known."""

import numpy as np
import pytest

from shrm_cli.geometry.mesh import make_mesh, smooth_points
from tests.transfer import meshes


def strewn(mesh, rng, count=4000):
    """Points of a mesh: triangles, barycentric weights, places and smooth normals."""
    faces, weights = rng.integers(len(mesh.faces), size=count), rng.dirichlet(np.ones(3), count)
    normals = mesh.interpolated(mesh.normals, faces, weights)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return faces, weights, mesh.interpolated(mesh.vertices, faces, weights), normals


@pytest.mark.parametrize("side", [1, -1])
def test_points_of_a_coarse_ball_lie_on_the_ball(rng, side):
    """From outside; from inside, where the ball is behind the triangles, they stay where they are.

    Points that are moved above the ball look over what shadows them.
    """
    mesh = meshes.sphere(2)
    faces, weights, places, normals = strewn(mesh, rng)
    moved = smooth_points(mesh, faces, weights, side * normals)
    if side < 0:
        np.testing.assert_array_equal(moved, places)
        return
    depth = 1 - np.linalg.norm(places, axis=1)
    assert depth.max() > 0.01
    np.testing.assert_allclose(np.linalg.norm(moved, axis=1), 1, atol=0.03 * depth.max())


def test_points_of_waves_are_not_lifted_above_them(rng):
    """Of ``z = 0.2 sin 2x``, which turns from convex to concave."""
    x, y = np.meshgrid(np.linspace(0, 2 * np.pi, 22), np.linspace(0, 1, 4), indexing="ij")
    index = np.arange(x.size).reshape(x.shape)
    a, b, c, d = (each.ravel() for each in (index[:-1, :-1], index[1:, :-1], index[1:, 1:],
                                            index[:-1, 1:]))  # fmt: skip
    normals = np.stack([-0.4 * np.cos(2 * x), 0 * x, 1 + 0 * x], axis=-1)
    mesh = make_mesh(
        "waves", np.stack([x, y, 0.2 * np.sin(2 * x)], -1).reshape(-1, 3),
        np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]), normals.reshape(-1, 3),
    )  # fmt: skip
    faces, weights, places, smooth = strewn(mesh, rng)
    moved = smooth_points(mesh, faces, weights, smooth)
    before = places[:, 2] - 0.2 * np.sin(2 * places[:, 0])
    after = moved[:, 2] - 0.2 * np.sin(2 * moved[:, 0])
    above = np.maximum(before, 0)  # where the surface is concave, triangles lie above it
    assert np.max(after - above) < 0.1 * -before.min()
    assert np.sqrt(np.mean(np.minimum(after, 0) ** 2)) < 0.1 * np.sqrt(np.mean(before**2))
