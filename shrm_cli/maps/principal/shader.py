"""Maps of principal functions as source code: cubes times the BRDF's own functions of the view."""

from collections.abc import Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from shrm_cli.maps.principal.principal import Lobe, PrincipalMap, plane_rule
from shrm_cli.maps.shader.harmonics import band
from shrm_cli.maps.shader.source import Source, Table, Words, central_direction, tangent_function

Array = NDArray[np.floating]


def source(made: PrincipalMap, textures: str) -> Source:
    """Return what the shader of a map consists of; the cubes of each lobe are a stack.

    Parameters
    ----------
    made : PrincipalMap
    textures : {"cube-array", "layers"}
        Cubes are the same in both.
    """
    entries = max(lobe.functions.shape[1] for lobe in made.lobes)
    rows = sum(len(lobe.functions) for lobe in made.lobes)
    return Source(
        "The light of a probe as a BRDF reflects it, by the BRDF's own functions of the view.",
        partial(_functions, made.lobes),
        [lobe.cubes for lobe in made.lobes],
        made.sampling,
        Table(
            (1, rows, entries),
            partial(_numbers, made.lobes, rows, entries),
            "a function in each row, over the angle of the view",
        ),
    )


def _numbers(lobes: Sequence[Lobe], rows: int, entries: int) -> Array:
    """Return the functions of all lobes, times the albedo, one below the other."""
    result = np.zeros((1, rows, entries, 3))
    first = 0
    for lobe in lobes:
        functions = lobe.functions if lobe.albedo is None else lobe.functions * lobe.albedo
        result[0, first : first + len(functions), : functions.shape[1]] = functions
        first += len(functions)
    return result


def _functions(lobes: Sequence[Lobe], words: Words) -> list[str]:
    """Write the functions of all lobes, and their sum."""
    lines = tangent_function([lobe.center for lobe in lobes])
    for degree in sorted({p for lobe in lobes for p in lobe.degrees if p}):
        lines += band(degree, words.language)
    total, row = "", 0
    for number, lobe in enumerate(lobes):
        lines += _lobe(number, lobe, row, words)
        call = f"shrm_lobe{number}(n, v)"
        total = words.language.add(total, call) if total else call
        row += len(lobe.functions)
    return [*lines, f"vec3 shrm_radiance(vec3 n, vec3 v) {{ return {total}; }}"]


def _lobe(number: int, lobe: Lobe, row: int, words: Words) -> list[str]:
    """Write the function of a lobe, whose functions begin in some row of the table."""
    speech, entries = words.language, lobe.functions.shape[1]
    step = speech.number((entries - 1) / lobe.span)
    lines = [
        f"vec3 shrm_lobe{number}(vec3 n, vec3 v)",
        "{",
        f"    vec3 c = {central_direction(lobe.center, speech)};",
        f"    vec3 beside = {'n' if lobe.center == 'reflection' else 'v'};",
        f"    vec3 across = {speech.minus('beside', speech.scale('dot(beside, c)', 'c'))};",
        f"    float angle = 2.0 * atan(length({speech.minus('v', 'c')}), "
        f"length({speech.add('v', 'c')}));",
        f"    float position = min(angle * {step}, {float(entries - 1)});",
        f"    int entry = int(min(position, {float(entries - 2)}));",
        "    float part = position - float(entry);",
        f"    vec3 place = {words.place(number, 'c')}, sum = vec3(0.0, 0.0, 0.0);",
        f"    across = {speech.scale('(1.0 / max(length(across), 1e-6))', 'across')};",
    ]
    cube = 0
    for degree in lobe.degrees:
        lines += _bundle(number, degree, cube, row, words)
        cube, row = cube + 2 * degree + 1, row + degree + 1
    return [*lines, "    return sum;", "}"]


def _bundle(number: int, degree: int, cube: int, row: int, words: Words) -> list[str]:
    """Write what one bundle adds to the sum."""
    speech, count = words.language, 2 * degree + 1
    angles, inverse = plane_rule(degree)

    def function(q: int) -> str:
        low, high = (words.cell("0", str(row + q), each) for each in ("entry", "entry + 1"))
        return f"mix({low}, {high}, part)"

    if not degree:  # the harmonic is a constant, which the rule takes away again
        constant = speech.number(float(inverse[0, 0]) / np.sqrt(4 * np.pi))
        light = speech.scale(constant, words.cube(number, "place", str(cube)))
        return [f"    {speech.grow('sum', speech.times(light, function(0)))}"]
    lines = [
        "    {",
        f"        float y[{count}];",
        f"        vec3 m[{count}], h[{degree + 1}];",
        *(f"        m[{k}] = {words.cube(number, 'place', str(cube + k))};" for k in range(count)),
    ]
    for j, angle in enumerate(angles.tolist()):
        factors = [speech.number(float(each)) for each in (np.cos(angle), np.sin(angle))]
        terms = speech.combined(
            [f"y[{k}]" for k in range(count)], [f"m[{k}]" for k in range(count)]
        )
        lines += [
            f"        shrm_band{degree}({speech.combined(factors, ['c', 'across'])}, y);",
            f"        h[{j}] = {terms};",
        ]
    for q in range(degree + 1):
        factors = [speech.number(float(each)) for each in inverse[q]]
        order = speech.combined(factors, [f"h[{j}]" for j in range(degree + 1)])
        lines.append(f"        {speech.grow('sum', speech.times(order, function(q)))}")
    return [*lines, "    }"]
