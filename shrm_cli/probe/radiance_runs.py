"""Radiance pictures of the oldest run lengths, which image libraries take for plain pixels.

A pixel of r = g = b = 1, which no light has, as the largest is 128 or more, says how often the one
before it is repeated, in place of its exponent. Of several in a row, each next one counts 256 times
as much.

References: Ward, Real Pixels, Graphics Gems II (1991), and ``oldreadcolrs`` of Radiance's color.c.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array
from shrm_cli.errors import ProbeError
from shrm_cli.probe.encoding import LONGEST
from shrm_cli.records import record

_SCANLINES = 8, 2**15 - 1
"""Pixels of the shortest and longest rows that may have run lengths of the newer kind."""
_MOST_MARKS = 4
"""A fifth one in a row would repeat a pixel four thousand million times."""
_BIAS = 128 + 8
"""The bias of the exponent, for mantissas that are integers."""


@record(eq=False)
class OldRuns:
    """The pixels of such a picture."""

    pixels: NDArray[np.uint8]
    """Mantissas and exponents, shape (H, W, 4)."""

    @classmethod
    def of(cls, path: Path, width: int, height: int) -> "OldRuns | None":
        """Read a Radiance picture; None if all pixels are stored, or runs are of the newer kind."""
        with open(path, "rb") as stream:
            head = stream.read(LONGEST)
            end = head.find(b"\n\n") + 2
            start = head.find(b"\n", end) + 1
            first = head[start : start + 2]
            is_newer = first == b"\x02\x02" and _SCANLINES[0] <= width <= _SCANLINES[1]
            is_plain = stream.seek(0, 2) - start >= 4 * width * height
            if end < 2 or is_newer or is_plain:
                return None
            stream.seek(start)
            stored = np.frombuffer(stream.read(), np.uint8)
        stored = stored[: len(stored) // 4 * 4].reshape(-1, 4)
        marks = (stored[:, :3] == 1).all(axis=1)
        pixels, places = np.flatnonzero(~marks), np.flatnonzero(marks)
        owners = np.searchsorted(pixels, places) - 1
        repeats = np.ones(len(pixels), np.int64)
        is_whole = bool((owners >= 0).all())  # or there is a mark before the first pixel
        if is_whole:
            before = places - pixels[owners] - 1
            counts = stored[places, 3] * 256.0 ** np.minimum(before, _MOST_MARKS)
            np.add.at(repeats, owners, counts.astype(np.int64))
        if not is_whole or repeats.sum() != width * height:
            raise ProbeError(f"{path}: damaged or truncated; copy or export it again")
        return cls(stored[pixels].repeat(repeats, axis=0).reshape(height, width, 4))

    def read(self, start: int, stop: int) -> Array:
        """Rows `start` .. `stop` - 1 as numbers, float32, shape (rows, width, 3)."""
        rows = self.pixels[start:stop]
        exponents = rows[..., 3:].astype(np.int32)
        scales = np.where(exponents > 0, np.ldexp(np.float32(1), exponents - _BIAS), 0)
        return (rows[..., :3] * scales).astype(np.float32)
