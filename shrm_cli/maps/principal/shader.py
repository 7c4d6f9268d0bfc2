"""Source code that looks a map of principal functions up, with its tables in place."""

from collections.abc import Sequence

import numpy as np
from numpy.polynomial import legendre, polynomial
from numpy.typing import NDArray

from shrm_cli.errors import MapError
from shrm_cli.maps.irradiance.shader import harmless
from shrm_cli.maps.principal.principal import Lobe, PrincipalMap, plane_rule

Array = NDArray[np.floating]

LANGUAGES = ("glsl", "hlsl")

# What differs between the languages, which otherwise share the code below.
_WORDS = {
    "glsl": {
        "vec3": "vec3",
        "const": "const",
        "head": "/* GLSL 4.20 */\nuniform samplerCubeArray shrm_cubes;",
        "texture": "texture(shrm_cubes, vec4(c, float({layer}))).rgb",
        "atan": "atan",
        "mix": "mix",
    },
    "hlsl": {
        "vec3": "float3",
        "const": "static const",
        "head": "/* HLSL, shader model 5 */\nTextureCubeArray shrm_cubes;\n"
        "SamplerState shrm_sampler;",
        "texture": "shrm_cubes.SampleLevel(shrm_sampler, float4(c, float({layer})), 0).rgb",
        "atan": "atan2",
        "mix": "lerp",
    },
}


def look_up_code(made: PrincipalMap, language: str) -> str:
    """Write the function ``shrm_radiance(n, v)`` for a shader.

    The cubes of all lobes are the layers of an array of cube maps, in the order of their channels.
    Faces are to be turned as the graphics API wants them (`shrm convert --orientation gl`).

    Parameters
    ----------
    made : PrincipalMap
    language : {"glsl", "hlsl"}

    Returns
    -------
    str
        The code; its last line ends with a newline too.

    Raises
    ------
    MapError
        If the language is unknown, or a lobe is about the tangent, which shaders have no word for.
    """
    if language not in LANGUAGES:
        raise MapError(f"shader language {language!r}: take one of {', '.join(LANGUAGES)}")
    if any(lobe.center == "tangent" for lobe in made.lobes):
        raise MapError("a map about the tangent has no shader; look it up by shrm render")
    words = _WORDS[language]
    lines = [*_comment(made), words["head"]]
    for degree in sorted({p for lobe in made.lobes for p in lobe.degrees}):
        lines += _band(degree, words)
    calls, layer = [], 0
    for number, lobe in enumerate(made.lobes):
        lines += _lobe(number, lobe, layer, words)
        calls.append(f"shrm_lobe{number}(n, v)")
        layer += lobe.cubes.shape[2]
    vec3 = words["vec3"]
    lines += [
        "/* Reflected radiance for the unit normal n and the unit direction v to the viewer. */",
        f"{vec3} shrm_radiance({vec3} n, {vec3} v) {{ return {' + '.join(calls)}; }}",
    ]
    return "\n".join(lines) + "\n"


def _comment(made: PrincipalMap) -> list[str]:
    """Write the comment that says what the code is for."""
    return [
        "/* Light of a probe reflected by a BRDF, by the BRDF's own functions of the view.",
        " * World axes: right-handed, +Y up; linear RGB radiance.",
        f" * Probe: {harmless(made.info.probe) or 'unknown'}",
        f" * Cubes: {made.cube_count}, the layers of shrm_cubes, in the order of the channels. */",
    ]


def _band(degree: int, words: dict[str, str]) -> list[str]:
    """Write the function of all real harmonics of one degree."""
    count = 2 * degree + 1
    lines = [
        f"void shrm_band{degree}({words['vec3']} d, out float y[{count}])",
        "{",
        "    float a0 = 1.0, b0 = 0.0;",
    ]
    for m in range(1, degree + 1):
        lines.append(
            f"    float a{m} = d.x * a{m - 1} - d.y * b{m - 1}, "
            f"b{m} = d.x * b{m - 1} + d.y * a{m - 1};"
        )
    for m in range(degree + 1):
        value = _horner(_profile(degree, m))
        lines.append(f"    float p{m} = {value};")
        lines.append(f"    y[{degree + m}] = p{m} * a{m};")
        if m:
            lines.append(f"    y[{degree - m}] = p{m} * b{m};")
    return [*lines, "}"]


def _profile(degree: int, m: int) -> Array:
    """Return the polynomial in z of a real harmonic, without its part in x and y."""
    series = legendre.leg2poly([0.0] * degree + [1.0])
    factor = (2 * degree + 1) / (4 * np.pi) * (2 if m else 1)
    for k in range(degree - m + 1, degree + m + 1):
        factor /= k
    return np.asarray(np.sqrt(factor) * polynomial.polyder(series, m))


def _horner(coefficients: Array) -> str:
    """Write a polynomial in d.z; every other coefficient is zero."""
    text = ""
    for value in coefficients[::-1]:
        text = f"({text}) * d.z + {_number(value)}" if text else _number(value)
    return text


def _number(value: float) -> str:
    """Write a number with a decimal point, as both languages want it."""
    text = f"{value:.9g}"
    return text if any(c in text for c in ".e") else f"{text}.0"


def _colors(rows: Array, words: dict[str, str]) -> str:
    """Write colours as constructors of vectors, separated by commas."""
    inside = (", ".join(_number(x) for x in row) for row in rows)
    return ", ".join(f"{words['vec3']}({each})" for each in inside)


def _table(kind: str, name: str, values: Sequence[str], count: int) -> list[str]:
    return [f"{kind} {name}[{count}] = {{", *(f"    {each}," for each in values[:-1]),
            f"    {values[-1]}", "};"]  # fmt: skip


def _lobe(number: int, lobe: Lobe, layer: int, words: dict[str, str]) -> list[str]:
    """Write the table and the function of a lobe."""
    vec3, name = words["vec3"], f"shrm_lobe{number}"
    functions = lobe.functions if lobe.albedo is None else lobe.functions * lobe.albedo
    count, entries = functions.shape[:2]
    rows = [_colors(each, words) for each in functions]
    lines = _table(f"{words['const']} {vec3}", f"{name}_functions", rows, count * entries)
    is_mirror = lobe.center == "reflection"
    lines += [
        f"{vec3} {name}({vec3} n, {vec3} v)",
        "{",
        f"    {vec3} c = {'2.0 * dot(n, v) * n - v' if is_mirror else 'n'};",
        f"    {vec3} beside = {'n' if is_mirror else 'v'};",
        f"    {vec3} across = beside - dot(beside, c) * c;",
        "    across = across / max(length(across), 1e-6);",
        f"    float angle = 2.0 * {words['atan']}(length(v - c), length(v + c));",
        f"    float position = clamp(angle * {_number((entries - 1) / lobe.span)}, 0.0, "
        f"{_number(float(entries - 1))});",
        f"    int entry = min(int(position), {entries - 2});",
        "    float part = position - float(entry);",
        f"    {vec3} sum = {vec3}(0.0, 0.0, 0.0);",
    ]
    cube = first = 0
    for degree in lobe.degrees:
        lines += _bundle(name, degree, layer + cube, first * entries, entries, words)
        cube, first = cube + 2 * degree + 1, first + degree + 1
    return [*lines, "    return sum;", "}"]


def _bundle(
    name: str, degree: int, layer: int, start: int, entries: int, words: dict[str, str]
) -> list[str]:
    """Write what one bundle adds to the sum."""
    vec3, mix = words["vec3"], words["mix"]
    angles, inverse = plane_rule(degree)
    count = 2 * degree + 1
    lines = ["    {", f"        float y[{count}];", f"        {vec3} m[{count}];"]
    lines += [f"        m[{k}] = {words['texture'].format(layer=layer + k)};" for k in range(count)]
    lines += [f"        {vec3} h[{degree + 1}];"]
    for j, angle in enumerate(angles):
        direction = f"{_number(np.cos(angle))} * c + {_number(np.sin(angle))} * across"
        terms = " + ".join(f"y[{k}] * m[{k}]" for k in range(count))
        lines += [f"        shrm_band{degree}({direction}, y);", f"        h[{j}] = {terms};"]
    for q in range(degree + 1):
        order = " + ".join(f"{_number(inverse[q, j])} * h[{j}]" for j in range(degree + 1))
        at = start + q * entries
        low, high = (f"{name}_functions[entry + {at + k}]" for k in (0, 1))
        lines.append(f"        sum += ({order}) * {mix}({low}, {high}, part);")
    return [*lines, "    }"]
