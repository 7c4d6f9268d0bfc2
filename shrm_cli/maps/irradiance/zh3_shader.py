"""ZH3 irradiance as source code: a linear function of the normal, and a square about an axis."""

import numpy as np

from shrm_cli.errors import MapError
from shrm_cli.maps.irradiance.irradiance import matrix_constants
from shrm_cli.maps.irradiance.zh3 import Zh3
from shrm_cli.maps.shader.language import C_MAY_BE_UNUSED, Language, harmless

_FLOAT_MAX = float(np.finfo(np.float32).max)


def zh3_snippet(made: Zh3, language: str) -> str:
    """Write the function ``shrm_irradiance(normal)`` for a shader or a program.

    Parameters
    ----------
    made : Zh3
    language : {"glsl", "hlsl", "c"}
        As `irradiance_snippet` has them.

    Raises
    ------
    MapError
        If the language is unknown, or a number does not fit into the language's type.
    """
    is_c = Language(language).is_c
    _, c2, c3, c4, _ = matrix_constants()
    # c3 / 3 is A_2 times the constant of Y_20: the zonal harmonic is that times 3 (a.n)^2 - 1.
    square = c3 * made.zonal
    constant = c4 * made.coefficients[0] - square / 3
    y, z, x = 2 * c2 * made.coefficients[1:4]
    rows = np.array([constant, x, y, z, square])
    if not is_c and np.abs(rows).max() > _FLOAT_MAX:
        raise MapError(f"a coefficient is beyond the 32-bit floats of {language}; dim the light")
    comment = [
        "/* Irradiance E of a unit normal in world axes (right-handed, +Y up), linear RGB.",
        " * E is without 1/pi: a diffuse surface reflects the radiance albedo / pi * E.",
        f" * Probe: {harmless(made.info.probe) or 'unknown'}",
        f" * SHA-256: {harmless(made.info.probe_sha256) or 'unknown'}",
        f" * Form: {made.form}; window: {made.window.name}",
        " * Roughton et al. 2024, ZH3: linear harmonics, and a zonal one about an axis. */",
    ]
    lines = _c(rows, made.axes) if is_c else _shader(rows, made.axes, language)
    return "\n".join([*comment, *lines]) + "\n"


def _shader(rows: np.ndarray, axes: np.ndarray, language: str) -> list[str]:
    """Write the function in GLSL or HLSL."""
    vector = {"glsl": "vec3", "hlsl": "float3"}[language]

    def text(values: np.ndarray) -> str:
        return f"{vector}({', '.join(_number(value, 9) for value in values.tolist())})"

    kind, along = "float", f"dot(normal, {text(axes[0])})"
    if np.ptp(axes, axis=0).any():
        kind = vector
        along = f"{vector}({', '.join(f'dot(normal, {text(axis)})' for axis in axes)})"
    constant, x, y, z, square = (text(row) for row in rows)
    return [
        f"{vector} shrm_irradiance({vector} normal)",
        "{",
        f"    {kind} along = {along};",
        f"    return {constant}",
        f"        + {x} * normal.x",
        f"        + {y} * normal.y",
        f"        + {z} * normal.z",
        f"        + {square} * (along * along);",
        "}",
    ]


def _c(rows: np.ndarray, axes: np.ndarray) -> list[str]:
    """Write the function in C89."""
    lines = [
        *C_MAY_BE_UNUSED,
        "static void shrm_irradiance(const double normal[3], double irradiance[3])",
        "{",
        "    const double x = normal[0], y = normal[1], z = normal[2];",
        "    double along;",
    ]
    for channel, axis in enumerate(axes):
        a, b, c = (_number(value, 17) for value in axis.tolist())
        constant, *linear, square = (_number(value, 17) for value in rows[:, channel].tolist())
        lines += [
            f"    along = {a} * x + {b} * y + {c} * z;",
            f"    irradiance[{channel}] = {constant} + {linear[0]} * x + {linear[1]} * y"
            f" + {linear[2]} * z + {square} * along * along;",
        ]
    return [*lines, "}"]


def _number(value: float, digits: int) -> str:
    """Write a number with a decimal point or an exponent; negative ones in brackets."""
    text = f"{value:.{digits}g}"
    text = text if set(text) & set(".e") else f"{text}.0"
    return f"({text})" if text.startswith("-") else text
