"""Plain RGB pictures."""

import os
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import OpenEXR
from numpy.typing import NDArray

from shrm_cli.files.exr import Part, choose_precision, write_parts

Array = NDArray[np.floating]


def write_image(
    path: str | os.PathLike[str],
    pixels: Array,
    precision: str = "auto",
    attributes: Mapping[str, Any] | None = None,
) -> str:
    """Write an RGB image, whole or not at all.

    Parameters
    ----------
    path : path-like
    pixels : ndarray, shape (H, W, 3)
        Scene-linear.
    precision : {"auto", "half", "float"}
    attributes : mapping, optional

    Returns
    -------
    str
        ``"half"`` or ``"float"``, as written.

    Raises
    ------
    OutputError
        If half would overflow, or the file cannot be written.
    """
    channels = {c: pixels[..., k] for k, c in enumerate("RGB")}
    return write_parts(path, [Part(channels, dict(attributes or {}))], precision)


def write_images(
    paths: Sequence[str],
    images: Sequence[Array],
    precision: str = "auto",
    attributes: Mapping[str, Any] | None = None,
) -> str:
    """Write images that belong together, of one pixel type; the rest as `write_image`."""
    together = np.stack(images)
    chosen = choose_precision(paths[0], [together], precision)
    for path, image in zip(paths, together, strict=True):
        write_image(path, image, chosen, attributes)
    return chosen


def probe_attributes(
    chromaticities: tuple[float, ...] | None, envmap: str | None = None
) -> dict[str, Any]:
    """Attributes of a probe's file.

    Parameters
    ----------
    chromaticities : tuple of 8 float, optional
    envmap : {"openexr", "latlong"}, optional
        Layout of a border-sampled image; files without it are sampled at pixel centres.
    """
    attributes: dict[str, Any] = {}
    if chromaticities is not None:
        attributes["chromaticities"] = tuple(chromaticities)
    return attributes if envmap is None else {**attributes, **envmap_attribute(envmap)}


def envmap_attribute(layout: str) -> dict[str, Any]:
    """OpenEXR's own attribute of a border-sampled image of layout ``openexr`` or ``latlong``."""
    is_cube = layout == "openexr"
    return {"envmap": OpenEXR.ENVMAP_CUBE if is_cube else OpenEXR.ENVMAP_LATLONG}
