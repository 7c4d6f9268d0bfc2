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
from shrm_cli.sphere.cube import catmull_rom, texel_index
from shrm_cli.sphere.double_fourier import harmonics_from_moments
from shrm_cli.sphere.grid.base import Analysis, Grid, Sampler
from shrm_cli.sphere.quadrature import cell_edges, colatitude_weights, longitude_weights, nodes
from shrm_cli.sphere.rotation import transform_coefficients
from shrm_cli.vocabulary import Sampling

AXES = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""World axes of a lat-long's own x, y and polar z, as rows: longitude 0 is +Z, 90 degrees +X."""
_known_waves = Memo(2**24)
"""The waves of each size and order; those of 1024 x 512 pixels and order 64 take 0.8 MB."""
_ROWS_AT_ONCE = 64
"""The rows that are folded at a time, which stay in the processor's cache."""


class LatLong(Grid):
    """A lat-long, twice as wide as high, of `size` rows."""

    name = "latlong"
    proportions = (2, 1)
    half_turn = 1.0
    smallest = 2
    largest = 8192
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

    The integrals with cos(m phi), sin(m phi) over longitude are a matrix product for each block,
    and those with the waves in theta another. Only (order+1)^2 moments stay in memory. The rules
    are exact for images band-limited below half the height.

    `width` and `height` are the size of the whole image; the width is even. `order` is the largest
    degree. `dtype` is the precision of the longitude integral; everything after it is float64.

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
        self.order = order
        key = width, height, order, sampling, np.dtype(dtype)
        self._row_waves, self._column_waves = _known_waves.get(key, lambda: analysis_waves(*key))
        self._moments: Array | None = None

    def add(self, start: int, pixels: Array, weights: Array | None = None) -> None:
        """Take in a block of rows of the image.

        `weights` is not used. Other analyses need the solid angles of the pixels; this one has
        separate weights for rows and columns, which it knows.
        """
        count, width, channels = pixels.shape
        planes = np.moveaxis(pixels, -1, 0)
        left, right = planes[..., : width // 2], planes[..., : width // 2 - 1 : -1]
        dtype = self._column_waves[0].dtype
        rings = np.empty((channels, count, 2, self.order + 1))
        for rows in slices(count, _ROWS_AT_ONCE):
            # The product is three times as fast where the columns of a channel lie side by side.
            folded = np.empty((channels, rows.stop - rows.start, width // 2), dtype)
            for k, (fold, wave) in enumerate(
                zip((np.add, np.subtract), self._column_waves, strict=True)
            ):
                fold(left[:, rows], right[:, rows], out=folded, dtype=dtype)  # half would overflow
                product = folded.reshape(-1, width // 2) @ wave
                rings[:, rows, k] = product.reshape(channels, -1, product.shape[1])
        if self._moments is None:
            self._moments = np.zeros((2, self.order + 1, self.order + 1, channels))
        for parity, waves in enumerate(self._row_waves):
            part = waves[start : start + count].T @ np.moveaxis(
                rings[..., parity::2], 1, 0
            ).reshape(count, -1)
            part = part.reshape(self.order + 1, channels, 2, -1)
            self._moments[:, parity::2] += part.transpose(2, 3, 0, 1)

    def coefficients(self) -> Array:
        """Real coefficients in world axes, shape ((order+1)^2, channels)."""
        return transform_coefficients(self.polar_coefficients(), AXES.T)

    def polar_coefficients(self) -> Array:
        """Coefficients in the image's own axes, whose polar axis is the world's +Y.

        They have the same shape as `coefficients`, and are cheaper where the axes do not matter.
        """
        if self._moments is None:
            raise ValueError("no rows were added")
        return harmonics_from_moments(self._moments)


def analysis_waves(
    width: int, height: int, order: int, sampling: Sampling, dtype: np.dtype[Any]
) -> tuple[list[Array], list[Array]]:
    """Return the waves over rows and over columns, times the weights of the integrals.

    The parameters are those of `LatLongAnalysis`.

    Returns the cosines and the sines over the rows, of shape (height, order+1); and, of shape
    (width/2, order+1), the same over half of the columns, in the precision `dtype`.
    """
    border = sampling == "border"
    # theta is a multiple of pi / rows, longitude one of pi / columns.
    rows = height - 1 if border else 2 * height
    columns = width - 1 if border else width
    weights = colatitude_weights(height, sampling)[:, None]
    multiples = np.arange(height) if border else 2 * np.arange(height) + 1
    row_waves: list[Array] = [wave * weights for wave in _waves(multiples, rows, order)]
    # Column j and its mirror image width - 1 - j have opposite longitudes: half is enough.
    half = np.arange(width // 2)
    measure = longitude_weights(width, sampling)[: len(half), None]
    column_waves = _waves(width - 1 - 2 * half, columns, order)
    return row_waves, [(wave * measure).astype(dtype) for wave in column_waves]


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
