"""KTX: cubes with mips. KTX 2 has them in Vulkan's formats, compressed by Zstandard where that is
installed, and KTX 1 in OpenGL's terms.

References: Khronos, "KTX File Format Specification", versions 1 and 2.0; "Khronos Data Format
Specification", version 1.3, section 5 (the basic descriptor) and table 96 (the descriptor of
RGB9E5).
"""

import os
import struct
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from math import lcm
from typing import Any

from shrm_cli import __release__
from shrm_cli.errors import MapError
from shrm_cli.export.pixels import TexelFormat
from shrm_cli.records import record

_KTX2 = b"\xabKTX 20\xbb\r\n\x1a\n"
_FACES = 6
_ZSTD = 2
_LEVEL = 18
"""Zstandard's level; higher ones take seconds, and save next to nothing."""

_MOST_LEVELS = 16
_KTX1 = b"\xabKTX 11\xbb\r\n\x1a\n"
_LITTLE_ENDIAN = 0x04030201

_GL = {
    # glType, glTypeSize, glFormat, glInternalFormat, glBaseInternalFormat
    "rgba16f": (0x140B, 2, 0x1908, 0x881A, 0x1908),  # HALF_FLOAT, RGBA, RGBA16F
    "r11g11b10": (0x8C3A, 4, 0x1907, 0x8C3A, 0x1907),
}
"""The header's numbers for the formats that Filament reads, which alone reads these files. By the
specification the type of R11F_G11F_B10F is 0x8C3B (UNSIGNED_INT_10F_11F_11F_REV). Filament's cmgen
writes the number of the internal format there, and its reader knows no other; it has a type for
HALF_FLOAT, and none for RGB9_E5."""

# Bits of a sample's channel type.
_EXPONENT, _SIGNED, _FLOAT = 0x20, 0x40, 0x80
_RED, _GREEN, _BLUE, _ALPHA = 0, 1, 2, 15
_ONE, _MINUS_ONE = 0x3F800000, 0xBF800000
"""The bits of the 32-bit floats 1 and -1."""


@record
class _Sample:
    """One channel of a texel: where its bits are, what they are, and which numbers 0 and 1 are."""

    channel: int
    offset: int
    bits: int
    lower: int
    upper: int

    def packed(self) -> bytes:
        return struct.pack(
            "<HBB4xII", self.offset, self.bits - 1, self.channel, self.lower, self.upper
        )


def _float(channel: int, offset: int, bits: int = 16) -> _Sample:
    return _Sample(channel | _FLOAT | _SIGNED, offset, bits, _MINUS_ONE, _ONE)


def _shared(channel: int, offset: int) -> tuple[_Sample, _Sample]:
    """Return a mantissa, and the exponent that all share: bias 15; 1.0 is 256 2^(16 - 24)."""
    return (
        _Sample(channel, offset, 9, 0, 16 << 9 | 256),
        _Sample(channel | _EXPONENT, 27, 5, 15, 31),
    )


_VULKAN: dict[str, tuple[int, int, tuple[_Sample, ...]]] = {
    # vkFormat, typeSize, samples
    "rgba16f": (
        97, 2, (_float(_RED, 0), _float(_GREEN, 16), _float(_BLUE, 32), _float(_ALPHA, 48)),
    ),
    "rgba32f": (
        109, 4,
        tuple(_float(each, 32 * k, 32) for k, each in enumerate((_RED, _GREEN, _BLUE, _ALPHA))),
    ),
    "r11g11b10": (
        122, 4,
        (
            _Sample(_RED | _FLOAT, 0, 11, 0, _ONE),
            _Sample(_GREEN | _FLOAT, 11, 11, 0, _ONE),
            _Sample(_BLUE | _FLOAT, 22, 10, 0, _ONE),
        ),
    ),
    "rgb9e5": (123, 4, (*_shared(_RED, 0), *_shared(_GREEN, 9), *_shared(_BLUE, 18))),
    "bc6h": (143, 1, (_Sample(_FLOAT, 0, 128, 0, _ONE),)),
    # ASTC, whose colour model says that it is rewritten as BC6H at once.
    "uastc": (1000066000, 1, (_Sample(_FLOAT, 0, 128, 0, _ONE),)),
    "astc4x4": (1000066000, 1, (_float(0, 0, 128),)),
    "astc6x6": (1000066004, 1, (_float(0, 0, 128),)),
}  # fmt: skip
_RGBSDA = 1
_MODELS = {"bc6h": 133, "uastc": 167, "astc4x4": 162, "astc6x6": 162}
"""The descriptor's colour models; of texels without blocks it is `_RGBSDA`."""


def can_compress() -> bool:
    """Tell whether the package for Zstandard is installed."""
    return find_spec("zstandard") is not None


def ktx2(
    levels: Sequence[bytes],
    shape: tuple[int, int, int],
    texels: TexelFormat,
    compress: bool,
    faces: int = 1,
) -> bytes:
    """Return a KTX 2 file of a cube, a picture or a volume.

    `levels` are the encoded texels of each mip, which has half the size of the one before: the
    faces of a cube in the order +X -X +Y -Y +Z -Z; of a volume x runs fastest, then y, then z.
    `shape` is the number of texels along x, y and z of the first mip. The depth of pictures and
    cubes is 0. `compress` tells whether each mip is compressed by Zstandard, which needs the extra
    ``export``. `faces` are 6 of a cube.
    """
    number, type_size, samples = _VULKAN[texels.name]
    stored = list(levels)
    if compress:
        import zstandard

        stored = [zstandard.ZstdCompressor(level=_LEVEL).compress(mip) for mip in levels]
    descriptor = _descriptor(samples, texels)
    pairs = _pair("KTXwriter", f"shrm {__release__}")
    head = len(_KTX2) + 9 * 4 + 4 * 4 + 2 * 8 + 24 * len(levels)
    header = struct.pack(
        "<9I", number, type_size, *shape, 0, faces, len(levels), _ZSTD if compress else 0
    )
    index = struct.pack("<4I2Q", head, len(descriptor), head + len(descriptor), len(pairs), 0, 0)
    front = _KTX2 + header + index
    # The smallest mip comes first. What is not compressed begins at a multiple of its texels.
    step = 1 if compress else lcm(texels.size, 4)
    at = head + len(descriptor) + len(pairs)
    places, body = {}, bytearray()
    for k in reversed(range(len(levels))):
        body += bytes(-(at + len(body)) % step)
        places[k] = at + len(body)
        body += stored[k]
    entries = b"".join(
        struct.pack("<3Q", places[k], len(stored[k]), len(levels[k])) for k in range(len(levels))
    )
    return front + entries + descriptor + pairs + bytes(body)


def read_ktx2_facts(path: str | os.PathLike[str]) -> dict[str, Any] | None:
    """Return what the header of a KTX 2 file says of it; None of another file.

    Raises MapError if the file ends before its last mip.
    """
    if not os.path.isfile(path):
        return None
    head, size = len(_KTX2) + 13 * 4 + 2 * 8, os.path.getsize(path)
    with open(path, "rb") as file:
        start = file.read(head + 24 * _MOST_LEVELS)
    if not start or not _KTX2.startswith(start[: len(_KTX2)]):
        return None
    try:
        number, _, width, height, depth, _, faces, mips, scheme = struct.unpack_from(
            "<9I", start, len(_KTX2)
        )
        for k in range(max(mips, 1)):  # 0 asks for more mips than the one that there is
            place, count, _ = struct.unpack_from("<3Q", start, head + 24 * k)
            if place + count > size:
                raise damaged(path)
    except struct.error:
        raise damaged(path) from None
    known = (name for name, (own, _, _) in _VULKAN.items() if own == number)
    return {
        "holds": "a cube" if faces == 6 else "a volume" if depth else "a picture",
        "width": width, "height": height, **({"depth": depth} if depth else {}),
        "mips": mips,
        "texels": next(known, f"vkFormat {number}"),
        "packed": scheme != 0,
        "bytes": os.path.getsize(path),
    }  # fmt: skip


def read_ktx1_facts(path: str | os.PathLike[str]) -> dict[str, Any] | None:
    """Return what the header of a KTX 1 file as `ktx1_cube` writes it says; None of another file.

    Raises MapError if the file ends before its last mip.
    """
    size = os.path.getsize(path)
    with open(path, "rb") as file:
        start = file.read(len(_KTX1) + 13 * 4)
        if not start.startswith(_KTX1):
            return None
        try:
            endian, _, _, _, internal, _, width, height, _, _, faces, mips, pairs = (
                struct.unpack_from("<13I", start, len(_KTX1))
            )
            if endian != _LITTLE_ENDIAN:
                return None
            place = len(start) + pairs
            for _ in range(min(mips, _MOST_LEVELS)):
                file.seek(min(place, size))
                place += 4 + faces * struct.unpack("<I", file.read(4))[0]
        except struct.error:
            raise damaged(path) from None
    if place > size:
        raise damaged(path)
    known = (name for name, numbers in _GL.items() if numbers[3] == internal)
    return {
        "kind": "KTX 1 texture of engines",
        "holds": "a cube" if faces == _FACES else "a picture",
        "width": width, "height": height, "mips": mips,
        "texels": next(known, f"glInternalFormat {internal}"),
        "bytes": size,
    }  # fmt: skip


def damaged(path: str | os.PathLike[str]) -> MapError:
    """Return the error about a file for engines that ends before its last texel."""
    return MapError(f"{os.fspath(path)}: damaged or truncated; export it again")


def ktx1_cube(
    levels: Sequence[bytes], size: int, texels: TexelFormat, metadata: Mapping[str, str]
) -> bytes:
    """Return a KTX 1 file of a cube.

    `levels` are the encoded faces of each mip, in the order +X -X +Y -Y +Z -Z; each mip has half
    the size of the one before. `size` is the number of texels along an edge of the first mip.
    Values end in a NUL in the file.
    """
    pairs = b"".join(_pair(key, value) for key, value in metadata.items())
    kind, kind_size, layout, internal, base = _GL[texels.name]
    header = struct.pack(
        "<13I", _LITTLE_ENDIAN, kind, kind_size, layout, internal, base, size, size, 0, 0,
        _FACES, len(levels), len(pairs),
    )  # fmt: skip
    data = [_KTX1, header, pairs]
    for mip in levels:
        # A cube that is no array tells the size of one face. Texels of 4 bytes need no padding.
        data += [struct.pack("<I", len(mip) // _FACES), mip]
    return b"".join(data)


def _descriptor(samples: Sequence[_Sample], texels: TexelFormat) -> bytes:
    """Return the data format descriptor: linear RGB of BT.709."""
    block = 24 + 16 * len(samples)
    model = _MODELS.get(texels.name, _RGBSDA)
    primaries, linear, flags = 1, 1, 0  # BT709
    last = texels.edge - 1
    basic = struct.pack(
        "<IHH4B4B8B", 0, 2, block, model, primaries, linear, flags, last, last, 0, 0,
        texels.size, 0, 0, 0, 0, 0, 0, 0,
    )  # fmt: skip
    return struct.pack("<I", 4 + block) + basic + b"".join(each.packed() for each in samples)


def _pair(key: str, value: str) -> bytes:
    both = key.encode() + b"\0" + value.encode() + b"\0"
    return struct.pack("<I", len(both)) + both + bytes(-len(both) % 4)
