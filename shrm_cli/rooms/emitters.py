"""The lamps of a room as points that are looked for: on triangles that send light, and outside.

A small lamp is found by looking for points on it, and one that fills half of what is seen by
looking everywhere. Both are done, and each direction counts by how densely either would have taken
it (Veach and Guibas 1995, the balance heuristic).
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array
from shrm_cli.geometry.mesh import Integers
from shrm_cli.geometry.rays import Rays
from shrm_cli.probe.disc import Disc, disc_directions
from shrm_cli.records import record
from shrm_cli.rooms.lamps import areas
from shrm_cli.rooms.room import Room
from shrm_cli.vocabulary import LUMINANCE

_OF_DISC = 8
"""Directions within each lamp outside."""
_STEPS = 0.7548776662466927, 0.5698402909980532
"""Steps of a sequence that fills squares evenly (Roberts 2018, "The Unreasonable Effectiveness of
Quasirandom Sequences"): powers of the plastic number's reciprocal."""
_SHORT = 1e-4
"""The part of the way to a lamp that is left out at both ends, so as not to meet what is there."""


def cosines(directions: Array, normals: Array) -> Array:
    """Return the cosines of directions (n, s, 3) to normals (n, 3); 0 below the horizon."""
    return np.maximum(np.einsum("nsv,nv->ns", directions, normals), 0)


@record(eq=False)
class _Looked:
    """What points see of samples on triangles, in arrays of a row for each point."""

    directions: Array
    faces: Integers
    density: Array
    """Samples in a unit of solid angle; 0 where a triangle shows its back."""
    is_free: NDArray[np.bool_]
    sent: Array
    """Radiance, shape (n, s, 3)."""


class Emitters:
    """Triangles that send light, and discs of light outside, as points of equal power.

    `rays` meet the same mesh. `samples` is the number of points on lamps that each point looks for.
    `faces` are the triangles, by default all that send light. `less`, of shape (m, 3), is what does
    not count of the radiance of each triangle of the room.
    """

    def __init__(
        self,
        room: Room,
        rays: Rays,
        samples: int,
        faces: Integers | None = None,
        less: Array | None = None,
    ) -> None:
        self._room, self._rays, self._samples, self._less = room, rays, samples, less
        self._faces = np.flatnonzero(room.emission.any(axis=1)) if faces is None else faces
        corners = room.mesh.corners(self._faces)
        sizes = areas(corners)
        powers = sizes * (room.emission[self._faces] @ LUMINANCE)
        # A dim lamp may be the only one that a point sees: half of the samples go by area alone.
        whole = max(powers.sum(), np.finfo(float).tiny), max(sizes.sum(), np.finfo(float).tiny)
        shares = (powers / whole[0] + sizes / whole[1]) / 2
        self._ends, self._corners = np.cumsum(shares), corners
        self._density = np.zeros(len(room.mesh.faces))
        self._density[self._faces] = samples * shares / np.maximum(sizes, 1e-300)

    def sent(self, faces: Integers, weights: Array) -> Array:
        """Return what points of triangles send, shape (n, 3); all is as of `Room.emission_at`."""
        found = self._room.emission_at(faces, weights)
        return found if self._less is None else found - self._less[faces]

    def density(self, faces: NDArray[np.integer], distance: Array, facing: Array) -> Array:
        """Return how many samples a unit of solid angle gets about directions to triangles.

        `faces`, of any shape, are triangles; -1 for none. `distance` and `facing`, of the same
        shape, are the distance to them, and the cosine that they are turned towards the point by.
        """
        near = np.maximum(distance, _SHORT * self._room.size)
        found = self._density[faces] * near**2 / np.maximum(facing, 1e-9)
        return np.where((faces >= 0) & (facing > 0), found, 0)

    def arriving(
        self, points: Array, number: int, others: Callable[[Array], Array]
    ) -> tuple[Array, Array]:
        """Return the light of all lamps that points see, as far as other directions leave it.

        `points` are of shape (n, 3). `number` is that of the first point among all, from which its
        samples follow. `others` takes directions (n, s, 3) and returns how many others a unit of
        solid angle has there.

        Returns `directions` of shape (n, s, 3), unit vectors from the points; and `light` of shape
        (n, s, 3), radiance times solid angle. The sum of it times anything, and that of what is
        seen in the other directions, is the integral over all lamps.
        """
        found = [self._of_faces(points, number, others)] if len(self._faces) else []
        found += [self._of_disc(points, disc) for disc in self._room.discs]
        if not found:
            nothing = np.zeros((len(points), 0, 3))
            return nothing, nothing
        directions, light = zip(*found, strict=True)
        return np.concatenate(directions, axis=1), np.concatenate(light, axis=1)

    def partly(self, points: Array, number: int) -> tuple[Array, Array, Array]:
        """Return how much points see of the triangles, and what of their light that leaves out.

        Returns `shares` of shape (n,), parts of their solid angle, -1 where all show their backs;
        `directions` of shape (n, s, 3); and `light` of shape (n, s, 3), what is seen less a share
        of what there is, in the mean over each triangle, radiance times solid angle; the sum of
        what there is, over all channels, is 1.
        """
        found = self._looked_for(points, number)
        solid = np.where(found.density > 0, 1 / np.maximum(found.density, 1e-300), 0)
        seen, whole = (solid * found.is_free).sum(axis=1), solid.sum(axis=1)
        shares = np.where(whole > 0, seen / np.maximum(whole, 1e-300), -1)
        light = solid[..., None] * self._room.emission[found.faces]
        light /= np.maximum(light.sum(axis=(1, 2), keepdims=True), 1e-300)
        return shares, found.directions, (found.is_free - shares[:, None])[..., None] * light

    def _of_faces(
        self, points: Array, number: int, others: Callable[[Array], Array]
    ) -> tuple[Array, Array]:
        found = self._looked_for(points, number)
        dense = found.density + others(found.directions)
        strength = found.is_free / np.maximum(dense, 1e-300)
        return found.directions, strength[..., None] * found.sent

    def _looked_for(self, points: Array, number: int) -> _Looked:
        count = self._samples
        # Each point has the same samples, shifted by other amounts.
        shift = np.arange(number, number + len(points))[:, None] * 0.61803398875
        along = (np.arange(count) + shift % 1) / count
        chosen = np.minimum(np.searchsorted(self._ends, along), len(self._faces) - 1)
        across, up = ((np.arange(count) * step + shift * (1 + step)) % 1 for step in _STEPS)
        outside = across + up > 1
        across, up = np.where(outside, 1 - across, across), np.where(outside, 1 - up, up)
        weights = np.stack([1 - across - up, across, up], axis=-1)
        places = np.einsum("nsc,nscv->nsv", weights, self._corners[chosen])
        ways = places - points[:, None]
        distance = np.linalg.norm(ways, axis=-1)
        directions = ways / np.maximum(distance, np.finfo(float).tiny)[..., None]
        faces = self._faces[chosen]
        facing = -np.einsum("nsv,nsv->ns", directions, self._room.normals[faces])
        lit = np.flatnonzero(facing > 0)
        starts = np.repeat(points, count, axis=0)[lit]
        flat, far = directions.reshape(-1, 3)[lit], distance.reshape(-1)[lit]
        met, _, first = self._rays.first_hits(starts, flat)
        is_free = np.zeros(facing.shape, bool)
        is_free.flat[lit] = (met == faces.reshape(-1)[lit]) | (first >= far * (1 - _SHORT))
        sent = self.sent(faces.ravel(), weights.reshape(-1, 3)).reshape(ways.shape)
        return _Looked(directions, faces, self.density(faces, distance, facing), is_free, sent)

    def _of_disc(self, points: Array, disc: Disc) -> tuple[Array, Array]:
        directions = disc_directions(disc, _OF_DISC)
        shape = len(points), _OF_DISC, 3
        every = np.broadcast_to(directions, shape)
        starts = np.repeat(points, _OF_DISC, axis=0)
        free = ~self._rays.occluded(starts, every.reshape(-1, 3)).reshape(shape[:2])
        light = disc.radiance * (disc.solid_angle / _OF_DISC)
        return every, free[..., None] * light
