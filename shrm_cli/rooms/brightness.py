"""The light that the surfaces of a room send on.

The irradiance of a patch is ``E = D + pi <L>``: what lamps send straight to it, and the mean of the
radiance L that arrives along directions which are dense by the cosine to its normal. What each
direction meets is found once, as the number of a patch, and then light goes along it as often as is
needed: ``L = albedo / pi E`` of that patch. Such a mean over few directions is noisy, but it is a
mean over patches, and a probe gathers from hundreds of them.

References: Goral, Torrance, Greenberg and Battaile 1984, Modeling the Interaction of Light Between
Diffuse Surfaces. Keller 1997, Instant Radiosity, has the same integral by paths.
"""

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array, slices
from shrm_cli.errors import MeshError
from shrm_cli.geometry.mesh import Integers
from shrm_cli.geometry.rays import Rays
from shrm_cli.progress import Progress, tell
from shrm_cli.records import record
from shrm_cli.rooms.emitters import Emitters, cosines
from shrm_cli.rooms.room import Room, centers_of
from shrm_cli.sphere.directions import horizontal_tangents, surface_frames
from shrm_cli.sphere.quadrature import spiral_directions

_DIRECTIONS = 96
"""Directions along which a patch gathers what others reflect."""
_SAMPLES = 32
"""Points on lamps that a patch looks for."""
_BOUNCES = 100
_LOST = 1e-4
"""Light of which no more than this part is left is no longer sent on. Rooms that lose no more of it
at a bounce have light without end."""
_AT_ONCE = 2**11
"""Patches at a time."""
LIFT = 1e-5
"""How far above surfaces rays begin, as a part of the diagonal of the room's box."""
_MOST = 2**18
"""The most patches of a room."""


class Patches:
    """The triangles of a room, each cut into s^2 alike ones.

    A triangle's patches are numbered in rows from its first corner on: row r has 2 r + 1, of which
    every second one stands upside down.

    `size` is the longest edge that a patch should have; there are `_MOST` of them at most.

    `owner`, of shape (k,), is the triangle of each patch. `centers` is of shape (k, 3), and
    `weights`, of the same, are barycentric. `sides`, of shape (k, 3, 2), are two of its sides.
    """

    def __init__(self, room: Room, size: float) -> None:
        corners = room.mesh.corners(np.arange(len(room.mesh.faces)))
        edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
        self._cuts = np.maximum(np.ceil(edges / size), 1).astype(np.int64)
        while np.sum(self._cuts**2) > max(_MOST, len(edges)):
            self._cuts = np.maximum(self._cuts * 3 // 4, 1)
        counts = self._cuts**2
        self._first = np.cumsum(counts) - counts
        self.owner = np.repeat(np.arange(len(counts)), counts)
        number = np.arange(len(self.owner)) - self._first[self.owner]
        cuts = self._cuts[self.owner]
        self.weights = centers_of(number, cuts)
        self.centers = np.einsum("kc,kcv->kv", self.weights, corners[self.owner])
        self.sides = room.mesh.sides(self.owner) / cuts[:, None, None]

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


@record(eq=False)
class Seen:
    """What rays see, in arrays of an entry each."""

    faces: NDArray[np.int64]
    """Triangles that they meet; -1 for none, shape (n,)."""
    patches: NDArray[np.int64]
    """What they meet from its front; -1 for nothing, shape (n,)."""
    sky: Array
    lamps: Array
    """`sky` and `lamps`: radiance of the surroundings, and of what is met, as far as `Emitters`
    leave it, shape (n, 3)."""
    distance: Array
    """The distance to what is met; infinite where nothing is, shape (n,)."""
    is_behind: NDArray[np.bool_]
    """Whether a triangle is met from behind, shape (n,)."""


class Brightness:
    """The light that each patch of a room sends from its front, besides that of lamps."""

    def __init__(
        self, room: Room, rays: Rays, size: float, progress: Progress | None = None
    ) -> None:
        self.room, self.rays = room, rays
        self.patches = patches = Patches(room, size)
        normals = room.normals[patches.owner]
        origins = patches.centers + LIFT * room.size * normals
        emitters = Emitters(room, rays, _SAMPLES)
        met = np.empty((len(patches), _DIRECTIONS), np.int64)
        lit = np.empty((len(patches), 3))
        for part in slices(len(patches), _AT_ONCE):
            of = normals[part]

            def dense(directions: Array, of: Array = of) -> Array:
                return cosines(directions, of) * (_DIRECTIONS / np.pi)

            directions, light = emitters.arriving(origins[part], part.start, dense)
            lit[part] = np.einsum("ns,nsc->nc", cosines(directions, of), light)
            ways = _above(of, part.start)
            starts = np.repeat(origins[part], _DIRECTIONS, axis=0)
            seen = self.look(starts, ways.reshape(-1, 3), emitters, dense(ways).reshape(-1))
            met[part] = seen.patches.reshape(-1, _DIRECTIONS)
            straight = (seen.sky + seen.lamps).reshape(-1, _DIRECTIONS, 3)
            lit[part] += np.pi * straight.mean(axis=1)
            tell(progress, part.stop, len(patches))
        self.radiance = self._settled(lit, met)

    def _settled(self, lit: Array, met: NDArray[np.int64]) -> Array:
        """Return the radiance of each patch, shape (k + 1, 3); the last one is of no patch."""
        of = self.patches
        albedo = self.room.albedo_at(of.owner, of.weights, of.sides)
        sent = np.zeros((len(albedo) + 1, 3))
        sent[:-1] = albedo / np.pi * lit
        total = sent.copy()
        for _ in range(_BOUNCES):
            before = sent.sum(axis=0)
            arriving = np.empty_like(lit)
            for part in slices(len(met), _AT_ONCE):
                for channel in range(3):  # numpy is slow along axes of three
                    arriving[part, channel] = sent[:, channel].take(met[part]).mean(axis=1)
            sent[:-1] = albedo * arriving
            total += sent
            # Light that has gone to and fro falls by the same part at each bounce.
            kept = sent.sum(axis=0) / np.maximum(before, np.finfo(float).tiny)
            left = kept / np.maximum(1 - kept, _LOST)
            if (sent.sum(axis=0) * left <= _LOST * total.sum(axis=0)).all():
                break
        if (kept > 1 - _LOST).any():
            raise MeshError(
                "the walls reflect all light, which grows without end where none is lost; give "
                "them a lower `albedo`"
            )
        return np.asarray(total + sent * left)

    def look(
        self, origins: Array, directions: Array, emitters: Emitters, dense: Array | float
    ) -> "Seen":
        """Return what rays see.

        `origins` and `directions` are each of shape (n, 3). `emitters` say which look for the lamps
        besides. `dense`, a number or of shape (n,), is how many of the rays a unit of solid angle
        has.
        """
        faces, barycentric, distance = self.rays.first_hits(origins, directions)
        facing = -np.einsum("nv,nv->n", self.room.normals[faces], directions)
        hit = np.flatnonzero((faces >= 0) & (facing > 0))
        patches = np.full(len(faces), -1)
        patches[hit] = self.patches.at(faces[hit], barycentric[hit])
        rivals = emitters.density(faces[hit], distance[hit], facing[hit])
        own = np.broadcast_to(dense, len(faces))[hit]
        share = own / np.maximum(own + rivals, np.finfo(float).tiny)
        lamps, sky = np.zeros((2, len(faces), 3))
        lamps[hit] = share[:, None] * emitters.sent(faces[hit], barycentric[hit])
        free = np.flatnonzero(faces < 0)
        if len(free):
            sky[free] = self.room.sky_radiance(directions[free])
        return Seen(faces, patches, sky, lamps, distance, (faces >= 0) & (patches < 0))


def _above(normals: Array, number: int) -> Array:
    """Directions that are dense by the cosine to normals, shape (n, _DIRECTIONS, 3).

    Each normal has the same, turned about it by another angle. `number` is that of the first one.
    """
    spiral = spiral_directions(_DIRECTIONS)
    # What is even over the sphere's heights is even over the squares of the cosines.
    height = np.sqrt((spiral[:, 2] + 1) / 2)
    angle = np.arctan2(spiral[:, 1], spiral[:, 0])
    turn = 2 * np.pi * 0.61803398875 * np.arange(number, number + len(normals))
    around = angle + turn[:, None]
    flat = np.sqrt(1 - height**2)
    local = np.stack(
        [flat * np.cos(around), flat * np.sin(around), np.broadcast_to(height, around.shape)],
        axis=-1,
    )
    return local @ surface_frames(normals, horizontal_tangents(normals))
