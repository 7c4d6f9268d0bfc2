"""The options --roughness and --f0 of the surface that maps of light alone are shown as."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import click

from shrm_cli.cli.options import several
from shrm_cli.cli.types import Parsed, within
from shrm_cli.cli.usage import Applies, given_options, refuse_inapplicable
from shrm_cli.vocabulary import DEFAULT_ROUGHNESS, DEFAULT_TAPS, MIN_ROUGHNESS, TAP_COUNTS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from shrm_cli.brdf.models.ggx import Ggx
    from shrm_cli.maps.base import Map
    from shrm_cli.probe.probe import Probe
    from shrm_cli.render.shading import KnownMap


def _reflectance(text: str) -> str:
    """Return a text that `reflectance` understands, as it is."""
    from shrm_cli.errors import BrdfError
    from shrm_cli.render.shading import reflectance

    if not text.strip() or set(text) & set(",:+*="):
        raise ValueError(f"{text!r} is not a colour such as 0.04, 1/0.78/0.34 or gold")
    try:
        reflectance(text)
    except BrdfError as error:
        raise ValueError(str(error).removeprefix("ggx: ")) from None
    return text


def _as_number(context: object, parameter: object, value: str | None) -> int | None:
    return None if value is None else int(value)


roughness_option = click.option(
    "--roughness", type=within(MIN_ROUGHNESS, 1), metavar="R",
    help="Perceptual roughness of the GGX surface that split sums and SH exponentials are shown "
    f"as.  [default: {DEFAULT_ROUGHNESS:g}]",
)  # fmt: skip
f0_option = click.option(
    "--f0", type=Parsed("F0", _reflectance),
    help="Its reflectance at normal incidence: a number, R/G/B or a metal's name.  [default: 1]",
)  # fmt: skip
surface_options = several(roughness_option, f0_option)
brushed_options = several(
    click.option(
        "--anisotropy", type=within(0, 1), metavar="S",
        help="Anisotropy of that surface under split sums, as in glTF: its brush marks run across "
        "the tangents, which run around +Y on spheres.  [default: 0]",
    ),
    click.option(
        "--taps", type=click.Choice([str(each) for each in TAP_COUNTS]), callback=_as_number,
        help="Look-ups of the light with --anisotropy.  "
        f"[default: {DEFAULT_TAPS}]",
    ),
)  # fmt: skip


def needs_surface(maps: Sequence[Map]) -> dict[str, Applies]:
    """Return when the options of a surface apply: to maps of light alone."""
    holds = any(each.needs_surface for each in maps)
    applies = Applies(holds, "to split sums and SH exponentials, and no MAP is one")
    return {"roughness": applies, "f0": applies}


def brushed_rules(maps: Sequence[Map]) -> dict[str, Applies]:
    """Return when the options of brushed surfaces apply."""
    from shrm_cli.render.shading import can_be_brushed

    lit = [each for each in maps if each.needs_surface]
    holds = bool(lit) and all(map(can_be_brushed, lit))
    is_brushed = "anisotropy" in given_options()
    return {
        "anisotropy": Applies(
            holds, "to split sums of GGX; other forms take a BRDF, ggx:anisotropy=, when made"
        ),
        "taps": Applies(holds and is_brushed, "with --anisotropy"),
    }


def surface_of(
    roughness: float | None,
    f0: str | None,
    primaries: tuple[float, ...] | None,
    anisotropy: float | None = None,
) -> Ggx:
    """Return the surface that the options ask for, under light of some primaries."""
    from shrm_cli.render.shading import ggx_surface, reflectance

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
    maps : list of KnownMap
        All maps, those of light alone with the surface.
    surface : dict
        Roughness and reflectance of the first map's surface, for a result; without a reflectance
        where that is a BRDF with colors of its own, and empty if no map needs a surface.
    warnings : list of str
        One for each map that was not made for this roughness.

    Raises
    ------
    click.UsageError
        If a surface is asked for, and no map needs one.
    """
    from shrm_cli.render.shading import outside_range, shown_as, takes_f0

    refuse_inapplicable(needs_surface(maps))
    refuse_inapplicable(brushed_rules(maps))
    if not any(each.needs_surface for each in maps):
        return list(maps), {}, []
    is_ggx = any(map(takes_f0, maps))
    refuse_inapplicable({"f0": Applies(is_ggx, "to maps of GGX, and no MAP is one")})
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


window_option = click.option(
    "--window", metavar="NAME[:WIDTH]",
    help="Of the light of product textures that hold none: none, hann, lanczos, or auto, the "
    "least that leaves no black spots.  [default: auto]",
)  # fmt: skip


def to_unlit(maps: Sequence[Map]) -> Applies:
    """Whether options about the light of product textures apply."""
    needs_light = any(each.needs_light for each in maps)
    return Applies(needs_light, "to product textures that hold no light, and no MAP is one")


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
    click.UsageError
        If a window is asked for, and no map needs light.
    MapError
        If a map needs light and there is none, or there is no such window.
    ProbeError
        If the probe cannot be read.
    """
    from shrm_cli.errors import MapError
    from shrm_cli.maps.negative import negative_share, negative_warnings
    from shrm_cli.maps.product.window import product_window
    from shrm_cli.probe.lighting import Projection

    refuse_inapplicable({"window": to_unlit(maps)})
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
