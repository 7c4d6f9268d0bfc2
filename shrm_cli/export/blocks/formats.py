"""The block-compressed formats that cubes are written in."""

from types import ModuleType

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.export.blocks import astc, bc6h, uastc
from shrm_cli.export.blocks.lamps import Found, with_lamps
from shrm_cli.export.pixels import FORMATS, TexelFormat, Words
from shrm_cli.progress import in_order

_CHUNK = 4096
"""Blocks of a job."""


def _ours(name: str, title: str, coder: ModuleType) -> TexelFormat:
    """Return a format of blocks of 4 x 4 texels by encoders of blocks of shape (3, 16, n)."""

    def pack(images: Array) -> Words:
        height, width = images.shape[0] * images.shape[1], images.shape[2]
        blocks = images.reshape(height // 4, 4, width // 4, 4, 3)
        blocks = blocks.transpose(4, 1, 3, 0, 2).reshape(3, 16, -1)
        prices = coder.prices_of(blocks)
        jobs = [slice(at, at + _CHUNK) for at in range(0, blocks.shape[-1], _CHUNK)]
        found = in_order(lambda some: coder.encoded(blocks[..., some], prices[some]), jobs)
        parts = [one.arrays for one in found]
        whole = Found(*(np.concatenate(each) for each in zip(*parts, strict=True)))
        return with_lamps(blocks, whole, coder.searched).ravel()

    return TexelFormat(name, title, (coder.LARGEST,) * 3, 16, pack, 4)


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
        _ours("bc6h", "BC6H", bc6h),
        _ours("uastc", "UASTC HDR 4x4", uastc),
        _astc(4),
        _astc(6),
    )
}
"""The formats by name. They pack stacks of images of shape (n, M, N, 3)."""
ALL = {**FORMATS, **BLOCKS}
"""All formats of texels by name, those of `shrm_cli.export.pixels` too."""
