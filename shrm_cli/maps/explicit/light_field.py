"""A full light field: T x T reflection maps on a grid of views.

It is that of section 5.6.2 of Ramamoorthi's thesis.
"""

from math import isqrt

import numpy as np

from shrm_cli.arrays import Array, Indices
from shrm_cli.maps.explicit.explicit import ExplicitMap
from shrm_cli.sphere.directions import from_angles, to_angles
from shrm_cli.sphere.quadrature import colatitude_weights, nodes


class LightField(ExplicitMap):
    """Global reflection maps for T x T distant views, interpolated bilinearly.

    Image ``T j + k`` belongs to the view with the angle ``theta = pi (j + 1/2) / T`` from +Z and
    ``phi = 2 pi (k + 1/2) / T - pi``. +Z is the polar axis of the harmonics, and the rows are
    Fejer's nodes, so that integrals over the views find every coefficient with 2 P < T exactly.
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
