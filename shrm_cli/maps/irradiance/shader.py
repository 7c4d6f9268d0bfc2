"""Irradiance as source code, with its numbers in place: the quadratic polynomial of the normal.

Above order 2 it is a sum over harmonics.

Eq. 4.16 is one of chapter 4 of Ramamoorthi's thesis, "A Signal-Processing Framework for Forward
and Inverse Rendering" (2002).
"""

from collections.abc import Sequence

from shrm_cli.arrays import Array
from shrm_cli.errors import MapError
from shrm_cli.maps.irradiance.irradiance import POLYNOMIAL_ORDER, Irradiance, matrix_constants
from shrm_cli.maps.irradiance.zh3 import Zh3
from shrm_cli.maps.irradiance.zh3_shader import zh3_snippet
from shrm_cli.maps.shader.harmonics import harmonic_loop
from shrm_cli.maps.shader.language import C_MAY_BE_UNUSED, Language, harmless

_MOST_ORDER = 16
"""The largest order whose coefficients the code holds, 289 colours. Degree 16 of E has a thousandth
of the light's own."""
_POLYNOMIAL = [
    " * Ramamoorthi and Hanrahan 2001, An Efficient Representation for Irradiance",
    " * Environment Maps: the quadratic polynomial of the normal. */",
]
_C_OF_SUM = [
    "static void shrm_irradiance(const double normal[3], double irradiance[3])",
    "{",
    "    const vec3 sum = shrm_sum(vec3(normal[0], normal[1], normal[2]));",
    "    irradiance[0] = sum.x;",
    "    irradiance[1] = sum.y;",
    "    irradiance[2] = sum.z;",
    "}",
]


def irradiance_snippet(irradiance: Irradiance, language: str) -> str:
    """Write the function ``shrm_irradiance(normal)`` for a shader or a program.

    Parameters
    ----------
    irradiance : Irradiance
        A map of order 16 at most. Up to order 2 the code is the quadratic polynomial of eq. 4.16;
        above it sums the harmonics of the even degrees.
    language : {"glsl", "hlsl", "c"}
        The code in C is C89, which later standards and C++ take too. It computes in double
        precision.

    Returns
    -------
    str
        The code; its last line ends with a newline too.

    Raises
    ------
    MapError
        If the language is unknown, the map's order is above 16, or a number does not fit into the
        language's type.
    """
    if isinstance(irradiance, Zh3):
        return zh3_snippet(irradiance, language)
    speech = Language(language)
    if irradiance.order_f > POLYNOMIAL_ORDER:
        return "\n".join([*_comment(irradiance), *_sum(irradiance, speech)]) + "\n"
    terms = _terms(irradiance)
    for _, rgb in terms:
        speech.check(rgb)
    lines = _comment(irradiance) + (_c(terms) if language == "c" else _shader(terms, language))
    return "\n".join(lines) + "\n"


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


def _comment(irradiance: Irradiance) -> list[str]:
    """Write the comment that says what the numbers are, and where they come from."""
    info, window = irradiance.info, irradiance.window
    width = "" if window.width is None else f", width {window.width:.6g}"
    return [
        "/* Irradiance E of a unit normal in world axes (right-handed, +Y up), linear RGB.",
        " * E is without 1/pi: a diffuse surface reflects the radiance albedo / pi * E.",
        f" * Probe: {harmless(info.probe) or 'unknown'}",
        f" * SHA-256: {harmless(info.probe_sha256) or 'unknown'}",
        f" * Order: {irradiance.order_f}; window: {window.name}{width}",
        *(_POLYNOMIAL if irradiance.order_f <= POLYNOMIAL_ORDER else [" */"]),
    ]


def _shader(terms: Sequence[tuple[str, Array]], language: str) -> list[str]:
    """Write the function in GLSL or HLSL."""
    vector = {"glsl": "vec3", "hlsl": "float3"}[language]
    sums = [
        f"{vector}({', '.join(_number(c, 9) for c in rgb.tolist())})" + (f" * {by}" if by else "")
        for by, rgb in terms
    ]
    axes = "    float x = normal.x, y = normal.y, z = normal.z;"
    return [
        f"{vector} shrm_irradiance({vector} normal)",
        "{",
        *([axes] if len(terms) > 1 else []),
        "    return " + "\n        + ".join(sums) + ";",
        "}",
    ]


def _c(terms: Sequence[tuple[str, Array]]) -> list[str]:
    """Write the function in C89, which has no ``inline``."""
    lines = [
        *C_MAY_BE_UNUSED,
        "static void shrm_irradiance(const double normal[3], double irradiance[3])",
        "{",
    ]
    if len(terms) > 1:
        lines.append("    const double x = normal[0], y = normal[1], z = normal[2];")
    else:
        lines.append("    (void)normal;")
    for channel in range(3):
        sums = [_number(float(rgb[channel]), 17) + (f" * {by}" if by else "") for by, rgb in terms]
        lines.append(f"    irradiance[{channel}] = " + "\n        + ".join(sums) + ";")
    return [*lines, "}"]


def _number(value: float, digits: int) -> str:
    """Write a number with a decimal point, for every language; negative ones in brackets."""
    text = f"{value:.{digits}g}"
    if not set(text) & set(".e"):
        text += ".0"
    return f"({text})" if text.startswith("-") else text
