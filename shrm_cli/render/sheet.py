"""Contact sheets: several pictures in a grid, with a label under each."""

from collections.abc import Sequence
from math import ceil, isqrt

import numpy as np
from numpy.typing import NDArray

from shrm_cli.errors import OutputError
from shrm_cli.files.lettering import text_coverage
from shrm_cli.records import record

Array = NDArray[np.floating]
Picture = NDArray[np.float32]

MAX_PIXELS = 2**27
"""The most pixels of a sheet, which are 1.5 GiB as 32-bit floats."""

PAPER = 0.02
"""Linear grey of the paper, which is 39 of 255 in sRGB; the labels are 1."""


@record
class SheetLayout:
    """Where the tiles of a sheet lie, in pixels.

    Attributes
    ----------
    count, columns : int
        How many tiles there are, and how many of them stand beside each other.
    tile : int
        Width of a tile.
    tall : int, optional
        Height of a tile; by default tiles are square.
    """

    count: int
    columns: int
    tile: int
    tall: int | None = None

    @property
    def tile_height(self) -> int:
        """Height of a tile."""
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


def arrange(
    count: int, tile: int, columns: int | None = None, tall: int | None = None
) -> SheetLayout:
    """Lay out a sheet.

    Parameters
    ----------
    count : int
        Number of tiles.
    tile : int
        Width of a tile, pixels.
    columns : int, optional
        Tiles beside each other; by default the sheet is as square as possible.
    tall : int, optional
        Height of a tile; by default tiles are square.

    Raises
    ------
    OutputError
        If the sheet has more than `MAX_PIXELS` pixels.
    """
    wanted = columns or isqrt(count - 1) + 1
    layout = SheetLayout(count, min(wanted, count), tile, tall)
    height, width = layout.shape
    if height * width > MAX_PIXELS:
        raise OutputError(
            f"a sheet of {width} x {height} pixels is more than {MAX_PIXELS:,}; give a smaller "
            "`size` or fewer maps"
        )
    return layout


def draw_sheet(layout: SheetLayout, tiles: Sequence[Picture], labels: Sequence[str]) -> Picture:
    """Put tiles on a dark grey sheet with their labels in white.

    Parameters
    ----------
    layout : SheetLayout
    tiles : sequence of ndarray, shape (tile_height, tile, 3)
        Linear and already exposed; the paper and the labels are not exposed.
    labels : sequence of str
        A label is shortened in its middle if it is wider than its tile.

    Returns
    -------
    ndarray of float32, shape (*layout.shape, 3)

    Raises
    ------
    OutputError
        If the labels cannot be drawn.
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
