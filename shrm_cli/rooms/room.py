"""A room: triangles that reflect diffusely, lamps among them, and what is seen through openings.

Light reaches points straight from its lamps, and from those outside. A small lamp is found by
looking for points on it, and one that fills half of what is seen by looking everywhere. Both are
done, and each direction counts by how densely either would have taken it (Veach and Guibas 1995,
the balance heuristic).

The irradiance of a patch is ``E = D + pi <L>``: what lamps send straight to it, and the mean of the
radiance L that arrives along directions which are dense by the cosine to its normal. What each
direction meets is found once, as the number of a patch, and then light goes along it as often as is
needed: ``L = albedo / pi E`` of that patch. Such a mean over few directions is noisy, but it is a
mean over patches, and a probe gathers from hundreds of them.

References: Goral, Torrance, Greenberg and Battaile 1984, Modeling the Interaction of Light Between
Diffuse Surfaces. Keller 1997, Instant Radiosity, has the same integral by paths.
"""

from collections.abc import Callable, Mapping
from dataclasses import field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array, slices
from shrm_cli.brdf.base import Color
from shrm_cli.color import from_rec709
from shrm_cli.errors import MeshError
from shrm_cli.geometry.mesh import Integers, Mesh, SurfaceMaterial, face_normals
from shrm_cli.geometry.paint import Paint, points_of
from shrm_cli.geometry.rays import Rays
from shrm_cli.geometry.textures import Shelf
from shrm_cli.probe.disc import Disc, disc_directions
from shrm_cli.probe.probe import Probe
from shrm_cli.progress import Progress, tell
from shrm_cli.records import record
from shrm_cli.sphere.directions import horizontal_tangents, surface_frames
from shrm_cli.sphere.quadrature import spiral_directions
from shrm_cli.vocabulary import LUMINANCE

_EMISSION_CUTS = 8
"""Parts along the sides of a triangle whose mean is what it sends, where a texture has it."""
_PAINTED_AT_ONCE = 2**16
"""The most points whose textures are looked up at a time."""


@record(eq=False)
class Room:
    """Diffuse triangles, of which some send light, and the surroundings of all."""

    mesh: Mesh
    normals: Array
    """Unit normals of the triangles, on the side where their vertices' normals are, shape (m, 3).
    What is met from behind blocks light, and sends none."""
    albedo: Array
    """What each triangle reflects of its irradiance, shape (m, 3)."""
    emission: Array
    """The radiance that it sends, in the mean, shape (m, 3)."""
    sky: Probe | None = None
    """What is seen past the room, without its compact lamps; black by default."""
    discs: tuple[Disc, ...] = ()
    """These lamps."""
    paints: Mapping[int, Paint] = field(default_factory=dict)
    """Materials that vary over triangles, by textures or vertex colours, by their numbers."""

    @classmethod
    def of(
        cls,
        mesh: Mesh,
        albedo: Color,
        changes: Mapping[str, Mapping[str, Color]],
        sky: Probe | None = None,
        discs: tuple[Disc, ...] = (),
    ) -> "Room":
        """Return the room that a mesh is.

        The base colours of the materials of `mesh` are their albedos. `albedo` is that of triangles
        without a material. `changes` has under ``albedo`` and ``emission`` other values for
        materials, by their names. All are of Rec.709, and become those of the primaries of `sky`.
        Light passes through materials that are clear. `sky` and `discs` are those of `Room`.
        """
        _check_changes(mesh, changes)
        mesh = _without_clear(mesh)
        matrix = from_rec709(None if sky is None else sky.chromaticities)
        materials = [_changed(each, changes) for each in mesh.materials]
        # The last row is that of triangles without a material, whose index is -1.
        colors = np.array(
            [*((*each.base_color, *each.emission) for each in materials), (*albedo, 0, 0, 0)]
        )
        if matrix is not None:
            colors = np.concatenate([colors[:, :3] @ matrix.T, colors[:, 3:] @ matrix.T], axis=1)
        found = np.maximum(colors, 0)[mesh.face_materials]
        shelf = Shelf("give colours in their place by `albedo` and `emit`")
        used = {int(each) for each in np.unique(mesh.face_materials)}
        paints = {
            number: Paint(mesh, each, shelf, matrix)
            for number, each in enumerate(materials)
            if number in used and (each.textures or (each.colored and mesh.colors is not None))
        }
        normals = face_normals(mesh.vertices, mesh.faces)
        smooth = mesh.normals[mesh.faces].sum(axis=1)
        sides = np.where(np.einsum("fi,fi->f", normals, smooth) < 0, -1.0, 1.0)
        room = cls(mesh, sides[:, None] * normals, found[:, :3], found[:, 3:], sky, discs, paints)
        room = replace(room, emission=room._mean_emission())
        if sky is None and not room.emission.any():
            raise MeshError(
                f"{mesh.name}: nothing in it sends light; give `emit` NAME=R,G,B for a material, "
                "or `probe` for what is seen through its openings"
            )
        return room

    def albedo_at(self, faces: Integers, weights: Array, steps: Array | None = None) -> Array:
        """Return what points of triangles reflect, shape (n, 3).

        `faces` are of shape (n,), and `weights`, barycentric, of shape (n, 3). `steps`, of shape
        (n, 3, 2), are two sides of what each point stands for.
        """
        albedo = self.albedo[faces]
        for number, paint in self.paints.items():
            for some, points in points_of(self.mesh, number, faces, weights, steps):
                albedo[some] = paint.base_color(points)
        return albedo

    def emission_at(self, faces: Integers, weights: Array, steps: Array | None = None) -> Array:
        """Return what points of triangles send; all is as of `albedo_at`."""
        emission = self.emission[faces]
        for number, paint in self.paints.items():
            if paint.material.emission_map is not None:
                for some, points in points_of(self.mesh, number, faces, weights, steps):
                    emission[some] = paint.emission(points)
        return emission

    def _mean_emission(self) -> Array:
        """Return what triangles send in the mean, where textures have it."""
        emission = self.emission.copy()
        varying = [k for k, each in self.paints.items() if each.material.emission_map is not None]
        own = np.flatnonzero(np.isin(self.mesh.face_materials, varying))
        weights = _centers(np.arange(_EMISSION_CUTS**2), _EMISSION_CUTS)
        for part in slices(len(own), _PAINTED_AT_ONCE // len(weights)):
            faces = np.repeat(own[part], len(weights))
            places = np.tile(weights, (len(own[part]), 1))
            sent = self.emission_at(faces, places, self.mesh.sides(faces) / _EMISSION_CUTS)
            emission[own[part]] = sent.reshape(-1, len(weights), 3).mean(axis=1)
        return emission

    @cached_property
    def size(self) -> float:
        """The diagonal of the room's box."""
        return float(np.linalg.norm(np.ptp(self.mesh.vertices, axis=0)))

    def sky_radiance(self, directions: Array) -> Array:
        """Return what is seen past the room, shape (..., 3), without the compact lamps."""
        if self.sky is None:
            return np.zeros((*directions.shape[:-1], 3))
        return self.sky.radiance(directions)


def _check_changes(mesh: Mesh, changes: Mapping[str, Mapping[str, Color]]) -> None:
    names = [each.name for each in mesh.materials]
    if max((max(each) for each in changes.get("albedo", {}).values()), default=0) > 1:
        raise MeshError(f"{mesh.name}: `albedo` has a number above 1, which makes light")
    for given in changes.values():
        for name in given:
            if name not in names:
                known = ", ".join(sorted({each for each in names if each})[:8]) or "no names"
                raise MeshError(f"{mesh.name}: no material {name!r:.80}; it has {known}")


def _without_clear(mesh: Mesh) -> Mesh:
    """Return a mesh without the triangles of clear materials."""
    clear = np.array([*(each.is_clear for each in mesh.materials), False])
    kept = ~clear[mesh.face_materials]
    if not kept.any():
        raise MeshError(f"{mesh.name}: all of its materials are clear; give them an opacity")
    if kept.all():
        return mesh
    return replace(mesh, faces=mesh.faces[kept], face_materials=mesh.face_materials[kept])


def _changed(
    material: SurfaceMaterial, changes: Mapping[str, Mapping[str, Color]]
) -> SurfaceMaterial:
    """Return what counts of a material in a room, with other values in place of its textures."""
    found = material.matte
    albedo = changes.get("albedo", {}).get(material.name)
    if albedo is not None:
        found = replace(found, base_color=albedo, color_map=None, colored="")
    emission = changes.get("emission", {}).get(material.name)
    if emission is not None:
        found = replace(found, emission=emission, emission_map=None)
    return found


_OF_DISC = 8
"""Directions within each lamp outside."""
_STEPS = 0.7548776662466927, 0.5698402909980532
"""Steps of a sequence that fills squares evenly (Roberts 2018, "The Unreasonable Effectiveness of
Quasirandom Sequences"): powers of the plastic number's reciprocal."""
_SHORT = 1e-4
"""How much of the way to a lamp is left out at both ends, so as not to meet what is there."""


def cosines(directions: Array, normals: Array) -> Array:
    """Return the cosines of directions (n, s, 3) to normals (n, 3); 0 below the horizon."""
    return np.maximum(np.einsum("nsv,nv->ns", directions, normals), 0)


class Emitters:
    """Triangles that send light, and discs of light outside, as points of equal power.

    `rays` meet the same mesh. `samples` is the number of points on lamps that each point looks for.
    """

    def __init__(self, room: Room, rays: Rays, samples: int) -> None:
        self._room, self._rays, self._samples = room, rays, samples
        self._faces = np.flatnonzero(room.emission.any(axis=1))
        corners = room.mesh.corners(self._faces)
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        areas = np.linalg.norm(across, axis=1) / 2
        powers = areas * (room.emission[self._faces] @ LUMINANCE)
        # A dim lamp may be the only one that a point sees: half of the samples go by area alone.
        whole = max(powers.sum(), np.finfo(float).tiny), max(areas.sum(), np.finfo(float).tiny)
        self._shares = (powers / whole[0] + areas / whole[1]) / 2
        self._ends, self._areas, self._corners = np.cumsum(self._shares), areas, corners
        self._density = np.zeros(len(room.mesh.faces))
        self._density[self._faces] = samples * self._shares / np.maximum(areas, 1e-300)

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

    def _of_faces(
        self, points: Array, number: int, others: Callable[[Array], Array]
    ) -> tuple[Array, Array]:
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
        own = self.density(faces, distance, facing)
        strength = 1 / np.maximum(own + others(directions), 1e-300)
        lit = np.flatnonzero(facing > 0)
        starts = np.repeat(points, count, axis=0)[lit]
        flat, far = directions.reshape(-1, 3)[lit], distance.reshape(-1)[lit]
        met, _, first = self._rays.first_hits(starts, flat)
        hidden = (met != faces.reshape(-1)[lit]) & (first < far * (1 - _SHORT))
        seen = np.zeros(facing.size)
        seen[lit] = ~hidden
        sent = self._room.emission_at(faces.ravel(), weights.reshape(-1, 3)).reshape(ways.shape)
        light = (strength * seen.reshape(facing.shape))[..., None] * sent
        return directions, np.where(facing[..., None] > 0, light, 0)

    def _of_disc(self, points: Array, disc: Disc) -> tuple[Array, Array]:
        directions = disc_directions(disc, _OF_DISC)
        shape = len(points), _OF_DISC, 3
        every = np.broadcast_to(directions, shape)
        starts = np.repeat(points, _OF_DISC, axis=0)
        free = ~self._rays.occluded(starts, every.reshape(-1, 3)).reshape(shape[:2])
        light = disc.radiance * (disc.solid_angle / _OF_DISC)
        return every, free[..., None] * light


# ---- the room ------------------------------------------------------------------------------------


_DIRECTIONS = 96
"""Directions along which a patch gathers what others reflect."""
_SAMPLES = 32
"""Points on lamps that a patch looks for."""
_BOUNCES = 100
_LOST = 1e-4
"""Light of which no more than this part changes is no longer sent on."""
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
        self.weights = _centers(number, cuts)
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


def _centers(number: Integers, cuts: Integers | int) -> Array:
    """Return the middles of patches by their numbers in triangles, barycentric, shape (n, 3)."""
    row = np.floor(np.sqrt(number + 0.5)).astype(np.int64)
    place, inverted = np.divmod(number - row**2, 2)
    third = (1 + inverted) / 3
    second, last = (row - inverted - place + third) / cuts, (place + third) / cuts
    return np.stack([1 - second - last, second, last], axis=1)


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
    """To what is met; infinite to nothing, shape (n,)."""
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
            arriving = np.empty_like(lit)
            for part in slices(len(met), _AT_ONCE):
                for channel in range(3):  # numpy is slow along axes of three
                    arriving[part, channel] = sent[:, channel].take(met[part]).mean(axis=1)
            sent[:-1] = albedo * arriving
            total += sent
            if sent.sum() <= _LOST * total.sum():
                break
        return total

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
        lamps[hit] = share[:, None] * self.room.emission_at(faces[hit], barycentric[hit])
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
