"""The kinds of maps: reflected light, and what reflects nothing by itself, light or a material."""

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, ClassVar, NoReturn, Self

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Brdf, Color
from shrm_cli.errors import ArgumentError, MapError
from shrm_cli.maps.base import Map, ReflectedLight
from shrm_cli.maps.info import MapInfo
from shrm_cli.maps.registry import DESCRIPTIONS, unconverted
from shrm_cli.messages import refuse_arguments
from shrm_cli.records import record
from shrm_cli.sphere.directions import as_directions, central_directions, horizontal_tangents
from shrm_cli.vocabulary import (
    DEFAULT_ROUGHNESS,
    EVEN_LOOK_UPS,
    TAP_COUNTS,
    Center,
    Frame,
    Sampling,
)

if TYPE_CHECKING:
    from shrm_cli.maps.product.product import ProductMap
    from shrm_cli.maps.product.window import LightWindow
    from shrm_cli.probe.lighting import Projection


class ReflectionMap(ReflectedLight, Map):
    """A map of the light that surfaces of one BRDF reflect; see `Map` for its attributes."""

    def shaded(self, *surface: object, **named: object) -> Self:
        """Return the map itself, which is of a surface already."""
        return self


class BrushedLight(ReflectedLight):
    """Light that surfaces reflect whose tangents matter; by default these run around +Y."""

    def radiance(self, normals: ArrayLike, views: ArrayLike) -> Array:
        normals, views = as_directions(normals=normals, views=views)
        return self.brushed_radiance(normals, horizontal_tangents(normals), views)


class CentralMap(ReflectionMap):
    """A map that is looked up by central directions; hair has them of its tangents."""

    center: Center

    @abstractmethod
    def central_radiance(self, centers: ArrayLike, views: ArrayLike) -> Array:
        """Evaluate the radiance for central directions instead of normals; else as `radiance`."""

    def radiance(self, normals: ArrayLike, views: ArrayLike) -> Array:
        given = as_directions(normals=normals, views=views)
        return self.central_radiance(central_directions(self.center, *given), given[1])

    def brushed_radiance(self, normals: ArrayLike, tangents: ArrayLike, views: ArrayLike) -> Array:
        given = as_directions(normals=normals, views=views, tangents=tangents)
        return self.central_radiance(central_directions(self.center, *given), given[1])


class FixedMap(Map):
    """A map whose file can only be made anew, from the light or from the BRDF.

    It has no cubes, unless its class says otherwise.
    """

    format_version = 3
    frame: ClassVar[Frame] = "global"

    @property
    def cube_count(self) -> int:
        return 0

    def planes(self) -> Sequence[Array]:
        return ()

    def with_planes(self, planes: Sequence[Array], sampling: Sampling, info: MapInfo) -> Self:
        """Return the same map with other cubes, if it has any, and another `info`."""
        return self.with_info(info)

    def converted(
        self, to: str, size: int | None = None, sampling: Sampling | None = None, **options: Any
    ) -> Map:
        """Return the map itself, `resampled` where that is asked, or what a package makes of it.

        No form of `shrm` itself is made of such a map; a form of an installed package may be.
        """
        if to == self.representation and all(value is None for value in options.values()):
            return self.resampled(size, sampling)  # without what makes such maps, and takes long
        if to in DESCRIPTIONS:
            unconverted(self, to)
        return super().converted(to, size, sampling, **options)

    def resampled(self, size: int | None = None, sampling: Sampling | None = None) -> Map:
        """Return the map itself: what it holds cannot be filtered to another size."""
        refuse_arguments(self.what, size=size, sampling=sampling)
        return self

    def summary(self) -> dict[str, Any]:
        return {"representation": self.representation, "frame": self.frame, "center": self.center}


def check_tap_count(taps: int, is_brushed: bool) -> None:
    """Raise an `ArgumentError`, if no lobe has so many taps."""
    known = TAP_COUNTS if is_brushed else EVEN_LOOK_UPS
    if taps not in known:
        given = "with" if is_brushed else "without"
        counts = f"{', '.join(map(str, known[:-1]))} or {known[-1]}"
        raise ArgumentError("taps", f"is {taps!r}; {given} anisotropy give {counts}")


class LightMap(FixedMap):
    """Light that is prefiltered without a BRDF, for GGX surfaces of any roughness and reflectance.

    Game engines use light so.
    """

    is_rearrangeable = False
    surface_arguments: tuple[str, ...] = ("roughness", "f0")

    def shaded(
        self,
        roughness: float = DEFAULT_ROUGHNESS,
        f0: float | Sequence[float] = 1.0,
        anisotropy: float = 0.0,
        taps: int | None = None,
    ) -> "Shaded":
        self.check_brush(anisotropy)
        self.check_taps(taps, anisotropy)
        return self.surface(roughness, _reflectance(f0), anisotropy, taps)

    @abstractmethod
    def surface(self, roughness: float, f0: Color, anisotropy: float, taps: int | None) -> "Shaded":
        """Return a GGX surface under the light, on which it can be shown; see `shaded`."""

    def with_class(self, brdf: Brdf | None) -> Self:
        """Return the map as it is shown where a class of the user's is at hand.

        Files record the names of such classes, and the values of their parameters, alone.

        Raises MapError, if the map is of a BRDF that cannot be evaluated.
        """
        return self

    def check_brush(self, anisotropy: float) -> None:
        """Raise a `MapError`, if the light cannot be shown on a brushed surface."""
        if anisotropy and "anisotropy" not in self.surface_arguments:
            raise MapError(f"anisotropy is of split sums of GGX, not of {self.what}")

    def check_taps(self, taps: int | None, anisotropy: float) -> None:
        """Raise an error, if the light is not looked up so often for a surface."""
        if taps is None:
            return
        if "anisotropy" not in self.surface_arguments:
            raise MapError(f"taps are of split sums of GGX, not of {self.what}")
        check_tap_count(taps, bool(anisotropy))


def _reflectance(f0: float | Sequence[float]) -> Color:
    """Return the channels of a reflectance, which is grey where it is one number."""
    try:
        channels = np.asarray(f0, dtype=float)
        red, green, blue = np.broadcast_to(channels, (3,)).tolist()
    except (TypeError, ValueError):
        raise MapError(f"f0 must be one number or three, not {f0!r}") from None
    return red, green, blue


class MaterialMap(FixedMap):
    """A BRDF that is made ready for light, which is chosen when the map is used."""

    @abstractmethod
    def lit(self, lighting: ArrayLike) -> ReflectionMap:
        """Return the material under light of some coefficients.

        Parameters
        ----------
        lighting : Lighting, or array_like of shape ((order+1)^2, 3)
            The light over the real harmonics of world axes, index l(l+1)+m.

        Raises
        ------
        MapError
            If the material needs more coefficients.
        """

    @abstractmethod
    def window(self, spec: str, lighting: ArrayLike) -> "LightWindow":
        """Choose how the light is blurred before the material gets it.

        Parameters
        ----------
        spec : str
            As `shrm prefilter --window` takes it; ``auto`` leaves no black spots.
        lighting : Lighting, or array_like of shape ((order+1)^2, 3)
            As `lit` takes it.
        """

    @abstractmethod
    def error_under(self, light: "Projection", values: Mapping[str, float]) -> float:
        """Predict the relative RMS error of the light reflected that the material does not hold.

        `values` are those of parameters that vary; others are in the middle.
        """

    def shaded(self, *surface: object, **named: object) -> NoReturn:
        """Raise a `MapError`, since nothing is reflected without light."""
        raise MapError(f"{self.what} holds no light; give `probe`")


@record(eq=False)
class HarmonicLight:
    """Light as harmonics, and a surface that they are multiplied with where it is shaded."""

    coefficients: Array
    """The light over world axes, index l(l+1)+m, shape ((order+1)^2, 3)."""
    product: "ProductMap | None" = None
    """The surface; None of one that is white and diffuse."""


@record
class Shaded(ReflectedLight):
    """A GGX surface under the light of a map."""

    light: LightMap
    roughness: float
    """Perceptual roughness, in 0 .. 1."""
    f0: Color
    """Reflectance at normal incidence, linear RGB, in 0 .. 1."""

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
