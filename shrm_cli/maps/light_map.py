"""What the maps of light alone have in common: no BRDF is named when they are made."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, ClassVar, Self

from numpy.typing import ArrayLike

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Color
from shrm_cli.errors import MapError
from shrm_cli.maps.base import Map, no_way, refuse_arguments
from shrm_cli.maps.info import MapInfo
from shrm_cli.records import record
from shrm_cli.vocabulary import DEFAULT_ROUGHNESS, Center, Frame, Sampling


class FixedMap(Map):
    """A map whose file can only be made anew, from the light or from the BRDF.

    It has no cubes, unless its class says otherwise.
    """

    @property
    def cube_count(self) -> int:
        """The number of cubes that the map stores."""
        return 0

    def planes(self) -> Sequence[Array]:
        """Return the cubes of the map; see `Map.planes`."""
        return ()

    def with_planes(self, planes: Sequence[Array], sampling: Sampling, info: MapInfo) -> Self:
        """Return the same map with other cubes, if it has any, and another `info`."""
        return replace(self, info=info)  # type: ignore[type-var]

    def converted(self, to: str, *given: Any, **options: Any) -> Map:
        """Return the map itself, `resampled` where that is asked; it has no other representation.

        Raises
        ------
        ArgumentError
            If another representation is asked for, or an argument does not apply.
        """
        if to != self.representation:
            raise no_way(self, to)
        return super().converted(to, *given, **options)

    def resampled(self, size: int | None = None, sampling: Sampling | None = None) -> Map:
        """Return the map itself, because what it holds cannot be filtered.

        Raises
        ------
        ArgumentError
            If a size or a sampling is asked for.
        """
        refuse_arguments(self.what, size=size, sampling=sampling)
        return self


class LightMap(FixedMap):
    """Light that is prefiltered without naming a BRDF, as game engines use it."""

    format_version = 3
    frame: ClassVar[Frame] = "global"
    center: Center

    def summary(self) -> dict[str, Any]:
        """Return what users and scripts are told about every map of light alone."""
        return {
            "representation": self.representation,
            "frame": self.frame,
            "center": self.center,
        }


class SurfaceLightMap(LightMap):
    """A map of light alone that reflects as a GGX surface of any roughness and reflectance."""

    needs_surface = True
    is_rearrangeable = False

    def radiance(self, normals: ArrayLike, views: ArrayLike) -> Array:
        """Evaluate the radiance that GGX of roughness 0.5 and normal reflectance 1 reflects.

        Parameters and result are those of `Map.radiance`.
        """
        shown: Array = self.shaded(DEFAULT_ROUGHNESS, (1.0, 1.0, 1.0)).radiance(normals, views)
        return shown


@record
class Shaded:
    """A GGX surface under the light of a map. Subclasses have the method `radiance` of a map.

    Attributes
    ----------
    light : LightMap
    roughness : float
        Perceptual roughness, in 0 .. 1.
    f0 : tuple of 3 float
        Reflectance at normal incidence, linear RGB, in 0 .. 1.

    Raises
    ------
    MapError
        If a value is out of range.
    """

    light: LightMap
    roughness: float
    f0: Color

    def __post_init__(self) -> None:
        if not 0 <= self.roughness <= 1:
            raise MapError(f"roughness {self.roughness:g} is outside 0 .. 1")
        if not all(0 <= channel <= 1 for channel in self.f0):
            raise MapError(f"f0 {'/'.join(f'{x:g}' for x in self.f0)} is outside 0 .. 1")

    def brushed_radiance(self, normals: ArrayLike, tangents: ArrayLike, views: ArrayLike) -> Array:
        """Return what `radiance` does, since the surface is not brushed."""
        return self.radiance(normals, views)  # type: ignore[attr-defined]

    @property
    def info(self) -> MapInfo:
        """The record of how the light's map was made, with the surface as its BRDF."""
        parameters = {"roughness": self.roughness, "f0": list(self.f0)}
        return replace(self.light.info, brdf={"name": "ggx", "parameters": parameters})
