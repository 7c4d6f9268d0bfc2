"""The options --roughness and --f0 of the surface that maps of light alone are shown as."""

from __future__ import annotations

from collections.abc import Sequence

import click

import shrm_cli as shrm
from shrm_cli import vocabulary
from shrm_cli.cli import options, usage
from shrm_cli.cli.types import BRUSH, Parsed, option, within


def _reflectance(text: str) -> str:
    """Return a text that `reflectance` understands, as it is."""
    from shrm_cli.render.lit import reflectance

    if not text.strip() or set(text) & set(",:+*="):
        raise ValueError(f"{text!r} is not a colour such as 0.04, 1/0.78/0.34 or gold")
    try:
        reflectance(text)
    except shrm.BrdfError as error:
        raise ValueError(str(error).removeprefix("ggx: ")) from None
    return text


_TAPS = [str(n) for n in sorted({*vocabulary.EVEN_LOOK_UPS, *vocabulary.TAP_COUNTS})]


def _as_number(context: object, parameter: object, value: str | None) -> int | None:
    return None if value is None else int(value)


roughness_option = option(
    "--roughness R", within(vocabulary.MIN_ROUGHNESS, 1),
    help="Perceptual roughness of the GGX surface that split sums and SH exponentials are shown "
    f"as.  [default: {vocabulary.DEFAULT_ROUGHNESS:g}]",
)  # fmt: skip
f0_option = option(
    "--f0", Parsed("F0", _reflectance),
    help="Its reflectance at normal incidence: a number, R/G/B or a metal's name.  [default: 1]",
)  # fmt: skip
surface_options = options.several(roughness_option, f0_option)
brushed_options = options.several(
    option(
        "--anisotropy S", within(0, 1),
        help="Anisotropy of that surface under split sums, as in glTF: its brush marks run across "
        "the tangents, which run around +Y on spheres.  [default: 0]",
    ),
    option(
        "--taps", click.Choice(_TAPS),
        callback=_as_number,
        help="Look-ups of a split sum where the lobe lies: 1, 2 or 3, or with --anisotropy 3, 5 or "
        "8; 0 for one about the mirror direction, as engines do.  [default: "
        f"{vocabulary.DEFAULT_EVEN_TAPS}; with --anisotropy {vocabulary.DEFAULT_TAPS}]",
    ),
)  # fmt: skip

brush_option = option(
    "--brush", BRUSH,
    help="Tangents of a mesh for anisotropic maps: along the texture coordinate u, or a "
    "direction.  [default: around +Y]",
)  # fmt: skip


def surface_rules(maps: Sequence[shrm.Map]) -> dict[str, usage.Applies]:
    """Return when the options of a surface apply: to maps of light alone."""
    holds = any(each.surface_arguments for each in maps)
    applies = (holds, "to split sums and SH exponentials, and no MAP is one")
    return {"roughness": applies, "f0": applies, **brushed_rules(maps)}


def brushed_rules(maps: Sequence[shrm.Map]) -> dict[str, usage.Applies]:
    """Return when the options of split sums of GGX apply."""
    asked = [each.surface_arguments for each in maps if each.surface_arguments]
    holds = bool(asked) and all("anisotropy" in each for each in asked)
    return {
        "anisotropy": (
            holds,
            "to split sums of GGX; other forms take a BRDF, ggx:anisotropy=, when made",
        ),
        "taps": (holds, "to split sums of GGX"),
    }


def told_of_taps(maps: Sequence[shrm.Map], taps: int | None, anisotropy: float | None) -> list[str]:
    """Say how split sums were looked up where nobody asked, which engines do otherwise."""
    is_asked = taps is not None or anisotropy
    if is_asked or all("anisotropy" not in each.surface_arguments for each in maps):
        return []
    return [
        f"split sums were looked up {vocabulary.DEFAULT_EVEN_TAPS} times, where the lobe lies; "
        "engines do it once, about the mirror direction: --taps 0 shows that"
    ]


def refuse_surface(maps: Sequence[shrm.Map]) -> None:
    """Refuse the options of a surface that none of the maps needs."""
    usage.refuse_inapplicable(surface_rules(maps))
    if asked := [each.surface_arguments for each in maps if each.surface_arguments]:
        is_ggx = any("f0" in each for each in asked)
        usage.refuse_inapplicable({"f0": (is_ggx, "to maps of GGX, and no MAP is one")})


window_option = option(
    "--window NAME[:WIDTH]", str,
    help="Of the light of product textures that hold none: none, hann, lanczos, or auto, the "
    "least that leaves no black spots.  [default: auto]",
)  # fmt: skip


def refuse_window(maps: Sequence[shrm.Map]) -> None:
    """Refuse --window where no map needs light."""
    usage.refuse_inapplicable({"window": to_unlit(maps)})


def to_unlit(maps: Sequence[shrm.Map]) -> usage.Applies:
    """Whether options about the light of product textures apply."""
    from shrm_cli.maps.kinds import MaterialMap

    holds = any(isinstance(each, MaterialMap) for each in maps)
    return (holds, "to product textures that hold no light, and no MAP is one")
