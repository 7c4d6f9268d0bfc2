"""ASTC for light, by Arm's encoder (the package astc-encoder-py).

It weighs errors as the logarithms of its own format have them, which suits light.

References: The Khronos Data Format Specification 1.3, chapter 23 (ASTC).
"""

from types import ModuleType
from typing import Any

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.errors import ArgumentError
from shrm_cli.extras import install

_QUALITY = 60
"""Arm's "medium": what is better takes many times as long."""


def library() -> ModuleType:
    """Return Arm's encoder."""
    try:
        import astc_encoder
    except ImportError as error:
        raise ArgumentError(
            "texels", f"ASTC is made by the package astc-encoder-py; {install('astc')}"
        ) from error
    return astc_encoder


def encode(image: Array, edge: int) -> bytes:
    """Return an image, shape (M, N, 3), in blocks of `edge` by `edge` texels, row by row."""
    height, width = image.shape[:2]
    texels = np.ones((height, width, 4), dtype="<f2")
    texels[..., :3] = image
    arm = library()
    source = arm.ASTCImage(_types().F16, width, height, data=texels.tobytes())
    return _context(edge).compress(source, arm.ASTCSwizzle.from_str("RGB1"))


def decode(data: bytes, height: int, width: int, edge: int) -> Array:
    """Return the image of some blocks, shape (height, width, 3)."""
    arm = library()
    image = arm.ASTCImage(_types().F32, width, height)
    image = _context(edge).decompress(data, image, arm.ASTCSwizzle.from_str("RGBA"))
    texels = np.frombuffer(image.data, dtype="<f4").reshape(height, width, 4)
    return texels[..., :3].astype(float)


def _types() -> Any:
    library()
    from astc_encoder import enum

    return enum.ASTCType


def _context(edge: int) -> Any:
    from astc_encoder import enum

    arm = library()
    return arm.ASTCContext(arm.ASTCConfig(enum.ASTCProfile.HDR, edge, edge, 1, _QUALITY))
