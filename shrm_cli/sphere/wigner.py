"""Wigner's small-d matrices, and Clebsch-Gordan coefficients.

The matrices are made by recurrences that are stable to order 512: in the degree, and for right
angles in m. The coefficients are eigenvectors of J^2.

Convention: ``d^1_10(b) = -sin(b) / sqrt(2)``, so that ``D^l_mn(a, b, c) =
exp(-i m a) d^l_mn(b) exp(-i n c)`` rotates complex harmonics with Condon-Shortley phase.
"""

import math
from collections.abc import Iterator
from itertools import islice

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array, Memo, kept_order, slices

KEPT_ORDER = 96
"""The largest order to which values at right angles, and what is made of them, are kept."""
_known_rows = Memo(2**24)
"""Values at right angles of some orders, of which order 96 takes 7 MB."""
_MORE = 4
"""Series that many degrees longer than others share what is kept for these. Those of a map have P
more than its light, which mostly has a multiple of 8 itself."""
_VALUES_AT_ONCE = 2**22
"""Values at right angles of higher degrees that are computed at a time."""
_FACTORS_AT_ONCE = 2**18
"""The factors of recurrences, of some degrees, that are computed at a time."""


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
    angles = theta.ravel()
    cosine = np.cos(angles)[:, None, None]
    spins = order if max_spin is None else min(max_spin, order)
    lowest = -spins if min_spin is None else min_spin
    edges = _edges(order, spins, angles)
    previous = before = np.ones((len(angles), 1, int(lowest <= 0)))
    yield 0, _behind(previous, theta)
    for some in slices(order, _FACTORS_AT_ONCE // ((2 * order + 1) * (spins + 1 - lowest))):
        degrees = range(some.start + 1, some.stop + 1)
        for degree, factors in zip(degrees, _recurrence(degrees, lowest, spins), strict=True):
            columns = max(min(degree, spins) + 1 - max(lowest, -degree), 0)
            current = np.empty((len(angles), 2 * degree + 1, columns))
            _recur(current, previous, before, degree, lowest, cosine, factors)
            _set_edges(current, edges[degree], degree, lowest)
            yield degree, _behind(current, theta)
            before, previous = previous, current


def _behind(values: Array, theta: Array) -> Array:
    """Return values of angles, (angles, m, n), with the axes of the angles behind the others."""
    return values.transpose(1, 2, 0).reshape(*values.shape[1:], *theta.shape)


def folded_small_d(
    order: int, theta: Array, spins: range, around: int, first: int, at_once: int
) -> Iterator[Array]:
    """Yield ``d^l_mn(theta)`` for some degrees at a time, from the first to the order.

    `theta` holds angles in radians, (angles,). `spins` are the columns n, from 0 on. Orders m that
    differ by a multiple of `around` are side by side: they are the same wave at so many azimuths.

    Yields arrays of single precision, of shape (degrees, around, angles, spins, blocks), with
    ``m = k + around (b - blocks // 2)`` at k and b, zero where ``|m|`` or n are beyond the degree.
    """
    degrees = small_d_degrees(order, theta, spins[-1], spins[0])
    degrees = islice(degrees, first, None)
    while some := list(islice(degrees, at_once)):
        half = -(-some[-1][0] // around)
        middle, blocks = half * around, 2 * half + 1
        result = np.zeros((len(some), blocks * around, len(theta), len(spins)), np.float32)
        for (degree, d), own in zip(some, result, strict=True):
            own[middle - degree : middle + degree + 1, :, : d.shape[1]] = d.swapaxes(1, 2)
        result = result.reshape(len(some), blocks, around, len(theta), len(spins))
        yield np.ascontiguousarray(result.transpose(0, 2, 3, 4, 1))


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


def _edges(order: int, spins: int, theta: Array) -> Array:
    """Return the rows m = l of all degrees, n = -spins .. spins, shape (order+1, angles, n).

    What stands where ``|n| > l`` means nothing.
    """
    half_cos, half_sin = np.cos(theta / 2)[:, None], np.sin(theta / 2)[:, None]
    degree, n = np.arange(order + 1.0)[:, None, None], np.arange(-spins, spins + 1.0)
    # max() only guards degrees up to |n|, which do not grow from the one before.
    ratio = np.sqrt(2 * degree * (2 * degree - 1) / np.maximum(degree**2 - n**2, 1.0))
    grown = -ratio * (half_cos * half_sin)
    first = np.where(n < 0, half_sin, half_cos) ** (2 * np.abs(n))
    above = degree - np.abs(n)
    factors = np.where(above > 0, grown, np.where(above == 0, first, 1.0))
    return np.cumprod(factors, axis=0, out=factors)


def _recurrence(degrees: range, lowest: int, spins: int) -> Array:
    """Return the factors of `_recur` for some degrees l, shape (degrees, 3, m, n).

    The orders m are those of the last degree, and n = lowest .. spins; where either is l or larger
    the factors mean nothing. The first is that of ``cos(theta) d^(l-1)``, the others are those of
    ``d^(l-1)`` and ``d^(l-2)``, which are subtracted.
    """
    degree = np.array(degrees, float)[:, None, None]
    below = np.maximum(degree - 1, 1.0)
    m, n = np.arange(-degrees[-1], degrees[-1] + 1.0)[:, None], np.arange(lowest, spins + 1.0)

    def size(over: Array) -> Array:
        """Return sqrt((l^2 - m^2) (l^2 - n^2)), 0 where an order is larger."""
        return np.sqrt(np.maximum(over**2 - m**2, 0.0)) * np.sqrt(np.maximum(over**2 - n**2, 0.0))

    result = np.empty((len(degrees), 3, len(m), len(n)))
    scale = np.divide(2 * degree - 1, np.maximum(size(degree), 1.0), out=result[:, 0])
    np.multiply(scale, m * n / below, out=result[:, 1])
    result[:, 2] = scale * size(below) * (degree / (below * (2 * degree - 1)))
    scale *= degree
    return result


def _recur(
    current: Array,
    previous: Array,
    before: Array,
    degree: int,
    lowest: int,
    cosine: Array,
    factors: Array,
) -> None:
    """Fill |m| < l of the columns that the two degrees below have; the first is `lowest` or -l."""
    k, middle = degree - 1, factors.shape[1] // 2
    first = max(lowest, -k)
    own = slice(first - lowest, first - lowest + previous.shape[2])
    slope, offset, _ = factors[:, middle - k : middle + k + 1, own]
    new = first - max(lowest, -degree)
    target = current[:, 1:-1, new : new + previous.shape[2]]
    np.multiply(slope, cosine, out=target)
    target -= offset
    target *= previous
    if k == 0:
        return
    new = max(lowest, 1 - k) - first
    keep = slice(new, new + before.shape[2])
    target[:, 1:-1, keep] -= factors[2, middle + 1 - k : middle + k, own][:, keep] * before


def _set_edges(current: Array, edge: Array, degree: int, lowest: int) -> None:
    """Fill m = +-l, and n = +-l where it is kept, by d_mn = (-1)^(m-n) d_nm = d_-n,-m.

    `edge` is the row m = l, for the same n of both signs in any number.
    """
    spins = edge.shape[1] // 2
    width = min(degree, spins)
    edge = edge[:, spins - width : spins + width + 1]
    mirrored = (-1.0) ** (degree - np.arange(-width, width + 1)) * edge
    kept = slice(max(lowest, -degree) + width, None)
    current[:, -1] = edge[:, kept]
    current[:, 0] = mirrored[:, ::-1][:, kept]
    if width == degree >= lowest:
        current[..., -1] = mirrored
    if width == degree <= -lowest:
        current[..., 0] = edge[:, ::-1]


_known_couplings = Memo(2**25)
"""What `zonal_coupling` returns. F = 512 and p = 32 take 4.5 MB."""


def clebsch_gordan(degree: ArrayLike, order: ArrayLike, small: int, total: ArrayLike) -> Array:
    """Return ``<l M+s p -s | J M>`` for all orders s = -p .. p.

    They are an eigenvector of J^2, the square of the sum of both angular momenta, whose matrix is
    tridiagonal in s and whose eigenvalue J (J + 1) is known. Its rows are a recurrence, which is
    stable from both ends to where the vector is large. The last of its components that are not 0
    is positive.

    `degree`, `order` and `total`, broadcastable, are l, M and J, and `small` is p.

    Returns an array of shape (2p+1, ...), zero where an order is larger than its degree, or the
    degrees make no triangle.

    References: Varshalovich, Moskalev and Khersonskii 1988, 8.1.1 and 8.1.2 for the vectors, 8.5.2
    (32) for their sign.
    """
    low, over, total = np.broadcast_arrays(*(np.asarray(x, float) for x in (degree, order, total)))
    s = np.arange(-small, small + 1.0).reshape(-1, *[1] * low.ndim)
    m = over + s
    is_state = abs(m) <= low
    own = low * (low + 1) + small * (small + 1) - total * (total + 1) - 2 * s * m
    beside = np.maximum((low - m) * (low + m + 1), 0) * ((small - s) * (small + s + 1))
    np.sqrt(beside, out=beside)
    up, down = is_state.astype(float), is_state.astype(float)
    with np.errstate(all="ignore"):  # of what is no state, or no triangle
        for k in range(2 * small):
            grown = own[k] * up[k] + (beside[k - 1] * up[k - 1] if k else 0.0)
            np.copyto(up[k + 1, ...], grown / -beside[k], where=is_state[k] & is_state[k + 1])
        for k in range(2 * small, 0, -1):
            grown = own[k] * down[k] + (beside[k] * down[k + 1] if k < 2 * small else 0.0)
            np.copyto(down[k - 1, ...], grown / -beside[k - 1], where=is_state[k - 1] & is_state[k])
        # Both have the same ratios where the rows oscillate most.
        width = beside - abs(own)
        width[1:] += beside[:-1]
        place = np.argmax(np.where(is_state, width, -np.inf), axis=0)[None]
        nearby = np.concatenate([place, np.minimum(place + 1, 2 * small)])
        ups, downs = (np.take_along_axis(each, nearby, axis=0) for each in (up, down))
        up *= (ups * downs).sum(axis=0) / (ups * ups).sum(axis=0)
        found = np.where(s + small <= place, up, down)
        found /= np.sqrt((found * found).sum(axis=0))
    is_triangle = (abs(low - small) <= total) & (total <= low + small) & (abs(over) <= total)
    return np.where(is_state & is_triangle, found, 0.0)


def zonal_coupling(order: int, p: int) -> Array:
    """Return ``(-1)^q (<l q p -q | J 0> + <l -q p q | J 0>)`` for all l up to an order.

    The sum is 0 where J - l - p is odd.

    `order` and `p` are the largest degree l, and the other degree.

    Returns an array of shape (order+1, p+1, p+1), indexed [l, q, j] with ``J = l - p + 2 j``; one
    term where q = 0. Zero where q > l, or where no such J >= |l - p| exists.
    """
    kept = kept_order(order)

    def compute() -> Array:
        degree, q = np.arange(kept + 1)[:, None], np.arange(p + 1)
        both = clebsch_gordan(degree, 0, p, degree - p + 2 * q)
        signs = np.where(q > 0, (-1.0) ** q, 0.5)[:, None, None]
        return np.moveaxis((both[p:] + both[p::-1]) * signs, 0, 1)

    return _known_couplings.get((kept, p), compute)[: order + 1]
