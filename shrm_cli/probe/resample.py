"""Probes on other grids, in world axes: averaged where the target is coarser, else interpolated.

Where the source is finer, each cell of the target is cut into k x k parts, k being the ratio of
the resolutions rounded up, and the filtered radiance at their middles is averaged, weighted by
solid angle. The sun in a pixel of its own would be met too often or not at all by these points,
so what exceeds many times the mean radiance goes the other way: each such pixel is cut into
parts, and their light is added to the cells that they fall upon. That keeps the energy.

Large probes are averaged down while they are read, for work that needs fewer rows.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from shrm_cli import progress
from shrm_cli.arrays import Array, Indices, over_channels, slices
from shrm_cli.errors import ArgumentError, ProbeError
from shrm_cli.probe.image import ArrayImage, arrange_faces
from shrm_cli.probe.options import check_name
from shrm_cli.probe.probe import Probe
from shrm_cli.sphere.grid.base import Grid, grid_class
from shrm_cli.vocabulary import (
    CUBES,
    LAYOUTS,
    Layout,
    Orientation,
    Sampling,
    default_orientation,
    grid_name,
)

LEAST_ROWS = 2048
"""A probe of no more rows is kept as it is: it takes 100 MB as float32. None becomes coarser."""
MAX_PIXELS = 2**27
"""Pixels that a source may have: 1.6 GB as float32, which it takes twice while it is read."""
_FINER = 0.75
"""The least ratio of the resolutions at which the target is averaged.

Pixels of about the source's size could still miss its small lights; smaller ones cannot.
"""
_KEPT = 2
"""A large source is averaged down while it is read, to no less than this times the target's
resolution."""
_SAMPLES_AT_ONCE = 2**18
_BRIGHT = 16.0
"""Times the mean radiance that is bright; at most 1 / 16 of the sphere is brighter."""
_BRIGHT_PARTS = 4


def coarse_probe(probe: Probe, rows: int) -> Probe:
    """A probe with fewer pixels, if it is large and fewer will do.

    Each pixel of the result is the mean of k x k pixels by solid angle, so that no light is lost.
    The image itself is never held as a whole.

    The result has no fewer rows than this, and than `LEAST_ROWS`.

    Returns the probe itself where no k suits its size, or its grid cannot be read by rows.
    Otherwise a probe in memory, without the files of the first one; what the pixels needed stands
    in the report of the first one.
    """
    found = probe.grid.area_ratios()
    for count in range(probe.height // max(rows, LEAST_ROWS), 1, -1):
        grid = probe.grid.joined(count)
        if grid is not None and found is not None:
            image = ArrayImage(_means(probe, grid, found[1]), probe.name)
            return replace(probe, grid=grid, images=(image,), report=replace(probe.report))
    return probe


def _means(probe: Probe, grid: Grid, areas: Array) -> NDArray[np.float32]:
    """Means over the pixels of a probe that are a pixel of the grid; `areas` are of its rows."""
    height, width = grid.shape
    count = len(areas) // height
    areas = areas.reshape(height, count)
    shares = (areas / areas.sum(axis=1, keepdims=True) / count).ravel().astype(np.float32)
    means = np.zeros((height, width, 3), dtype=np.float32)
    for start, pixels, _ in probe.blocks():
        # To add views of every k-th column is many times as fast as a mean over a short axis.
        across = sum(pixels[:, k::count] for k in range(count))
        across *= shares[start : start + len(pixels), None, None]
        # The sums of a block that begins or ends within a row of the grid go on in others.
        first = start // count
        begins = np.maximum(np.arange(first, (start + len(pixels) - 1) // count + 1) * count, start)
        means[first : first + len(begins)] += np.add.reduceat(across, begins - start, axis=0)
    return means


def to_layout(
    probe: Probe,
    layout: Layout,
    orientation: Orientation | None = None,
    size: int | None = None,
    sampling: Sampling = "center",
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

    Returns
    -------
    ndarray of float32, shape (rows, columns, 3)

    Raises
    ------
    ProbeError
        If the size is out of its range, or the probe cannot be read.

    Examples
    --------
    >>> shrm.to_layout(shrm.open_probe("probes/studio.exr"), "hcross", size=16).shape
    (48, 64, 3)
    """
    check_name("layout", layout, LAYOUTS)
    if not isinstance(probe, Probe):
        raise ArgumentError("probe", "is no Probe; give one, such as open_probe(path)")
    kind = grid_class(grid_name(layout))
    size = default_size(probe, kind) if size is None else size
    image = to_grid(probe, kind(size, sampling))
    if layout not in CUBES:
        return image
    return arrange_faces(image, layout, orientation or default_orientation(layout))


def default_size(probe: Probe, kind: type[Grid]) -> int:
    """The size that keeps a probe's resolution on a grid of another kind, within the limits.

    As many pixels go around the equator: a lat-long of height H, a cube of edge H / 2 and an
    angular map of width 2 H belong together.
    """
    size = round(probe.grid.resolution / kind.half_turn)
    return min(max(size, kind.smallest), kind.largest)


def to_grid(probe: Probe, target: Grid) -> Array:
    """A probe on a grid in world axes.

    A cube is stacked, in OpenEXR's order and orientation.

    Returns an array of float32 of shape (rows, columns, 3), not negative, and 0 where the grid
    holds nothing.
    """
    if not target.smallest <= target.size <= target.largest:
        raise ProbeError(
            f"{probe.name}: a {target.name} image of size {target.size} is out of range; give a "
            f"size of {target.smallest} to {target.largest}"
        )
    probe = coarse_probe(probe, int(_KEPT * target.resolution))
    if (count := probe.width * probe.height) > MAX_PIXELS:
        raise ProbeError(
            f"{probe.name}: {count:,} pixels exceed {MAX_PIXELS:,}, what is kept in memory; scale "
            "it down"
        )
    source = probe.grid
    whole = probe.image()
    image = source.turned(whole, probe.matrix) if target == source else None
    if image is not None:
        return image
    ratio = source.resolution / target.resolution
    parts = max(int(np.ceil(ratio)), 1)
    if ratio < _FINER:
        return _sampled(whole, probe, target, parts)
    image = source.reduced(whole, target, probe.matrix)
    if image is None:
        bright = _take_bright(whole, probe)
        image = _sampled(whole, probe, target, parts)
        del whole  # large images would not leave room for their bright pixels
        if len(bright[0]):
            _add_bright(image, target, source, probe.matrix, *bright)
    if target.sampling == "border":
        target.share_borders(image)
    return image


def _sampled(pixels: Array, probe: Probe, target: Grid, parts: int) -> Array:
    """Filtered values of an image of the probe at the target's samples, or means of its parts."""
    look_up = probe.grid.sampler(pixels)
    height, width = target.shape
    down, across = target.parts(parts)
    image = np.empty((height, width, 3), dtype=np.float32)
    for band in slices(height, _SAMPLES_AT_ONCE // across.size):
        rows = np.arange(band.start, band.stop)
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
        progress.report(band.stop, height)
    used = target.used()
    if used is not None:
        image[~used] = 0
    return image


def _take_bright(image: Array, probe: Probe) -> tuple[Indices, Indices, Array]:
    """Dim, in place, what exceeds `_BRIGHT` times the mean radiance.

    `image`, of shape (H, W, 3), is the probe's pixels, which have just been read: its report tells
    their mean.

    Returns `rows`, `columns` of shape (n,), the pixels that were dimmed; and `excess` of shape (n,
    3), the radiance that was taken from each pixel.
    """
    report = probe.report
    mean = (report.energy - report.energy_removed) / (4 * np.pi * 3)
    brightest = over_channels(np.maximum, image)
    rows, columns = np.nonzero(brightest > _BRIGHT * mean)
    before = image[rows, columns].astype(float)
    after = before * (_BRIGHT * mean / brightest[rows, columns, None])
    image[rows, columns] = after
    return rows, columns, before - after


def _add_bright(
    image: Array,
    target: Grid,
    source: Grid,
    matrix: Array,
    rows: Indices,
    columns: Indices,
    excess: Array,
) -> None:
    """Add, in place, the light of some pixels of the source to the cells that they fall upon.

    `image`, of shape (H, W, 3), is on the target. `matrix`, of shape (3, 3), leads from the axes of
    the source to those of the target. `rows`, `columns` and `excess` are as `_take_bright` gives
    them.
    """
    down, across = source.parts(_BRIGHT_PARTS)
    heights, widths = source.extents()
    light = np.zeros_like(image)
    for some in slices(len(rows), _SAMPLES_AT_ONCE // _BRIGHT_PARTS**2):
        r, c = rows[some], columns[some]
        directions, density = source.points(
            r[:, None, None], down[r][:, :, None], across[c][:, None, :]
        )
        area = (heights[r] * widths[c])[:, None, None] / _BRIGHT_PARTS**2
        energy = (density * area)[..., None] * excess[some, None, None]
        np.add.at(light, target.pixels(directions @ matrix.T), energy)
    lit_rows, lit_columns = np.nonzero(over_channels(np.logical_or, light))
    solid_angles = target.solid_angles(lit_rows, lit_columns)
    image[lit_rows, lit_columns] += light[lit_rows, lit_columns] / solid_angles[:, None]
