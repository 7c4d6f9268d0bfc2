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

from shrm_cli.arrays import Array, Indices
from shrm_cli.memo import Memo, kept_order
from shrm_cli.progress import at_once
from shrm_cli.sphere.harmonics import legendre_columns, order_of

_known_places = Memo(2**20)
"""What `places_by_m` returns for some orders; that of order 96 takes 0.1 MB."""

Tables = tuple[slice, Array, tuple[Array, Array]]
"""Some m, the transform along theta, and the functions of even and of odd l - m of these m."""

_KEPT_ORDER = 96
"""The largest order whose tables and matrices are kept."""
_known_tables = Memo(2**24)
"""The tables of each order. Probes need those of one or two, of which order 96 takes 4 MB."""
_known_matrices = Memo(2**24)
"""The matrices of each order. Maps need those of two or three, of which order 96 takes 4 MB."""
_TABLE_BYTES = 2**25
"""Memory that the functions of some m may take. All m of order 512 together would take 0.5 GB."""
_LEAST_PARTS = 8
"""The parts into which the work of orders that are not kept is split at least, for threads."""
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
    columns = np.zeros((count * count, 2, maps))
    place, cosine, sine = places_by_m(count)
    columns[place, 0] = coefficients[cosine]
    columns[place[count:], 1] = coefficients[sine[count:]]
    flat = columns.reshape(count, count, 2 * maps)
    # Where the k lie side by side, syntheses take less time to sort them.
    result = np.empty((count, 2 * maps, count))
    if count <= _KEPT_ORDER + 1:
        kept = kept_order(count - 1) + 1
        for which, above, k, matrices in _known_matrices.get(kept, lambda: fourier_matrices(kept)):
            chosen, target = flat[which, above].transpose(0, 2, 1), result[which, :, k]
            size = len(target), target.shape[2], chosen.shape[2]
            target[...] = chosen @ matrices[: size[0], : size[1], : size[2]].transpose(0, 2, 1)
    else:
        flat[1:] *= np.sqrt(2)
        _transform_circles(flat, result.transpose(0, 2, 1))
    return result.reshape(count, 2, maps, count).transpose(1, 0, 3, 2)


def _transform_circles(flat: Array, result: Array) -> None:
    """Transform series [m, l - m, map] to [m, k, map] by their values on circles."""

    def transform(part: range) -> None:
        for which, matrix, (symmetric, antisymmetric) in _make_tables(len(flat) - 1, part):
            chosen = flat[which, : symmetric.shape[1] + antisymmetric.shape[1]]
            even = symmetric.transpose(0, 2, 1) @ chosen[:, 0::2]
            odd = antisymmetric.transpose(0, 2, 1) @ chosen[:, 1::2]
            circle = np.concatenate([even + odd, (even - odd)[:, -2::-1]], axis=1)
            result[which] = matrix @ circle

    at_once(transform, _parts(len(flat) - 1), _is_large(flat))


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
    columns = series.reshape(count * count, 2, maps)
    columns[count:] *= np.sqrt(2)
    result = np.empty((count**2, maps))
    place, cosine, sine = places_by_m(count)
    result[cosine] = columns[place, 0]
    result[sine[count:]] = columns[place[count:], 1]
    return result


def places_by_m(count: int) -> tuple[Indices, Indices, Indices]:
    """Where the harmonics of m = 0 .. order stand in tables by m, ordered by m and then by l.

    The first `count` of them have m = 0.

    Returns
    -------
    place : ndarray
        The index of [m, l - m] in a table of `count` rows and columns.
    cosine, sine : ndarray
        The linear indices of (l, m) and of (l, -m).
    """
    return _known_places.get(count, lambda: _make_places(count))


def _make_places(count: int) -> tuple[Indices, Indices, Indices]:
    m, above = np.nonzero(np.add.outer(np.arange(count), np.arange(count)) < count)
    center = (m + above) * (m + above + 1)
    return m * count + above, center + m, center - m


def _parts(order: int) -> list[range]:
    """Split m = 0 .. order into parts of which each has little memory for its tables."""
    if order <= _KEPT_ORDER:
        return [range(order + 1)]
    rings, parts, start = (order + 2) // 2 + 1, [], 0
    while start <= order:
        fitting = _TABLE_BYTES // (8 * rings * (order + 1 - start))
        fair = -(-(order + 1) // _LEAST_PARTS)
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
    if order > _KEPT_ORDER:
        return _make_tables(order, part)
    return _known_tables.get((order, part), lambda: _make_tables(order, part))


def fourier_matrices(count: int) -> list[tuple[slice, slice, slice, Array]]:
    """The whole transform from coefficients of one m to Fourier coefficients, for all m.

    The factor sqrt(2) of real harmonics with m > 0 is in the matrices.

    By symmetry about the equator even l only have waves of even k, and odd l those of odd k.

    Returns
    -------
    list of (which, above, k, matrices)
        Some m, the l - m and the k that they are about, as slices; and ndarray, shape
        (m, k, l - m).
    """
    found: list[tuple[slice, slice, slice, Array]] = []
    for which, matrix, tables in _make_tables(count - 1, range(count)):
        parity, rings = which.start % 2, tables[0].shape[-1]
        for above, sign in enumerate((1.0, -1.0)):
            k = slice((parity + above) % 2, None, 2)
            both = matrix[k, :rings].copy()
            both[:, :-1] += sign * matrix[k, :-rings:-1]
            matrices = both @ tables[above].transpose(0, 2, 1)
            matrices[which.start == 0 :] *= np.sqrt(2)  # not those of m = 0
            found.append((which, slice(above, None, 2), k, matrices))
    return found


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


@lru_cache(maxsize=2)
def _transforms(order: int, intervals: int) -> tuple[Array, Array]:
    """The transforms along theta of even and of odd m, shape (order+1, intervals+1) each."""
    angle = np.outer(np.arange(order + 1), np.arange(intervals + 1)) * (np.pi / intervals)
    weights = np.full(intervals + 1, 2.0 / intervals)
    weights[[0, -1]] /= 2
    cosine, sine = np.cos(angle) * weights, np.sin(angle) * weights
    cosine[0] /= 2
    return cosine, sine
