"""RGB images as files: how they are written, and the attributes of a probe's file."""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array, over_channels, slices
from shrm_cli.color import mix_channels, to_rec709
from shrm_cli.errors import OutputError
from shrm_cli.files.parts import Part, choose_storage, write_parts
from shrm_cli.files.png import encode_srgb, write_png
from shrm_cli.files.whole import together
from shrm_cli.vocabulary import PixelType, Precision


def write_image(
    path: str | os.PathLike[str],
    pixels: Array,
    precision: Precision = "auto",
    attributes: Mapping[str, Any] | None = None,
) -> PixelType:
    """Write an RGB image, whole or not at all, and return the pixel type.

    `pixels`, of shape (H, W, 3), are scene-linear values. The `precision` ``auto`` is half unless a
    value exceeds its range. `attributes` are attributes of the file by name.
    """
    channels = {c: pixels[..., k] for k, c in enumerate("RGB")}
    return write_parts(path, [Part(channels, dict(attributes or {}))], precision)


def write_images(
    paths: Sequence[str],
    images: Sequence[Array],
    precision: Precision = "auto",
    attributes: Mapping[str, Any] | None = None,
) -> PixelType:
    """Write images of the same pixel type, which is returned, or none of them.

    `paths` are the file of each image. `images`, each of shape (H, W, 3), are scene-linear values;
    all images have the same shape.
    """
    chosen = choose_storage(paths[0], images, precision).pixel_type
    with together():
        for path, image in zip(paths, images, strict=True):
            write_image(path, image, chosen, attributes)
    return chosen


def probe_attributes(
    chromaticities: tuple[float, ...] | None, envmap: str | None = None
) -> dict[str, Any]:
    """Return the attributes of a probe's file.

    `chromaticities` are CIE x and y of red, green, blue and white. `envmap`, one of ``openexr``,
    ``latlong``, is the layout of a border-sampled image. A file without this attribute is sampled
    at pixel centres.
    """
    attributes: dict[str, Any] = {}
    if chromaticities is not None:
        attributes["chromaticities"] = tuple(chromaticities)
    if envmap is not None:
        attributes["envmap"] = envmap
    return attributes


def without_negative(
    path: str | os.PathLike[str], images: Sequence[Array], cure: str
) -> tuple[list[Array], list[str]]:
    """Set negative values to 0, which programs that read plain images do not expect.

    `images` are each of shape (H, W, 3). `cure` is what leaves fewer in maps that are made anew.

    Returns `images`; and `warnings`, one, with the number of pixels and the least value, where
    there were any.
    """
    below = sum(int(np.count_nonzero(over_channels(np.logical_or, image < 0))) for image in images)
    if not below:
        return list(images), []
    total = sum(image.shape[0] * image.shape[1] for image in images)
    least = min(float(image.min()) for image in images)
    line = (
        f"{os.fspath(path)}: {below:,} of {total:,} pixels were negative (least {least:.3g}), "
        f"mostly beside lamps, and are 0 now; for fewer make the map anew and {cure}"
    )
    return [np.maximum(image, 0) for image in images], [line]


# ---- pictures: 8-bit sRGB PNG to look at, scene-linear EXR to measure ----------------------------


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

    `pixels`, of shape (H, W, 3), are linear and already exposed. `primaries` are its
    chromaticities; None is Rec.709.
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
            outside += int(np.count_nonzero(over_channels(np.minimum, shown) < _SEEN))
        encoded[band] = encode_srgb(shown)
    return encoded, outside * 3 / pixels.size if pixels.size else 0.0
