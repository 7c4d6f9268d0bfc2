"""DDS files with cubes and their mips, for DirectX and the tools that read its textures.

A header, its extension "DX10" with the number of the pixel format, then for each face
+X -X +Y -Y +Z -Z all levels from the largest.

References: Microsoft, Programming guide for DDS; DDS_HEADER, DDS_HEADER_DXT10.
"""

import os
import struct
from collections.abc import Sequence
from typing import Any

from shrm_cli.export.ktx import damaged
from shrm_cli.export.pixels import TexelFormat

_HEADER = struct.Struct("<4s 7I 44x 2I 4s 20x 4I 4x")
"""Magic; size, flags, height, width, pitch, depth, levels; of the pixel format its size, flags and
code; four words of caps."""
_EXTENSION = struct.Struct("<5I")
"""Format, dimension, flags, count, alpha."""
# Caps, height, width, pitch, pixel format and the number of levels are given.
_FLAGS = 0x1 | 0x2 | 0x4 | 0x8 | 0x1000 | 0x20000
_HAS_CODE = 0x4
# A texture of several surfaces with mips; a cube with all its faces.
_CAPS, _CAPS_CUBE = 0x1000 | 0x8 | 0x400000, 0x200 | 0xFC00
_TEXTURE_2D, _IS_CUBE, _OPAQUE = 3, 0x4, 3
_LINEAR_SIZE = 0x80000
"""Instead of a pitch, the bytes of the first level are given: of blocks."""
_NUMBERS = {"rgba16f": 10, "r11g11b10": 26, "rgb9e5": 67, "bc6h": 95}
"""DXGI_FORMAT_R16G16B16A16_FLOAT, R11G11B10_FLOAT, R9G9B9E5_SHAREDEXP and BC6H_UF16."""

_UNREAD = ("r11g11b10", "rgb9e5")
"""Those of four bytes a texel, which are not read as probes."""


def dds_cube(levels: Sequence[bytes], size: int, texels: TexelFormat) -> bytes:
    """Return the bytes of a file of a cube with its mips.

    `levels` are little-endian texels of each level: six faces, in rows from the top. Each level is
    half as wide as the one before. `size` is the number of texels along an edge of the first level.
    """
    flags, pitch = _FLAGS, size * texels.size
    if texels.edge > 1:
        flags, pitch = _FLAGS & ~0x8 | _LINEAR_SIZE, len(levels[0]) // 6
    header = _HEADER.pack(
        b"DDS ", 124, flags, size, size, pitch, 1, len(levels),
        32, _HAS_CODE, b"DX10", _CAPS, _CAPS_CUBE, 0, 0,
    )  # fmt: skip
    extension = _EXTENSION.pack(_NUMBERS[texels.name], _TEXTURE_2D, _IS_CUBE, 1, _OPAQUE)
    faces = (
        level[face * len(level) // 6 : (face + 1) * len(level) // 6]
        for face in range(6)
        for level in levels
    )
    return header + extension + b"".join(faces)


def dds_image(data: bytes, height: int, width: int) -> bytes:
    """Return a file of one image in BC6H."""
    flags = _FLAGS & ~(0x8 | 0x20000) | _LINEAR_SIZE
    header = _HEADER.pack(
        b"DDS ", 124, flags, height, width, len(data), 1, 1,
        32, _HAS_CODE, b"DX10", _CAPS & 0x1000, 0, 0, 0,
    )  # fmt: skip
    return header + _EXTENSION.pack(_NUMBERS["bc6h"], _TEXTURE_2D, 0, 1, _OPAQUE) + data


def read_dds_facts(path: str | os.PathLike[str]) -> dict[str, Any] | None:
    """Return what the header of a DDS file of `_UNREAD` says of it; None of another file.

    Raises MapError if the file ends before its last mip.
    """
    with open(path, "rb") as file:
        start = file.read(_HEADER.size + _EXTENSION.size)
    if len(start) < _HEADER.size + _EXTENSION.size or not start.startswith(b"DDS "):
        return None
    _, _, _, height, width, _, _, mips, _, _, code, *_ = _HEADER.unpack_from(start)
    number, _, flags, _, _ = _EXTENSION.unpack_from(start, _HEADER.size)
    texels = next((name for name in _UNREAD if _NUMBERS[name] == number), None)
    if code != b"DX10" or texels is None:
        return None
    sides = (max(width >> k, 1) * max(height >> k, 1) for k in range(max(1, min(mips, 16))))
    count = (6 if flags & _IS_CUBE else 1) * 4 * sum(sides)
    if os.path.getsize(path) < len(start) + count:
        raise damaged(path)
    return {
        "kind": "DDS texture of engines",
        "holds": "a cube" if flags & _IS_CUBE else "a picture",
        "width": width, "height": height, "mips": mips,
        "texels": texels,
        "bytes": os.path.getsize(path),
    }  # fmt: skip
