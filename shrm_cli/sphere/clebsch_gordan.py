"""Clebsch-Gordan coefficients: by a sum where one of the degrees is small, else from J^2."""

from math import factorial

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array
from shrm_cli.memo import Memo, kept_order

MOST_SMALL = 12
"""The largest degree p for which the sums below keep ten digits."""
_known_couplings = Memo(2**25)
"""What `zonal_coupling` returned. That of F = 512 and p = 32 takes 4.5 MB."""


def clebsch_gordan(degree: ArrayLike, m: ArrayLike, small: int, s: int, shift: int) -> Array:
    """Return ``<l m p s | l+shift m+s>`` for arrays of l and m.

    The factorials of large numbers occur as ratios, which are products of few numbers.

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
    low, m = np.asarray(degree, dtype=float), np.asarray(m, dtype=float)
    total, up, down = low + shift, low + m, low - m
    lowest = small - shift  # l + p - J, which is small as p is
    if not 0 <= lowest <= 2 * small or abs(s) > small:
        return np.zeros(up.shape)
    # 1 / (l-m-k)! and 1 / (J-p+m+k)! are falling factorials over (l-m)! and (l+m)!.
    first, last = max(0, s - shift), min(lowest, small + s)
    of_up, of_down = _falling(up, lowest - first), _falling(down, last)
    result = np.zeros(up.shape)
    for k in range(first, last + 1):
        known = factorial(k) * factorial(lowest - k)
        known *= factorial(small + s - k) * factorial(shift - s + k)
        result += ((-1) ** k / known) * of_down[k] * of_up[lowest - k]
    front = (2 * total + 1) * factorial(lowest) * factorial(small + shift)
    front *= float(factorial(small + s) * factorial(small - s))
    for number in range(2 * small + 1):  # (l+J-p)! / (l+J+p+1)!
        front = front / np.maximum(2 * low + shift - small + 1 + number, 1)
    result *= np.sqrt(np.maximum(front, 0.0))
    # (J+M)! / (l+m)! and (J-M)! / (l-m)!
    result *= np.sqrt(_ratio(up, shift + s))
    result *= np.sqrt(_ratio(down, shift - s))
    is_triangle = (total >= 0) & (total >= abs(low - small))
    is_valid = is_triangle & (up >= 0) & (down >= 0) & (abs(m + s) <= total)
    return np.where(is_valid, result, 0.0)


def _falling(number: Array, most: int) -> list[Array]:
    """Return ``n! / (n-k)!`` for k = 0 .. most, which is 0 where k > n."""
    result = [np.ones_like(number)]
    for k in range(most):
        result.append(result[-1] * (number - k))
    return result


def _ratio(number: Array, difference: int) -> Array:
    """Return ``(n + difference)! / n!``, or something positive where either does not exist."""
    result = np.ones_like(number)
    for step in range(1, abs(difference) + 1):
        factor = number + step if difference > 0 else number + 1 - step
        result *= np.maximum(factor, 1.0)
    return result if difference >= 0 else 1 / result


def zonal_coupling(order: int, p: int) -> Array:
    """Return ``(-1)^q (<l q p -q | J 0> + <l -q p q | J 0>)`` for all l up to an order.

    The coefficients are eigenvectors of J^2, the square of the sum of both angular momenta, whose
    matrix is tridiagonal in q and whose eigenvalues J (J + 1) lie far apart. Found so, they are as
    exact for large p as for small ones. The sum of both terms is 0 where J - l - p is odd.

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
    Varshalovich, Moskalev and Khersonskii 1988, 8.1.1 and 8.1.2 for the vectors, 8.5.2 (32) for
    their sign.
    """
    kept = kept_order(order)
    return _known_couplings.get((kept, p), lambda: _zonal_coupling(kept, p))[: order + 1]


def _zonal_coupling(order: int, p: int) -> Array:
    """Compute what `zonal_coupling` returns."""
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
    j = q
    vectors *= ((-1.0) ** (p - j) * np.copysign(1.0, vectors[:, 0]))[:, None]
    return np.where((q <= degree)[:, :, None], vectors, 0.0)
