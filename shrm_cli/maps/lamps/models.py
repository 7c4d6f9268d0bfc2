"""What BRDFs reflect of light from one direction, as source code: terms of sums, and layers.

The function of a BRDF takes light and view in the frame of the normal, and returns the transfer
function: the BRDF times the cosine of the light's angle. Layers call the functions of what lies
under them. What they tabulate over the cosine of light or view, the code has as it is: 64 colors,
linear between, so that it computes what the BRDF does.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Brdf, Color
from shrm_cli.brdf.sums import weighted_terms
from shrm_cli.brdf.vectors import GRAZING
from shrm_cli.errors import MapError
from shrm_cli.maps.shader.language import Language

if TYPE_CHECKING:  # a map has one BRDF, and all of them together take long to load
    from shrm_cli.brdf.layered.fuzzy import UnderFuzz
    from shrm_cli.brdf.layered.parts.dielectric import CoatLobe, ThroughCoat
    from shrm_cli.brdf.layered.parts.interior import UnderCoat
    from shrm_cli.brdf.layered.parts.opaque import BorderLobe, MetalLobe, UnderBorder
    from shrm_cli.brdf.layered.parts.table import Table
    from shrm_cli.brdf.models.ashikhmin_shirley import AshikhminShirley
    from shrm_cli.brdf.models.blinn_phong import BlinnPhong
    from shrm_cli.brdf.models.charlie import Charlie
    from shrm_cli.brdf.models.cook_torrance import CookTorrance
    from shrm_cli.brdf.models.disney_diffuse import DisneyDiffuse
    from shrm_cli.brdf.models.eon import Eon
    from shrm_cli.brdf.models.ggx import Ggx
    from shrm_cli.brdf.models.lambertian import Lambertian
    from shrm_cli.brdf.models.microfacet import Microfacet
    from shrm_cli.brdf.models.oren_nayar import OrenNayar
    from shrm_cli.brdf.models.phong import Phong
    from shrm_cli.brdf.models.ward import Ward

_SUM = """\
    float x = l.x + v.x, y = l.y + v.y, z = l.z + v.z;
    float size = max(sqrt(x * x + y * y + z * z), 1e-5);"""
"""The half vector before it is normalized."""
_SINE = f"""{_SUM}
    float sine2 = (x * x + y * y) / (size * size);"""
"""The squared sine of the half vector's angle to the normal."""
_HALF = f"""{_SINE}
    float up = z / size;"""
"""That, and the cosine of the angle."""
_COSINES = "    float lz = max(l.z, 1e-5), vz = max(v.z, 1e-5);"
_ABOVE = "    float above = max(l.z, 0.0) * min(max(1e30 * v.z, 0.0), 1.0);"
"""The light's cosine, or 0 where light or view is below the surface: browsers that have no graphics
card take minutes to compile functions with branches."""
_TANGENTIAL = "(l.x * v.x + l.y * v.y)"
_REFRACTED = """\
    float z = min(max(d.z, 0.0), 1.0);
    return vec3(d.x / ior, d.y / ior, sqrt(ior * ior - 1.0 + z * z) / ior);"""
_SWERVE = """\
    float z = min(max(d.z, 0.0), 1.0);
    float turn = z - sqrt(max(1.0 - ior * ior * (1.0 - z * z), 0.0)) / ior;
    return turn * turn;"""
"""`swerve`, squared."""


class Functions:
    """The functions of BRDFs: each is written once, before those that call it."""

    def __init__(self, language: Language) -> None:
        self.language = language
        self.lines: list[str] = []
        self._names: dict[object, str] = {}

    def total(self, brdf: Brdf, light: str, view: str) -> str:
        """Write the functions of the terms of a BRDF, and return the call of their sum.

        Raises MapError if there is no code of a term.
        """
        terms = weighted_terms(brdf)
        refuse_unknown(brdf)
        calls = [self.call(term, light, view) for _, term in terms]
        weights = [self.language.number(weight) for weight, _ in terms]
        found = self.language.combined(weights, calls)
        return found if self.language.is_c else f"({found})"

    def call(self, brdf: Brdf, light: str, view: str) -> str:
        """Return the call of a BRDF's function, for a light and a view."""
        takes_view = _kind(brdf) != "Lambertian"
        header = f"vec3 shrm_brdf{{}}(vec3 l{', vec3 v' if takes_view else ''})"
        name = self.named(header, brdf, lambda: _WRITERS[_kind(brdf)](brdf, self))
        return f"{name}({light}, {view})" if takes_view else f"{name}({light})"

    def reflectance(self, lobe: Ggx | AshikhminShirley | CookTorrance) -> str:
        """Return the call of a facet's reflectance, where `size` is twice the cosine."""
        of: Callable[..., list[str]] = _REFLECTANCES[_kind(lobe)]
        if getattr(lobe, "film", None):
            of = _film
        header, key = "vec3 shrm_reflectance{}(float cosine)", ("reflectance", lobe)
        name = self.named(header, key, lambda: of(lobe, self))
        return f"{name}(min(0.5 * size, 1.0))"

    def fifth(self) -> str:
        """Return the name of the function of fifth powers."""
        header = "float shrm_fifth(float x)"
        return self.named(header, header, lambda: ["    return x * x * x * x * x;"])

    def gain(self, table: Table, direction: str) -> str:
        """Return the call of what a layer tabulates, for a direction."""
        header = "vec3 shrm_gain{}(float cosine)"
        name = self.named(header, table, lambda: _table(table, self))
        return f"{name}({direction}.z)"

    def array(self, rows: Array) -> str:
        """Write a constant array of colors, and return its name."""
        name = f"shrm_colors{len(self._names)}"
        self._names[name] = name
        self.lines += self.language.colors(name, rows)
        return name

    def named(self, header: str, key: object, body: Callable[[], Sequence[str]]) -> str:
        """Return the name of a function, which is written unless it is there.

        `header` has braces where the number is that tells functions of a kind apart. `key` is what
        it is of. `body` returns its lines, and may write the functions that it calls.
        """
        if key not in self._names:
            lines = body()
            written = header.format(len(self._names))
            self.lines += [written, "{", *lines, "}"]
            self._names[key] = written.partition("(")[0].split()[-1]
        return self._names[key]


def has_code(brdf: Brdf) -> bool:
    """Tell whether there is code of what a BRDF reflects of lamps."""
    return all(_is_known(term) for _, term in weighted_terms(brdf))


def refuse_unknown(brdf: Brdf) -> None:
    """Raise MapError if there is no code of a term of a BRDF."""
    for _, term in weighted_terms(brdf):
        if not _is_known(term):
            known = ", ".join(re.sub("(?<!^)(?=[A-Z])", "-", kind).lower() for kind in _MODELS)
            raise MapError(
                f"no code for the lamps beside the map: there is none of {term.name}, only of "
                f"{known}, their sums and layers; the map's own code is had without `sun`"
            )


def _is_known(brdf: Brdf) -> bool:
    """Tell it of a term, and of all that lies under it."""
    below = getattr(brdf, "term", None)  # what lies under a layer
    return _kind(brdf) in _WRITERS and (below is None or _is_known(below))


def _kind(brdf: Brdf) -> str:
    """Return the name of the class of a BRDF, if it is one of shrm's own; else nothing."""
    own = type(brdf)
    return own.__name__ if own.__module__.startswith("shrm_cli.") else ""


def _rgb(color: Color, language: Language) -> str:
    return f"vec3({', '.join(map(language.number, color))})"


# ---- models --------------------------------------------------------------------------------------


def _lambertian(brdf: Lambertian, functions: Functions) -> list[str]:
    red, green, blue = (each / math.pi for each in brdf.color("albedo"))
    color = _rgb((red, green, blue), functions.language)
    return [f"    return {functions.language.scale('max(l.z, 0.0)', color)};"]


def _ggx(brdf: Ggx, functions: Functions) -> list[str]:
    number = functions.language.number
    squares = [f"    float a = {number(x**2)}, b = {number(y**2)};" for x, y in [brdf.alphas]]
    return _facets(squares, brdf, functions)


def _through_coat(brdf: ThroughCoat, functions: Functions) -> list[str]:
    number = functions.language.number
    factor, ior = brdf.factor, number(brdf.ior)
    header = "float shrm_swerve(vec3 d, float ior)"
    name = functions.named(header, header, lambda: _SWERVE.split("\n"))
    turned = f"{name}(l, {ior}) + {name}(v, {ior}) + {number(factor - 1)}"
    own = [f"min({number(factor * each**2)} + added, 1.0)" for each in brdf.whole.alphas]
    lines = [f"    float added = {number(brdf.coat)} * ({turned}), a = {own[0]}, b = {own[1]};"]
    return _facets(lines, brdf.whole, functions)


def _facets(squares: Sequence[str], lobe: Ggx, functions: Functions) -> list[str]:
    """Write what GGX's facets reflect, whose squares of alphas are a and b."""
    masking = [f"sqrt(a * {w}.x * {w}.x + b * {w}.y * {w}.y + {w}z * {w}z)" for w in "vl"]
    language = functions.language
    return [
        *_SUM.split("\n"),
        *squares,
        _COSINES,
        "    float d = (x * x / a + y * y / b + z * z) / (size * size);",
        f"    float both = lz * {masking[0]} + vz * {masking[1]};",
        _ABOVE,
        f"    float value = above / ({language.number(2 * math.pi)} * sqrt(a * b) * d * d * both);",
        f"    return {language.scale('value', functions.reflectance(lobe))};",
    ]


def _ward(brdf: Ward, functions: Functions) -> list[str]:
    language, number = functions.language, functions.language.number
    a, b = (brdf.number(each) for each in ("ax", "ay"))
    return [
        "    float x = l.x + v.x, y = l.y + v.y;",
        f"    float z = max(l.z + v.z, {number(2 * GRAZING)}), z2 = z * z;",
        f"    float slope = (x * x * {number(a**-2)} + y * y * {number(b**-2)}) / z2;",
        _ABOVE,
        f"    float value = {number(1 / (math.pi * a * b))} * exp(-slope) * above;",
        "    value = value * ((x * x + y * y + z2) / z2) / z2;",
        f"    return {language.scale('value', _rgb(brdf.color('color'), language))};",
    ]


def _cook_torrance(brdf: CookTorrance, functions: Functions) -> list[str]:
    language, number = functions.language, functions.language.number
    m2, least = brdf.number("roughness") ** 2, number(GRAZING)
    return [
        *_HALF.split("\n"),
        _COSINES,
        f"    float z2 = max(up, {least}) * max(up, {least});",
        _ABOVE,
        f"    float value = {number(0.25 / (math.pi * m2))} * exp({number(-1 / m2)} * sine2 / z2);",
        f"    float cavity = 2.0 * up / (max(0.5 * size, {least}) * max(lz, vz));",
        "    value = min(cavity, 1.0 / (lz * vz)) * above * value / (z2 * z2);",
        f"    return {language.scale('value', functions.reflectance(brdf))};",
    ]


def _ashikhmin_shirley(brdf: AshikhminShirley, functions: Functions) -> list[str]:
    language, number = functions.language, functions.language.number
    nu, nv = (brdf.number(each) for each in ("nu", "nv"))
    scale = math.sqrt((nu + 1) * (nv + 1)) / (4 * math.pi)
    lines = [
        *_SINE.split("\n"),
        _COSINES,
        _ABOVE,
        # It is log(up) / sine2, of which single precision leaves nothing near the normal.
        "    float rate = sine2 > 0.01 ? 0.5 * log(max(1.0 - sine2, 1e-7)) / sine2"
        " : -0.5 - sine2 * (0.25 + sine2 / 6.0);",
        f"    float power = ({number(nu)} * x * x + {number(nv)} * y * y) / (size * size) * rate;",
        f"    float value = {number(scale)} * exp(power) * above / (size * max(lz, vz));",
    ]
    lobe = language.scale("value", functions.reflectance(brdf))
    colors = zip(brdf.color("diffuse"), brdf.color("specular"), strict=True)
    red, green, blue = (28 / (23 * math.pi) * base * (1 - top) for base, top in colors)
    if max(red, green, blue) > 0:
        ends = [f"(1.0 - {functions.fifth()}(1.0 - 0.5 * {each}z))" for each in "lv"]
        lines.append(f"    float lower = {ends[0]} * {ends[1]} * above;")
        lobe = language.add(lobe, language.scale("lower", _rgb((red, green, blue), language)))
    return [*lines, f"    return {lobe};"]


def _blinn_phong(brdf: BlinnPhong, functions: Functions) -> list[str]:
    from shrm_cli.brdf.models.blinn_phong import normalization

    language, n = functions.language, brdf.number("exponent")
    factor, half = language.number(normalization(n)), language.number(n / 2)
    return [
        *_HALF.split("\n"),
        f"    float value = {factor} * l.z * exp({half} * log(max(1.0 - sine2, 1e-7)));",
        "    if (l.z <= 0.0 || v.z <= 0.0 || up <= 0.0) {",
        "        value = 0.0;",
        "    }",
        f"    return {language.scale('value', _rgb(brdf.color('color'), language))};",
    ]


def _phong(brdf: Phong, functions: Functions) -> list[str]:
    number, n = functions.language.number, brdf.number("exponent")
    factor = number((n + 1) / (2 * math.pi))
    lobe = f"{factor} * exp({number(n)} * log(min(cosine, 1.0)))"
    return [
        "    float cosine = l.z * v.z - l.x * v.x - l.y * v.y;",
        f"    float value = cosine > 1e-30 ? {lobe} : 0.0;",
        "    return vec3(value, value, value);",
    ]


def _microfacet(brdf: Microfacet, functions: Functions) -> list[str]:
    number, sigma = functions.language.number, brdf.number("sigma")
    factor = number(1 / (4 * math.pi * sigma**2))
    return [
        *_HALF.split("\n"),
        f"    float angle = atan(sqrt(sine2), up) / {number(sigma)};",
        f"    float value = l.z > 0.0 ? {factor} * exp(-angle * angle) : 0.0;",
        "    return vec3(value, value, value);",
    ]


def _oren_nayar(brdf: OrenNayar, functions: Functions) -> list[str]:
    language = functions.language
    first, second = (language.number(each / math.pi) for each in brdf.factors)
    return [
        f"    float swing = max({_TANGENTIAL}, 0.0) / max(max(l.z, abs(v.z)), 1e-5);",
        f"    float value = ({first} + {second} * swing) * max(l.z, 0.0);",
        f"    return {language.scale('value', _rgb(brdf.color('albedo'), language))};",
    ]


def _disney_diffuse(brdf: DisneyDiffuse, functions: Functions) -> list[str]:
    language, fifth = functions.language, functions.fifth()
    ends = [f"(1.0 + g * {fifth}(1.0 - {each}))" for each in ("lz", "vz")]
    pi, roughness = map(language.number, (math.pi, brdf.number("roughness")))
    return [
        "    float lz = min(max(l.z, 0.0), 1.0), vz = min(abs(v.z), 1.0);",
        f"    float g = {roughness} * (1.0 + lz * vz + {_TANGENTIAL}) - 0.5;",
        f"    float value = {ends[0]} * {ends[1]} * max(l.z, 0.0) / {pi};",
        f"    return {language.scale('value', _rgb(brdf.color('color'), language))};",
    ]


def _eon(brdf: Eon, functions: Functions) -> list[str]:
    language, number = functions.language, functions.language.number
    roughness = brdf.number("roughness")
    # One less the albedo of walls that light leaves at once.
    lost = f"""\
    float s = sqrt(max(1.0 - z * z, 0.0)), angle = atan(s, z);
    float bend = s * (angle - s * z) + 2.0 / 3.0 * s * (z * (1.0 + s + s * s) / (1.0 + s) - 1.0);
    return 1.0 - {number(brdf.scale)} * (1.0 + {number(roughness / math.pi)} * bend);"""
    name = functions.named("float shrm_lost{}(float z)", ("lost", brdf), lambda: lost.split("\n"))
    once = f"{number(brdf.scale / math.pi)} * (1.0 + {number(roughness)} * swing)"
    colors = [_rgb(each, language) for each in (brdf.color("albedo"), brdf.again)]
    return [
        "    float lit = max(abs(l.z), 1e-5), seen = max(abs(v.z), 1e-5);",
        f"    float swing = {_TANGENTIAL}, once, again;",
        "    swing = min(swing, 0.0) + max(swing, 0.0) / max(lit, seen);",
        f"    once = {once} * max(l.z, 0.0);",
        f"    again = {name}(lit) * {name}(seen) * max(l.z, 0.0);",
        f"    return {language.combined(['once', 'again'], colors)};",
    ]


def _charlie(brdf: Charlie, functions: Functions) -> list[str]:
    language, number = functions.language, functions.language.number
    rate = 1 / brdf.number("roughness")
    hidden = "lz + vz - lz * vz"
    if brdf.values.get("visibility") != "neubelt":
        key = "hidden", brdf
        name = functions.named("float shrm_hidden{}(float z)", key, lambda: _hidden(brdf, number))
        hidden = f"lz * vz * (1.0 + {name}(lz) + {name}(vz))"
    power = f"exp({number(rate / 2)} * log(min(max(sine2, 1e-30), 1.0)))"
    return [
        *_SINE.split("\n"),
        _COSINES,
        _ABOVE,
        f"    float value = {number((2 + rate) / (8 * math.pi))} * {power} * above / ({hidden});",
        f"    return {language.scale('value', _rgb(brdf.color('color'), language))};",
    ]


def _hidden(brdf: Charlie, number: Callable[[float], str]) -> list[str]:
    """Write how much fibres hide: Lambda of Charlie."""
    a, b, c, d, e = brdf.fit
    middle = number(2 * (a / (1 + b * 0.5**c) + d * 0.5 + e))
    one, two, three, four, five = map(number, brdf.fit)
    bent = f"{one} / (1.0 + {two} * exp({three} * log(max(x, 1e-30))))"
    return [
        "    float x = min(z, 1.0 - z), side = min(max(1e30 * (0.5 - z), -1.0), 1.0);",
        f"    float value = {bent} + {four} * x + {five};",
        f"    return exp(side * value + (0.5 - 0.5 * side) * {middle});",
    ]


# ---- layers --------------------------------------------------------------------------------------


def _under_coat(brdf: UnderCoat, functions: Functions) -> list[str]:
    language, ior = functions.language, functions.language.number(brdf.ior)
    header = "vec3 shrm_refracted(vec3 d, float ior)"
    name = functions.named(header, header, lambda: _REFRACTED.split("\n"))
    lines = [f"    vec3 inner = {name}(l, {ior}), total = vec3(0.0, 0.0, 0.0);", _ABOVE]
    for lobe, gain in brdf.lobes:
        value = functions.call(lobe, "inner", f"{name}(v, {ior})")
        lines.append(f"    {language.grow('total', _passed(value, gain, functions))}")
    return [*lines, f"    return {language.scale('(above / max(inner.z, 1e-5))', 'total')};"]


def _under_border(brdf: UnderBorder, functions: Functions) -> list[str]:
    value = functions.call(brdf.term, "l", "v")
    return [f"    return {_passed(value, brdf.passing, functions)};"]


def _passed(value: str, gain: Table, functions: Functions) -> str:
    """Write a value that is multiplied by a gain of the light and of the view."""
    for direction in "lv":
        value = functions.language.times(functions.gain(gain, direction), value)
    return value


def _under_fuzz(brdf: UnderFuzz, functions: Functions) -> list[str]:
    light, view = (f"{functions.gain(brdf.passing, each)}.x" for each in "lv")
    value = functions.call(brdf.term, "l", "v")
    return [f"    return {functions.language.scale(f'min({light}, {view})', value)};"]


def _table(table: Table, functions: Functions) -> list[str]:
    """Write what is linear between cosines that are squares of even steps."""
    last, name = len(table.values) - 1, functions.array(table.values)
    return [
        f"    float square = {last**2}.0 * min(max(cosine, 0.0), 1.0);",
        f"    int k = int(min(sqrt(square), {last - 1}.0));",
        "    float share = (square - float(k * k)) / float(2 * k + 1);",
        f"    return mix({name}[k], {name}[k + 1], share);",
    ]


# ---- reflectances of facets ----------------------------------------------------------------------


def _schlick(color: Color, functions: Functions) -> list[str]:
    number = functions.language.number
    channels = [f"{number(f0)} + {number(1 - f0)} * rest" for f0 in color]
    return [_FIFTH, f"    return vec3({', '.join(channels)});"]


def _metal(lobe: MetalLobe, functions: Functions) -> list[str]:
    number = functions.language.number
    channels = [
        f"max({number(f0)} + {number(1 - f0)} * rest - {number(darker)} * edge, 0.0)"
        for f0, darker in zip(lobe.color("f0"), lobe.darkening, strict=True)
    ]
    edge = "    float edge = cosine * less * rest;"
    return [_FIFTH, edge, f"    return vec3({', '.join(channels)});"]


def _fresnel(lobe: BorderLobe | CoatLobe, functions: Functions) -> list[str]:
    language, square = functions.language, lobe.number("ior") ** 2
    tint = lobe.color("tint") if _kind(lobe) == "BorderLobe" else (1.0, 1.0, 1.0)
    n2, rest = language.number(square), language.number(square - 1)
    return [
        f"    float deep = sqrt({rest} + cosine * cosine);",
        "    float across = (cosine - deep) / (cosine + deep);",
        f"    float along = ({n2} * cosine - deep) / ({n2} * cosine + deep);",
        "    float value = 0.5 * (across * across + along * along);",
        f"    return {language.scale('value', _rgb(tint, language))};",
    ]


def _film(lobe: Ggx, functions: Functions) -> list[str]:
    """Write what is linear between even steps of the cosine."""
    from shrm_cli.brdf.film import COSINES

    number, name = functions.language.number, functions.array(lobe.reflectance(COSINES))
    first, step = COSINES[0], COSINES[1] - COSINES[0]
    return [
        f"    float at = max((cosine - {number(first)}) / {number(step)}, 0.0);",
        f"    int k = int(min(at, {len(COSINES) - 2}.0));",
        f"    return mix({name}[k], {name}[k + 1], at - float(k));",
    ]


_FIFTH = """\
    float less = 1.0 - cosine, rest = less * less * less * less * less;"""
_REFLECTANCES: dict[str, Callable[..., list[str]]] = {
    "Ggx": lambda lobe, functions: _schlick(lobe.color("f0"), functions),
    "AshikhminShirley": lambda lobe, functions: _schlick(lobe.color("specular"), functions),
    "CookTorrance": lambda lobe, functions: _schlick(lobe.color("f0"), functions),
    "MetalLobe": _metal,
    "BorderLobe": _fresnel,
    "CoatLobe": _fresnel,
}
_MODELS: dict[str, Callable[..., list[str]]] = {
    "Lambertian": _lambertian,
    "Ggx": _ggx,
    "Ward": _ward,
    "CookTorrance": _cook_torrance,
    "AshikhminShirley": _ashikhmin_shirley,
    "BlinnPhong": _blinn_phong,
    "Phong": _phong,
    "Microfacet": _microfacet,
    "Eon": _eon,
    "OrenNayar": _oren_nayar,
    "DisneyDiffuse": _disney_diffuse,
    "Charlie": _charlie,
}
_WRITERS: dict[str, Callable[..., list[str]]] = {
    **_MODELS,
    "MetalLobe": _ggx,
    "BorderLobe": _ggx,
    "CoatLobe": _ggx,
    "ThroughCoat": _through_coat,
    "UnderCoat": _under_coat,
    "UnderBorder": _under_border,
    "UnderFuzz": _under_fuzz,
    "LobeTable": lambda table, functions: table.code(functions.language),
}
"""The models, the terms of layers and the tables that there is code of. A class that is derived
from one may be another BRDF."""
