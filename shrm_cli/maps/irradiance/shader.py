"""Irradiance as source code: the polynomial of eq. 4.16 with its numbers in place."""

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


def irradiance_snippet(irradiance: Irradiance, language: str) -> str:
    """A function ``shrm_irradiance(normal)`` for a shader or a program.

    Parameters
    ----------
    irradiance : Irradiance
        Of order 2 at most.
    language : {"glsl", "hlsl", "c"}
        C99 computes in double precision.

    Returns
    -------
    str
        Lines, the last one ended too.

    Raises
    ------
    MapError
        Above order 2, or if a number does not fit into the language's type.
    """
    if language not in LANGUAGES:
        raise MapError(f"shader language {language!r}: take one of {', '.join(LANGUAGES)}")
    terms = _terms(irradiance)
    if language != "c" and max(abs(rgb).max() for _, rgb in terms) > _FLOAT_MAX:
        raise MapError(f"a coefficient is beyond the 32-bit floats of {language}; dim the light")
    lines = _comment(irradiance) + (_c(terms) if language == "c" else _shader(terms, language))
    return "\n".join(lines) + "\n"


def _terms(irradiance: Irradiance) -> list[tuple[str, Array]]:
    """Monomials of the normal, and the colour that each is multiplied with (eq. 4.16)."""
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
    """What the numbers are, and where they come from."""
    info, window = irradiance.info, irradiance.window
    width = "" if window.width is None else f", width {window.width:.6g}"
    return [
        "/* Irradiance E of a unit normal in world axes (right-handed, +Y up), linear RGB.",
        " * E is without 1/pi: a diffuse surface reflects the radiance albedo / pi * E.",
        f" * Probe: {_harmless(info.probe) or 'unknown'}",
        f" * SHA-256: {_harmless(info.probe_sha256) or 'unknown'}",
        f" * Order: {irradiance.order_f}; window: {window.name}{width}",
        " * Ramamoorthi and Hanrahan 2001, An Efficient Representation for Irradiance",
        " * Environment Maps: the quadratic polynomial of the normal. */",
    ]


def _harmless(text: str) -> str:
    """Text that cannot end a comment, start one, or continue a line."""
    return re.sub(r"[^A-Za-z0-9 ._+,()-]", "_", text)[:_MOST_NAME]


def _shader(terms: Sequence[tuple[str, Array]], language: str) -> list[str]:
    """Of GLSL or HLSL."""
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
    """Of C99."""
    lines = [
        "static inline void shrm_irradiance(const double normal[3], double irradiance[3])",
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
    """A number with a decimal point, as every language reads it; negative ones in brackets."""
    text = f"{value:.{digits}g}"
    if not set(text) & set(".e"):
        text += ".0"
    return f"({text})" if text.startswith("-") else text
