"""Code that computes real spherical harmonics, in the convention of `sphere.harmonics`."""

from collections.abc import Callable

import numpy as np
from numpy.polynomial import legendre, polynomial
from numpy.typing import NDArray

from shrm_cli.maps.shader.language import Language

Array = NDArray[np.floating]


def harmonic_loop(order: int, direction: str, body: Callable[[str, str], list[str]]) -> list[str]:
    """Write a block that visits all real harmonics up to an order, without an array of them.

    The recurrence is that of the normalized Legendre functions, ``z p_l = c_(l+1) p_(l+1) + c_l
    p_(l-1)`` with ``c_l = sqrt((l^2 - m^2) / (4 l^2 - 1))``, which is stable for every order.

    Parameters
    ----------
    order : int
    direction : str
        The name of a unit vector.
    body : callable
        Given the text of an index ``l(l+1)+m`` and that of the harmonic's value, returns statements
        that use them. They may use the variable ``l``, the degree, too.

    Returns
    -------
    list of str
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


def band(degree: int, language: Language) -> list[str]:
    """Write the function ``shrm_bandL`` of all real harmonics of one degree above 0."""
    number, count = language.number, 2 * degree + 1
    lines = [
        f"void shrm_band{degree}(vec3 d, out float y[{count}])",
        "{",
        "    float a0 = 1.0, b0 = 0.0;",
    ]
    for m in range(1, degree + 1):
        lines.append(
            f"    float a{m} = d.x * a{m - 1} - d.y * b{m - 1}, "
            f"b{m} = d.x * b{m - 1} + d.y * a{m - 1};"
        )
    lines += [
        f"    float p{m} = {_horner(_profile(degree, m), number)};" for m in range(degree + 1)
    ]
    lines += [f"    y[{degree + m}] = p{m} * a{m};" for m in range(degree + 1)]
    lines += [f"    y[{degree - m}] = p{m} * b{m};" for m in range(1, degree + 1)]
    return [*lines, "}"]


def _profile(degree: int, m: int) -> Array:
    """Return the polynomial in z of a real harmonic, without its part in x and y."""
    series = legendre.leg2poly([0.0] * degree + [1.0])
    factor = (2 * degree + 1) / (4 * np.pi) * (2 if m else 1)
    for k in range(degree - m + 1, degree + m + 1):
        factor /= k
    return np.asarray(np.sqrt(factor) * polynomial.polyder(series, m))


def _horner(coefficients: Array, number: Callable[[float], str]) -> str:
    """Write a polynomial in d.z."""
    text = ""
    for value in coefficients[::-1].tolist():
        text = f"({text}) * d.z + {number(value)}" if text else number(value)
    return text
