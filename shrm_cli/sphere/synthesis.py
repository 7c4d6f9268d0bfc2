"""Synthesis of spherical harmonic series on the texels of a cube.

The method rests on two facts. Every texel row of a face that does not contain the polar axis
lies on one meridian, if the axis is parallel to the rows (a constant x/y is a plane through the
z axis); and on a meridian a series of order L is a trigonometric polynomial of degree L:

    f(theta, phi) = sum_k a_k(phi) cos(k theta) + b_k(phi) sin(k theta),   k <= L,

where even m make the a_k and odd m the b_k. So the sum over (L+1)^2 coefficients at each of
6 N^2 texels becomes two short ones, over m for each of the 6 N rows and over k for each texel:
O(L) operations a texel instead of O(L^2), all of them matrix products. The rows of +-X run
along z, those of +-Y and +-Z along x, so the series is used as it is and with x as its polar
axis. Values are exact at each texel: no intermediate image is interpolated, and there is no pole.

Small cubes are left to the octants of `shrm_cli.sphere.double_fourier`, which have less to do
beside the arithmetic.
"""

from collections.abc import Mapping
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array, Indices, Memo, slices
from shrm_cli.progress import at_once, in_order
from shrm_cli.sphere import double_fourier
from shrm_cli.sphere.double_fourier import fourier_from_harmonics, harmonics_from_moments
from shrm_cli.sphere.harmonics import degrees, order_of
from shrm_cli.sphere.quadrature import nodes
from shrm_cli.sphere.rotation import rotated_again, transform_coefficients
from shrm_cli.vocabulary import FACES, Sampling

X_POLAR = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
"""Rows: the world axes y, z, x, which are x', y' and the polar z' of the turned series."""

Quadrants = tuple[tuple[int, str, bool, bool], ...]
"""Quadrant q holds the points (1, s, t), s and t in [-1, 1], turned by q * 90 degrees about the
polar axis. Each row is a quadrant, the face that it is, whether the face's rows go down as s falls,
and whether its columns go right as t falls."""

ALONG_Z = ((0, "+X", True, False), (2, "-X", False, True))
ALONG_X = (
    (0, "+Y", True, False),
    (1, "+Z", False, True),
    (2, "-Y", True, False),
    (3, "-Z", True, False),
)
_AXES = ALONG_Z, ALONG_X

_known_waves = Memo(2**24)
"""Waves of some sizes and orders, those of size 64 and order 64 take 1.1 MB in single precision."""
_BLOCK_BYTES = 2**26
"""Memory that the intermediate arrays of some maps may take."""
_TURNED_BYTES = 200
"""What a coefficient takes while it is turned."""
_KEPT_BYTES = 2**24
"""Memory of series up to which the turned ones are kept for further cubes."""
_WAVE_BYTES = 40
"""What a wave at a texel takes while it is computed: complex, and twice as cosine and sine."""
_LARGE = 2**24
"""The values of series, times rows, above which several threads are worth their start."""
_CACHED_BYTES = 2**21
"""Memory of what is evaluated in one go, so that it stays in the processor's cache."""


def synthesize_cube(
    coefficients: Array, size: int, sampling: Sampling = "center", dtype: type = np.float64
) -> Array:
    """Values of real spherical harmonic series at the texels of a cube.

    `coefficients`, of shape ((order+1)^2, maps), are one series a column, index l(l+1)+m. `dtype`
    is the precision of the products and of the result.

    Returns an array of shape (maps, 6 size, size): planes in OpenEXR's face order and orientation.
    """
    return CubeSeries(coefficients).planes(size, sampling, dtype)


class CubeSeries:
    """Series that are synthesized on several cubes, each with its own factors of their degrees.

    They are turned once, because turning does not mix degrees, and their double Fourier sums are
    found once where the degrees are as they are, and the series are not too many.

    `coefficients`, of shape ((order+1)^2, maps), are one series a column, index l(l+1)+m.
    """

    def __init__(self, coefficients: Array) -> None:
        self._series = coefficients

    @property
    def order(self) -> int:
        """The largest degree of the series."""
        return order_of(len(self._series))

    def _both_of(self, part: slice) -> Array:
        """Return some of the series as they are, and turned, shape ((order+1)^2, 2, maps)."""
        return self._both[:, :, part] if self._is_kept else _with_turned(self._series[:, part])

    @property
    def _is_kept(self) -> bool:
        """Whether the turned series are kept; many of them are turned anew for each cube."""
        return self._series.nbytes <= _KEPT_BYTES

    @cached_property
    def _both(self) -> Array:
        return _with_turned(self._series)

    @cached_property
    def _fourier(self) -> list[Array]:
        return _double_fourier(self._both)

    def planes(
        self,
        size: int,
        sampling: Sampling = "center",
        dtype: type = np.float64,
        factors: Array | None = None,
    ) -> Array:
        """Values at the texels of a cube, shape (maps, 6 size, size).

        `factors`, of shape (degrees,), are what the degrees are multiplied with, no more of them
        than the series have. Further degrees are left out. By default the series are taken as they
        are.
        """
        order = self.order if factors is None else len(factors) - 1
        degree = degrees(order)
        if double_fourier.is_small_cube(order, size):
            series = self._series[: len(degree)]
            series = series if factors is None else series * factors[degree, None]
            return double_fourier.synthesize_octants(series, size, sampling, dtype)
        count, maps = order + 1, self._series.shape[1]
        result: Array = np.empty((maps, 6, size, size), dtype=dtype)
        map_bytes = result.itemsize * 16 * min(size, count) * count
        if not self._is_kept:
            map_bytes += _TURNED_BYTES * count**2
        for part in slices(maps, _BLOCK_BYTES // map_bytes):
            is_whole = factors is None and len(result[part]) == maps
            fourier = self._fourier if is_whole else self._fourier_of(part, degree, factors)
            _fill_faces(fourier, nodes(size, sampling), result[part])
        return result.reshape(maps, 6 * size, size)

    def _fourier_of(self, part: slice, degree: Indices, factors: Array | None) -> list[Array]:
        """Return the double Fourier sums of some of the series, whose degrees have factors."""
        both = self._both_of(part)[: len(degree)]
        return _double_fourier(both if factors is None else both * factors[degree, None, None])


def _with_turned(series: Array) -> Array:
    return np.stack([series, rotated_again(series, X_POLAR)], axis=1)


def _double_fourier(both: Array) -> list[Array]:
    """The double Fourier sums of series as they are, and turned, ``[l (l+1) + m, which, map]``."""
    waves = fourier_from_harmonics(both.reshape(len(both), -1))
    halves = waves.reshape(*waves.shape[:3], 2, -1)
    return [halves[..., which, :] for which in (0, 1)]


def _fill_faces(fourier: list[Array], s: Array, result: Array) -> None:
    """Evaluate all faces into `result`, (maps, 6, N, N), from both series' double Fourier sums.

    It is done for some rows of all maps at a time: the waves of a large cube take longer than sums.
    """
    half = s[len(s) // 2 :]  # s >= 0; the rest is its mirror image
    count, maps = fourier[0].shape[1], len(result)
    step = _rows_at_once(len(ALONG_X) * maps * result.itemsize, count, len(half))
    row_bytes = 4 * sum(map(len, _AXES)) * maps * count * result.itemsize
    series = [_by_parity(each, result.dtype) for each in fourier]
    for block in slices(len(half), step * max(_BLOCK_BYTES // (row_bytes * step), 1)):
        _fill_rows(series, half, block, step, result)


def _by_parity(fourier: Array, dtype: np.dtype[Any]) -> tuple[Array, Array]:
    """Double Fourier sums of even and of odd m, each of shape (2, m, maps, k), in a precision."""
    even, odd = (fourier[:, parity::2].transpose(0, 1, 3, 2) for parity in (0, 1))
    return even.astype(dtype, order="C"), odd.astype(dtype, order="C")


def _fill_rows(
    series: list[tuple[Array, Array]], half: Array, block: slice, step: int, result: Array
) -> None:
    """Evaluate a block of the rows of `_fill_faces`, so many of them at once."""
    maps, count = series[0][0].shape[2:]
    is_large = 2 * count**2 * maps * len(half) > _LARGE

    def along(axis: int) -> tuple[Array, Array]:
        quadrants = [face[0] for face in _AXES[axis]]
        return _meridians(series[axis], quadrants, half[block])

    parts = list(zip(_AXES, in_order(along, range(len(_AXES)), is_large), strict=True))

    def fill(start: int) -> None:
        rows = slice(start, min(start + step, block.stop))
        own = slice(rows.start - block.start, rows.stop - block.start)
        same, opposite = _kept_waves(count, half[rows], half, result.dtype)
        for faces, (symmetric, antisymmetric) in parts:
            even, odd = symmetric[own] @ same, antisymmetric[own] @ opposite
            _store_rows(even, odd, faces, start, result)

    at_once(fill, range(block.start, block.stop, step), is_large)


def _rows_at_once(series_bytes: int, count: int, half: int) -> int:
    """Return for how many rows values stay in the processor's cache, and waves within bounds.

    `series_bytes` are the bytes that a single value of each face and map takes. `count` is the
    number of waves, order + 1. `half` is half of the texels along a row.
    """
    values = 2 * series_bytes * half
    waves = _WAVE_BYTES * count * half
    return max(1, min(_CACHED_BYTES // values, _BLOCK_BYTES // waves))


def _store_rows(even: Array, odd: Array, faces: Quadrants, start: int, result: Array) -> None:
    """Add symmetric and antisymmetric parts, and their mirror images, into the rows of faces."""
    maps, size = len(result), result.shape[-1]
    half = even.shape[-1]
    shape = (len(even), len(faces), 2, maps, half)
    even, odd = even.reshape(shape), odd.reshape(shape)
    at = np.arange(start, start + len(even))
    for k, (_, name, s_falls, t_falls) in enumerate(faces):
        for side, column in ((0, size // 2 + at), (1, half - 1 - at)):
            row = size - 1 - column if s_falls else column
            target = result[:, FACES.index(name), _span(row)].transpose(1, 0, 2)
            if t_falls:
                target = target[..., ::-1]
            np.add(even[:, k, side], odd[:, k, side], out=target[..., size // 2 :])
            mirrored = target[..., half - 1 :: -1]
            np.subtract(even[:, k, side], odd[:, k, side], out=mirrored)


def _span(indices: NDArray[np.intp]) -> slice:
    """The slice that consecutive indices, rising or falling, stand for."""
    first, last = int(indices[0]), int(indices[-1])
    if first <= last:
        return slice(first, last + 1)
    return slice(first, None if last == 0 else last - 1, -1)


def _meridians(
    series: tuple[Array, Array], quadrants: list[int], half: Array
) -> tuple[Array, Array]:
    """Fourier coefficients in theta along the meridians through s = +-half of each quadrant.

    `series` are what `_by_parity` returns.

    Returns `symmetric` and `antisymmetric`, each of shape (len(half), quadrants * 2 * maps, about
    order+1), coefficients of the waves that keep and that change their sign under theta -> pi -
    theta, in the order that `meridian_waves` has.
    """
    maps, count = series[0].shape[2:]
    waves = longitude_waves(count, quadrants, half, series[0].dtype)
    a, b = (
        (along @ each.reshape(-1, maps * count)).reshape(len(half), -1, count)
        for along, each in zip(waves, series, strict=True)
    )
    return (
        np.concatenate([a[..., 0::2], b[..., 1::2]], axis=-1),
        np.concatenate([a[..., 1::2], b[..., 0::2]], axis=-1),
    )


def longitude_waves(
    count: int, quadrants: list[int], half: Array, dtype: np.dtype[Any]
) -> tuple[Array, Array]:
    """Cosines and sines of m times the longitudes of `_meridians`, m < count.

    Returns `even` and `odd`, each of shape (longitudes, about count), those of even and of odd m;
    the cosines come first.
    """

    def make() -> tuple[Array, Array]:
        offset = np.arctan(half)
        # The rows s = +-half of each quadrant, in the order (half, quadrant, sign).
        rows = [[q * np.pi / 2 + offset, q * np.pi / 2 - offset] for q in quadrants]
        phi = np.moveaxis(np.array(rows), -1, 0).reshape(-1)
        products = (np.outer(phi, np.arange(parity, count, 2)) for parity in (0, 1))
        even, odd = (np.concatenate([np.cos(p), np.sin(p)], axis=1).astype(dtype) for p in products)
        return even, odd

    key = "longitudes", count, tuple(quadrants), half.tobytes(), np.dtype(dtype)
    return _known_waves.get(key, make)


def _kept_waves(count: int, s: Array, t: Array, dtype: np.dtype[Any]) -> tuple[Array, Array]:
    """What `meridian_waves` returns, in a precision; it is kept from one call to the next."""

    def make() -> tuple[Array, Array]:
        same, opposite = meridian_waves(count, s, t)
        return same.astype(dtype), opposite.astype(dtype)

    return _known_waves.get((count, s.tobytes(), t.tobytes(), np.dtype(dtype)), make)


def meridian_waves(count: int, s: Array, t: Array) -> tuple[Array, Array]:
    """Waves cos(k theta) and sin(k theta), k < count, at the points (1, s, t) / |(1, s, t)|.

    They are sorted by their symmetry about the equator:
    ``cos(k (pi - theta)) = (-1)^k cos(k theta)``, ``sin(k (pi - theta)) = -(-1)^k sin(k theta)``.

    Returns `same` and `opposite`, each of shape (len(s), count or so, len(t)), even cosines and odd
    sines, which keep their sign there; odd cosines and even sines.
    """
    theta = np.arctan2(np.hypot(1.0, s)[:, None], t)
    step = np.exp(1j * theta)
    powers = np.empty((count, len(s), len(t)), dtype=complex)
    powers[0] = 1
    for k in range(1, count):
        np.multiply(powers[k - 1], step, out=powers[k])
    cosine, sine = powers.real, powers.imag
    return (
        np.concatenate([cosine[0::2], sine[1::2]]).transpose(1, 0, 2),
        np.concatenate([cosine[1::2], sine[0::2]]).transpose(1, 0, 2),
    )


class CubeIntegral:
    """Integrals of cube images with every real harmonic: the transpose of `synthesize_cube`.

    The faces arrive one after the other, each of whose values is multiplied by its solid angle.
    """

    def __init__(self, order: int, sampling: Sampling = "center") -> None:
        self.order, self.sampling = order, sampling
        self._along_z, self._along_x = np.zeros(()), np.zeros(())

    def add(self, faces: Mapping[str, Array]) -> None:
        """Add some of the faces by their names, each of shape (maps, N, N).

        They take the more time the fewer of them arrive together.
        """
        s = nodes(next(iter(faces.values())).shape[-1], self.sampling)
        if along_z := tuple(part for part in ALONG_Z if part[1] in faces):
            self._along_z = self._along_z + _gather_faces(faces, along_z, s, self.order)
        if along_x := tuple(part for part in ALONG_X if part[1] in faces):
            self._along_x = self._along_x + _gather_faces(faces, along_x, s, self.order)

    def coefficients(self) -> Array:
        """The integrals, shape ((order+1)^2, maps), after all six faces were added."""
        along_x = harmonics_from_moments(self._along_x)
        along_z = harmonics_from_moments(self._along_z)
        return along_z + transform_coefficients(along_x, X_POLAR.T)


def _gather_faces(values: Mapping[str, Array], faces: Quadrants, s: Array, order: int) -> Array:
    """Moments, shape (2, order+1, order+1, maps), of values: the transpose of `_fill_faces`."""
    maps, size, count = len(values[faces[0][1]]), len(s), order + 1
    half = s[size // 2 :]
    # Where s = 0 is a sample, it stands on both sides of its mirror image.
    share = np.where((np.arange(len(half)) == 0) & (size % 2 == 1), 0.5, 1.0)
    quadrants = [face[0] for face in faces]
    symmetric = np.empty((len(half), len(faces), 2, maps, (count + 1) // 2 + count // 2))
    antisymmetric = np.empty_like(symmetric)
    step = _rows_at_once(len(faces) * maps * 8, count, len(half))
    for rows in slices(len(half), step):
        same, opposite = _kept_waves(count, half[rows], half, np.dtype(float))
        at = np.arange(rows.start, rows.start + len(same))
        even = np.empty((len(same), len(faces), 2, maps, len(half)))
        odd = np.empty_like(even)
        for k, (_, name, s_falls, t_falls) in enumerate(faces):
            for side, column in ((0, size // 2 + at), (1, len(half) - 1 - at)):
                row = size - 1 - column if s_falls else column
                source = values[name][:, _span(row)].transpose(1, 0, 2)
                if t_falls:
                    source = source[..., ::-1]
                north, south = source[..., size // 2 :], source[..., len(half) - 1 :: -1]
                np.add(north, south, out=even[:, k, side])
                np.subtract(north, south, out=odd[:, k, side])
        weight = share[rows, None, None, None, None] * share
        for target, part, waves in ((symmetric, even, same), (antisymmetric, odd, opposite)):
            flat = (part * weight).reshape(len(same), -1, len(half))
            target[rows] = (flat @ waves.transpose(0, 2, 1)).reshape(target[rows].shape)
    return _moments(symmetric, antisymmetric, quadrants, half)


def _moments(symmetric: Array, antisymmetric: Array, quadrants: list[int], half: Array) -> Array:
    """Moments from sums along meridians: the transpose of `_meridians`."""
    maps, count = symmetric.shape[3], symmetric.shape[4]
    result = np.zeros((2, count, count, maps))
    evens, odds = (count + 1) // 2, count // 2
    waves = longitude_waves(count, quadrants, half, np.dtype(float))
    longitudes = len(waves[0])
    a, b = (np.empty((longitudes, maps, count)) for _ in range(2))
    symmetric = symmetric.reshape(longitudes, maps, count)
    antisymmetric = antisymmetric.reshape(longitudes, maps, count)
    a[..., 0::2], b[..., 1::2] = symmetric[..., :evens], symmetric[..., evens:]
    a[..., 1::2], b[..., 0::2] = antisymmetric[..., :odds], antisymmetric[..., odds:]
    for parity, part in ((0, a), (1, b)):
        sums = (waves[parity].T @ part.reshape(longitudes, -1)).reshape(2, -1, maps, count)
        result[:, parity::2] = sums.transpose(0, 1, 3, 2)
    return result
