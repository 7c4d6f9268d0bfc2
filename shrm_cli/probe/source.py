"""A probe as many small lights, for sums over its pixels."""

from typing import Literal

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.probe.lighting import lamps_of
from shrm_cli.probe.probe import Probe
from shrm_cli.probe.resample import LEAST_ROWS, coarse_probe, to_grid
from shrm_cli.progress import using
from shrm_cli.records import record
from shrm_cli.sphere.grid.base import Grid
from shrm_cli.sphere.grid.latlong import LatLong

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
    """Return world directions and radiance times solid angle of lights, shape (H, W, 3) each.

    `probe` and `height` are as `Source.of` takes them.
    """
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

    Raises ProbeError if the probe cannot be read.
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
