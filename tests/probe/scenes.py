"""A smooth, asymmetric HDR scene, drawn into every layout without the package's own geometry.

Directions of pixels are written down here from the tables of the conventions, or from how a
cube unfolds; files are written by OpenImageIO and OpenEXR, or byte by byte.
"""

import struct
import zlib
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import OpenImageIO as oiio
from numpy.typing import NDArray

from tests import oracles

Array = NDArray[np.floating]
Radiance = Callable[[Array], Array]

FACES = ("+X", "-X", "+Y", "-Y", "+Z", "-Z")

# The conventions' table: right / down of each face, seen from inside.
TABLE = """
+X  +Z -Y   -Z -Y
-X  -Z -Y   +Z -Y
+Y  +X -Z   +X +Z
-Y  +X +Z   +X -Z
+Z  -X -Y   +X -Y
-Z  +X -Y   -X -Y
"""

# Direction, sharpness and colour of the lights of the scene.
LIGHTS = (
    ((0.48, 0.6, 0.64), 7.0, (9.0, 7.0, 4.0)),
    ((-0.6, 0.0, 0.8), 4.0, (0.5, 1.0, 2.5)),
    ((0.36, -0.8, -0.48), 5.0, (1.5, 0.2, 0.7)),
    ((-0.8, 0.36, -0.48), 3.0, (0.3, 0.9, 0.4)),
)


def radiance(directions: Array) -> Array:
    """Radiance of the scene, (..., 3), in world directions."""
    result = np.full((*np.shape(directions)[:-1], 3), (0.2, 0.25, 0.3))
    for axis, sharpness, colour in LIGHTS:
        lobe = np.exp(sharpness * (np.asarray(directions) @ np.array(axis) - 1))
        result += lobe[..., None] * np.array(colour)
    return result


@lru_cache
def coefficients(order: int) -> Array:
    """Coefficients of the scene, ((order+1)^2, 3)."""
    return project(radiance, order)


def project(f: Radiance, order: int) -> Array:
    """Coefficients by brute force of a function as smooth as the scene."""
    directions, weights = oracles.sphere_rule(order + 60)
    return oracles.real_harmonics(order, directions).T @ (weights[:, None] * f(directions))


def error(found: Array, expected: Array) -> float:
    """Largest difference, as a part of L_00 of its channel."""
    return float(np.max(np.abs(found - expected) / np.abs(expected[0])))


def latlong(height: int, sampling: str = "center", f: Radiance = radiance) -> Array:
    """Centre +Z, left quarter +X, top +Y."""
    down, across = _positions(height, sampling), _positions(2 * height, sampling)
    elevation, turn = -down[:, None] * np.pi / 2, -across[None, :] * np.pi
    level = np.cos(elevation)
    directions = np.stack(
        [level * np.sin(turn), np.sin(elevation) + 0 * turn, level * np.cos(turn)], axis=-1
    )
    return _float(f(directions))


def angular(size: int, sampling: str = "center", f: Radiance = radiance) -> Array:
    """Centre +Z, right -X, top +Y, angle proportional to the radius; black outside the rim."""
    s = _positions(size, sampling)
    r = np.hypot(s[:, None], s)
    inside = r <= 1
    flat = np.where(r > 0, np.sin(np.pi * r) / np.maximum(r, 1e-9), np.pi)
    directions = np.stack([-s * flat, -s[:, None] * flat, np.cos(np.pi * r)], axis=-1)
    return _float(np.where(inside[..., None], f(directions), 0))


def cube_faces(
    size: int, sampling: str = "center", orientation: str = "openexr", f: Radiance = radiance
) -> Array:
    """The six faces, (6, size, size, 3)."""
    s = _positions(size, sampling)
    faces = []
    for line in TABLE.split("\n")[1:-1]:
        forward, *pairs = line.split()
        right, down = pairs[:2] if orientation == "openexr" else pairs[2:]
        points = _axis(forward) + s[:, None] * _axis(right) + s[:, None, None] * _axis(down)
        faces.append(f(points / np.linalg.norm(points, axis=-1, keepdims=True)))
    return _float(np.array(faces))


def unfolded(layout: str, size: int, sampling: str = "center", f: Radiance = radiance) -> Array:
    """A cross as a cube cut open and laid flat around the face +Z, its neighbour +X at right.

    The pattern needs no table: each cell is the one before it, turned about the edge they share.
    """
    s = _positions(size, sampling)
    front = np.stack(
        [s[None, :] + 0 * s[:, None], -s[:, None] + 0 * s, np.ones((size, size))], axis=-1
    )

    def turned(axis: str, quarters: int) -> Array:
        points = front @ oracles.turn(axis, quarters * np.pi / 2).T
        return f(points / np.linalg.norm(points, axis=-1, keepdims=True))

    cells = {(1, 0): turned("x", -1), (1, 1): turned("x", 0), (1, 2): turned("x", 1)}
    cells |= {(0, 1): turned("y", -1), (2, 1): turned("y", 1)}
    if layout == "hcross":
        cells[3, 1] = turned("y", 2)
        columns, rows = 4, 3
    else:
        cells[1, 3] = turned("x", 2)
        columns, rows = 3, 4
    image = np.zeros((rows * size, columns * size, 3))
    for (column, row), cell in cells.items():
        image[row * size : (row + 1) * size, column * size : (column + 1) * size] = cell
    return _float(image)


def arrange(faces: Array, layout: str) -> Array:
    """Faces as one image."""
    size = faces.shape[1]
    if layout == "openexr":
        return faces.reshape(6 * size, size, 3)
    if layout == "strip":
        return np.concatenate(list(faces), axis=1)
    columns, rows = (4, 3) if layout == "hcross" else (3, 4)
    image = np.zeros((rows, size, columns, size, 3), dtype=faces.dtype)
    px, nx, py, ny, pz, nz = faces
    image[1, :, 2], image[1, :, 0], image[1, :, 1] = px, nx, pz
    image[0, :, 1], image[2, :, 1] = py, ny
    if layout == "hcross":
        image[1, :, 3] = nz
    else:
        image[3, :, 1] = nz[::-1, ::-1]
    return image.reshape(rows * size, columns * size, 3)


def write(path: Path, pixels: Array, kind: str = "float", tile: int = 0, **attributes: Any) -> Path:
    """Write by OpenImageIO; pixels (H, W, channels) in 0 .. 1 for integer kinds."""
    height, width, channels = pixels.shape
    spec = oiio.ImageSpec(width, height, channels, getattr(oiio, kind.upper()))
    if tile:
        spec.tile_width = spec.tile_height = tile
    if names := attributes.pop("names", None):
        spec.channelnames = names
    for name, value in attributes.items():
        spec.attribute(name.replace("__", ":"), value)
    output = oiio.ImageOutput.create(str(path))
    assert output.open(str(path), spec), output.geterror()
    # In the file's own type: the library's conversions are not what is tested.
    integer = {"uint8": np.uint8, "uint16": np.uint16}.get(kind)
    values = np.rint(pixels * np.iinfo(integer).max).astype(integer) if integer else pixels
    assert output.write_image(np.ascontiguousarray(values)), output.geterror()
    output.close()
    return path


def write_exr(
    path: Path, channels: dict[str, Array], dtype: Any = np.float32, **header: Any
) -> Path:
    """Write planes by OpenEXR; header attributes as it names them."""
    full = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, **header}
    planes = {
        name: np.ascontiguousarray(plane, plane.dtype if plane.dtype == np.uint32 else dtype)
        for name, plane in channels.items()
    }
    with OpenEXR.File(full, planes) as file:
        file.write(str(path))
    return path


def rgb(pixels: Array, pattern: str = "{}") -> dict[str, Array]:
    """Named planes of an image."""
    return {pattern.format(c): pixels[..., k] for k, c in enumerate("RGB")}


def write_rgbe(path: Path, pixels: Array, resolution: str | None = None) -> Path:
    """Write a Radiance file without run lengths."""
    height, width, _ = pixels.shape
    brightest = pixels.max(axis=-1, keepdims=True)
    exponent = np.floor(np.log2(np.maximum(brightest, 1e-30))) + 1
    mantissa = np.floor(pixels * 2.0 ** (8 - exponent))
    packed = np.concatenate([mantissa, exponent + 128], axis=-1).astype(np.uint8)
    resolution = resolution or f"-Y {height} +X {width}"
    header = f"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n{resolution}\n"
    path.write_bytes(header.encode() + packed.tobytes())
    return path


def write_old_runs(path: Path, pixels: Array) -> Path:
    """Write a Radiance file of the oldest run lengths, as Radiance's `oldreadcolrs` reads them."""
    plain = write_rgbe(path, pixels).read_bytes()
    start = len(plain) - 4 * pixels.shape[0] * pixels.shape[1]
    packed = bytearray(plain[:start])
    quads = [plain[k : k + 4] for k in range(start, len(plain), 4)]
    while quads:
        same = next((k for k, each in enumerate(quads) if each != quads[0]), len(quads))
        packed += quads[0]
        count = same - 1
        while count:
            packed += bytes((1, 1, 1, count & 255))
            count >>= 8
        del quads[:same]
    path.write_bytes(packed)
    return path


def write_pfm(path: Path, pixels: Array, big_endian: bool = False) -> Path:
    """Write a portable float map: the bottom row comes first."""
    height, width, _ = pixels.shape
    header = f"PF\n{width} {height}\n{1.0 if big_endian else -1.0}\n".encode()
    path.write_bytes(header + pixels[::-1].astype(">f4" if big_endian else "<f4").tobytes())
    return path


def write_dds_cube(path: Path, faces: NDArray[np.uint8]) -> Path:
    """Write an uncompressed 8-bit cube map, faces (6, N, N, 3)."""
    size = faces.shape[1]
    alpha = np.full((*faces.shape[:3], 1), 255, np.uint8)
    header = struct.pack("<4sIIIIIII44x", b"DDS ", 124, 0x1007, size, size, 0, 0, 0)
    pixel_format = struct.pack("<II4sIIIII", 32, 4, b"DX10", 0, 0, 0, 0, 0)
    caps = struct.pack("<IIIII", 0x1008, 0xFE00, 0, 0, 0)
    r8g8b8a8 = struct.pack("<IIIII", 28, 3, 4, 1, 0)
    data = np.concatenate([faces, alpha], axis=-1).tobytes()
    path.write_bytes(header + pixel_format + caps + r8g8b8a8 + data)
    return path


def write_png(path: Path, pixels: NDArray[np.uint8], *extra: tuple[bytes, bytes]) -> Path:
    """Write an 8-bit PNG, (H, W, 3 or 4), with extra chunks before its pixels."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        body = kind + data
        return struct.pack(">I", len(data)) + body + struct.pack(">I", zlib.crc32(body))

    height, width, channels = pixels.shape
    header = struct.pack(">IIBBBBB", width, height, 8, 6 if channels == 4 else 2, 0, 0, 0)
    rows = b"".join(b"\0" + row.tobytes() for row in pixels)
    chunks = [(b"IHDR", header), *extra, (b"IDAT", zlib.compress(rows)), (b"IEND", b"")]
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(chunk(*parts) for parts in chunks))
    return path


def write_raw_exr(path: Path, planes: dict[str, tuple[int, Array]]) -> Path:
    """Write an uncompressed float EXR byte by byte: planes and their subsampling, by name."""
    height, width = planes["Y"][1].shape
    window = struct.pack("<4i", 0, 0, width - 1, height - 1)
    names = sorted(planes)
    channels = b"".join(
        name.encode() + b"\0" + struct.pack("<iB3xii", 2, 0, planes[name][0], planes[name][0])
        for name in names
    )
    attributes = [
        ("channels", "chlist", channels + b"\0"),
        ("compression", "compression", b"\0"),
        ("dataWindow", "box2i", window),
        ("displayWindow", "box2i", window),
        ("lineOrder", "lineOrder", b"\0"),
        ("pixelAspectRatio", "float", struct.pack("<f", 1)),
        ("screenWindowCenter", "v2f", struct.pack("<ff", 0, 0)),
        ("screenWindowWidth", "float", struct.pack("<f", 1)),
    ]
    head = struct.pack("<ii", 20000630, 2)
    for name, kind, data in attributes:
        head += name.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<i", len(data)) + data
    head += b"\0"
    lines = []
    for y in range(height):
        row = b"".join(
            planes[name][1][y // planes[name][0]].astype("<f4").tobytes()
            for name in names
            if y % planes[name][0] == 0
        )
        lines.append(struct.pack("<ii", y, len(row)) + row)
    offsets = len(head) + 8 * height + np.cumsum([0, *(len(line) for line in lines[:-1])])
    path.write_bytes(head + offsets.astype("<u8").tobytes() + b"".join(lines))
    return path


def patch_exr_windows(path: Path, width: int, height: int) -> None:
    """Overwrite the size that an EXR file claims."""
    data = bytearray(path.read_bytes())
    for name in (b"dataWindow\0box2i\0", b"displayWindow\0box2i\0"):
        start = data.index(name) + len(name) + 4
        data[start : start + 16] = struct.pack("<4i", 0, 0, width - 1, height - 1)
    path.write_bytes(data)


def _positions(size: int, sampling: str) -> Array:
    return np.array(oracles.positions(size, sampling))


def _axis(name: str) -> Array:
    return np.where(np.array(list("XYZ")) == name[1], 1.0, 0.0) * float(name[0] + "1")


def _float(image: Array) -> Array:
    return image.astype(np.float32)
