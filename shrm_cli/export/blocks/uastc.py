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
from shrm_cli.export.blocks.lines import (
    Floats,
    Space,
    Texels,
    along,
    balanced,
    is_steep,
    line,
)  # fmt: skip
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


def encoded(blocks: Array) -> NDArray[np.uint8]:
    """Return blocks of shape (3, 16, n) as bytes, shape (n, 16)."""
    texels = Texels.of(np.minimum(blocks, LARGEST), SPACE)
    ends = np.stack(line(texels, np.ones((16, blocks.shape[-1]), dtype=bool), _STEPS))
    is_turned = ends[0].max(axis=0) > ends[1].max(axis=0)
    numbers = written(np.where(is_turned, ends[::-1], ends), texels.weights.sum(axis=1))
    found = (16 * read(numbers)).astype(np.float32)
    at = along(texels, found[0][:, None], found[1][:, None])
    indices = np.rint(np.clip(at, 0, 1) * (_STEPS - 1)).astype(np.int64)
    bright = np.flatnonzero(is_steep(texels))
    if bright.size:
        on_second = np.zeros((16, bright.size), dtype=bool)
        indices[:, bright] = balanced(
            texels[bright], found[..., bright], indices[:, bright], on_second, _STEPS
        )
    return pack(numbers, indices)


def to_bc6h(data: bytes) -> bytes:
    """Return the blocks as BC6H, just as the transcoder makes it."""
    numbers, indices = unpack(np.frombuffer(data, dtype=np.uint8).reshape(-1, 16))
    ends = (_halves((16 * read(numbers)).astype(np.float32)).astype(float) * 64 + 30) / 31
    # The number of the first texel has no highest bit.
    is_late = indices[0] >= _STEPS // 2
    ends = np.where(is_late, ends[::-1], ends)
    return bc6h.one_line(ends, np.where(is_late, _STEPS - 1 - indices, indices)).tobytes()
