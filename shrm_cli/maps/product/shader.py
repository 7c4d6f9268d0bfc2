"""Product textures as source code: the functions of a view, turned to world axes, times the light.

The light is a short array of coefficients that the program sets, so that it may turn or change in
every frame. The functions of the view are turned to world axes instead of the light into the
surface's, because those of grey BRDFs have one channel. By Euler angles the rotation is ``Rz(a)
Ry(b) Rz(c)``, and ``Ry(b)`` a turn about z between two quarter turns, whose matrices are the table.

Where parameters vary, the functions are the sums that `Steps` tells: of one parameter those of the
two values around its own, of two those of all textures, whose weights are more rows of the table.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.errors import MapError
from shrm_cli.maps.product.product import LitProduct, ProductMap, VaryingProduct
from shrm_cli.maps.product.steps import Steps
from shrm_cli.maps.shader.language import Language, filled, harmless
from shrm_cli.maps.shader.pages import MAX_EDGE, MAX_LAYERS
from shrm_cli.maps.shader.source import BRUSHED_BY_TANGENT, Source, Table, Words, tangent_function
from shrm_cli.records import record
from shrm_cli.sphere.rotation import transform_coefficients

_QUARTER = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
"""The rotation that carries the axis z to y."""
_SHARES = "first", "second"
"""What the code calls the shares of the ways of parameters that vary."""
_HEAD = "vec3 shrm_{}_radiance(vec3 n, vec3 t, vec3 v{})"
_RADIANCE = """\
HEAD
{
    vec3 b = vec3(n.y * t.z - n.z * t.y, n.z * t.x - n.x * t.z, n.x * t.y - n.y * t.x);
    vec3 sum = vec3(0.0, 0.0, 0.0);
    KIND own[MOST], turned[MOST];
    float up = max(dot(n, v), 0.0), x, y, tilt, ca, sa, cc, sc;
    int l, m, k, row, column;
DECLARED    x = min(max((dot(t, v) / (1.0 + up) + 1.0) * HALF - 0.5, 0.0), LAST);
    y = min(max((dot(b, v) / (1.0 + up) + 1.0) * HALF - 0.5, 0.0), LAST);
    column = int(min(x, LAST - 1.0));
    row = int(min(y, LAST - 1.0));
    x -= float(column);
    y -= float(row);
WEIGHED    tilt = sqrt(n.x * n.x + n.y * n.y);
    ca = tilt > 1e-6 ? n.x / max(tilt, 1e-6) : 1.0;
    sa = tilt > 1e-6 ? n.y / max(tilt, 1e-6) : 0.0;
    cc = ca * b.y - sa * b.x;
    sc = ca * t.y - sa * t.x;
    for (l = 0; l <= ORDER; ++l) {
        for (k = 0; k <= 2 * l; ++k) {
FETCHED
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


@record
class _Tiles:
    """Where images of one size lie in an array: one a layer, or several where they are many."""

    size: int
    """Texels along the edge of an image."""
    layers: int
    columns: int
    rows: int
    """`columns` and `rows`: of the images in a layer."""

    @classmethod
    def of(cls, count: int, size: int) -> "_Tiles":
        """Arrange images in no more layers than all devices have."""
        cells = -(-count // MAX_LAYERS)
        columns = next(k for k in range(1, cells + 1) if k * k >= cells)
        rows = -(-cells // columns)
        if columns * size > MAX_EDGE:
            raise MapError(
                f"{count} images of {size} x {size} texels do not fit into {MAX_LAYERS} layers of "
                f"{MAX_EDGE} texels; make the textures with a lower `size` or `order`"
            )
        return cls(size, -(-count // (columns * rows)), columns, rows)

    @property
    def cells(self) -> int:
        """The number of images in a layer."""
        return self.columns * self.rows

    def drawn(self, images: Array) -> Array:
        """Put images into their places.

        `images` are of shape (n, N, N, c).

        Returns an array of shape (layers, height, width, c).
        """
        size = self.size
        whole = np.zeros((self.layers * self.cells, *images.shape[1:]), dtype=images.dtype)
        whole[: len(images)] = images
        grid = whole.reshape(self.layers, self.rows, self.columns, size, size, -1).swapaxes(2, 3)
        return grid.reshape(self.layers, self.rows * size, self.columns * size, -1)

    def fetched(self, index: str) -> list[str]:
        """Write statements that fetch four texels of an image, and the text of their mean."""
        left, top, layer, lines = "column", "row", index, []
        if self.cells > 1:
            left, top, layer = "left", "top", "layer"
            lines = [
                f"layer = {index};",
                f"left = layer % {self.cells} % {self.columns} * {self.size} + column;",
                f"top = layer % {self.cells} / {self.columns} * {self.size} + row;",
                f"layer = layer / {self.cells};",
            ]
        above, below = (
            f"mix(shrm_own({left}, {y}, {layer}), shrm_own({left} + 1, {y}, {layer}), x)"
            for y in (top, f"{top} + 1")
        )
        return [*lines, f"mix({above}, {below}, y)"]


def source(made: ProductMap | LitProduct, textures: str) -> Source:
    """Return what the shader of a product texture consists of.

    Light that programs are to set is 0 where the map holds none.
    """
    order, count = made.order, (made.order + 1) ** 2
    lit = made if isinstance(made, LitProduct) else made.lit(np.zeros((count, 3)))
    product = lit.product
    steps = product.steps if isinstance(product, VaryingProduct) else None
    weights: Array = np.zeros((0, 0))
    about = "the quarter turn of each degree, a row for each harmonic"
    if steps is not None and product.varies > 1:
        weights = steps.weights.reshape(-1, len(product.textures))
        about = f"{about}, then weights"
    tiles = _Tiles.of(len(product.textures) * count, product.size)
    layout = "a layer each"
    if tiles.cells > 1:
        layout = f"{tiles.columns} x {tiles.rows} in a layer, row by row"
    return Source(
        "The light of a probe as a BRDF reflects it: a product texture.",
        partial(_functions, product, steps, tiles),
        table=Table(
            (1, count + len(weights), max(2 * order + 1, weights.shape[1])),
            partial(_table, order, weights),
            about,
            in_code=False,
        ),
        images=Table(
            (tiles.layers, tiles.rows * tiles.size, tiles.columns * tiles.size),
            lambda: tiles.drawn(_images(product)),
            f"the file's channels in their order, {layout}, without filtering",
            in_code=False,
        ),
        lighting=lit.lighting,
        takes_tangent=True,
        notes=() if steps is None else _about_shares(steps),
    )


def _about_shares(steps: Steps) -> list[str]:
    """Say what ``shrm_varied_radiance`` takes besides; the other functions take 0.5."""
    names = ", ".join(_SHARES[: len(steps.values)])
    return [
        f"shrm_varied_radiance(n, t, v, {names}): where parameters are on their ways, 0 .. 1; half",
        "way in the other functions.",
        *(
            f"{share}: of {harmless(name)} from {own[0]:g} to {own[-1]:g}."
            for share, (name, own) in zip(_SHARES, steps.values.items(), strict=False)
        ),
    ]


def _images(made: ProductMap) -> Array:
    """Return the product functions as images of RGB, shape (textures x coefficients, N, N, 3)."""
    images = np.concatenate([np.moveaxis(each.table, 2, 0) for each in made.textures])
    return np.broadcast_to(images, (*images.shape[:3], 3))


def _table(order: int, weights: Array) -> Array:
    """Return the quarter turn of each degree, one below the other, and then the weights.

    The shape is (1, rows, columns, 3), all channels of which are the same.
    """
    count = (order + 1) ** 2
    whole = transform_coefficients(np.eye(count), _QUARTER)
    result = np.zeros((count + len(weights), max(2 * order + 1, weights.shape[1])))
    for degree in range(order + 1):
        rows = slice(degree**2, (degree + 1) ** 2)
        result[rows, : 2 * degree + 1] = whole[rows, rows]
    result[count:, : weights.shape[1]] = weights
    return np.broadcast_to(result[None, ..., None], (1, *result.shape, 3))


def _functions(made: ProductMap, steps: Steps | None, tiles: _Tiles, words: Words) -> list[str]:
    """Write the look-up of the view's functions, their rotation, and the product."""
    speech = words.language
    is_grey = made.channels == 1
    zero = "0.0" if is_grey else "vec3(0.0, 0.0, 0.0)"

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
        return "\n".join(filled(_TURN_Z, parts))

    def multiply(row: str, column: str) -> str:
        entry = f"{words.cell('0', f'l * l + {row}', column)}.x"
        return _MULTIPLY.replace(
            "ADD", f"turned[k] = {added('turned[k]', scaled(entry, 'own[m]'))};"
        )

    mixing = _Mixing() if steps is None else _mixing(steps, made.order, words)
    *lines, value = tiles.fetched(mixing.index)
    value = f"{value}.x" if is_grey else value
    if steps is None:
        lines += [f"own[k] = {value};"]
    else:
        lines += [f"own[k] = {added('own[k]', scaled('weight[m]', value))};"]
        head = [f"own[k] = {zero};", f"for (m = 0; m < {mixing.count}; ++m) {{"]
        lines = [*head, *(f"    {line}" for line in lines), "}"]
    declared = [*mixing.declared, *["int left, top, layer;"] * (tiles.cells > 1)]
    light = "shrm_lighting[l * l + k]"
    product = speech.scale("own[k]", light) if is_grey else speech.times("own[k]", light)
    parts = {
        "HEAD": mixing.head,
        "DECLARED": _indented(declared, 4), "WEIGHED": _indented(mixing.weighed, 4),
        "FETCHED": _indented(lines, 12).rstrip("\n"),
        "TURN_C": turn("cc", "sc"), "TURN_B": turn("n.z", "tilt"), "TURN_A": turn("ca", "sa"),
        "TO_SIDE": multiply("m", "k"), "TO_TOP": multiply("k", "m"),
        "GROW": speech.grow("sum", product),
        "ZERO": zero,
        "KIND": "float" if is_grey else "vec3",
        "MOST": str(2 * made.order + 1), "ORDER": str(made.order),
        "HALF": speech.number(made.size / 2), "LAST": speech.number(float(made.size - 1)),
    }  # fmt: skip
    return [
        *tangent_function(["tangent"]),
        *mixing.before,
        *filled(_RADIANCE, parts),
        *mixing.after,
        *BRUSHED_BY_TANGENT,
    ]


@record
class _Mixing:
    """How the functions of several textures are joined, or those of a single one are taken."""

    head: str = _HEAD.format("brushed", "")
    """The head of the function that shades."""
    before: Sequence[str] = ()
    after: Sequence[str] = ()
    """`before` and `after`: other functions, in front of that and behind."""
    declared: Sequence[str] = ()
    weighed: Sequence[str] = ()
    """`declared` and `weighed`: declarations and statements in it, after which the array ``weight``
    holds the weights of textures."""
    count: int = 1
    """The number of textures that are joined."""
    index: str = "l * l + k"
    """The image of a harmonic of the texture m of these."""


def _mixing(steps: Steps, order: int, words: Words) -> _Mixing:
    """Join the textures of parameters that vary."""
    axes, images = list(steps.values.values()), (order + 1) ** 2
    shares = _SHARES[: len(axes)]
    last, *others = (words.language.number(float(len(own) - 2)) for own in axes)
    found = _Mixing(
        _HEAD.format("varied", "".join(f", float {share}" for share in shares)),
        [line for each in zip(shares, axes, strict=True) for line in _place(*each, words.language)],
        [_Mixing.head, "{", f"    return shrm_varied_radiance(n, t, v{', 0.5' * len(axes)});", "}"],
    )
    if not others:
        return replace(
            found,
            declared=[
                "float place = shrm_first(first), weight[2];",
                f"int below = int(min(place, {last}));",
            ],
            weighed=["weight[1] = place - float(below);", "weight[0] = 1.0 - weight[1];"],
            count=2,
            index=f"(below + m) * {images} + l * l + k",
        )
    count, width = steps.weights.shape[-1], len(axes[1])
    cells = [words.cell("0", f"below + {k}", "k") for k in (0, 1, width, width + 1)]
    near, far = (f"mix({a}, {b}, down)" for a, b in (cells[:2], cells[2:]))
    return replace(
        found,
        declared=[
            f"float across = shrm_first(first), down = shrm_second(second), weight[{count}];",
            f"int below = int(min(across, {last})), beside = int(min(down, {others[0]}));",
        ],
        weighed=[
            "across -= float(below);",
            "down -= float(beside);",
            f"below = {images} + below * {width} + beside;",
            f"for (k = 0; k < {count}; ++k) {{",
            f"    weight[k] = mix({near}, {far}, across).x;",
            "}",
        ],
        count=count,
        index=f"m * {images} + l * l + k",
    )


def _place(name: str, values: Sequence[float], language: Language) -> list[str]:
    """Write the function of the place among values at which a share of their way lies."""
    shares = ((np.array(values) - values[0]) / (values[-1] - values[0])).tolist()
    lines = [f"float shrm_{name}(float share)", "{", "    float place = 0.0;"]
    for low, high in pairwise(shares):
        slope = language.number(1 / (high - low))
        lines.append(
            f"    place += min(max((share - {language.number(low)}) * {slope}, 0.0), 1.0);"
        )
    return [*lines, "    return place;", "}"]


def _indented(lines: Sequence[str], by: int) -> str:
    return "".join(f"{' ' * by}{line}\n" for line in lines)
