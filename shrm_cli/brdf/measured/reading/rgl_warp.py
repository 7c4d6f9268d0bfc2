"""Bilinear grids over the unit square that depend on parameters, and warps by their density.

A table holds a grid for each combination of some values of the parameters, a slice each, and is
linear between them in each parameter.
"""

from math import prod

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array

Index = NDArray[np.intp]


class Slices:
    """Where parameters lie between the slices of a table; those beyond the ends lie at the ends.

    `axes` are for each parameter two arrays: the values of the slices, increasing and two at least,
    and the values that are looked up. Slices of the last parameter follow each other. Without
    parameters the table is a single slice.
    """

    def __init__(self, *axes: tuple[Array, Array]) -> None:
        self._low: Index = np.zeros(1, dtype=np.intp)
        parts: list[Array] = []
        for nodes, parameter in axes:
            low = np.clip(np.searchsorted(nodes, parameter, side="right") - 1, 0, len(nodes) - 2)
            nodes = nodes.astype(parameter.dtype)
            start, end = nodes[low], nodes[low + 1]
            parts.append(np.clip((parameter - start) / (end - start), 0, 1))
            self._low = self._low * len(nodes) + low
        counts = [len(nodes) for nodes, _ in axes]
        strides = [prod(counts[k + 1 :]) for k in range(len(counts))]
        self._steps = list(zip(strides, parts, strict=True))

    def blend(self, records: Array, index: Index, per_slice: int) -> Array:
        """Interpolate records between the slices that each point lies between, shape (n, ...).

        `records` are of shape (slices * per_slice, ...). `index`, of shape (n,), is that of a
        record within its slice. `per_slice` is the number of records of a slice.
        """
        steps = [(stride * per_slice, part) for stride, part in self._steps]
        return _blend(records, self._low * per_slice + index, steps)


def _blend(records: Array, at: Index, steps: list[tuple[int, Array]]) -> Array:
    """Interpolate between records and those a step farther, along each of the steps."""
    if not steps:
        return records.take(at, axis=0)
    (step, part), *inner = steps
    low, high = _blend(records, at, inner), _blend(records, at + step, inner)
    return low + part[(..., *(None,) * (records.ndim - 1))] * (high - low)


class Grid:
    """Values with several channels on a grid in each slice, bilinear between the nodes.

    `values` are of shape (s, rows, columns, channels).
    """

    def __init__(self, values: Array) -> None:
        self.shape = values.shape[1:3]
        # A record holds a node and its right neighbour, so that two fetches serve four corners.
        pairs = np.stack([values[:, :, :-1], values[:, :, 1:]], axis=3)
        pairs = np.pad(pairs, [(0, 0), (0, 0), (0, 1), (0, 0), (0, 0)])
        self._records = np.ascontiguousarray(pairs, dtype=np.float32).reshape(-1, *pairs.shape[3:])

    def __call__(self, x: Array, y: Array, slices: Slices) -> Array:
        """Interpolate values, shape (n, channels), at x (columns) and y (rows), both 0 .. 1."""
        columns = self.shape[1]
        column, right = _cell(x, columns)
        row, below = _cell(y, self.shape[0])
        at, count = row * columns + column, self.shape[0] * columns
        top = slices.blend(self._records, at, count)
        bottom = slices.blend(self._records, at + columns, count)
        pair = top + below[:, None, None] * (bottom - top)
        return pair[:, 0] + right[:, None] * (pair[:, 1] - pair[:, 0])


class Warp:
    """A map of the unit square to itself that makes a bilinear density uniform.

    The cumulative of the density along a row maps x, and the cumulative of the rows' integrals maps
    y. Both are exact for the density as it is interpolated.

    `density`, of shape (s, rows, columns), is not negative, and has a positive integral in every
    slice, of any scale.

    References: Dupuy and Jakob 2018, "An adaptive parameterization for efficient material
    acquisition and rendering". This is the inverse of the sampling of visible normals there.
    """

    def __init__(self, density: Array) -> None:
        self.shape = density.shape[1:]
        downs = np.empty(density.shape[:2], dtype=np.float32)
        # A record holds the density at a node and at the next node of its row, the cumulative up to
        # the node, and the integral of the whole row.
        records = np.empty((*density.shape, 4), dtype=np.float32)
        for k, each in enumerate(density):  # so that double precision serves one slice at a time
            downs[k], records[k] = _cumulated(each.astype(np.float64))
        self._down: Array = downs.reshape(-1)
        self._records: Array = records.reshape(-1, 4)

    def invert(self, x: Array, y: Array, slices: Slices) -> tuple[Array, Array]:
        """Find the points of the uniform square that the map takes to x (columns) and y (rows).

        Where a row has no density at all, x becomes 0.
        """
        columns = self.shape[1]
        column, right = _cell(x, columns)
        row, below = _cell(y, self.shape[0])
        at, count = row * columns + column, self.shape[0] * columns
        top = slices.blend(self._records, at, count)
        bottom = slices.blend(self._records, at + columns, count)
        left, after, along, whole = (top + below[:, None] * (bottom - top)).T
        inside = right * (left + right / 2 * (after - left))
        tiny = np.finfo(np.float32).tiny
        source_x = (along + inside) / np.maximum(whole, tiny)
        first, last = top[:, 3], bottom[:, 3]
        source_y = slices.blend(self._down, row, self.shape[0])
        source_y = source_y + below * (first + below / 2 * (last - first))
        return np.clip(source_x, 0, 1), np.clip(source_y, 0, 1)


def _cumulated(density: Array) -> tuple[Array, Array]:
    """The cumulative of the rows, shape (rows,), and the records, shape (rows, columns, 4)."""
    along = np.zeros(density.shape)
    along[:, 1:] = np.cumsum((density[:, :-1] + density[:, 1:]) / 2, axis=1)
    rows = along[:, -1]
    down = np.zeros(rows.shape)
    down[1:] = np.cumsum((rows[:-1] + rows[1:]) / 2)
    following = np.concatenate([density[:, 1:], density[:, -1:]], axis=1)
    whole = np.broadcast_to(rows[:, None], density.shape)
    records = np.stack([density, following, along, whole], axis=-1)
    return down / down[-1], records / down[-1]


def _cell(coordinate: Array, count: int) -> tuple[Index, Array]:
    """The cell that a coordinate 0 .. 1 falls into, of a grid of `count` nodes, and where in it."""
    scaled = np.clip(coordinate, 0, 1) * (count - 1)
    low = np.minimum(scaled.astype(np.intp), count - 2)
    return low, scaled - low.astype(scaled.dtype)
