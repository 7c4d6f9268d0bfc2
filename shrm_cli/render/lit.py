"""Maps as pictures show them: those of light alone with a surface, those of a BRDF with light."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property, partial
from itertools import product
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Brdf, Color
from shrm_cli.brdf.models.ggx import Ggx
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.color import conversion, same_primaries, title_of
from shrm_cli.errors import ArgumentError, MapError
from shrm_cli.maps.base import Map, ReflectedLight
from shrm_cli.maps.info import MapInfo
from shrm_cli.maps.kinds import LightMap, MaterialMap
from shrm_cli.maps.request import wrong_light
from shrm_cli.maps.wrong_pixels import Negative, negative_of
from shrm_cli.probe.lighting import Projection
from shrm_cli.probe.probe import Probe
from shrm_cli.records import record
from shrm_cli.rooms.grid import ProbeGrid
from shrm_cli.rooms.lit import in_grid
from shrm_cli.vocabulary import DEFAULT_ROUGHNESS

Measured = TypeVar("Measured")
_ROUNDING = 1e-6
"""How far a roughness may lie outside a map's range, which files hold as 32-bit floats."""


_BLURRED = 0.25
"""The predicted error from which whoever lights a product texture is told. Views that graze make
most of it, so that pictures show less: of Ward's lobe of .2 and .4 under a city, order 4 was 45 %
and measured 27 %, with 86 % of wrong pixels, and order 16 was 19 % and measured 2 %, with 9 %."""


def ggx_surface(
    roughness: float | None = None, f0: Color | None = None, anisotropy: float | None = None
) -> Ggx:
    """Return the GGX surface that maps are shown as.

    `roughness` is perceptual roughness: GGX's alpha is its square. The default is
    `DEFAULT_ROUGHNESS`, as everywhere where maps are shown, which is not that of `Ggx`.
    `f0` is the reflectance at normal incidence, linear RGB. The default is that of `Ggx`.
    `anisotropy` is that of glTF; without it the surface is not brushed.
    """
    shown = DEFAULT_ROUGHNESS if roughness is None else roughness
    given = {"roughness": shown, "f0": f0, "anisotropy": anisotropy or None}
    return Ggx(**{key: value for key, value in given.items() if value is not None})


def shown_as(made: Map, surface: Ggx, taps: int | None = None) -> ReflectedLight:
    """Return the light of a map as a GGX surface reflects it; see `Map.shaded`."""
    anisotropy = 0.0 if surface.isotropic else surface.number("anisotropy")
    numbers = surface.number("roughness"), surface.color("f0"), anisotropy
    return made.shaded(*numbers, taps)


def reflectance(
    value: str | float | Sequence[float], primaries: tuple[float, ...] | None = None
) -> Color:
    """Return the linear RGB, each channel within 0 .. 1, that a text such as ``gold`` means.

    One number is that of all channels, and three are those of each.

    `primaries` are the chromaticities of the light, which the colors of metals are converted to.
    """
    text = value if isinstance(value, str) else "/".join(map(str, np.ravel(value).tolist()))
    return parse_spec(f"ggx:f0={text}", primaries=primaries).color("f0")


def outside_range(maps: Mapping[str, Map], roughness: float) -> list[str]:
    """Return a warning for each map that was not made for a roughness."""
    lines = []
    for path, each in maps.items():
        low, high = each.roughness_range
        if not low - _ROUNDING <= roughness <= high + _ROUNDING:
            made = f"{low:.4g}" if low == high else f"{low:.4g} .. {high:.4g}"
            lines.append(f"{path}: it was made for roughness {made}, not {roughness:g}")
    return lines


def surface_of(
    roughness: float | None,
    f0: str | float | Sequence[float] | None,
    primaries: tuple[float, ...] | None,
    anisotropy: float | None = None,
) -> Ggx:
    """Return the surface that arguments ask for, under light of some primaries."""
    color = None if f0 is None else reflectance(f0, primaries)
    return ggx_surface(roughness, color, anisotropy)


def refuse_surface(maps: Sequence[Map], **given: object) -> None:
    """Raise an `ArgumentError` for what is given of a surface, not None, if no map needs one."""
    if not any(each.surface_arguments for each in maps):
        for name, value in given.items():
            if value is not None:
                raise ArgumentError(
                    name, "applies to split sums and SH exponentials; no map is one"
                )


def with_classes(maps: Sequence[Map], brdf: Brdf | None) -> list[Map]:
    """Return maps of which those of light alone know the BRDF that is at hand; see `LightMap`."""
    return [each.with_class(brdf) if isinstance(each, LightMap) else each for each in maps]


def shaded_maps(
    maps: Sequence[Map],
    names: Sequence[str],
    roughness: float | None,
    f0: str | float | Sequence[float] | None,
    anisotropy: float | None = None,
    taps: int | None = None,
) -> tuple[list[ReflectedLight], dict[str, Any], list[str]]:
    """Give a surface to the maps of light alone, such as split sums and SH exponentials.

    `roughness` is the perceptual roughness of the surface; `DEFAULT_ROUGHNESS` by default. `f0` is
    its reflectance at normal incidence, as `reflectance` takes it; that of `Ggx` by default. The
    colors of metals are converted to the primaries of each map. `anisotropy` and `taps` are those
    of `Map.shaded`.

    Returns `maps`, all maps, those of light alone with the surface; `surface`, roughness and
    reflectance of the first map's surface, for a result; without a reflectance where that is a BRDF
    with colors of its own, and empty if no map needs a surface; and `warnings`, one for each map
    that was not made for this roughness.
    """
    lights = [each for each in maps if isinstance(each, LightMap)]
    if not lights:
        return [each.shaded() for each in maps], {}, []
    surfaces = [surface_of(roughness, f0, each.info.chromaticities, anisotropy) for each in maps]
    rough = surfaces[0].number("roughness")
    surface: dict[str, Any] = {"roughness": rough, "f0": list(surfaces[0].color("f0"))}
    if anisotropy is not None:
        surface["anisotropy"] = anisotropy
    warnings = outside_range(dict(zip(names, maps, strict=True)), rough)
    if "f0" not in lights[0].surface_arguments:
        del surface["f0"]
    shown = [shown_as(each, own, taps) for each, own in zip(maps, surfaces, strict=True)]
    return shown, surface, warnings


def lit_maps(
    maps: Sequence[Map],
    names: Sequence[str],
    probe: Probe | ProbeGrid | None,
    window: str | None,
    ways: Mapping[str, tuple[float, float]] | None = None,
) -> tuple[list[Map], list[str]]:
    """Give light to the maps that hold a BRDF alone, which are product textures.

    `probe` is that light; under that of a grid of probes surfaces have another light wherever they
    are. `window` is the window of the light; ``auto`` by default. `ways` are the first and the last
    values of parameters that are shown with no others, and without which the middle is shown. By
    default any value may be.

    Returns `maps`; and `warnings`, for each map that reflects less than nothing somewhere, or too
    little of what is sharp in the light, with the values that are shown.
    """
    light = Projection(probe) if isinstance(probe, Probe) else None
    found: list[Map] = []
    warnings: list[str] = []
    for each, name in zip(maps, names, strict=True):
        if not isinstance(each, MaterialMap):
            found.append(each)
            continue
        if isinstance(probe, ProbeGrid):
            in_room, changed = in_grid(each, probe, window or "auto")
            found.append(in_room)
            if changed:
                warnings.append(
                    f"{name}: the light is windowed, which changes what is reflected by up to "
                    f"{changed:.1%} RMS; `window` none leaves it"
                )
            continue
        if light is None:
            raise MapError(f"{name}: a product texture that holds no light; give `probe`")
        order, shown = each.info.order_f, _shown_ends(each, ways)
        # Of the most degrees, so that light is projected once.
        error, at_error = _worst(shown, partial(each.error_under, light), float)
        series = light.to_order(order).coefficients[: (order + 1) ** 2]
        shape = each.window(window or "auto", series)
        lit = each.lit(shape.apply(series))
        if shape.factors:
            every = f" for all values of {' and '.join(each.ways)}" if each.ways else ""
            warnings.append(
                f"{name}: the light is windowed ({shape.name}){every}, which changes what is "
                f"reflected by "
                f"{shape.change:.1%} RMS, p95 {shape.p95_change:.0%}; without it (`window` none) "
                f"{shape.spots:.1%} would lack a color"
            )
        if error > _BLURRED:
            why = f"over all orientations and views, for order {order} shows nothing sharper"
            remedy = "make the texture of a larger order, or an SHRM of the probe for its BRDF"
            warnings.append(f"{name}: {at_error}{wrong_light(error, why, remedy)}")
        # Its metals are in the primaries that the light of its making had, of Rec.709 without any.
        lit = lit.with_info(replace(lit.info, chromaticities=light.probe.chromaticities))
        dark, where = _worst(shown, partial(_negative, lit), lambda each: each.badness)
        warnings += [f"{name}: {where}{line}" for line in dark.warnings(lit)]
        found.append(lit)
    return found, warnings


def _shown_ends(
    made: Map, ways: Mapping[str, tuple[float, float]] | None
) -> list[dict[str, float]]:
    """Return the values of parameters that vary at which a map is looked at.

    Surfaces are sharpest at an end, where light of few orders is most wrong and shows most of what
    is negative. The ends are those of `ways`, beside which other parameters are in the middle; or
    all of the map's without.
    """
    if ways is None:
        shown = dict(made.ways)
    else:
        shown = {name: way for name, way in ways.items() if name in made.ways}
    ends = product(*map(dict.fromkeys, shown.values()))
    return [dict(zip(shown, each, strict=True)) for each in ends]


def _worst(
    shown: Sequence[dict[str, float]],
    measure: Callable[[dict[str, float]], Measured],
    badness: Callable[[Measured], float],
) -> tuple[Measured, str]:
    """Return the worst of what is measured, and at which values it is, in words."""
    found = [(measure(values), values) for values in shown]
    worst, values = max(found, key=lambda each: badness(each[0]))
    said = " and ".join(f"{key}={value:g}" for key, value in values.items())
    return worst, f"with {said}, " if said else ""


def _negative(lit: Any, values: dict[str, float]) -> Negative:
    return negative_of(lit.with_values(values) if lit.ways else lit)


# ---- brought to the same primaries ---------------------------------------------------------------


@record(eq=False)
class Recolored(ReflectedLight):
    """A map whose radiance is shown in other primaries; that is exact for maps of every form."""

    shown: ReflectedLight
    matrix: Array
    """It takes the map's linear RGB to that which is wanted, shape (3, 3)."""
    primaries: tuple[float, ...] | None
    """The primaries that are wanted; None is Rec.709."""

    @cached_property
    def info(self) -> MapInfo:
        """How the map was made, with the new primaries."""
        return replace(self.shown.info, chromaticities=self.primaries)

    def radiance(self, normals: ArrayLike, views: ArrayLike) -> Array:
        return np.asarray(self.shown.radiance(normals, views) @ self.matrix.T)


def in_same_primaries(
    maps: Sequence[ReflectedLight], primaries: tuple[float, ...] | None
) -> list[ReflectedLight]:
    """Return maps that are all shown in the same primaries, which None says are Rec.709."""
    found: list[ReflectedLight] = []
    for each in maps:
        matrix = conversion(each.info.chromaticities, primaries)
        found.append(each if matrix is None else Recolored(each, matrix, primaries))
    return found


def one_of(stated: set[tuple[float, ...] | None]) -> tuple[float, ...] | None:
    """Return the primaries that all maps of a mesh have; None where nobody states any."""
    first, *others = sorted(stated, key=lambda each: each or ()) or [None]
    for other in others:
        if not same_primaries(first, other):
            raise MapError(
                f"maps in {title_of(first)} and in {title_of(other)} cannot be in one picture of a "
                "mesh; convert one of them, by shrm convert MAP --to REPRESENTATION with `working`"
            )
    return next((each for each in stated if each is not None), None)
