"""Finding the shortest vector within linear bounds, by non-negative least squares."""

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array

_TINY = 1e-13
"""Residuals, gains and coefficients that are smaller than this, relatively, count as rounding."""


def shortest_within(rows: Array, bounds: Array) -> Array | None:
    """Find the x of least ``|x|^2`` with ``rows @ x <= bounds``.

    `rows`, of shape (m, n), must each be of about unit length, so that all bounds are kept with the
    same precision. `bounds`, of shape (m,), must not be much smaller than -1, for the same reason.

    Returns the vector x, or None if no x is within the bounds.

    References
    ----------
    Lawson and Hanson 1974, Solving Least Squares Problems, chapter 23: Least distance
    programming, algorithm 23.27.
    """
    n = rows.shape[1]
    matrix = -np.concatenate([rows.T, bounds[None]])
    target = np.zeros(n + 1)
    target[n] = 1.0
    residual = target - matrix @ non_negative_least_squares(matrix, target)
    if residual[n] <= _TINY:
        return None
    return np.asarray(-residual[:n] / residual[n])


def non_negative_least_squares(matrix: Array, target: Array) -> Array:
    """Find the u >= 0 of least ``|matrix @ u - target|``, shape (n,).

    Columns that lower the residual join the set of free columns, one at a time. Columns whose
    coefficient would turn negative leave it, and their coefficient is 0.

    `matrix` is of shape (m, n). `target` is of shape (m,).

    References
    ----------
    Lawson and Hanson 1974, algorithm 23.10.
    """
    count = matrix.shape[1]
    result: Array = np.zeros(count)
    free = np.zeros(count, dtype=bool)
    lengths = np.linalg.norm(matrix, axis=0)
    tolerance = _TINY * lengths * np.linalg.norm(target)
    for _ in range(3 * count):
        gain = np.where(free, 0.0, matrix.T @ (target - matrix @ result))
        joined = _join(matrix, target, free, np.where(gain > tolerance, gain, 0.0))
        if joined is None:
            break
        solved = joined
        while (solved[free] <= 0).any():
            leaving = free & (solved <= 0)
            shares = result[leaving] / (result[leaving] - solved[leaving])
            result += shares.min() * (solved - result)
            free &= result > _TINY * result.max()
            result[~free] = 0.0
            solved = _solved(matrix, target, free)
        result = solved
    return result


def _join(matrix: Array, target: Array, free: NDArray[np.bool_], gain: Array) -> Array | None:
    """Let the column that gains most join the free ones, and solve for all free ones.

    The result is None if no column can join.
    """
    while gain.any():
        joining = int(np.argmax(gain))
        free[joining] = True
        solved = _solved(matrix, target, free)
        if solved[joining] > 0:
            return solved
        free[joining], gain[joining] = False, 0.0  # its gain is rounding alone
    return None


def _solved(matrix: Array, target: Array, free: NDArray[np.bool_]) -> Array:
    """Solve least squares over the free columns; the coefficients of the others are 0."""
    result = np.zeros(matrix.shape[1])
    if free.any():
        result[free] = np.linalg.lstsq(matrix[:, free], target, rcond=None)[0]
    return result
