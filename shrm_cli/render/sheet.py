"""Sheets of pictures: a grid with a label under each (`SheetLayout`), or with names beside its rows
and columns (`Grid`).
"""

import textwrap
from bisect import bisect_left
from collections.abc import Callable, Iterable, Sequence
from math import ceil, isqrt

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.errors import OutputError
from shrm_cli.files.image import Picture
from shrm_cli.files.openimageio import oiio
from shrm_cli.records import record

MAX_PIXELS = 2**27
"""The most pixels of a sheet, which are 1.5 GiB as 32-bit floats."""

PAPER = 0.02
"""Linear grey of the paper, which is 39 of 255 in sRGB; the labels are 1."""

_FAILED = 0.05
"""Linear grey of a cell without a picture."""
_LETTER = 0.6
"""Width of a letter as a part of the font's height, on the safe side."""
_LINES = 8
"""The most lines of an error in a cell."""


@record
class SheetLayout:
    """Where the tiles of a sheet lie, in pixels."""

    count: int
    columns: int
    """`count` and `columns`: how many tiles there are, and how many of them stand beside each
    other."""
    tile: int
    """Width of a tile."""
    tall: int | None = None
    """Height of a tile; by default tiles are square."""

    @property
    def tile_height(self) -> int:
        return self.tile if self.tall is None else self.tall

    @property
    def gap(self) -> int:
        """Width of the space between tiles and around the sheet."""
        return max(self.tile // 32, 2)

    @property
    def font_size(self) -> int:
        return max(self.tile // 24, 10)

    @property
    def label_height(self) -> int:
        return 2 * self.font_size

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width of the sheet."""
        rows = ceil(self.count / self.columns)
        width = self.columns * (self.tile + self.gap) + self.gap
        return rows * (self.tile_height + self.label_height + self.gap) + self.gap, width

    def origin(self, index: int) -> tuple[int, int]:
        """Return row and column of a tile's upper left pixel; its label begins right below."""
        row, column = divmod(index, self.columns)
        return (
            self.gap + row * (self.tile_height + self.label_height + self.gap),
            self.gap + column * (self.tile + self.gap),
        )

    def cut(self, sheet: Picture) -> list[Picture]:
        """Cut the tiles out of a sheet."""
        places = [self.origin(index) for index in range(self.count)]
        return [
            sheet[top : top + self.tile_height, left : left + self.tile] for top, left in places
        ]


def arrange(
    count: int, tile: int, columns: int | None = None, tall: int | None = None
) -> SheetLayout:
    """Lay out a sheet.

    `columns` are tiles beside each other; by default the sheet is as square as possible. `tall` is
    the height of a tile; by default tiles are square.
    """
    wanted = columns or isqrt(count - 1) + 1
    layout = SheetLayout(count, min(wanted, count), tile, tall)
    _check_size(layout.shape, "`size` or fewer maps")
    return layout


def _check_size(shape: tuple[int, int], smaller: str) -> None:
    """Refuse a sheet of more than `MAX_PIXELS` pixels, and say what would make it smaller."""
    height, width = shape
    if height * width > MAX_PIXELS:
        raise OutputError(
            f"a sheet of {width} x {height} pixels is more than {MAX_PIXELS:,}; give a smaller "
            f"{smaller}"
        )


def draw_sheet(layout: SheetLayout, tiles: Sequence[Picture], labels: Sequence[str]) -> Picture:
    """Put tiles on a dark grey sheet, their labels in white, shape (*layout.shape, 3).

    `tiles`, each of shape (tile_height, tile, 3), are linear and already exposed; the paper and the
    labels are not exposed; see `text_coverage` about labels that are wider than their tile.
    """
    sheet = np.full((*layout.shape, 3), PAPER, dtype=np.float32)
    for index, (tile, label) in enumerate(zip(tiles, labels, strict=True)):
        top, left = layout.origin(index)
        columns = slice(left, left + layout.tile)
        bottom = top + layout.tile_height
        sheet[top:bottom, columns] = tile
        ink = text_coverage(label, layout.font_size, layout.tile, layout.label_height)
        sheet[bottom : bottom + layout.label_height, columns] += (1 - PAPER) * ink
    return sheet


@record
class Grid:
    """Where the cells of a sheet lie that has names of rows and columns, in pixels."""

    rows: int
    columns: int
    tile: int
    """Width and height of a cell."""

    @property
    def gap(self) -> int:
        """Space between cells and around the sheet."""
        return max(self.tile // 32, 2)

    @property
    def font_size(self) -> int:
        return max(self.tile // 16, 11)

    @property
    def label(self) -> int:
        """Height of a line of text with the space around it."""
        return 2 * self.font_size

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width of the sheet."""
        step = self.tile + self.gap
        return (
            self.label + self.gap + self.rows * step,
            self.label + self.gap + self.columns * step,
        )

    def origin(self, row: int, column: int) -> tuple[int, int]:
        """Return row and column of a cell's upper left pixel."""
        step = self.tile + self.gap
        return self.label + row * step, self.label + column * step

    def check(self) -> None:
        """Check that the sheet is not too large."""
        _check_size(self.shape, "`size`, or fewer probes or materials")


def draw_grid(
    grid: Grid,
    heads: Sequence[str],
    sides: Sequence[str],
    tiles: Iterable[tuple[int, int, Picture | str]],
) -> Picture:
    """Put pictures on dark grey, names above columns and beside rows, shape (*grid.shape, 3).

    `heads` and `sides` are names of the columns and of the rows; they are shortened where they are
    too wide. `tiles` are row and column of a cell, and its picture, shape (tile, tile, 3), linear
    and exposed, or why there is none.
    """
    sheet = np.full((*grid.shape, 3), PAPER, dtype=np.float32)
    ink = 1 - PAPER
    for column, name in enumerate(heads):
        _, left = grid.origin(0, column)
        strip = text_coverage(name, grid.font_size, grid.tile, grid.label)
        sheet[: grid.label, left : left + grid.tile] += ink * strip
    for row, name in enumerate(sides):
        top, _ = grid.origin(row, 0)
        strip = np.rot90(text_coverage(name, grid.font_size, grid.tile, grid.label))
        sheet[top : top + grid.tile, : grid.label] += ink * strip
    for row, column, content in tiles:
        top, left = grid.origin(row, column)
        place = sheet[top : top + grid.tile, left : left + grid.tile]
        place[:] = _failure(grid, content) if isinstance(content, str) else content
    return sheet


def _failure(grid: Grid, text: str) -> Array:
    """Return a cell that says why there is no picture."""
    font = max(grid.font_size * 3 // 4, 9)
    letters = max(int(grid.tile / (_LETTER * font)), 8)
    lines = textwrap.wrap(text, letters, max_lines=_LINES, placeholder=" ...")
    height = font * 3 // 2
    lines = lines[: max(grid.tile // height, 1)]
    cell = np.full((grid.tile, grid.tile, 3), _FAILED, dtype=np.float32)
    top = (grid.tile - len(lines) * height) // 2
    for line in lines:
        cell[top : top + height] += 0.6 * text_coverage(line, font, grid.tile, height)
        top += height
    return cell


# ---- lines of text, in the font of OpenImageIO ---------------------------------------------------

_ELLIPSIS = "..."  # the font has no single character for an ellipsis


def shorten(text: str, fits: Callable[[str], bool]) -> str:
    """Shorten a text in its middle until it fits, to nothing if not even the ellipsis does."""
    if fits(text):
        return text

    def keep(count: int) -> str:
        return text[: count - count // 2] + _ELLIPSIS + text[len(text) - count // 2 :]

    too_many = bisect_left(range(len(text)), True, key=lambda count: not fits(keep(count)))
    return keep(too_many - 1) if too_many else ""


def text_coverage(text: str, font_size: int, width: int, height: int) -> Array:
    """Draw a text in the middle of a strip, in two lines where one is too wide.

    A line that is still too wide is shortened in its middle.

    Returns an array of float32 of shape (height, width, 1): the fraction of each pixel that the
    text covers.
    """
    # The name of a file may hold bytes that are not text.
    text = text.encode("utf-8", "replace").decode()
    strip = oiio.ImageBufAlgo.zero(oiio.ROI(0, width, 0, height, 0, 1, 0, 1))
    for line, bottom in _lines(text, font_size, width, height):
        shown = shorten(line, lambda part: _width(part, font_size) <= width)
        left = (width - _width(shown, font_size)) // 2
        # The empty name of a font stands for the one that OpenImageIO's package contains.
        if not oiio.ImageBufAlgo.render_text(strip, left, bottom, shown, font_size, "", (1,)):
            raise OutputError(f"labels cannot be drawn ({strip.geterror()})")
    return np.asarray(strip.get_pixels(oiio.FLOAT))


def _lines(text: str, font_size: int, width: int, height: int) -> list[tuple[str, int]]:
    """Return the lines of a text with the rows that they stand on: two where one is too wide."""
    words = text.split(" ")
    if _width(text, font_size) <= width or len(words) == 1 or height < 2 * font_size:
        return [(text, height * 5 // 8)]
    halves = [(" ".join(words[:k]), " ".join(words[k:])) for k in range(1, len(words))]
    upper, lower = min(halves, key=lambda pair: max(_width(each, font_size) for each in pair))
    return [(upper, height * 2 // 5), (lower, height * 9 // 10)]


def _width(text: str, font_size: int) -> int:
    return oiio.ImageBufAlgo.text_size(text, font_size, "").xend
