"""Contact sheets: several pictures in a grid, with a label under each."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, isqrt

import numpy as np
from numpy.typing import NDArray

from shrm_cli.errors import OutputError
from shrm_cli.files.lettering import text_coverage

Array = NDArray[np.floating]
Picture = NDArray[np.float32]

MAX_PIXELS = 2**27
"""Of a sheet: 1.5 GiB of float."""

PAPER = 0.02
"""Linear grey of the sheet, sRGB 39; the labels are 1."""


@dataclass(frozen=True)
class SheetLayout:
    """Where the tiles of a sheet lie, in pixels.

    Attributes
    ----------
    count, columns : int
        Tiles, and how many stand beside each other.
    tile : int
        Width and height of a tile.
    """

    count: int
    columns: int
    tile: int

    @property
    def gap(self) -> int:
        """Between tiles and around the sheet."""
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
        return rows * (self.tile + self.label_height + self.gap) + self.gap, width

    def origin(self, index: int) -> tuple[int, int]:
        """Row and column of a tile's upper left pixel; its label begins `tile` rows below."""
        row, column = divmod(index, self.columns)
        return (
            self.gap + row * (self.tile + self.label_height + self.gap),
            self.gap + column * (self.tile + self.gap),
        )


def arrange(count: int, tile: int, columns: int | None = None) -> SheetLayout:
    """Lay out a sheet: in `columns` columns, by default as square as possible.

    Raises
    ------
    OutputError
        If it has more than `MAX_PIXELS` pixels.
    """
    wanted = columns or isqrt(count - 1) + 1
    layout = SheetLayout(count, min(wanted, count), tile)
    height, width = layout.shape
    if height * width > MAX_PIXELS:
        raise OutputError(
            f"a sheet of {width} x {height} pixels is more than {MAX_PIXELS:,}; give a smaller "
            "--size or fewer maps"
        )
    return layout


def draw_sheet(layout: SheetLayout, tiles: Sequence[Picture], labels: Sequence[str]) -> Picture:
    """Put tiles on a dark grey sheet with their labels in white.

    Parameters
    ----------
    layout : SheetLayout
    tiles : sequence of ndarray, shape (tile, tile, 3)
        Linear, already exposed: paper and labels are not.
    labels : sequence of str
        Shortened in the middle where they are too wide.

    Returns
    -------
    ndarray of float32, shape (*layout.shape, 3)
    """
    sheet = np.full((*layout.shape, 3), PAPER, dtype=np.float32)
    for index, (tile, label) in enumerate(zip(tiles, labels, strict=True)):
        top, left = layout.origin(index)
        columns = slice(left, left + layout.tile)
        sheet[top : top + layout.tile, columns] = tile
        bottom = top + layout.tile
        ink = text_coverage(label, layout.font_size, layout.tile, layout.label_height)
        sheet[bottom : bottom + layout.label_height, columns] += (1 - PAPER) * ink
    return sheet
