"""Where the cubes of a map lie in one array of images, which WebGL2 and any other API can read.

All images of the array, its layers, have one size. A cube is a rectangle of 3 x 2 faces in it::

    +X  +Y  +Z
    -X  -Y  -Z

Each face has OpenEXR's orientation (its right and down are those of `sphere.cube`), and a rim of
one texel all around. The rim is copied from the faces beside it, and a corner of the rim is the
mean of the three texels that meet there, so that bilinear filtering within a face has no seams.
"""

from collections.abc import Sequence

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.errors import MapError
from shrm_cli.records import record
from shrm_cli.sphere.cube import face_axes

MAX_LAYERS = 256
"""The most layers of an array: every WebGL2 takes so many."""
MAX_EDGE = 8192
"""The most texels along an edge of a layer; all WebGL2 take 2048, and desktops 16384."""


@record
class Run:
    """Cubes of one size that lie in a regular grid."""

    count: int
    size: int
    """`count` and `size`: the number of cubes, and texels along a face's edge without its rim."""
    layer: int
    """The layer of the first cube."""
    left: int = 0
    top: int = 0
    """`left` and `top`: the corner of its rectangle, in texels."""
    columns: int = 1
    rows: int = 1
    """`columns` and `rows`: cubes beside each other and below each other in a layer. They follow
    row by row, then layer by layer."""

    @property
    def edge(self) -> int:
        """Texels along a face's edge with its rim."""
        return self.size + 2

    def corner(self, cube: int) -> tuple[int, int, int]:
        """Return layer, left and top of the rectangle of a cube."""
        layer, cell = divmod(cube, self.columns * self.rows)
        row, column = divmod(cell, self.columns)
        return (
            self.layer + layer,
            self.left + 3 * self.edge * column,
            self.top + 2 * self.edge * row,
        )


@record
class Pages:
    """The size of an array, and the runs that lie in it."""

    width: int
    height: int
    layers: int
    runs: tuple[Run, ...]


def arrange(stacks: Sequence[tuple[int, int]]) -> Pages:
    """Choose where stacks of cubes lie.

    Layers are about as large as a cube of the largest size, or as a grid of them where there would
    be more than `MAX_LAYERS`, such that they have the fewest texels in all. Single smaller cubes,
    such as the levels of a split sum, share layers.

    `stacks` are the number of cubes of each stack, and their size.
    """
    largest = max(size for _, size in stacks) + 2
    # Layers that smaller cubes fill without a rest are a little larger than the largest cube.
    edges = {-(-largest // (size + 2)) * (size + 2) for _, size in stacks}
    edges |= {largest * grid for grid in range(1, MAX_EDGE // (3 * largest) + 1)}
    tried = [_arranged(stacks, 3 * edge, 2 * edge) for edge in sorted(edges)]
    fitting = [each for each in tried if each.layers <= MAX_LAYERS and each.width <= MAX_EDGE]
    if fitting:
        return min(fitting, key=lambda each: each.layers * each.width * each.height)
    count = sum(count for count, _ in stacks)
    raise MapError(
        f"{count} cubes of size {largest - 2} do not fit into {MAX_LAYERS} layers of {MAX_EDGE} "
        "texels; make the map with a lower `size` or fewer coefficients"
    )


def _arranged(stacks: Sequence[tuple[int, int]], width: int, height: int) -> Pages:
    """Place stacks in layers of a given size, the largest cubes first."""
    runs: dict[int, Run] = {}
    layers = left = top = shelf = 0  # the next free place of the layer that single cubes share
    for index in sorted(range(len(stacks)), key=lambda k: -stacks[k][1]):
        count, size = stacks[index]
        across, down = 3 * (size + 2), 2 * (size + 2)
        columns, rows = width // across, height // down
        if count > 1:
            runs[index] = Run(count, size, layers, 0, 0, columns, rows)
            layers += -(-count // (columns * rows))
            shelf = 0
            continue
        if shelf and left + across > width:
            left, top, shelf = 0, top + shelf, down
        if not shelf or top + down > height:
            layers, left, top, shelf = layers + 1, 0, 0, down
        runs[index] = Run(1, size, layers - 1, left, top)
        left += across
    return Pages(width, height, layers, tuple(runs[index] for index in range(len(stacks))))


def with_rims(stack: Array) -> Array:
    """Put a rim of one texel around the faces of cubes, shape (6, N+2, N+2, K, 3).

    `stack`, of shape (6N, N, K, 3), holds cubes in OpenEXR's orientation. Border-sampled faces hold
    their edges, so that filtering never gives the rim a weight.
    """
    size = stack.shape[1]
    faces = stack.reshape(6, size, size, *stack.shape[2:])
    result = np.pad(faces, ((0, 0), (1, 1), (1, 1), (0, 0), (0, 0)))
    middle = 2 * np.arange(size) + 1 - size  # places of texels across a face, from -size to size
    axes = np.rint(face_axes()).astype(int)
    for face, (right, down, forward) in enumerate(axes):
        for side, along, index in (
            (-right, down, np.s_[1:-1, 0]),
            (right, down, np.s_[1:-1, -1]),
            (-down, right, np.s_[0, 1:-1]),
            (down, right, np.s_[-1, 1:-1]),
        ):
            other = int(np.argmax(axes[:, 2] @ side))
            edge = size * (forward + side) + middle[:, None] * along
            column, row = (
                np.clip((edge @ axes[other, k] + size) // 2, 0, size - 1) for k in (0, 1)
            )
            result[face][index] = faces[other, row, column]
    for row, column in ((0, 0), (0, -1), (-1, 0), (-1, -1)):
        inner_row, inner_column = (1 if k == 0 else -2 for k in (row, column))
        meeting = (
            result[:, inner_row, inner_column]
            + result[:, row, inner_column]
            + result[:, inner_row, column]
        )
        result[:, row, column] = meeting / 3
    return result


def drawn(pages: Pages, stacks: Sequence[Array]) -> Array:
    """Draw cubes where they lie.

    `stacks` are each of shape (6N, N, K, 3).

    Returns an array of float32 of shape (layers, height, width, 3): texels where no cube lies are
    0; those beyond the range of float32 are infinite.
    """
    result = np.zeros((pages.layers, pages.height, pages.width, 3), dtype=np.float32)
    for run, stack in zip(pages.runs, stacks, strict=True):
        faces = with_rims(stack)
        for cube in range(run.count):
            layer, left, top = run.corner(cube)
            for face in range(6):
                x, y = left + face // 2 * run.edge, top + face % 2 * run.edge
                with np.errstate(over="ignore"):
                    result[layer, y : y + run.edge, x : x + run.edge] = faces[face, :, :, cube]
    return result
