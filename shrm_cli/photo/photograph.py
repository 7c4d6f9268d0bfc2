"""Photographs, opened and read whole."""

import os
from dataclasses import replace

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.errors import ProbeError
from shrm_cli.probe.encoding import Encoding
from shrm_cli.probe.image_file import ImageFile

MOST_PIXELS = 2**26
"""The most pixels of a photograph: sums and weights of several take 1.6 GB."""


def open_photograph(
    path: str | os.PathLike[str], linearize: bool = False, as_stored: bool = False
) -> ImageFile:
    """Open a photograph.

    `linearize` tells whether to decode integers; they are refused otherwise. `as_stored` tells
    whether to leave all numbers as they are stored, integers as parts of the largest.

    Raises ProbeError if there is no such image, it is turned, or too large.
    """
    opened = ImageFile.open(path, linearize or as_stored)
    if opened.width * opened.height > MOST_PIXELS:
        raise ProbeError(
            f"{path}: {opened.width} x {opened.height} pixels are more than {MOST_PIXELS:,}; "
            "scale it down"
        )
    return replace(opened, encoding=Encoding()) if as_stored else opened


def pixels_of(opened: ImageFile) -> Array:
    """Return the pixels of a photograph, shape (H, W, 3).

    Raises ProbeError if one is not finite, or the file is damaged.
    """
    pixels = opened.read(0, opened.height)
    if not np.isfinite(pixels).all():
        raise ProbeError(f"{opened.path}: it holds numbers that are not finite; export it again")
    return pixels
