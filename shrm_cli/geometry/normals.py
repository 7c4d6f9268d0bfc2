"""Normals of triangles, and smooth ones of vertices."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array

if TYPE_CHECKING:
    from shrm_cli.geometry.mesh import Mesh

Integers = NDArray[np.int64]

_FLAT = 1e-12
"""Area of a triangle, in squares of its longest edge, below which it has no direction."""
_NOWHERE = 1e-9
"""Length of a sum of normals below which they cancel each other."""


def face_normals(vertices: Array, faces: Integers) -> Array:
    """Return the unit normals of triangles.

    `vertices`, of shape (n, 3), are finite. `faces`, of shape (m, 3), are counterclockwise as seen
    from where the normals point to.

    Returns an array of shape (m, 3): 0 where a triangle has no area.
    """
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    edges = np.stack([b - a, c - b, a - c])
    longest = np.sqrt(np.max(np.sum(edges**2, axis=-1), axis=0))[:, None]
    scale = np.where(longest > 0, longest, 1)
    normals = np.cross((b - a) / scale, (c - a) / scale)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.where(length > _FLAT, normals / np.where(length > 0, length, 1), 0)


def smooth_normals(vertices: Array, faces: Integers) -> Array:
    """Return unit normals of vertices: means of the triangles there, weighted by their angles.

    The result does not depend on how a surface is cut into triangles (Thurmer and Wuthrich 1998,
    "Computing vertex normals from polygonal facets"). Vertices at one place are one, so that
    seams of texture coordinates are not seen. Triangles without an area do not count.

    `vertices` are of shape (n, 3). `faces` are of shape (m, 3).

    Returns an array of shape (n, 3). Where normals cancel each other, as on the two sides of a
    sheet, the normal is that of one of the vertex's own triangles.
    """
    flat = face_normals(vertices, faces)
    _, place = np.unique(vertices, axis=0, return_inverse=True)
    place = place.reshape(-1)
    total = np.zeros((int(place.max()) + 1, 3))
    for corner, angle in enumerate(_angles(vertices, faces)):
        for axis in range(3):
            total[:, axis] += np.bincount(
                place[faces[:, corner]], angle * flat[:, axis], minlength=len(total)
            )
    length = np.linalg.norm(total, axis=1)
    normals = total / np.where(length > 0, length, 1)[:, None]
    result = normals[place]
    cancelled = length[place] < _NOWHERE
    if cancelled.any():
        own = np.zeros_like(result)
        sound = np.any(flat != 0, axis=1)
        own[faces[sound].ravel()] = np.repeat(flat[sound], 3, axis=0)
        result[cancelled] = own[cancelled]
    return result


def _angles(vertices: Array, faces: Integers) -> Array:
    """Return the angles of triangles at their corners, radians, shape (3, m); 0 without edges."""
    angles = np.empty(faces.T.shape)
    for corner in range(3):
        here, after, before = (vertices[faces[:, (corner + k) % 3]] for k in range(3))
        u, v = _unit(after - here), _unit(before - here)
        # atan2 is exact for small angles and those near pi, where the arc cosine is not.
        angles[corner] = np.arctan2(
            np.linalg.norm(np.cross(u, v), axis=1), np.einsum("ij,ij->i", u, v)
        )
    return angles


def _unit(vectors: Array) -> Array:
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return vectors / np.where(length > 0, length, 1)


def smooth_points(mesh: "Mesh", faces: Integers, weights: Array, normals: Array) -> Array:
    """Return points of the smooth surface of the normals, to trace rays from, shape (n, 3).

    From the flat triangles themselves, rays of low lamps would meet their neighbours, and the edge
    of the light would show the triangles (Hanika 2021, "Hacking the Shadow Terminator", Ray Tracing
    Gems II, chapter 4). There points are moved onto a mean of their corners' tangent planes, which
    is twice as high above a triangle as the sphere that touches these planes: ``sum_i w_i sum_j
    w_j |e_ij|^2 / 2R`` beside ``sum_i<j w_i w_j |e_ij|^2 / 2R``, with edges e_ij. From so high they
    look over what shadows them. Here they are moved half as far, and a plane below a point, as
    where the surface turns from convex to concave, counts against one above it.

    `faces` are of shape (n,). `weights`, of shape (n, 3), are barycentric. `normals`, of shape (n,
    3), are those of the side that is looked from.
    """
    corners = mesh.faces[faces]
    points = mesh.interpolated(mesh.vertices, faces, weights)
    flat = face_normals(mesh.vertices, corners)
    flat *= np.where(np.einsum("nv,nv->n", flat, normals) < 0, -1.0, 1.0)[:, None]
    # With a normal turned round, both factors change their signs, and so the height does not.
    own = mesh.normals[corners]
    above = np.einsum("ncv,ncv->nc", mesh.vertices[corners] - points[:, None], own)
    height = np.einsum("nc,nc,ncv,nv->n", weights, above, own, flat) / 2
    return points + np.maximum(height, 0)[:, None] * flat
