"""Cabral's maps: twelve reflection maps for views at the vertices of an icosahedron."""

import numpy as np
from numpy.typing import NDArray

from shrm_cli.maps.explicit.explicit import Array, ExplicitMap, Indices
from shrm_cli.sphere.harmonics import real_harmonics

_COUNT = 12
_NEIGHBOUR = 0.5
"""Vertices of one edge have the cosine 1/sqrt(5); the next ones -1/sqrt(5)."""


def _vertices() -> Array:
    golden = (1 + np.sqrt(5)) / 2
    corners = [(0.0, a, b * golden) for a in (1, -1) for b in (1, -1)]
    cyclic = [np.roll(corner, turn) for turn in range(3) for corner in corners]
    return np.array(cyclic) / np.hypot(1, golden)


def _triangles(vertices: Array) -> NDArray[np.intp]:
    """The twenty faces as indices of their vertices, counter-clockwise from outside."""
    near = vertices @ vertices.T > 1 / np.sqrt(5) - _NEIGHBOUR / 2
    faces = [
        (a, b, c) if np.linalg.det(vertices[[a, b, c]]) > 0 else (a, c, b)
        for a in range(_COUNT)
        for b in range(a + 1, _COUNT)
        for c in range(b + 1, _COUNT)
        if near[a, b] and near[b, c] and near[a, c]
    ]
    return np.array(faces)


VERTICES = _vertices()
TRIANGLES = _triangles(VERTICES)


class Cabral(ExplicitMap):
    """Reflection maps for twelve distant views, interpolated in the spherical triangle of V.

    Each is a global map over the mirror direction (eq. 5.35), so that the warping of the
    original method is not needed.

    References
    ----------
    Cabral, Olano and Nemec 1999, Reflection space image based rendering.
    """

    representation = "cabral"

    @classmethod
    def image_count(cls, view_count: int) -> int:
        return _COUNT

    @classmethod
    def check_count(cls, count: int) -> None:
        if count != _COUNT:
            raise ValueError(f"{count} images, not {_COUNT}")

    @classmethod
    def sample_views(cls, count: int) -> Array:
        return VERTICES

    @classmethod
    def view_weights(cls, count: int) -> Array:
        # The vertices are a spherical 5-design.
        return np.full(_COUNT, 4 * np.pi / _COUNT)

    @classmethod
    def basis(cls, order_p: int, count: int) -> Array:
        return real_harmonics(order_p, VERTICES)

    @classmethod
    def blend(cls, centers: Array, views: Array, count: int) -> tuple[Indices, Array]:
        """The triangle that holds a view, and the solid angles opposite to its corners."""
        inverses = np.linalg.inv(VERTICES[TRIANGLES].transpose(0, 2, 1))
        inside = np.einsum("fij,...j->...fi", inverses, views).min(axis=-1)
        indices = TRIANGLES[np.argmax(inside, axis=-1)]
        a, b, c = np.moveaxis(VERTICES[indices], -2, 0)
        areas = [_solid_angle(views, b, c), _solid_angle(a, views, c), _solid_angle(a, b, views)]
        weights = np.maximum(np.stack(areas, axis=-1), 0.0)
        return indices, weights / weights.sum(axis=-1, keepdims=True)


def _solid_angle(a: Array, b: Array, c: Array) -> Array:
    """Of the spherical triangle of unit vectors (..., 3) (Van Oosterom and Strackee 1983)."""
    volume = np.sum(a * np.cross(b, c), axis=-1)
    sides = np.sum(a * b, axis=-1) + np.sum(b * c, axis=-1) + np.sum(c * a, axis=-1)
    return np.asarray(2 * np.arctan2(volume, 1 + sides))
