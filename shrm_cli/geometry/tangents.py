"""Tangents of surfaces: the directions along which they are brushed."""

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array
from shrm_cli.errors import ArgumentError
from shrm_cli.geometry.mesh import Integers, Mesh, unit_or_zero
from shrm_cli.sphere.directions import horizontal_tangents

_TINY = 1e-300
_NO_DIRECTION = 1e-6
"""Length of a projected unit vector below which it has no direction."""


def tangents_from_uvs(mesh: Mesh) -> Array:
    """Return the directions in which the texture coordinate u grows.

    In each triangle it is the direction along which u grows and v stays the same. The sum at a
    vertex, weighted by the areas of its triangles, is made perpendicular to the vertex's normal.
    How fast u grows does not count.

    Returns an array of shape (n, 3): unit, perpendicular to the normals. Where the coordinates give
    no direction, and all over a mesh without any, `horizontal_tangents`.
    """
    if mesh.uvs is None:
        return horizontal_tangents(mesh.normals)
    along, _ = _along_u(mesh, mesh.uvs)
    total = _summed(mesh.faces, along, len(mesh.vertices))
    return perpendicular(unit_or_zero(total), mesh.normals)


def brushed_tangents(mesh: Mesh, brush: str | tuple[float, float, float] | None = None) -> Array:
    """Return unit tangents of a mesh's vertices, shape (n, 3).

    `brush` is along the texture coordinate u, or a direction; by default around +Y.
    """
    if brush is None:
        return horizontal_tangents(mesh.normals)
    if not isinstance(brush, str):
        return projected_tangents(mesh.normals, brush)
    if mesh.uvs is None:
        raise ArgumentError("brush", f"cannot be uv: {mesh.name} has no texture coordinates")
    return tangents_from_uvs(mesh)


class UvTangents:
    """Tangents for normal maps: the direction in which u grows, and on which side of it v does.

    They are those of the file where it has them. Else they are means at the vertices, as
    `tangents_from_uvs` has them, but apart for triangles whose texture coordinates are mirrored.

    `uv_set`, one of 0, 1, says which coordinates count.
    """

    def __init__(self, mesh: Mesh, uv_set: int = 0) -> None:
        uvs = mesh.uvs_1 if uv_set else mesh.uvs
        assert uvs is not None
        self._mesh, self._own = mesh, None if uv_set else mesh.tangents
        along, sign = _along_u(mesh, uvs)
        self._is_mirrored = sign < 0
        sides = mesh.faces * 2 + self._is_mirrored[:, None]
        self._sums = _summed(sides, along, 2 * len(mesh.vertices))

    def at(self, faces: ArrayLike, weights: Array) -> Array:
        """Return tangents at points of triangles, and the sign of v's direction, shape (n, 4)."""
        mirrored = self._is_mirrored[np.asarray(faces)]
        sums = self._sums[self._mesh.faces[np.asarray(faces)] * 2 + mirrored[:, None]]
        unit = sums / np.maximum(np.linalg.norm(sums, axis=-1, keepdims=True), _TINY)
        along = np.einsum("kc,kcv->kv", weights, unit)
        found = np.column_stack([along, np.where(mirrored, -1.0, 1.0)])
        if self._own is None:
            return found
        own = self._mesh.interpolated(self._own, faces, weights)
        return np.where(np.isfinite(own).all(axis=1, keepdims=True), own, found)


def _along_u(mesh: Mesh, uvs: Array) -> tuple[Array, Array]:
    """Return triangles' directions of u, as long as their areas, and -1 where uv are mirrored."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    u, v, w = (uvs[mesh.faces[:, k]] for k in range(3))
    first, second = b - a, c - a
    # Solve the triangle's map from (u, v) to space for the direction of u at constant v.
    (du1, dv1), (du2, dv2) = (v - u).T, (w - u).T
    sign = np.sign(du1 * dv2 - du2 * dv1)
    along = first * dv2[:, None] - second * dv1[:, None]
    along *= sign[:, None]
    area = np.linalg.norm(np.cross(first, second), axis=1, keepdims=True)
    return unit_or_zero(along) * area, sign


def _summed(places: Integers, along: Array, count: int) -> Array:
    """Return the sums of the triangles' vectors at the places of their corners."""
    total = np.zeros((count, 3))
    for corner in range(3):
        for axis in range(3):
            total[:, axis] += np.bincount(places[:, corner], along[:, axis], minlength=count)
    return total


def projected_tangents(normals: ArrayLike, direction: ArrayLike) -> Array:
    """Return a constant direction projected into the planes of surfaces.

    `normals`, of shape (..., 3), are unit. `direction`, of shape (3,), is of any length but 0.

    Returns an array of shape (..., 3): unit; `horizontal_tangents` where the direction is the
    normal's own.
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
