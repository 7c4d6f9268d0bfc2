"""Synthesis of spherical harmonic series on small cubes, by one matrix product a symmetry.

Every real harmonic is even or odd in each of x, y and z. The harmonics fall into eight classes
accordingly, and what a class adds to a texel is known up to its sign in all eight octants from the
texel's mirror image in the first one. So a series is summed class by class, at the texels of one
octant only, by a product with a table of harmonics that many series share; sums and differences of
the classes are its values in all octants. To exchange x and y is to reorder the coefficients, so
that the faces of y, and half of those of z, need no table of their own.

That takes ``3/4 N^2 (F+1)^2`` steps a map. The meridians of `shrm_cli.sphere.synthesis` take fewer
from some size on, but in arrays so small for small cubes that most of the time is not arithmetic.
"""

from functools import cache, lru_cache

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array
from shrm_cli.memo import Memo, kept_order
from shrm_cli.sphere.cube import face_axes
from shrm_cli.sphere.harmonics import degrees, harmonic_planes, order_of
from shrm_cli.sphere.quadrature import nodes
from shrm_cli.vocabulary import FACES, Sampling

MOST_VALUES = 3 * 2**19
"""The most numbers of a table of harmonics, 6 MB in single precision."""
_known_tables = Memo(2**25)
"""Tables of some sizes and orders; size 32 and order 48 take 3.8 MB in single precision."""
_CACHED_BYTES = 2**21
"""Memory of the values of some maps, so that they stay in the processor's cache."""


def is_small(order: int, size: int) -> bool:
    """Whether series of an order are synthesized here on a cube with so many texels an edge.

    This decides by order and size alone, so that the same series have the same values always.
    """
    half = (size + 1) // 2
    return 2 * half**2 * (kept_order(order) + 1) ** 2 <= MOST_VALUES


def synthesize(coefficients: Array, size: int, sampling: Sampling, dtype: type) -> Array:
    """Values of real series, of an order that `is_small`, at the texels of a cube.

    Parameters and result are those of `shrm_cli.sphere.synthesis.synthesize_cube`.
    """
    order, maps = order_of(len(coefficients)), coefficients.shape[1]
    kept = kept_order(order)
    key = kept, size, sampling, np.dtype(dtype)
    tables = _known_tables.get(key, lambda: _tables(kept, size, sampling, dtype))
    half = (size + 1) // 2
    result: Array = np.empty((maps, len(FACES), size, size), dtype=dtype)
    step = max(1, _CACHED_BYTES // (8 * 3 * half**2 * result.itemsize))
    for start in range(0, maps, step):
        part = slice(start, start + step)
        _fill(_class_values(coefficients[:, part], tables, half, dtype), result[part])
    return result.reshape(maps, 6 * size, size)


def _class_values(coefficients: Array, tables: list[Array], half: int, dtype: type) -> Array:
    """Return what the harmonics of each class add to the texels of the first octant.

    Returns
    -------
    ndarray, shape (2, 2, 2, maps, 3, half, half)
        By the parities in x, y and z, and by the axis of the texel's face.
    """
    order, maps = order_of(len(coefficients)), coefficients.shape[1]
    source, sign = _exchanged(order)
    # The series, and with x and y exchanged, which belong to the class of [y, x, z].
    both = np.concatenate([coefficients, coefficients[source] * sign[:, None]], axis=1)
    both = both.astype(dtype)
    values: Array = np.empty((2, 2, 2, maps, 3, half, half), dtype=dtype)
    low, high = np.tril_indices(half)
    for (x, y, z), rows, table in zip(np.ndindex(2, 2, 2), _classes(order), tables, strict=True):
        # The large factor is the first, which BLAS libraries take less time for.
        found = table[:, : len(rows)] @ both[rows]
        sides = found[: half**2].reshape(half, half, 2, maps)
        values[x, y, z, :, 0] = sides[:, :, 0].transpose(2, 0, 1)
        # On +Y, x rises to the right; on +X, y rises downwards.
        values[y, x, z, :, 1] = sides[:, :, 1].transpose(2, 1, 0)
        values[x, y, z, :, 2, low, high] = found[half**2 :, :maps]
        values[y, x, z, :, 2, high, low] = found[half**2 :, maps:]
    return values


@lru_cache(maxsize=64)
def _exchanged(order: int) -> tuple[NDArray[np.intp], Array]:
    """Return where the coefficients of f(y, x, z) are found among those of f, and their signs.

    To exchange x and y is to turn the longitude phi into ``pi/2 - phi``.
    """
    degree = degrees(order)
    middle = degree * (degree + 1)
    m = np.arange(len(degree)) - middle
    # cos(m (pi/2 - phi)) is cos(m pi/2) cos(m phi) or sin(m pi/2) sin(m phi), for even and odd m.
    # sin(m (pi/2 - phi)) is -cos(m pi/2) sin(m phi) or sin(m pi/2) cos(m phi).
    source = np.where(m % 2 == 0, middle + m, middle - m)
    sign = np.where((abs(m) // 2) % 2 == 0, 1.0, -1.0) * np.where((m < 0) & (m % 2 == 0), -1, 1)
    return source, sign


@lru_cache(maxsize=64)
def _classes(order: int) -> list[NDArray[np.intp]]:
    """Return the linear indices of the harmonics of each class, rising in degree.

    The classes are numbered ``4 x + 2 y + z``, where x is 1 for those that are odd in x.
    """
    degree = degrees(order)
    m = np.arange(len(degree)) - degree * (degree + 1)
    # Y_lm of m >= 0 is a real part of (x + iy)^m, that of m < 0 an imaginary part of (x + iy)^|m|;
    # the degree of both as polynomials of x, y and z is that of l but for even powers.
    odd_y = m < 0
    odd_x, odd_z = (m + odd_y) % 2, (degree - m) % 2
    number = 4 * odd_x + 2 * odd_y + odd_z
    return [np.flatnonzero(number == each) for each in range(8)]


def _tables(order: int, size: int, sampling: Sampling, dtype: type) -> list[Array]:
    """Return the harmonics of each class, ``[texel, harmonic]``, at the texels of `_octant`."""
    values: Array = harmonic_planes(order, _octant(size, sampling)).astype(dtype)
    return [np.ascontiguousarray(values[rows].T) for rows in _classes(order)]


def _octant(size: int, sampling: Sampling) -> Array:
    """Unit directions of texels with no negative coordinate, shape (n, 3).

    Those of +X come first, whose coordinates rise down and to the right, and then those of +Z
    whose row is no less than their column.
    """
    axis = nodes(size, sampling)[size // 2 :]
    right, down, forward = np.abs(np.moveaxis(face_axes()[::4], 1, 0))[..., None, None, :]
    points = forward + right * axis[None, :, None] + down * axis[:, None, None]
    points = np.concatenate([points[0].reshape(-1, 3), points[1][np.tril_indices(len(axis))]])
    return np.asarray(points / np.linalg.norm(points, axis=1, keepdims=True))


def _fill(values: Array, result: Array) -> None:
    """Write the values in all octants, from those of the classes in one, into faces.

    Parameters
    ----------
    values : ndarray, shape (2, 2, 2, maps, 3, half, half)
        What `_class_values` returns. They are overwritten.
    result : ndarray, shape (maps, 6, N, N)
    """
    for even, odd in ((values[0], values[1]), (values[:, 0], values[:, 1])):
        difference = even - odd
        even += odd
        odd[...] = difference
    for x, y in np.ndindex(2, 2):
        even, odd = values[x, y]
        for z, combine in enumerate((np.add, np.subtract)):
            for axis, (face, rows, columns) in enumerate(_places((x, y, z), result.shape[-1])):
                combine(even[:, axis], odd[:, axis], out=result[:, face, rows, columns])


@cache
def _places(negative: tuple[int, int, int], size: int) -> list[tuple[int, slice, slice]]:
    """Return the face, and the rows and columns on it, that an octant has of each axis.

    Parameters
    ----------
    negative : tuple of int
        For x, y and z whether the octant lies on their negative side.
    size : int
    """
    rising, falling = slice(size // 2, None), slice((size + 1) // 2 - 1, None, -1)
    places = []
    for axis in range(3):
        face = 2 * axis + negative[axis]
        right, down, _ = face_axes()[face]
        # To the right of the middle is the side that the face's axis points to.
        across, along = (
            rising if (step.sum() < 0) == negative[int(np.argmax(np.abs(step)))] else falling
            for step in (right, down)
        )
        places.append((face, along, across))
    return places
