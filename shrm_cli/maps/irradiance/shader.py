"""Irradiance as source code, with its numbers in place: the quadratic polynomial of the normal.

Above order 2 it is a sum over harmonics. ZH3 irradiance is a linear function of the normal, and a
square about an axis.

Eq. 4.16 is one of chapter 4 of Ramamoorthi's thesis, "A Signal-Processing Framework for Forward
and Inverse Rendering" (2002).
"""

from collections.abc import Sequence

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.errors import MapError
from shrm_cli.maps.irradiance.irradiance import POLYNOMIAL_ORDER, Irradiance, Zh3, matrix_constants
from shrm_cli.maps.shader.language import C_MAY_BE_UNUSED, FLOAT_MAX, Language, harmless
from shrm_cli.maps.shader.source import harmonic_loop

_MOST_ORDER = 16
"""The largest order whose coefficients the code holds, 289 colours. Degree 16 of E has a thousandth
of the light's own."""
_POLYNOMIAL = [
    " * Ramamoorthi and Hanrahan 2001, An Efficient Representation for Irradiance",
    " * Environment Maps: the quadratic polynomial of the normal. */",
]
_ZH3 = " * Roughton et al. 2024, ZH3: linear harmonics, and a zonal one about an axis. */"
_C_NAME = ["static void shrm_irradiance(const double normal[3], double irradiance[3])", "{"]
_C_HEAD = [*C_MAY_BE_UNUSED, *_C_NAME]
_C_AXES = "    const double x = normal[0], y = normal[1], z = normal[2];"
_C_OF_SUM = [
    *_C_NAME,
    "    const vec3 sum = shrm_sum(vec3(normal[0], normal[1], normal[2]));",
    "    irradiance[0] = sum.x;",
    "    irradiance[1] = sum.y;",
    "    irradiance[2] = sum.z;",
    "}",
]


def irradiance_snippet(irradiance: Irradiance, language: str) -> str:
    """Write the function ``shrm_irradiance(normal)`` for a shader or a program.

    `irradiance` is a map of order 16 at most. Up to order 2 the code is the quadratic polynomial of
    eq. 4.16; above it sums the harmonics of the even degrees. The code in the language C is C89,
    which later standards and C++ take too. It computes in double precision.

    Returns the code; its last line ends with a newline too.
    """
    speech = Language(language)
    if isinstance(irradiance, Zh3):
        lines = _zh3(irradiance, speech)
    elif irradiance.order_f > POLYNOMIAL_ORDER:
        lines = _sum(irradiance, speech)
    else:
        terms = _terms(irradiance)
        for _, rgb in terms:
            speech.check(rgb)
        lines = _c(terms, speech) if speech.is_c else _shader(terms, speech)
    return "\n".join([*_comment(irradiance), *lines]) + "\n"


def _sum(irradiance: Irradiance, speech: Language) -> list[str]:
    """Write the function as a sum over the harmonics, of which those of high odd degrees are 0."""
    if irradiance.order_f > _MOST_ORDER:
        raise MapError(
            f"code for irradiance holds the coefficients of orders up to {_MOST_ORDER}, not "
            f"{irradiance.order_f}; lower `order_f`"
        )

    def add(index: str, value: str) -> list[str]:
        return [speech.grow("sum", speech.scale(value, f"shrm_series[{index}]"))]

    loop = harmonic_loop(irradiance.order_f, "normal", add)
    name = "shrm_sum" if speech.is_c else "shrm_irradiance"
    lines = [
        *speech.colors("shrm_series", irradiance.series),
        f"vec3 {name}(vec3 normal)",
        "{",
        "    vec3 sum = vec3(0.0, 0.0, 0.0);",
        *loop,
        "    return sum;",
        "}",
    ]
    return speech.translated([*lines, *(_C_OF_SUM if speech.is_c else [])])


def _terms(irradiance: Irradiance) -> list[tuple[str, Array]]:
    """List monomials of the normal, and the color that each is multiplied with (eq. 4.16)."""
    c1, c2, c3, c4, c5 = matrix_constants()
    l00, l1_1, l10, l11, l2_2, l2_1, l20, l21, l22 = irradiance.nine()
    terms = [
        ("", c4 * l00 - c5 * l20),
        ("x", 2 * c2 * l11),
        ("y", 2 * c2 * l1_1),
        ("z", 2 * c2 * l10),
        ("x * y", 2 * c1 * l2_2),
        ("x * z", 2 * c1 * l21),
        ("y * z", 2 * c1 * l2_1),
        ("z * z", c3 * l20),
        ("(x * x - y * y)", c1 * l22),
    ]
    return terms[: (irradiance.order_f + 1) ** 2]


def _comment(made: Irradiance) -> list[str]:
    """Write the comment that says what the numbers are, and where they come from."""
    lines = [
        "/* Irradiance E of a unit normal in world axes (right-handed, +Y up), linear RGB.",
        " * E is without 1/pi: a diffuse surface reflects the radiance albedo / pi * E.",
        f" * Probe: {harmless(made.info.probe) or 'unknown'}",
        f" * SHA-256: {harmless(made.info.probe_sha256) or 'unknown'}",
    ]
    if isinstance(made, Zh3):
        return [*lines, f" * Form: {made.form}; window: {made.window.name}", _ZH3]
    width = "" if made.window.width is None else f", width {made.window.width:.6g}"
    lines.append(f" * Order: {made.order_f}; window: {made.window.name}{width}")
    return [*lines, *(_POLYNOMIAL if made.order_f <= POLYNOMIAL_ORDER else [" */"])]


def _shader(terms: Sequence[tuple[str, Array]], speech: Language) -> list[str]:
    sums = [_vector(rgb, speech) + (f" * {by}" if by else "") for by, rgb in terms]
    axes = "    float x = normal.x, y = normal.y, z = normal.z;"
    lines = [
        "vec3 shrm_irradiance(vec3 normal)",
        "{",
        *([axes] if len(terms) > 1 else []),
        "    return " + "\n        + ".join(sums) + ";",
        "}",
    ]
    return speech.translated(lines)


def _vector(values: Array, speech: Language) -> str:
    return f"vec3({', '.join(map(speech.literal, values.tolist()))})"


def _c(terms: Sequence[tuple[str, Array]], speech: Language) -> list[str]:
    """Write the function in C89, which has no ``inline``."""
    many = len(terms) > 1
    lines = [*_C_HEAD, _C_AXES if many else "    (void)normal;"]
    for channel in range(3):
        sums = [
            speech.number(float(rgb[channel])) + (f" * {by}" if by else "") for by, rgb in terms
        ]
        lines.append(f"    irradiance[{channel}] = " + "\n        + ".join(sums) + ";")
    return [*lines, "}"]


def _zh3(made: Zh3, speech: Language) -> list[str]:
    """Write the function of ZH3 irradiance."""
    _, c2, c3, c4, _ = matrix_constants()
    # c3 / 3 is A_2 times the constant of Y_20: the zonal harmonic is that times 3 (a.n)^2 - 1.
    square = c3 * made.zonal
    constant = c4 * made.coefficients[0] - square / 3
    y, z, x = 2 * c2 * made.coefficients[1:4]
    rows = np.array([constant, x, y, z, square])
    if not speech.is_c and np.abs(rows).max() > FLOAT_MAX:
        raise MapError(f"a coefficient is beyond the 32-bit floats of {speech.name}; dim the light")
    return _zh3_c(rows, made.axes, speech) if speech.is_c else _zh3_shader(rows, made.axes, speech)


def _zh3_shader(rows: Array, axes: Array, speech: Language) -> list[str]:
    kind, along = "float", f"dot(normal, {_vector(axes[0], speech)})"
    if np.ptp(axes, axis=0).any():
        kind = "vec3"
        along = f"vec3({', '.join(f'dot(normal, {_vector(axis, speech)})' for axis in axes)})"
    constant, x, y, z, square = (_vector(row, speech) for row in rows)
    lines = [
        "vec3 shrm_irradiance(vec3 normal)",
        "{",
        f"    {kind} along = {along};",
        f"    return {constant}",
        f"        + {x} * normal.x",
        f"        + {y} * normal.y",
        f"        + {z} * normal.z",
        f"        + {square} * (along * along);",
        "}",
    ]
    return speech.translated(lines)


def _zh3_c(rows: Array, axes: Array, speech: Language) -> list[str]:
    lines = [*_C_HEAD, _C_AXES, "    double along;"]
    for channel, axis in enumerate(axes):
        a, b, c = map(speech.number, axis.tolist())
        constant, x, y, z, square = map(speech.number, rows[:, channel].tolist())
        lines += [
            f"    along = {a} * x + {b} * y + {c} * z;",
            f"    irradiance[{channel}] = {constant} + {x} * x + {y} * y"
            f" + {z} * z + {square} * along * along;",
        ]
    return [*lines, "}"]
