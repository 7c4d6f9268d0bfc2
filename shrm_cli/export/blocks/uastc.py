"""UASTC HDR 4x4: those blocks of ASTC that are rewritten as BC6H at once.

Phones and Apple's machines read the blocks as ASTC; where a device reads BC6H alone, the
transcoder of Basis Universal, which engines of the web ship, moves their fields. So one file
serves all. The blocks here have one line through their colours with 16 steps, which both formats
have alike.

How blocks of UASTC HDR write the two ends of their line: mode 11 of ASTC's endpoints.

Six bytes hold the ends, 12 bits a channel at most: the largest channel of the last end whole, all
else as differences from it, in eight ways that share the bits out differently; or all whole, with
8 bits, and 7 of blue.

The 128 bits of a block of UASTC HDR: one line, and 16 steps on it for each texel.

A block of ASTC tells by its first bits how it is divided. Of the many ways this is the one that
BC6H has as well. The ends of the line are six bytes, of which 192 values each are there: 6 bits and
a trit; five trits share 8 bits.

References
----------
Binomial, basis_universal, basisu_transcoder.cpp (`astc_hdr_transcode_to_bc6h`). The Khronos Data
Format Specification 1.3, section 23.20 (how interpolated numbers become half floats).
The Khronos Data Format Specification 1.3, section 23.14 (HDR endpoint mode 11).
The Khronos Data Format Specification 1.3, sections 23.9 (block modes), 23.12 (integer sequences)
and 23.13 (which values there are).
"""

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array
from shrm_cli.export.blocks import bc6h
from shrm_cli.export.blocks.lamps import STARTS, Found, light_error, nearest, refined
from shrm_cli.export.blocks.lines import (
    Floats,
    Space,
    Texels,
    Whole,
    balanced,
    between,
    is_steep,
    line,
    squared_error,
    steps,
)

LARGEST = 65216.0
"""The largest value of a texel."""
_STEPS = 16
"""Where a texel may lie on its line."""


def _numbers(light: Floats) -> Floats:
    """Return what a decoder makes light of: 5 bits of exponent, and 11 of a bent mantissa."""
    halves = light.astype(np.float16).view(np.uint16).astype(np.int64)
    mantissa = (halves & 1023) * 8 + 4
    bent = np.where(
        mantissa < 3 * 512,
        mantissa / 3,
        np.where(mantissa < 4 * 1536 - 512, (mantissa + 512) / 4, (mantissa + 2048) / 5),
    )
    return ((halves >> 10 << 11) + bent).astype(np.float32)


def _light(numbers: Floats) -> Floats:
    """Return the light of such numbers."""
    return _halves(numbers).view(np.float16).astype(np.float32)


def _halves(numbers: Floats) -> NDArray[np.uint16]:
    """Return the bits of the half floats that a decoder makes of numbers."""
    whole = np.clip(numbers, 0, 63487).astype(np.int64)
    bent = whole & 2047
    mantissa = np.where(
        bent < 512, 3 * bent, np.where(bent < 1536, 4 * bent - 512, 5 * bent - 2048)
    )
    halves = (whole >> 11 << 10) + (mantissa >> 3)
    return halves.astype(np.uint16)


SPACE = Space(_numbers, _light, 2048)
"""Numbers whose steps are nearly alike in all of an octave."""


def encoded(blocks: Array) -> Found:
    """Return blocks of shape (3, 16, n), encoded."""
    texels = Texels.of(np.minimum(blocks, LARGEST), SPACE)
    found = _with_line(texels, None)
    return Found(found.data, found.error * texels.scale)


def searched(blocks: Array) -> Found:
    """Return blocks of shape (3, 16, n) encoded as well as may be, which takes its time."""
    texels = Texels.of(np.minimum(blocks, LARGEST), SPACE)
    every = np.arange(blocks.shape[-1])
    found = _with_line(texels, STARTS[0])
    for start in STARTS[1:]:
        found.replace(every, _with_line(texels, start))
    return found


def _with_line(texels: Texels, start: float | None) -> Found:
    """Return blocks; with a start as `lamps.refined` has it, by light."""
    whole = np.ones(texels.light.shape[1:], dtype=bool)
    ends = np.stack(line(texels, whole, _STEPS))
    if start is not None:
        ends = refined(texels, whole, ends, _STEPS, start)
    is_turned = ends[0].max(axis=0) > ends[1].max(axis=0)
    numbers = written(np.where(is_turned, ends[::-1], ends), texels.weights.sum(axis=1))
    found = (16 * read(numbers)).astype(np.float32)
    indices = (steps if start is None else nearest)(texels, found, _STEPS)
    bright = np.flatnonzero(is_steep(texels))
    if bright.size:
        indices[:, bright] = balanced(
            texels[bright], found[..., bright], indices[:, bright], ~whole[:, bright], _STEPS
        )
    values = between(found, indices, ~whole, _STEPS)
    error = squared_error if start is None else light_error
    return Found(pack(numbers, indices), error(texels, values))


def to_bc6h(data: bytes) -> bytes:
    """Return the blocks as BC6H, just as the transcoder makes it."""
    numbers, indices = unpack(np.frombuffer(data, dtype=np.uint8).reshape(-1, 16))
    ends = (_halves((16 * read(numbers)).astype(np.float32)).astype(float) * 64 + 30) / 31
    # The number of the first texel has no highest bit.
    is_late = indices[0] >= _STEPS // 2
    ends = np.where(is_late, ends[::-1], ends)
    return bc6h.one_line(ends, np.where(is_late, _STEPS - 1 - indices, indices)).tobytes()


_MOST = 3967
"""The largest 12 bits of an end; larger ones are infinite."""
_DIFFERENCES = (
    # Bits of the largest channel of the last end, of the others below it, of the first end below
    # the last, of what the others differ by from that; and where the higher bits of them lie: the
    # number (a, b0, b1, c), the bit of it, the byte, and the bit of that byte.
    (9, 7, 6, 7, "b0.6:2.6 b1.6:3.6"),
    (9, 8, 6, 6, "b0.6:2.6 b1.6:3.6 b0.7:4.6 b1.7:5.6"),
    (10, 6, 7, 7, "a.9:2.6 c.6:3.6"),
    (10, 7, 7, 6, "b0.6:2.6 b1.6:3.6 a.9:4.6 c.6:5.6"),
    (11, 8, 6, 5, "b0.6:2.6 b1.6:3.6 b0.7:4.6 b1.7:5.6 a.9:4.5 a.10:5.5"),
    (11, 6, 8, 6, "a.9:2.6 a.10:3.6 c.7:4.6 c.6:5.6"),
    (12, 7, 7, 5, "b0.6:2.6 b1.6:3.6 a.11:4.6 c.6:5.6 a.9:4.5 a.10:5.5"),
    (12, 6, 7, 6, "a.9:2.6 a.10:3.6 a.11:4.6 c.6:5.6"),
)  # fmt: skip
"""The eight ways by which ends of mode 11 are written as differences."""


def written(ends: Floats, weight: Floats) -> Whole:
    """Return the six bytes of ends in the way that keeps them best: shape (6, n).

    Parameters
    ----------
    ends : ndarray, shape (2, 3, n)
        Numbers between 0 and 65536, as they are interpolated. The last end has the largest one.
    weight : ndarray, shape (3, n)
        What differences squared count in each channel.
    """
    wanted = np.clip(np.rint(ends / 16), 0, _MOST).astype(np.int64)
    largest = np.argmax(wanted[1], axis=0)
    best = _whole(wanted)
    least = _apart(read(best), ends, weight)
    for mode in range(len(_DIFFERENCES)):
        numbers, holds = _by_differences(wanted, largest, mode)
        found = _by_mode(numbers, mode, largest)
        apart = _apart(found, ends, weight)
        is_better = holds & (apart < least) & (found <= _MOST).all(axis=(0, 1))
        best = np.where(is_better, numbers, best)
        least = np.where(is_better, apart, least)
    return best


def _apart(found: Whole, ends: Floats, weight: Floats) -> Floats:
    off = (16 * found - ends) ** 2 * weight
    apart: Floats = off.sum(axis=(0, 1))
    return apart


def _whole(wanted: Whole) -> Whole:
    """Return ends as bytes without differences."""
    red, green = (np.minimum(wanted[:, k] + 8 >> 4, 247) for k in (0, 1))
    blue = np.minimum(wanted[:, 2] + 16 >> 5, 123) | 128
    return np.concatenate([NEAR[8][red], NEAR[8][green], NEAR[7][blue]])


class _Bytes:
    """Six bytes while they are written, and the parts in them as they will be read."""

    def __init__(self, mode: int, largest: Whole) -> None:
        self.numbers = np.zeros((6, len(largest)), dtype=np.int64)
        self.parts: dict[str, Whole] = {}
        self._places = _places(mode)
        for byte in (1, 2, 3):
            self.numbers[byte] = (mode >> byte - 1 & 1) << 7
        self.numbers[4], self.numbers[5] = (largest & 1) << 7, largest >> 1 << 7

    def put_high(self, name: str) -> None:
        """Write the higher bits of a part, which lie here and there."""
        for source, bit, byte, place in self._places:
            if source == name:
                self.numbers[byte] |= (self.parts[name] >> bit & 1) << place

    def put(self, byte: int, name: str, bits: int) -> None:
        """Write the lower bits of a part, which fill a byte; it becomes what is nearest."""
        exact = self.numbers[byte] | self.parts[name] & ((1 << bits) - 1)
        self.numbers[byte] = NEAR[bits][exact]
        self.parts[name] = self.parts[name] + self.numbers[byte] - exact


def _by_differences(wanted: Whole, largest: Whole, mode: int) -> tuple[Whole, NDArray[np.bool_]]:
    """Return ends as bytes of a way by differences, and where they hold them."""
    bits_a, bits_b, bits_c, bits_d, _ = _DIFFERENCES[mode]
    shift = 3 - mode // 2
    high, low = _turned(wanted[1], largest), _turned(wanted[0], largest)

    def rounded(values: Whole) -> Whole:
        return (values + (1 << shift >> 1)) >> shift

    # What is rounded first is made good by what follows.
    made = _Bytes(mode, largest)
    parts = made.parts
    parts["a"] = np.minimum(rounded(high[0]), (1 << bits_a) - 1)
    made.put_high("a")
    made.numbers[1] |= (parts["a"] >> 8 & 1) << 6
    made.put(0, "a", 8)
    top = parts["a"] << shift
    parts |= {
        "b0": rounded(top - high[1]),
        "b1": rounded(top - high[2]),
        "c": rounded(top - low[0]),
    }
    holds = np.ones(len(largest), dtype=bool)
    for name, bits in (("b0", bits_b), ("b1", bits_b), ("c", bits_c)):
        holds &= (parts[name] >= 0) & (parts[name] < 1 << bits)
        made.put_high(name)
    for byte, name in ((1, "c"), (2, "b0"), (3, "b1")):
        made.put(byte, name, 6)
    half = 1 << (bits_d - 1)
    for k in (0, 1):
        below = parts["a"] - parts[f"b{k}"] - parts["c"]
        parts["d"] = rounded((below << shift) - low[k + 1])
        holds &= (parts["d"] >= -half) & (parts["d"] < half)
        made.put(4 + k, "d", bits_d)
    return made.numbers, holds


def read(numbers: Whole) -> Whole:
    """Return the ends that six bytes are, 12 bits each: shape (2, 3, n)."""
    red, green, blue = numbers[:2] << 4, numbers[2:4] << 4, (numbers[4:] & 127) << 5
    ends = np.stack([red, green, blue], axis=1)
    largest = numbers[4] >> 7 | numbers[5] >> 7 << 1
    mode = np.where(largest == 3, -1, sum(numbers[k + 1] >> 7 << k for k in range(3)))
    for k in range(len(_DIFFERENCES)):
        here = np.flatnonzero(mode == k)
        if here.size:
            ends[..., here] = _by_mode(numbers[:, here], k, largest[here])
    return ends


def _by_mode(numbers: Whole, mode: int, largest: Whole) -> Whole:
    """Return the ends of bytes of a way by differences."""
    bits_d = _DIFFERENCES[mode][3]
    parts = {
        "a": numbers[0] | (numbers[1] >> 6 & 1) << 8,
        "b0": numbers[2] & 63, "b1": numbers[3] & 63, "c": numbers[1] & 63,
    }  # fmt: skip
    for name, bit, byte, place in _places(mode):
        parts[name] = parts[name] | (numbers[byte] >> place & 1) << bit
    half = 1 << (bits_d - 1)
    d = [(numbers[k] + half & 2 * half - 1) - half for k in (4, 5)]
    b = [np.zeros_like(parts["a"]), parts["b0"], parts["b1"]]
    high = np.stack([parts["a"] - each for each in b])
    low = high - parts["c"] - np.stack([b[0], *d])
    ends = np.stack([_turned(low, largest), _turned(high, largest)]) << (3 - mode // 2)
    return np.clip(ends, 0, 4095)


def _places(mode: int) -> list[tuple[str, int, int, int]]:
    """Return where the higher bits of a way by differences lie."""
    places = []
    for each in _DIFFERENCES[mode][4].split():
        source, place = each.split(":")
        name, bit = source.split(".")
        byte, at = place.split(".")
        places.append((name, int(bit), int(byte), int(at)))
    return places


def _turned(ends: Whole, largest: Whole) -> Whole:
    """Return ends, shape (3, n), with the first and the largest channel changed for each other."""
    every = np.arange(len(largest))
    turned = ends.copy()
    turned[0] = ends[largest, every]
    turned[largest, every] = ends[0]
    return turned


_HEAD = 578 | 11 << 13
"""A grid of 4 x 4 numbers of 16 steps, one line, and ends by mode 11: HDR RGB, direct."""
_HEAD_BITS = 17


def _levels() -> tuple[Whole, Whole]:
    """Return the trit and the 6 bits of each byte, where it is one of the 192 that there are.

    Returns
    -------
    trits, bits : ndarray of int, shape (256,)
        The trit is -1 where there is none.
    """
    trits, bits = np.full(256, -1), np.zeros(256, dtype=np.int64)
    for trit in range(3):
        for number in range(64):
            b = number >> 1 << 4 | number >> 5
            value = trit * 5 + b ^ (511 if number & 1 else 0)
            value = (128 if number & 1 else 0) | value >> 2
            trits[value], bits[value] = trit, number
    return trits, bits


_TRITS, _BITS = _levels()
_VALUES = np.zeros((3, 64), dtype=np.int64)
_VALUES[_TRITS[_TRITS >= 0], _BITS[_TRITS >= 0]] = np.flatnonzero(_TRITS >= 0)


def _nearest(free: int) -> Whole:
    """Return for each byte the nearest of the 192 that has its bits from `free` on."""
    there = np.flatnonzero(_TRITS >= 0)
    own = np.arange(256)[:, None]
    off = np.abs(there - own) + 1000 * (there >> free != own >> free)
    return there[off.argmin(axis=1)]


NEAR = {free: _nearest(free) for free in (5, 6, 7, 8)}
"""The nearest that there is of each byte, by how many of its low bits may change."""


def _trit_codes() -> Whole:
    """Return the 8 bits that hold five trits: shape (3, 3, 3, 3, 3), the first trit first."""
    codes = np.zeros((3,) * 5, dtype=np.int64)
    for code in reversed(range(256)):
        if code >> 2 & 7 == 7:
            c, upper = code >> 5 << 2 | code & 3, (2, 2)
        elif code >> 5 & 3 == 3:
            c, upper = code & 31, (code >> 7, 2)
        else:
            c, upper = code & 31, (code >> 5 & 3, code >> 7)
        if c & 3 == 3:
            lower = (c >> 2 & 3, c >> 4, 2)
        elif c >> 2 & 3 == 3:
            lower = (c & 3, 2, 2)
        else:
            lower = (c & 3, c >> 2 & 3, c >> 4)
        if lower[0] < 3:
            codes[(*lower, *upper)] = code
    return codes


_CODES = _trit_codes()
_DECODED = np.zeros((256, 5), dtype=np.int64)
_DECODED[_CODES.ravel()] = np.indices(_CODES.shape).reshape(5, -1).T
_SHARED = ((0, 2), (2, 2), (4, 1), (5, 2), (7, 1))
"""The bits of the code of five trits that follow each number's own: the first, and how many."""


def pack(numbers: Whole, indices: Whole) -> NDArray[np.uint8]:
    """Return blocks, 16 bytes each.

    Parameters
    ----------
    numbers : ndarray of int, shape (6, n)
        The bytes of the ends, each one of the 192 that there are.
    indices : ndarray of int, shape (16, n)
        Where each texel lies on the line, of 16 steps.
    """
    trits, small = _TRITS[numbers], _BITS[numbers]
    code = _CODES[tuple(trits[:5])]
    rows = [np.full(code.shape, _HEAD >> bit & 1) for bit in range(_HEAD_BITS)]
    for k, (first, length) in enumerate(_SHARED):
        rows += [small[k] >> bit & 1 for bit in range(6)]
        rows += [code >> first + bit & 1 for bit in range(length)]
    rows += [small[5] >> bit & 1 for bit in range(6)] + [trits[5] >> bit & 1 for bit in (0, 1)]
    bits = np.zeros((128, code.size), dtype=np.uint8)
    bits[: len(rows)] = rows
    # The numbers of the texels come from the other end of the block, their bits turned.
    bits[:63:-1] = np.stack([indices >> bit & 1 for bit in range(4)], axis=1).reshape(64, -1)
    return np.packbits(bits, axis=0, bitorder="little").T


def unpack(data: NDArray[np.uint8]) -> tuple[Whole, Whole]:
    """Return the bytes of the ends, shape (6, n), and the numbers of texels, shape (16, n).

    Parameters
    ----------
    data : ndarray of uint8, shape (n, 16)
        Blocks as `pack` makes them.
    """
    bits = np.unpackbits(data, axis=1, bitorder="little").T.astype(np.int64)
    at, code = _HEAD_BITS, np.zeros(len(data), dtype=np.int64)
    small = []
    for first, length in (*_SHARED, (0, 0)):
        small.append(_number(bits[at : at + 6]))
        code |= _number(bits[at + 6 : at + 6 + length]) << first
        at += 6 + length
    trits = np.vstack([_DECODED[code].T, _number(bits[at : at + 2])])
    indices = _number(bits[:63:-1].reshape(16, 4, -1).swapaxes(0, 1))
    return _VALUES[trits, np.stack(small)], indices


def _number(bits: Whole) -> Whole:
    """Return the numbers that bits along the first axis are, the lowest first."""
    number: Whole = sum(
        (row << k for k, row in enumerate(bits)), np.zeros(bits.shape[1:], np.int64)
    )
    return number
