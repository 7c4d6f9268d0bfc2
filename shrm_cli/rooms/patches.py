"""Triangles cut into small ones of one brightness each."""

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array
from shrm_cli.rooms.room import Room

MOST = 2**18
"""The most patches of a room."""

Integers = NDArray[np.int64]


class Patches:
    """The triangles of a room, each cut into s^2 alike ones.

    A triangle's patches are numbered in rows from its first corner on: row r has 2 r + 1, of which
    every second one stands upside down.

    Parameters
    ----------
    size : float
        The longest edge that a patch should have; there are `MOST` of them at most.

    Attributes
    ----------
    owner : ndarray of int64, shape (k,)
        The triangle of each patch.
    centers : ndarray, shape (k, 3)
    """

    def __init__(self, room: Room, size: float) -> None:
        corners = room.mesh.corners(np.arange(len(room.mesh.faces)))
        edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
        self._cuts = np.maximum(np.ceil(edges / size), 1).astype(np.int64)
        while np.sum(self._cuts**2) > max(MOST, len(edges)):
            self._cuts = np.maximum(self._cuts * 3 // 4, 1)
        counts = self._cuts**2
        self._first = np.cumsum(counts) - counts
        self.owner = np.repeat(np.arange(len(counts)), counts)
        number = np.arange(len(self.owner)) - self._first[self.owner]
        row = np.floor(np.sqrt(number + 0.5)).astype(np.int64)
        place, inverted = np.divmod(number - row**2, 2)
        third = (1 + inverted) / 3
        cuts = self._cuts[self.owner]
        second, last = (row - inverted - place + third) / cuts, (place + third) / cuts
        weights = np.stack([1 - second - last, second, last], axis=1)
        self.centers = np.einsum("kc,kcv->kv", weights, corners[self.owner])

    def __len__(self) -> int:
        return len(self.owner)

    def at(self, faces: Integers, barycentric: Array) -> Integers:
        """Return the patches at points of triangles, shape (n,)."""
        cuts = self._cuts[faces]
        second, last = barycentric[:, 1] * cuts, barycentric[:, 2] * cuts
        row = np.clip(np.floor(second + last), 0, cuts - 1).astype(np.int64)
        place = np.clip(np.floor(last), 0, row).astype(np.int64)
        inverted = np.floor(second) + place < row
        return self._first[faces] + np.minimum(row**2 + 2 * place + inverted, (row + 1) ** 2 - 1)
