"""Rays against all triangles one by one, and tangents against known parametrisations."""

import numpy as np
import pytest

from shrm_cli.errors import MeshError
from shrm_cli.geometry.mesh import joined, make_mesh
from shrm_cli.geometry.rays import Rays
from shrm_cli.geometry.tangents import projected_tangents, tangents_from_uvs
from shrm_cli.sphere.directions import horizontal_tangents
from tests.geometry.shapes import TETRAHEDRON, icosphere


def random_mesh(rng, count=60):
    return make_mesh("random", rng.normal(size=(count, 3)), rng.integers(0, count, (count, 3)))


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def brute_force(mesh, origin, direction):
    """The nearest triangle, its distance and point, by a 3 x 3 system for each triangle."""
    a, b, c = np.moveaxis(mesh.corners(np.arange(len(mesh.faces))), 1, 0)
    system = np.stack([b - a, c - a, np.broadcast_to(-direction, a.shape)], axis=-1)
    u, v, t = np.linalg.solve(system, (origin - a)[..., None])[..., 0].T
    t = np.where((u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0), t, np.inf)
    where = int(np.argmin(t))
    return (where, t[where]) if np.isfinite(t[where]) else (-1, np.inf)


@pytest.mark.parametrize("scale", [1e-6, 1, 1e6])
def test_rays_meet_what_brute_force_meets(rng, scale):
    mesh = random_mesh(rng)
    placed = mesh.transformed([[scale, 0, 0, 3 * scale], [0, scale, 0, 0], [0, 0, scale, 0]])
    origins = 3 * rng.normal(size=(300, 3))
    directions = unit(rng.normal(size=(300, 3)) - origins)
    shift = np.array([3, 0, 0])
    faces, weights, distance = Rays(placed).first_hits(scale * (origins + shift), directions)
    expected = [brute_force(mesh, o, d) for o, d in zip(origins, directions, strict=True)]
    known = np.array([face for face, _ in expected])
    # Single precision may decide otherwise on a ray that only grazes a triangle.
    same = faces == known
    assert same.mean() > 0.98
    assert (known >= 0).mean() > 0.4
    hit = same & (known >= 0)
    lengths = np.array([length for _, length in expected])
    np.testing.assert_allclose(distance[hit], scale * lengths[hit], rtol=1e-9)
    points = placed.interpolated(placed.vertices, faces[hit], weights[hit])
    reached = scale * (origins + shift)[hit] + distance[hit, None] * directions[hit]
    np.testing.assert_allclose(points, reached, atol=1e-9 * scale)
    assert np.isinf(distance[faces < 0]).all()
    assert (weights[faces < 0] == 0).all()


def test_rays_from_very_far_away_are_exact():
    mesh = make_mesh("sphere", *icosphere(3))
    rng = np.random.default_rng(1)
    targets = 0.9 * unit(rng.normal(size=(200, 3))) * rng.random((200, 1))
    origin = np.array([0, 0, 1e7])
    directions = unit(targets - origin)
    faces, weights, _ = Rays(mesh).first_hits(origin, directions)
    assert (faces >= 0).all()
    points = mesh.interpolated(mesh.vertices, faces, weights)
    off = points - targets
    across = off - np.einsum("ij,ij->i", off, directions)[:, None] * directions
    assert np.abs(across).max() < 1e-8  # that of 1e7 in double precision


def test_points_of_a_convex_body_are_occluded_inwards_only():
    mesh = make_mesh("sphere", *icosphere(2))
    rng = np.random.default_rng(2)
    faces = np.arange(len(mesh.faces))
    corners = mesh.corners(faces)
    weights = rng.dirichlet(np.ones(3), len(faces))
    points = np.einsum("fc,fcv->fv", weights, corners)
    normals = unit(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    directions = unit(rng.normal(size=points.shape))
    side = np.einsum("ij,ij->i", directions, normals)
    clear = np.abs(side) > 0.01
    occluded = Rays(mesh).occluded(points, directions)
    np.testing.assert_array_equal(occluded[clear], side[clear] < 0)


def test_without_embreex_one_line_says_what_to_install(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "embreex.mesh_construction", None)
    with pytest.raises(MeshError, match="pip install trimesh embreex"):
        Rays(make_mesh("a", *TETRAHEDRON))


def test_meshes_that_are_joined_keep_their_triangles(rng):
    one, other = random_mesh(rng), random_mesh(rng)
    both = joined("both", [one, other])
    np.testing.assert_array_equal(
        both.corners(np.arange(len(both.faces))),
        np.concatenate([each.corners(np.arange(len(each.faces))) for each in (one, other)]),
    )


# ---- tangents ------------------------------------------------------------------------------------


def test_tangents_follow_the_coordinate_u():
    """On a sphere with u the longitude about +Y, they are the horizontal ones."""
    vertices, faces = icosphere(4)
    longitude = np.arctan2(vertices[:, 0], vertices[:, 2])
    # Away from the seam at longitude pi and from the poles.
    kept = (np.ptp(longitude[faces], axis=1) < 3) & (np.abs(vertices[faces, 1]) < 0.9).all(axis=1)
    uvs = np.stack([longitude / 6, 0.3 * vertices[:, 1]], axis=1)
    mesh = make_mesh("globe", vertices, faces[kept], normals=vertices, uvs=uvs)
    found = tangents_from_uvs(mesh)
    inner = (np.abs(mesh.vertices[:, 1]) < 0.8) & (np.arctan2(*mesh.vertices[:, ::2].T) < 2.9)
    inner &= np.arctan2(*mesh.vertices[:, ::2].T) > -2.9
    np.testing.assert_allclose(found[inner], horizontal_tangents(mesh.normals)[inner], atol=0.02)


def test_tangents_of_a_sheared_and_mirrored_quad():
    vertices = np.array([(0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0)], dtype=float)
    faces = [(0, 1, 2), (0, 2, 3)]
    for forward in ([3, 1], [-1, 2], [0, -5]):
        # u = w . (x, y) for a known w, and v any other function: u grows fastest along the
        # direction in which v stays the same.
        v = np.array([1, 4])
        uvs = vertices[:, :2] @ np.stack([forward, v], axis=1)
        found = tangents_from_uvs(make_mesh("quad", vertices, faces, uvs=uvs))
        direction = np.array([v[1], -v[0]]) * np.sign(forward[0] * v[1] - forward[1] * v[0])
        np.testing.assert_allclose(found[:, :2], [direction / np.hypot(*direction)] * 4)


def test_tangents_without_coordinates_are_horizontal():
    mesh = make_mesh("sphere", *icosphere(1))
    np.testing.assert_array_equal(tangents_from_uvs(mesh), horizontal_tangents(mesh.normals))


def test_projected_tangents_lie_in_the_surface(rng):
    normals = unit(rng.normal(size=(50, 3)))
    found = projected_tangents(normals, (0, 0, 9))
    np.testing.assert_allclose(np.einsum("ij,ij->i", found, normals), 0, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1)
    # Of all unit vectors in the plane, none is nearer to the direction.
    np.testing.assert_allclose(found[:, 2], np.sqrt(1 - normals[:, 2] ** 2))
    np.testing.assert_allclose(projected_tangents([0, 0, 1.0], (0, 0, 1)), [1, 0, 0])
