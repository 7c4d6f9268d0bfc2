"""The 128 bits of a block of UASTC HDR: one line, and 16 steps on it for each texel.

A block of ASTC tells by its first bits how it is divided. Of the many ways this is the one that
BC6H has as well. The ends of the line are six bytes, of which 192 values each are there: 6 bits and
a trit; five trits share 8 bits.

References
----------
The Khronos Data Format Specification 1.3, sections 23.9 (block modes), 23.12 (integer sequences)
and 23.13 (which values there are).
"""

import numpy as np
from numpy.typing import NDArray

from shrm_cli.export.blocks.lines import Whole

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
