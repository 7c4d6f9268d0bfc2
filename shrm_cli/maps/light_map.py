"""What the maps of light alone have in common: no BRDF is named when they are made."""

from dataclasses import replace
from typing import Any, ClassVar

from numpy.typing import ArrayLike

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Color
from shrm_cli.errors import MapError
from shrm_cli.maps.fixed_map import FixedMap
from shrm_cli.maps.info import MapInfo
from shrm_cli.records import record
from shrm_cli.vocabulary import DEFAULT_ROUGHNESS, Center, Frame


class LightMap(FixedMap):
    """Light that is prefiltered without naming a BRDF, as game engines use it."""

    format_version = 3
    frame: ClassVar[Frame] = "global"
    center: ClassVar[Center]

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

    @property
    def info(self) -> MapInfo:
        """The record of how the light's map was made, with the surface as its BRDF."""
        parameters = {"roughness": self.roughness, "f0": list(self.f0)}
        return replace(self.light.info, brdf={"name": "ggx", "parameters": parameters})
