"""Least squares for the exponent of an SH exponential: in log space, and in the light itself."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating]

FLOOR = 1e-3
"""Of the mean sample. Samples come from a truncated series: what is darker is within its error,
and may be negative, where the light is not. The logarithm would make much of it."""
_STEPS = 20
_SETTLED = 1e-4
_RIDGE = 1e-6
_TRIALS = 6
_PARTS = 1.0, 0.5, 0.25, 0.0
_LARGEST_EXPONENT = 60.0


@dataclass(frozen=True)
class Problem:
    """Samples of one channel, and what the exponent is made of there.

    Attributes
    ----------
    rows, variances : ndarray, shape (n, k)
        The exponent is ``rows @ x - variances @ x^2``.
    target : ndarray, shape (n,)
        What the exponential is to be.
    weights : ndarray, shape (n,)
    """

    rows: Array
    variances: Array
    target: Array
    weights: Array


def fit_logarithm(problem: Problem) -> Array:
    """Coefficients (k,) whose ``rows @ x`` is nearest to the logarithm of the target.

    The first column of the rows is constant. A target without light has no logarithm: it gets an
    exponential that is as good as 0.

    References
    ----------
    Silvennoinen et al. 2025, eq. 13 and 14.
    """
    mean = float(problem.weights @ problem.target / problem.weights.sum())
    if mean <= 0:
        black = np.zeros(problem.rows.shape[1])
        black[0] = -_LARGEST_EXPONENT / problem.rows[0, 0]
        return black
    logarithm = np.log(np.maximum(problem.target, FLOOR * mean))
    weighted = problem.rows * problem.weights[:, None]
    normal = weighted.T @ problem.rows
    return np.linalg.solve(normal + _ridge(normal), weighted.T @ logarithm)


def fit_exponent(problem: Problem) -> Array:
    """Coefficients (k,) whose exponential is nearest to the target itself.

    Gauss and Newton's method, damped after Levenberg and Marquardt, from the fit in log space,
    or a part of it.
    """
    x = _start(problem)
    twice, roots = 2 * problem.variances, np.sqrt(problem.weights)
    value, cost = _evaluate(problem, x)
    damping = 1e-3
    for _ in range(_STEPS):
        slopes = twice * -x
        slopes += problem.rows
        slopes *= (roots * value)[:, None]
        normal = slopes.T @ slopes
        gradient = slopes.T @ (roots * (problem.target - value))
        before = cost
        for _ in range(_TRIALS):
            damped = normal + damping * np.diag(np.diag(normal)) + _ridge(normal)
            step = np.linalg.solve(damped, gradient)
            tried, tried_cost = _evaluate(problem, x + step)
            if tried_cost < cost:
                x, value, cost = x + step, tried, tried_cost
                damping = max(damping / 10, 1e-7)
                break
            damping *= 10
        if cost >= before * (1 - _SETTLED):
            break
    return x


def _start(problem: Problem) -> Array:
    """The fit in log space, or the part of it that is nearest to the target.

    It knows no variances. Where the light has much contrast they would make all of it too dark,
    so dark that no slope is left to climb.
    """
    whole = fit_logarithm(problem)
    found = [whole]
    for part in _PARTS:
        x = part * whole
        value, _ = _evaluate(problem, x)
        weighted = problem.weights * value
        overlap = float(weighted @ problem.target)
        if overlap > 0:
            x[0] += np.log(overlap / float(weighted @ value)) / problem.rows[0, 0]
            found.append(x)
    return min(found, key=lambda x: _evaluate(problem, x)[1])


def _ridge(normal: Array) -> Array:
    """A small part of the mean diagonal: P and Q nearly cancel in some directions."""
    return _RIDGE * np.mean(np.diag(normal)) * np.eye(len(normal))


def _evaluate(problem: Problem, x: Array) -> tuple[Array, float]:
    """The exponential, and its weighted squared distance from the target."""
    exponent = problem.rows @ x - problem.variances @ x**2
    value = np.exp(np.clip(exponent, -_LARGEST_EXPONENT, _LARGEST_EXPONENT))
    return value, float(problem.weights @ (value - problem.target) ** 2)
