"""The parabolic map of the hemisphere about +Z: a square image over directions of the view.

A direction d has the place ``(x, y) = (d_x, d_y) / (1 + d_z)`` in the square -1 .. 1. The horizon
is the circle of radius 1 in it, and what lies outside the circle is no direction of the hemisphere.
Texel (row i, column j) of an image of size N has its centre at ``x = (2 j + 1) / N - 1`` and ``y =
(2 i + 1) / N - 1``, so that a graphics API whose first row is at v = 0 looks it up at ``(u, v) =
((x, y) + 1) / 2``.

References: Heidrich and Seidel 1998, "View-independent environment maps"; Kautz, Sloan and Snyder
2002, section 3.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.arrays import Array, slices
from shrm_cli.sphere.cube import catmull_rom, linear

Weigh = Callable[[Array], tuple[NDArray[np.intp], list[Array]]]
"""Takes places in texels; returns the first texel of a filter and the weights of all its texels."""

_POINTS_AT_ONCE = 2**13
"""Directions that are looked up at a time, so that their channels stay in the cache."""


def parabolic_directions(size: int) -> Array:
    """Compute the directions of all texels of an image, shape (size, size, 3).

    Texels outside the circle have the direction of the place beside them on the circle that is half
    a texel inside it, and so have those of the outermost half texel. Surfaces are not seen from
    exactly their horizon, and a filter finds values there that go on as they are.
    """
    at = (2 * np.arange(size) + 1) / size - 1
    x, y = np.meshgrid(at, at)
    radius = np.hypot(x, y)
    inwards = np.minimum(radius, 1 - 1 / size) / np.where(radius > 0, radius, 1.0)
    return unproject(x * inwards, y * inwards)


def project(directions: ArrayLike) -> tuple[Array, Array]:
    """Return the places x and y of directions, shape (..., 3), on the hemisphere about +Z."""
    x, y, z = np.moveaxis(np.asarray(directions), -1, 0)
    return x / (1 + z), y / (1 + z)


def unproject(x: ArrayLike, y: ArrayLike) -> Array:
    """Return the directions of places in the square, shape (..., 3)."""
    x, y = np.broadcast_arrays(x, y)
    square = x * x + y * y
    return np.stack([2 * x, 2 * y, 1 - square], axis=-1) / (1 + square)[..., None]


class ParabolicSampler:
    """Filtered look-ups in a parabolic map.

    The texels of `image`, of shape (N, N, channels), outside the circle continue those inside, as
    `parabolic_directions` has them.
    """

    def __init__(self, image: Array) -> None:
        self._size = len(image)
        self._texels = np.ascontiguousarray(image.reshape(self._size**2, -1))

    def __call__(self, directions: ArrayLike) -> Array:
        """Look up directions by Catmull and Rom's cubic filter, shape (..., channels).

        `directions`, of shape (..., 3), are unit vectors; those below the horizon count as on it.
        """
        return self._filtered(directions, catmull_rom)

    def linear(self, directions: ArrayLike) -> Array:
        """Look up directions by the bilinear filter of graphics hardware; see `__call__`."""
        return self._filtered(directions, linear)

    def _filtered(self, directions: ArrayLike, weigh: Weigh) -> Array:
        directions = np.asarray(directions)
        flat = directions.reshape(-1, 3)
        result = np.empty((len(flat), self._texels.shape[1]), dtype=self._texels.dtype)
        for part in slices(len(flat), _POINTS_AT_ONCE):
            result[part] = self._looked_up(flat[part], weigh)
        return result.reshape(*directions.shape[:-1], result.shape[1])

    def _looked_up(self, directions: Array, weigh: Weigh) -> Array:
        size = self._size
        above = np.maximum(directions[:, 2], 0.0)
        x, y = directions[:, 0] / (1 + above), directions[:, 1] / (1 + above)
        (left, across), (top, down) = (weigh((each + 1) * size / 2 - 0.5) for each in (x, y))
        result = np.zeros((len(directions), self._texels.shape[1]), dtype=self._texels.dtype)
        for row, row_weight in enumerate(down):
            rows = np.clip(top + row, 0, size - 1) * size
            for column, weight in enumerate(across):
                columns = np.clip(left + column, 0, size - 1)
                share = (row_weight * weight).astype(self._texels.dtype)
                result += share[:, None] * self._texels[rows + columns]
        return result
