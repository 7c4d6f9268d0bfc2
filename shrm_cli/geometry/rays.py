"""Rays that find a mesh, traced by Intel's Embree.

The package `embreex`, which belongs to the extra `mesh`, is used by this module alone. It computes
in single precision. What is returned is computed again from the triangle that it names, in double
precision.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.arrays import Array, slices
from shrm_cli.errors import MeshError
from shrm_cli.extras import install
from shrm_cli.geometry.mesh import Mesh

_AT_ONCE = 2**18
"""The most rays that are traced at a time: about 50 MB of vectors."""
_START = 1e-5
"""Where rays that ask for occluders begin, in radii of the mesh, so as not to meet their own."""


class Rays:
    """Asks what rays meet of a mesh."""

    def __init__(self, mesh: Mesh) -> None:
        try:
            from embreex.mesh_construction import TriangleMesh
            from embreex.rtcore_scene import EmbreeScene
        except ImportError as error:
            raise MeshError(
                f"{mesh.name}: rays need the package embreex; {install('mesh')}"
            ) from error
        self._mesh = mesh
        low, high = mesh.bounds
        self._center = (low + high) / 2
        # In single precision numbers near 1 are the most exact, whatever the unit of the mesh.
        self._radius = float(np.linalg.norm(high - low)) / 2
        corners = self._scaled(mesh.vertices)[mesh.faces]
        corners[:, 1:] -= corners[:, :1]
        self._sides = np.ascontiguousarray(np.moveaxis(corners, 0, -1))  # [corner or side, axis, k]
        self._scene = EmbreeScene(robust=True)
        self._triangles = TriangleMesh(
            self._scene,
            np.ascontiguousarray(self._scaled(mesh.vertices), dtype=np.float32),
            np.ascontiguousarray(mesh.faces, dtype=np.int32),
        )

    def first_hits(
        self, origins: ArrayLike, directions: ArrayLike
    ) -> tuple[NDArray[np.int64], Array, Array]:
        """Return the first triangle that each ray meets, from either side.

        `origins` and `directions`, each of shape (k, 3), broadcastable, are in the mesh's own
        coordinates; directions are unit.

        Returns `faces` of shape (k,), triangles; -1 for none; `barycentric` of shape (k, 3),
        weights of the corners, at least 0, their sum 1; all 0 where there is no triangle; and
        `distance` of shape (k,), from the origin, in the mesh's unit; infinite where there is no
        triangle.
        """
        start, along = np.broadcast_arrays(
            np.asarray(origins, dtype=float), np.asarray(directions, dtype=float)
        )
        faces = np.empty(len(start), dtype=np.int64)
        weights, distance = np.zeros((len(start), 3)), np.full(len(start), np.inf)
        for block in slices(len(start), _AT_ONCE):
            faces[block] = self._run(start[block], along[block])
            hit = np.flatnonzero(faces[block] >= 0) + block.start
            weights[hit], distance[hit] = self._exact(start[hit], along[hit], faces[hit])
        return faces, weights, distance

    def occluded(self, origins: ArrayLike, directions: ArrayLike) -> NDArray[np.bool_]:
        """Return whether rays meet any triangle, bool of shape (k,).

        Rays begin a little in front of their origin (1e-5 of half the diagonal of the mesh), so
        that points of the surface do not hide themselves.
        """
        start, along = np.broadcast_arrays(
            np.asarray(origins, dtype=float), np.asarray(directions, dtype=float)
        )
        found = np.empty(len(start), dtype=bool)
        for block in slices(len(start), _AT_ONCE):
            begin = start[block] + _START * self._radius * along[block]
            found[block] = self._run(begin, along[block], "OCCLUDED") >= 0
        return found

    def _run(self, start: Array, along: Array, query: str = "INTERSECT") -> NDArray[np.int64]:
        """Ask Embree for the triangle of each ray; -1 for none."""
        near = self._scaled(start)
        # A ray from afar is moved to where it comes near the mesh, or its end would be inexact.
        skipped = np.maximum(-np.einsum("ij,ij->i", near, along) - 2, 0)
        near += skipped[:, None] * along
        found = self._scene.run(
            near.astype(np.float32), np.ascontiguousarray(along, dtype=np.float32), query=query
        )
        return np.asarray(found, dtype=np.int64)

    def _scaled(self, points: Array) -> Array:
        """Return points in the coordinates that Embree has them in, where the mesh has radius 1."""
        return (points - self._center) / self._radius

    def _exact(self, start: Array, along: Array, faces: NDArray[np.int64]) -> tuple[Array, Array]:
        """Return where rays meet the triangles that they are known to meet.

        After Moller and Trumbore 1997, "Fast, minimum storage ray-triangle intersection". Rays
        just past an edge are moved onto it.
        """
        # Each component is an array of its own: numpy is slow along axes of three.
        corner, first, second = self._sides[:, :, faces]
        way, origin = along.T, self._scaled(start).T
        from_corner = origin + np.maximum(-dot(origin, way) - 2, 0) * way - corner
        p, q = cross(way, second), cross(from_corner, first)
        determinant = dot(first, p)
        is_flat = determinant == 0
        scale = 1 / np.where(is_flat, 1, determinant)
        u, v = dot(from_corner, p) * scale, dot(way, q) * scale
        weights = np.clip(np.stack([1 - u - v, u, v]), 0, 1)
        weights /= weights[0] + weights[1] + weights[2]
        weights[:, is_flat] = 1 / 3
        reached = corner + weights[1] * first + weights[2] * second - origin
        return weights.T, dot(reached, way) * self._radius


def dot(one: Array, other: Array) -> Array:
    """Return the scalar products of vectors, shape (3, k) each."""
    return np.asarray(one[0] * other[0] + one[1] * other[1] + one[2] * other[2])


def cross(one: Array, other: Array) -> Array:
    """Return the vector products of vectors, shape (3, k) each."""
    (a, b, c), (x, y, z) = one, other
    return np.stack([b * z - c * y, c * x - a * z, a * y - b * x])
