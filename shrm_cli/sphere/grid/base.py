"""What every grid answers: the pixels of an image as cells of the sphere.

Whoever has an image asks its grid, and never which grid it is. A new grid is a new subclass of
`Grid`, and a row of `shrm_cli.vocabulary.GRIDS`.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from importlib import import_module
from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.arrays import Array, Indices
from shrm_cli.records import record
from shrm_cli.sphere.quadrature import cell_edges, nodes
from shrm_cli.vocabulary import GRIDS, Sampling

Sampler = Callable[[ArrayLike], Array]
"""Takes directions of any length, shape (..., 3); returns filtered values, (..., channels)."""


def bilinear(image: Array, columns: Array, rows: Array) -> Array:
    """Look an image up between its pixels; beyond its edge it is as at the edge."""
    height, width = image.shape[:2]
    columns, rows = np.clip(columns, 0, width - 1), np.clip(rows, 0, height - 1)
    left, top = columns.astype(int), rows.astype(int)
    across, down = (columns - left)[..., None], (rows - top)[..., None]
    right, below = np.minimum(left + 1, width - 1), np.minimum(top + 1, height - 1)
    upper = (1 - across) * image[top, left] + across * image[top, right]
    lower = (1 - across) * image[below, left] + across * image[below, right]
    return np.asarray((1 - down) * upper + down * lower)


_ALL_CHANNELS = 2**22
"""Pixels of larger images are integrated one channel after the other."""
_PARTS = 8
"""Parts of a cell along each axis, in the sum that is its solid angle."""


class Analysis(Protocol):
    """Projects an image, which arrives in blocks of rows, onto the spherical harmonics."""

    def add(self, start: int, pixels: Array, weights: Array) -> None:
        """Take in a block of rows.

        `start` is the index of the first row. `pixels` are of shape (rows, width, channels).
        `weights`, which broadcast to shape (rows, width), are what `Grid.weights` gives for these
        rows.
        """

    def coefficients(self) -> Array:
        """Real coefficients in the grid's axes, shape ((order+1)^2, channels)."""


@record
class Grid(ABC):
    """The pixels of an image of the sphere.

    A pixel's cell reaches half way to the samples beside it, cut at the ends of the image.
    Positions on an image run from -1 at its left or upper end to 1 at the other. Those of a cube
    are positions on a face. Directions are in the grid's own axes, in which +Y is up.
    """

    size: int
    """Height of a lat-long, texels along an edge of a cube, width of an angular map."""
    sampling: Sampling = "center"
    """Where the pixels at the ends of the image lie."""

    name: ClassVar[str]
    """The grid's name in `shrm_cli.vocabulary.GRIDS`."""
    proportions: ClassVar[tuple[int, int]]
    """Width and height of an image of size 1."""
    half_turn: ClassVar[float]
    """Pixels half way around a great circle, on average, of an image of size 1."""
    smallest: ClassVar[int]
    largest: ClassVar[int]
    """The range of sizes that images are made in, up to 1.6 GB as float32."""
    most_pixels: ClassVar[int | None]
    """Pixels of a file that is read as a whole; None where files are read by rows."""
    faces: ClassVar[int] = 1
    """Pictures of the same size that are stacked in the image, without a border between them."""
    wraps: ClassVar[bool] = False
    """Whether the left and right ends of the image are beside each other on the sphere."""

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the image."""
        columns, rows = self.proportions
        return rows * self.size, columns * self.size

    @property
    def resolution(self) -> float:
        """Pixels from pole to pole, or half way around any other great circle, on average."""
        return self.size * self.half_turn

    @property
    def latlong_rows(self) -> int:
        """Rows of the lat-long that is as fine."""
        return int(self.resolution)

    @property
    def resolved_order(self) -> int:
        """The largest degree whose waves are at least two pixels long.

        Sums over the pixels with shorter waves are aliases: a constant image would have them.
        """
        shared = 1 if self.sampling == "border" and self.size > 1 else 0
        return max(int((self.size - shared) * self.half_turn) - 1, 0)

    # ---- geometry ------------------------------------------------------------------------------

    @abstractmethod
    def directions(self) -> Array:
        """Unit directions of the pixels, shape (rows, columns, 3)."""

    @abstractmethod
    def weights(self, start: int = 0, stop: int | None = None) -> Array:
        """Weights of the pixels of some rows in integrals over the sphere.

        They are solid angles, or the weights of a more exact rule. Those of all pixels sum to 4 pi.

        `start` and `stop` are the first row, and the one behind the last; every row by default.

        Returns an array of shape (stop - start, columns) or (stop - start, 1): there is a single
        column where all the pixels of a row weigh the same.
        """

    @abstractmethod
    def points(self, rows: Indices, down: Array, across: Array) -> tuple[Array, Array]:
        """Directions at positions in some rows of the image.

        `rows` are the row that each position is in, which tells the face of a cube. `down` and
        `across` are positions on the image or the face; all three can be broadcast.

        Returns `directions` of shape (..., 3), those of a cube are longer than 1; and `density` of
        shape (...), solid angle for a unit of area of positions; 0 where the image holds nothing.
        """

    @abstractmethod
    def coordinates(self, directions: Array) -> tuple[Indices, Array, Array]:
        """Where `pixels` looks for directions of any length, shape (..., 3).

        Returns `face` of shape (...), which of the `faces` that are stacked in the image; and
        `across`, `down` of shape (...), positions on it.
        """

    def pixels(self, directions: Array) -> tuple[Indices, Indices]:
        """Row and column of the pixel whose cell contains each direction, shape (..., 3)."""
        rows, columns = self.shape
        rows //= self.faces
        face, across, down = self.coordinates(directions)
        return (
            face * rows + _nearest(down, rows, self.sampling),
            _nearest(across, columns, self.sampling),
        )

    def parts(self, count: int) -> tuple[Array, Array]:
        """Positions of the middles of the `count` parts of each cell along an axis.

        Returns `down` and `across`, each of shape (rows, count) and (columns, count), the samples
        themselves where `count` is 1.
        """
        rows, columns = self.shape
        down = _middles(rows // self.faces, self.sampling, count)
        return np.tile(down, (self.faces, 1)), _middles(columns, self.sampling, count)

    def extents(self) -> tuple[Array, Array]:
        """Height of each row of cells and width of each column, as differences of positions."""
        rows, columns = self.shape
        down = np.diff(cell_edges(rows // self.faces, self.sampling))
        return np.tile(down, self.faces), np.diff(cell_edges(columns, self.sampling))

    def solid_angles(self, rows: Indices, columns: Indices) -> Array:
        """Solid angle of the cells of some pixels, shape (n,), as the sum over some parts."""
        down, across = self.parts(_PARTS)
        _, density = self.points(
            rows[:, None, None], down[rows][:, :, None], across[columns][:, None, :]
        )
        heights, widths = self.extents()
        return np.asarray(density.mean(axis=(1, 2)) * heights[rows] * widths[columns])

    def area_ratios(self) -> tuple[Array, Array] | None:
        """How the rows' weights differ from solid angles; None where they are solid angles.

        Returns `ratios` of shape (rows,), solid angle over weight, less 1; and `areas` of shape
        (rows,), solid angles of whole rows, sr.
        """
        return None

    def joined(self, count: int) -> "Grid | None":
        """The grid whose cells are `count` x `count` cells of this one each, if there is one.

        Only grids that have `area_ratios` can be joined.
        """
        return None

    # ---- images --------------------------------------------------------------------------------

    @abstractmethod
    def sampler(self, image: Array) -> Sampler:
        """A filtered look-up of an image, shape (rows, columns, channels), without seams."""

    @abstractmethod
    def analysis(self, order: int) -> Analysis:
        """A projection of an image onto the spherical harmonics of degrees up to `order`."""

    @abstractmethod
    def share_borders(self, image: Array) -> None:
        """Give border pixels that are the same direction the mean of their cells, in place."""

    def used(self) -> NDArray[np.bool_] | None:
        """The pixels that hold radiance, shape (rows, columns); None where all of them do."""
        return None

    def turned(self, image: Array, matrix: Array) -> Array | None:
        """An image in other axes, if its pixels fall upon each other there.

        `image` is of shape (rows, columns, channels). `matrix`, of shape (3, 3), is orthogonal,
        from the axes of the image to those of the result.

        Returns the same pixels, none of them changed, or None if they do not line up.
        """
        return image if np.allclose(matrix, np.eye(3), rtol=0, atol=1e-9) else None

    def reduced(self, image: Array, target: "Grid", matrix: Array) -> Array | None:
        """Exact means over the cells of a coarser grid, where these are known.

        `image` and `matrix` are as `turned` takes them. `target` is the coarser grid.

        Returns an array of shape (target rows, target columns, channels), or None.
        """
        return None


def grid_class(name: str) -> type[Grid]:
    """The class of a grid, by a name out of `shrm_cli.vocabulary.GRIDS`."""
    module, _, member = GRIDS[name].partition(":")
    return getattr(import_module(module), member)


def channels_at_once(pixels: Array) -> int:
    """How many channels of an image, shape (rows, columns, channels), are integrated together.

    Their products with weights take twice as much memory as the pixels, but they share waves.
    """
    return pixels.shape[-1] if pixels[..., 0].size <= _ALL_CHANNELS else 1


class WholeImageAnalysis:
    """An `Analysis` of an image that arrives in one block.

    `integrate` goes from all the pixels of some channels, shape (rows, columns, channels), each
    multiplied by its weight, to coefficients, shape ((order+1)^2, channels).
    """

    def __init__(self, integrate: Callable[[Array], Array]) -> None:
        self._integrate = integrate
        self._coefficients: Array | None = None

    def add(self, start: int, pixels: Array, weights: Array) -> None:
        if start or self._coefficients is not None:
            raise ValueError("this grid is analyzed as a whole, not by blocks of rows")
        channels, step = pixels.shape[-1], channels_at_once(pixels)
        weights = weights[..., None]
        parts = [
            self._integrate(pixels[..., k : k + step] * weights) for k in range(0, channels, step)
        ]
        self._coefficients = np.concatenate(parts, axis=-1)

    def coefficients(self) -> Array:
        if self._coefficients is None:
            raise ValueError("no rows were added")
        return self._coefficients


def _middles(size: int, sampling: Sampling, count: int) -> Array:
    """Positions of the middles of the parts of each of `size` cells, shape (size, count)."""
    if count == 1:
        return nodes(size, sampling)[:, None]
    edges = cell_edges(size, sampling)
    return edges[:-1, None] + np.diff(edges)[:, None] * ((np.arange(count) + 0.5) / count)


def _nearest(position: Array, count: int, sampling: Sampling) -> Indices:
    """Index of the sample nearest to positions in [-1, 1]."""
    x = (position + 1) / 2
    index = np.floor(x * count) if sampling == "center" else np.rint(x * (count - 1))
    return np.clip(index, 0, count - 1).astype(np.intp)
