"""UASTC HDR 4x4: those blocks of ASTC that are rewritten as BC6H at once.

Phones and Apple's machines read the blocks as ASTC; where a device reads BC6H alone, the
transcoder of Basis Universal, which engines of the web ship, moves their fields. So one file
serves all. The blocks here have one line through their colours with 16 steps, which both formats
have alike; but ASTC interpolates almost logarithms and BC6H the bits of half floats, which differ
by up to 6 % within an octave. So blocks are sought whose error is least in the mean of both.

Of ends and steps that are nearly as good, those are taken that a file of fewer bytes holds.

References: Binomial, basis_universal, basisu_transcoder.cpp (`astc_hdr_transcode_to_bc6h`). The
Khronos Data Format Specification 1.3, section 23.20 (how interpolated numbers become half floats).
"""

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array
from shrm_cli.export.blocks import bc6h, lines, rate
from shrm_cli.export.blocks.uastc_bits import PLACES, pack, read, unpack, written

LARGEST = 65216.0
"""The largest value of a texel."""
DIMMEST = 5e-6
"""Below it the ends, of 12 bits, lose as much as half precision does below 6e-7."""
_STEPS = 16
"""Where a texel may lie on its line."""
_ROUNDS = 2
_MANY_ROUNDS = 4
"""How often a line is fitted to both decoders, and that of a lamp."""
_SAMPLE = 2048
"""About so many blocks are tried to find what a bit is worth."""
_MOST_BITS = 6.4
"""What a byte may take by an ideal code: 12.8 bytes a block, of which Zstandard saves a few %."""
_TRIES = 6
_DEARER = 2
"""How many powers of 2 a bit too many makes bits dearer by, at each try."""


def _tables() -> tuple[lines.Floats, NDArray[np.uint16]]:
    """Return the number of each half float, and the half float of each number.

    Numbers have 5 bits of exponent, and 11 of a bent mantissa.
    """
    bent = np.arange(2048)
    halves = np.select([bent < 512, bent < 1536], [3 * bent, 4 * bent - 512], 5 * bent - 2048) >> 3
    middle = np.interp(np.arange(1024) * 8 + 4.0, [0, 1536, 5632, 8192], [0, 512, 1536, 2048])
    return (
        np.add.outer(np.arange(31) * 2048, middle).ravel().astype(np.float32),
        np.add.outer(np.arange(31) * 1024, halves).ravel().astype(np.uint16),
    )


_NUMBERS, _HALVES = _tables()
_LIGHT = _HALVES.view(np.float16).astype(np.float32)


def _numbers(light: lines.Floats) -> lines.Floats:
    """Return what a decoder makes light of."""
    return _NUMBERS[light.astype(np.float16).view(np.uint16)]


def _light(numbers: lines.Floats) -> lines.Floats:
    """Return the light of such numbers."""
    return _LIGHT[np.clip(numbers, 0, len(_LIGHT) - 1).astype(np.int32)]


_FRACTIONS = np.array(
    [0, 4, 8, 12, 17, 21, 25, 29, 35, 39, 43, 47, 52, 56, 60, 64], dtype=np.float32
) * np.float32(1 / 64)
SPACE = lines.Space(_numbers, _light, 2048, {_STEPS: _FRACTIONS})
"""Numbers whose steps are nearly alike in all of an octave."""


def encoded(blocks: Array, prices: lines.Floats) -> lines.Found:
    """Return blocks of shape (3, 16, n), encoded."""
    texels = lines.Texels.of(np.minimum(blocks, LARGEST), SPACE)
    of_channels = texels.weights.sum(axis=1)
    ends = lines.line(texels, _every(texels), _STEPS)
    ends = _fitted(texels, lines.relative_weights(texels.light), ends, _ROUNDS)
    prices = prices * ~lines.is_steep(texels)  # lamps keep what they have
    numbers = written(ends, of_channels)
    data = pack(numbers, _chosen(_relative_errors(texels, numbers), numbers, prices, 1))
    numbers = written(ends, of_channels, prices, rate.bits_of_bytes(data))
    indices = _chosen(_relative_errors(texels, numbers), numbers, prices)
    return _balanced_blocks(texels, numbers, indices, np.flatnonzero(lines.is_steep(texels)))


def prices_of(blocks: Array) -> lines.Floats:
    """Return what a bit of the file is worth in each of all blocks of a level: shape (n,).

    It is a squared error relative to the light of a texel, as `lines.relative_weights` has it: so
    much that the level takes no more bytes than it may.

    `blocks` are of shape (3, 16, n).
    """
    prices = rate.starting_prices(blocks)
    if not prices.any():
        return prices
    some = slice(None, None, max(1, prices.size // _SAMPLE))
    texels = lines.Texels.of(np.minimum(blocks[..., some], LARGEST), SPACE)
    numbers = written(lines.line(texels, _every(texels), _STEPS), texels.weights.sum(axis=1))
    errors = _relative_errors(texels, numbers)
    of_some, factor = prices[some] * ~lines.is_steep(texels), np.float32(1)
    for _ in range(_TRIES):
        data = pack(numbers, _chosen(errors, numbers, factor * of_some))
        bits = float(rate.bits_of_bytes(data)[data].mean())
        factor *= np.float32(max(1.0, 2 ** (_DEARER * (bits - _MOST_BITS))))
    return factor * prices


def searched(blocks: Array) -> lines.Found:
    """Return blocks of shape (3, 16, n) encoded as well as may be, which takes its time."""
    texels = lines.Texels.of(np.minimum(blocks, LARGEST), SPACE)
    count = blocks.shape[-1]
    every = texels[np.tile(np.arange(count), len(lines.STARTS))]
    ends = lines.line(every, _every(every), _STEPS)
    ends = lines.refined(every, _every(every), ends, _STEPS, np.repeat(lines.STARTS, count))
    ends = _fitted(every.by_light(), np.ones_like(every.light[0]), ends, _MANY_ROUNDS)
    numbers = written(ends, every.weights.sum(axis=1))
    indices = rate.smallest(_errors(_lights(numbers), every.light))
    return lines.best(
        _balanced_blocks(every, numbers, indices, np.arange(indices.shape[-1])), len(lines.STARTS)
    )


def _every(texels: lines.Texels) -> lines.Members:
    return np.ones(texels.light.shape[1:], dtype=bool)


def _fitted(
    texels: lines.Texels, weight: lines.Floats, ends: lines.Floats, rounds: int
) -> lines.Floats:
    """Return ends that suit both decoders.

    They are those of the best of some rounds, in each of which the line is fitted to where its
    steps would have to lie so that the mean of what the decoders read is right.

    `weight`, of shape (16, n), is what squared errors of light count.
    """
    kept, least = ends, np.full(ends.shape[-1], np.float32(np.inf))
    for _ in range(rounds):
        numbers = written(ends, texels.weights.sum(axis=1))
        lights = _lights(numbers)
        errors = _errors(lights, texels.light) * weight
        indices = rate.smallest(errors)
        error = errors.min(axis=0).sum(axis=0)
        kept, least = np.where(error < least, ends, kept), np.minimum(error, least)
        there = (16 * read(numbers)).astype(np.float32)
        at = _FRACTIONS[indices]
        middle = np.take_along_axis(lights.mean(axis=0), indices[:, None], axis=0).swapaxes(0, 1)
        gap = SPACE.numbers(middle) - there[0][:, None] - at * (there[1] - there[0])[:, None]
        ends = lines.solved(texels.values - gap, texels.weights, at, there)
    return kept


def _relative_errors(texels: lines.Texels, numbers: lines.Whole) -> lines.Floats:
    """Return by step and texel what both decoders are off, shape (16, 16, n)."""
    return _errors(_lights(numbers), texels.light) * lines.relative_weights(texels.light)


def _chosen(
    errors: lines.Floats, numbers: lines.Whole, prices: lines.Floats, passes: int = rate.PASSES
) -> lines.Whole:
    """Return the steps of texels that are cheap in error and bits, shape (16, n)."""
    return rate.cheap_steps(errors, prices, lambda at: pack(numbers, at), PLACES, passes)


def _lights(numbers: lines.Whole) -> lines.Floats:
    """Return what ASTC's and BC6H's decoders make of each step: shape (2, 16, 3, n)."""
    ends = read(numbers)
    as_bc6h = bc6h.read_line(_as_bc6h(ends))
    return np.stack(
        [
            space.light(first + space.fractions[_STEPS][:, None, None] * (last - first))
            for space, (first, last) in (
                (SPACE, (16 * ends).astype(np.float32)),
                (bc6h.SPACE, as_bc6h),
            )
        ]
    )


def _errors(lights: lines.Floats, wanted: lines.Floats) -> lines.Floats:
    """Return the squared error of each step at each texel, the mean of both decoders'.

    Shape (16, 16, n). It is that of the mean of what they read, and their distance from the mean.
    """
    middle = lights.mean(axis=0)
    apart = ((lights[0] - middle) ** 2).sum(axis=1)
    errors = np.empty((_STEPS, *wanted.shape[1:]), dtype=np.float32)
    for step in range(_STEPS):
        off = middle[step][:, None] - wanted
        off *= off
        errors[step] = off.sum(axis=0) + apart[step]
    return errors


def _balanced_blocks(
    texels: lines.Texels, numbers: lines.Whole, indices: lines.Whole, lamps: lines.Whole
) -> lines.Found:
    """Return blocks, with the steps of some moved so that lamps keep their energy."""
    lights = _lights(numbers)
    wanted = np.concatenate([texels.light, texels.light])

    def light(lights: lines.Floats, at: lines.Whole) -> lines.Floats:
        chosen = np.take_along_axis(lights, at[None, :, None], axis=1)
        return chosen.swapaxes(1, 2).reshape(6, *at.shape)

    if lamps.size:
        there = lights[..., lamps]
        indices[:, lamps] = lines.balanced(
            lambda at: light(there, at), wanted[..., lamps], indices[:, lamps], _STEPS
        )
    off = lines.light_error(light(lights, indices), wanted)
    return lines.Found(pack(numbers, indices), off, off)


def _as_bc6h(ends: lines.Whole) -> lines.Floats:
    """Return ends of 12 bits as BC6H interpolates them, before it rounds them."""
    halves = _HALVES[np.minimum(16 * ends, len(_HALVES) - 1)]
    return ((halves.astype(float) * 64 + 30) / 31).astype(np.float32)


def to_bc6h(data: bytes) -> bytes:
    """Return the blocks as BC6H, just as the transcoder makes it."""
    numbers, indices = unpack(np.frombuffer(data, dtype=np.uint8).reshape(-1, 16))
    ends = _as_bc6h(read(numbers))
    # The number of the first texel has no highest bit.
    is_late = indices[0] >= _STEPS // 2
    ends = np.where(is_late, ends[::-1], ends)
    return bc6h.one_line(ends, np.where(is_late, _STEPS - 1 - indices, indices)).tobytes()
