"""The lamps beside a map as source code: the same rule, over the same discs, as `rule` has."""

import math
from collections.abc import Callable, Sequence

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.brdf.lobe import cuts_horizon
from shrm_cli.maps.lamps.models import Functions
from shrm_cli.maps.lamps.rule import LEAST_COSINE, MORE, LitDiscs, chebyshev, sines
from shrm_cli.maps.shader.language import Language, filled
from shrm_cli.maps.shader.source import BRUSHED_BY_TANGENT, central_direction, tangent_function
from shrm_cli.sphere.quadrature import gauss_legendre

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
float shrm_turned(float x)
{
    return x - 2.0 * PI * floor(x / (2.0 * PI) + 0.5);
}
float shrm_sin(float x)
{
    float d = shrm_turned(x), s = max(min(d, PI - d), -PI - d), q = s * s;
    float t = q * (1.0 / 120.0 - q * (1.0 / 5040.0 - q * (1.0 / 362880.0 - q / 39916800.0)));
    return s - s * q * (1.0 / 6.0 - t);
}
float shrm_cos(float x)
{
    float d = abs(shrm_turned(x)), s = min(d, PI - d), q = s * s;
    float t = q * (1.0 / 24.0 - q * (1.0 / 720.0 - q * (1.0 / 40320.0 - q / 3628800.0)));
    return min(max(1e30 * (0.5 * PI - d), -1.0), 1.0) * (1.0 - q * (0.5 - t));
}"""
"""Frames, and functions that are exact for small angles too.

Shading languages allow their own sines and arc sines errors of some 5e-4, a tenth of the radius of
a small lamp. Here they are Taylor's series within a quarter of a turn. Other angles are folded
there without a branch: renderers without a graphics device compiled one for over a minute, as each
call stands in two loops.
"""
# The names are those of `rule`; half is a word of shaders.
_CUT = """\
    turn = atan(dot(n, e), dot(n, c));
    is_cut = abs(dot(a, n)) < sine ? 1 : 0;
    count = is_cut == 1 ? steps + MORE : steps;
    low = max(low, turn - 0.5 * PI);
    high = min(high, turn + 0.5 * PI);"""
_REACH = """\
    if (dot(a, c) < rule.x) {
        skip = 0;FIRST
        steps = FEW;
    }"""
_LAMPS = """\
vec3 shrm_lamp(vec3 n, SIDEvec3 v, vec3 c, vec3 a, vec3 size, vec3 rule)
{
    vec3 total = vec3(0.0, 0.0, 0.0);
    vec3 e = shrm_beside(c, v), f = shrm_third(c, e), OWNt = shrm_third(n, s);
    float ax = dot(a, e), ay = dot(a, f), az = dot(a, c);
    float wide = sqrt(ax * ax + az * az), middle = atan(ax, az), radius = size.x, sine = size.y;
    float span = shrm_asin(min(sine / max(wide, sine), 1.0));
    float wy = WIDTH * max(dot(n, v), LEAST);
    float low, high, step, x, over, turn, b, reach, above, y, weight;
    int i, j, count, skip = int(rule.z), steps = int(rule.y)BOOL;
REACHED
    count = steps;
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
        for (j = 0; j < steps; j++) {
            vec3 l;
            step = 0.5 * (first + last) + 0.5 * (last - first) * shrm_lamp_nodes[skip + j].x;
            y = wy * sinh(step);
            weight = shrm_lamp_nodes[skip + j].y * 0.5 * (last - first) * wy * cosh(step);
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
        vec3 a = shrm_lamp_axes[k], size = shrm_lamp_sizes[k], rule = shrm_lamp_rules[k];
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
}"""
"""Of brushed surfaces x is along the tangent, and not in the plane of the view."""


def with_lamps(
    functions: Sequence[str], lamps: LitDiscs, language: Language, takes_tangent: bool
) -> list[str]:
    """Write the functions of a map with those of the lamps beside it.

    Its ``shrm_radiance`` becomes ``shrm_map``, to which a new one adds the lamps. That of brushed
    surfaces, ``shrm_brushed_radiance``, takes the tangent besides.

    `functions` are those of the map. `takes_tangent` tells whether ``shrm_brushed_radiance`` is
    among them.

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
    lines += filled(_BRUSHED if is_brushed else _BOTH, {"BOTH": both})
    return [*lines, *BRUSHED_BY_TANGENT] if is_brushed else lines


def _lamps(lamps: LitDiscs, language: Language) -> list[str]:
    """Write ``shrm_lamps``, and what it uses."""
    discs, rules = lamps.discs, lamps.rules
    is_brushed = not lamps.brdf.isotropic
    radii = np.array([disc.radius for disc in discs])
    # What is beyond reach takes the first steps of the tables.
    few = [rules[0].few] if any(rule.reach < math.pi for rule in rules) else []
    steps = [*few, *sorted({rule.steps for rule in rules}.difference(few))]
    places = np.array([steps.index(rule.steps) for rule in rules])
    skipped = np.append(0, np.cumsum(steps))[places]
    reach = [math.cos(rule.reach) if rule.reach < math.pi else -2.0 for rule in rules]
    tables = {
        "shrm_lamp_whole": _one_by_one(chebyshev, steps),
        "shrm_lamp_nodes": _one_by_one(gauss_legendre, steps),
        "shrm_lamp_axes": np.array([disc.direction for disc in discs]),
        "shrm_lamp_sizes": np.stack([radii, np.sin(radii), skipped + MORE * places], axis=-1),
        "shrm_lamp_rules": np.stack([reach, [rule.steps for rule in rules], skipped], axis=-1),
        "shrm_lamp_lights": np.array([disc.radiance for disc in discs]),
    }
    functions = Functions(language)
    reflected = functions.total(lamps.brdf, "l", "vec3(dot(v, s), dot(v, t), dot(v, n))")
    cuts = cuts_horizon(lamps.brdf)
    if cuts:
        tables["shrm_lamp_cut"] = _one_by_one(sines, [count + MORE for count in steps])
    light = language.combined(
        ["shrm_sin(x) * shrm_cos(y)", "shrm_sin(y)", "shrm_cos(x) * shrm_cos(y)"], ["e", "f", "c"]
    )
    added = language.times(
        f"shrm_lamp(n, {'t, ' if is_brushed else ''}v, c, a, size, rule)", "shrm_lamp_lights[k]"
    )
    words = {
        "CUT": _CUT if cuts else "",
        "REACHED": _REACH if few else "",
        "FIRST": " past = 0;" if cuts else "",
        "FEW": str(rules[0].few),
        "MORE": str(MORE),
        "WIDTH": language.number(rules[0].width),
        "LEAST": language.number(LEAST_COSINE),
        "PI": language.number(math.pi),
        "BOOL": ", past = int(size.z), is_cut = 0" if cuts else "",
        "COUNT": str(len(discs)),
        "CENTER": central_direction(lamps.brdf.center, language),
        "LIGHT": light,
        "GROW": language.grow("total", language.scale("weight", reflected)),
        "RULE": "is_cut == 1 ? shrm_lamp_cut[past + i] : shrm_lamp_whole[skip + i]"
        if cuts
        else "shrm_lamp_whole[skip + i]",
        "LOWEST": "-size.y" if cuts else "-2.0",
        "ADD": language.grow("total", added),
        "SIDEvec3 v, vec3 c": "vec3 s, vec3 v, vec3 c" if is_brushed else "vec3 v, vec3 c",
        "SIDE": "vec3 t, " if is_brushed else "",
        "OWN": "" if is_brushed else "s = shrm_beside(n, v), ",
    }
    lines = [line for line in filled(_LAMPS, words) if line]
    arrays = [line for name, rows in tables.items() for line in language.colors(name, rows)]
    return [*arrays, *filled(_FRAME, words), *functions.lines, *lines]


def _one_by_one(make: Callable[[int], tuple[Array, Array]], counts: Sequence[int]) -> Array:
    """Return the nodes and weights of rules of some counts, one behind the other, (n, 3)."""
    nodes, weights = np.concatenate([make(count) for count in counts], axis=1)
    return np.stack([nodes, weights, 0 * nodes], axis=-1)
