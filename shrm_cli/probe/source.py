"""A probe as many small lights: its pixels, and a pyramid of cells of 2 x 2, 4 x 4 and more.

A cell stands for all light within it as one light in the direction of its centroid. So a function
that is linear over the cell is summed without an error, however the light is spread, and the error
of any other one goes by how far the light is from its centroid, which is known exactly. A lamp
stands in its own place in cells of every size.

References: Barnes and Hut 1986, A hierarchical O(N log N) force-calculation algorithm; Walter et
al. 2005, Lightcuts: a scalable approach to illumination.
"""

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array
from shrm_cli.probe.lighting import lamps_of
from shrm_cli.probe.probe import Probe
from shrm_cli.probe.resample import LEAST_ROWS, coarse_probe, to_grid
from shrm_cli.progress import using
from shrm_cli.records import record
from shrm_cli.sphere.grid.base import Grid
from shrm_cli.sphere.grid.latlong import LatLong
from shrm_cli.vocabulary import LUMINANCE

_TILE_ROWS = 8
"""Rows of a tile, which has twice as many columns."""
_BAND_ROWS = 16 * _TILE_ROWS
"""Rows whose tiles are made at a time."""
_TINY = 1e-300


@record(eq=False)
class Source:
    """A probe as many small lights, in tiles of neighboring pixels."""

    directions: Array
    """Unit directions of the lights, world axes, shape (tiles, 3, m)."""
    light: Array
    """Radiance times solid angle of each, shape (tiles, m, 3)."""
    axes: Array
    """Unit axes of cones around the tiles, world axes, shape (tiles, 3)."""
    angles: Array
    """Half angles of these cones, radians, shape (tiles,)."""
    pixels: int
    """Pixels of the image. Tiles that cross its edge hold black lights as well, and black tiles are
    left out."""

    @classmethod
    def of(cls, probe: Probe, height: int | None = None, dtype: type = np.float32) -> "Source":
        """Make the lights of a probe.

        With a `height` the probe is averaged down to a lat-long of this many rows first. By default
        its own pixels are taken, or those of no fewer than `LEAST_ROWS` rows of a large probe.
        `dtype` is that of the attributes, but for the angles.
        """
        directions, light = source_pixels(probe, height)
        pixels = light.shape[0] * light.shape[1]
        # Tiles are copies, so that those of a large probe are made of a few rows at a time.
        bands = [
            _lights(directions[row : row + _BAND_ROWS], light[row : row + _BAND_ROWS], dtype)
            for row in range(0, len(light), _BAND_ROWS)
        ]
        del directions, light  # or they would be in memory beside two copies of all tiles
        tiles, radiant, axes, angles = (np.concatenate(each) for each in zip(*bands, strict=True))
        return cls(tiles, radiant, axes, angles, pixels)


def _lights(directions: Array, light: Array, dtype: type) -> tuple[Array, Array, Array, Array]:
    """The tiles of some rows: directions, light, axes and angles as `Source` has them."""
    directions, light = _tiles(directions, "edge"), _tiles(light, "constant")
    lit = light.any(axis=(1, 2))
    directions, light = directions[lit], light[lit]
    axes = directions.mean(axis=1)
    axes /= np.maximum(np.linalg.norm(axes, axis=-1, keepdims=True), _TINY)
    cosines = np.einsum("tmk,tk->tm", directions, axes).min(axis=1)
    angles = np.arccos(np.clip(cosines, -1, 1))
    directions = np.ascontiguousarray(directions.swapaxes(1, 2), dtype=dtype)
    return directions, light.astype(dtype), axes.astype(dtype), angles


def source_pixels(probe: Probe, height: int | None = None) -> tuple[Array, Array]:
    """Return world directions and radiance times solid angle of lights, shape (H, W, 3) each."""
    probe = coarse_probe(probe, LEAST_ROWS)
    if height is None:
        return _pixels(probe)
    return LatLong(height).directions(), latlong_light(probe, height)


def _pixels(probe: Probe) -> tuple[Array, Array]:
    """World directions and radiance times solid angle of a probe's pixels, (H, W, 3) each."""
    light = _light(probe.grid, probe.image())
    directions = probe.grid.directions()
    for start in range(0, len(directions), _BAND_ROWS):
        directions[start : start + _BAND_ROWS] @= probe.matrix.T
    return directions, light


def latlong_light(probe: Probe, height: int) -> Array:
    """Return a probe's radiance times solid angle on a lat-long, shape (height, 2 height, 3).

    `probe` is averaged down, or interpolated, if it is no such lat-long itself. `height` is the
    number of rows of the lat-long.
    """
    grid = LatLong(height)
    with using(None):
        return _light(grid, to_grid(probe, grid))


def _light(grid: Grid, image: Array) -> Array:
    """Radiance times solid angle of an image's pixels, as `probe.lighting` integrates it."""
    pixels = image.astype(float)
    for lamps in lamps_of(grid, image):
        pixels[lamps.start : lamps.start + len(lamps.excess)] += lamps.light
    pixels *= grid.weights()[..., None]
    return pixels


def _tiles(image: Array, mode: Literal["constant", "edge"]) -> Array:
    """An image in tiles, shape (tiles, pixels, 3), padded as np.pad does."""
    rows, columns = _TILE_ROWS, 2 * _TILE_ROWS
    missing = ((0, -image.shape[0] % rows), (0, -image.shape[1] % columns), (0, 0))
    image = np.pad(image, missing, mode=mode)
    tiles = image.reshape(image.shape[0] // rows, rows, -1, columns, 3).swapaxes(1, 2)
    return tiles.reshape(-1, rows * columns, 3)


_TOP_CELLS = 512
"""About how many of the largest cells there are: 16 rows of a lat-long, 11 degrees each. Half as
many rows made errors of 8 % under a city's sun, twice as many took twice the time."""
_HAS_CENTROID = 0.1
"""The least length of a mean of directions that is one; cells of edges of cubes may have none."""


@record(eq=False)
class Level:
    """The cells of one size. Cells 4 i .. 4 i + 3 of the next finer level make up cell i."""

    directions: Array
    """Unit directions of the centroids of the luminance, world axes, shape (cells, 3)."""
    light: Array
    """Radiance times solid angle, shape (cells, 3)."""
    spread: Array
    """The sum of luminance times solid angle times the square of the chord to the centroid over the
    pixels, shape (cells,). Pixels themselves have none."""
    radii: Array
    """The largest angle from the centroid to the centre of a pixel, radians, shape (cells,)."""


@record(eq=False)
class Pyramid:
    """A probe in cells of all sizes."""

    levels: list[Level]
    """Pixels first, the largest cells last."""
    pixels: int
    """Pixels of the image."""

    @classmethod
    def of(cls, probe: Probe, height: int | None = None, dtype: type = np.float32) -> "Pyramid":
        """Make the pyramid of a probe."""
        directions, light = source_pixels(probe, height)
        pixels = light.shape[0] * light.shape[1]
        # Pixels that are large beside a lobe are cut on the way down from a cell: there is one.
        count = max(round(np.log2(pixels / _TOP_CELLS) / 2), 1)
        directions = _nested(directions, count, "edge").astype(dtype)
        light = _nested(light, count, "constant")
        weights: Array = np.abs(light) @ LUMINANCE
        moments: Array = weights[:, None] * directions
        middles: Array = directions
        nothing: Array = np.zeros(len(light), dtype)
        levels = [Level(directions, light.astype(dtype), nothing, nothing)]
        for _ in range(count):
            light, moments, weights = (_sums_of_fours(each) for each in (light, moments, weights))
            middles = _sums_of_fours(middles) / 4
            lengths = np.linalg.norm(moments, axis=-1)
            axes = np.where((lengths > _HAS_CENTROID * weights)[:, None], moments, middles)
            axes /= np.maximum(np.linalg.norm(axes, axis=-1, keepdims=True), _TINY)
            spread = 2 * (weights - np.einsum("nc,nc->n", moments, axes))
            members = directions.reshape(len(axes), -1, 3)
            cosines = np.einsum("nmc,nc->nm", members, axes.astype(dtype)).min(axis=1)
            radii = np.arccos(np.clip(cosines, -1, 1))
            made = axes, light, np.maximum(spread, 0), radii
            levels.append(Level(*(each.astype(dtype) for each in made)))
        return cls(levels, pixels)


def pixel_sides(pixels: Level, cells: NDArray[np.integer]) -> Array:
    """Return how far pixels reach across and down, shape (n, 2, 3), as differences of directions.

    Those to their neighbors within a cell of 2 x 2 tell it, up to a sign that does not matter.
    """
    own = pixels.directions[cells]
    beside = [pixels.directions[cells ^ step] for step in (1, 2)]
    return np.stack(beside, axis=1) - own[:, None]


def _sums_of_fours(values: Array) -> Array:
    """Sums of values of cells, shape (n, ...), over the larger cells that they make up: (n/4, ...).

    numpy's own sums take several times as long along an axis of four.
    """
    return values[0::4] + values[1::4] + values[2::4] + values[3::4]


def _nested(image: Array, count: int, mode: Literal["constant", "edge"]) -> Array:
    """Pixels of an image, shape (n, 3), padded, so that those of every cell stand in a row."""
    side = 2**count
    missing = ((0, -image.shape[0] % side), (0, -image.shape[1] % side), (0, 0))
    image = np.pad(image, missing, mode=mode)
    halves = [2] * count
    image = image.reshape(image.shape[0] // side, *halves, image.shape[1] // side, *halves, 3)
    order = [axis + offset for axis in range(count + 1) for offset in (0, count + 1)]
    return image.transpose(*order, 2 * count + 2).reshape(-1, 3)
