"""The block-compressed formats that cubes are written in."""

from collections.abc import Callable

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.export.blocks import astc, bc6h, uastc
from shrm_cli.export.pixels import FORMATS, TexelFormat, Words
from shrm_cli.parallel import in_order

_CHUNK = 4096
"""Blocks of a job."""


def _ours(name: str, title: str, largest: float, encoded: Callable[[Array], Words]) -> TexelFormat:
    """Return a format of blocks of 4 x 4 texels by an encoder of blocks of shape (3, 16, n)."""

    def pack(images: Array) -> Words:
        height, width = images.shape[0] * images.shape[1], images.shape[2]
        blocks = images.reshape(height // 4, 4, width // 4, 4, 3)
        blocks = blocks.transpose(4, 1, 3, 0, 2).reshape(3, 16, -1)
        jobs = [blocks[..., at : at + _CHUNK] for at in range(0, blocks.shape[-1], _CHUNK)]
        return np.concatenate([each.ravel() for each in in_order(encoded, jobs)])

    return TexelFormat(name, title, (largest,) * 3, 16, pack, 4)


def _astc(edge: int) -> TexelFormat:
    def pack(images: Array) -> Words:
        data = b"".join(astc.encode(image, edge) for image in images)
        return np.frombuffer(data, dtype=np.uint8)

    return TexelFormat(
        f"astc{edge}x{edge}", f"ASTC {edge}x{edge}", (bc6h.LARGEST,) * 3, 16, pack, edge
    )


BLOCKS = {
    each.name: each
    for each in (
        _ours("bc6h", "BC6H", bc6h.LARGEST, bc6h.encoded),
        _ours("uastc", "UASTC HDR 4x4", uastc.LARGEST, uastc.encoded),
        _astc(4),
        _astc(6),
    )
}
"""The formats by name. They pack stacks of images of shape (n, M, N, 3)."""
ALL = {**FORMATS, **BLOCKS}
"""All formats of texels by name, those of `shrm_cli.export.pixels` too."""
