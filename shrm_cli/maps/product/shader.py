"""Product textures as source code: the functions of a view, turned to world axes, times the light.

The light is a short array of coefficients that the program sets, so that it may turn or change in
every frame. The functions of the view are turned to world axes instead of the light into the
surface's, because those of grey BRDFs have one channel. By Euler angles the rotation is ``Rz(a)
Ry(b) Rz(c)``, and ``Ry(b)`` a turn about z between two quarter turns, whose matrices are the table.
"""

from functools import partial

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.errors import MapError
from shrm_cli.maps.product.product import LitProduct, ProductMap, ProductTexture
from shrm_cli.maps.shader.source import Source, Table, Words, tangent_function
from shrm_cli.sphere.rotation import transform_coefficients

_QUARTER = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
"""The rotation that carries the axis z to y."""
_MOST_ORDER = 15
_BRUSHED = """\
vec3 shrm_brushed_radiance(vec3 n, vec3 t, vec3 v)
{
    vec3 b = vec3(n.y * t.z - n.z * t.y, n.z * t.x - n.x * t.z, n.x * t.y - n.y * t.x);
    vec3 sum = vec3(0.0, 0.0, 0.0);
    KIND own[MOST], turned[MOST];
    float up = max(dot(n, v), 0.0), x, y, tilt, ca, sa, cc, sc;
    int l, m, k, row, column;
    x = min(max((dot(t, v) / (1.0 + up) + 1.0) * HALF - 0.5, 0.0), LAST);
    y = min(max((dot(b, v) / (1.0 + up) + 1.0) * HALF - 0.5, 0.0), LAST);
    column = int(min(x, LAST - 1.0));
    row = int(min(y, LAST - 1.0));
    x -= float(column);
    y -= float(row);
    tilt = sqrt(n.x * n.x + n.y * n.y);
    ca = tilt > 1e-6 ? n.x / max(tilt, 1e-6) : 1.0;
    sa = tilt > 1e-6 ? n.y / max(tilt, 1e-6) : 0.0;
    cc = ca * b.y - sa * b.x;
    sc = ca * t.y - sa * t.x;
    for (l = 0; l <= ORDER; ++l) {
        for (k = 0; k <= 2 * l; ++k) {
            own[k] = FETCHED;
        }
TURN_C
TO_SIDE
TURN_B
TO_TOP
TURN_A
        for (k = 0; k <= 2 * l; ++k) {
            GROW
        }
    }
    return sum;
}
vec3 shrm_radiance(vec3 n, vec3 v)
{
    return shrm_brushed_radiance(n, shrm_tangent(n), v);
}"""
_TURN_Z = """\
        {
            float c = 1.0, s = 0.0, next;
            KIND cosine, sine;
            for (m = 1; m <= l; ++m) {
                next = c * COS - s * SIN;
                s = c * SIN + s * COS;
                c = next;
                cosine = own[l + m];
                sine = own[l - m];
                own[l + m] = LESS;
                own[l - m] = MORE;
            }
        }"""
_MULTIPLY = """\
        for (k = 0; k <= 2 * l; ++k) {
            turned[k] = ZERO;
            for (m = 0; m <= 2 * l; ++m) {
                ADD
            }
        }
        for (k = 0; k <= 2 * l; ++k) {
            own[k] = turned[k];
        }"""


def source(made: ProductMap | LitProduct, textures: str) -> Source:
    """Return what the shader of a product texture consists of.

    Light that programs are to set is 0 where the map holds none. There is no code where a parameter
    of the BRDF varies, or the order is above 15.
    """
    black = np.zeros(((made.order + 1) ** 2, 3))
    lit = made if isinstance(made, LitProduct) else made.lit(black)
    if lit.varies:
        raise MapError(
            "there is no code for a product texture whose parameters vary; make one of single "
            "values by shrm product"
        )
    (texture,) = lit.product.textures
    order = texture.order
    if order > _MOST_ORDER:
        raise MapError(
            f"code for product textures reads orders up to {_MOST_ORDER}, not {order}: devices "
            "have arrays of 256 images"
        )
    return Source(
        "The light of a probe as a BRDF reflects it: a product texture.",
        partial(_functions, texture),
        table=Table(
            (1, (order + 1) ** 2, 2 * order + 1),
            partial(_quarter_turns, order),
            "the quarter turn of each degree, a row for each harmonic",
            in_code=False,
        ),
        images=Table(
            (len(black), texture.size, texture.size),
            partial(_images, texture),
            "the file's channels in their order, a layer each, without filtering",
            in_code=False,
        ),
        lighting=lit.lighting,
        takes_tangent=True,
    )


def _images(made: ProductTexture) -> Array:
    """Return the product functions as layers of RGB, shape (coefficients, N, N, 3)."""
    layers = np.moveaxis(made.table, 2, 0)
    return np.broadcast_to(layers, (*layers.shape[:3], 3))


def _quarter_turns(order: int) -> Array:
    """Return the quarter turn of each degree, one below the other, (1, rows, columns, 3)."""
    count = (order + 1) ** 2
    whole = transform_coefficients(np.eye(count), _QUARTER)
    result = np.zeros((1, count, 2 * order + 1, 3))
    for degree in range(order + 1):
        rows = slice(degree**2, (degree + 1) ** 2)
        result[0, rows, : 2 * degree + 1] = whole[rows, rows, None]
    return result


def _functions(made: ProductTexture, words: Words) -> list[str]:
    """Write the look-up of the view's functions, their rotation, and the product."""
    speech = words.language
    is_grey = made.channels == 1
    kind = "float" if is_grey else "vec3"

    def scaled(factor: str, value: str) -> str:
        return f"{factor} * {value}" if is_grey else speech.scale(factor, value)

    def added(a: str, b: str) -> str:
        return f"({a} + {b})" if is_grey else speech.add(a, b)

    def turn(cosine: str, sine: str) -> str:
        parts = {
            "LESS": added(scaled("c", "cosine"), scaled("(-s)", "sine")),
            "MORE": added(scaled("s", "cosine"), scaled("c", "sine")),
            "COS": cosine, "SIN": sine,
        }  # fmt: skip
        return _with(_TURN_Z, parts)

    def multiply(row: str, column: str) -> str:
        entry = f"{words.cell('0', f'l * l + {row}', column)}.x"
        return _MULTIPLY.replace(
            "ADD", f"turned[k] = {added('turned[k]', scaled(entry, 'own[m]'))};"
        )

    corners = [
        f"shrm_own({column}, {row}, l * l + k)"
        for row in ("row", "row + 1")
        for column in ("column", "column + 1")
    ]
    fetched = f"mix(mix({corners[0]}, {corners[1]}, x), mix({corners[2]}, {corners[3]}, x), y)"
    light = "shrm_lighting[l * l + k]"
    product = speech.scale("own[k]", light) if is_grey else speech.times("own[k]", light)
    parts = {
        "FETCHED": f"{fetched}.x" if is_grey else fetched,
        "TURN_C": turn("cc", "sc"), "TURN_B": turn("n.z", "tilt"), "TURN_A": turn("ca", "sa"),
        "TO_SIDE": multiply("m", "k"), "TO_TOP": multiply("k", "m"),
        "GROW": speech.grow("sum", product),
        "ZERO": "0.0" if is_grey else "vec3(0.0, 0.0, 0.0)",
        "KIND": kind, "MOST": str(2 * made.order + 1), "ORDER": str(made.order),
        "HALF": speech.number(made.size / 2), "LAST": speech.number(float(made.size - 1)),
    }  # fmt: skip
    return [*tangent_function(["tangent"]), *_with(_BRUSHED, parts).split("\n")]


def _with(text: str, parts: dict[str, str]) -> str:
    """Return a text whose words in capitals are replaced."""
    for word, meaning in parts.items():
        text = text.replace(word, meaning)
    return text
