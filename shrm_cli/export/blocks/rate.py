"""Steps of texels that Zstandard packs well.

KTX 2 files are compressed by Zstandard, which writes what does not repeat by a code of Huffman's:
frequent bytes take fewer bits. Of the steps that suit a texel nearly as well as the best, those are
taken whose bytes are frequent in their neighbourhood, and so they become more frequent still.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array
from shrm_cli.export.blocks.lines import Floats, Whole

PRICE = 6e-6
"""The squared error that a bit is worth, as `lines.relative_weights` has it: 1 % of the light of a
texel that is right otherwise."""
_SMOOTH = 0.02
"""Where light differs by less within a block bits are worth less: in a sky that is otherwise smooth
an error of 1 % shows as squares."""
PASSES = 2
"""How often steps are chosen by what their bytes take, which this changes."""
_FEW = 2048
"""Levels of fewer blocks take few bytes, and keep what they have."""


def starting_prices(blocks: Array) -> Floats:
    """Return what a bit is worth in each block of a level, shape (n,).

    What is bright beside the rest of the level changes less, and so does what is smooth.

    `blocks` are of shape (3, 16, n).
    """
    squares = (blocks**2).sum(axis=0)
    light = squares.mean(axis=0)
    norm = np.sqrt(squares)
    contrast = norm.var(axis=0) / np.maximum(light, 1e-30)
    price = PRICE if light.size >= _FEW else 0.0
    price = price * np.minimum(contrast / _SMOOTH**2, 1)
    return (price / (1 + light / max(light.mean(), 1e-30))).astype(np.float32)


def bits_of_bytes(data: NDArray[np.uint8]) -> Floats:
    """Return how many bits each of the 256 bytes takes by an ideal code: shape (256,)."""
    counts = np.bincount(data.ravel(), minlength=256) + 0.5
    return np.log2(counts.sum() / counts).astype(np.float32)


def cheap_steps(
    errors: Floats,
    prices: Floats,
    packed: Callable[[Whole], NDArray[np.uint8]],
    places: Whole,
    passes: int = PASSES,
    first: int = 0,
) -> Whole:
    """Return steps of texels that are cheap in error and bits, shape (16, n).

    `errors`, of shape (16, 16, n), are by step and texel. `prices`, of shape (n,), are the error
    that a bit is worth. `packed` holds the blocks of steps, of which it is counted how frequent
    bytes are. `places`, of shape (16, 16), are the bytes that two steps are, of a texel and of the
    next one. `passes` is how often they are chosen. `first` is the texel from which on two fill a
    byte; those before it have the steps of least error.
    """
    indices = smallest(errors)
    if prices.any():
        for _ in range(passes):
            bits = bits_of_bytes(packed(indices))
            indices[first:] = _cheapest(errors[:, first:], prices, bits, places)
    return indices


def _cheapest(errors: Floats, price: Floats, bits: Floats, places: Whole) -> Whole:
    """Return steps of texels that leave the least of error and bits together: shape (k, n).

    `errors`, of shape (16, k, n), are by step and texel; k is even. `price`, `bits` and `places`
    are as of `cheap_steps`; bits are those of each of the 256 bytes.
    """
    found = np.empty(errors.shape[1:], dtype=np.int64)
    costs = (bits[places][..., None] * price).astype(np.float32)
    for texel in range(0, len(found), 2):
        both = costs + errors[:, None, texel]
        both += errors[None, :, texel + 1]
        found[texel], found[texel + 1] = divmod(smallest(both.reshape(256, -1)), 16)
    return found


def smallest(errors: Floats) -> Whole:
    """Return the index along the first axis, of at most 256, of the smallest error of 0 or more.

    The index takes the place of the last bits of the numbers, of which 15 stay. So the least of
    whole numbers is all that is sought, which numpy finds many at a time.
    """
    last = 256 if len(errors) > 16 else 16
    bits = errors.view(np.int32) & -last
    bits |= np.arange(len(errors), dtype=np.int32).reshape(-1, *[1] * (errors.ndim - 1))
    return (np.minimum.reduce(bits, axis=0) & last - 1).astype(np.int64)
