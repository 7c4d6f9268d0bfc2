"""KTX 1: cubes with mips and a list of keys with values, in OpenGL's terms.

References
----------
Khronos, "KTX File Format Specification", version 1.
"""

import struct
from collections.abc import Mapping, Sequence

from shrm_cli.export.pixels import TexelFormat

_IDENTIFIER = b"\xabKTX 11\xbb\r\n\x1a\n"
_LITTLE_ENDIAN = 0x04030201
_FACES = 6

_GL = {
    # glType, glTypeSize, glFormat, glInternalFormat, glBaseInternalFormat
    "rgba16f": (0x140B, 2, 0x1908, 0x881A, 0x1908),  # HALF_FLOAT, RGBA, RGBA16F
    "r11g11b10": (0x8C3A, 4, 0x1907, 0x8C3A, 0x1907),
}
"""The header's numbers for the formats that Filament reads, which alone reads these files. By the
specification the type of R11F_G11F_B10F is 0x8C3B (UNSIGNED_INT_10F_11F_11F_REV). Filament's cmgen
writes the number of the internal format there, and its reader knows no other; it has a type for
HALF_FLOAT, and none for RGB9_E5."""


def ktx1_cube(
    levels: Sequence[bytes], size: int, texels: TexelFormat, metadata: Mapping[str, str]
) -> bytes:
    """Return a KTX 1 file of a cube.

    Parameters
    ----------
    levels : sequence of bytes
        The encoded faces of each mip, in the order +X -X +Y -Y +Z -Z; each mip has half the size
        of the one before.
    size : int
        Texels along an edge of the first mip.
    texels : TexelFormat
    metadata : mapping of str to str
        Keys and values. Values end in a NUL in the file.

    Returns
    -------
    bytes
    """
    pairs = b"".join(_pair(key, value) for key, value in metadata.items())
    kind, kind_size, layout, internal, base = _GL[texels.name]
    header = struct.pack(
        "<13I", _LITTLE_ENDIAN, kind, kind_size, layout, internal, base, size, size, 0, 0,
        _FACES, len(levels), len(pairs),
    )  # fmt: skip
    data = [_IDENTIFIER, header, pairs]
    for mip in levels:
        # A cube that is no array tells the size of one face. Texels of 4 bytes need no padding.
        data += [struct.pack("<I", len(mip) // _FACES), mip]
    return b"".join(data)


def _pair(key: str, value: str) -> bytes:
    both = key.encode() + b"\0" + value.encode() + b"\0"
    return struct.pack("<I", len(both)) + both + bytes(-len(both) % 4)
