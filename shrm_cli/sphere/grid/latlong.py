"""The grid of latitude-longitude maps, whose rows can be read and analyzed in blocks.

This is a lat-long seen from inside, with the world axes that it looks at::

        left quarter      center      right quarter        top row: +Y
            +X              +Z             -X              the seam at both ends: -Z
"""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.arrays import Array, Indices, Memo, slices
from shrm_cli.progress import at_once
from shrm_cli.sphere.cube import catmull_rom, texel_index
from shrm_cli.sphere.double_fourier import harmonics_from_moments
from shrm_cli.sphere.grid.base import Analysis, Grid, Sampler
from shrm_cli.sphere.quadrature import cell_edges, colatitude_weights, longitude_weights, nodes
from shrm_cli.sphere.rotation import transform_coefficients
from shrm_cli.vocabulary import MAX_LATLONG_HEIGHT, Sampling

AXES = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""World axes of a lat-long's own x, y and polar z, as rows: longitude 0 is +Z, 90 degrees +X."""
_known_waves = Memo(2**24)
"""The waves of each size and order; those of 1024 x 512 pixels and order 64 take 0.8 MB."""
_LARGE = 2**20
"""The values of a block from which several threads are worth their start."""
_MANY = 112
"""The order from which Fourier transforms of rows take less time than matrix products, as measured
of images 1024 and 8192 pixels wide."""


class LatLong(Grid):
    """A lat-long, twice as wide as high, of `size` rows."""

    name = "latlong"
    proportions = (2, 1)
    half_turn = 1.0
    smallest = 2
    largest = MAX_LATLONG_HEIGHT
    most_pixels = None
    wraps = True

    def directions(self) -> Array:
        return latlong_directions(2 * self.size, self.size, self.sampling)

    def weights(self, start: int = 0, stop: int | None = None) -> Array:
        """Weights of Fejer's (``center``) or Clenshaw and Curtis's rule; see `Grid.weights`."""
        column = longitude_weights(2 * self.size, self.sampling)
        if self.sampling == "center":  # every column weighs the same
            column = column[:1]
        return colatitude_weights(self.size, self.sampling)[start:stop, None] * column

    def area_ratios(self) -> tuple[Array, Array]:
        edges = np.sin(cell_edges(self.size, self.sampling) * (np.pi / 2))
        areas = np.diff(edges)
        ratios = areas / colatitude_weights(self.size, self.sampling) - 1
        return ratios, areas * (2 * np.pi)

    def joined(self, count: int) -> "LatLong | None":
        if self.sampling == "border" or self.size % count or self.size < 2 * count:
            return None
        return LatLong(self.size // count)

    def points(self, rows: Indices, down: Array, across: Array) -> tuple[Array, Array]:
        density = np.cos(down * (np.pi / 2)) * (np.pi**2 / 2)
        return latlong_points(across, down), density + 0 * across

    def coordinates(self, directions: Array) -> tuple[Indices, Array, Array]:
        across, down = latlong_coordinates(directions)
        return np.zeros(across.shape, dtype=np.intp), across, down

    def sampler(self, image: Array) -> Sampler:
        return LatLongSampler(image, self.sampling)

    def analysis(self, order: int) -> Analysis:
        return LatLongAnalysis(2 * self.size, self.size, order, self.sampling)

    def share_borders(self, image: Array) -> None:
        image[:, [0, -1]] = (image[:, :1] + image[:, -1:]) / 2
        image[[0, -1]] = image[[0, -1], :-1].mean(axis=1, keepdims=True)

    def turned(self, image: Array, matrix: Array) -> Array | None:
        if (same := super().turned(image, matrix)) is not None:
            return same
        turn = turn_about_axis(matrix, 2 * self.size, self.sampling)
        if turn is None or turn[0] % 1:
            return None
        return overlapped(image, self.sampling, self.shape, self.sampling, *turn)

    def reduced(self, image: Array, target: Grid, matrix: Array) -> Array | None:
        turn = turn_about_axis(matrix, 2 * self.size, self.sampling)
        if turn is None or not isinstance(target, LatLong):
            return None
        return overlapped(image, self.sampling, target.shape, target.sampling, *turn)


def latlong_directions(width: int, height: int, sampling: Sampling = "center") -> Array:
    """World directions of the pixels of a lat-long, shape (height, width, 3)."""
    return latlong_points(nodes(width, sampling), nodes(height, sampling)[:, None])


def latlong_points(across: ArrayLike, down: ArrayLike) -> Array:
    """World directions at positions on a lat-long, each in [-1, 1], broadcastable: (..., 3)."""
    theta = (np.asarray(down) + 1) * (np.pi / 2)
    longitude = -np.asarray(across) * np.pi
    x, y, z = np.broadcast_arrays(
        np.sin(theta) * np.sin(longitude), np.cos(theta), np.sin(theta) * np.cos(longitude)
    )
    return np.stack([x, y, z], axis=-1)


def latlong_coordinates(directions: ArrayLike) -> tuple[Array, Array]:
    """Position across and down a lat-long, each in [-1, 1], of directions, shape (..., 3)."""
    x, y, z = np.moveaxis(np.asarray(directions), -1, 0)
    return -np.arctan2(x, z) / np.pi, np.arctan2(np.hypot(x, z), y) * (2 / np.pi) - 1


class LatLongSampler:
    """Bilinear filtering of a lat-long.

    It wraps around in longitude, and goes on beyond a pole half a turn away.

    `image` is of shape (H, W, channels).
    """

    def __init__(self, image: ArrayLike, sampling: Sampling) -> None:
        self._image = np.asarray(image)
        self._sampling = sampling

    def __call__(self, directions: ArrayLike) -> Array:
        """Values at directions of any length, shape (..., 3): (..., channels)."""
        image = self._image
        height, width = image.shape[:2]
        across, down = latlong_coordinates(directions)
        x, y = texel_index(across, width, self._sampling), texel_index(down, height, self._sampling)
        column, row = np.floor(x).astype(np.intp), np.floor(y).astype(np.intp)
        fx, fy = (x - column)[..., None], (y - row)[..., None]
        result: Array = np.zeros((), dtype=image.dtype)
        for i, wy in ((row, 1 - fy), (row + 1, fy)):
            turned = np.where((i < 0) | (i >= height), width // 2, 0)
            i = np.minimum(np.maximum(i, -1 - i), height - 1)  # -1 is row 0, height the last
            for j, wx in ((column, 1 - fx), (column + 1, fx)):
                result = result + wy * wx * image[i, (j + turned) % width]
        return result


def sample_latlong_cubic(image: ArrayLike, directions: ArrayLike) -> Array:
    """Cubically filtered values of a center-sampled lat-long, shape (..., channels).

    The filter is more exact than that of `LatLongSampler` for smooth images, but overshoots beside
    bright pixels.

    `image` is of shape (H, W, channels). `directions`, of shape (..., 3), may have any length but
    0.
    """
    image = np.asarray(image)
    height, width = image.shape[:2]
    across, down = latlong_coordinates(directions)
    columns, along = catmull_rom(texel_index(across, width, "center"))
    rows, below = catmull_rom(texel_index(down, height, "center"))
    result: Array = np.zeros((*across.shape, image.shape[2]), dtype=image.dtype)
    for i in range(4):
        row = rows + i
        turned = np.where((row < 0) | (row >= height), width // 2, 0)
        row = np.where(row < 0, -1 - row, np.minimum(row, 2 * height - 1 - row))
        line = np.zeros_like(result)
        for j in range(4):
            line += along[j][..., None] * image[row, (columns + j + turned) % width]
        result += below[i][..., None] * line
    return result


class LatLongAnalysis:
    """Analysis of a lat-long whose rows arrive in blocks.

    The integrals with cos(m phi), sin(m phi) over longitude are a Fourier transform of each row, or
    for few m a matrix product, which is faster. They stay in memory, 50 MB of 4096 rows and order
    512. Those with the waves in theta are matrix products in the end, of sums and differences of
    rows on both sides of the equator. The rules are exact for images band-limited below half the
    height.

    `width` and `height` are the size of the whole image. The width is even. `order` is the largest
    degree, which is less than half the width. `dtype` is the precision of the longitude integral;
    everything after it is float64.

    References: Ramamoorthi 2002, eq. 5.20 and 5.21.
    """

    def __init__(
        self,
        width: int,
        height: int,
        order: int,
        sampling: Sampling = "center",
        dtype: type = np.float32,
    ) -> None:
        self._shape, self._order, self._sampling = (height, width), order, sampling
        self._over_longitude = (_Waves if order < _MANY else _Series)(width, order, sampling, dtype)
        self._rings: Array | None = None

    def add(self, start: int, pixels: Array, weights: Array | None = None) -> None:
        """Take in a block of rows of the image, or more light in rows that were taken in.

        `weights` is not used. Other analyses need the solid angles of the pixels; this one has
        separate weights for rows and columns, which it knows.
        """
        count, _, channels = pixels.shape
        if self._rings is None:
            shape = self._shape[0], self._order + 1, channels
            self._rings = np.zeros(shape, self._over_longitude.dtype)
        rings = self._rings[start : start + count]

        def integrate(rows: slice) -> None:
            for channel in range(channels):
                rings[rows, :, channel] += self._over_longitude(pixels[rows, :, channel])

        over = self._over_longitude
        do_threads_pay = not over.has_threads and pixels.size > _LARGE
        at_once(integrate, list(slices(count, over.rows_at_once)), do_threads_pay)

    def coefficients(self) -> Array:
        """Real coefficients in world axes, shape ((order+1)^2, channels)."""
        return transform_coefficients(self.polar_coefficients(), AXES.T)

    def polar_coefficients(self) -> Array:
        """Coefficients in the image's own axes, whose polar axis is the world's +Y.

        They have the same shape as `coefficients`, and are cheaper where the axes do not matter.
        """
        if self._rings is None:
            raise ValueError("no rows were added")
        height, count, channels = self._rings.shape
        key = height, self._order, self._sampling
        waves = _known_waves.get(key, lambda: row_waves(*key))
        half = len(waves[0])
        north, south = self._rings[:half], self._rings[::-1][:half]
        moments = np.empty((2, count, count, channels))
        for parity, wave in enumerate(waves[:count]):  # cosines where m is even, sines where odd
            some = slice(parity, None, 2)
            for k, fold in ((parity, np.add), (1 - parity, np.subtract)):
                folded = fold(north[:, some], south[:, some]).view(self._rings.real.dtype)
                part = wave[:, k::2].T @ folded.reshape(half, -1).astype(float)
                part = part.reshape(part.shape[0], folded.shape[1], channels, 2)
                moments[:, some, k::2] = part.transpose(3, 1, 0, 2)
        return harmonics_from_moments(moments)


class _Series:
    """Integrals of rows with ``exp(i m phi)``, m = 0 .. order, by Fourier transforms."""

    rows_at_once, has_threads = 16, False  # these rows stay in the processor's cache

    def __init__(self, width: int, order: int, sampling: Sampling, dtype: type) -> None:
        self._dtype, self.dtype = dtype, np.result_type(dtype, 1j)
        self._is_border = sampling == "border"
        columns = width - 1 if self._is_border else width
        # Longitude falls from column to column, and the first one is at (width - 1) pi / columns.
        first = np.arange(order + 1) * (width - 1) % (2 * columns) * (np.pi / columns)
        self._factors = (np.exp(1j * first) * (2 * np.pi / columns)).astype(self.dtype)

    def __call__(self, rows: Array) -> Array:
        circle: Array = rows.astype(self._dtype)
        if self._is_border:  # both ends are the same meridian, of which each is half
            circle[:, 0] = (circle[:, 0] + circle[:, -1]) / 2
            circle = circle[:, :-1]
        return np.fft.rfft(circle, axis=1)[:, : len(self._factors)] * self._factors


class _Waves:
    """Integrals of rows with ``exp(i m phi)``, m = 0 .. order, by matrix products."""

    rows_at_once, has_threads = 64, True  # those of the BLAS library

    def __init__(self, width: int, order: int, sampling: Sampling, dtype: type) -> None:
        self.dtype = np.result_type(dtype, 1j)
        key = width, order, sampling, np.dtype(dtype)
        self._waves = _known_waves.get(key, lambda: column_waves(*key))

    def __call__(self, rows: Array) -> Array:
        cosines, sines = self._waves
        half = len(cosines)
        left, right = rows[:, :half], rows[:, : half - 1 : -1]
        result = np.empty((len(rows), cosines.shape[1]), self.dtype)
        # Sums of half precision would overflow.
        result.real = np.add(left, right, dtype=cosines.dtype) @ cosines
        result.imag = np.subtract(left, right, dtype=sines.dtype) @ sines
        return result


def column_waves(
    width: int, order: int, sampling: Sampling, dtype: np.dtype[Any]
) -> tuple[Array, Array]:
    """Return cos and sin of m phi, m = 0 .. order, times the weights of the integral over phi.

    Column j and its mirror image width - 1 - j have opposite longitudes: half of them is enough.

    Returns arrays of shape (width / 2, order+1), in the precision `dtype`.
    """
    columns = width - 1 if sampling == "border" else width
    half = np.arange(width // 2)
    measure = longitude_weights(width, sampling)[: len(half), None]
    cosines, sines = _waves(width - 1 - 2 * half, columns, order)
    return (cosines * measure).astype(dtype), (sines * measure).astype(dtype)


def row_waves(height: int, order: int, sampling: Sampling) -> tuple[Array, Array]:
    """Return cos and sin of k theta, k = 0 .. order, times the weights of the integral over theta.

    They are those of the northern rows, of shape (ceil(height / 2), order+1). On the other side of
    the equator the cosines of even k and the sines of odd k are the same, and all others the
    negative. A row on the equator has half of its weight, for it is on both sides.
    """
    border = sampling == "border"
    half = np.arange((height + 1) // 2)
    weights = colatitude_weights(height, sampling)[: len(half), None].copy()
    if height % 2:
        weights[-1] /= 2
    multiples, rows = (half, height - 1) if border else (2 * half + 1, 2 * height)
    cosines, sines = _waves(multiples, rows, order)
    return cosines * weights, sines * weights


def _waves(multiples: NDArray[np.integer], divisor: int, order: int) -> tuple[Array, Array]:
    """Cosine and sine of ``m * multiples * pi / divisor``, m = 0 .. order, looked up in a table."""
    turns = np.arange(2 * divisor) * (np.pi / divisor)
    at = np.outer(multiples, np.arange(order + 1)) % (2 * divisor)
    return np.cos(turns)[at], np.sin(turns)[at]


# ---- exact means over the cells of one, of the cells of another about the same axis --------------
# The cells of both are bounded by meridians and parallels, so they overlap in such cells again.
# Whatever the ratio of their sizes, no filter and no sum over samples is needed.


Overlap = tuple[NDArray[np.intp], Array]
"""Some cells of the source, and the share of each in a cell of the target."""

_ROUNDING = 1e-9


def turn_about_axis(matrix: Array, width: int, sampling: Sampling) -> tuple[float, bool] | None:
    """How a turn about the lat-long's axis, and a mirroring with it, move the columns.

    `matrix`, of shape (3, 3), is orthogonal, from the axes of the source to those of the target.
    `width` is the number of columns of the source.

    Returns `offset`, the column, not rounded, of the source where the target begins; and
    `backwards`, whether the columns of the target go the other way.

    None is returned instead if the matrix moves the axis.
    """
    if not np.allclose(matrix[1], (0, 1, 0), rtol=0, atol=_ROUNDING):
        return None
    # The longitude of M^-1 d is that of d, or minus it, and what +Z is moved by.
    shift = -np.arctan2(matrix[2, 0], matrix[2, 2]) / (2 * np.pi)
    offset = shift * _span(width, sampling)
    nearest = np.rint(offset)
    if abs(offset - nearest) < _ROUNDING * width:
        offset = nearest
    backwards = matrix[0, 0] * matrix[2, 2] < matrix[0, 2] * matrix[2, 0]
    return float(offset), bool(backwards)


def overlapped(
    image: Array,
    sampling: Sampling,
    shape: tuple[int, int],
    target_sampling: Sampling,
    offset: float,
    backwards: bool,
) -> Array:
    """Means of the source's cells over each cell of the target, by solid angle.

    `image`, of shape (rows, columns, channels), is the source. `shape` is the rows and columns of
    the target. `offset` and `backwards` are as `turn_about_axis` gives them.

    Returns an array of shape (*shape, channels), of the data type of the image.
    """
    height, width = shape
    rows = _edges(image.shape[0], sampling)
    down = _scaled(height, target_sampling, rows[-1])
    columns = _edges(image.shape[1], sampling)
    span = columns[-1]
    across = _scaled(width, target_sampling, span) + offset % span
    twice = np.concatenate([columns, columns[1:] + span])  # around the seam
    polar = np.pi / rows[-1]

    def band(low: Array, high: Array) -> Array:
        # cos(low) - cos(high) as a product: the difference loses digits at the poles.
        product = np.sin((low + high) * (polar / 2)) * np.sin((high - low) * (polar / 2))
        return np.asarray(product)

    tall = _means(image, _overlaps(rows, down, band), height)
    turned = np.ascontiguousarray(tall.swapaxes(0, 1))
    around = (
        (k % image.shape[1], weight) for k, weight in _overlaps(twice, across, lambda a, b: b - a)
    )
    result = _means(turned, around, width).swapaxes(0, 1)
    return np.ascontiguousarray(result[:, ::-1] if backwards else result)


def _means(image: Array, overlaps: Iterator[Overlap], count: int) -> Array:
    """Weighted means of rows of an image, shape (count, ...)."""
    result = np.empty((count, *image.shape[1:]), dtype=image.dtype)
    for row, (sources, weights) in enumerate(overlaps):
        result[row] = np.tensordot(weights, image[sources], axes=1)
    return result


def _overlaps(
    source: Array, target: Array, measure: Callable[[Array, Array], Array]
) -> Iterator[Overlap]:
    """Yield the cells of the source that each cell of the target overlaps, and their shares of it.

    `source` and `target` are edges of the cells, ascending. `measure` is the size of cells, from
    their lower and upper edges.
    """
    first = np.searchsorted(source, target[:-1], "right") - 1
    last = np.searchsorted(source, target[1:], "left")
    for low, high, i, j in zip(target[:-1], target[1:], first, last, strict=True):
        cuts = np.clip(source[i : j + 1], low, high)
        weights = measure(cuts[:-1], cuts[1:])
        yield np.arange(i, j), weights / weights.sum()


def _span(count: int, sampling: Sampling) -> int:
    """Distance between the ends of an axis of `count` samples, in samples."""
    return count if sampling == "center" else count - 1


def _edges(count: int, sampling: Sampling) -> Array:
    """Edges of cells in samples, from 0 to `_span`: whole or half numbers, without rounding."""
    if sampling == "center":
        return np.arange(count + 1.0)
    return np.concatenate([[0], np.arange(count - 1) + 0.5, [count - 1]])


def _scaled(count: int, sampling: Sampling, span: float) -> Array:
    """Edges of the cells of a target, in samples of a source whose axis has this span."""
    return _edges(count, sampling) * span / _span(count, sampling)
