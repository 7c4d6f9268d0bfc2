"""A probe as many small lights, for sums over its pixels."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from shrm_cli.probe.probe import Probe
from shrm_cli.sphere.cube import cube_directions
from shrm_cli.sphere.grids import (
    angular_directions,
    colatitude_weights,
    latlong_directions,
    longitude_weights,
)

Array = NDArray[np.floating]

_TILE_ROWS = 8  # and twice as many columns
_TINY = 1e-300


@dataclass(frozen=True)
class Source:
    """A probe as many small lights, in tiles of neighbours.

    Attributes
    ----------
    directions : ndarray, shape (tiles, 3, m)
        Unit, world axes.
    light : ndarray, shape (tiles, m, 3)
        Radiance times solid angle.
    axes : ndarray, shape (tiles, 3)
    angles : ndarray, shape (tiles,)
        Cones around the tiles: axis, half angle in radians.
    pixels : int
        In all; tiles that cross the image's edge hold black ones besides.
    """

    directions: Array
    light: Array
    axes: Array
    angles: Array
    pixels: int

    @classmethod
    def of(cls, probe: Probe, height: int | None = None, dtype: type = np.float32) -> "Source":
        """The pixels of a probe, or of the lat-long of some height that it is averaged down to."""
        if height is None:
            directions, light = _pixels(probe)
        else:
            from shrm_cli.probe.resample import resample_latlong

            directions = latlong_directions(2 * height, height)
            weights = colatitude_weights(height)[:, None] * longitude_weights(2 * height)
            light = resample_latlong(probe, height) * weights[..., None]
        pixels = light.shape[0] * light.shape[1]
        directions, light = _tiles(directions, "edge"), _tiles(light, "constant")
        lit = light.any(axis=(1, 2))
        directions, light = directions[lit], light[lit]
        axes = directions.mean(axis=1)
        axes /= np.maximum(np.linalg.norm(axes, axis=-1, keepdims=True), _TINY)
        cosines = np.einsum("tmk,tk->tm", directions, axes).min(axis=1)
        angles = np.arccos(np.clip(cosines, -1, 1))
        directions = np.ascontiguousarray(directions.swapaxes(1, 2), dtype=dtype)
        return cls(directions, light.astype(dtype), axes.astype(dtype), angles, pixels)


def _pixels(probe: Probe) -> tuple[Array, Array]:
    """World directions and radiance times solid angle of a probe's pixels, (H, W, 3) each."""
    if probe.grid == "latlong":
        directions = latlong_directions(probe.width, probe.height, probe.sampling)
    elif probe.grid == "cube":
        directions = cube_directions(probe.width, probe.sampling)
    else:
        directions = angular_directions(probe.width, probe.sampling)[0]
    blocks = [pixels * weights[..., None] for _, pixels, weights in probe.blocks()]
    return directions @ probe.matrix.T, np.concatenate(blocks)


def _tiles(image: Array, mode: Literal["constant", "edge"]) -> Array:
    """An image in tiles, shape (tiles, pixels, 3), padded as np.pad does."""
    rows, columns = _TILE_ROWS, 2 * _TILE_ROWS
    missing = ((0, -image.shape[0] % rows), (0, -image.shape[1] % columns), (0, 0))
    image = np.pad(image, missing, mode=mode)
    tiles = image.reshape(image.shape[0] // rows, rows, -1, columns, 3).swapaxes(1, 2)
    return tiles.reshape(-1, rows * columns, 3)
