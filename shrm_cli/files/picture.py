"""Linear pictures written as files: 8-bit sRGB PNG to look at, scene-linear EXR to measure."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import slices
from shrm_cli.color import mix_channels, to_rec709
from shrm_cli.errors import OutputError
from shrm_cli.files.image import write_image
from shrm_cli.files.png import encode_srgb, write_png
from shrm_cli.vocabulary import Precision

Picture = NDArray[np.float32]
FileType = Literal["png", "exr"]

_SEEN = -0.5 / 255 / 12.92
"""What lies below it would be less than black by half a step of 8-bit sRGB."""
_ROWS_AT_ONCE = 256
"""Rows of a picture that are encoded as sRGB at a time."""


def file_type(path: str | os.PathLike[str]) -> FileType:
    """Return the type of picture that the suffix of a file's name asks for."""
    suffix = Path(path).suffix.lower()
    if suffix == ".png":
        return "png"
    if suffix == ".exr":
        return "exr"
    raise OutputError(f"{path}: pictures are written as .png or .exr; name such a file")


def write_picture(
    path: str | os.PathLike[str],
    pixels: Picture,
    precision: Precision = "auto",
    attributes: Mapping[str, Any] | None = None,
) -> str:
    """Write a picture, whole or not at all, as the type that its name's suffix asks for.

    `path` is ``.png`` or ``.exr``. `pixels`, of shape (H, W, 3), are linear and already exposed.
    PNG clips the values to 0 .. 1; EXR keeps them. `precision` is the pixel type of an EXR; a PNG
    ignores it. `attributes` are attributes of an EXR. A PNG, which is Rec.709, is converted from
    their ``chromaticities``; what lies outside its colors is clipped.

    Returns the pixel type written: ``"8-bit sRGB"``, ``"half"`` or ``"float"``. Of a PNG it says
    how much of a converted picture was clipped.
    """
    if file_type(path) == "exr":
        return write_image(path, pixels, precision, attributes)
    encoded, share = in_srgb(path, pixels, (attributes or {}).get("chromaticities"))
    write_png(path, encoded)
    return "8-bit sRGB" + (f" ({share:.1%} of it outside its colors)" if share >= 1e-3 else "")


def in_srgb(
    path: str | os.PathLike[str], pixels: Picture, primaries: Any = None
) -> tuple[NDArray[np.uint8], float]:
    """Return a linear picture as 8-bit sRGB, and the share of it that was outside its colors.

    `path` is the file that it is for, for the message. `pixels`, of shape (H, W, 3), are linear and
    already exposed. `primaries` are its chromaticities; None is Rec.709.
    """
    if np.isnan(pixels).any():
        raise OutputError(
            f"{path}: a value is not a number, as where a map holds values too large for 32-bit "
            "floats; nothing was written"
        )
    matrix = to_rec709(primaries)
    outside = 0
    encoded = np.empty(pixels.shape, dtype=np.uint8)
    for band in slices(len(pixels), _ROWS_AT_ONCE):
        shown = pixels[band]
        if matrix is not None:
            shown = mix_channels(shown, matrix)
            outside += int(np.count_nonzero(shown.min(axis=-1) < _SEEN))
        encoded[band] = encode_srgb(shown)
    return encoded, outside * 3 / pixels.size if pixels.size else 0.0
