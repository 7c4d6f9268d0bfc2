"""Clebsch-Gordan coefficients: by a sum where one of the degrees is small, else from J^2."""

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.floating]

MOST_SMALL = 8
"""The largest degree p for which the sums below keep ten digits."""


def clebsch_gordan(degree: ArrayLike, m: ArrayLike, small: int, s: int, shift: int) -> Array:
    """Return ``<l m p s | l+shift m+s>`` for arrays of l and m.

    Parameters
    ----------
    degree, m : array_like of int, broadcastable
        The degree l and the order m, of any sign.
    small, s : int
        The degree p, at most `MOST_SMALL`, and its order.
    shift : int
        How far the coupled degree J is above l.

    Returns
    -------
    ndarray
        Zero where an order is larger than its degree, or the degrees make no triangle.

    References
    ----------
    Varshalovich, Moskalev and Khersonskii 1988, 8.2.1 (3).
    """
    low, m = np.broadcast_arrays(np.asarray(degree), np.asarray(m))
    total, order = low + shift, m + s
    lowest = small - shift  # l + p - J, which is small as p is
    is_valid = (
        (abs(m) <= low) & (total >= abs(order)) & (abs(s) <= small) & (total >= abs(low - small))
    )
    if not 0 <= lowest <= 2 * small:
        return np.zeros(low.shape)
    logs = _log_factorials(int(low.max(initial=0)) * 2 + 2 * small + 2)

    def log_factorial(number: NDArray[np.integer]) -> Array:
        """Return log(n!), which is infinite for negative n."""
        return np.where(number >= 0, logs[np.maximum(number, 0)], np.inf)

    def small_factorial(number: int) -> float:
        return float(logs[number])

    front = (
        np.log(2.0 * total.clip(0) + 1)
        + small_factorial(lowest) + log_factorial((2 * low + shift - small).clip(0))
        + small_factorial(small + shift) - log_factorial(2 * low + shift + small + 1)
        + log_factorial((total + order).clip(0)) + log_factorial((total - order).clip(0))
        + log_factorial((low + m).clip(0)) + log_factorial((low - m).clip(0))
        + small_factorial(abs(small + s)) + small_factorial(abs(small - s))
    ) / 2  # fmt: skip
    result = np.zeros(low.shape)
    for k in range(max(0, s - shift), min(lowest, small + s) + 1):
        known = small_factorial(k) + small_factorial(lowest - k) + small_factorial(small + s - k)
        known += small_factorial(shift - s + k)
        below = log_factorial(low - m - k) + log_factorial(total - small + m + k)
        result += (-1.0) ** k * np.exp(front - known - below)
    return np.where(is_valid, result, 0.0)


def _log_factorials(most: int) -> Array:
    """Return log(n!) for n = 0 .. most."""
    return np.concatenate([[0.0], np.cumsum(np.log(np.arange(1, most + 1)))])


@lru_cache(64)
def zonal_coupling(order: int, p: int) -> Array:
    """Return ``(-1)^q (<l q p -q | J 0> + <l -q p q | J 0>)`` for all l up to an order.

    The coefficients are eigenvectors of J^2, the square of the sum of both angular momenta, whose
    matrix is tridiagonal in q and whose eigenvalues J (J + 1) lie far apart. Found so, they are as
    exact for large p as for small ones, up to the sign of all of one l and J together, which is
    left open here. The sum of both terms is 0 where J - l - p is odd.

    Parameters
    ----------
    order, p : int
        The largest degree l, and the other degree.

    Returns
    -------
    ndarray, shape (order+1, p+1, p+1)
        Indexed [l, q, j] with ``J = l - p + 2 j``; one term where q = 0. Zero where q > l, or
        where no such J >= |l - p| exists.

    References
    ----------
    Varshalovich, Moskalev and Khersonskii 1988, 8.1.1 and 8.1.2: the vectors are orthonormal.
    """
    degree, q = np.arange(order + 1)[:, None], np.arange(p + 1)
    # The basis is |l 0, p 0> and the normalized even sums (|l q, p -q> + |l -q, p q>) / sqrt(2).
    square = np.zeros((order + 1, p + 1, p + 1))
    low, small = degree * (degree + 1), p * (p + 1)
    # Where q > l there is no such state. These rows have eigenvalues of their own below all others.
    square[:, q, q] = np.where(q <= degree, low + small - 2 * q**2, -small - 1 - q)
    up = q[:-1]
    beside = (low - up * (up + 1)).clip(0) * (small - up * (up + 1))
    beside = -np.sqrt(np.where(up == 0, 2, 1) * beside)  # the sign is that of (-1)^q
    square[:, up + 1, up] = square[:, up, up + 1] = beside
    vectors = np.linalg.eigh(square)[1]
    vectors[:, 1:] *= np.sqrt(2)
    return np.where((q <= degree)[:, :, None], vectors, 0.0)
