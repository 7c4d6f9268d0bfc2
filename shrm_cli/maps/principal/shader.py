"""Maps of principal functions as source code: cubes times the BRDF's own functions of the view.

The light of a bundle of degree p is ``sum_q f_q sum_j inverse[q, j] sum_k y_k(d_j) m_k``: its cubes
m_k, the harmonics y_k of directions d_j in the plane of the view, and the functions f_q, in the
words of `about_center.plane_rule`. The code sums over j first, ``sum_k m_k sum_j g_j y_k(d_j)``, so
that it looks up each cube once and needs no arrays, which GPUs keep in slow memory. The table holds
the ``g_j = sum_q inverse[q, j] f_q``, which are functions of the angle of the view as the f_q are.
All is in loops over what the table says, because compilers take seconds over 50 cubes that are
written out, and much longer on a busy machine.
"""

from collections.abc import Sequence
from functools import partial

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.maps.principal import brushed_shader
from shrm_cli.maps.principal.about_center import plane_rule
from shrm_cli.maps.principal.brushed import BrushedLobe
from shrm_cli.maps.principal.principal import Lobe, PrincipalMap
from shrm_cli.maps.shader.harmonics import pair_function
from shrm_cli.maps.shader.source import Source, Table, Words, central_direction, tangent_function


def source(made: PrincipalMap, textures: str) -> Source:
    """Return what the shader of a map consists of; the cubes of each lobe are a stack."""
    entries = max(lobe.functions.shape[-2] for lobe in made.lobes)
    rows = sum(map(_rows, made.lobes))
    layers = max(
        brushed_shader.layers(lobe) if isinstance(lobe, BrushedLobe) else 1 for lobe in made.lobes
    )
    return Source(
        "The light of a probe as a BRDF reflects it, by the BRDF's own functions of the view.",
        partial(_functions, made.lobes, entries),
        [lobe.cubes for lobe in made.lobes],
        made.sampling,
        Table(
            (layers, rows, entries + 1),
            partial(_numbers, made.lobes, (layers, rows, entries)),
            "a function of the angle of the view in each row, then what it is for",
            in_code=layers == 1,
        ),
        takes_tangent=made.is_brushed,
    )


def _rows(lobe: Lobe) -> int:
    return brushed_shader.rows(lobe) if isinstance(lobe, BrushedLobe) else len(lobe.functions)


def _numbers(lobes: Sequence[Lobe], shape: tuple[int, int, int]) -> Array:
    """Return the rows of all lobes, one below the other, shape (layers, rows, entries + 1, 3).

    A row is a function g_j, times the albedo. Its last texel is the tangent of half the angle
    j, and the degree p of the bundle, which has p + 1 rows.
    """
    layers, rows, entries = shape
    whole = np.zeros((layers, rows, entries + 1, 3))
    result, row = whole[0], 0
    for lobe in lobes:
        if isinstance(lobe, BrushedLobe):
            weights, about = brushed_shader.numbers(lobe)
            place = slice(row, row + len(about))
            whole[: len(weights), place, : weights.shape[2]] = weights
            result[place, entries] = about
            row = place.stop
            continue
        functions = lobe.functions if lobe.albedo is None else lobe.functions * lobe.albedo
        first = 0
        for degree in lobe.degrees:
            angles, inverse = plane_rule(degree)
            place, bundle = slice(row, row + degree + 1), functions[first : first + degree + 1]
            result[place, : functions.shape[1]] = np.einsum("qj,qec->jec", inverse, bundle)
            result[place, entries, 0] = np.tan(angles / 2)
            result[place, entries, 1] = degree
            row, first = row + degree + 1, first + degree + 1
    return whole


def _functions(lobes: Sequence[Lobe], entries: int, words: Words) -> list[str]:
    is_brushed = any(lobe.is_brushed for lobe in lobes)
    centers = ["tangent"] if is_brushed else [lobe.center for lobe in lobes]
    lines = [*tangent_function(centers), *pair_function()]
    lines += brushed_shader.cross_function() if is_brushed else []
    total, row = "", 0
    for number, lobe in enumerate(lobes):
        if isinstance(lobe, BrushedLobe):
            lines += brushed_shader.code(number, lobe, row, entries, words)
        else:
            lines += _lobe(number, lobe, row, entries, words)
        call = f"shrm_lobe{number}({'n, t, v' if lobe.is_brushed else 'n, v'})"
        total = words.language.add(total, call) if total else call
        row += _rows(lobe)
    if not is_brushed:
        return [*lines, f"vec3 shrm_radiance(vec3 n, vec3 v) {{ return {total}; }}"]
    return [
        *lines,
        f"vec3 shrm_brushed_radiance(vec3 n, vec3 t, vec3 v) {{ return {total}; }}",
        "vec3 shrm_radiance(vec3 n, vec3 v)",
        "{",
        "    return shrm_brushed_radiance(n, shrm_tangent(n), v);",
        "}",
    ]


def _lobe(number: int, lobe: Lobe, row: int, about: int, words: Words) -> list[str]:
    """Write the function of a lobe.

    Its rows of the table begin with `row`; what they are for is in the column `about`.
    """
    speech, entries = words.language, lobe.functions.shape[1]
    step = speech.number((entries - 1) / lobe.span)
    low, high = (words.cell("0", "row + j", each) for each in ("entry", "entry + 1"))
    tangent = words.cell("0", "row + j", str(about))
    in_plane = speech.combined(["(2.0 * near - 1.0)", "(2.0 * near * t)"], ["c", "across"])
    return [
        f"vec3 shrm_lobe{number}(vec3 n, vec3 v)",
        "{",
        f"    vec3 c = {central_direction(lobe.center, speech)};",
        f"    vec3 beside = {'n' if lobe.center == 'reflection' else 'v'};",
        f"    vec3 across = {speech.minus('beside', speech.scale('dot(beside, c)', 'c'))};",
        f"    float angle = 2.0 * atan(length({speech.minus('v', 'c')}), "
        f"length({speech.add('v', 'c')}));",
        f"    float position = min(angle * {step}, {float(entries - 1)});",
        f"    int entry = int(min(position, {float(entries - 2)}));",
        "    float part = position - float(entry), norm, t, near;",
        f"    vec3 place = {words.place(number, 'c')}, sum = vec3(0.0, 0.0, 0.0);",
        "    vec3 pair, weight, cosine, sine;",
        f"    int row = {row}, cube = 0, p, m, j;",
        f"    across = {speech.scale('(1.0 / max(length(across), 1e-6))', 'across')};",
        f"    while (row < {row + len(lobe.functions)}) {{",
        f"        p = int({words.cell('0', 'row', str(about))}.y + 0.5);",
        "        norm = sqrt(float(2 * p + 1)) * 0.282094791773878143;",
        "        for (m = 0; m <= p; ++m) {",
        "            cosine = vec3(0.0, 0.0, 0.0);",
        "            sine = cosine;",
        "            for (j = 0; j <= p; ++j) {",
        f"                t = {tangent}.x;",
        "                near = 1.0 / (1.0 + t * t);",
        f"                weight = mix({low}, {high}, part);",
        f"                pair = shrm_pair({in_plane}, p, m);",
        *brushed_shader.sum_over_orders("p + 1", words, number),
    ]
