"""For which values of a parameter that varies there are textures.

Between two textures a shader interpolates linearly. What that misses of the texture in the middle
is measured, and the interval that misses most gets that texture, until all miss little or there
are as many as asked for. Lobes change most where they are broad: evenly spaced values would be too
few there, and too many elsewhere.
"""

import heapq
from collections.abc import Callable
from itertools import pairwise

import numpy as np

from shrm_cli.arrays import Array

MOST_STEPS = 64
"""The most textures of a parameter."""
ENOUGH = 0.01
"""The relative RMS error between textures above which more of them are made."""
_FIRST = 4
"""Intervals to begin with: the middle of a single one could be right by symmetry alone."""


def chosen_values(
    coefficients: Callable[[float], Array], low: float, high: float, steps: int | None = None
) -> tuple[list[float], float]:
    """Choose the values of a parameter that textures are made for.

    Parameters
    ----------
    coefficients : callable
        Takes a value, and returns coefficients of the product functions at some views, an array of
        any shape.
    low, high : float
        The ends of the range, which are among the values.
    steps : int, optional
        How many values, at least 2; by default as many as miss no more than `ENOUGH`, and no more
        than `MOST_STEPS`.

    Returns
    -------
    values : list of float
        Rising.
    error : float
        The largest relative RMS error in the middle between two of them.
    """
    known: dict[float, Array] = {}

    def at(value: float) -> Array:
        if value not in known:
            known[value] = coefficients(value)
        return known[value]

    def measured(a: float, b: float) -> tuple[float, float, float]:
        middle = at((a + b) / 2)
        whole = max(float(np.sum(middle**2)), np.finfo(float).tiny)
        missed = float(np.sum((middle - (at(a) + at(b)) / 2) ** 2))
        return -np.sqrt(missed / whole), a, b

    count = _FIRST if steps is None else min(_FIRST, steps - 1)
    ends = [low + (high - low) * k / count for k in range(count)] + [high]
    worst = [measured(a, b) for a, b in pairwise(ends)]
    heapq.heapify(worst)
    most = MOST_STEPS if steps is None else steps
    while len(worst) + 1 < most and (steps is not None or -worst[0][0] > ENOUGH):
        _, a, b = heapq.heappop(worst)
        middle = (a + b) / 2
        heapq.heappush(worst, measured(a, middle))
        heapq.heappush(worst, measured(middle, b))
    return sorted({a for _, a, _ in worst} | {high}), -worst[0][0]
