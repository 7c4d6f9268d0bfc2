"""BC6H: blocks of 4 x 4 texels in 16 bytes, for light.

A block of 4 x 4 texels is one line in the space of its colours, or two, with a number for each
texel that says where on its line it lies. Modes differ in how fine the ends of the lines are, and
in how far apart they may be: the first end is written whole, the others as differences from it.

The format interpolates the bits of half floats, which are nearly logarithms. So does the search:
in that space each block gets the line through its colours, and where one line is too coarse, two
lines for the better of 32 partitions. Ends come from principal components, then from least
squares, and are written in the finest mode that holds them. Errors are weighted so that they are
relative to the light of their texel, and bright texels of a block count more: the dark ones beside
a lamp are outshone.

References: The Khronos Data Format Specification 1.3, section 20.2 (BPTC, "BC6H").
"""

import re
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array
from shrm_cli.export.blocks.lines import (
    STARTS,
    Floats,
    Found,
    Space,
    Texels,
    Whole,
    along,
    balanced,
    best,
    between,
    is_steep,
    light_error,
    line,
    nearest,
    refined,
    relative_weights,
    scaled,
    squared_error,
    step_errors,
    steps,
)
from shrm_cli.export.blocks.rate import bits_of_bytes, cheap_steps, starting_prices
from shrm_cli.records import record
from shrm_cli.vocabulary import LARGEST_HALF


@record
class Mode:
    """How the ends of a block's lines are written."""

    code: int
    """The number that a block begins with."""
    lines: int
    """1 or 2."""
    bits: int
    """The bits of each channel of the first end."""
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


LARGEST = LARGEST_HALF
"""The largest value of a texel."""
_TRIES = 2
"""Partitions that are tried for each block that gets two lines."""
_MANY = 16
"""Partitions that are tried for a lamp."""
_PLACES = np.arange(16)[:, None] | np.arange(16) << 4
"""The byte of two texels."""
_FINE = 0.01**2
"""Where the squared relative error of one line is smaller, two are not tried."""


def _numbers(light: Floats) -> Floats:
    steps = light.astype(np.float16).view(np.uint16).astype(np.float32)
    return (steps + np.float32(0.5)) * np.float32(64 / 31)


def _light(numbers: Floats) -> Floats:
    steps = np.clip(numbers * np.float32(31 / 64), 0, 31743).astype(np.uint16)
    return steps.view(np.float16).astype(np.float32)


_FRACTIONS: dict[int, Floats] = {
    len(weights): np.array(weights, dtype=np.float32) * np.float32(1 / 64)
    for weights in (
        [0, 9, 18, 27, 37, 46, 55, 64],
        [0, 4, 9, 13, 17, 21, 26, 30, 34, 38, 43, 47, 51, 55, 60, 64],
    )
}
SPACE = Space(_numbers, _light, 1024 * 64 / 31, _FRACTIONS)
"""The bits of half floats, 31/64 of what is interpolated."""


prices_of = starting_prices


def encoded(blocks: Array, prices: Floats) -> Found:
    """Return blocks of shape (3, 16, n), encoded."""
    texels = Texels.of(np.minimum(blocks, LARGEST), SPACE)
    every = np.zeros(blocks.shape[-1], dtype=np.int64)
    prices = prices * ~is_steep(texels)  # lamps keep what they have
    found = _with_lines(texels, every, 1, prices=prices)
    bits = bits_of_bytes(found.data)
    coarse = np.flatnonzero(found.error > _FINE)
    if coarse.size:
        harder = texels[coarse]
        for partition in _partitions(harder, _TRIES):
            tried = _with_lines(harder, partition, 2)
            tried.error[:] += prices[coarse] * bits[tried.data].sum(axis=1)
            found.replace(coarse, tried)
    return found


def searched(blocks: Array) -> Found:
    """Return blocks of shape (3, 16, n) encoded as well as may be, which takes its time."""
    texels = Texels.of(np.minimum(blocks, LARGEST), SPACE)
    count = blocks.shape[-1]
    partitions = np.concatenate(list(_partitions(texels, _MANY)))
    found = []
    for lines, ways in ((1, np.zeros(count, dtype=np.int64)), (2, partitions)):
        ways = np.tile(ways, len(STARTS))
        start = np.repeat(STARTS, len(ways) // len(STARTS))
        every = texels[np.arange(len(ways)) % count]
        found.append(best(_with_lines(every, ways, lines, start), len(ways) // count))
    one, two = found
    one.replace(np.arange(count), two)
    return one


def _partitions(texels: Texels, tries: int) -> Iterator[Whole]:
    """Yield for each block the partitions whose two lines should fit best, the best first."""
    weight, _, values = scaled(texels)
    values = values - values.mean(axis=1, keepdims=True)
    red, green, blue = values
    terms = np.stack(
        [np.ones_like(red), red, green, blue, red * red, green * green, blue * blue,
         red * green, red * blue, green * blue]
    ) * weight  # fmt: skip
    second = np.matmul(PARTITIONS.astype(np.float32), terms)  # shape (10, 32, n)
    total = terms.sum(axis=1)[:, None]
    cost = _beside_a_line(second) + _beside_a_line(total - second)
    order = np.argpartition(cost, range(tries), axis=0)
    yield from order[:tries].astype(np.int64)


def _beside_a_line(sums: Floats) -> Floats:
    """Return the squared distances from the best line through points, about, and their rounding.

    The sum of the two smaller eigenvalues of the covariance is about the sum of its principal
    minors over its trace; along the line stand 8 points, which leaves a 49th of the trace.
    """
    count, sx, sy, sz, xx, yy, zz, xy, xz, yz = sums
    scale = 1 / np.maximum(count, np.float32(1e-6))
    xx, yy, zz = xx - sx * sx * scale, yy - sy * sy * scale, zz - sz * sz * scale
    xy, xz, yz = xy - sx * sy * scale, xz - sx * sz * scale, yz - sy * sz * scale
    minors = xx * yy + yy * zz + xx * zz - xy * xy - xz * xz - yz * yz
    trace = np.maximum(xx + yy + zz, np.float32(1e-12))
    return np.maximum(minors, 0) / trace + trace / np.float32(49)


def _with_lines(
    texels: Texels,
    partition: Whole,
    lines: int,
    start: Array | None = None,
    prices: Floats | None = None,
) -> Found:
    """Return blocks of one line or two; with starts as `lines.refined` has them, by light.

    Where there are prices, steps on one line are cheap ones, and errors hold what bits cost.
    """
    count = 16 if lines == 1 else 8
    every = np.arange(len(partition))
    second = PARTITIONS[partition].T & (lines == 2)
    sets, anchors = [~second, second][:lines], [np.zeros_like(partition), ANCHORS[partition]]
    ends = []
    for members, anchor in zip(sets, anchors, strict=False):
        fitted = line(texels, members, count)
        if start is not None:
            fitted = refined(texels, members, fitted, count, start)
        # The number of the anchor has no highest bit, so it lies in the first half of its line.
        is_late = along(texels.chosen(anchor), *fitted) > 0.5
        ends.append(np.where(is_late, fitted[::-1], fitted))
    written, mode = _written(np.concatenate(ends), lines)
    whole = _unquantized(written, mode)
    near = steps if start is None else nearest
    indices = near(texels, whole[:2], count)
    if prices is not None and prices.any():
        indices = _cheap_steps(texels, whole, written, mode, prices)
    if lines == 2:
        indices = np.where(second, near(texels, whole[2:], count), indices)
    is_lamp = is_steep(texels) if start is None else np.ones_like(every, dtype=bool)
    bright = np.flatnonzero(is_lamp)
    if bright.size:
        ends_there, second_there = whole[..., bright], second[:, bright]

        def light(at: Whole) -> Floats:
            return SPACE.light(between(ends_there, _FRACTIONS[count][at], second_there))

        indices[:, bright] = balanced(light, texels.light[..., bright], indices[:, bright], count)
    for anchor in anchors[:lines]:
        indices[anchor, every] = np.minimum(indices[anchor, every], count // 2 - 1)
    values = between(whole, _FRACTIONS[count][indices], second)
    off = light_error(SPACE.light(values), texels.light)
    error = squared_error(texels, values) if start is None else off
    data = _packed(written, mode, indices, partition)
    if prices is not None:
        error = error + prices * bits_of_bytes(data)[data].sum(axis=1)
    return Found(data, error, off)


def _cheap_steps(
    texels: Texels, ends: Floats, written: Whole, mode: Whole, prices: Floats
) -> Whole:
    """Return steps of one line that are cheap in error and bits, shape (16, n).

    From the third texel on two fill a byte.
    """
    errors = step_errors(texels, ends, 16) * relative_weights(texels.light)

    def packed(indices: Whole) -> NDArray[np.uint8]:
        return _packed(written, mode, indices, 0 * mode)

    return cheap_steps(errors, prices, packed, _PLACES, first=2)


def one_line(ends: Array, indices: Whole) -> NDArray[np.uint8]:
    """Return blocks of one line, 16 bytes each, in the finest modes that hold their ends.

    `ends`, of shape (2, 3, n), are numbers between 0 and 65536, as they are interpolated.
    `indices`, of shape (16, n), are where texels lie on their line, of 16 steps; the first of each
    block in the first half.
    """
    return _packed(*_written(ends, 1), indices, np.zeros(indices.shape[-1], dtype=np.int64))


def read_line(ends: Floats) -> Floats:
    """Return the ends of blocks of one line as decoders take them, shape (2, 3, n)."""
    return _unquantized(*_written(ends, 1))


def _packed(written: Whole, mode: Whole, indices: Whole, partition: Whole) -> NDArray[np.uint8]:
    """Return blocks of several modes, 16 bytes each."""
    data = np.empty((len(partition), 16), dtype=np.uint8)
    for k, each in enumerate(MODES):
        here = np.flatnonzero(mode == k)
        if here.size:
            packed = _differences(each, written[..., here])
            data[here] = pack(each, packed, indices[:, here], partition[here])
    return data


def _written(ends: Floats, lines: int) -> tuple[Whole, Whole]:
    """Return the ends as numbers of the finest mode that holds them, and the index of that mode."""
    best = np.zeros(ends.shape, dtype=np.int64)
    mode = np.zeros(ends.shape[-1], dtype=np.int64)
    for k, each in enumerate(MODES):
        if each.lines != lines:
            continue
        near = np.clip(ends / 2.0 ** (16 - each.bits), 0, 2**each.bits - 1).astype(np.int64)
        half = np.array([1 << bits - 1 for bits in each.differences])[:, None]
        apart = near[1:] - near[0]
        holds = ((apart >= -half) & (apart < half)).all(axis=(0, 1)) | each.is_whole
        best = np.where(holds, near, best)
        mode = np.where(holds, k, mode)
    return best, mode


def _differences(mode: Mode, written: Whole) -> Whole:
    """Return ends as a mode writes them."""
    return written if mode.is_whole else np.concatenate([written[:1], written[1:] - written[0]])


def _unquantized(written: Whole, mode: Whole) -> Floats:
    """Return ends between 0 and 65535, as decoders take them."""
    bits = np.array([each.bits for each in MODES])[mode]
    middle = ((written << 16) + 0x8000) >> bits
    extreme = np.where(written == 0, 0, np.where(written == (1 << bits) - 1, 0xFFFF, middle))
    return np.where(bits == 16, written, extreme).astype(np.float32)
