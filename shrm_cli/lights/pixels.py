"""Some pixels of an image of the sphere as points with areas, whatever the grid is.

Seams and poles of lat-longs and the edges of cube faces are nothing special here: what is near in
space is near on the sphere.
"""

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array, Indices, slices
from shrm_cli.records import record
from shrm_cli.sphere.directions import normalize
from shrm_cli.sphere.grid.base import Grid

_KEYS = 2**21
"""Little cubes of space along an axis, at most: three numbers below it make one of 63 bits."""
_HALF_OF_THE_NEIGHBOURS = np.array(
    [(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if (x, y, z) > (0, 0, 0)]
)
_CUBES_AT_ONCE = 2**17
"""The neighbours of cubes that are looked for together."""


@record
class SpherePixels:
    """The cells of an image, by the number of each pixel in row-major order."""

    grid: Grid

    @property
    def pitch(self) -> float:
        """The mean distance of pixels in radians."""
        return np.pi / self.grid.resolution

    def directions(self, numbers: Indices) -> Array:
        """Unit directions of the samples of some pixels, shape (n, 3), in the grid's axes."""
        rows, columns = np.divmod(numbers, self.grid.shape[1])
        down, across = self.grid.parts(1)
        return normalize(self.grid.points(rows, down[rows, 0], across[columns, 0])[0])

    def areas(self, numbers: Indices) -> Array:
        """Solid angles of some pixels in sr, shape (n,)."""
        rows, columns = np.divmod(numbers, self.grid.shape[1])
        weights = self.grid.weights()
        found = weights[rows, columns if weights.shape[1] > 1 else 0]
        ratios = self.grid.area_ratios()
        return found if ratios is None else found * (1 + ratios[0][rows])

    def within(self, axis: Array, radius: float) -> Indices:
        """Numbers of the pixels whose samples are within an angle of a direction.

        `axis`, of shape (3,), is unit, in the grid's axes. `radius` is in radians.
        """
        met = np.unique(self.grid.pixels(_cap(axis, radius + self.pitch, self.pitch / 2))[0])
        height, width = self.grid.shape
        # At the rim of an angular map rows are thinner than the cap's steps, and the last of them
        # are never looked up: those between the rows that are met on a face, and two more, count.
        edge = height // self.grid.faces
        runs = [met[met // edge == face] for face in np.unique(met // edge)]
        rows = np.concatenate(
            [np.arange(max(run[0] - 2, run[0] // edge * edge), run[-1] + 3) for run in runs]
        )
        rows = np.unique(rows[rows < height])
        found = [np.zeros(0, np.intp)]
        for some in np.array_split(rows, max(len(rows) * width // 2**20, 1)):
            numbers = (some[:, None] * width + np.arange(width)).ravel()
            near = np.linalg.norm(self.directions(numbers) - axis, axis=1)
            found.append(numbers[near <= 2 * np.sin(min(radius, np.pi) / 2)])
        return np.concatenate(found)


def _cap(axis: Array, radius: float, step: float) -> Array:
    """Directions no farther apart than a step on a circle's area and its rim, shape (n, 3)."""
    radius = min(radius, np.pi)
    helper = np.eye(3)[np.argmin(np.abs(axis))]
    first = normalize(np.cross(axis, helper))
    second = np.cross(axis, first)
    parts = [axis[None]]
    for angle in np.linspace(0, radius, int(np.ceil(radius / step)) + 1)[1:]:
        turns = np.arange(0, 2 * np.pi, min(step / max(np.sin(angle), step), np.pi / 4))
        around = np.cos(turns)[:, None] * first + np.sin(turns)[:, None] * second
        parts.append(np.cos(angle) * axis + np.sin(angle) * around)
    return np.concatenate(parts)


def clusters(points: Array, reach: float) -> Indices:
    """Number the groups of points that belong together.

    Space is cut into little cubes with edges of `reach`. Points in the same cube or in cubes that
    touch belong together, so that those within the reach always do.

    `points`, of shape (n, 3), are within the unit ball.

    Returns an array of int of shape (n,): 0, 1, ... for each point.
    """
    keys = _keys(points, reach)
    cubes, place = np.unique(keys, return_inverse=True)
    pairs = []
    for some in slices(len(_HALF_OF_THE_NEIGHBOURS), _CUBES_AT_ONCE // len(cubes)):
        x, y, z = _HALF_OF_THE_NEIGHBOURS[some].T[..., None]
        wanted = cubes + (x * _KEYS + y) * _KEYS + z
        at = np.minimum(np.searchsorted(cubes, wanted), len(cubes) - 1)
        neighbour, here = np.nonzero(cubes[at] == wanted)
        pairs.append(np.stack([here, at[neighbour, here]]))
    first, second = np.concatenate(pairs, axis=1)
    # Each cube takes the least number among its neighbours', and that one's own, till none changes.
    labels = np.arange(len(cubes))
    while True:
        before = labels.copy()
        np.minimum.at(labels, labels[first], labels[second])
        np.minimum.at(labels, labels[second], labels[first])
        labels = labels[labels]
        if np.array_equal(labels, before):
            break
    return np.unique(labels, return_inverse=True)[1][place]


def near(points: Array, others: Array, reach: float) -> NDArray[np.bool_]:
    """Whether each point, shape (n, 3), has one of the others, shape (m, 3), within a distance."""
    result = np.zeros(len(points), dtype=bool)
    if not len(others):
        return result
    keys = _keys(others, reach)
    order = np.argsort(keys, kind="stable")
    keys, sorted_others = keys[order], others[order]
    own = _keys(points, reach)
    # A cube and its neighbours along z are consecutive keys: nine runs for each point.
    for x in (-1, 0, 1):
        for y in (-1, 0, 1):
            base = own + (x * _KEYS + y) * _KEYS
            start = np.searchsorted(keys, base - 1, "left")
            stop = np.searchsorted(keys, base + 1, "right")
            left = np.flatnonzero((start < stop) & ~result)
            step = 0
            while len(left):
                gap = points[left] - sorted_others[start[left] + step]
                result[left] |= np.einsum("ij,ij->i", gap, gap) <= reach**2
                step += 1
                left = left[~result[left] & (start[left] + step < stop[left])]
    return result


def _keys(points: Array, edge: float) -> NDArray[np.int64]:
    """One number for the little cube of space that each point is in."""
    cubes = np.floor(np.asarray(points, dtype=float) / max(edge, 4 / _KEYS)).astype(np.int64)
    x, y, z = (cubes + _KEYS // 2).T
    return np.asarray((x * _KEYS + y) * _KEYS + z)
