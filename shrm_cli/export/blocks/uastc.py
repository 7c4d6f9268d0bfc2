"""UASTC HDR 4x4: those blocks of ASTC that are rewritten as BC6H at once.

Phones and Apple's machines read the blocks as ASTC; where a device reads BC6H alone, the
transcoder of Basis Universal, which engines of the web ship, moves their fields. So one file
serves all. The blocks here have one line through their colours with 16 steps, which both formats
have alike.

References
----------
Binomial, basis_universal, basisu_transcoder.cpp (`astc_hdr_transcode_to_bc6h`). The Khronos Data
Format Specification 1.3, section 23.20 (how interpolated numbers become half floats).
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
    balanced,
    between,
    is_steep,
    line,
    squared_error,
    steps,
)
from shrm_cli.export.blocks.uastc_ends import read, written
from shrm_cli.export.blocks.uastc_fields import pack, unpack

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
