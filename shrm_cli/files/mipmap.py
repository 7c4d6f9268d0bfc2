"""Mip-mapped OpenEXR files: one image in halving sizes, as texture systems read it.

OpenImageIO writes them, because OpenEXR's own bindings write one level only.
"""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.files.openimageio import oiio
from shrm_cli.files.parts import choose_storage
from shrm_cli.files.whole import cut_off_error, replacing
from shrm_cli.vocabulary import PixelType, Precision

_TILE = 64


def write_mipmap(
    path: str | os.PathLike[str],
    levels: Sequence[Array],
    precision: Precision = "auto",
    attributes: Mapping[str, Any] | None = None,
) -> PixelType:
    """Write a tiled, mip-mapped RGB image with ZIP compression, whole; return the pixel type.

    `levels`, each of shape (H_k, W_k, 3), are all levels down to one pixel; each is half as wide
    and as high as the one before, rounded down, and at least 1. `attributes` are texts, numbers and
    ``chromaticities`` by name. ``envmap`` of ``latlong`` marks a border-sampled lat-long, as
    texture systems want it.
    """
    pixel_type = choose_storage(path, levels, precision).pixel_type
    with replacing(path) as temporary:
        temporary.touch()  # raises the system's error, which OpenImageIO would not report
        _write(temporary, levels, pixel_type, attributes or {})
        _check(temporary, levels)
    return pixel_type


def _write(
    path: Path, levels: Sequence[Array], pixel_type: PixelType, attributes: Mapping[str, Any]
) -> None:
    target = oiio.ImageOutput.create("exr")
    if target is None:
        raise OSError(0, oiio.geterror() or "OpenImageIO cannot write it")
    for index, level in enumerate(levels):
        spec = _spec(level, pixel_type, attributes)
        # Calling write_image after a failed open would be a segmentation fault.
        if not target.open(str(path), spec, "AppendMIPLevel" if index else "Create"):
            raise OSError(0, target.geterror() or "OpenImageIO cannot write it")
        if not target.write_image(np.ascontiguousarray(level, dtype=np.float32)):
            raise OSError(0, target.geterror() or "it was not written whole")
    if not target.close() or target.has_error:
        raise cut_off_error()


def _spec(level: Array, pixel_type: PixelType, attributes: Mapping[str, Any]) -> Any:
    height, width, _ = level.shape
    spec = oiio.ImageSpec(width, height, 3, oiio.TypeDesc(pixel_type))
    spec.tile_width = spec.tile_height = _TILE
    spec.attribute("compression", "zip")
    spec.attribute("DateTime", "")  # the same inputs give the same bytes
    # This is how OpenImageIO is told to write levels, and the attribute `envmap`.
    is_marked = attributes.get("envmap") == "latlong"
    spec.attribute("textureformat", "LatLong Environment" if is_marked else "Plain Texture")
    for name, value in attributes.items():
        if name == "chromaticities":
            spec.attribute(name, oiio.TypeDesc("float[8]"), tuple(value))
        elif name != "envmap":
            spec.attribute(name, value)
    return spec


def _check(path: Path, levels: Sequence[Array]) -> None:
    """Raise an error unless all levels are there; on a full disk writing reports none."""
    source = oiio.ImageInput.open(str(path))
    for index, level in enumerate(levels):
        pixels = None
        if source is not None and source.seek_subimage(0, index):
            pixels = source.read_image(0, index, 0, 3, oiio.FLOAT)
        if pixels is None or pixels.shape != level.shape:
            oiio.geterror()
            raise cut_off_error()
