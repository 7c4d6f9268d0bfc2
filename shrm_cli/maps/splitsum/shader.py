"""Split sums as source code: two levels mixed, times a number from the environment-BRDF's table."""

import math
from collections.abc import Callable
from functools import partial

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.environment.material_albedo import albedo_table
from shrm_cli.maps.shader.language import Language
from shrm_cli.maps.shader.source import (
    TABLE_SIZE,
    Source,
    Table,
    Words,
    bilinear_table,
    central_direction,
    ggx_moments,
)
from shrm_cli.maps.splitsum.split_sum import SplitSum

_POSITIONS: dict[str, tuple[str, Callable[[float], float]]] = {
    "linear": ("roughness", lambda r: r),
    "filament": ("roughness * (2.0 - roughness)", lambda r: r * (2 - r)),
    "unreal": ("log(max(roughness, 1e-6))", math.log),
}
"""What grows by the same amount from each level to the next, in code and as a function."""
_ROWS = 64
"""Texels along an edge of the table of another BRDF than GGX, which takes seconds to integrate."""


def source(made: SplitSum, textures: str) -> Source:
    """Return what the shader of a split sum consists of; each level is a stack of one cube.

    The table of another BRDF than GGX is its directional albedo.
    """
    material, of, size, make = made.material, "GGX", TABLE_SIZE, _environment_brdf
    about = "shrm dfg; R = scale and G = bias of f0, N.V along x, roughness down"
    if material is not None:
        of, size, make = material.name, _ROWS, partial(_albedo, material)
        about = "shrm dfg --brdf; RGB = directional albedo, N.V along x, roughness down"
    table = Table((1, size, size), make, about, in_code=False)
    return Source(
        f"The light of a probe as {of} of any roughness reflects it: a split sum.",
        partial(_functions, made, table),
        [level[:, :, None] for level in made.levels],
        made.sampling,
        table,
    )


def _albedo(material: Brdf) -> Array:
    """Return the table of the directional albedo, shape (1, N, N, 3)."""
    return albedo_table(material, _ROWS)[None]


def _environment_brdf() -> Array:
    """Return the table of scale and bias, shape (1, N, N, 3)."""
    total, bias = ggx_moments()[..., 0], ggx_moments()[..., 3]
    return np.stack([total - bias, bias, np.zeros_like(bias)], axis=-1)[None]


def _functions(made: SplitSum, table: Table, words: Words) -> list[str]:
    """Write the look-up of the light, and the radiance; only GGX has an f0 for all surfaces."""
    speech = words.language
    looked_up, f0, lines = "shrm_between(dot(n, v), roughness, 0)", "", []
    if made.material is None:
        lines, f0 = [f"    vec3 dfg = {looked_up};"], ", vec3 f0"
        looked_up = speech.add(speech.scale("dfg.x", "f0"), "vec3(dfg.y, dfg.y, dfg.y)")
    return [
        *_level(made, words),
        "vec3 shrm_light(vec3 d, float roughness)",
        "{",
        *_mixture(made, speech),
        "}",
        *bilinear_table(table, words),
        f"vec3 shrm_radiance(vec3 n, vec3 v, float roughness{f0})",
        "{",
        f"    vec3 r = {central_direction(made.center, speech)};",
        *lines,
        f"    return {speech.times('shrm_light(r, roughness)', looked_up)};",
        "}",
    ]


def _level(made: SplitSum, words: Words) -> list[str]:
    """Write the function that looks up a level; beyond the last it is the last."""
    lines = ["vec3 shrm_level(vec3 d, int level)", "{"]
    *others, last = [
        f"return {words.cube(level, words.place(level, 'd'), '0')};"
        for level in range(len(made.levels))
    ]
    for level, look_up in enumerate(others or [last]):
        lines += [f"    if (level == {level}) {{", f"        {look_up}", "    }"]
    return [*lines, f"    {last}", "}"]


def _mixture(made: SplitSum, speech: Language) -> list[str]:
    """Write the choice of two levels, and their mixture; a single level is both."""
    position, function = _POSITIONS[made.mapping]
    starts = [speech.number(float(function(each))) for each in made.roughness]
    if len(starts) == 1:
        starts.append(speech.number(float(function(made.roughness[0])) + 1.0))
    lines = [
        f"    float x = {position}, low = {starts[0]}, high = {starts[1]};",
        "    int level = 0;",
    ]
    for level in range(1, len(starts) - 1):
        lines += [
            f"    if (x > {starts[level]}) {{",
            f"        level = {level};",
            f"        low = {starts[level]};",
            f"        high = {starts[level + 1]};",
            "    }",
        ]
    share = "min(max((x - low) / (high - low), 0.0), 1.0)"
    return [*lines, f"    return mix(shrm_level(d, level), shrm_level(d, level + 1), {share});"]
