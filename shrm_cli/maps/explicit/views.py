"""Where the views of explicit maps lie: those of Cabral, of Kautz and McCool, of a light field."""

from math import isqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array, Indices
from shrm_cli.maps.explicit.explicit import ExplicitMap
from shrm_cli.sphere.directions import from_angles, to_angles
from shrm_cli.sphere.quadrature import colatitude_weights, nodes

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


class KautzMcCool(ExplicitMap):
    """Slices ``B(alpha, beta, theta_o)`` of the part of the light without azimuth, q = 0.

    They are a 3D texture, which depends on the view by its angle from the center only. The slice
    with index k of T belongs to the angle ``theta_o = pi k / (T - 1)`` between the view and the
    central direction, so that both ends of the range are slices.

    References: Kautz and McCool 2000, Approximation of glossy reflection with prefiltered
    environment maps: the BRDF is approximated by ``u(theta_i', theta_o')``. The slices are those of
    eq. 5.25 of chapter 5 of Ramamoorthi's thesis.
    """

    representation = "kautz-mccool"
    frame = "local"

    @classmethod
    def image_count(cls, view_count: int) -> int:
        return view_count

    @classmethod
    def view_angles(cls, count: int) -> Array:
        """Return the angles theta_o of the slices, radians, shape (count,).

        The angle of a single slice does not matter, and is 0.
        """
        return np.linspace(0.0, np.pi, count) if count > 1 else np.zeros(1)

    @classmethod
    def part_names(cls, count: int) -> list[str]:
        return [f"slice{k:02d}" for k in range(count)]

    @classmethod
    def view_attributes(cls, count: int) -> list[dict[str, Any]]:
        return [{"shrm:theta_o": float(theta)} for theta in cls.view_angles(count)]

    @classmethod
    def view_count(cls, slices: int | None = None, views: int | None = None) -> int | None:
        super().view_count(views=views)
        return slices

    @classmethod
    def sample_views(cls, count: int) -> Array:
        return from_angles(cls.view_angles(count), 0.0)

    @classmethod
    def view_weights(cls, count: int) -> Array:
        if count == 1:
            return np.full(1, 4 * np.pi)
        return 2 * np.pi * colatitude_weights(count, "border")

    @classmethod
    def basis(cls, order_p: int, count: int) -> Array:
        zonal = [q == 0 for p in range(order_p + 1) for q in range(-p, p + 1)]
        return super().basis(order_p, count) * np.array(zonal)

    @classmethod
    def blend(cls, centers: Array, views: Array, count: int) -> tuple[Indices, Array]:
        """Return the slices on both sides of the view's angle, and their linear weights."""
        sine = np.linalg.norm(np.cross(centers, views), axis=-1)
        theta = np.arctan2(sine, np.sum(centers * views, axis=-1))
        position = theta * ((count - 1) / np.pi)
        first = np.clip(np.floor(position).astype(np.intp), 0, max(count - 2, 0))
        rest = position - first
        indices = np.stack([first, np.minimum(first + 1, count - 1)], axis=-1)
        return indices, np.stack([1 - rest, rest], axis=-1)


class LightField(ExplicitMap):
    """Global reflection maps for T x T distant views, interpolated bilinearly.

    Image ``T j + k`` belongs to the view with the angle ``theta = pi (j + 1/2) / T`` from +Z and
    ``phi = 2 pi (k + 1/2) / T - pi``. +Z is the polar axis of the harmonics, and the rows are
    Fejer's nodes, so that integrals over the views find every coefficient with 2 P < T exactly.

    References: section 5.6.2 of Ramamoorthi's thesis.
    """

    representation = "lightfield"

    @classmethod
    def image_count(cls, view_count: int) -> int:
        return view_count**2

    @classmethod
    def part_names(cls, count: int) -> list[str]:
        side = range(isqrt(count))
        return [f"view{j:02d}_{k:02d}" for j in side for k in side]

    @classmethod
    def view_count(cls, slices: int | None = None, views: int | None = None) -> int | None:
        super().view_count(slices=slices)
        return views

    @classmethod
    def sample_views(cls, count: int) -> Array:
        side = nodes(isqrt(count))
        theta, phi = (side + 1) * (np.pi / 2), side * np.pi
        return from_angles(theta[:, None], phi).reshape(-1, 3)

    @classmethod
    def view_weights(cls, count: int) -> Array:
        rows = colatitude_weights(isqrt(count)) * (2 * np.pi / isqrt(count))
        return np.repeat(rows, isqrt(count))

    @classmethod
    def blend(cls, centers: Array, views: Array, count: int) -> tuple[Indices, Array]:
        """Return the images in two rows and two columns around a view, and their bilinear weights.

        Beyond a pole the grid continues half a turn away.
        """
        side = isqrt(count)
        theta, phi = to_angles(views)
        down = theta * (side / np.pi) - 0.5
        row = np.floor(down).astype(np.intp)
        parts = []
        for at, weight in ((row, row + 1 - down), (row + 1, down - row)):
            beyond = (at < 0) | (at >= side)
            at = np.minimum(np.maximum(at, -1 - at), 2 * side - 1 - at)
            along = (phi / np.pi + np.where(beyond, 2.0, 1.0)) * (side / 2) - 0.5
            column = np.floor(along).astype(np.intp)
            for step, share in ((0, column + 1 - along), (1, along - column)):
                parts.append((at * side + (column + step) % side, weight * share))
        indices, weights = zip(*parts, strict=True)
        return np.stack(indices, axis=-1), np.stack(weights, axis=-1)
