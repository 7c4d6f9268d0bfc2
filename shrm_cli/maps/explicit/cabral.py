"""Cabral's maps: twelve reflection maps for views at the vertices of an icosahedron."""

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array, Indices
from shrm_cli.maps.explicit.explicit import ExplicitMap

_COUNT = 12
"""The number of vertices of an icosahedron."""


def _vertices() -> Array:
    """Return the vertices of an icosahedron as unit vectors, shape (12, 3)."""
    golden = (1 + np.sqrt(5)) / 2
    corners = [(0.0, a, b * golden) for a in (1, -1) for b in (1, -1)]
    cyclic = [np.roll(corner, turn) for turn in range(3) for corner in corners]
    return np.array(cyclic) / np.hypot(1, golden)


def _triangles(vertices: Array) -> NDArray[np.intp]:
    """Return the twenty faces as indices of their vertices, shape (20, 3).

    The vertices of a face are in counter-clockwise order as seen from outside.
    """
    near = vertices @ vertices.T > 0  # 1/sqrt(5) along an edge, and -1/sqrt(5) to those beyond
    faces = [
        (a, b, c) if np.linalg.det(vertices[[a, b, c]]) > 0 else (a, c, b)
        for a in range(_COUNT)
        for b in range(a + 1, _COUNT)
        for c in range(b + 1, _COUNT)
        if near[a, b] and near[b, c] and near[a, c]
    ]
    return np.array(faces)


VERTICES = _vertices()
"""The views of the maps as unit vectors in world axes, shape (12, 3)."""
TRIANGLES = _triangles(VERTICES)
"""The spherical triangles between the views as indices of `VERTICES`, shape (20, 3)."""


class Cabral(ExplicitMap):
    """Reflection maps for twelve distant views, interpolated in the spherical triangle of V.

    Each image is a global map over the central direction, so that the warping of the original
    method is not needed.

    References: Cabral, Olano and Nemec 1999, Reflection space image based rendering. The maps for
    distant views are those of eq. 5.35 of chapter 5 of Ramamoorthi's thesis.
    """

    representation = "cabral"

    @classmethod
    def image_count(cls, view_count: int) -> int:
        return _COUNT

    @classmethod
    def part_names(cls, count: int) -> list[str]:
        return [f"view{k:02d}" for k in range(count)]

    @classmethod
    def sample_views(cls, count: int) -> Array:
        return VERTICES

    @classmethod
    def view_weights(cls, count: int) -> Array:
        # The vertices are a spherical 5-design: equal weights are exact to degree 5.
        return np.full(_COUNT, 4 * np.pi / _COUNT)

    @classmethod
    def blend(cls, centers: Array, views: Array, count: int) -> tuple[Indices, Array]:
        """Return the corners of the triangle that holds a view, and their weights.

        The weight of a corner is the share of the triangle's solid angle that lies opposite to it.
        """
        inverses = np.linalg.inv(VERTICES[TRIANGLES].transpose(0, 2, 1))
        inside = np.einsum("fij,...j->...fi", inverses, views).min(axis=-1)
        indices = TRIANGLES[np.argmax(inside, axis=-1)]
        a, b, c = np.moveaxis(VERTICES[indices], -2, 0)
        areas = [_solid_angle(views, b, c), _solid_angle(a, views, c), _solid_angle(a, b, views)]
        weights = np.maximum(np.stack(areas, axis=-1), 0.0)
        return indices, weights / weights.sum(axis=-1, keepdims=True)


def _solid_angle(a: Array, b: Array, c: Array) -> Array:
    """Return the solid angles of the spherical triangles of unit vectors, shape (..., 3) each.

    References: Van Oosterom and Strackee 1983, The solid angle of a plane triangle.
    """
    volume = np.sum(a * np.cross(b, c), axis=-1)
    sides = np.sum(a * b, axis=-1) + np.sum(b * c, axis=-1) + np.sum(c * a, axis=-1)
    return np.asarray(2 * np.arctan2(volume, 1 + sides))
