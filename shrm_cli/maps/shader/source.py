"""What the shader of a form consists of: the cubes it looks up, its table, and its functions."""

from collections.abc import Callable, Sequence
from functools import lru_cache

from shrm_cli.arrays import Array
from shrm_cli.maps.shader.language import Language
from shrm_cli.records import record
from shrm_cli.vocabulary import Sampling


@record
class Words:
    """How the functions of a form read cubes and the table in some language and layout."""

    language: Language
    place: Callable[[int, str], str]
    """Given the number of a stack and the name of a direction, writes the place of the direction in
    the cubes of that stack, a vec3."""
    cube: Callable[[int, str, str], str]
    """Given the number of a stack, the name of a place and the text of a cube's number, writes the
    filtered colour of the cube."""

    def cell(self, layer: str, row: str, column: str) -> str:
        """Write the entry of the table, a vec3."""
        return f"shrm_cell({column}, {row}, {layer})"


@record
class Table:
    """Numbers that functions look up, entry by entry."""

    shape: tuple[int, int, int]
    """Layers, rows and columns."""
    make: Callable[[], Array]
    """Returns the numbers, shape (layers, rows, columns, 3)."""
    about: str
    """What they are, for the comment."""
    in_code: bool = True
    """Whether the table has one layer and is so small that the code can hold it."""


@record
class Source:
    """The shader of a map, whatever the language."""

    title: str
    """The line of the comment that says what the code is."""
    functions: Callable[[Words], list[str]]
    """Given `Words`, returns lines of GLSL as `Language.translated` takes it, with the function
    ``shrm_radiance``."""
    stacks: Sequence[Array] = ()
    """Cubes in OpenEXR's orientation, which are filtered in world axes, of shape (6N, N, K, 3)
    each."""
    sampling: Sampling = "center"
    table: Table | None = None
    images: Table | None = None
    """Further numbers, which half precision holds as well as the map's file does."""
    lighting: Array | None = None
    """The light's coefficients, where programs may change them, shape (n, 3)."""
    takes_tangent: bool = False
    """Whether ``shrm_brushed_radiance``, which takes the tangent, is among the functions."""
    notes: Sequence[str] = ()
    """More lines of the comment, about further functions."""


def central_direction(center: str, language: Language) -> str:
    """Write the central direction of a point with the normal n that is seen from v."""
    if center == "reflection":
        return language.minus(language.scale("2.0 * dot(n, v)", "n"), "v")
    return "n" if center == "normal" else "shrm_tangent(n)"


def tangent_function(centers: Sequence[str]) -> list[str]:
    """Write the function of the tangent, where a map is looked up by it."""
    if "tangent" not in centers:
        return []
    return [
        "/* The horizontal tangent. Return the mesh's own, where it has one. */",
        "vec3 shrm_tangent(vec3 n)",
        "{",
        "    float across = sqrt(n.x * n.x + n.z * n.z);",
        "    if (across < 1e-12) {",
        "        return vec3(1.0, 0.0, 0.0);",
        "    }",
        "    return vec3(n.z / across, 0.0, -n.x / across);",
        "}",
    ]


BRUSHED_BY_TANGENT = [
    "vec3 shrm_radiance(vec3 n, vec3 v)",
    "{",
    "    return shrm_brushed_radiance(n, shrm_tangent(n), v);",
    "}",
]
"""The function ``shrm_radiance`` of forms with ``shrm_brushed_radiance``."""
CROSS = [
    "vec3 shrm_cross(vec3 a, vec3 b)",
    "{",
    "    return vec3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);",
    "}",
]
"""The function of the cross product."""


def view_angle(language: Language) -> str:
    """Write the angle between the view v and the central direction c, exact for small ones too."""
    apart, both = language.minus("v", "c"), language.add("v", "c")
    return f"2.0 * atan(length({apart}), length({both}))"


TABLE_SIZE = 128
"""Texels along an edge of the tables of GGX, as `shrm dfg` makes them by default."""


@lru_cache(1)
def ggx_moments() -> Array:
    """Return `moments_table`, shape (128, 128, 6); it takes a second, so that it is kept."""
    # Whoever puts lamps beside a map has a shader of them, which knows nothing of this table.
    from shrm_cli.brdf.environment.environment_brdf import moments_table

    return moments_table(TABLE_SIZE)


def bilinear_table(table: Table, words: Words) -> list[str]:
    """Write the function that filters a table, whose entries are at texel centres of 0 .. 1."""
    _, rows, columns = table.shape
    cells = [
        words.cell("layer", row, column)
        for row in ("row", "row + 1")
        for column in ("column", "column + 1")
    ]
    return [
        "vec3 shrm_between(float x, float y, int layer)",
        "{",
        f"    float across = min(max(x * {columns}.0 - 0.5, 0.0), {columns - 1}.0);",
        f"    float down = min(max(y * {rows}.0 - 0.5, 0.0), {rows - 1}.0);",
        f"    int column = int(min(across, {columns - 2}.0)), row = int(min(down, {rows - 2}.0));",
        f"    vec3 above = mix({cells[0]}, {cells[1]}, across - float(column));",
        f"    vec3 below = mix({cells[2]}, {cells[3]}, across - float(column));",
        "    return mix(above, below, down - float(row));",
        "}",
    ]


# ---- code of real spherical harmonics, in the convention of `sphere.harmonics` -------------------


def harmonic_loop(order: int, direction: str, body: Callable[[str, str], list[str]]) -> list[str]:
    """Write a block that visits all real harmonics up to an order, without an array of them.

    The recurrence is that of the normalized Legendre functions, ``z p_l = c_(l+1) p_(l+1) + c_l
    p_(l-1)`` with ``c_l = sqrt((l^2 - m^2) / (4 l^2 - 1))``, which is stable for every order.

    `direction` is the name of a unit vector. `body`, given the text of an index ``l(l+1)+m`` and
    that of the harmonic's value, returns statements that use them. They may use the variable ``l``,
    the degree, too.
    """
    d = direction
    cosine = [f"                {line}" for line in body("l * (l + 1) + m", "(p * a)")]
    sine = [f"                    {line}" for line in body("l * (l + 1) - m", "(p * b)")]
    return [
        "    {",
        "        float a = 1.0, b = 0.0, first = 0.282094791773878, p, low, next, up, down;",
        "        int l, m;",
        f"        for (m = 0; m <= {order}; ++m) {{",
        "            p = first;",
        "            low = 0.0;",
        "            down = 0.0;",
        f"            for (l = m; l <= {order}; ++l) {{",
        *cosine,
        *(["                if (m > 0) {", *sine, "                }"] if order else []),
        "                up = sqrt(float((l + 1 - m) * (l + 1 + m)) / "
        "float((2 * l + 1) * (2 * l + 3)));",
        f"                next = ({d}.z * p - down * low) / up;",
        "                low = p;",
        "                p = next;",
        "                down = up;",
        "            }",
        f"            next = {d}.x * a - {d}.y * b;",
        f"            b = {d}.x * b + {d}.y * a;",
        "            a = next;",
        "            first *= sqrt(float(2 * m + 3) / float(m == 0 ? 1 : 2 * m + 2));",
        "        }",
        "    }",
    ]


def pair_function() -> list[str]:
    """Write the function ``shrm_pair(d, p, m)`` of the real harmonics m and -m of a degree p.

    They are x and y of its value, but for their norm, which is 1/sqrt(4 pi) where p = m = 0, grows
    by sqrt(2p + 1), and from m to m + 1 by (2m + 1) / sqrt((p + m + 1) (p - m)); from m = 0 to 1 by
    sqrt(2) more. The recurrence is that of the derivatives of Legendre polynomials, ``(l + 1 - m)
    P_(l+1) = (2l + 1) z P_l - (l + m) P_(l-1)``, over the first one, which is a constant. It has no
    cancellation, unlike the polynomials in z.
    """
    return [
        "vec3 shrm_pair(vec3 d, int p, int m)",
        "{",
        "    float a = 1.0, b = 0.0, value = 1.0, low = 0.0, next;",
        "    int l;",
        "    for (l = 0; l < m; ++l) {",
        "        next = d.x * a - d.y * b;",
        "        b = d.x * b + d.y * a;",
        "        a = next;",
        "    }",
        "    for (l = m; l < p; ++l) {",
        "        next = (float(2 * l + 1) * d.z * value - float(l + m) * low) / float(l + 1 - m);",
        "        low = value;",
        "        value = next;",
        "    }",
        "    return vec3(value * a, value * b, 0.0);",
        "}",
    ]
