"""Linear pictures -> files: 8-bit sRGB PNG to look at, or scene-linear EXR to measure."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from shrm_cli.errors import OutputError
from shrm_cli.files.image import write_image
from shrm_cli.files.png import encode_srgb, write_png

Picture = NDArray[np.float32]
FileType = Literal["png", "exr"]

_ROWS_AT_ONCE = 256


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
    write_png(path, encoded)
    return "8-bit sRGB"
