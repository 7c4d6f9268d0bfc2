"""A room: triangles that reflect diffusely, lamps among them, and what is seen through openings."""

from collections.abc import Mapping
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
from shrm_cli.geometry.textures import Shelf
from shrm_cli.probe.disc import Disc
from shrm_cli.probe.probe import Probe
from shrm_cli.records import record

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
    """The mean radiance that each triangle sends, shape (m, 3)."""
    sky: Probe | None = None
    """What is seen past the room, without its compact lamps; black by default."""
    discs: tuple[Disc, ...] = ()
    """The compact lamps that are seen past the room."""
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
        without a material, and of those materials that `untold` returns. `changes` has under
        ``albedo`` and ``emission`` other values for materials, by their names. All are of Rec.709,
        and become those of the primaries of `sky`.
        Light passes through materials that are clear. `sky` and `discs` are those of `Room`.
        """
        _check_changes(mesh, changes)
        mesh = _without_clear(mesh)
        matrix = from_rec709(None if sky is None else sky.chromaticities)
        silent = {each.name for each in untold(mesh)}
        materials = [
            _changed(replace(each, base_color=albedo) if each.name in silent else each, changes)
            for each in mesh.materials
        ]
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
            lost = next((each for each in mesh.materials if not each.is_known), None)
            why = "" if lost is None else f" (it has the material {lost.name!r}, {lost.unread[0]})"
            raise MeshError(
                f"{mesh.name}: nothing in it sends light{why}; give `emit` NAME=R,G,B for a "
                "material, or `probe` for what is seen through its openings"
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

    @cached_property
    def is_uneven(self) -> NDArray[np.bool_]:
        """Whether a texture has what a triangle sends, shape (m,)."""
        varying = [k for k, each in self.paints.items() if each.material.emission_map is not None]
        return np.isin(self.mesh.face_materials, varying)

    def _mean_emission(self) -> Array:
        """Return what triangles send in the mean, where textures have it."""
        emission = self.emission.copy()
        own = np.flatnonzero(self.is_uneven)
        weights = centers_of(np.arange(_EMISSION_CUTS**2), _EMISSION_CUTS)
        for part in slices(len(own), _PAINTED_AT_ONCE // len(weights)):
            faces = np.repeat(own[part], len(weights))
            places = np.tile(weights, (len(own[part]), 1))
            sent = self.emission_at(faces, places, self.mesh.sides(faces) / _EMISSION_CUTS)
            emission[own[part]] = sent.reshape(-1, len(weights), 3).mean(axis=1)
        return emission

    def fronts(self, faces: Integers) -> Array:
        """Return the corners of triangles, right-handed about their normals, shape (n, 3, 3)."""
        corners = self.mesh.corners(faces)
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        is_behind = np.einsum("fv,fv->f", across, self.normals[faces]) < 0
        return np.where(is_behind[:, None, None], corners[:, ::-1], corners)

    @cached_property
    def size(self) -> float:
        """The diagonal of the room's box."""
        return float(np.linalg.norm(np.ptp(self.mesh.vertices, axis=0)))

    def sky_radiance(self, directions: Array) -> Array:
        """Return what is seen past the room, shape (..., 3), without the compact lamps."""
        if self.sky is None:
            return np.zeros((*directions.shape[:-1], 3))
        return self.sky.radiance(directions)


def untold(mesh: Mesh) -> list[SurfaceMaterial]:
    """Return the materials of which nothing says what they reflect.

    They are those whose file is missing, or all where none has a colour but white, which programs
    write where nothing was chosen; walls that lose no light would be bright without end.
    """
    told = any(each.has_color for each in mesh.materials)
    return [each for each in mesh.materials if not (told and each.is_known)]


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


def centers_of(number: Integers, cuts: Integers | int) -> Array:
    """Return the middles of patches by their numbers in triangles, barycentric, shape (n, 3)."""
    row = np.floor(np.sqrt(number + 0.5)).astype(np.int64)
    place, inverted = np.divmod(number - row**2, 2)
    third = (1 + inverted) / 3
    second, last = (row - inverted - place + third) / cuts, (place + third) / cuts
    return np.stack([1 - second - last, second, last], axis=1)
