"""Probes on other grids, in world axes: averaged where the target is coarser, else interpolated.

Where the source is finer, each cell of the target is cut into k x k parts, k being the ratio of
the resolutions rounded up, and the filtered radiance at their middles is averaged, weighted by
solid angle. The sun in a pixel of its own would be met too often or not at all by these points,
so what exceeds many times the mean radiance goes the other way: each such pixel is cut into
parts, and their light is added to the cells that they fall upon. That keeps the energy.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from shrm_cli.errors import ProbeError
from shrm_cli.probe.aligned import copy, reduce_latlong
from shrm_cli.probe.layout import Layout, arrange_faces, default_orientation
from shrm_cli.probe.probe import Grid, Probe
from shrm_cli.probe.raster import Raster
from shrm_cli.sphere.cube import FACES, face_axes
from shrm_cli.sphere.sampling import CubeSampler, sample_angular, sample_latlong
from shrm_cli.vocabulary import Orientation, Sampling

Array = NDArray[np.floating]
Indices = NDArray[np.intp]
Progress = Callable[[int, int], object]

MAX_SIZE: dict[Grid, int] = {"latlong": 8192, "cube": 4096, "angular": 4096}
"""Height of a lat-long, edge of a cube, width of an angular map: up to 1.6 GB as float32."""
MAX_PIXELS = 2**27
"""Of the source: 1.6 GB as float32, twice while it is read."""

_MIN_SIZE: dict[Grid, int] = {"latlong": 2, "cube": 1, "angular": 3}
_FINER = 0.75
"""Pixels of about the source's size could still miss its small lights; smaller ones cannot."""
_SAMPLES_AT_ONCE = 2**18
_BRIGHT = 16.0
"""Times the mean radiance; at most 1 / 16 of the sphere is brighter."""
_BRIGHT_PARTS = 4


def resample_latlong(
    probe: Probe, height: int, sampling: Sampling = "center", progress: Progress | None = None
) -> Array:
    """A probe as a lat-long in world axes.

    Parameters
    ----------
    probe : Probe
    height : int
        Rows; it is twice as wide.
    sampling : {"center", "border"}
        Of the result.
    progress : callable, optional
        Called with the rows done and their number.

    Returns
    -------
    ndarray of float32, shape (height, 2 * height, 3)
        Not negative.

    Raises
    ------
    ProbeError
        If the size is out of its range, or the probe cannot be read.
    """
    return _resample(probe, Raster("latlong", height, sampling), progress)


def resample_cube(
    probe: Probe, size: int, sampling: Sampling = "center", progress: Progress | None = None
) -> Array:
    """A probe as a stacked cube of OpenEXR's orientation, (6 size, size, 3) of float32.

    Parameters and errors as for `resample_latlong`; `size` is the texels along an edge.
    """
    return _resample(probe, Raster("cube", size, sampling), progress)


def resample_angular(
    probe: Probe, size: int, sampling: Sampling = "center", progress: Progress | None = None
) -> Array:
    """A probe as an angular map, (size, size, 3) of float32; 0 outside the rim.

    Parameters and errors as for `resample_latlong`; `size` is the width and the height.
    """
    return _resample(probe, Raster("angular", size, sampling), progress)


def relay(
    probe: Probe,
    layout: Layout,
    orientation: Orientation | None = None,
    size: int | None = None,
    sampling: Sampling = "center",
    progress: Progress | None = None,
) -> Array:
    """A probe as an image of any layout, in world axes.

    Parameters
    ----------
    probe : Probe
    layout : Layout
        ``"faces"`` gives the six files stacked.
    orientation : {"openexr", "gl"}, optional
        Of the faces of a cube; `default_orientation` of the layout if not given.
    size : int, optional
        Texels along an edge of a cube or of a cross's faces; height of the others. See
        `default_size`.
    sampling : {"center", "border"}
    progress : callable, optional
        As for `resample_latlong`.

    Returns
    -------
    ndarray of float32, shape (rows, columns, 3)

    Raises
    ------
    ProbeError
        If the size is out of its range, or the probe cannot be read.
    """
    grid: Grid = layout if layout == "latlong" or layout == "angular" else "cube"
    size = default_size(probe, grid) if size is None else size
    image = _resample(probe, Raster(grid, size, sampling), progress)
    if grid != "cube":
        return image
    return arrange_faces(image, layout, orientation or default_orientation(layout, "openexr"))


def default_size(probe: Probe, grid: Grid) -> int:
    """The size that keeps a probe's resolution on another grid, within the limits.

    As many pixels go around the equator: a lat-long of height H, a cube of edge H / 2 and an
    angular map of width 2 H belong together.
    """
    size = round(Raster.of(probe).resolution / Raster(grid, 1, "center").resolution)
    return min(max(size, _MIN_SIZE[grid]), MAX_SIZE[grid])


def _resample(probe: Probe, target: Raster, progress: Progress | None) -> Array:
    smallest, largest = _MIN_SIZE[target.grid], MAX_SIZE[target.grid]
    if not smallest <= target.size <= largest:
        raise ProbeError(
            f"{probe.name}: a {target.grid} image of size {target.size} is out of range; give a "
            f"size of {smallest} to {largest}"
        )
    if (count := probe.width * probe.height) > MAX_PIXELS:
        raise ProbeError(
            f"{probe.name}: {count:,} pixels exceed {MAX_PIXELS:,}, what is kept in memory; scale "
            "it down"
        )
    image = copy(probe, target)
    if image is not None:
        return image
    source = Raster.of(probe)
    ratio = source.resolution / target.resolution
    parts = max(int(np.ceil(ratio)), 1)
    if ratio < _FINER:
        return _sampled(probe.image(), probe, target, parts, progress)
    image = reduce_latlong(probe, target)
    if image is None:
        whole = probe.image()
        bright = _take_bright(whole, probe)
        image = _sampled(whole, probe, target, parts, progress)
        if len(bright[0]):
            _add_bright(image, target, source, probe.matrix, *bright)
    if target.sampling == "border":
        _share_borders(image, target)
    return image


def _sampled(
    pixels: Array, probe: Probe, target: Raster, parts: int, progress: Progress | None
) -> Array:
    """Filtered values of an image of the probe at the target's samples, or means of its parts."""
    look_up: Callable[[Array], Array]
    if probe.grid == "cube":
        look_up = CubeSampler(pixels, probe.sampling)
    else:
        sample = sample_latlong if probe.grid == "latlong" else sample_angular
        look_up = lambda directions: sample(pixels, directions, probe.sampling)  # noqa: E731
    height, width = target.shape
    down, across = target.parts(parts)
    image = np.empty((height, width, 3), dtype=np.float32)
    step = max(_SAMPLES_AT_ONCE // across.size, 1)
    for start in range(0, height, step):
        rows = np.arange(start, min(start + step, height))
        total = np.zeros((len(rows), width, 3))
        weight = np.zeros((len(rows), width))
        for part in range(parts):
            directions, density = target.points(
                rows[:, None], down[rows, part, None], across.reshape(1, -1)
            )
            density = density if parts > 1 else np.ones_like(density)
            values = look_up(directions @ probe.matrix) * density[..., None]  # M^-1 d, as rows
            total += values.reshape(*weight.shape, parts, 3).sum(axis=2)
            weight += density.reshape(*weight.shape, parts).sum(axis=2)
        mean = total / np.where(weight > 0, weight, 1)[..., None]
        image[rows] = np.maximum(mean, 0)  # a cubic filter overshoots
        if progress is not None:
            progress(start + len(rows), height)
    if target.grid == "angular":
        s = target.parts(1)[1].ravel()
        image[np.hypot(s, s[:, None]) > 1] = 0
    return image


def _take_bright(image: Array, probe: Probe) -> tuple[Indices, Indices, Array]:
    """Dim, in place, what exceeds `_BRIGHT` times the mean radiance.

    Returns
    -------
    rows, columns : ndarray of int, shape (n,)
    excess : ndarray, shape (n, 3)
        The radiance that was taken from each pixel.
    """
    report = probe.report
    mean = (report.energy - report.energy_removed) / (4 * np.pi * 3)
    brightest = image.max(axis=-1)
    rows, columns = np.nonzero(brightest > _BRIGHT * mean)
    before = image[rows, columns].astype(float)
    after = before * (_BRIGHT * mean / brightest[rows, columns, None])
    image[rows, columns] = after
    return rows, columns, before - after


def _add_bright(
    image: Array,
    target: Raster,
    source: Raster,
    matrix: Array,
    rows: Indices,
    columns: Indices,
    excess: Array,
) -> None:
    """Add, in place, the light of some pixels of the source to the cells that they fall upon."""
    down, across = source.parts(_BRIGHT_PARTS)
    heights, widths = source.extents()
    step = max(_SAMPLES_AT_ONCE // _BRIGHT_PARTS**2, 1)
    light = np.zeros_like(image)
    for start in range(0, len(rows), step):
        r, c = rows[start : start + step], columns[start : start + step]
        directions, density = source.points(
            r[:, None, None], down[r][:, :, None], across[c][:, None, :]
        )
        area = (heights[r] * widths[c])[:, None, None] / _BRIGHT_PARTS**2
        energy = (density * area)[..., None] * excess[start : start + step, None, None]
        np.add.at(light, target.pixels(directions @ matrix.T), energy)
    lit_rows, lit_columns = np.nonzero(light.any(axis=-1))
    solid_angles = target.solid_angles(lit_rows, lit_columns)
    image[lit_rows, lit_columns] += light[lit_rows, lit_columns] / solid_angles[:, None]


def _share_borders(image: Array, target: Raster) -> None:
    """Give the border pixels that are the same direction the mean of their cells, in place."""
    if target.grid == "latlong":
        image[:, [0, -1]] = (image[:, :1] + image[:, -1:]) / 2
        image[[0, -1]] = image[[0, -1], :-1].mean(axis=1, keepdims=True)
    if target.grid == "cube" and target.size > 1:
        last = target.size - 1
        k = np.arange(0, 2 * last + 1, 2) - last  # whole numbers: equal points are equal
        right, down, forward = np.moveaxis(face_axes().astype(int), 1, 0)[:, :, None, None]
        points = forward * last + right * k[:, None] + down * k[:, None, None]
        on_edge = np.broadcast_to(
            (np.abs(k) == last) | (np.abs(k[:, None]) == last), (len(FACES), len(k), len(k))
        )
        pixels = image.reshape(*on_edge.shape, 3)
        _, place, count = np.unique(
            points[on_edge], axis=0, return_inverse=True, return_counts=True
        )
        total = np.zeros((len(count), 3))
        np.add.at(total, place.ravel(), pixels[on_edge])
        pixels[on_edge] = (total / count[:, None])[place.ravel()]
