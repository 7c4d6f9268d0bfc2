"""DDS files with cubes and their mips, for DirectX and the tools that read its textures.

A header, its extension "DX10" with the number of the pixel format, then for each face
+X -X +Y -Y +Z -Z all levels from the largest.

References
----------
Microsoft, Programming guide for DDS; DDS_HEADER, DDS_HEADER_DXT10.
"""

import struct
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.generic]

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
_FORMATS = {np.dtype("<f2"): (10, 8), np.dtype("<u4"): (67, 4)}
"""DXGI_FORMAT_R16G16B16A16_FLOAT and DXGI_FORMAT_R9G9B9E5_SHAREDEXP, and bytes of a pixel."""


def dds_file(levels: Sequence[Array]) -> bytes:
    """Return the bytes of a file of a cube with its mips.

    Parameters
    ----------
    levels : sequence of ndarray
        Half floats of shape (6, N, N, 4), RGBA, or words of a shared exponent of shape (6, N, N),
        each level half as wide as the one before.

    Raises
    ------
    ValueError
        If the levels are no such chain, or of another type.
    """
    sizes = [level.shape[1] for level in levels]
    if any(size != sizes[0] >> k or size < 1 for k, size in enumerate(sizes)):
        raise ValueError(f"levels of {sizes} texels do not halve")
    kind = levels[0].dtype.newbyteorder("<")
    if kind not in _FORMATS:
        raise ValueError(f"pixels of {kind}")
    number, pixel_bytes = _FORMATS[kind]
    size = sizes[0]
    header = _HEADER.pack(
        b"DDS ", 124, _FLAGS, size, size, size * pixel_bytes, 1, len(sizes),
        32, _HAS_CODE, b"DX10", _CAPS, _CAPS_CUBE, 0, 0,
    )  # fmt: skip
    extension = _EXTENSION.pack(number, _TEXTURE_2D, _IS_CUBE, 1, _OPAQUE)
    faces = [level[face].astype(kind).tobytes() for face in range(6) for level in levels]
    return header + extension + b"".join(faces)
