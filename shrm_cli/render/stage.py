"""What stands before the camera: meshes in one, and what each triangle is made of."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Color
from shrm_cli.errors import MapError
from shrm_cli.geometry.mesh import Mesh, joined
from shrm_cli.geometry.paint import Paint, Painted
from shrm_cli.geometry.tangents import UvTangents, brushed_tangents
from shrm_cli.maps.base import Map, ReflectedLight
from shrm_cli.maps.kinds import LightMap
from shrm_cli.records import record
from shrm_cli.render.boxed import Vectors, outside, reflected, seen_from
from shrm_cli.render.lit import ggx_surface, outside_range, shown_as
from shrm_cli.render.variation import Variation, VariedSurface
from shrm_cli.sphere.directions import horizontal_tangents

_FOR_OTHERS = "textures of roughness and metallic, which split sums and SH exponentials show"
_DIELECTRIC = 0.04
"""Reflectance at normal incidence of glTF's materials that are no metals."""


@record
class Look:
    """How a surface reflects: a map, and the parameters that maps of light alone need."""

    map: Map | None = None
    """None for the map that the picture is drawn of."""
    roughness: float | None = None
    """Perceptual roughness of the GGX surface that maps of light alone are shown as."""
    f0: Color | None = None
    """Its reflectance at normal incidence, linear RGB."""
    irradiance: Map | None = None
    """What a white diffuse surface reflects: the light of the diffuse part, which is added to that
    of maps of light alone."""
    variation: Variation | None = None
    """What parameters of the BRDF follow, where the map lets them vary."""
    anisotropy: float | None = None
    """The anisotropy, as glTF has it, of the GGX surface that split sums are shown as."""
    taps: int | None = None
    """How many directions the light of that surface is looked up in, as `Map.shaded` has it."""
    paint: Paint | None = None
    """What the surface is made of from point to point. It replaces the roughness, and the f0 that
    is not given."""

    def of(self, given: Map | None) -> "Reflector":
        """Return the surface under the light of its map, or of the given map where it has none.

        Raises
        ------
        MapError
            If there is no map, or a value is out of range.
        """
        chosen = self.map or given
        if chosen is None:
            raise MapError("an object of the scene has no map; name one")
        if not isinstance(chosen, LightMap):
            return Reflector(chosen, chosen.shaded(), variation=self.variation, paint=self.paint)
        chosen.check_brush(self.anisotropy or 0.0)
        if self.paint is not None:
            varied = VariedSurface(chosen, self.anisotropy, self.taps)
            more = self.irradiance, None, self.paint, varied, self.f0
            return Reflector(chosen, chosen.shaded(), *more)
        shown = shown_as(chosen, ggx_surface(self.roughness, self.f0, self.anisotropy), self.taps)
        return Reflector(chosen, shown)

    def warnings(self, name: str, given: Map | None) -> list[str]:
        """Return a warning if the map was not made for the roughness."""
        chosen = self.map or given
        if not isinstance(chosen, LightMap):
            return []
        if self.paint is None:
            found = {ggx_surface(self.roughness, self.f0).number("roughness")}
        else:
            found = set(self.paint.roughness_range)
        return [line for each in sorted(found) for line in outside_range({name: chosen}, each)]


@record
class Reflector:
    """A map as one surface shows it."""

    map: Map
    shown: ReflectedLight
    irradiance: Map | None = None
    variation: Variation | None = None
    paint: Paint | None = None
    varied: VariedSurface | None = None
    f0: Color | None = None
    is_boxed: bool = True
    other: "Reflector | None" = None
    """The same surface under the light that this one becomes, if it does."""
    share: float = 0.0
    """How much of the light is that of the other one."""

    def radiance(
        self,
        normals: Array,
        views: Array,
        tangents: Array | None = None,
        shares: Array | None = None,
        painted: Painted | None = None,
        points: Array | None = None,
    ) -> Array:
        """Return the radiance of a surface, shape (n, 3).

        `normals`, `views` and `tangents`, each of shape (n, 3), are unit vectors in world axes;
        tangents run around +Y by default. `shares`, of shape (n,) or (n, parameters), are the
        values of the `variation`. `painted` is what the `paint` is there. `points`, of shape (n,
        3), are where they are, in world axes, for maps that know of a box; see `render.boxed`.
        """
        if tangents is None and shares is not None:
            tangents = horizontal_tangents(normals)
        own = self._own((normals, views, tangents), shares, painted, points)
        if self.other is None:
            return own
        other = self.other.radiance(normals, views, tangents, shares, painted, points)
        return (1 - self.share) * own + self.share * other

    def _own(
        self, vectors: Vectors, shares: Array | None, painted: Painted | None, points: Array | None
    ) -> Array:
        where = points if self.is_boxed else None
        if painted is None:
            return reflected(self.map, self.shown, vectors, where, shares)
        found: Array
        if self.varied is None:
            found = reflected(self.map, self.shown, vectors, where, shares)
            found = found * painted.base_color
        else:
            found = self._metallic(vectors, painted, where)
        return found * painted.occlusion[:, None] + painted.emission

    def with_values(self, values: Mapping[str, float]) -> "Reflector":
        """Return the surface where parameters have values, if they do not follow anything else."""
        shown = self.shown if self.variation else self.shown.with_values(values)
        if not isinstance(shown, Map):
            return self
        return replace(self, map=shown, shown=shown)

    def _metallic(self, vectors: Vectors, painted: Painted, points: Array | None) -> Array:
        """Return what glTF's metallic-roughness model reflects.

        The reflectance at normal incidence is ``lerp(0.04, base colour, metallic)``. What is left
        of the base colour, times 1 - metallic, is diffuse.
        """
        assert self.varied is not None
        metal = painted.metallic[:, None]
        f0: Array = _DIELECTRIC * (1 - metal) + painted.base_color * metal
        if self.f0 is not None:
            f0 = np.broadcast_to(np.array(self.f0), f0.shape)
        lit = seen_from(self.map, self.map.center, vectors, points)
        found = self.varied.radiance(*lit, painted.roughness, f0)
        albedo = painted.base_color * (1 - metal)
        if self.irradiance is None or not albedo.any():
            return found
        white: Any = self.irradiance
        return found + reflected(white, white, vectors, points) * albedo


@record
class Actor:
    """A mesh in its place, and how it looks."""

    mesh: Mesh
    """The mesh, in world axes."""
    looks: Sequence[Look]
    """The look of triangles without a material, and then of each of the mesh's materials."""
    brush: "str | tuple[float, float, float] | None" = None
    """What the tangents follow: texture coordinates, or a direction in world axes. By default they
    run around +Y. It is "uv" or a direction."""


@record(eq=False)
class Stage:
    """All meshes of a picture as one."""

    mesh: Mesh
    looks: tuple[Look, ...]
    face_looks: NDArray[np.int64]
    """Which look each triangle has, shape (m,)."""
    tangents: Array | None = field(default=None, repr=False)
    """The tangents of the vertices; None where nothing is brushed, shape (n, 3)."""

    @classmethod
    def of(cls, actors: Iterable[Actor]) -> "Stage":
        """Put meshes on a stage."""
        actors = list(actors)
        looks: list[Look] = []
        owners = []
        for actor in actors:
            owners.append(actor.mesh.face_materials + 1 + len(looks))
            looks += actor.looks
        brushed = any(actor.brush is not None for actor in actors)
        return cls(
            joined(actors[0].mesh.name, [actor.mesh for actor in actors]),
            tuple(looks),
            np.concatenate(owners),
            np.concatenate([brushed_tangents(one.mesh, one.brush) for one in actors])
            if brushed
            else None,
        )

    @property
    def needs_map(self) -> bool:
        """Whether a triangle is drawn by the map that the picture is of."""
        return any(self.looks[k].map is None for k in self._used())

    def reflectors(self, given: Map | None) -> list[Reflector | None]:
        """Return the surfaces of all looks under the light of a map; None for unused ones."""
        used = self._used()
        return [look.of(given) if k in used else None for k, look in enumerate(self.looks)]

    def warnings(self, name: str, given: Map | None) -> list[str]:
        """Return a warning for each roughness that a map was not made for."""
        found = [line for k in sorted(self._used()) for line in self.looks[k].warnings(name, given)]
        return list(dict.fromkeys(found))

    def maps(self) -> list[Map]:
        """Return the maps that the looks name."""
        return [look.map for look in self.looks if look.map is not None]

    def irradiances(self) -> list[Map]:
        """Return the light of the diffuse parts of materials that are drawn, if any."""
        return [look.irradiance for look in self.looks if look.paint and look.irradiance]

    def under_irradiance(self, irradiance: Map) -> "Stage":
        """Return the stage with another light of diffuse parts, where there is some."""
        looks = [
            look if look.irradiance is None else replace(look, irradiance=irradiance)
            for look in self.looks
        ]
        return replace(self, looks=tuple(looks))

    def lacks_diffuse(self, maps: Sequence[Map]) -> bool:
        """Whether a material has a diffuse part, and no light for it, under one of some maps."""
        for look in (self.looks[k] for k in self._used()):
            lit = [look.map] if look.map else maps
            if look.paint is None or look.irradiance or not look.paint.has_diffuse:
                continue
            if any(isinstance(each, LightMap) for each in lit):
                return True
        return False

    def unread(self, maps: Sequence[Map]) -> list[str]:
        """Return what files say of their materials that is not drawn, with the materials."""
        named = []
        for look in (self.looks[k] for k in sorted(self._used())):
            if look.paint is None:
                continue
            unread = look.paint.unread
            lit = [look.map] if look.map else maps
            if look.paint.is_rough_by_texture and not all(
                isinstance(each, LightMap) for each in lit
            ):
                unread = [*unread, _FOR_OTHERS]
            if unread:
                named.append(f"{look.paint.material.name!r} ({', '.join(unread)})")
        return list(dict.fromkeys(named))

    @cached_property
    def uv_tangents(self) -> tuple[UvTangents | None, UvTangents | None]:
        """The tangents of normal maps over the two sets of texture coordinates."""
        sets = {look.paint.normal_set for look in self.looks if look.paint is not None}
        first, second = (UvTangents(self.mesh, k) if k in sets else None for k in (0, 1))
        return first, second

    def outside_boxes(self, maps: Sequence[Map], names: Sequence[str]) -> list[str]:
        """Return the warnings of `outside` about the maps, and those that looks name."""
        warnings = []
        for made, name, named in self._lights(maps, names):
            lit = [k for k, look in enumerate(self.looks) if look.map is named]
            corners = np.unique(self.mesh.faces[np.isin(self.face_looks, lit)])
            if corners.size:
                warnings += outside([made], [name], self.mesh.vertices[corners])
        return warnings

    def boxes_left_out(self, maps: Sequence[Map], names: Sequence[str]) -> list[str]:
        """Return a warning about each map whose light turns, which its room does not."""
        return [
            f"{name}: its proxy box is left out, because its room does not turn with the light; "
            "--no-box draws light at rest so"
            for made, name, _ in self._lights(maps, names)
            if made.info.proxy is not None
        ]

    def _lights(
        self, maps: Sequence[Map], names: Sequence[str]
    ) -> list[tuple[Map, str, Map | None]]:
        """Return maps and those that looks name, with what they are called, and these again."""
        own = {id(each): each for each in self.maps()}.values()
        return [
            *((each, name, None) for each, name in zip(maps, names, strict=True)),
            *((each, f"{each.what} of {each.info.probe}", each) for each in own),
        ]

    def _used(self) -> set[int]:
        return {int(k) for k in np.unique(self.face_looks)}


def transformation(
    translate: ArrayLike = (0, 0, 0), rotate: ArrayLike = (0, 0, 0), scale: ArrayLike = 1.0
) -> Array:
    """Return the matrix that scales, rotates about x, y and z, and translates, shape (4, 4).

    `translate` is of shape (3,). `rotate`, of shape (3,), holds degrees, counterclockwise as seen
    from the end of the axis. `scale` is of shape () or (3,).
    """
    matrix = np.eye(4)
    matrix[:3, :3] = np.diag(np.broadcast_to(np.asarray(scale, dtype=float), (3,)))
    for axis, degrees in enumerate(np.asarray(rotate, dtype=float)):
        cosine, sine = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
        turn = np.eye(3)
        i, j = (axis + 1) % 3, (axis + 2) % 3
        turn[[i, j], [i, j]] = cosine
        turn[i, j], turn[j, i] = -sine, sine
        matrix[:3, :3] = turn @ matrix[:3, :3]
    matrix[:3, 3] = translate
    return matrix
