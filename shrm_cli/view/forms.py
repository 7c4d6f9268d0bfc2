"""Maps as the page draws them: the code of a shader, its textures, and what is said of them."""

import re
from typing import Any

from shrm_cli.color import to_rec709
from shrm_cli.errors import MapError
from shrm_cli.maps import registry
from shrm_cli.maps.base import Map
from shrm_cli.maps.info import spec_of
from shrm_cli.maps.kinds import LightMap, MaterialMap
from shrm_cli.maps.shader.code import Code, written_code
from shrm_cli.maps.shader.file import pack
from shrm_cli.view.blocks import Blocks
from shrm_cli.vocabulary import DEFAULT_TAPS

_LIGHT = ("shrm_layers", "shrm_product", "shrm_lobe")
"""The textures of light and of a BRDF, for which half precision will do; other tables stay 32
bits."""


def described_map(
    made: Map, name: str, file: str, blocks: Blocks, taps: int = DEFAULT_TAPS
) -> dict[str, Any]:
    """Describe a map for the page, as `viewer.js` knows it, and keep its textures.

    `name` is what the page calls the map. `file` is the name of its file, without a folder. Its
    textures are added to `blocks`. `taps`, one of 3, 5, 8, are how many look-ups the light of
    brushed surfaces takes.

    Raises MapError if shaders have no words for the map.
    """
    if isinstance(made, MaterialMap):
        raise MapError(f"{file}: a product texture that holds no light; give `probe`")
    brushed = taps if "anisotropy" in made.surface_arguments else None
    try:
        code = written_code(made, "glsl", "layers", brushed)
        textures = pack(made)
    except MapError as error:
        raise MapError(
            f"{file}: pages cannot show it ({error}); `shrm convert` makes another form of it"
        ) from error
    facts, light, ways = _facts(made), made.harmonic_light, made.ways.items()
    count = len(light.product.textures) if light and light.product else 1
    packed = []
    for each in textures:
        series = 0
        if made.texels_are_series:
            series = count if len(each.values) % count == 0 else 1
        what = f"{file}: {each.name}"
        found = blocks.texture(each.values, what, each.name in _LIGHT, series)
        packed.append({"name": each.name, **found})
    facts += [("rounded by", f"{each['error']:.2%}") for each in packed if "error" in each]
    return {
        "name": name,
        "file": file,
        "code": code.text,
        "call": _call(made, code),
        "boxed_call": _call(made, code, ", p") if code.is_boxed and not made.varies else None,
        "surface": isinstance(made, LightMap),
        "brushed": brushed,
        "tangents": code.takes_tangent or brushed is not None,
        "roughness": list(made.roughness_range),
        "textures": packed,
        "lighting": light.coefficients.ravel().tolist() if light and light.product else None,
        "probe": made.info.probe,
        "ways": [{"name": name, "low": low, "high": high} for name, (low, high) in ways],
        "facts": facts,
    }


def _call(made: Map, code: Code, point: str = "") -> str:
    """Return the expression of the radiance at a normal n and a view v, in linear Rec.709.

    Of brushed maps the code takes the tangent besides. With a point it is looked up in the box of
    the map's probe, unless the surface is brushed by many look-ups, whose code knows of none.
    """
    at = "_at" if point else ""
    own = [f", view_{name}" for name in ("roughness", "f0") if name in made.surface_arguments]
    call = f"shrm_radiance{at}(n, v{point}{''.join(own)})"
    if code.takes_tangent:
        call = f"shrm_brushed_radiance{at}(n, view_tangent(n), v{point})"
    if made.varies:
        shares = "".join(f", view_shares.{axis}" for axis, _ in zip("xy", made.ways, strict=False))
        call = f"shrm_varied_radiance(n, view_tangent(n), v{shares})"
    if "anisotropy" in made.surface_arguments:
        brushed = "n, view_tangent(n), v, view_roughness, view_anisotropy, view_f0"
        call = f"(view_anisotropy > 0.0 ? shrm_brushed({brushed}) : {call})"
    if code.is_irradiance:
        call = f"shrm_irradiance{at}(n{point}) * 0.3183098861837907"
    matrix = to_rec709(made.info.chromaticities)
    if matrix is None:
        return call
    # GLSL takes matrices column by column.
    return f"mat3({', '.join(repr(float(x)) for x in matrix.T.ravel())}) * ({call})"


def _facts(made: Map) -> list[tuple[str, str]]:
    """Return what the page says of a map, as pairs of a word and a value."""
    info, summary = made.info, made.summary()
    facts = [("form", registry.description(made.representation).title)]
    if "f0" not in made.surface_arguments and not made.is_white:
        brdf = info.brdf
        if isinstance(own := brdf.get("parameters"), dict):
            same = {name: value for name, value in own.items() if name not in made.ways}
            brdf = {**brdf, "parameters": same}
        places_to_break = re.sub(r"([,+:])", "\\1\u200b", spec_of(brdf))
        facts.append(("BRDF", places_to_break))
    facts += [(name, f"{low:.3g} \u2026 {high:.3g}") for name, (low, high) in made.ways.items()]
    facts.append(("probe", info.probe or "unknown"))
    if made.cube_count:
        facts.append(("cubes", f"{made.cube_count} of 6 \u00d7 {made.size}\u00b2"))
    orders = f"F = {info.order_carried}"
    facts.append(("orders", orders if not info.order_p else f"{orders}, P = {info.order_p}"))
    if isinstance(made, LightMap):
        low, high = made.roughness_range
        facts.append(("roughness", f"{low:.3g} \u2026 {high:.3g}"))
    for word, key in (
        ("predicted error", "predicted_error"),
        ("added by form", "added_error"),
        ("by bilinear", "filter_error"),
    ):
        value = summary.get(key) or 0.0
        if value > 0:
            facts.append((word, f"{value:.2%}"))
    return facts
