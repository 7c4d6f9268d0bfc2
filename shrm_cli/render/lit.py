"""Maps as pictures show them: those of light alone with a surface, those of a BRDF with light."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from shrm_cli.brdf.models.ggx import Ggx
from shrm_cli.errors import MapError
from shrm_cli.maps.base import Map, ReflectedLight
from shrm_cli.maps.kinds import LightMap, MaterialMap
from shrm_cli.maps.negative import negative_share, negative_warnings
from shrm_cli.probe.lighting import Projection
from shrm_cli.probe.probe import Probe
from shrm_cli.render.shading import (
    ggx_surface,
    outside_range,
    reflectance,
    shown_as,
)
from shrm_cli.vocabulary import DEFAULT_ROUGHNESS


def surface_of(
    roughness: float | None,
    f0: str | None,
    primaries: tuple[float, ...] | None,
    anisotropy: float | None = None,
) -> Ggx:
    """Return the surface that arguments ask for, under light of some primaries."""
    color = None if f0 is None else reflectance(f0, primaries)
    chosen = DEFAULT_ROUGHNESS if roughness is None else roughness
    return ggx_surface(chosen, color, anisotropy)


def shaded_maps(
    maps: Sequence[Map],
    names: Sequence[str],
    roughness: float | None,
    f0: str | None,
    anisotropy: float | None = None,
    taps: int | None = None,
) -> tuple[list[ReflectedLight], dict[str, Any], list[str]]:
    """Give a surface to the maps of light alone, such as split sums and SH exponentials.

    Parameters
    ----------
    maps : sequence of Map
    names : sequence of str
        Names of the maps' files, for warnings.
    roughness : float, optional
        Perceptual roughness of the surface; `DEFAULT_ROUGHNESS` by default.
    f0 : str, optional
        Its reflectance at normal incidence, as `reflectance` takes it; that of `Ggx` by default.
        The colors of metals are converted to the primaries of each map.
    anisotropy, taps
        Of a brushed surface, as `shown_as` takes them.

    Returns
    -------
    maps : list of ReflectedLight
        All maps, those of light alone with the surface.
    surface : dict
        Roughness and reflectance of the first map's surface, for a result; without a reflectance
        where that is a BRDF with colors of its own, and empty if no map needs a surface.
    warnings : list of str
        One for each map that was not made for this roughness.
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
    maps: Sequence[Map], names: Sequence[str], probe: Probe | None, window: str | None
) -> tuple[list[Map], list[str]]:
    """Give the light of a probe to the maps that hold a BRDF alone, which are product textures.

    Parameters
    ----------
    maps : sequence of Map
    names : sequence of str
        Names of the maps' files, for the message.
    probe : Probe, optional
    window : str, optional
        The window of the light; ``auto`` by default.

    Returns
    -------
    maps : list of Map
    warnings : list of str
        One for each map that reflects less than nothing somewhere.

    Raises
    ------
    MapError
        If a map needs light and there is none, or there is no such window.
    ProbeError
        If the probe cannot be read.
    """
    light = None if probe is None else Projection(probe)
    found, warnings = [], []
    for each, name in zip(maps, names, strict=True):
        if not isinstance(each, MaterialMap):
            found.append(each)
            continue
        if light is None:
            raise MapError(f"{name}: a product texture that holds no light; give `probe`")
        order = each.info.order_f
        series = light.to_order(order).coefficients[: (order + 1) ** 2]
        shape = each.window(window or "auto", series)
        lit = each.lit(shape.apply(series))
        if shape.factors:
            warnings.append(
                f"{name}: the light is windowed ({shape.name}), which changes what is reflected by "
                f"{shape.change:.1%} RMS, p95 {shape.p95_change:.0%}; `window` none leaves it"
            )
        # Its metals are in the primaries that the light of its making had, of Rec.709 without any.
        lit = lit.with_info(replace(lit.info, chromaticities=light.probe.chromaticities))
        warnings += [f"{name}: {line}" for line in negative_warnings(lit, negative_share(lit))]
        found.append(lit)
    return found, warnings
