"""Code that computes real spherical harmonics, in the convention of `sphere.harmonics`."""

from collections.abc import Callable


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
