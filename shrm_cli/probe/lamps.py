"""Small lamps near the poles of a lat-long, which count by the solid angles of their pixels.

The rule that integrates a lat-long is exact where the light is smooth, and pays for it near the
poles: the first row weighs .873 of its solid angle, the second one 1.024 of it. No set of weights
has both, exactness and areas. So the two are divided: what is smooth is integrated by the rule,
and what stands out of it within the polar rows, such as a sun in the zenith, by areas.
"""

from collections.abc import Iterator

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.records import record
from shrm_cli.sphere.grid.base import Grid

_MOST_ROWS = 32
"""Rows at each pole; farther away the rule and the areas differ by less than 1e-4."""
_PART = 4
"""These rows are no more than the height over this."""
_STANDS_OUT = 4.0
"""What is brighter than the mean of the polar rows without their lamps, times this, is a lamp.

Smooth light is at most so bright that its waves are longer than the rows are high.
"""
_PASSES, _SETTLED = 16, 0.99
"""The mean is taken anew, with lamps dimmed to the limit, until the limit falls by less than this.
A lamp that raised its own limit would be smooth in part: a row of 32 lost .8 % of its light."""


@record(eq=False)
class Lamps:
    """What integrals over a block of polar rows must add for lamps.

    Attributes
    ----------
    start : int
        The first row.
    excess : ndarray, shape (rows, width, 3)
        Radiance of the lamps above the smooth light.
    smooth : ndarray, shape (rows, width, 3)
        Radiance of what is left.
    ratios : ndarray, shape (rows, 1, 1)
        What the solid angle is more than the weight of the rule, over that weight.
    """

    start: int
    excess: Array
    smooth: Array
    ratios: Array

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.excess.shape[0], self.excess.shape[1]

    @property
    def light(self) -> Array:
        """Radiance to be added to the pixels, with the rule's weights: (rows, width, 3)."""
        return self.excess * self.ratios

    @property
    def squares(self) -> Array:
        """The same of the squared radiance."""
        return (self.excess**2 + 2 * self.excess * self.smooth) * self.ratios


class PolarRows:
    """Gathers the polar rows of an image, which arrives in blocks of rows.

    Parameters
    ----------
    grid : Grid
        Nothing is gathered, and there are no lamps, where weights are solid angles.
    """

    def __init__(self, grid: Grid) -> None:
        self._ratios = grid.area_ratios()
        rows, width = grid.shape
        self._count = 0 if self._ratios is None else min(rows // _PART, _MOST_ROWS)
        self._starts = (0, rows - self._count)
        self._caps = [np.zeros((self._count, width, 3), np.float32) for _ in self._starts]

    def add(self, start: int, pixels: Array) -> None:
        """Take in a block of rows, pixels of shape (rows, width, 3)."""
        stop = start + len(pixels)
        for first, cap in zip(self._starts, self._caps, strict=True):
            low, high = max(start, first), min(stop, first + self._count)
            if low < high:
                cap[low - first : high - first] = pixels[low - start : high - start]

    def lamps(self) -> Iterator[Lamps]:
        """Yield the lamps at each pole, where there are any, after all rows were added."""
        for start, cap in zip(self._starts, self._caps, strict=True):
            if self._ratios is None or not cap.any():
                continue
            ratios, areas = (each[start : start + self._count] for each in self._ratios)
            # Numpy takes several times as long for the maximum along an axis of three.
            brightest = np.maximum(np.maximum(cap[..., 0], cap[..., 1]), cap[..., 2])
            limit = _limit(brightest, areas / areas.sum())
            if brightest.max() > limit:
                most = np.maximum(brightest, max(limit, float(np.finfo(np.float32).tiny)))
                excess = cap * (1 - limit / most)[..., None]
                yield Lamps(start, excess, cap - excess, ratios[:, None, None])


def _limit(brightest: Array, shares: Array) -> float:
    """What is brighter is a lamp, of radiance (rows, width) in rows with shares of the area."""
    limit = float(brightest.max())
    for _ in range(_PASSES):
        before = limit
        limit = _STANDS_OUT * float(shares @ np.minimum(brightest, before).mean(axis=1))
        if limit >= _SETTLED * before:
            break
    return limit


def lamps_of(grid: Grid, image: Array) -> Iterator[Lamps]:
    """Yield the lamps near the poles of a whole image, shape (rows, width, 3)."""
    rows = PolarRows(grid)
    rows.add(0, image)
    return rows.lamps()
