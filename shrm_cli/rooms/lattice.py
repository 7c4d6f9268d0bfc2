"""Points in rows: where the probes of a grid are."""

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.records import record

MOST = 2**20
"""The most probes of a grid."""


@record(eq=False)
class Lattice:
    """A box that is cut into cells, with a probe in the middle of each.

    Attributes
    ----------
    low, high : ndarray, shape (3,)
        The corners of the box, world axes.
    shape : tuple of 3 int
        Cells along x, y and z.
    """

    low: Array
    high: Array
    shape: tuple[int, int, int]

    @property
    def spacing(self) -> Array:
        """Distances between neighbours along each axis, shape (3,)."""
        return (self.high - self.low) / self.shape

    @property
    def count(self) -> int:
        """The number of probes."""
        return int(np.prod(self.shape))

    def points(self) -> Array:
        """Return where the probes are, shape (n, 3); z runs fastest, then y, then x."""
        axes = [np.arange(count) for count in self.shape]
        index = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
        return self.low + (index + 0.5) * self.spacing

    def corners(self, points: Array) -> tuple[Array, Array]:
        """Return the eight probes about points, and their shares by distance.

        Parameters
        ----------
        points : ndarray, shape (n, 3)
            Those outside of the middles of the outermost cells are moved to them.

        Returns
        -------
        probes : ndarray of int64, shape (n, 8)
        shares : ndarray, shape (n, 8)
            Their sums are 1.
        """
        most = np.array(self.shape) - 1
        place = np.clip((points - self.low) / self.spacing - 0.5, 0, most)
        first = np.minimum(np.floor(place), np.maximum(most - 1, 0)).astype(np.int64)
        part = place - first
        probes, shares = [], []
        for corner in np.ndindex(2, 2, 2):
            index = np.minimum(first + corner, most)
            probes.append(np.ravel_multi_index(tuple(index.T), self.shape))
            shares.append(np.where(corner, part, 1 - part).prod(axis=1))
        return np.stack(probes, axis=1), np.stack(shares, axis=1)
