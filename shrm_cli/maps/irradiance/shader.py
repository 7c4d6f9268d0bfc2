"""Irradiance as source code: the quadratic polynomial of the normal, with its numbers in place.

Eq. 4.16 is one of chapter 4 of Ramamoorthi's thesis, "A Signal-Processing Framework for Forward
and Inverse Rendering" (2002).
"""

import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from shrm_cli.errors import MapError
from shrm_cli.maps.irradiance.irradiance import Irradiance, matrix_constants

Array = NDArray[np.floating]

LANGUAGES = ("glsl", "hlsl", "c")

_FLOAT_MAX = float(np.finfo(np.float32).max)
_MOST_NAME = 100
"""The most characters of a probe's name or digest in the code's comment."""


def irradiance_snippet(irradiance: Irradiance, language: str) -> str:
    """Write the function ``shrm_irradiance(normal)`` for a shader or a program.

    Parameters
    ----------
    irradiance : Irradiance
        A map of order 2 at most.
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
        If the language is unknown, the map's order is above 2, or a number does not fit into the
        language's type.
    """
    if language not in LANGUAGES:
        raise MapError(f"shader language {language!r}: take one of {', '.join(LANGUAGES)}")
    terms = _terms(irradiance)
    if language != "c" and max(abs(rgb).max() for _, rgb in terms) > _FLOAT_MAX:
        raise MapError(f"a coefficient is beyond the 32-bit floats of {language}; dim the light")
    lines = _comment(irradiance) + (_c(terms) if language == "c" else _shader(terms, language))
    return "\n".join(lines) + "\n"


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
        " * Ramamoorthi and Hanrahan 2001, An Efficient Representation for Irradiance",
        " * Environment Maps: the quadratic polynomial of the normal. */",
    ]


def harmless(text: str) -> str:
    """Replace characters that could end a comment, start one, or continue a line."""
    return re.sub(r"[^A-Za-z0-9 ._+,()-]", "_", text)[:_MOST_NAME]


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
