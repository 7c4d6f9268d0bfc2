"""How blocks of UASTC HDR write the two ends of their line: mode 11 of ASTC's endpoints.

Six bytes hold the ends, 12 bits a channel at most: the largest channel of the last end whole, all
else as differences from it, in eight ways that share the bits out differently; or all whole, with
8 bits, and 7 of blue.

References
----------
The Khronos Data Format Specification 1.3, section 23.14 (HDR endpoint mode 11).
"""

import numpy as np
from numpy.typing import NDArray

from shrm_cli.export.blocks.lines import Floats, Whole
from shrm_cli.export.blocks.uastc_fields import NEAR

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
