"""The block-compressed formats that cubes are written in."""

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.export.blocks import astc, bc6h
from shrm_cli.export.pixels import FORMATS, TexelFormat, Words


def _bc6h(images: Array) -> Words:
    return np.frombuffer(bc6h.encode(images.reshape(-1, *images.shape[2:])), dtype=np.uint8)


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
        TexelFormat("bc6h", "BC6H", (bc6h.LARGEST,) * 3, 16, _bc6h, 4),
        _astc(4),
        _astc(6),
    )
}
"""The formats by name. They pack stacks of images of shape (n, M, N, 3)."""
ALL = {**FORMATS, **BLOCKS}
"""All formats of texels by name, those of `shrm_cli.export.pixels` too."""
