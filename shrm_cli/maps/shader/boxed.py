"""Look-ups with parallax as source code: the same as `probe.proxy` and `render.boxed` compute."""

import re
from collections.abc import Sequence

from shrm_cli.maps.base import Map
from shrm_cli.maps.shader.language import Language, filled
from shrm_cli.maps.shader.source import central_direction
from shrm_cli.probe.proxy import PARALLEL, ProxyBox

_TERMS = {"shrm": "shrm_term", "principal": "shrm_lobe"}
"""What the functions of a sum's terms are called, before their numbers."""
_BOX = """\
/* How far a coordinate goes along a direction until it leaves the box. */
float shrm_way(float p, float d, float low, float high)
{
    float ahead = d > 0.0 ? high - p : p - low;
    return abs(d) < PARALLEL ? 1e30 : ahead / max(abs(d), PARALLEL);
}
/* The direction in which the probe saw what a ray from p along d meets of the box. */
vec3 shrm_box(vec3 p, vec3 d)
{
    float x = min(max(p.x, LOWX), HIGHX), y = min(max(p.y, LOWY), HIGHY);
    float z = min(max(p.z, LOWZ), HIGHZ), size;
    float way = min(shrm_way(x, d.x, LOWX, HIGHX), shrm_way(y, d.y, LOWY, HIGHY));
    way = min(way, shrm_way(z, d.z, LOWZ, HIGHZ));
    x = x + way * d.x - ATX;
    y = y + way * d.y - ATY;
    z = z + way * d.z - ATZ;
    size = sqrt(x * x + y * y + z * z);
    return vec3(x / size, y / size, z / size);
}"""


def boxed_functions(
    made: Map, functions: Sequence[str], language: Language, takes_tangent: bool
) -> list[str]:
    """Write the function ``shrm_radiance_at``, which takes a point as well.

    Where there is ``shrm_even``, ``shrm_even_at`` takes the point after v, too.

    Where the surface is brushed, it is ``shrm_brushed_radiance_at(n, t, v, p)``, and that with the
    tangent of ``shrm_tangent``.

    `takes_tangent` tells whether ``shrm_brushed_radiance`` is among them.

    Returns lines of GLSL as `Language.translated` takes it; none where the map knows of no box, and
    none where all parts are about the tangent, which are looked up without.
    """
    box, centers = made.info.proxy, {center for _, center in made.parts}
    text = "\n".join(functions)
    if box is None or centers == {"tangent"}:
        return []
    found = re.search(r"vec3 shrm_radiance\(vec3 n, vec3 v(.*?)\)", text)
    assert found is not None
    more = re.sub(r"(?:float|vec3) ", "", found[1])
    both = language.minus(language.scale("2.0 * dot(axis, v)", "axis"), "v")
    lines = [
        *box_function(box, language),
        "vec3 shrm_half_turn(vec3 v, vec3 axis)",
        "{",
        f"    return {both};",
        "}",
        "/* Turn v by the least rotation that takes a to b. */",
        "vec3 shrm_carried(vec3 v, vec3 a, vec3 b)",
        "{",
        f"    vec3 axis = {language.add('a', 'b')};",
        f"    axis = {language.scale('(1.0 / max(length(axis), 1e-6))', 'axis')};",
        "    return shrm_half_turn(shrm_half_turn(v, a), axis);",
        "}",
        "vec3 shrm_brushed_radiance_at(vec3 n, vec3 t, vec3 v, vec3 p)"
        if takes_tangent
        else f"vec3 shrm_radiance_at(vec3 n, vec3 v, vec3 p{found[1]})",
        "{",
        "    vec3 total = vec3(0.0, 0.0, 0.0), c, d;",
    ]
    for name, center in _parts(made, text):
        along = "shrm_carried(t, c, d), " if f"vec3 {name}(vec3 n, vec3 t, " in text else ""
        if center == "tangent":
            lines.append(f"    {language.grow('total', f'{name}(n, v{more})')}")
            continue
        turned = f"{name}(shrm_carried(n, c, d), {along}shrm_carried(v, c, d){more})"
        lines += [
            f"    c = {central_direction(center, language)};",
            "    d = shrm_box(p, c);",
            f"    {language.grow('total', turned)}",
        ]
    lines += ["    return total;", "}"]
    if "vec3 shrm_even(" in text:
        lines += _even_at(language)
    if takes_tangent:
        lines += ["vec3 shrm_radiance_at(vec3 n, vec3 v, vec3 p)", "{"]
        lines += ["    return shrm_brushed_radiance_at(n, shrm_tangent(n), v, p);", "}"]
    return lines


def _even_at(language: Language) -> list[str]:
    """Write the function of split sums that are looked up where their lobe lies."""
    return [
        "vec3 shrm_even_at(vec3 n, vec3 v, vec3 p, float roughness, vec3 f0)",
        "{",
        f"    vec3 c = {central_direction('reflection', language)};",
        "    vec3 d = shrm_box(p, c);",
        "    return shrm_even(shrm_carried(n, c, d), shrm_carried(v, c, d), roughness, f0);",
        "}",
    ]


def box_function(box: ProxyBox, language: Language) -> list[str]:
    """Write the function ``shrm_box``, whose numbers are in place."""
    words = {"PARALLEL": language.number(PARALLEL)}
    for word, numbers in (("LOW", box.low), ("HIGH", box.high), ("AT", box.at)):
        for axis, number in zip("XYZ", numbers, strict=True):
            words[word + axis] = language.number(number)
    return filled(_BOX, words)


def _parts(made: Map, text: str) -> list[tuple[str, str]]:
    """Return the function and the central direction of each part of a map."""
    within = made.stored
    centers = [center for _, center in within.parts]
    kind = "radiance" if within is made else "map"
    is_brushed = f"vec3 shrm_brushed_{kind}(" in text
    names = [f"shrm_{'brushed_' if is_brushed else ''}{kind}"]
    if len(centers) > 1:
        names = [f"{_TERMS[within.representation]}{k}" for k in range(len(centers))]
    lamps = [] if within is made else [("shrm_lamps", made.parts[-1][1])]
    return [*zip(names, centers, strict=True), *lamps]
