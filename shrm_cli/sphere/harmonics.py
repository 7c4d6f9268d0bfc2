"""Associated Legendre functions and the real spherical harmonics of eq. 4.5.

Orthonormal over the sphere, no Condon-Shortley phase, polynomials of world (x, y, z), polar
axis +Z: ``Y_1,-1 = 0.488603 y``, ``Y_10 = 0.488603 z``, ``Y_11 = 0.488603 x``.
"""

import math
from collections.abc import Iterator
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.arrays import Array


def index(degree: int, m: int) -> int:
    """Linear index ``l (l+1) + m`` of a coefficient."""
    return degree * (degree + 1) + m


def order_of(count: int) -> int:
    """Largest degree of a vector of `count` = (order+1)^2 coefficients."""
    return math.isqrt(count) - 1


def degrees(order: int) -> NDArray[np.intp]:
    """Degree l of every linear index up to `order`, shape ((order+1)^2,)."""
    return np.repeat(np.arange(order + 1), 2 * np.arange(order + 1) + 1)


def by_degree(values: Array, axis: int = 0) -> Array:
    """Sum what belongs to each linear index, along an axis, over the indices of each degree."""
    starts = np.arange(order_of(values.shape[axis]) + 1) ** 2
    return np.add.reduceat(values, starts, axis=axis)


def degrees_and_orders(order: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Degree l and order m of every linear index up to a degree, shape ((order+1)^2,) each."""
    degree = degrees(order)
    return degree, np.arange(len(degree)) - degree * (degree + 1)


def polynomial_factors() -> Array:
    """Return the factors of the nine harmonics before 1, y, z, x, xy, yz, 3zz-1, xz and xx-yy."""
    linear, mixed, zonal = np.sqrt(3), np.sqrt(15), np.sqrt(5) / 2
    factors = [1, *[linear] * 3, mixed, mixed, zonal, mixed, mixed / 2]
    return np.array(factors) / np.sqrt(4 * np.pi)


def legendre_degrees(
    order: int, z: ArrayLike, max_m: int | None = None, sine: ArrayLike | None = None
) -> Iterator[tuple[int, Array]]:
    """Yield ``(l, P_l)`` for l = 0 .. order: ``P_l[m] = f_lm(acos z)``.

    ``f_lm`` is the normalized associated Legendre function without Condon-Shortley phase,
    ``Y_lm = f_lm(theta) exp(i m phi)``, so that ``2 pi`` times the integral of ``f_lm^2`` over
    z is 1. The three-term recurrence in l is stable upwards for every m.

    `z` holds cosines of the polar angle, in [-1, 1]. `max_m` is the largest m; every m by default.
    `sine` holds sines of the polar angle, for callers who know them better than z tells, as beside
    poles.

    Yields `l` and `values` of shape (min(l, max_m) + 1, *z.shape).
    """
    z = np.asarray(z, dtype=float)
    last = order if max_m is None else max_m
    sine = np.sqrt((1 - z) * (1 + z)) if sine is None else np.asarray(sine)
    scales, backs = _recurrence(order, min(last, order))
    scales, backs = (each.reshape(*each.shape, *[1] * z.ndim) for each in (scales, backs))
    before = np.empty((0, *z.shape))
    previous = np.full((1, *z.shape), np.sqrt(1 / (4 * np.pi)))
    yield 0, previous
    for degree in range(1, order + 1):
        current = np.empty((min(degree, last) + 1, *z.shape))
        known = current[: len(previous)]
        np.multiply(scales[degree, : len(known)], z, out=known)
        known *= previous
        known[: len(before)] -= backs[degree, : len(before)] * before
        if degree <= last:
            current[degree] = np.sqrt((2 * degree + 1) / (2 * degree)) * sine * previous[-1]
        yield degree, current
        before, previous = previous, current


@lru_cache(maxsize=8)
def _recurrence(order: int, last: int) -> tuple[Array, Array]:
    """Return what ``z P_(l-1)[m]``, and ``P_(l-2)[m]``, which is subtracted, are multiplied with.

    Both are of shape (order+1, last+1), indexed [l, m]; they mean nothing where m >= l.
    """
    return _factors(np.arange(order + 1)[:, None], np.arange(last + 1))


def _factors(degree: NDArray[np.intp], m: NDArray[np.intp]) -> tuple[Array, Array]:
    """Return what `_recurrence` does, of some degrees and orders."""
    below = np.maximum(degree - 1, 0)
    scale = np.sqrt((4 * degree**2 - 1) / np.maximum(degree**2 - m**2, 1) * (degree > 0))
    back = np.sqrt(np.maximum(below**2 - m**2, 0) / np.maximum(4 * below**2 - 1, 1))
    return scale, scale * back


def legendre_table(order: int, z: ArrayLike, max_m: int | None = None, first: int = 0) -> Array:
    """The values of `legendre_degrees` as one array, of ``m = first .. max_m`` alone.

    Returns an array of shape (max_m+1-first, order+1-first, *z.shape): ``[m - first, l - m, ...]``,
    zero where l > order. The parity of ``l - m`` is the parity of the function in z.
    """
    last = (order if max_m is None else max_m) + 1
    shape = last - first, order + 1 - first, *np.shape(z)
    z = np.ravel(np.asarray(z, dtype=float))
    # Those of one l - m lie side by side, of which the recurrence in l makes the next ones.
    table = np.zeros((order + 1 - first, last - first, len(z)))
    sine = np.sqrt((1 - z) * (1 + z))
    highest = np.full(len(z), np.sqrt(1 / (4 * np.pi)))  # f_mm
    for degree in range(min(last, order + 1)):
        if degree:
            highest = np.sqrt((2 * degree + 1) / (2 * degree)) * sine * highest
        if degree >= first:
            table[0, degree - first] = highest
    # The recurrence goes up in all m at once, as far as each of them reaches.
    m = np.arange(first, last)
    scale, back = _factors(m + np.arange(1, order - first + 1)[:, None], m)
    for above in range(1, order - first + 1):
        kept = slice(min(last, order - above + 1) - first)
        current = table[above, kept]
        np.multiply(scale[above - 1, kept, None] * z, table[above - 1, kept], out=current)
        if above > 1:
            current -= back[above - 1, kept, None] * table[above - 2, kept]
    return table.swapaxes(0, 1).reshape(shape)


def real_harmonics(order: int, directions: ArrayLike, first: int = 0) -> Array:
    """Values of the real spherical harmonics (eq. 4.5).

    `directions`, of shape (..., 3), are unit vectors in world axes. `first` is the least degree.

    Returns an array of shape (..., (order+1)^2 - first^2): index l(l+1)+m - first^2.
    """
    return np.ascontiguousarray(np.moveaxis(harmonic_planes(order, directions, first), 0, -1))


def harmonic_planes(order: int, directions: ArrayLike, first: int = 0) -> Array:
    """Values of `real_harmonics`, one array for each, shape ((order+1)^2 - first^2, ...)."""
    directions = np.asarray(directions, dtype=float)
    x, y, z = np.moveaxis(directions, -1, 0)
    sine = np.hypot(x, y)
    safe = np.where(sine > 0, sine, 1.0)
    phase = np.where(sine > 0, x / safe, 1.0) + 1j * (y / safe)
    powers = np.empty((order + 1, *z.shape), dtype=complex)
    powers[0] = np.sqrt(2)
    for m in range(order):  # many times as fast as powers of complex numbers
        powers[m + 1] = powers[m] * phase
    cosines, sines = np.ascontiguousarray(powers.real), np.ascontiguousarray(powers.imag)
    values = np.empty(((order + 1) ** 2 - first**2, *z.shape))
    for degree, legendre in legendre_degrees(order, np.clip(z, -1.0, 1.0), sine=sine):
        if degree < first:
            continue
        center = index(degree, 0) - first**2
        values[center] = legendre[0]
        above = values[center + 1 : center + degree + 1]
        np.multiply(legendre[1:], cosines[1 : degree + 1], out=above)
        below = values[center - degree : center][::-1]
        np.multiply(legendre[1:], sines[1 : degree + 1], out=below)
    return values


def complex_from_real(coefficients: Array, order: int) -> NDArray[np.complexfloating]:
    """Complex coefficients, with Condon-Shortley phase, of a real function.

    `coefficients`, of shape (>= (order+1)^2, ...), are real coefficients, index l(l+1)+m.

    Returns an array of shape (order+1, 2*order+1, ...): ``[l, m + order]``, zero where |m| > l.
    """
    tail = coefficients.shape[1:]
    result = np.zeros((order + 1, 2 * order + 1, *tail), dtype=complex)
    degree = np.arange(order + 1)
    result[:, order] = coefficients[degree * (degree + 1)]
    degree, m = (1 + each for each in np.tril_indices(order))  # of all harmonics with m > 0
    signs = (-1.0) ** m
    center = degree * (degree + 1)
    # f = a Y_m + b Y_-m over the real basis is (a - i b)/sqrt2 over exp(i m phi).
    positive = (coefficients[center + m] - 1j * coefficients[center - m]) / np.sqrt(2)
    result[degree, order + m] = signs.reshape(-1, *[1] * len(tail)) * positive
    result[degree, order - m] = np.conj(positive)
    return result
