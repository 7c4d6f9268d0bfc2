"""SHRMs as source code: the harmonics of the view, each times the cube of its coefficients."""

from collections.abc import Sequence
from functools import partial

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.errors import MapError
from shrm_cli.maps.shader.source import (
    Source,
    Table,
    Words,
    central_direction,
    harmonic_loop,
    tangent_function,
)
from shrm_cli.maps.shrm.shrm import CompressedShrm, Shrm
from shrm_cli.maps.shrm.summed import SummedShrm
from shrm_cli.records import record
from shrm_cli.vocabulary import Center


@record(eq=False)
class _Term:
    """A term of the map: its cubes, shape (6N, N, K, 3), and the matrix that mixes them, if any."""

    center: Center
    order_p: int
    cubes: Array
    matrix: Array | None


def source(made: Shrm | CompressedShrm | SummedShrm, textures: str) -> Source:
    """Return what the shader of an SHRM consists of.

    The cubes of local frames are turned to world axes, in which alone they can be filtered; the
    file's own cubes, which users fill arrays of cube maps with, are refused. The components of a
    compressed map in world axes are looked up as they are, and weighted with what the map's matrix
    makes of the harmonics of the view.
    """
    held = made.terms if isinstance(made, SummedShrm) else (made,)
    if textures == "cube-array" and any(term.frame == "local" for term in held):
        raise MapError(
            "cubes in local frames cannot be filtered; make the map with `frame` global, or take "
            "the textures layers, which turn them"
        )
    terms = [_term(term) for term in held]
    matrices = [term.matrix for term in terms if term.matrix is not None]
    return Source(
        "The light of a probe as a BRDF reflects it: a spherical harmonic reflection map.",
        partial(_functions, terms),
        [term.cubes for term in terms],
        made.sampling,
        _table(matrices) if matrices else None,
    )


def _term(term: Shrm | CompressedShrm) -> _Term:
    if isinstance(term, CompressedShrm) and term.frame == "global":
        return _Term(term.center, term.order_p, term.components, term.matrix)
    turned = term.to_shrm(frame="global")
    return _Term(turned.center, turned.order_p, turned.coefficients, None)


def _table(matrices: Sequence[Array]) -> Table:
    """Return the matrices of all terms, one below the other; all channels are the same."""
    rows = sum(len(matrix) for matrix in matrices)
    columns = max(matrix.shape[1] for matrix in matrices)
    numbers = np.zeros((1, rows, columns, 3))
    first = 0
    for matrix in matrices:
        numbers[0, first : first + len(matrix), : matrix.shape[1]] = matrix[..., None]
        first += len(matrix)
    return Table(
        (1, rows, columns), lambda: numbers, "a row for each component, a column for each harmonic"
    )


def _functions(terms: Sequence[_Term], words: Words) -> list[str]:
    lines = tangent_function([term.center for term in terms])
    row = 0
    for number, term in enumerate(terms):
        lines += _function(number, term, row, words)
        row += 0 if term.matrix is None else len(term.matrix)
    total = "shrm_term0(n, v)"
    for number in range(1, len(terms)):
        total = words.language.add(total, f"shrm_term{number}(n, v)")
    return [*lines, f"vec3 shrm_radiance(vec3 n, vec3 v) {{ return {total}; }}"]


def _function(number: int, term: _Term, row: int, words: Words) -> list[str]:
    """Write the function of a term, whose matrix begins in some row of the table."""
    speech = words.language
    head = [
        f"vec3 shrm_term{number}(vec3 n, vec3 v)",
        "{",
        f"    vec3 c = {central_direction(term.center, speech)};",
        f"    vec3 place = {words.place(number, 'c')}, sum = vec3(0.0, 0.0, 0.0);",
    ]
    if term.matrix is None:

        def add(index: str, value: str) -> list[str]:
            return [speech.grow("sum", speech.scale(value, words.cube(number, "place", index)))]

        return [*head, *harmonic_loop(term.order_p, "v", add), "    return sum;", "}"]

    count = len(term.matrix)

    def weigh(index: str, value: str) -> list[str]:
        entry = words.cell("0", f"{row} + k", index)
        return [f"for (k = 0; k < {count}; ++k) {{", f"    w[k] += {value} * {entry}.x;", "}"]

    part = speech.scale("w[k]", words.cube(number, "place", "k"))
    return [
        *head,
        f"    float w[{count}];",
        "    int k;",
        f"    for (k = 0; k < {count}; ++k) {{",
        "        w[k] = 0.0;",
        "    }",
        *harmonic_loop(term.order_p, "v", weigh),
        f"    for (k = 0; k < {count}; ++k) {{",
        f"        {speech.grow('sum', part)}",
        "    }",
        "    return sum;",
        "}",
    ]
