"""The grid of latitude-longitude maps, whose rows can be read and analyzed in blocks."""

import numpy as np

from shrm_cli.arrays import Array, Indices
from shrm_cli.sphere.grid.base import Analysis, Grid, Sampler
from shrm_cli.sphere.quadrature import cell_edges, colatitude_weights, longitude_weights
from shrm_cli.sphere.transform import LatLongAnalysis


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
        from shrm_cli.sphere.latlong import latlong_directions

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
        from shrm_cli.sphere.latlong import latlong_points

        density = np.cos(down * (np.pi / 2)) * (np.pi**2 / 2)
        return latlong_points(across, down), density + 0 * across

    def coordinates(self, directions: Array) -> tuple[Indices, Array, Array]:
        from shrm_cli.sphere.latlong import latlong_coordinates

        across, down = latlong_coordinates(directions)
        return np.zeros(across.shape, dtype=np.intp), across, down

    def sampler(self, image: Array) -> Sampler:
        from shrm_cli.sphere.sampling import LatLongSampler

        return LatLongSampler(image, self.sampling)

    def analysis(self, order: int) -> Analysis:
        return LatLongAnalysis(2 * self.size, self.size, order, self.sampling)

    def share_borders(self, image: Array) -> None:
        image[:, [0, -1]] = (image[:, :1] + image[:, -1:]) / 2
        image[[0, -1]] = image[[0, -1], :-1].mean(axis=1, keepdims=True)

    def turned(self, image: Array, matrix: Array) -> Array | None:
        from shrm_cli.sphere.grid.overlap import overlapped, turn_about_axis

        turn = turn_about_axis(matrix, 2 * self.size, self.sampling)
        if turn is None or turn[0] % 1:
            return None
        return overlapped(image, self.sampling, self.shape, self.sampling, *turn)

    def reduced(self, image: Array, target: Grid, matrix: Array) -> Array | None:
        from shrm_cli.sphere.grid.overlap import overlapped, turn_about_axis

        turn = turn_about_axis(matrix, 2 * self.size, self.sampling)
        if turn is None or not isinstance(target, LatLong):
            return None
        return overlapped(image, self.sampling, target.shape, target.sampling, *turn)
