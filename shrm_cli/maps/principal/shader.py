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
from shrm_cli.maps.principal.about_center import cone_rule, plane_rule
from shrm_cli.maps.principal.brushed import BrushedLobe
from shrm_cli.maps.principal.principal import Lobe, PrincipalMap
from shrm_cli.maps.shader.source import (
    BRUSHED_BY_TANGENT,
    CROSS,
    Source,
    Table,
    Words,
    central_direction,
    pair_function,
    tangent_function,
    view_angle,
)


def source(made: PrincipalMap, textures: str) -> Source:
    """Return what the shader of a map consists of; the cubes of each lobe are a stack."""
    entries = max(lobe.functions.shape[-2] for lobe in made.lobes)
    rows = sum(map(_rows, made.lobes))
    layers = max(_layers(lobe) if isinstance(lobe, BrushedLobe) else 1 for lobe in made.lobes)
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
    return lobe.cubes.shape[2] if isinstance(lobe, BrushedLobe) else len(lobe.functions)


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
            weights, about = _brushed_numbers(lobe)
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
    lines += CROSS if is_brushed else []
    total, row = "", 0
    for number, lobe in enumerate(lobes):
        if isinstance(lobe, BrushedLobe):
            lines += _brushed_lobe(number, lobe, row, entries, words)
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
        *BRUSHED_BY_TANGENT,
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
    weighed = [
        f"t = {tangent}.x;",
        "near = 1.0 / (1.0 + t * t);",
        f"weight = mix({low}, {high}, part);",
        f"pair = shrm_pair({in_plane}, p, m);",
    ]
    return [
        f"vec3 shrm_lobe{number}(vec3 n, vec3 v)",
        "{",
        f"    vec3 c = {central_direction(lobe.center, speech)};",
        f"    vec3 beside = {'n' if lobe.center == 'reflection' else 'v'};",
        f"    vec3 across = {speech.minus('beside', speech.scale('dot(beside, c)', 'c'))};",
        f"    float angle = {view_angle(speech)};",
        f"    float position = min(angle * {step}, {float(entries - 1)});",
        f"    int entry = int(min(position, {float(entries - 2)}));",
        "    float part = position - float(entry), norm, t, near;",
        f"    vec3 place = {words.place(number, 'c')}, sum = vec3(0.0, 0.0, 0.0);",
        "    vec3 pair, weight, cosine, sine;",
        f"    int row = {row}, cube = 0, p, m, j;",
        f"    across = {speech.scale('(1.0 / max(length(across), 1e-6))', 'across')};",
        *_sum_over_bundles(number, row + _rows(lobe), about, "p", weighed, words),
    ]


# ---- lobes of anisotropic BRDFs ------------------------------------------------------------------
# A row of the table is the weight g_j of a direction on the cone of `about_center.cone_rule`, and
# has a layer for each of even azimuths psi of the view from the tangent. In mirror images psi
# becomes -psi and the azimuth of a direction does, too: where all functions have them, layers of a
# quarter turn are enough, and rows are taken in the reverse order for other quarters.

STEPS = 24
"""The steps of azimuths in a quarter turn. Linear interpolation between them costs lobes of
`ward:ax=0.15,ay=0.5` a third of a percent."""


def _is_mirrored(lobe: BrushedLobe) -> bool:
    """Tell whether a quarter turn of azimuths tells all of a lobe's functions."""
    return not (lobe.waves[:, 0] % 2).any() and not lobe.waves[:, 1].any()


def _layers(lobe: BrushedLobe) -> int:
    """Return the azimuths of a lobe's tables; the last one ends the turn."""
    return (STEPS if _is_mirrored(lobe) else 4 * STEPS) + 1


def _brushed_numbers(lobe: BrushedLobe) -> tuple[Array, Array]:
    """Return the weights of a lobe, and what its rows are for.

    Returns `weights` of shape (layers, rows, entries, 3); and `about` of shape (rows, 3), the
    tangent of half the angle of the cone, the degree of the bundle, and the tangent of half the
    azimuth on the cone, because sines of shading languages may be wrong by 5e-4.
    """
    count, entries = _layers(lobe), lobe.functions.shape[2]
    theta = np.linspace(0.0, lobe.span, entries)
    weights = np.zeros((count, _rows(lobe), entries, 3))
    about = np.zeros((_rows(lobe), 3))
    for layer in range(count):
        psi = np.full(entries, np.pi / 2 / STEPS * layer)
        real, imaginary = lobe.parts(theta, psi)
        row = first = 0
        for degree in lobe.degrees:
            angle, azimuths, inverse = cone_rule(degree)
            place, used = slice(row, row + 2 * degree + 1), slice(first, first + degree + 1)
            both = np.concatenate([real[:, used], imaginary[:, used][:, 1:]], axis=1)
            weights[layer, place] = np.einsum("qj,eqc->jec", inverse, both)
            about[place, 0], about[place, 1] = np.tan(angle / 2), degree
            about[place, 2] = np.tan(azimuths / 2)
            row, first = place.stop, used.stop
    return weights, about


def _brushed_lobe(number: int, lobe: BrushedLobe, row: int, about: int, words: Words) -> list[str]:
    """Write the function of a lobe of the normal, the tangent and the view.

    Its rows of the table begin with `row`; what they are for is in the column `about`.
    """
    speech, entries = words.language, lobe.functions.shape[2]
    step = speech.number((entries - 1) / lobe.span)
    steps = speech.number(STEPS * 2 / np.pi)
    half, whole = speech.number(np.pi), speech.number(2 * np.pi)
    corners = [
        words.cell(layer, "row + place_of", column)
        for layer in ("layer", "layer + 1")
        for column in ("entry", "entry + 1")
    ]
    cell = words.cell("0", "row + j", str(about))
    on_cone = speech.combined(
        [
            "(2.0 * near - 1.0)",
            "(2.0 * near * x * (2.0 * around - 1.0))",
            "(2.0 * near * x * (2.0 * around * y))",
        ],
        ["c", "across", "side"],
    )
    is_quarter = _is_mirrored(lobe)
    folded = [
        "    if (turn < 0.0) {",
        "        turn = -turn;",
        "        flips = 1;",
        "    }",
        f"    if (turn > 0.5 * {half}) {{",
        f"        turn = {half} - turn;",
        "        flips = 1 - flips;",
        "    }",
    ]
    whole_turn = ["    if (turn < 0.0) {", f"        turn += {whole};", "    }"]
    towards = speech.combined(["(x / far)", "(y / far)"], ["t", "side"])
    across = speech.combined(["dot(n, v)", "far"], ["across", "n"])  # at right angles with C
    weighed = [
        f"x = {cell}.x;",
        "near = 1.0 / (1.0 + x * x);",
        f"y = {cell}.z;",
        "around = 1.0 / (1.0 + y * y);",
        "place_of = flips * j > 0 ? 2 * p + 1 - j : j;",
        f"weight = mix(mix({corners[0]}, {corners[1]}, part), "
        f"mix({corners[2]}, {corners[3]}, part), share);",
        f"pair = shrm_pair({on_cone}, p, m);",
    ]
    return [
        f"vec3 shrm_lobe{number}(vec3 n, vec3 t, vec3 v)",
        "{",
        f"    vec3 c = {central_direction(lobe.center, speech)};",
        "    vec3 side = shrm_cross(n, t);",
        "    float x = dot(v, t), y = dot(v, side), far = sqrt(x * x + y * y);",
        f"    float angle = {view_angle(speech)};",
        f"    float position = min(angle * {step}, {float(entries - 1)}), turn = 0.0, share;",
        f"    int entry = int(min(position, {float(entries - 2)}));",
        "    float part = position - float(entry), near, norm, around;",
        f"    vec3 across = t, place = {words.place(number, 'c')}, sum = vec3(0.0, 0.0, 0.0);",
        "    vec3 pair, weight, cosine, sine;",
        f"    int row = {row}, cube = 0, flips = 0, layer, place_of, p, m, j;",
        "    if (far > 1e-12) {",
        f"        across = {towards};",
        "        turn = atan(y, x);",
        "    }",
        *(folded if is_quarter else whole_turn),
        f"    share = min(turn * {steps}, {float(_layers(lobe) - 1)});",
        f"    layer = int(min(share, {float(_layers(lobe) - 2)}));",
        "    share -= float(layer);",
        *([] if lobe.center == "normal" else [f"    across = {across};"]),
        "    side = shrm_cross(c, across);",
        *_sum_over_bundles(number, row + _rows(lobe), about, "2 * p", weighed, words),
    ]


def _sum_over_bundles(
    number: int, end: int, about: int, last: str, weighed: Sequence[str], words: Words
) -> list[str]:
    """Write the loops over bundles, orders m and directions, which both kinds of lobes share.

    A bundle's directions are 0 .. `last`, as many as its rows. `weighed` finds the `weight` of one,
    and the `pair` of its harmonics, which are added to `cosine` and `sine`; these, times their
    cubes, are added to `sum`. The rows of the last bundle end before `end`.
    """
    speech = words.language
    upper, lower = (words.cube(number, "place", f"cube + p {sign} m") for sign in "+-")
    return [
        f"    while (row < {end}) {{",
        f"        p = int({words.cell('0', 'row', str(about))}.y + 0.5);",
        "        norm = sqrt(float(2 * p + 1)) * 0.282094791773878143;",
        "        for (m = 0; m <= p; ++m) {",
        "            cosine = vec3(0.0, 0.0, 0.0);",
        "            sine = cosine;",
        f"            for (j = 0; j <= {last}; ++j) {{",
        *[f"                {line}" for line in weighed],
        f"                {speech.grow('cosine', speech.scale('(norm * pair.x)', 'weight'))}",
        f"                {speech.grow('sine', speech.scale('(norm * pair.y)', 'weight'))}",
        "            }",
        f"            {speech.grow('sum', speech.times('cosine', upper))}",
        "            if (m > 0) {",
        f"                {speech.grow('sum', speech.times('sine', lower))}",
        "            }",
        "            norm *= float(2 * m + 1) * sqrt((m == 0 ? 2.0 : 1.0) / "
        "float(max((p + m + 1) * (p - m), 1)));",
        "        }",
        "        cube += 2 * p + 1;",
        f"        row += {last} + 1;",
        "    }",
        "    return sum;",
        "}",
    ]
