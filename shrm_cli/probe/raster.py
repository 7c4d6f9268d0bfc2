"""The pixels of a grid as cells: where their parts lie, how large they are, what they contain."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shrm_cli.probe.probe import Grid, Probe
from shrm_cli.sphere.cube import cube_coordinates, face_axes
from shrm_cli.sphere.grids import (
    angular_coordinates,
    angular_points,
    latlong_coordinates,
    latlong_points,
    nodes,
)
from shrm_cli.vocabulary import Sampling

Array = NDArray[np.floating]
Indices = NDArray[np.intp]

_ROWS: dict[Grid, float] = {"latlong": 1, "cube": 2, "angular": 0.5}

_PARTS = 8


@dataclass(frozen=True)
class Raster:
    """A grid of a size.

    A pixel's cell reaches half way to the neighbouring samples, cut at the ends of the image.

    Attributes
    ----------
    grid : {"latlong", "cube", "angular"}
    size : int
        Height of a lat-long, texels along an edge of a cube, width of an angular map.
    sampling : {"center", "border"}
    """

    grid: Grid
    size: int
    sampling: Sampling

    @classmethod
    def of(cls, probe: Probe) -> "Raster":
        """The raster that a probe is on."""
        size = probe.height if probe.grid == "latlong" else probe.width
        return cls(probe.grid, size, probe.sampling)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the image."""
        rows = 6 * self.size if self.grid == "cube" else self.size
        return rows, 2 * self.size if self.grid == "latlong" else self.size

    @property
    def resolution(self) -> float:
        """Pixels from pole to pole, or half way around any other great circle, on average."""
        return self.size * _ROWS[self.grid]

    def parts(self, count: int) -> tuple[Array, Array]:
        """Positions in [-1, 1] of the middles of the `count` parts of each cell along an axis.

        Returns
        -------
        down, across : ndarray, shape (rows, count) and (columns, count)
            The samples themselves where `count` is 1.
        """
        across = _middles(self.shape[1], self.sampling, count)
        down = _middles(self.size, self.sampling, count)
        return (np.tile(down, (6, 1)) if self.grid == "cube" else down), across

    def extents(self) -> tuple[Array, Array]:
        """Height of each row of cells and width of each column, as differences of positions."""
        across = np.diff(cell_edges(self.shape[1], self.sampling))
        down = np.diff(cell_edges(self.size, self.sampling))
        return (np.tile(down, 6) if self.grid == "cube" else down), across

    def points(self, rows: Indices, down: Array, across: Array) -> tuple[Array, Array]:
        """Directions at positions of some rows of the image.

        Parameters
        ----------
        rows : ndarray of int
            The row that each position is in; these tell the face of a cube.
        down, across : ndarray
            Positions on the image or the face; all three can be broadcast.

        Returns
        -------
        directions : ndarray, shape (..., 3)
            In world axes; those of a cube are longer than 1.
        density : ndarray, shape (...)
            Solid angle for a unit of area of positions; 0 outside the rim of an angular map.
        """
        if self.grid == "latlong":
            density = np.cos(down * (np.pi / 2)) * (np.pi**2 / 2)
            return latlong_points(across, down), density + 0 * across
        if self.grid == "angular":
            radius = np.hypot(across, down)
            density = np.where(radius <= 1, np.pi**2 * np.sinc(radius), 0)
            return angular_points(across, down), density
        right, below, forward = np.moveaxis(face_axes()[rows // self.size], -2, 0)
        points = forward + right * across[..., None] + below * down[..., None]
        return points, (1 + across**2 + down**2) ** -1.5

    def solid_angles(self, rows: Indices, columns: Indices) -> Array:
        """Solid angle of the cells of some pixels, shape (n,), as the sum over some parts."""
        down, across = self.parts(_PARTS)
        _, density = self.points(
            rows[:, None, None], down[rows][:, :, None], across[columns][:, None, :]
        )
        heights, widths = self.extents()
        return np.asarray(density.mean(axis=(1, 2)) * heights[rows] * widths[columns])

    def pixels(self, directions: Array) -> tuple[Indices, Indices]:
        """Row and column of the pixel whose cell contains each direction, shape (..., 3)."""
        rows, columns = self.shape
        if self.grid == "cube":
            face, across, down = cube_coordinates(directions)
            first_row = face * self.size
            rows = self.size
        else:
            coordinates = latlong_coordinates if self.grid == "latlong" else angular_coordinates
            across, down = coordinates(directions)
            first_row = np.zeros(across.shape, dtype=np.intp)
        if self.grid == "angular":
            # Pixels beyond the rim hold nothing: their share goes to those before it.
            reach = 1 - np.sqrt(2) / self.size
            radius = np.hypot(across, down)
            scale = np.where(radius > reach, reach / np.maximum(radius, reach), 1)
            across, down = across * scale, down * scale
        return (
            first_row + _nearest(down, rows, self.sampling),
            _nearest(across, columns, self.sampling),
        )


def cell_edges(count: int, sampling: Sampling) -> Array:
    """Positions in [-1, 1] where the cells of `count` samples meet, and both ends."""
    samples = nodes(count, sampling)
    return np.concatenate([[-1.0], (samples[1:] + samples[:-1]) / 2, [1.0]])


def _middles(size: int, sampling: Sampling, count: int) -> Array:
    if count == 1:
        return nodes(size, sampling)[:, None]
    edges = cell_edges(size, sampling)
    return edges[:-1, None] + np.diff(edges)[:, None] * ((np.arange(count) + 0.5) / count)


def _nearest(position: Array, count: int, sampling: Sampling) -> Indices:
    """Index of the sample nearest to positions in [-1, 1]."""
    x = (position + 1) / 2
    index = np.floor(x * count) if sampling == "center" else np.rint(x * (count - 1))
    return np.clip(index, 0, count - 1).astype(np.intp)
