"""SH exponentials as source code, with their coefficients in place.

The formulas are those of `shrm_cli.maps.she.exponential`.
"""

from functools import partial

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.maps.shader.language import Language
from shrm_cli.maps.shader.source import (
    TABLE_SIZE,
    Source,
    Table,
    Words,
    bilinear_table,
    central_direction,
    ggx_moments,
    harmonic_loop,
)
from shrm_cli.maps.she.exponential import SphericalHarmonicExponential


def source(made: SphericalHarmonicExponential, textures: str) -> Source:
    """Return what the shader of an SH exponential consists of; there are no cubes."""
    table = Table(
        (2, TABLE_SIZE, TABLE_SIZE),
        _moments,
        "shrm dfg --moments; layer 0 = base, layer 1 = tail, RGB = E, N, T",
        in_code=False,
    )
    return Source(
        "The light of a probe as GGX of any roughness reflects it: an SH exponential.",
        partial(_functions, made, table),
        table=table,
    )


def _moments() -> Array:
    """Return the moments without Fresnel's term and with its tail, shape (2, N, N, 3)."""
    return np.moveaxis(ggx_moments().reshape(TABLE_SIZE, TABLE_SIZE, 2, 3), 2, 0)


def _functions(made: SphericalHarmonicExponential, table: Table, words: Words) -> list[str]:
    """Write the coefficients, the light for one f0, and the radiance for a coloured f0."""
    speech = words.language
    is_paper = made.law == "paper"
    kind, own = ("float", "roughness") if is_paper else ("vec3", "base")
    coefficients = np.concatenate([made.p_coefficients, np.zeros((1, 3)), made.q_coefficients])
    lobe = _paper_lobe(speech) if is_paper else _lobe(speech)
    exponentials = ", ".join(f"exp(min(x.{each}, 80.0))" for each in "xyz")
    of_q, first = "s" if is_paper else "0.25 * s", (made.order_p + 1) ** 2
    return [
        *speech.colors("shrm_factors", coefficients),
        *bilinear_table(table, words),
        "/* The light for an f0 that is the same in all channels. */",
        f"vec3 shrm_grey(vec3 n, vec3 v, {kind} {own}, vec3 tail, float f0)",
        "{",
        *lobe,
        f"    h = {speech.scale('(1.0 / max(length(h), 1e-6))', 'h')};",
        *_series("d", "s", made.order_p, 0, not is_paper, speech),
        *_series("h", of_q, made.order_q, first, not is_paper, speech),
        # Larger exponents than 80 count as 80.
        f"    return {speech.scale('albedo', f'vec3({exponentials})')};",
        "}",
        "vec3 shrm_radiance(vec3 n, vec3 v, float roughness, vec3 f0)",
        "{",
        "    float facing = dot(n, v);",
        *([] if is_paper else ["    vec3 base = shrm_between(facing, roughness, 0);"]),
        "    vec3 tail = shrm_between(facing, roughness, 1);",
        f"    vec3 red = shrm_grey(n, v, {own}, tail, f0.x);",
        "    if (f0.x == f0.y && f0.y == f0.z) {",
        "        return red;",
        "    }",
        f"    return vec3(red.x, shrm_grey(n, v, {own}, tail, f0.y).y,",
        f"                shrm_grey(n, v, {own}, tail, f0.z).z);",
        "}",
    ]


def _lobe(speech: Language) -> list[str]:
    """Write directions, spread and albedo of GGX's lobe.

    Half precision has no number for the tail of a mirror that faces the viewer: its moments become
    0 one after the other, and a mean without length has no direction.
    """
    across = speech.minus(speech.scale("dot(n, v)", "n"), "v")
    mean = speech.combined(["lobe.y / lobe.x", "lobe.z / lobe.x"], ["n", across])
    return [
        f"    vec3 whole = {speech.combined(['f0', '(1.0 - f0)'], ['base', 'tail'])};",
        "    vec3 lobe = whole.y > 0.0 ? whole : base;",
        f"    vec3 mean = {mean};",
        "    float s = max(-log(length(mean)), 0.0), albedo = whole.x;",
        f"    vec3 d = {speech.scale('(1.0 / length(mean))', 'mean')}, "
        f"h = {speech.add('n', 'd')}, x = vec3(0.0, 0.0, 0.0);",
    ]


def _paper_lobe(speech: Language) -> list[str]:
    """Write directions, spread and albedo as they were published."""
    return [
        f"    vec3 d = {central_direction('reflection', speech)};",
        f"    vec3 h = {speech.add('n', 'd')}, x = vec3(0.0, 0.0, 0.0);",
        "    float s = roughness * roughness, albedo = f0 + (1.0 - f0) * tail.x;",
    ]


def _series(
    direction: str, spread: str, order: int, first: int, keeps_mean: bool, speech: Language
) -> list[str]:
    """Write what a factor adds to the exponents of the channels, x."""

    def add(index: str, value: str) -> list[str]:
        entry = f"shrm_factors[{first} + {index}]" if first else f"shrm_factors[{index}]"
        lines = [f"c = {speech.scale('fade', entry)};", speech.grow("x", speech.scale(value, "c"))]
        if keeps_mean:
            half = -1 / (8 * np.pi)
            factor = f"(l > 0 ? {speech.number(half)} : 0.0)"
            lines.append(speech.grow("x", speech.scale(factor, speech.times("c", "c"))))
        return [f"fade = exp(-0.5 * {spread} * float(l * (l + 1)));", *lines]

    block = harmonic_loop(order, direction, add)
    return ["    {", "    float fade;", "    vec3 c;", *block, "    }"]
