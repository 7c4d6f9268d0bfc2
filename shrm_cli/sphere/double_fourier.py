"""Fast sums of spherical harmonics: by double Fourier series, and by octants for small cubes.

Double Fourier series are those of the sphere unrolled to a torus.

On a meridian ``f_lm(theta)`` is a trigonometric polynomial of degree l in theta, of cosines for
even m and of sines for odd m. So a series of order L is, exactly,

    f = sum_mk (A_mk cos(m phi) + B_mk sin(m phi)) trig_m(k theta),   m, k <= L,

``trig_m`` being cos for even m and sin for odd m. `fourier_from_harmonics` is the matrix from
coefficients c_lm to (A, B); `harmonics_from_moments` is its transpose, which turns the moments
of an image with those waves into its coefficients c_lm.

On small cubes one matrix product a symmetry is faster. Every real harmonic is even or odd in each
of x, y and z. The harmonics fall into eight classes accordingly, and what a class adds to a texel
is known up to its sign in all eight octants from the texel's mirror image in the first one. So a
series is summed class by class, at the texels of one octant only, by a product with a table of
harmonics that many series share; sums and differences of the classes are its values in all octants.
To exchange x and y is to reorder the coefficients, so that the faces of y, and half of those of z,
need no table of their own. That takes ``3/4 N^2 (F+1)^2`` steps a map. The meridians of
`shrm_cli.sphere.synthesis` take fewer from some size on, but in arrays so small for small cubes
that most of the time is not arithmetic.
"""

from collections.abc import Iterator
from functools import cache, lru_cache

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array, Indices, Memo, kept_order, slices
from shrm_cli.progress import at_once
from shrm_cli.sphere import harmonics
from shrm_cli.sphere.cube import face_axes
from shrm_cli.sphere.directions import normalize
from shrm_cli.sphere.quadrature import nodes
from shrm_cli.sphere.wigner import KEPT_ORDER, right_angle_rows, shared_order
from shrm_cli.vocabulary import FACES, Sampling

Tables = tuple[slice, Array, tuple[Array, Array]]
"""Some m, the transform along theta, and the functions of even and of odd l - m of these m."""

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

    `coefficients`, of shape ((order+1)^2, maps), are one series a column, index l(l+1)+m.

    Returns an array of shape (2, order+1, order+1, maps): ``[A or B, m, k]``.
    """
    count = harmonics.order_of(len(coefficients)) + 1
    maps = coefficients.shape[1]
    columns = np.zeros((count * count, 2, maps))
    place, cosine, sine = places_by_m(count)
    columns[place, 0] = coefficients[cosine]
    columns[place[count:], 1] = coefficients[sine[count:]]
    flat = columns.reshape(count, count, 2 * maps)
    # Where the k lie side by side, syntheses take less time to sort them.
    result = np.empty((count, 2 * maps, count))
    if count <= KEPT_ORDER + 1:
        for which, above, k, matrices in _kept_matrices(count):
            result[which, :, k] = flat[which, above].transpose(0, 2, 1) @ matrices
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

    `moments`, of shape (2, order+1, order+1, maps), are ``[cos or sin of m phi, m, k]``: the
    image's integral over the sphere with ``cos(m phi) trig_m(k theta)``, and with ``sin(m phi)
    trig_m(k theta)``.

    Returns an array of shape ((order+1)^2, maps): ``c_lm``, index l(l+1)+m.
    """
    _, count, _, maps = moments.shape
    flat = moments.transpose(1, 2, 0, 3).reshape(count, count, 2 * maps)
    series = np.zeros_like(flat)
    if count <= KEPT_ORDER + 1:
        for which, above, k, matrices in _kept_matrices(count):
            series[which, above] = matrices @ flat[which, k]
    else:
        _transform_moments(flat, series)
        series[1:] *= np.sqrt(2)
    columns = series.reshape(count * count, 2, maps)
    result = np.empty((count**2, maps))
    place, cosine, sine = places_by_m(count)
    result[cosine] = columns[place, 0]
    result[sine[count:]] = columns[place[count:], 1]
    return result


def _transform_moments(flat: Array, result: Array) -> None:
    """Transform moments [m, k, map] to [m, l - m, map] by their values on circles."""

    def transform(part: range) -> None:
        for which, matrix, (symmetric, antisymmetric) in _make_tables(len(flat) - 1, part):
            # One product of all m takes far less time than one for each of them.
            circle = np.tensordot(matrix, flat[which], (0, 1))
            north = circle[: symmetric.shape[-1]]
            south = np.zeros_like(north)
            south[:-1] = circle[: -len(north) : -1]
            chosen = result[which, : symmetric.shape[1] + antisymmetric.shape[1]]
            chosen[:, 0::2] = symmetric @ (north + south).swapaxes(0, 1)
            chosen[:, 1::2] = antisymmetric @ (north - south).swapaxes(0, 1)

    at_once(transform, _parts(len(flat) - 1), _is_large(flat))


def places_by_m(count: int) -> tuple[Indices, Indices, Indices]:
    """Where the harmonics of m = 0 .. order stand in tables by m, ordered by m and then by l.

    The first `count` of them have m = 0.

    Returns `place`, the index of [m, l - m] in a table of `count` rows and columns; and `cosine`,
    `sine`, the linear indices of (l, m) and of (l, -m).
    """
    m, above = np.nonzero(np.add.outer(np.arange(count), np.arange(count)) < count)
    center = (m + above) * (m + above + 1)
    return m * count + above, center + m, center - m


def _parts(order: int) -> list[range]:
    """Split m = 0 .. order into parts of which each has little memory for its tables."""
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


def fourier_matrices(count: int) -> list[tuple[slice, slice, slice, Array]]:
    """The whole transform from coefficients of one m to Fourier coefficients, for all m.

    The factor sqrt(2) of real harmonics with m > 0 is in the matrices.

    By symmetry about the equator even l only have waves of even k, and odd l those of odd k.

    Returns matrices of shape (m, k, l - m), behind the m, the l - m and the k that they are about,
    as slices. What stands where l > order means nothing.

    References: Trapani & Navaza 2006, Acta Cryst. A62: ``d^l_m0(theta)`` is the sum of ``i^m
    d^l_km(pi/2) d^l_k0(pi/2) exp(-i k theta)`` over k = -l .. l, whose terms of -k are those of k
    times (-1)^m.
    """
    rows, at = right_angle_rows(count - 1), np.arange(count)
    zonal = rows[at, at] * np.where(at > 0, 2.0, 1.0)  # d^l_0k
    zonal *= np.sqrt((2 * at[:, None] + 1) / (4 * np.pi))
    signs = np.where(at > 0, np.sqrt(2), 1.0) * (-1.0) ** (at // 2)  # of m
    found: list[tuple[slice, slice, slice, Array]] = []
    for parity, above in np.ndindex(2, 2):
        which, some = slice(parity, None, 2), slice(above, None, 2)
        k = slice((parity + above) % 2, None, 2)
        degree = np.minimum(at[which, None] + at[some], count - 1)
        matrices = rows[at[some], degree, k] * zonal[degree, k]
        matrices *= signs[which, None, None]
        # Products of many series are twice as fast with the l - m side by side.
        found.append((which, some, k, np.ascontiguousarray(matrices.transpose(0, 2, 1))))
    return found


def _kept_matrices(count: int) -> Iterator[tuple[slice, slice, slice, Array]]:
    """Yield what `fourier_matrices` returns, transposed, which is kept for the next time."""
    kept = shared_order(count - 1) + 1
    for which, above, k, matrices in _known_matrices.get(kept, lambda: fourier_matrices(kept)):
        sizes = (slice(len(range(count)[each])) for each in (which, k, above))
        yield which, above, k, matrices[tuple(sizes)].transpose(0, 2, 1)


def _make_tables(order: int, part: range) -> list[Tables]:
    """Make the transform from samples on half a circle to Fourier coefficients, and f_lm there.

    The samples lie at theta = j pi / n, n > order, which is enough for degree `order`. Functions
    of even and odd l - m are symmetric and antisymmetric about the equator, so they are tabulated
    on one hemisphere only.

    `part` is some m.

    Returns a tuple for even and one for odd m: which m these are; the transform of waves of this
    parity of m, shape (order+1, samples); and the functions of even and odd l - m, shape (m, l - m,
    rings), as far up as the first m reaches.
    """
    rings = (order + 2) // 2 + 1
    intervals = 2 * (rings - 1)
    z = np.cos(np.linspace(0, np.pi / 2, rings))
    table = harmonics.legendre_table(order, z, part.stop - 1, part.start)
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


MOST_VALUES = 3 * 2**19
"""The most numbers of a table of harmonics, 6 MB in single precision."""
_known_octants = Memo(2**25)
"""Tables of some sizes and orders; size 32 and order 48 take 3.8 MB in single precision."""
_CACHED_BYTES = 2**21
"""Memory of the values of some maps, so that they stay in the processor's cache."""


def is_small_cube(order: int, size: int) -> bool:
    """Whether series of an order are synthesized here on a cube with so many texels an edge.

    This decides by order and size alone, so that the same series have the same values always.
    """
    half = (size + 1) // 2
    return 2 * half**2 * (kept_order(order) + 1) ** 2 <= MOST_VALUES


def synthesize_octants(coefficients: Array, size: int, sampling: Sampling, dtype: type) -> Array:
    """Values of real series, of an order that `is_small_cube` takes, at the texels of a cube."""
    order, maps = harmonics.order_of(len(coefficients)), coefficients.shape[1]
    kept = kept_order(order)
    key = kept, size, sampling, np.dtype(dtype)
    tables = _known_octants.get(key, lambda: _octant_tables(kept, size, sampling, dtype))
    half = (size + 1) // 2
    result: Array = np.empty((maps, len(FACES), size, size), dtype=dtype)
    for part in slices(maps, _CACHED_BYTES // (8 * 3 * half**2 * result.itemsize)):
        _fill(_class_values(coefficients[:, part], tables, half, dtype), result[part])
    return result.reshape(maps, 6 * size, size)


def _class_values(coefficients: Array, tables: list[Array], half: int, dtype: type) -> Array:
    """Return what the harmonics of each class add to the texels of the first octant.

    Returns an array of shape (2, 2, 2, maps, 3, half, half), by the parities in x, y and z, and by
    the axis of the texel's face.
    """
    order, maps = harmonics.order_of(len(coefficients)), coefficients.shape[1]
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
    degree = harmonics.degrees(order)
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
    degree, m = harmonics.degrees_and_orders(order)
    # Y_lm of m >= 0 is a real part of (x + iy)^m, that of m < 0 an imaginary part of (x + iy)^|m|;
    # the degree of both as polynomials of x, y and z is that of l but for even powers.
    odd_y = m < 0
    odd_x, odd_z = (m + odd_y) % 2, (degree - m) % 2
    number = 4 * odd_x + 2 * odd_y + odd_z
    return [np.flatnonzero(number == each) for each in range(8)]


def _octant_tables(order: int, size: int, sampling: Sampling, dtype: type) -> list[Array]:
    """Return the harmonics of each class, ``[texel, harmonic]``, at the texels of `_octant`."""
    values: Array = harmonics.harmonic_planes(order, _octant(size, sampling)).astype(dtype)
    return [np.ascontiguousarray(values[rows].T) for rows in _classes(order)]


def _octant(size: int, sampling: Sampling) -> Array:
    """Unit directions of texels with no negative coordinate, shape (n, 3).

    Those of +X come first, whose coordinates rise down and to the right, and then those of +Z
    whose row is no less than their column.
    """
    axis = nodes(size, sampling)[size // 2 :]
    right, down, forward = np.abs(np.moveaxis(face_axes()[::4], 1, 0))[..., None, None, :]
    points = forward + right * axis[None, :, None] + down * axis[:, None, None]
    some = points[0].reshape(-1, 3), points[1][np.tril_indices(len(axis))]
    return normalize(np.concatenate(some))


def _fill(values: Array, result: Array) -> None:
    """Write the values in all octants, from those of the classes in one, into faces.

    `values`, of shape (2, 2, 2, maps, 3, half, half), are what `_class_values` returns. They are
    overwritten. `result` is of shape (maps, 6, N, N).
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

    `negative` tells for x, y and z whether the octant lies on their negative side.
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
