"""The lamps beside a map as source code: the same rule, over the same discs, as `rule` has."""

import math
from collections.abc import Callable, Sequence

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Brdf, Color
from shrm_cli.brdf.film import COSINES, film_table
from shrm_cli.brdf.lobe import cuts_horizon
from shrm_cli.brdf.models.blinn_phong import normalization
from shrm_cli.brdf.sums import weighted_terms
from shrm_cli.errors import MapError
from shrm_cli.maps.lamps.discs import LitDiscs
from shrm_cli.maps.lamps.rule import LEAST_COSINE, chebyshev, gauss, sines
from shrm_cli.maps.shader.language import Language
from shrm_cli.maps.shader.source import central_direction, tangent_function

_SUM = """\
    float x = l.x + v.x, y = l.y + v.y, z = l.z + v.z;
    float size = max(sqrt(x * x + y * y + z * z), 1e-5);"""
"""The half vector before it is normalized."""
_HALF = f"""{_SUM}
    float sine2 = (x * x + y * y) / (size * size), up = z / size;"""
"""The squared sine and the cosine of the half vector's angle to the normal."""
_FRAME = """\
vec3 shrm_across(vec3 up, vec3 to)
{
    float along = dot(up, to);
    return vec3(to.x - along * up.x, to.y - along * up.y, to.z - along * up.z);
}
vec3 shrm_beside(vec3 up, vec3 to)
{
    vec3 found = shrm_across(up, to);
    float size = sqrt(dot(found, found));
    if (size < 1e-3) {
        found = shrm_across(up, abs(up.x) < 0.7 ? vec3(1.0, 0.0, 0.0) : vec3(0.0, 1.0, 0.0));
        size = sqrt(dot(found, found));
    }
    return vec3(found.x / size, found.y / size, found.z / size);
}
vec3 shrm_third(vec3 a, vec3 b)
{
    return vec3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
}
float shrm_asinh(float x)
{
    float size = log(abs(x) + sqrt(x * x + 1.0));
    return x < 0.0 ? -size : size;
}
float shrm_asin(float x)
{
    float s = x > 0.5 ? sqrt(0.5 - 0.5 * x) : x, q = s * s;
    float t = 0.0446429 + q * (0.0303819 + q * (0.0223722 + q * (0.0173528 + q * 0.0139648)));
    t = s + s * q * (0.16666667 + q * (0.075 + q * t));
    return x > 0.5 ? 1.57079633 - 2.0 * t : t;
}
float shrm_sin(float x)
{
    float q = x * x;
    float t = q * (1.0 / 120.0 - q * (1.0 / 5040.0 - q * (1.0 / 362880.0 - q / 39916800.0)));
    return abs(x) < 1.6 ? x - x * q * (1.0 / 6.0 - t) : sin(x);
}
float shrm_cos(float x)
{
    float q = x * x;
    float t = q * (1.0 / 24.0 - q * (1.0 / 720.0 - q * (1.0 / 40320.0 - q / 3628800.0)));
    return abs(x) < 1.6 ? 1.0 - q * (0.5 - t) : cos(x);
}"""
"""Frames, and functions that are exact for small angles too.

Shading languages allow their own sines and arc sines errors of some 5e-4, a tenth of the radius of
a small lamp. Here they are Taylor's series as far as these converge soon.
"""
# The names are those of `rule`; half is a word of shaders.
_CUT = """\
    turn = atan(dot(n, e), dot(n, c));
    is_cut = abs(dot(a, n)) < sine ? 1 : 0;
    count = is_cut == 1 ? MANY : STEPS;
    low = max(low, turn - 0.5 * PI);
    high = min(high, turn + 0.5 * PI);"""
_LAMPS = """\
vec3 shrm_lamp(vec3 n, SIDEvec3 v, vec3 c, vec3 a, float radius)
{
    vec3 total = vec3(0.0, 0.0, 0.0);
    vec3 e = shrm_beside(c, v), f = shrm_third(c, e), OWNt = shrm_third(n, s);
    float ax = dot(a, e), ay = dot(a, f), az = dot(a, c);
    float wide = sqrt(ax * ax + az * az), middle = atan(ax, az), sine = shrm_sin(radius);
    float span = shrm_asin(min(sine / max(wide, sine), 1.0));
    float wy = WIDTH * max(dot(n, v), LEAST);
    float low, high, step, x, over, turn, b, reach, above, y, weight;
    int i, j, count = STEPSBOOL;
    if (abs(ay) >= shrm_cos(radius)) {
        span = PI;
    }
    low = middle - span;
    high = middle + span;
CUT
    high = shrm_asinh(max(low, high) / WIDTH);
    low = shrm_asinh(low / WIDTH);
    for (i = 0; i < count; i++) {
        float first, last;
        vec3 node = RULE;
        step = 0.5 * (low + high) + 0.5 * (high - low) * node.x;
        x = WIDTH * sinh(step);
        over = node.y * 0.5 * (high - low) * WIDTH * cosh(step);
        turn = x - middle;
        b = wide * shrm_cos(turn);
        reach = sqrt(ay * ay + b * b);
        above = 2.0 * shrm_sin(0.5 * radius) * shrm_sin(0.5 * radius);
        above = above - wide * shrm_sin(turn) * wide * shrm_sin(turn) / (1.0 + reach);
        span = 2.0 * shrm_asin(sqrt(min(max(above / max(2.0 * reach, 1e-12), 0.0), 1.0)));
        first = shrm_asinh(max(atan(ay, b) - span, -0.5 * PI) / wy);
        last = shrm_asinh(min(atan(ay, b) + span, 0.5 * PI) / wy);
        for (j = 0; j < STEPS; j++) {
            vec3 l;
            step = 0.5 * (first + last) + 0.5 * (last - first) * shrm_lamp_nodes[j].x;
            y = wy * sinh(step);
            weight = shrm_lamp_nodes[j].y * 0.5 * (last - first) * wy * cosh(step);
            weight = weight * over * shrm_cos(y);
            l = LIGHT;
            l = vec3(dot(l, s), dot(l, t), dot(l, n));
            GROW
        }
    }
    return total;
}
vec3 shrm_lamps(vec3 n, SIDEvec3 v)
{
    vec3 total = vec3(0.0, 0.0, 0.0), c = CENTER;
    int k;
    for (k = 0; k < COUNT; k++) {
        vec3 a = shrm_lamp_axes[k];
        float radius = shrm_lamp_sizes[k].x;
        if (dot(a, n) > LOWEST) {
            ADD
        }
    }
    return total;
}"""
_BOTH = """\
vec3 shrm_radiance(vec3 n, vec3 v)
{
    return BOTH;
}"""
_BRUSHED = """\
vec3 shrm_brushed_radiance(vec3 n, vec3 t, vec3 v)
{
    return BOTH;
}
vec3 shrm_radiance(vec3 n, vec3 v)
{
    return shrm_brushed_radiance(n, shrm_tangent(n), v);
}"""
"""Of brushed surfaces x is along the tangent, and not in the plane of the view."""


def with_lamps(
    functions: Sequence[str], lamps: LitDiscs, language: Language, takes_tangent: bool
) -> list[str]:
    """Write the functions of a map with those of the lamps beside it.

    Its ``shrm_radiance`` becomes ``shrm_map``, to which a new one adds the lamps. That of brushed
    surfaces, ``shrm_brushed_radiance``, takes the tangent besides.

    Parameters
    ----------
    functions : sequence of str
        Those of the map.
    takes_tangent : bool
        Whether ``shrm_brushed_radiance`` is among them.

    Returns lines of GLSL as `Language.translated` takes it. Raises MapError if there are no words
    for the BRDF.
    """
    is_brushed = not lamps.brdf.isotropic
    own = "\n".join(functions).replace("vec3 shrm_radiance(", "vec3 shrm_map(")
    shown = "shrm_map(n, v)"
    if is_brushed and takes_tangent:
        own, shown = own.partition("\nvec3 shrm_map(")[0], "shrm_brushed_map(n, t, v)"
        own = own.replace("vec3 shrm_brushed_radiance(", "vec3 shrm_brushed_map(")
    both = language.add(shown, f"shrm_lamps({'n, t, v' if is_brushed else 'n, v'})")
    lines = [*own.split("\n"), *_lamps(lamps, language)]
    if is_brushed and "shrm_tangent(" not in own:
        lines += tangent_function(["tangent"])
    return lines + (_BRUSHED if is_brushed else _BOTH).replace("BOTH", both).split("\n")


def _lamps(lamps: LitDiscs, language: Language) -> list[str]:
    """Write ``shrm_lamps``, and what it uses."""
    discs, rule = lamps.discs, lamps.rule
    is_brushed = not lamps.brdf.isotropic
    radii = np.array([disc.radius for disc in discs])
    tables = {
        "shrm_lamp_whole": _rows(*chebyshev(rule.steps)),
        "shrm_lamp_nodes": _rows(*gauss(rule.steps)),
        "shrm_lamp_axes": np.array([disc.direction for disc in discs]),
        "shrm_lamp_sizes": _rows(radii, np.sin(radii)),
        "shrm_lamp_lights": np.array([disc.radiance for disc in discs]),
    }
    functions, reflected = _brdf(lamps.brdf, language)
    cuts = cuts_horizon(lamps.brdf)
    if cuts:
        tables["shrm_lamp_cut"] = _rows(*sines(rule.longitudes(is_cut=True)))
    light = language.combined(
        ["shrm_sin(x) * shrm_cos(y)", "shrm_sin(y)", "shrm_cos(x) * shrm_cos(y)"], ["e", "f", "c"]
    )
    added = language.times(
        f"shrm_lamp(n, {'t, ' if is_brushed else ''}v, c, a, radius)", "shrm_lamp_lights[k]"
    )
    words = {
        "CUT": _CUT if cuts else "",
        "WIDTH": language.number(rule.width),
        "LEAST": language.number(LEAST_COSINE),
        "PI": language.number(math.pi),
        "MANY": str(rule.longitudes(is_cut=True)),
        "STEPS": str(rule.steps),
        "COUNT": str(len(discs)),
        "CENTER": central_direction(lamps.brdf.center, language),
        "LIGHT": light,
        "GROW": language.grow("total", language.scale("weight", reflected)),
        "RULE": "is_cut == 1 ? shrm_lamp_cut[i] : shrm_lamp_whole[i]"
        if cuts
        else "shrm_lamp_whole[i]",
        "BOOL": ", is_cut = 0" if cuts else "",
        "LOWEST": "-shrm_lamp_sizes[k].y" if cuts else "-2.0",
        "ADD": language.grow("total", added),
        "SIDEvec3 v, vec3 c": "vec3 s, vec3 v, vec3 c" if is_brushed else "vec3 v, vec3 c",
        "SIDE": "vec3 t, " if is_brushed else "",
        "OWN": "" if is_brushed else "s = shrm_beside(n, v), ",
    }
    text = _LAMPS
    for word, meaning in words.items():
        text = text.replace(word, meaning)
    text = text.replace("\n\n", "\n")
    arrays = [line for name, rows in tables.items() for line in language.colors(name, rows)]
    return [*arrays, *functions, *_FRAME.split("\n"), *text.split("\n")]


def _rows(first: Array, second: Array) -> Array:
    """Return numbers as the first two parts of vectors."""
    return np.stack([first, second, 0 * first], axis=-1)


def has_code(brdf: Brdf) -> bool:
    """Tell whether there is code of what a BRDF reflects of lamps."""
    return all(term.name in _MODELS for _, term in weighted_terms(brdf))


def _brdf(brdf: Brdf, language: Language) -> tuple[list[str], str]:
    """Write the functions of the terms, and their sum for a light l and the view v.

    Each is a transfer function: the BRDF times the cosine of the light's angle.
    """
    lines, calls, terms = [], [], weighted_terms(brdf)
    for number, (_, term) in enumerate(terms):
        if term.name not in _MODELS:
            known = ", ".join(_MODELS)
            raise MapError(
                f"no code for the lamps beside the map: there is none of {term.name}, only of "
                f"{known} and their sums; the map's own code is had without `sun`"
            )
        takes, gets = "vec3 l, vec3 v", "l, vec3(dot(v, s), dot(v, t), dot(v, n))"
        if term.name in _BLIND:
            takes, gets = "vec3 l", "l"
        lines += [f"vec3 shrm_brdf{number}({takes})", "{"]
        lines += [*_MODELS[term.name](term, language), "}"]
        calls.append(f"shrm_brdf{number}({gets})")
    total = language.combined([language.number(weight) for weight, _ in terms], calls)
    return lines, total if language.is_c else f"({total})"


def _color(color: Color, language: Language) -> str:
    return f"vec3({', '.join(map(language.number, color))})"


def _lambertian(brdf: Brdf, language: Language) -> list[str]:
    red, green, blue = brdf.color("albedo")
    color = _color((red / math.pi, green / math.pi, blue / math.pi), language)
    return [f"    return {language.scale('max(l.z, 0.0)', color)};"]


def _ggx(brdf: Brdf, language: Language) -> list[str]:
    parts = ["value * (1.0 - rest)", "value * rest"]
    colors = [_color(brdf.color("f0"), language), "vec3(1.0, 1.0, 1.0)"]
    table, place, blend = [], [], ["    rest = rest * rest * rest * rest * rest;"]
    film = brdf.film  # type: ignore[attr-defined]
    if film:
        table = language.colors("film", film_table(brdf.color("f0"), *film))
        colors, blend = ["film[k]", "film[k + 1]"], ["    rest = at - float(k);"]
        first, per_step = (language.number(each) for each in (COSINES[0], COSINES[1] - COSINES[0]))
        place = [
            f"    float at = (min(0.5 * size, 1.0) - {first}) / {per_step};",
            f"    int k = int(min(at, {len(COSINES) - 2}.0));",
        ]
    return [
        *table,
        *_facets(brdf.alphas, language),  # type: ignore[attr-defined]
        *place,
        *blend,
        "    if (l.z <= 0.0 || v.z <= 0.0) {",
        "        value = 0.0;",
        "    }",
        f"    return {language.combined(parts, colors)};",
    ]


def _facets(alphas: tuple[float, float], language: Language) -> list[str]:
    """Write the distribution and the masking of GGX's facets, as `value`."""
    ax2, ay2 = (alpha**2 for alpha in alphas)
    a, b, rest = (language.number(each) for each in (ax2, ay2, 1 - ax2))
    half, slopes = _HALF, f"sine2 / {a}"
    masking = [f"sqrt({a} + {rest} * {z} * {z})" for z in ("vz", "lz")]
    if ax2 != ay2:
        half = f"{_SUM}\n    float up = z / size;"
        slopes = f"(x * x / {a} + y * y / {b}) / (size * size)"
        masking = [
            f"sqrt({a} * {w}.x * {w}.x + {b} * {w}.y * {w}.y + {w}z * {w}z)" for w in ("v", "l")
        ]
    scale = language.number(2 * math.pi * math.sqrt(ax2 * ay2))
    return [
        *half.split("\n"),
        "    float lz = max(l.z, 1e-5), vz = max(v.z, 1e-5);",
        f"    float d = {slopes} + up * up, rest = 1.0 - min(0.5 * size, 1.0);",
        f"    float both = lz * {masking[0]} + vz * {masking[1]};",
        f"    float value = l.z / ({scale} * d * d * both);",
    ]


def _blinn_phong(brdf: Brdf, language: Language) -> list[str]:
    n = brdf.number("exponent")
    factor, half = language.number(normalization(n)), language.number(n / 2)
    return [
        *_HALF.split("\n"),
        f"    float value = {factor} * l.z * exp({half} * log(max(1.0 - sine2, 1e-7)));",
        "    if (l.z <= 0.0 || v.z <= 0.0 || up <= 0.0) {",
        "        value = 0.0;",
        "    }",
        f"    return {language.scale('value', _color(brdf.color('color'), language))};",
    ]


def _phong(brdf: Brdf, language: Language) -> list[str]:
    n = brdf.number("exponent")
    factor = language.number((n + 1) / (2 * math.pi))
    lobe = f"{factor} * exp({language.number(n)} * log(min(cosine, 1.0)))"
    return [
        "    float cosine = l.z * v.z - l.x * v.x - l.y * v.y;",
        f"    float value = cosine > 1e-30 ? {lobe} : 0.0;",
        "    return vec3(value, value, value);",
    ]


def _microfacet(brdf: Brdf, language: Language) -> list[str]:
    sigma = brdf.number("sigma")
    factor = language.number(1 / (4 * math.pi * sigma**2))
    return [
        *_HALF.split("\n"),
        f"    float angle = atan(sqrt(sine2), up) / {language.number(sigma)};",
        f"    float value = l.z > 0.0 ? {factor} * exp(-angle * angle) : 0.0;",
        "    return vec3(value, value, value);",
    ]


_MODELS: dict[str, Callable[[Brdf, Language], Sequence[str]]] = {
    "lambertian": _lambertian,
    "ggx": _ggx,
    "blinn-phong": _blinn_phong,
    "phong": _phong,
    "microfacet": _microfacet,
}
"""The models that there is code of."""
_BLIND = {"lambertian"}
"""Those to which the view makes no difference."""
