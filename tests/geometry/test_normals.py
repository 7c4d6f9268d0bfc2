"""Normals and tangents, and points of smooth surfaces beside those of which a formula is known."""

import numpy as np
import pytest

from shrm_cli.errors import MeshError
from shrm_cli.geometry.mesh import face_normals, make_mesh, smooth_normals, smooth_points
from shrm_cli.geometry.tangents import perpendicular
from shrm_cli.sphere.directions import horizontal_tangents
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


def test_slivers_have_a_normal_and_lines_have_none():
    """A billionth as high as long, and along a line but for rounding."""
    sliver = np.array([[0, 0, 0], [3, 0, 0], [1, 0, -3e-9]])
    line = np.array([0.1, 0.7, 0.3]) * np.array([[1], [2.3], [4.7]])
    faces = np.array([[0, 1, 2], [3, 4, 5]])
    found = face_normals(np.concatenate([sliver, line]), faces)
    np.testing.assert_allclose(found, [[0, 1, 0], [0, 0, 0]], atol=1e-12)


@pytest.mark.parametrize(("opened", "is_own"), [(0.0, True), (1e-7, False)])
def test_a_sheet_has_the_normals_of_its_sides_and_a_nearly_folded_one_their_mean(opened, is_own):
    """Two triangles that share an edge, and whose normals cancel but for the angle between them."""
    along, across = np.array([0.6, 0.48, 0.64]), np.array([0.8, -0.36, -0.48])
    up = np.cross(along, across)
    corners = np.stack([0 * along, along, across + opened * up, across - opened * up])
    found = smooth_normals(corners, np.array([[0, 1, 2], [1, 0, 3]]), corners)[:2]
    if is_own:
        np.testing.assert_allclose(np.abs(found @ up), 1, atol=1e-9)
    else:
        np.testing.assert_allclose(found, np.broadcast_to(-across, (2, 3)), atol=1e-6)


def test_short_normals_of_files_have_a_direction_and_those_of_rounding_none():
    corners, faces = np.eye(3), np.array([[0, 1, 2]])
    given = np.array([[1e-9, 0, 0], [1e-14, 0, 0], [0, 0, 0]])
    made = make_mesh("triangle", corners, faces, given)
    flat = np.full(3, 1 / np.sqrt(3))
    np.testing.assert_allclose(made.normals, [[1, 0, 0], flat, flat], atol=1e-12)


def test_meshes_may_be_flattened_a_billion_times_but_not_to_nothing():
    made = make_mesh("triangle", np.eye(3), np.array([[0, 1, 2]]))
    thin = made.transformed(np.diag([1, 1e-9, 1e-9, 1]))
    np.testing.assert_allclose(thin.normals, np.tile([0, 0.5, 0.5], (3, 1)) * np.sqrt(2), atol=1e-8)
    with pytest.raises(MeshError, match="flattens it"):
        made.transformed(np.diag([1, 1e-16, 1e-16, 1]))


def test_tangents_that_are_nearly_normals_have_a_direction_and_those_of_rounding_are_horizontal():
    normal, across = np.array([0.6, 0.48, 0.64]), np.array([0.8, -0.36, -0.48])
    near, same = normal + 1e-4 * across, normal + 1e-9 * across
    found = perpendicular(np.stack([near, same]), np.stack([normal, normal]))
    expected = np.stack([across, horizontal_tangents(normal)])
    np.testing.assert_allclose(found, expected, atol=1e-9)
