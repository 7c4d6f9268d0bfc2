"""Linear pictures -> files: 8-bit sRGB PNG to look at, or scene-linear EXR to measure."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np
import OpenImageIO as oiio
from numpy.typing import ArrayLike, NDArray

from shrm_cli.errors import OutputError
from shrm_cli.exr import write_image
from shrm_cli.files import replacing

Array = NDArray[np.floating]
Picture = NDArray[np.float32]
FileType = Literal["png", "exr"]

_ROWS_AT_ONCE = 256
_PNG_END = b"\0\0\0\0IEND\xaeB`\x82"


def file_type(path: str | os.PathLike[str]) -> FileType:
    """The type of picture that a file's name asks for.

    Raises
    ------
    OutputError
        If its suffix is neither ``.png`` nor ``.exr``.
    """
    suffix = Path(path).suffix.lower()
    if suffix == ".png":
        return "png"
    if suffix == ".exr":
        return "exr"
    raise OutputError(f"{path}: pictures are written as .png or .exr; name such a file with -o")


def expose(pixels: ArrayLike, exposure: float) -> Picture:
    """Radiance times ``2**exposure`` (the exposure value, EV, in stops)."""
    with np.errstate(over="ignore"):  # writers refuse infinite values, or clip them
        return np.asarray(pixels, dtype=np.float32) * np.float32(2.0**exposure)


def encode_srgb(pixels: ArrayLike) -> NDArray[np.uint8]:
    """Linear Rec.709 values as 8-bit sRGB, clipped to 0 .. 1 and rounded.

    References
    ----------
    IEC 61966-2-1:1999, the sRGB transfer function.
    """
    linear = np.clip(np.asarray(pixels, dtype=np.float32), 0, 1)
    encoded = np.where(
        linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** np.float32(1 / 2.4) - 0.055
    )
    return np.floor(255 * encoded + 0.5).astype(np.uint8)


def write_picture(
    path: str | os.PathLike[str],
    pixels: Picture,
    precision: str = "auto",
    attributes: Mapping[str, Any] | None = None,
) -> str:
    """Write a picture as its name's suffix says, whole or not at all.

    Parameters
    ----------
    path : path-like
        ``.png`` or ``.exr``.
    pixels : ndarray, shape (H, W, 3)
        Linear, already exposed; EXR keeps what PNG clips.
    precision : {"auto", "half", "float"}
        Of an EXR.
    attributes : mapping, optional
        Of an EXR.

    Returns
    -------
    str
        The pixel type written: ``"8-bit sRGB"``, ``"half"`` or ``"float"``.

    Raises
    ------
    OutputError
        If the suffix is another, a value is not finite, or the file cannot be written.
    """
    if file_type(path) == "exr":
        return write_image(path, pixels, precision, attributes)
    if np.isnan(pixels).any():
        raise OutputError(f"{path}: a value is not a number; nothing was written")
    encoded = np.empty(pixels.shape, dtype=np.uint8)
    for start in range(0, len(pixels), _ROWS_AT_ONCE):
        band = slice(start, start + _ROWS_AT_ONCE)
        encoded[band] = encode_srgb(pixels[band])
    with replacing(path) as temporary:
        _write_png(temporary, encoded)
    return "8-bit sRGB"


def _write_png(path: Path, pixels: NDArray[np.uint8]) -> None:
    height, width, _ = pixels.shape
    spec = oiio.ImageSpec(width, height, 3, oiio.UINT8)
    spec.attribute("oiio:ColorSpace", "sRGB")
    path.touch()  # fails with the system's reason, which OpenImageIO does not tell
    target = oiio.ImageOutput.create("png")
    # write_image after a failed open would be a segmentation fault.
    if target is None or not target.open(str(path), spec):
        raise OSError(0, "OpenImageIO cannot write it")
    written = target.write_image(pixels) and target.close()
    # On a full disk both return True. Errors are only noted, and not even that where the last
    # block fails (closing the file writes it): then the end of the file is missing.
    if not written or target.has_error or not _ends_whole(path):
        raise OSError(0, "it was not written whole; is the disk full?")


def _ends_whole(path: Path) -> bool:
    with open(path, "rb") as stream:
        stream.seek(0, os.SEEK_END)
        stream.seek(max(stream.tell() - len(_PNG_END), 0))
        return stream.read() == _PNG_END
