"""Lat-longs about the same axis: exact means over the cells of one, of the cells of the other.

The cells of both are bounded by meridians and parallels, so they overlap in such cells again.
Whatever the ratio of their sizes, no filter and no sum over samples is needed.
"""

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array
from shrm_cli.vocabulary import Sampling

Overlap = tuple[NDArray[np.intp], Array]
"""Some cells of the source, and the share of each in a cell of the target."""

_ROUNDING = 1e-9


def turn_about_axis(matrix: Array, width: int, sampling: Sampling) -> tuple[float, bool] | None:
    """How a turn about the lat-long's axis, and a mirroring with it, move the columns.

    `matrix`, of shape (3, 3), is orthogonal, from the axes of the source to those of the target.
    `width` is the number of columns of the source. `sampling` is that of the source.

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
