"""Readers of the files that are exported, written from their specifications; slow and strict.

Nothing here shares code with shrm.
"""

import struct
from dataclasses import dataclass

import numpy as np


@dataclass
class Cube:
    """A cube from a file: mips of shape (6, N, N, 3), and what its header says."""

    mips: list
    header: dict
    pairs: dict


def half(bits):
    """Return a 16-bit float; by Python's own decoder."""
    return struct.unpack("<e", struct.pack("<H", bits))[0]


def small_float(bits, mantissa_bits):
    """Return an unsigned float of 5 bits of exponent (EXT_packed_float), not infinite or NaN."""
    exponent, mantissa = bits >> mantissa_bits, bits & ((1 << mantissa_bits) - 1)
    assert exponent < 31
    if exponent == 0:
        return 2.0**-14 * mantissa / 2**mantissa_bits
    return 2.0 ** (exponent - 15) * (1 + mantissa / 2**mantissa_bits)


def packed_floats(word):
    """Return red, green and blue of R11F_G11F_B10F: 11, 11 and 10 bits from the lowest."""
    return [
        small_float(word & 2047, 6), small_float(word >> 11 & 2047, 6), small_float(word >> 22, 5)
    ]  # fmt: skip


def shared_exponent(word):
    """Return red, green and blue of RGB9_E5 (EXT_texture_shared_exponent): m 2^(e - 15 - 9)."""
    scale = 2.0 ** ((word >> 27) - 24)
    return [(word & 511) * scale, (word >> 9 & 511) * scale, (word >> 18 & 511) * scale]


def decoded(data, texels):
    """Return the numbers of packed texels, shape (n, 3)."""
    if texels == "rgba16f":
        values = [half(each) for each in np.frombuffer(data, "<u2").tolist()]
        pixels = np.reshape(values, (-1, 4))
        assert (pixels[:, 3] == 1).all()
        return pixels[:, :3]
    decode = packed_floats if texels == "r11g11b10" else shared_exponent
    return np.array([decode(word) for word in np.frombuffer(data, "<u4").tolist()])


def read_ktx1(data):
    """Read a KTX 1 cube of R11F_G11F_B10F or RGBA16F by the file format specification."""
    assert data[:12] == bytes([0xAB, 0x4B, 0x54, 0x58, 0x20, 0x31, 0x31, 0xBB, 13, 10, 0x1A, 10])
    names = (
        "endianness glType glTypeSize glFormat glInternalFormat glBaseInternalFormat pixelWidth "
        "pixelHeight pixelDepth numberOfArrayElements numberOfFaces numberOfMipmapLevels "
        "bytesOfKeyValueData"
    ).split()
    header = dict(zip(names, struct.unpack_from("<13I", data, 12), strict=True))
    assert header["endianness"] == 0x04030201
    assert (header["pixelDepth"], header["numberOfArrayElements"]) == (0, 0)
    at = 12 + 13 * 4
    end = at + header["bytesOfKeyValueData"]
    pairs = {}
    while at < end:
        (length,) = struct.unpack_from("<I", data, at)
        key, _, value = data[at + 4 : at + 4 + length].partition(b"\0")
        pairs[key.decode()] = value
        at += 4 + length + (-length) % 4
    assert at == end
    texels = {0x8C3A: "r11g11b10", 0x881A: "rgba16f"}[header["glInternalFormat"]]
    mips = []
    for mip in range(header["numberOfMipmapLevels"]):
        size = max(header["pixelWidth"] >> mip, 1)
        (face_bytes,) = struct.unpack_from("<I", data, at)
        at += 4
        faces = []
        for _ in range(header["numberOfFaces"]):
            faces.append(decoded(data[at : at + face_bytes], texels).reshape(size, size, 3))
            at += face_bytes + (-face_bytes) % 4
        mips.append(np.stack(faces))
    assert at == len(data)
    return Cube(mips, header, pairs)


def read_ktx2(data):
    """Read a KTX 2 cube by the file format specification, and check its descriptor."""
    assert data[:12] == bytes([0xAB, 0x4B, 0x54, 0x58, 0x20, 0x32, 0x30, 0xBB, 13, 10, 0x1A, 10])
    names = (
        "vkFormat typeSize pixelWidth pixelHeight pixelDepth layerCount faceCount levelCount "
        "supercompressionScheme dfdByteOffset dfdByteLength kvdByteOffset kvdByteLength"
    ).split()
    header = dict(zip(names, struct.unpack_from("<13I", data, 12), strict=True))
    assert struct.unpack_from("<2Q", data, 64) == (0, 0)  # no global data
    assert (header["pixelDepth"], header["layerCount"]) == (0, 0)
    texels, bytes_a_texel, type_size = {
        97: ("rgba16f", 8, 2), 122: ("r11g11b10", 4, 4), 123: ("rgb9e5", 4, 4)
    }[header["vkFormat"]]  # fmt: skip
    assert header["typeSize"] == type_size
    header["texels"] = texels
    header["samples"] = _descriptor(data, header, bytes_a_texel)
    at, end = header["kvdByteOffset"], header["kvdByteOffset"] + header["kvdByteLength"]
    pairs = {}
    while at < end:
        (length,) = struct.unpack_from("<I", data, at)
        key, _, value = data[at + 4 : at + 4 + length].partition(b"\0")
        pairs[key.decode()] = value
        at += 4 + length + (-length) % 4
    assert at == end
    assert list(pairs) == sorted(pairs)
    mips, places = [], []
    for mip in range(header["levelCount"]):
        offset, length, whole = struct.unpack_from("<3Q", data, 80 + 24 * mip)
        size = max(header["pixelWidth"] >> mip, 1)
        stored = data[offset : offset + length]
        if header["supercompressionScheme"] == 2:
            import zstandard

            stored = zstandard.ZstdDecompressor().decompress(stored)
        else:
            assert offset % max(bytes_a_texel, 4) == 0
        assert len(stored) == whole == 6 * size * size * bytes_a_texel
        places.append((offset, offset + length))
        mips.append(decoded(stored, texels).reshape(6, size, size, 3))
    # The smallest mip is first in the file, and nothing overlaps or is left over.
    assert places == sorted(places, reverse=True)
    assert places[0][1] == len(data)
    return Cube(mips, header, pairs)


def _descriptor(data, header, bytes_a_texel):
    """Check the basic descriptor block, and return its samples."""
    at, length = header["dfdByteOffset"], header["dfdByteLength"]
    (total, kind, version, block) = struct.unpack_from("<IIHH", data, at)
    assert (total, kind, version, block) == (length, 0, 2, length - 4)
    model, primaries, transfer, flags = data[at + 12 : at + 16]
    assert (model, primaries, transfer, flags) == (1, 1, 1, 0)
    assert data[at + 16 : at + 20] == bytes(4)  # blocks of one texel
    assert data[at + 20 : at + 28] == bytes([bytes_a_texel, 0, 0, 0, 0, 0, 0, 0])
    samples = []
    for start in range(at + 28, at + length, 16):
        offset, bits, kind, position, lower, upper = struct.unpack_from("<HBBIII", data, start)
        assert position == 0
        samples.append((kind, offset, bits + 1, lower, upper))
    return samples


def look_up(faces, directions):
    """Return the texels (n, 3) that a graphics interface finds in faces (6, N, N, 3).

    The table is that of OpenGL 4.6, table 8.19: face, and s and t on it, of a direction.
    """
    size = faces.shape[1]
    found = []
    for x, y, z in directions:
        ax, ay, az = abs(x), abs(y), abs(z)
        if ax >= ay and ax >= az:
            face, sc, tc, ma = (0, -z, -y, ax) if x > 0 else (1, z, -y, ax)
        elif ay >= az:
            face, sc, tc, ma = (2, x, z, ay) if y > 0 else (3, x, -z, ay)
        else:
            face, sc, tc, ma = (4, x, -y, az) if z > 0 else (5, -x, -y, az)
        s, t = (sc / ma + 1) / 2, (tc / ma + 1) / 2
        column, row = (min(int(each * size), size - 1) for each in (s, t))
        found.append(faces[face, row, column])
    return np.array(found)
