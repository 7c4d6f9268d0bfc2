"""The picture of a sheet: probes in columns under their names, materials in rows beside theirs."""

import textwrap
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from shrm_cli.errors import OutputError
from shrm_cli.files.lettering import text_coverage
from shrm_cli.files.picture import Picture
from shrm_cli.records import record
from shrm_cli.render.sheet import MAX_PIXELS, PAPER

Array = NDArray[np.floating]

_FAILED = 0.05
"""Linear grey of a cell without a picture."""
_LETTER = 0.6
"""Width of a letter as a part of the font's height, on the safe side."""
_LINES = 8
"""The most lines of an error in a cell."""


@record
class Grid:
    """Where the cells of a sheet lie, in pixels.

    Attributes
    ----------
    rows, columns : int
    tile : int
        Width and height of a cell.
    """

    rows: int
    columns: int
    tile: int

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
        """Check that the sheet is not too large.

        Raises
        ------
        OutputError
            If it has more than `shrm_cli.render.sheet.MAX_PIXELS` pixels.
        """
        height, width = self.shape
        if height * width > MAX_PIXELS:
            raise OutputError(
                f"a sheet of {width} x {height} pixels is more than {MAX_PIXELS:,}; give a smaller "
                "`size`, or fewer probes or materials"
            )


def draw_grid(
    grid: Grid,
    heads: Sequence[str],
    sides: Sequence[str],
    tiles: Iterable[tuple[int, int, Picture | str]],
) -> Picture:
    """Put pictures on dark grey paper, with names above columns and, upright, beside rows.

    Parameters
    ----------
    grid : Grid
    heads, sides : sequence of str
        Names of the columns and of the rows; they are shortened where they are too wide.
    tiles : iterable of (int, int, ndarray or str)
        Row and column of a cell, and its picture, shape (tile, tile, 3), linear and exposed, or
        why there is none.

    Returns
    -------
    ndarray of float32, shape (*grid.shape, 3)

    Raises
    ------
    OutputError
        If text cannot be drawn.
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
