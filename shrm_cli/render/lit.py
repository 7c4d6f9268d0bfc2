"""Maps as pictures show them: those of light alone with a surface, those of a BRDF with light."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from shrm_cli.brdf.models.ggx import Ggx
from shrm_cli.errors import MapError
from shrm_cli.maps.base import Map
from shrm_cli.maps.prefiltered import negative_share, negative_warnings
from shrm_cli.maps.product.window import product_window
from shrm_cli.probe.lighting import Projection
from shrm_cli.probe.probe import Probe
from shrm_cli.render.shading import (
    KnownMap,
    ggx_surface,
    outside_range,
    reflectance,
    shown_as,
    takes_f0,
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
) -> tuple[list[KnownMap], dict[str, Any], list[str]]:
    """Give a surface to the maps of light alone, such as split sums and SH exponentials.

    Parameters
    ----------
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
    maps : list of KnownMap
        All maps, those of light alone with the surface.
    surface : dict
        Roughness and reflectance of the first map's surface, for a result; without a reflectance
        where that is a BRDF with colors of its own, and empty if no map needs a surface.
    warnings : list of str
        One for each map that was not made for this roughness.
    """
    if not any(each.needs_surface for each in maps):
        return list(maps), {}, []
    surfaces = [surface_of(roughness, f0, each.info.chromaticities, anisotropy) for each in maps]
    rough = surfaces[0].number("roughness")
    surface: dict[str, Any] = {"roughness": rough, "f0": list(surfaces[0].color("f0"))}
    if anisotropy is not None:
        surface["anisotropy"] = anisotropy
    warnings = outside_range(dict(zip(names, maps, strict=True)), rough)
    if not takes_f0(next(each for each in maps if each.needs_surface)):
        del surface["f0"]
    pairs = zip(maps, surfaces, strict=True)
    shown = [shown_as(each, own, taps) if each.needs_surface else each for each, own in pairs]
    return shown, surface, warnings


def lit_maps(
    maps: Sequence[Map], names: Sequence[str], probe: Probe | None, window: str | None
) -> tuple[list[Map], list[str]]:
    """Give the light of a probe to the maps that hold a BRDF alone, which are product textures.

    Parameters
    ----------
    names : sequence of str
        Names of the maps' files, for the message.
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
        if not each.needs_light:
            found.append(each)
            continue
        if light is None:
            raise MapError(f"{name}: a product texture that holds no light; give `probe`")
        order = each.info.order_f
        series = light.to_order(order).coefficients[: (order + 1) ** 2]
        shape = product_window(window or "auto", each, series)
        lit = each.lit(shape.apply(series))
        if shape.factors:
            warnings.append(
                f"{name}: the light is windowed ({shape.name}), which changes what is reflected by "
                f"{shape.change:.1%} RMS, p95 {shape.p95_change:.0%}; `window` none leaves it"
            )
        # Its metals are in the primaries that the light of its making had, of Rec.709 without any.
        lit = replace(lit, info=replace(lit.info, chromaticities=light.probe.chromaticities))  # type: ignore[type-var]
        warnings += [f"{name}: {line}" for line in negative_warnings(lit, negative_share(lit))]
        found.append(lit)
    return found, warnings
