"""RGB images as files: how they are written, and the attributes of a probe's file."""

import os
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.files.parts import Part, choose_storage, write_parts
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
    all images have the same shape. `precision` and `attributes` are as in `write_image`.
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
    ``latlong``, is layout of a border-sampled image. A file without this attribute is sampled at
    pixel centres.
    """
    attributes: dict[str, Any] = {}
    if chromaticities is not None:
        attributes["chromaticities"] = tuple(chromaticities)
    if envmap is not None:
        attributes["envmap"] = envmap
    return attributes


def without_negative(
    path: str | os.PathLike[str], images: Sequence[Array]
) -> tuple[list[Array], list[str]]:
    """Set negative values to 0, which programs that read plain images do not expect.

    `path` is the name of the file that they are for, for the warning. `images` are each of shape
    (H, W, 3).

    Returns `images`; and `warnings`, one, with the number of pixels and the least value, where
    there were any.
    """
    below = sum(int(np.count_nonzero((image < 0).any(axis=-1))) for image in images)
    if not below:
        return list(images), []
    total = sum(image.shape[0] * image.shape[1] for image in images)
    least = min(float(image.min()) for image in images)
    line = (
        f"{os.fspath(path)}: {below:,} of {total:,} pixels were negative (least {least:.3g}) and "
        "are 0 now; more orders, or `to` principal, leave fewer"
    )
    return [np.maximum(image, 0) for image in images], [line]
