"""Between spherical harmonics and double Fourier series: the sphere unrolled to a torus.

On a meridian ``f_lm(theta)`` is a trigonometric polynomial of degree l in theta, of cosines for
even m and of sines for odd m. So a series of order L is, exactly,

    f = sum_mk (A_mk cos(m phi) + B_mk sin(m phi)) trig_m(k theta),   m, k <= L,

``trig_m`` being cos for even m and sin for odd m. `fourier_from_harmonics` is the matrix from
coefficients c_lm to (A, B); `harmonics_from_moments` is its transpose, which turns the moments
of an image with those waves into its coefficients c_lm.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from shrm_cli.parallel import at_once
from shrm_cli.sphere.harmonics import legendre_columns, order_of

Array = NDArray[np.floating]

Tables = tuple[slice, Array, tuple[Array, Array]]
"""Some m, the transform along theta, and the functions of even and of odd l - m of these m."""

_CACHED_ORDER = 96
_TABLE_BYTES = 2**25
"""Memory that the functions of some m may take. All m of order 512 together would take 0.5 GB."""
_SHARED_ORDER, _LEAST_PARTS = 64, 8
"""From this order on the work is split into so many parts at least, for several threads."""
_LARGE = 2**20
"""The numbers in tables and series above which several threads are worth their start."""


def fourier_from_harmonics(coefficients: Array) -> Array:
    """Double Fourier coefficients of real series.

    Parameters
    ----------
    coefficients : ndarray, shape ((order+1)^2, maps)
        One series a column, index l(l+1)+m.

    Returns
    -------
    ndarray, shape (2, order+1, order+1, maps)
        ``[A or B, m, k]``.
    """
    count = order_of(len(coefficients)) + 1
    maps = coefficients.shape[1]
    columns = np.zeros((count, count, 2, maps))
    for m, at, sine in _by_m(count):
        columns[m, : count - m, 0] = coefficients[at]
        if m:
            columns[m, : count - m, 1] = coefficients[sine]
    columns[1:] *= np.sqrt(2)
    flat = columns.reshape(count, count, 2 * maps)
    result = np.empty_like(flat)

    def transform(part: range) -> None:
        for which, matrix, (symmetric, antisymmetric) in _tables(count - 1, part):
            chosen = flat[which, : symmetric.shape[1] + antisymmetric.shape[1]]
            even = symmetric.transpose(0, 2, 1) @ chosen[:, 0::2]
            odd = antisymmetric.transpose(0, 2, 1) @ chosen[:, 1::2]
            circle = np.concatenate([even + odd, (even - odd)[:, -2::-1]], axis=1)
            np.matmul(matrix, circle, out=result[which])

    at_once(transform, _parts(count - 1), _is_large(flat))
    return result.reshape(count, count, 2, maps).transpose(2, 0, 1, 3)


def harmonics_from_moments(moments: Array) -> Array:
    """Coefficients from the integrals of an image with every double Fourier wave.

    Parameters
    ----------
    moments : ndarray, shape (2, order+1, order+1, maps)
        ``[cos or sin of m phi, m, k]``: the image's integral over the sphere with
        ``cos(m phi) trig_m(k theta)``, and with ``sin(m phi) trig_m(k theta)``.

    Returns
    -------
    ndarray, shape ((order+1)^2, maps)
        ``c_lm``, index l(l+1)+m.
    """
    _, count, _, maps = moments.shape
    flat = moments.transpose(1, 2, 0, 3).reshape(count, count, 2 * maps)
    series = np.zeros_like(flat)

    def transform(part: range) -> None:
        for which, matrix, (symmetric, antisymmetric) in _tables(count - 1, part):
            circle = matrix.T @ flat[which]
            rings = symmetric.shape[-1]
            north = circle[:, :rings]
            south = np.zeros_like(north)
            south[:, :-1] = circle[:, :-rings:-1]
            chosen = series[which, : symmetric.shape[1] + antisymmetric.shape[1]]
            chosen[:, 0::2] = symmetric @ (north + south)
            chosen[:, 1::2] = antisymmetric @ (north - south)

    at_once(transform, _parts(count - 1), _is_large(flat))
    columns = series.reshape(count, count, 2, maps)
    columns[1:] *= np.sqrt(2)
    result = np.empty((count**2, maps))
    for m, at, sine in _by_m(count):
        result[at] = columns[m, : count - m, 0]
        if m:
            result[sine] = columns[m, : count - m, 1]
    return result


def _by_m(count: int) -> list[tuple[int, NDArray[np.intp], NDArray[np.intp]]]:
    """For each m: m itself, and the linear indices of (l, m) and of (l, -m), l = m .. order."""
    degree = np.arange(count)
    center = degree * (degree + 1)
    return [(m, center[m:] + m, center[m:] - m) for m in range(count)]


def _parts(order: int) -> list[range]:
    """Split m = 0 .. order into parts of which each has little memory for its tables."""
    rings, parts, start = (order + 2) // 2 + 1, [], 0
    while start <= order:
        fitting = _TABLE_BYTES // (8 * rings * (order + 1 - start))
        fair = -(-(order + 1) // _LEAST_PARTS) if order >= _SHARED_ORDER else order + 1
        stop = min(start + 2 * max(1, min(fitting, fair) // 2), order + 1)
        parts.append(range(start, stop))
        start = stop
    return parts


def _is_large(series: Array) -> bool:
    """Whether several threads are worth their start, for series [m, l or k, map]."""
    count, _, columns = series.shape
    return count**2 * (columns + count / 2) > _LARGE


def _tables(order: int, part: range) -> list[Tables]:
    """What `_make_tables` makes, kept from one call to the next unless it is large."""
    make = _cached_tables if order <= _CACHED_ORDER else _make_tables
    return make(order, part)


def _make_tables(order: int, part: range) -> list[Tables]:
    """Make the transform from samples on half a circle to Fourier coefficients, and f_lm there.

    The samples lie at theta = j pi / n, n > order, which is enough for degree `order`. Functions
    of even and odd l - m are symmetric and antisymmetric about the equator, so they are tabulated
    on one hemisphere only.

    Parameters
    ----------
    order : int
    part : range
        Some m.

    Returns
    -------
    list of (which, matrix, (symmetric, antisymmetric))
        One for even and one for odd m: which m these are; the transform of waves of this parity
        of m, shape (order+1, samples); and the functions of even and odd l - m, shape
        (m, l - m, rings), as far up as the first m reaches.
    """
    rings = (order + 2) // 2 + 1
    intervals = 2 * (rings - 1)
    z = np.cos(np.linspace(0, np.pi / 2, rings))
    table = legendre_columns(order, z, part.start, part.stop)
    found: list[Tables] = []
    for parity, matrix in enumerate(_transforms(order, intervals)):
        first = (part.start + parity) % 2
        own = table[first::2]
        if len(own):
            which = slice(part.start + first, part.stop, 2)
            found.append((which, matrix, (own[:, 0::2], own[:, 1::2])))
    return found


_cached_tables = lru_cache(maxsize=2 * _LEAST_PARTS)(_make_tables)


@lru_cache(maxsize=2)
def _transforms(order: int, intervals: int) -> tuple[Array, Array]:
    """The transforms along theta of even and of odd m, shape (order+1, intervals+1) each."""
    angle = np.outer(np.arange(order + 1), np.arange(intervals + 1)) * (np.pi / intervals)
    weights = np.full(intervals + 1, 2.0 / intervals)
    weights[[0, -1]] /= 2
    cosine, sine = np.cos(angle) * weights, np.sin(angle) * weights
    cosine[0] /= 2
    return cosine, sine
