"""Targets on the probe's own grid whose pixels line up with its own: no filter is needed.

The pixels of the same raster, turned or mirrored so that they fall upon each other, are copied.
A lat-long about the same axis is reduced by the exact overlap of its cells, whatever the ratio.
"""

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from shrm_cli.probe.probe import Probe
from shrm_cli.probe.raster import Indices, Raster
from shrm_cli.sphere.cube import face_axes
from shrm_cli.vocabulary import Sampling

Array = NDArray[np.floating]
Overlap = tuple[Indices, Array]

_ROUNDING = 1e-9
_FRONT = 4  # an angular map is seen as the face +Z is: right is -X, down is -Y


def copy(probe: Probe, target: Raster) -> Array | None:
    """The probe's own pixels as the target's image, or None if they do not line up."""
    if target != Raster.of(probe):
        return None
    if target.grid == "latlong":
        turn = _about_the_axis(probe)
        if turn is None or turn[0] % 1:
            return None
        return _overlapped(probe, target, *turn)
    turned = np.rint(probe.matrix)
    if not np.allclose(probe.matrix, turned, rtol=0, atol=_ROUNDING):
        return None
    if target.grid == "angular":
        if turned[2, 2] != 1:
            return None
        return _turned(probe.image(), face_axes()[_FRONT] @ turned, _FRONT)
    faces = probe.image().reshape(6, target.size, target.size, 3)
    result = np.empty_like(faces)
    for face, axes in enumerate(face_axes() @ turned):  # M^-1 of each axis, as rows
        source = int(np.argmax(face_axes()[:, 2] @ axes[2]))
        result[face] = _turned(faces[source], axes, source)
    return result.reshape(*target.shape, 3)


def reduce_latlong(probe: Probe, target: Raster) -> Array | None:
    """Means over the target's cells, exact, or None if these are no lat-longs about one axis."""
    if probe.grid != "latlong" or target.grid != "latlong":
        return None
    turn = _about_the_axis(probe)
    return None if turn is None else _overlapped(probe, target, *turn)


def _turned(image: Array, axes: Array, face: int) -> Array:
    """A square image seen along other axes: right and down in the image's own axes."""
    (along, turned_along), (turned_down, down) = np.rint(axes[:2] @ face_axes()[face, :2].T)
    if along:
        return image[:: int(down), :: int(along)]
    return image.swapaxes(0, 1)[:: int(turned_down), :: int(turned_along)]


def _about_the_axis(probe: Probe) -> tuple[float, bool] | None:
    """How a turn about the lat-long's axis, and a mirror beside it, move its columns.

    Returns
    -------
    offset : float
        Column, not rounded, of the source where the target begins.
    backwards : bool
        Whether columns go the other way.
    """
    matrix = probe.matrix
    if not np.allclose(matrix[1], (0, 1, 0), rtol=0, atol=_ROUNDING):
        return None
    # The longitude of M^-1 d is that of d, or minus it, and what +Z is moved by.
    shift = -np.arctan2(matrix[2, 0], matrix[2, 2]) / (2 * np.pi)
    offset = shift * _span(probe.width, probe.sampling)
    nearest = np.rint(offset)
    if abs(offset - nearest) < _ROUNDING * probe.width:
        offset = nearest
    backwards = matrix[0, 0] * matrix[2, 2] < matrix[0, 2] * matrix[2, 0]
    return float(offset), bool(backwards)


def _overlapped(probe: Probe, target: Raster, offset: float, backwards: bool) -> Array:
    """Mean of the source's cells over each of the target's, by solid angle."""
    height, width = target.shape
    rows = _edges(probe.height, probe.sampling)
    down = _scaled(height, target.sampling, rows[-1])
    columns = _edges(probe.width, probe.sampling)
    span = columns[-1]
    across = _scaled(width, target.sampling, span) + offset % span
    twice = np.concatenate([columns, columns[1:] + span])  # around the seam
    polar = np.pi / rows[-1]

    def band(low: Array, high: Array) -> Array:
        # cos(low) - cos(high) as a product: the difference loses digits at the poles.
        product = np.sin((low + high) * (polar / 2)) * np.sin((high - low) * (polar / 2))
        return np.asarray(product)

    tall = _means(probe.image(), _overlaps(rows, down, band), height)
    turned = np.ascontiguousarray(tall.swapaxes(0, 1))
    around = (
        (k % probe.width, weight) for k, weight in _overlaps(twice, across, lambda a, b: b - a)
    )
    image = _means(turned, around, width).swapaxes(0, 1)
    return np.ascontiguousarray(image[:, ::-1] if backwards else image)


def _means(image: Array, overlaps: Iterator[Overlap], count: int) -> Array:
    """Weighted means of rows of an image, shape (count, ...)."""
    result = np.empty((count, *image.shape[1:]), dtype=image.dtype)
    for row, (sources, weights) in enumerate(overlaps):
        result[row] = np.tensordot(weights, image[sources], axes=1)
    return result


def _overlaps(
    source: Array, target: Array, measure: Callable[[Array, Array], Array]
) -> Iterator[Overlap]:
    """Which cells of the source each cell of the target overlaps, and their shares of it."""
    first = np.searchsorted(source, target[:-1], "right") - 1
    last = np.searchsorted(source, target[1:], "left")
    for low, high, i, j in zip(target[:-1], target[1:], first, last, strict=True):
        cuts = np.clip(source[i : j + 1], low, high)
        weights = measure(cuts[:-1], cuts[1:])
        yield np.arange(i, j), weights / weights.sum()


def _span(count: int, sampling: Sampling) -> int:
    return count if sampling == "center" else count - 1


def _edges(count: int, sampling: Sampling) -> Array:
    """Edges of cells in samples, from 0 to `_span`: whole or half numbers, without rounding."""
    if sampling == "center":
        return np.arange(count + 1.0)
    return np.concatenate([[0], np.arange(count - 1) + 0.5, [count - 1]])


def _scaled(count: int, sampling: Sampling, span: float) -> Array:
    """The same for a target, in samples of a source of this span."""
    return _edges(count, sampling) * span / _span(count, sampling)
