"""A grid that the package does not have: the sphere projected onto an octahedron, unfolded.

It is all that a new layout takes, beside a row of `shrm_cli.vocabulary.GRIDS`. The center of the
square looks along +Z, the middles of its edges along -X, +X, +Y and -Y, and its corners along -Z.
"""

import numpy as np

from shrm_cli.sphere.grid.base import Grid, WholeImageAnalysis
from shrm_cli.sphere.harmonics import real_harmonics


class Octahedral(Grid):
    name = "octahedral"
    proportions = (1, 1)
    half_turn = 1.0
    smallest = 2
    largest = 4096
    most_pixels = 2**25

    def directions(self):
        rows = np.arange(self.size)
        down, across = (parts[:, 0] for parts in self.parts(1))
        points, _ = self.points(rows[:, None], down[:, None], across[None])
        return points / np.linalg.norm(points, axis=-1, keepdims=True)

    def weights(self, start=0, stop=None):
        rows, columns = np.indices(self.shape)
        cells = self.solid_angles(rows.ravel(), columns.ravel()).reshape(self.shape)
        return (cells * (4 * np.pi / cells.sum()))[start:stop]

    def points(self, rows, down, across):
        x, y = np.broadcast_arrays(-across, -down)
        z = 1 - np.abs(x) - np.abs(y)
        x, y = fold(x, y, z)
        points = np.stack([x, y, z], axis=-1)
        return points, np.linalg.norm(points, axis=-1) ** -3

    def coordinates(self, directions):
        x, y, z = np.moveaxis(directions / np.abs(directions).sum(axis=-1, keepdims=True), -1, 0)
        x, y = fold(x, y, z)
        return np.zeros(x.shape, dtype=np.intp), -x, -y

    def sampler(self, image):
        return lambda directions: image[self.pixels(np.asarray(directions))]

    def analysis(self, order):
        harmonics = real_harmonics(order, self.directions())
        return WholeImageAnalysis(lambda image: np.einsum("ijn,ijc->nc", harmonics, image))

    def share_borders(self, image):
        pass


def fold(x, y, z):
    """Turn the four triangles of the lower half over the edges where z is 0."""
    return (
        np.where(z < 0, (1 - np.abs(y)) * np.where(x < 0, -1, 1), x),
        np.where(z < 0, (1 - np.abs(x)) * np.where(y < 0, -1, 1), y),
    )
