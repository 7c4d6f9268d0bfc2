"""The 128 bits of a BC6H block: its modes, its partitions, and where each number lies.

A block of 4 x 4 texels is one line in the space of its colours, or two, with a number for each
texel that says where on its line it lies. Modes differ in how fine the ends of the lines are, and
in how far apart they may be: the first end is written whole, the others as differences from it.

References
----------
The Khronos Data Format Specification 1.3, section 20.2 (BPTC, "BC6H").
"""

import re
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from shrm_cli.records import record

Whole = NDArray[np.int64]


@record
class Mode:
    """How the ends of a block's lines are written."""

    code: int
    """The number that a block begins with."""
    lines: int
    """1 or 2."""
    bits: int
    """Of each channel of the first end."""
    differences: tuple[int, int, int]
    """Bits of the others in red, green and blue."""
    layout: str
    """Numbers of the block after the code, from the lowest bit: ``rw[9:0]`` are the bits 0 to 9 of
    the red of the first end, ``rw[10:11]`` its bits 11 and 10. The ends are w, x, y and z."""

    @property
    def is_whole(self) -> bool:
        """Whether all ends are written whole."""
        return self.differences == (self.bits,) * 3

    def runs(self) -> Iterator[tuple[int, int, int, int]]:
        """Yield the end, the channel, the lowest bit and how many bits follow upon each other."""
        for channel, end, first, last in re.findall(
            r"([rgb])([wxyz])\[(\d+):?(\d*)\]", self.layout
        ):
            high, low = int(first), int(last or first)
            of = "wxyz".index(end), "rgb".index(channel)
            if low <= high:
                yield *of, low, high - low + 1
            else:
                yield from ((*of, bit, 1) for bit in range(low, high - 1, -1))


_END = " bx[4:0] bz[1] by[3:0] ry[4:0] bz[2] rz[4:0] bz[3]"
MODES = (
    # From the coarsest to the finest.
    Mode(30, 2, 6, (6, 6, 6),
         "rw[5:0] gz[4] bz[0] bz[1] by[4] gw[5:0] gy[5] by[5] bz[2] gy[4] bw[5:0] gz[5] bz[3] "
         "bz[5] bz[4] rx[5:0] gy[3:0] gx[5:0] gz[3:0] bx[5:0] by[3:0] ry[5:0] rz[5:0]"),
    Mode(1, 2, 7, (6, 6, 6),
         "gy[5] gz[4] gz[5] rw[6:0] bz[0] bz[1] by[4] gw[6:0] by[5] bz[2] gy[4] bw[6:0] bz[3] "
         "bz[5] bz[4] rx[5:0] gy[3:0] gx[5:0] gz[3:0] bx[5:0] by[3:0] ry[5:0] rz[5:0]"),
    Mode(18, 2, 8, (6, 5, 5),
         "rw[7:0] gz[4] by[4] gw[7:0] bz[2] gy[4] bw[7:0] bz[3] bz[4] rx[5:0] gy[3:0] gx[4:0] "
         "bz[0] gz[3:0] bx[4:0] bz[1] by[3:0] ry[5:0] rz[5:0]"),
    Mode(22, 2, 8, (5, 6, 5),
         "rw[7:0] bz[0] by[4] gw[7:0] gy[5] gy[4] bw[7:0] gz[5] bz[4] rx[4:0] gz[4] gy[3:0] "
         "gx[5:0] gz[3:0]"
         + _END),
    Mode(26, 2, 8, (5, 5, 6),
         "rw[7:0] bz[1] by[4] gw[7:0] by[5] gy[4] bw[7:0] bz[5] bz[4] rx[4:0] gz[4] gy[3:0] "
         "gx[4:0] bz[0] gz[3:0] bx[5:0] by[3:0] ry[4:0] bz[2] rz[4:0] bz[3]"),
    Mode(14, 2, 9, (5, 5, 5),
         "rw[8:0] by[4] gw[8:0] gy[4] bw[8:0] bz[4] rx[4:0] gz[4] gy[3:0] gx[4:0] bz[0] gz[3:0]"
         + _END),
    Mode(0, 2, 10, (5, 5, 5),
         "gy[4] by[4] bz[4] rw[9:0] gw[9:0] bw[9:0] rx[4:0] gz[4] gy[3:0] gx[4:0] bz[0] gz[3:0]"
         + _END),
    Mode(2, 2, 11, (5, 4, 4),
         "rw[9:0] gw[9:0] bw[9:0] rx[4:0] rw[10] gy[3:0] gx[3:0] gw[10] bz[0] gz[3:0] bx[3:0] "
         "bw[10] bz[1] by[3:0] ry[4:0] bz[2] rz[4:0] bz[3]"),
    Mode(6, 2, 11, (4, 5, 4),
         "rw[9:0] gw[9:0] bw[9:0] rx[3:0] rw[10] gz[4] gy[3:0] gx[4:0] gw[10] gz[3:0] bx[3:0] "
         "bw[10] bz[1] by[3:0] ry[3:0] bz[0] bz[2] rz[3:0] gy[4] bz[3]"),
    Mode(10, 2, 11, (4, 4, 5),
         "rw[9:0] gw[9:0] bw[9:0] rx[3:0] rw[10] by[4] gy[3:0] gx[3:0] gw[10] bz[0] gz[3:0] "
         "bx[4:0] bw[10] by[3:0] ry[3:0] bz[1] bz[2] rz[3:0] bz[4] bz[3]"),
    Mode(3, 1, 10, (10, 10, 10),
         "rw[9:0] gw[9:0] bw[9:0] rx[9:0] gx[9:0] bx[9:0]"),
    Mode(7, 1, 11, (9, 9, 9),
         "rw[9:0] gw[9:0] bw[9:0] rx[8:0] rw[10] gx[8:0] gw[10] bx[8:0] bw[10]"),
    Mode(11, 1, 12, (8, 8, 8),
         "rw[9:0] gw[9:0] bw[9:0] rx[7:0] rw[10:11] gx[7:0] gw[10:11] bx[7:0] bw[10:11]"),
    Mode(15, 1, 16, (4, 4, 4),
         "rw[9:0] gw[9:0] bw[9:0] rx[3:0] rw[10:15] gx[3:0] gw[10:15] bx[3:0] bw[10:15]"),
)  # fmt: skip
"""All modes."""

_SETS = (
    0xCCCC, 0x8888, 0xEEEE, 0xECC8, 0xC880, 0xFEEC, 0xFEC8, 0xEC80,
    0xC800, 0xFFEC, 0xFE80, 0xE800, 0xFFE8, 0xFF00, 0xFFF0, 0xF000,
    0xF710, 0x008E, 0x7100, 0x08CE, 0x008C, 0x7310, 0x3100, 0x8CCE,
    0x088C, 0x3110, 0x6666, 0x366C, 0x17E8, 0x0FF0, 0x718E, 0x399C,
)  # fmt: skip
PARTITIONS = np.array([[each >> texel & 1 for texel in range(16)] for each in _SETS], dtype=bool)
"""The texels of the second line in each of the 32 partitions: shape (32, 16)."""
ANCHORS = np.array([15] * 17 + [2, 8, 2, 2, 8, 8, 15, 2, 8, 2, 2, 8, 8, 2, 2])
"""The texel of the second line, whose number is a bit shorter: shape (32,). On the first line it
is texel 0."""


def pack(mode: Mode, ends: Whole, indices: Whole, partition: Whole) -> NDArray[np.uint8]:
    """Return blocks of one mode, 16 bytes each.

    `ends`, of shape (2 * lines, 3, n), are the first end whole; the others as the mode has them,
    negative ones too. `indices`, of shape (16, n), are where each texel lies on its line. The
    highest bit of those of anchors is 0. `partition`, of shape (n,), says which texels lie on the
    second line, where there are two.
    """
    words = np.zeros((2, len(partition)), dtype=np.uint64)

    def put(numbers: Whole, at: int | Whole, length: int) -> None:
        words[int(np.min(at) >= 64)] |= numbers.astype(np.uint64) << np.asarray(at & 63, np.uint64)
        if isinstance(at, int) and at < 64 < at + length:
            words[1] |= numbers.astype(np.uint64) >> np.uint64(64 - at)

    put(np.full_like(partition, mode.code), 0, 5)
    at = 2 if mode.code < 2 else 5
    for end, channel, bit, length in mode.runs():
        put(ends[end, channel] >> bit & (1 << length) - 1, at, length)
        at += length
    if mode.lines == 2:
        put(partition, at, 5)
        at += 5
    length = 4 if mode.lines == 1 else 3
    # Later texels move up by a bit for each anchor that was left a bit shorter.
    places = np.full_like(partition, at)
    for texel in range(16):
        put(indices[texel], places, length)
        is_anchor = (texel == 0) | ((mode.lines == 2) & (ANCHORS[partition] == texel))
        places = places + length - is_anchor
    return np.ascontiguousarray(words.T, dtype="<u8").view(np.uint8)
