"""The pixels of images, brought to a grid in blocks of rows, without NaN or infinite ones."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array
from shrm_cli.errors import ProbeError
from shrm_cli.layouts import Layout
from shrm_cli.probe.image import ProbeImage
from shrm_cli.probe.layout import clear_unused, stack_faces
from shrm_cli.probe.pixels import PixelReport, fill_nonfinite, find_nonfinite, refuse_nonfinite
from shrm_cli.records import record
from shrm_cli.sphere.cube import reoriented
from shrm_cli.sphere.grid.base import Grid
from shrm_cli.vocabulary import Orientation

Block = tuple[int, Array, Array]
"""First row, pixels of shape (rows, width, 3), weights as `Grid.weights` has them."""

_BLOCK_PIXELS = 2**20
_NOTHING_FINITE = "{}: nothing is finite to fill NaN or infinite pixels from; export it again"
_SMALL_FACE = 1024
"""Texels along the edge of the largest face of a cube that is read as a whole, which is faster."""
_HOLE_ROWS = 32
"""Rows that are read before and behind a block with holes, at first."""


@record(eq=False)
class BlockReader:
    """Reads the pixels of a probe.

    Attributes
    ----------
    name : str
        What messages call the probe.
    images : tuple of ProbeImage
        One, or six where each face of a cube is an image of its own.
    layout : Layout
        Of the images.
    orientation : {"openexr", "gl"}, optional
        Of the faces of a cube in the images.
    grid : Grid
        What the pixels are brought to.
    fix_nonfinite : bool
        Whether NaN and infinite pixels are filled instead of refused.
    report : PixelReport
        What is added to.
    """

    name: str
    images: tuple[ProbeImage, ...]
    layout: Layout
    orientation: Orientation | None
    grid: Grid
    fix_nonfinite: bool
    report: PixelReport

    def blocks(self) -> Iterator[Block]:
        """Yield the image in blocks of rows, by faces, or as a whole where it cannot be cut.

        Raises
        ------
        ProbeError
            If a file is damaged, or has NaN or infinite pixels that are not to be filled.
        """
        if self.grid.most_pixels is None:
            return self._by_rows()
        if self.layout == "faces" and len(self.images) > 1 and self.grid.size > _SMALL_FACE:
            return self._by_faces()
        return self._whole()

    def _by_faces(self) -> Iterator[Block]:
        """Yield one face after the other, each from an image of its own."""
        for face, image in enumerate(self.images):
            pixels = image.read(0, image.height)
            bad = find_nonfinite(pixels, 0, self.report)
            if bad is not None and not self.fix_nonfinite:
                refuse_nonfinite(image.name, self.report)
            if bad is not None:
                pixels = fill_nonfinite(pixels)
                if not np.isfinite(pixels).all():
                    raise ProbeError(_NOTHING_FINITE.format(image.name))
            pixels = reoriented(pixels, face, self.orientation or "openexr")
            start = face * self.grid.size
            yield start, pixels, self.grid.weights(start, start + self.grid.size)

    def _by_rows(self) -> Iterator[Block]:
        """Yield blocks of rows of a single image.

        NaN and infinite pixels that are not to be filled are counted here, all of them, and
        refused at the end.
        """
        image = self.images[0]
        height, width = self.grid.shape
        rows = max(_BLOCK_PIXELS // width, 1)
        rows = -(-rows // image.row_multiple) * image.row_multiple
        for start in range(0, height, rows):
            stop = min(start + rows, height)
            pixels = image.read(start, stop)
            bad = find_nonfinite(pixels, start, self.report)
            if bad is not None and self.fix_nonfinite:
                pixels = self._filled_rows(start, stop)
            elif bad is not None:
                pixels = np.where(bad[..., None], np.float32(0), pixels)
            yield start, pixels, self.grid.weights(start, stop)
        if not self.fix_nonfinite:
            refuse_nonfinite(self.name, self.report)

    def _filled_rows(self, start: int, stop: int) -> Array:
        """Rows without holes, the same however the image is cut into blocks.

        A pixel at depth k of a hole depends on the k rows above and below it, so as many are
        read as the deepest one needs.
        """
        height = self.grid.shape[0]
        margin = _HOLE_ROWS
        while True:
            first, last = max(start - margin, 0), min(stop + margin, height)
            is_whole = last - first == height
            around = fill_nonfinite(
                self.images[0].read(first, last),
                wraps=self.grid.wraps,
                rounds=None if is_whole else margin,
            )
            pixels = around[start - first : stop - first]
            if np.isfinite(pixels).all():
                return pixels
            if is_whole:
                raise ProbeError(_NOTHING_FINITE.format(self.name))
            margin *= 4

    def _whole(self) -> Iterator[Block]:
        """Yield all images as one block."""
        used = self.grid.used()
        parts = []
        for image in self.images:
            part = image.read(0, image.height)
            if used is not None:
                part[~used] = 0
            clear_unused(part, self.layout)
            find_nonfinite(part, 0, self.report)
            if not self.fix_nonfinite:
                refuse_nonfinite(image.name, self.report)
            parts.append(part)
        pixels = np.concatenate(parts) if len(parts) > 1 else parts[0]
        del parts, part  # or the image would be in memory twice
        if self.orientation is not None:
            pixels = stack_faces(pixels, self.layout, self.orientation)
        if self.report.nonfinite:
            pixels = self._filled(pixels, used)
        yield 0, pixels, self.grid.weights()

    def _filled(self, pixels: Array, used: NDArray[np.bool_] | None) -> Array:
        """The whole image without holes; each of the grid's faces is filled from itself."""
        height, width = self.grid.shape
        used = np.ones((height, width), dtype=bool) if used is None else used
        faces = self.grid.faces
        pictures = pixels.reshape(faces, height // faces, width, 3)
        masks = used.reshape(faces, height // faces, width)
        filled = np.concatenate(
            [
                fill_nonfinite(part, self.grid.wraps, mask)
                for part, mask in zip(pictures, masks, strict=True)
            ]
        )
        if not np.isfinite(filled).all():
            raise ProbeError(_NOTHING_FINITE.format(self.name))
        return filled
