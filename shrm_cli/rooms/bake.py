"""From a room to the probes of a grid."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array, relative_difference, slices
from shrm_cli.geometry.rays import Rays
from shrm_cli.progress import Progress, Stages
from shrm_cli.records import record
from shrm_cli.rooms.brightness import Brightness, Seen
from shrm_cli.rooms.emitters import Emitters, cosines
from shrm_cli.rooms.grid import Lattice, ProbeGrid, octahedral_directions
from shrm_cli.rooms.lamps import SeenLamps, joined, lamps_of
from shrm_cli.rooms.room import Room
from shrm_cli.sphere.harmonics import real_harmonics
from shrm_cli.sphere.quadrature import scrambled, spiral_directions

SAMPLES = 1024
"""Directions along which a probe looks."""
_OF_LAMPS = 256
"""Points on lamps that a probe looks for."""
_OF_LAMP = 8
"""At least so many of each lamp."""
IN_WALLS = 0.25
"""The share of directions in which a probe within a wall sees triangles from behind."""
_TOUCHING = 1e-5
"""Surfaces are no nearer than so much of a cell's diagonal, for probes that lie on them."""
_PATCHES = 2.0
"""Patches along the least spacing of the probes."""
_RAYS_AT_ONCE = 2**18
_PROOFS = 400
"""Points between the probes where the light is gathered, to state errors."""


def bake(
    room: Room,
    lattice: Lattice,
    order: int,
    samples: int = SAMPLES,
    progress: Progress | None = None,
) -> ProbeGrid:
    """Find the light at the probes of a lattice, and how far it is off between them.

    The facts of the result have the relative RMS errors of the irradiance at random points:
    ``error`` of all light, ``error_coefficients`` where no lamps are known, but coefficients alone,
    and ``error_reflected`` of the light that does not come straight from lamps.
    """
    stages = Stages(progress, 3)
    rays = Rays(room.mesh)
    patch = float(lattice.spacing.min()) / _PATCHES
    gathering = Gathering(Brightness(room, rays, patch, stages.within), order, samples)
    stages.done(1, 3)
    longest = float(np.linalg.norm(lattice.spacing))
    points = lattice.points()
    found = []
    for part in slices(len(points), _RAYS_AT_ONCE // samples):
        found.append(gathering.probe(points[part], part.start, longest))
        stages.within(part.stop, len(points))
    stages.done(2, 3)
    parts = ((e.reflected, e.direct, e.others, e.seen, e.walls, e.behind) for e in found)
    reflected, direct, others, seen, walls, behind = (
        np.concatenate(each) for each in zip(*parts, strict=True)
    )
    lamps = SeenLamps(joined(gathering.groups), seen, others) if gathering.groups else None
    grid = ProbeGrid(lattice, reflected, direct, walls, behind <= IN_WALLS, lamps=lamps)
    return replace(grid, facts=_proven(grid, gathering, stages))


def _proven(grid: ProbeGrid, gathering: "Gathering", stages: Stages) -> dict[str, float]:
    """Return relative RMS errors at random points that are not within walls."""
    lattice = grid.lattice
    # Any numbers without a pattern will do for points and normals, the same in each run.
    order = np.stack([np.roll(scrambled(_PROOFS), shift) for shift in (0, 17, 61)], axis=1)
    points = lattice.low + (order + 0.5) / _PROOFS * (lattice.high - lattice.low)
    normals = spiral_directions(_PROOFS)[scrambled(_PROOFS)]
    truths = []
    for part in slices(_PROOFS, 50):
        truths.append(gathering.irradiance(points[part], normals[part], part.start))
        stages.within(part.stop, _PROOFS)
    reflected, direct, behind = (np.concatenate(each) for each in zip(*truths, strict=True))
    free = behind < IN_WALLS
    found = {}
    for name, of, truth, is_direct in (
        ("error", grid, reflected + direct, True),
        ("error_coefficients", replace(grid, lamps=None), reflected + direct, True),
        ("error_reflected", grid, reflected, False),
    ):
        shown = of.irradiance(points, normals, is_direct)
        found[name] = relative_difference(shown[free], truth[free])
    return found


@record(eq=False)
class Looked:
    """What some probes see; see `ProbeGrid` and `SeenLamps`."""

    reflected: Array
    direct: Array
    others: Array
    seen: Array
    walls: Array
    behind: Array
    """The shares of back faces, shape (n,)."""


class Gathering:
    """What is seen from points of a room."""

    def __init__(self, brightness: Brightness, order: int, samples: int) -> None:
        self._brightness, self._order = brightness, order
        room, rays = brightness.room, brightness.rays
        faces = np.flatnonzero(room.emission.any(axis=1))
        self.groups = lamps_of(room.fronts(faces), room.emission[faces])
        each = max(_OF_LAMP, _OF_LAMPS // max(len(self.groups), 1))
        self._lamps = [Emitters(room, rays, each, faces[group.rows]) for group in self.groups]
        known = np.zeros_like(room.emission)
        for group in self.groups:
            known[faces[group.rows]] = room.emission[faces[group.rows]]
        others = np.flatnonzero((known != room.emission).any(axis=1) | room.is_uneven)
        self._emitters = Emitters(room, rays, _OF_LAMPS)
        self._others = Emitters(room, rays, _OF_LAMPS, others, known)
        self._directions = spiral_directions(samples)
        self._area = 4 * np.pi / samples
        self._harmonics = real_harmonics(order, self._directions) * self._area
        self._texels = _Texels(self._directions)

    def probe(self, points: Array, number: int, longest: float) -> Looked:
        """Return what probes see, of walls up to `longest`; `number` is the first one's."""
        seen = self._look(points, self._others)
        reflected, lamps, behind = self._of(seen, len(points))
        directions, light = self._arriving(points, number, self._others)
        others = np.einsum("dj,ndc->njc", self._harmonics, lamps) + self._sum(directions, light)
        direct, shares = np.zeros(others.shape), np.zeros((len(points), len(self.groups)))
        for share, group, emitters in zip(shares.T, self.groups, self._lamps, strict=True):
            whole = group.lamps.coefficients(points, self._order, np.ones((len(points), 1)))
            share[:], directions, light = emitters.partly(points, number)
            strength = whole[:, 0].sum(axis=1) * np.sqrt(4 * np.pi)
            others += strength[:, None, None] * self._sum(directions, light)
            direct += np.maximum(share, 0)[:, None, None] * whole
        faces, distance = self._met(points, seen)
        walls = self._texels.walls(
            np.clip(distance, _TOUCHING * longest, 2 * longest),
            self._brightness.room.normals[faces],
            longest,
        )
        reflected = np.einsum("dj,ndc->njc", self._harmonics, reflected)
        direct += others
        return Looked(
            reflected.astype(np.float32),
            direct.astype(np.float32),
            others.astype(np.float32),
            shares.astype(np.float32),
            walls.astype(np.float32),
            behind.mean(axis=1),
        )

    def _sum(self, directions: Array, light: Array) -> Array:
        """Return the coefficients of light from directions, each of shape (n, s, 3)."""
        harmonics = real_harmonics(self._order, directions)
        return np.asarray(np.einsum("nsj,nsc->njc", harmonics, light, optimize=True))

    def irradiance(
        self, points: Array, normals: Array, number: int = 0
    ) -> tuple[Array, Array, Array]:
        """Return the irradiance of surfaces at points: reflected, direct, and back faces' share."""
        reflected, lamps, behind = self._of(self._look(points), len(points))
        facing = np.maximum(normals @ self._directions.T, 0) * self._area
        directions, light = self._arriving(points, number)
        others = cosines(directions, normals)
        direct = np.einsum("nd,ndc->nc", facing, lamps) + np.einsum("ns,nsc->nc", others, light)
        return np.einsum("nd,ndc->nc", facing, reflected), direct, behind.mean(axis=1)

    def _arriving(
        self, points: Array, number: int, emitters: Emitters | None = None
    ) -> tuple[Array, Array]:
        """Return the light of lamps that is looked for, as `Emitters.arriving` does."""
        return (emitters or self._emitters).arriving(
            points, number, lambda directions: np.full(directions.shape[:-1], 1 / self._area)
        )

    def _met(self, points: Array, seen: Seen) -> tuple[NDArray[np.int64], Array]:
        """Return triangles and distances along the texels' middles and then all directions."""
        middles, count = self._texels.middles, len(points)
        starts, ways = np.repeat(points, len(middles), axis=0), np.tile(middles, (count, 1))
        faces, _, distance = self._brightness.rays.first_hits(starts, ways)
        return (
            np.hstack([faces.reshape(count, -1), seen.faces.reshape(count, -1)]),
            np.hstack([distance.reshape(count, -1), seen.distance.reshape(count, -1)]),
        )

    def _look(self, points: Array, emitters: Emitters | None = None) -> Seen:
        """Return what is seen from points along all directions, one point after the other."""
        starts = np.repeat(points, len(self._directions), axis=0)
        ways = np.tile(self._directions, (len(points), 1))
        return self._brightness.look(starts, ways, emitters or self._emitters, 1 / self._area)

    def _of(self, seen: Seen, points: int) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Return radiance of surfaces and sky and of lamps, and which faces are back, by points."""
        light = self._brightness.radiance[seen.patches] + seen.sky
        return (
            light.reshape(points, -1, 3),
            seen.lamps.reshape(points, -1, 3),
            seen.is_behind.reshape(points, -1),
        )


class _Texels:
    """What is known of walls about the directions of an octahedral map."""

    def __init__(self, directions: Array) -> None:
        """Take the rays' `directions`, unit vectors of shape (d, 3)."""
        self.middles, self._rays = octahedral_directions(), directions
        cosines = self.middles @ directions.T
        # Each texel has its share of the rays. Those of the lobe of Majercik et al., which are
        # many times as many, told no more of what is hidden in a room of tilted boxes.
        share = max(4, len(directions) // len(self.middles))
        self._of_texel = np.argsort(-cosines, axis=1)[:, :share]

    def walls(self, distance: Array, normals: Array, longest: float) -> Array:
        """Return planes and how far rays miss them, shape (n, t, 4); see `ProbeGrid.walls`.

        `distance`, of shape (n, t + d), is to what n points meet along the texels' middles and the
        rays, whose `normals` have the shape (n, t + d, 3). What is farther than `longest` counts as
        that far.
        """
        count = len(self.middles)
        facing = np.einsum("ndv,dv->nd", normals, np.concatenate([self.middles, self._rays]))
        facing = np.where(facing == 0, np.finfo(float).tiny, facing)
        all_planes = normals / (facing * distance)[..., None]
        far = (distance[:, :count] >= longest)[..., None]
        found = np.zeros((len(distance), count, 4))
        found[..., :3] = np.where(far, self.middles / longest, all_planes[:, :count])
        for texel, (rays, middle) in enumerate(zip(self._of_texel, self.middles, strict=True)):
            own = found[:, texel, :3]
            # Along a texel's middle rays have planes of their own. Those in front of the texel's
            # do not count: where walls meet in a corner the plane that is nearest is right.
            planes = np.maximum(all_planes[:, count + rays] @ middle, 1 / longest)
            less = np.maximum(own @ middle - planes.T, 0).T
            ends = own @ self._rays[rays].T > 1 / distance[:, count + rays]
            found[:, texel, 3] = (less**2 * ends).mean(axis=1)
        return found
