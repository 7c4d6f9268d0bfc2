"""The 128 bits of a block of UASTC HDR: two ends of a line, and 16 steps on it for each texel.

A block of ASTC tells by its first bits how it is divided. Of the many ways this is the one that
BC6H has as well. The ends are six bytes of which 192 values each are there, 6 bits and a trit; five
trits share 8 bits. By mode 11 they hold 12 bits a channel at most: the largest channel of the last
end whole, all else as differences from it, in eight ways that share the bits out differently; or
all whole, with 8 bits, and 7 of blue.

References: The Khronos Data Format Specification 1.3, sections 23.9 (block modes), 23.12 (integer
sequences), 23.13 (which values there are) and 23.14 (HDR endpoint mode 11).
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.export.blocks.lines import Floats, Whole

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


_COARSE = 2
"""How many more bits of the ends may be left 0 where that is cheaper, less one."""


def written(
    ends: Floats, weight: Floats, price: ArrayLike = 0.0, bits: Floats | None = None
) -> Whole:
    """Return the six bytes of ends in the way that keeps them best: shape (6, n).

    `ends`, of shape (2, 3, n), are numbers between 0 and 65536, as they are interpolated. The last
    end has the largest one. `weight`, of shape (3, n), is what differences squared count in each
    channel. `price`, of shape (n,), is the error that a bit is worth. `bits`, of shape (256,), are
    what each byte of the block takes. With it coarser ends are tried, too.
    """
    wanted = np.clip(np.rint(ends / 16), 0, _MOST).astype(np.int64)
    largest = np.argmax(wanted[1], axis=0)

    def cost(numbers: Whole, found: Whole) -> Floats:
        # Half of the texels are nearer to either end: a third is the mean of their shares squared.
        apart: Floats = ((16 * found - ends) ** 2 * weight).sum(axis=(0, 1)) / 3
        return apart if bits is None else apart + price * bits[_packed_ends(numbers)].sum(axis=1)

    best = _whole(wanted)
    least = cost(best, read(best))
    for coarse in range(1 if bits is None else _COARSE):
        for mode in range(len(_DIFFERENCES)):
            numbers, holds = _by_differences(wanted, largest, mode, coarse)
            found = _by_mode(numbers, mode, largest)
            found_cost = cost(numbers, found)
            is_better = holds & (found_cost < least) & (found <= _MOST).all(axis=(0, 1))
            best = np.where(is_better, numbers, best)
            least = np.where(is_better, found_cost, least)
    return best


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


def _by_differences(
    wanted: Whole, largest: Whole, mode: int, coarse: int
) -> tuple[Whole, NDArray[np.bool_]]:
    """Return ends as bytes of a way by differences, and where they hold them.

    The last bits of all parts are 0, but for those that a byte cannot have, if it is coarse.
    """
    bits_a, bits_b, bits_c, bits_d, _ = _DIFFERENCES[mode]
    shift = 3 - mode // 2
    high, low = _turned(wanted[1], largest), _turned(wanted[0], largest)

    def rounded(values: Whole) -> Whole:
        step = shift + coarse
        return (values + (1 << step >> 1)) >> step << coarse

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


PLACES = np.packbits(
    [[[a >> bit & 1 for bit in range(4)] + [b >> bit & 1 for bit in range(4)] for b in range(16)]
     for a in range(16)], axis=-1,
)[..., 0].astype(np.int64)  # fmt: skip
"""The byte of two texels, which has its bits turned."""

_HEAD = 578 | 11 << 13
"""A grid of 4 x 4 numbers of 16 steps, one line, and ends by mode 11: HDR RGB, direct."""
_HEAD_BITS = 17


def _levels() -> tuple[Whole, Whole]:
    """Return the trit and the 6 bits of each byte, where it is one of the 192 that there are.

    Returns `trits` and `bits`, each of shape (256,), the trit is -1 where there is none.
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

    `numbers`, of shape (6, n), are the bytes of the ends, each one of the 192 that there are.
    `indices`, of shape (16, n), are where each texel lies on the line, of 16 steps.
    """
    data = np.empty((indices.shape[-1], 16), dtype=np.uint8)
    data[:, :8] = _packed_ends(numbers)
    # The numbers of the texels come from the other end of the block, their bits turned.
    data[:, :7:-1] = PLACES[indices[::2], indices[1::2]].T
    return data


def _packed_ends(numbers: Whole) -> NDArray[np.uint8]:
    """Return the first half of blocks: shape (n, 8)."""
    trits, small = _TRITS[numbers], _BITS[numbers]
    code = _CODES[tuple(trits[:5])]
    word, at = np.full(code.shape, _HEAD), _HEAD_BITS
    for k, (first, length) in enumerate(_SHARED):
        word |= (small[k] | (code >> first & (1 << length) - 1) << 6) << at
        at += 6 + length
    word |= (small[5] | trits[5] << 6) << at
    return word.astype("<i8").view(np.uint8).reshape(-1, 8)


def unpack(data: NDArray[np.uint8]) -> tuple[Whole, Whole]:
    """Return the bytes of the ends, shape (6, n), and the numbers of texels, shape (16, n).

    `data`, of shape (n, 16), holds blocks as `pack` makes them.
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
    return sum((row << k for k, row in enumerate(bits)), np.zeros(bits.shape[1:], np.int64))
