"""Wigner's small-d matrices, and Clebsch-Gordan coefficients.

The matrices are made by recurrences that are stable to order 512: in the degree, and for right
angles in m. The coefficients are made by a sum where one of the degrees is small, and else from
J^2.

Convention: ``d^1_10(b) = -sin(b) / sqrt(2)``, so that ``D^l_mn(a, b, c) =
exp(-i m a) d^l_mn(b) exp(-i n c)`` rotates complex harmonics with Condon-Shortley phase.
"""

import math
from collections.abc import Iterator
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array, Memo, kept_order

KEPT_ORDER = 96
"""The largest order to which values at right angles, and what is made of them, are kept."""
_known_rows = Memo(2**24)
"""Values at right angles of some orders, of which order 96 takes 7 MB."""
_MORE = 4
"""Series that many degrees longer than others share what is kept for these. Those of a map have P
more than its light, which mostly has a multiple of 8 itself."""
_VALUES_AT_ONCE = 2**22
"""Values at right angles of higher degrees that are computed at a time."""


def shared_order(order: int) -> int:
    """Return the order, at most `KEPT_ORDER`, to which series of some order share what is kept."""
    return min(kept_order(order + _MORE), KEPT_ORDER)


def small_d_degrees(
    order: int, theta: ArrayLike, max_spin: int | None = None, min_spin: int | None = None
) -> Iterator[tuple[int, Array]]:
    """Yield ``(l, d^l)`` for l = 0 .. order.

    `theta` holds angles in radians, any shape. `max_spin` and `min_spin` keep only the columns
    ``min_spin <= n <= max_spin``; all of them by default, and those from ``-max_spin`` on, which is
    the least, if `max_spin` alone is given.

    Yields `l`; and `d` of shape (2l+1, columns, *theta.shape), ``d[m + l, n - k] = d^l_mn(theta)``
    where k is the larger of -l and `min_spin`.

    References: Varshalovich, Moskalev & Khersonskii 1988, 4.8.2 (14) for the recurrence, 4.17 for
    the edges.
    """
    theta = np.asarray(theta, dtype=float)
    spins = order if max_spin is None else min(max_spin, order)
    half_cos, half_sin = np.cos(theta / 2), np.sin(theta / 2)
    cosine = np.cos(theta)
    lowest = -spins if min_spin is None else min_spin
    edge = np.ones((1, *theta.shape))  # d^l_{l,n} for n = -min(l, spins) .. min(l, spins)
    previous = before = np.ones((1, int(lowest <= 0), *theta.shape))
    yield 0, previous
    for degree in range(1, order + 1):
        edge = _next_edge(edge, degree, min(degree, spins), half_cos, half_sin)
        columns = max(min(degree, spins) + 1 - max(lowest, -degree), 0)
        current = np.empty((2 * degree + 1, columns, *theta.shape))
        _recur(current, previous, before, degree, lowest, cosine)
        _set_edges(current, edge, degree, lowest)
        yield degree, current
        before, previous = previous, current


def right_angle_rows(order: int, first: int = 0) -> Array:
    """Return ``d^l_mn(pi/2)``, m, n >= 0, for l = first .. order at once.

    From the row m = l on down to m = 0, a recurrence in m takes all degrees in one step. It is
    stable in that direction, also at order 512. The values of one quadrant are all that there are,
    ``d_m,-n = (-1)^(l+m) d_mn``.

    Returns an array of shape (order+1, order+1-first, order+1), indexed [l - m, l - first, n]; zero
    where n or l - m are larger than l. As for all l it takes memory with the third power of the
    order, `right_angle_degrees` is for high ones.

    References: Trapani & Navaza 2006, Calculation of spherical harmonics and Wigner d functions by
    FFT, Acta Cryst. A62.
    """
    if first == 0 and order <= KEPT_ORDER:
        kept = kept_order(order)
        rows = _known_rows.get(kept, lambda: _falling_rows(kept, 0))
        return rows[: order + 1, : order + 1, : order + 1]
    return _falling_rows(order, first)


def _falling_rows(order: int, first: int, room: Array | None = None) -> Array:
    """Compute what `right_angle_rows` returns.

    If there is `room`, a row of numbers that suffices, the result is made there, and what is 0
    where l - m is larger than l has any values.
    """
    degree, n = np.arange(first, order + 1.0)[:, None], np.arange(order + 1.0)
    shape = order + 1, len(degree), order + 1
    result = np.zeros(shape) if room is None else room[: math.prod(shape)].reshape(shape)
    even = 2 * n[1:]
    result[0, :, 0] = np.cumprod(np.append(1.0, -np.sqrt((even - 1) / even)))[first:]
    result[0, :, 1:] = -np.sqrt(np.maximum(degree - n[:-1], 0.0) / (degree + n[:-1] + 1))
    np.cumprod(result[0], axis=1, out=result[0])
    above = np.arange(float(order))  # l - m, to which the factors of the next row belong
    scale = 1 / np.sqrt((above + 1) * np.maximum(2 * degree - above, 1)).T[..., None]
    back = scale * np.sqrt(above * np.maximum(2 * degree - above + 1, 0)).T[..., None]
    for row in range(order):
        some = slice(max(row + 1 - first, 0), None)
        lower = result[row + 1, some]
        np.multiply(result[row, some], scale[row, some], out=lower)
        lower *= 2 * n
        if row:
            lower -= back[row, some] * result[row - 1, some]
    return result


def right_angle_degrees(order: int, first: int = 0) -> Iterator[Array]:
    """Yield ``d^l_mn(pi/2)``, m, n = 0 .. l, for l = first .. order.

    Yields `d` of shape (l+1, l+1), which holds until the next one is taken.
    """
    more = _VALUES_AT_ONCE // (order + 1) ** 2
    room: Array = np.empty(0)
    while first <= order:
        last = min(max(first + more, KEPT_ORDER), order)
        if last <= KEPT_ORDER:
            rows = right_angle_rows(last, first)
        else:  # memory that was not used before takes more time than the numbers
            size = (last + 1) ** 2 * (last + 1 - first)
            room = room if len(room) >= size else np.empty((order + 1) ** 2 * (more + 1))
            rows = _falling_rows(last, first, room)
        for degree in range(first, last + 1):
            yield rows[degree::-1, degree - first, : degree + 1]
        first = last + 1


def _next_edge(edge: Array, degree: int, width: int, half_cos: Array, half_sin: Array) -> Array:
    """The row m = l of d^l from the row m = l - 1 of d^{l-1}."""
    old = (len(edge) - 1) // 2
    n = np.arange(-old, old + 1).reshape(-1, *[1] * half_cos.ndim)
    # max() only guards n = +-degree, which cannot be among the old columns.
    ratio = np.sqrt(2 * degree * (2 * degree - 1) / ((degree + n) * (degree - n)))
    grown = -ratio * (half_cos * half_sin) * edge
    if width == old:
        return grown
    first, last = half_sin ** (2 * degree), half_cos ** (2 * degree)
    return np.concatenate([first[None], grown, last[None]])


def _recur(
    current: Array, previous: Array, before: Array, degree: int, lowest: int, cosine: Array
) -> None:
    """Fill |m| < l of the columns that the two degrees below have; the first is `lowest` or -l."""
    k = degree - 1
    first = max(lowest, -k)
    tail = [1] * cosine.ndim
    m = np.arange(-k, k + 1).reshape(-1, 1, *tail)
    n = np.arange(first, first + previous.shape[1]).reshape(1, -1, *tail)
    scale = 1 / np.sqrt(float(degree**2) - m**2) / np.sqrt(float(degree**2) - n**2)
    new = first - max(lowest, -degree)
    target = current[1:-1, new : new + previous.shape[1]]
    if k == 0:
        target[...] = cosine
        return
    np.multiply(degree * cosine - m * n / k, previous, out=target)
    target *= scale * (2 * k + 1)
    weight = (degree / k) * np.sqrt((k**2 - m**2) * np.maximum(k**2 - n**2, 0.0)) * scale
    new = max(lowest, 1 - k) - first
    keep = slice(new, new + before.shape[1])
    target[1:-1, keep] -= weight[1:-1, keep] * before


def _set_edges(current: Array, edge: Array, degree: int, lowest: int) -> None:
    """Fill m = +-l, and n = +-l where it is kept, by d_mn = (-1)^(m-n) d_nm = d_-n,-m."""
    width = (len(edge) - 1) // 2
    signs = (-1.0) ** (degree - np.arange(-width, width + 1))
    mirrored = signs.reshape(-1, *[1] * (edge.ndim - 1)) * edge
    kept = slice(max(lowest, -degree) + width, None)
    current[-1] = edge[kept]
    current[0] = mirrored[::-1][kept]
    if width == degree >= lowest:
        current[:, -1] = mirrored
    if width == degree <= -lowest:
        current[:, 0] = edge[::-1]


_known_couplings = Memo(2**25)
"""What `zonal_coupling` returns, for so many degrees at once. F = 512 and p = 32 take 4.5 MB."""
_DEGREES_AT_ONCE = 32

_FACTORIALS = np.array([math.factorial(number) for number in range(27)], dtype=float)
"""Factorials, to that of 26, which degrees p to 13 need."""


def clebsch_gordan(degree: ArrayLike, m: ArrayLike, small: int, s: int, shift: int) -> Array:
    """Return ``<l m p s | l+shift m+s>`` for arrays of l and m.

    The factorials of large numbers occur as ratios, which are products of few numbers. Each depends
    on l, on l+m or on l-m alone, and is looked up in a table of it.

    `degree` and `m`, broadcastable, are the degree l and the order m, of any sign. `small` and `s`
    are the degree p, at most 12, for which the sums keep ten digits, and its order. `shift` is how
    far the coupled degree J is above l.

    Returns an array, zero where an order is larger than its degree, or the degrees make no
    triangle.

    References: Varshalovich, Moskalev and Khersonskii 1988, 8.2.1 (3).
    """
    low, m = np.asarray(degree, dtype=np.intp), np.asarray(m, dtype=np.intp)
    total, up, down = low + shift, low + m, low - m
    lowest = small - shift  # l + p - J, which is small as p is
    if not 0 <= lowest <= 2 * small or abs(s) > small:
        return np.zeros(up.shape)
    # 1 / (l-m-k)! and 1 / (J-p+m+k)! are falling factorials over (l-m)! and (l+m)!.
    k = np.arange(max(0, s - shift), min(lowest, small + s) + 1)
    numbers = np.arange(2.0 * low.max(initial=0) + 1)
    of_up, of_down = np.clip(up, 0, len(numbers) - 1), np.clip(down, 0, len(numbers) - 1)
    factorials = _FACTORIALS[[k, lowest - k, small + s - k, shift - s + k]].prod(axis=0)
    falling = _falling(numbers, lowest)
    first = falling[k] * ((-1.0) ** k / factorials)[:, None]
    result = np.einsum(
        "k...,k...->...", first.take(of_down, axis=1), falling[lowest - k].take(of_up, axis=1)
    )
    factor = _FACTORIALS[[lowest, small + shift, small + s, small - s]].prod()
    front = factor * (2 * (numbers + shift) + 1)
    front /= _rising(2 * numbers + shift - small, 2 * small + 1)  # (l+J-p)! / (l+J+p+1)!
    result *= np.sqrt(np.maximum(front, 0.0))[low]
    # (J+M)! / (l+m)! and (J-M)! / (l-m)!
    result *= np.sqrt(_ratio(numbers, shift + s))[of_up]
    result *= np.sqrt(_ratio(numbers, shift - s))[of_down]
    is_triangle = (total >= 0) & (total >= abs(low - small))
    is_valid = is_triangle & (up >= 0) & (down >= 0) & (abs(m + s) <= total)
    return np.where(is_valid, result, 0.0)


def _falling(number: Array, most: int) -> Array:
    """Return ``n! / (n-k)!`` for k = 0 .. most, which is 0 where k > n, shape (most+1, n)."""
    factors = np.ones((most + 1, len(number)))
    factors[1:] = number - np.arange(most)[:, None]
    return np.cumprod(factors, axis=0)


def _rising(number: Array, count: int) -> Array:
    """Return ``(n+1) .. (n+count)``, without factors that are not positive."""
    return np.asarray(np.maximum(number + np.arange(1, count + 1)[:, None], 1.0).prod(axis=0))


def _ratio(number: Array, difference: int) -> Array:
    """Return ``(n + difference)! / n!``, or something positive where either does not exist."""
    if difference < 0:
        return 1 / _rising(number + difference, -difference)
    return _rising(number, difference)


def zonal_coupling(order: int, p: int) -> Array:
    """Return ``(-1)^q (<l q p -q | J 0> + <l -q p q | J 0>)`` for all l up to an order.

    The coefficients are eigenvectors of J^2, the square of the sum of both angular momenta, whose
    matrix is tridiagonal in q and whose eigenvalues J (J + 1) lie far apart. Found so, they are as
    exact for large p as for small ones. The sum of both terms is 0 where J - l - p is odd.

    `order` and `p` are the largest degree l, and the other degree.

    Returns an array of shape (order+1, p+1, p+1), indexed [l, q, j] with ``J = l - p + 2 j``; one
    term where q = 0. Zero where q > l, or where no such J >= |l - p| exists.

    References: Varshalovich, Moskalev and Khersonskii 1988, 8.1.1 and 8.1.2 for the vectors, 8.5.2
    (32) for their sign.
    """
    blocks = [
        _known_couplings.get((first, p), partial(_zonal_coupling, first, p))
        for first in range(0, order + 1, _DEGREES_AT_ONCE)
    ]
    return np.concatenate(blocks)[: order + 1]


def _zonal_coupling(first: int, p: int) -> Array:
    """Compute what `zonal_coupling` returns for some degrees from a first one on."""
    degree, q = np.arange(first, first + _DEGREES_AT_ONCE)[:, None], np.arange(p + 1)
    # The basis is |l 0, p 0> and the normalized even sums (|l q, p -q> + |l -q, p q>) / sqrt(2).
    square = np.zeros((len(degree), p + 1, p + 1))
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
