"""PNG files of 8-bit sRGB, or of 16-bit numbers, written whole or not at all."""

import os
import struct
import zlib
from contextlib import suppress
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.files.openimageio import oiio
from shrm_cli.files.whole import cut_off_error, replacing

SOFTWARE = "shrm"
"""What files say of the program that wrote them."""
_SAYS = b"tEXtSoftware\0" + SOFTWARE.encode()
_MOST_MARKS = 4096
"""The bytes among which a file of ours says it; others may have a long profile before."""
_PNG_END = b"\0\0\0\0IEND\xaeB`\x82"
"""The empty IEND chunk with which every whole PNG file ends."""


def encode_srgb(pixels: ArrayLike) -> NDArray[np.uint8]:
    """Encode linear Rec.709 values as 8-bit sRGB, clipped to 0 .. 1, of the same shape.

    References: IEC 61966-2-1:1999, the sRGB transfer function.
    """
    linear = np.clip(np.asarray(pixels, dtype=np.float32), 0, 1)
    encoded = np.where(
        linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** np.float32(1 / 2.4) - 0.055
    )
    return np.floor(255 * encoded + 0.5).astype(np.uint8)


def png_bytes(pixels: NDArray[np.uint8]) -> bytes:
    """Return a picture as the bytes of a PNG, for pages that hold it within.

    `pixels`, of shape (H, W, 3) or (H, W, 4), are 8-bit sRGB; the fourth channel is the coverage,
    by which the others are not multiplied.

    References: ISO/IEC 15948:2004, clauses 5 and 9. Each row takes that of the filters none, sub
    and up whose differences are the least.
    """
    height, width, channels = pixels.shape
    rows = pixels.reshape(height, width * channels)
    sub, up = rows.copy(), rows.copy()
    sub[:, channels:] -= rows[:, :-channels]
    up[1:] -= rows[:-1]
    filtered = np.stack([rows, sub, up])
    costs = np.abs(filtered.view(np.int8).astype(np.int16)).sum(axis=2, dtype=np.int64)
    chosen = costs.argmin(axis=0)
    lines = np.empty((height, 1 + width * channels), dtype=np.uint8)
    lines[:, 0], lines[:, 1:] = chosen, filtered[chosen, np.arange(height)]
    # The rendering intent of an sRGB chunk says that the values are sRGB.
    return png_of_lines(width, lines, 7, _chunk(b"sRGB", b"\0"))


def png_of_lines(width: int, lines: NDArray[np.uint8], level: int, marks: bytes = b"") -> bytes:
    """Return a PNG of 8 bits of filtered lines, shape (H, 1 + 3 W) or (H, 1 + 4 W)."""
    color = {3: 2, 4: 6}[(lines.shape[1] - 1) // width]
    header = _chunk(b"IHDR", struct.pack(">IIBBBBB", width, len(lines), 8, color, 0, 0, 0))
    data = _chunk(b"IDAT", zlib.compress(lines.tobytes(), level))
    return b"\x89PNG\r\n\x1a\n" + header + marks + data + _PNG_END


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def write_png(path: str | os.PathLike[str], pixels: NDArray[np.uint8 | np.uint16]) -> None:
    """Write a picture of 8-bit sRGB values, or 16-bit linear ones, whole or not at all.

    `pixels`, of shape (H, W, 3), are of 8 or 16 bits.
    """
    with replacing(path) as temporary:
        _write_png(temporary, pixels)


def _write_png(path: Path, pixels: NDArray[np.uint8 | np.uint16]) -> None:
    height, width, _ = pixels.shape
    is_srgb = pixels.dtype == np.uint8
    spec = oiio.ImageSpec(width, height, 3, oiio.UINT8 if is_srgb else oiio.UINT16)
    spec.attribute("oiio:ColorSpace", "sRGB" if is_srgb else "linear")
    spec.attribute("Software", SOFTWARE)
    path.touch()  # raises the system's error, which OpenImageIO would not report
    target = oiio.ImageOutput.create("png")
    # Calling write_image after a failed open would be a segmentation fault.
    if target is None or not target.open(str(path), spec):
        raise OSError(0, "OpenImageIO cannot write it")
    written = target.write_image(pixels) and target.close()
    # On a full disk both calls return True and only set has_error. They do not even set it if the
    # last block fails, which closing the file writes: then the end of the file is missing.
    if not written or target.has_error or not _ends_whole(path):
        raise cut_off_error()


def is_ours(path: str | os.PathLike[str]) -> bool:
    """Whether a file is a PNG that says that `shrm` wrote it."""
    with suppress(OSError), open(path, "rb") as stream:
        begun = stream.read(_MOST_MARKS)
        return begun.startswith(b"\x89PNG") and _SAYS in begun.partition(b"IDAT")[0]
    return False


def _ends_whole(path: Path) -> bool:
    with open(path, "rb") as stream:
        stream.seek(0, os.SEEK_END)
        stream.seek(max(stream.tell() - len(_PNG_END), 0))
        return stream.read() == _PNG_END
