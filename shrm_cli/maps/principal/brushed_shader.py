"""The code of lobes of anisotropic BRDFs, beside that of `shader`.

A row of the table is the weight g_j of a direction on the cone of `about_center.cone_rule`, and has
a layer for each of even azimuths psi of the view from the tangent. In mirror images psi becomes
-psi and the azimuth of a direction does, too: where all functions have them, layers of a quarter
turn are enough, and rows are taken in the reverse order for other quarters.
"""

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.maps.principal.about_center import cone_rule
from shrm_cli.maps.principal.brushed import BrushedLobe
from shrm_cli.maps.shader.source import Words, central_direction

STEPS = 24
"""The steps of azimuths in a quarter turn. Linear interpolation between them costs lobes of
`ward:ax=0.15,ay=0.5` a third of a percent."""


def is_mirrored(lobe: BrushedLobe) -> bool:
    """Tell whether a quarter turn of azimuths tells all of a lobe's functions."""
    return not (lobe.waves[:, 0] % 2).any() and not lobe.waves[:, 1].any()


def layers(lobe: BrushedLobe) -> int:
    """Return the azimuths of a lobe's tables; the last one ends the turn."""
    return (STEPS if is_mirrored(lobe) else 4 * STEPS) + 1


def rows(lobe: BrushedLobe) -> int:
    """Return the rows of a lobe in the table: one for each cube."""
    return lobe.cubes.shape[2]


def numbers(lobe: BrushedLobe) -> tuple[Array, Array]:
    """Return the weights of a lobe, and what its rows are for.

    Returns `weights` of shape (layers, rows, entries, 3); and `about` of shape (rows, 3), the
    tangent of half the angle of the cone, the degree of the bundle, and the tangent of half the
    azimuth on the cone, because sines of shading languages may be wrong by 5e-4.
    """
    count, entries = layers(lobe), lobe.functions.shape[2]
    theta = np.linspace(0.0, lobe.span, entries)
    weights = np.zeros((count, rows(lobe), entries, 3))
    about = np.zeros((rows(lobe), 3))
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


def code(number: int, lobe: BrushedLobe, row: int, about: int, words: Words) -> list[str]:
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
    is_quarter = is_mirrored(lobe)
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
    return [
        f"vec3 shrm_lobe{number}(vec3 n, vec3 t, vec3 v)",
        "{",
        f"    vec3 c = {central_direction(lobe.center, speech)};",
        "    vec3 side = shrm_cross(n, t);",
        "    float x = dot(v, t), y = dot(v, side), far = sqrt(x * x + y * y);",
        f"    float angle = 2.0 * atan(length({speech.minus('v', 'c')}), "
        f"length({speech.add('v', 'c')}));",
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
        f"    share = min(turn * {steps}, {float(layers(lobe) - 1)});",
        f"    layer = int(min(share, {float(layers(lobe) - 2)}));",
        "    share -= float(layer);",
        *_towards_view(lobe, words),
        "    side = shrm_cross(c, across);",
        f"    while (row < {row + rows(lobe)}) {{",
        f"        p = int({words.cell('0', 'row', str(about))}.y + 0.5);",
        "        norm = sqrt(float(2 * p + 1)) * 0.282094791773878143;",
        "        for (m = 0; m <= p; ++m) {",
        "            cosine = vec3(0.0, 0.0, 0.0);",
        "            sine = cosine;",
        "            for (j = 0; j <= 2 * p; ++j) {",
        f"                x = {cell}.x;",
        "                near = 1.0 / (1.0 + x * x);",
        f"                y = {cell}.z;",
        "                around = 1.0 / (1.0 + y * y);",
        "                place_of = flips * j > 0 ? 2 * p + 1 - j : j;",
        f"                weight = mix(mix({corners[0]}, {corners[1]}, part), "
        f"mix({corners[2]}, {corners[3]}, part), share);",
        f"                pair = shrm_pair({on_cone}, p, m);",
        *sum_over_orders("2 * p + 1", words, number),
    ]


def sum_over_orders(step: str, words: Words, number: int) -> list[str]:
    """Write the end of the loops over directions and orders m, which both kinds of lobes share.

    It adds a direction's harmonics to `cosine` and `sine`, and these, times their cubes, to `sum`;
    then it goes on to the next bundle, whose rows are `step` further.
    """
    speech = words.language
    upper, lower = (words.cube(number, "place", f"cube + p {sign} m") for sign in "+-")
    return [
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
        f"        row += {step};",
        "    }",
        "    return sum;",
        "}",
    ]


def _towards_view(lobe: BrushedLobe, words: Words) -> list[str]:
    """Write what turns the axis to the view, in the surface, to one at right angles with C."""
    if lobe.center == "normal":
        return []
    turned = words.language.combined(["dot(n, v)", "far"], ["across", "n"])
    return [f"    across = {turned};"]


def cross_function() -> list[str]:
    """Write the cross product."""
    return [
        "vec3 shrm_cross(vec3 a, vec3 b)",
        "{",
        "    return vec3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);",
        "}",
    ]
