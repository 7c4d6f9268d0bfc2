"""Tangents of surfaces: the directions along which they are brushed."""

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array
from shrm_cli.geometry.mesh import Mesh
from shrm_cli.sphere.directions import horizontal_tangents

_NO_DIRECTION = 1e-6
"""Length of a projected unit vector below which it has no direction."""


def tangents_from_uvs(mesh: Mesh) -> Array:
    """Return the directions in which the texture coordinate u grows.

    In each triangle it is the direction along which u grows and v stays the same. The sum at a
    vertex, weighted by the areas of its triangles, is made perpendicular to the vertex's normal.
    How fast u grows does not count.

    Parameters
    ----------
    mesh : Mesh

    Returns
    -------
    ndarray, shape (n, 3)
        Unit, perpendicular to the normals. Where the coordinates give no direction, and all over
        a mesh without any, `horizontal_tangents`.
    """
    if mesh.uvs is None:
        return horizontal_tangents(mesh.normals)
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    u, v, w = (mesh.uvs[mesh.faces[:, k]] for k in range(3))
    first, second = b - a, c - a
    # Solve the triangle's map from (u, v) to space for the direction of u at constant v.
    (du1, dv1), (du2, dv2) = (v - u).T, (w - u).T
    along = first * dv2[:, None] - second * dv1[:, None]
    along *= np.sign(du1 * dv2 - du2 * dv1)[:, None]
    length = np.linalg.norm(along, axis=1, keepdims=True)
    area = np.linalg.norm(np.cross(first, second), axis=1, keepdims=True)
    along = along / np.where(length > 0, length, 1) * area
    total = np.zeros_like(mesh.vertices)
    for corner in range(3):
        for axis in range(3):
            total[:, axis] += np.bincount(
                mesh.faces[:, corner], along[:, axis], minlength=len(total)
            )
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return perpendicular(total / np.where(length > 0, length, 1), mesh.normals)


def projected_tangents(normals: ArrayLike, direction: ArrayLike) -> Array:
    """Return a constant direction projected into the planes of surfaces.

    Parameters
    ----------
    normals : array_like, shape (..., 3)
        Unit.
    direction : array_like, shape (3,)
        Of any length but 0.

    Returns
    -------
    ndarray, shape (..., 3)
        Unit; `horizontal_tangents` where the direction is the normal's own.
    """
    vector = np.asarray(direction, dtype=float)
    vector = vector / np.linalg.norm(vector)
    across = np.asarray(normals, dtype=float)
    return perpendicular(np.broadcast_to(vector, across.shape), across)


def perpendicular(tangents: Array, normals: Array) -> Array:
    """Return unit tangents made perpendicular to unit normals, shape (..., 3).

    Where nothing is left of a tangent, it is that of `horizontal_tangents`.
    """
    flat = tangents - np.sum(tangents * normals, axis=-1, keepdims=True) * normals
    length = np.linalg.norm(flat, axis=-1, keepdims=True)
    has_direction = length > _NO_DIRECTION
    return np.where(
        has_direction, flat / np.where(has_direction, length, 1), horizontal_tangents(normals)
    )
