"""Maps that hold light filtered for every roughness, and the surface that they are shown as."""

from collections.abc import Mapping
from typing import Protocol, cast, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.brdf.base import Color
from shrm_cli.brdf.models.ggx import Ggx
from shrm_cli.maps.info import MapInfo
from shrm_cli.maps.light_map import EngineMap

Array = NDArray[np.floating]

_ROUNDING = 1e-6
"""Of a range that a file holds as 32-bit floats."""


class KnownMap(Protocol):
    """A map that reflects light, and remembers how it was made."""

    @property
    def info(self) -> MapInfo:
        """Its light and its BRDF."""

    def radiance(self, normals: ArrayLike, views: ArrayLike) -> Array:
        """Reflected radiance, shape (..., 3), for unit world vectors of shape (..., 3)."""


@runtime_checkable
class ShadedMap(Protocol):
    """A map that reflects once it is told the roughness and the reflectance of a GGX surface."""

    def shaded(self, roughness: float, f0: Color) -> KnownMap:
        """What reflects: the same light on that surface."""


def ggx_surface(roughness: float | None = None, f0: Color | None = None) -> Ggx:
    """The surface that maps are shown as: GGX, with its own defaults.

    Parameters
    ----------
    roughness : float, optional
        Perceptual: GGX's alpha is its square.
    f0 : tuple of 3 float, optional
        Reflectance at normal incidence, linear RGB.

    Raises
    ------
    BrdfError
        If one is out of its range.
    """
    given = {"roughness": roughness, "f0": f0}
    return Ggx(**{key: value for key, value in given.items() if value is not None})


def needs_surface(reflection_map: object) -> bool:
    """Whether a map reflects only as a surface that it is told."""
    return isinstance(reflection_map, ShadedMap)


def shade(reflection_map: KnownMap | ShadedMap | EngineMap, surface: Ggx) -> KnownMap:
    """What reflects: a map on that surface if it needs one, else the map as it is."""
    if isinstance(reflection_map, ShadedMap):
        return reflection_map.shaded(surface.number("roughness"), surface.color("f0"))
    return cast(KnownMap, reflection_map)


def outside_range(maps: Mapping[str, object], roughness: float) -> list[str]:
    """Lines about the maps that were not made for a roughness.

    Parameters
    ----------
    maps : mapping
        Of each file.
    roughness : float
        Perceptual.
    """
    lines = []
    for path, each in maps.items():
        low, high = each.roughness_range if isinstance(each, EngineMap) else (0.0, 1.0)
        if not low - _ROUNDING <= roughness <= high + _ROUNDING:
            made = f"{low:.4g}" if low == high else f"{low:.4g} .. {high:.4g}"
            lines.append(f"{path}: it was made for roughness {made}, not {roughness:g}")
    return lines
