"""The OpenEXR container: files of one or more parts, which are written whole or not at all.

OpenEXR's own library writes them, and reads plain pictures; OpenImageIO reads all others. It also
writes mip-mapped files, one image in halving sizes as texture systems read it, because OpenEXR's
bindings write one level only.
"""

import os
import re
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import redirect_stdout, suppress
from functools import cached_property
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR

from shrm_cli import settings
from shrm_cli.arrays import Array
from shrm_cli.errors import MapError
from shrm_cli.files.exr_header import SEAL, UNSEALED, ends_whole, seal, why_too_much
from shrm_cli.files.openimageio import oiio, quiet
from shrm_cli.files.parts import LARGE, Part, StoredFile, StoredPart, choose_storage
from shrm_cli.files.whole import cut_off_error, replacing
from shrm_cli.progress import in_order
from shrm_cli.vocabulary import PixelType, Precision

_printing = threading.Lock()
"""Held while what is printed goes elsewhere, for all threads."""
_ENVMAPS = {"openexr": OpenEXR.ENVMAP_CUBE, "latlong": OpenEXR.ENVMAP_LATLONG}
_TILE = 64
"""Texels along a side of a tile of a mip-mapped file."""


def write(path: str | os.PathLike[str], parts: Sequence[Part], pixel_type: str) -> None:
    """Write an OpenEXR file, whole or not at all; see `files.parts.write_parts`.

    It has a digest of itself, see `files.exr_header.seal`.
    """
    dtype = np.float32 if pixel_type == "float" else np.float16

    def contiguous(plane: Array) -> Array:
        # OpenEXR ignores strides.
        return np.ascontiguousarray(plane, dtype)

    stored: list[Any] = []
    shapes = [plane.shape for part in parts for plane in part.channels.values()]
    height, width = (max(lengths) for lengths in zip(*shapes, strict=True))
    # Parts of different sizes have to share a canvas.
    canvas = np.array([0, 0], np.int32), np.array([width - 1, height - 1], np.int32)
    for part in parts:
        planes = list(part.channels.values())
        is_large = sum(plane.size for plane in planes) > LARGE
        packed = in_order(contiguous, planes, is_large)
        header = _header(part) | {"displayWindow": canvas} | ({} if stored else {SEAL: UNSEALED})
        stored.append(OpenEXR.Part(header, dict(zip(part.channels, packed, strict=True))))
    with replacing(path) as temporary:
        try:
            with OpenEXR.File(stored, num_threads=settings.current().threads or -1) as file:
                file.write(str(temporary))
        except RuntimeError as error:  # its message ends with the system's reason
            raise OSError(0, str(error).rpartition('". ')[2].rstrip(".")) from error
        # OpenEXR tells nobody if its last write fails, which closing the file is.
        if not ends_whole(temporary):
            raise cut_off_error()
        seal(temporary)


def _header(part: Part) -> dict[str, Any]:
    """Return the attributes of a part in the form that OpenEXR's library takes."""
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, **part.header}
    if "envmap" in header:
        header["envmap"] = _ENVMAPS[header["envmap"]]
    return header


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
        _write_levels(temporary, levels, pixel_type, attributes or {})
        _check_levels(temporary, levels)
    return pixel_type


def _write_levels(
    path: Path, levels: Sequence[Array], pixel_type: PixelType, attributes: Mapping[str, Any]
) -> None:
    target = oiio.ImageOutput.create("exr")
    if target is None:
        raise OSError(0, oiio.geterror() or "OpenImageIO cannot write it")
    for index, level in enumerate(levels):
        spec = _level_spec(level, pixel_type, attributes)
        # Calling write_image after a failed open would be a segmentation fault.
        if not target.open(str(path), spec, "AppendMIPLevel" if index else "Create"):
            raise OSError(0, target.geterror() or "OpenImageIO cannot write it")
        if not target.write_image(np.ascontiguousarray(level, dtype=np.float32)):
            raise OSError(0, target.geterror() or "it was not written whole")
    if not target.close() or target.has_error:
        raise cut_off_error()


def _level_spec(level: Array, pixel_type: PixelType, attributes: Mapping[str, Any]) -> Any:
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


def _check_levels(path: Path, levels: Sequence[Array]) -> None:
    """Raise an error unless all levels are there; on a full disk writing reports none."""
    source = oiio.ImageInput.open(str(path))
    for index, level in enumerate(levels):
        pixels = None
        if source is not None and source.seek_subimage(0, index):
            pixels = source.read_image(0, index, 0, 3, oiio.FLOAT)
        if pixels is None or pixels.shape != level.shape:
            oiio.geterror()
            raise cut_off_error()


def decoded(path: str | os.PathLike[str], names: Sequence[str]) -> Array | None:
    """Return the pixels of a file of one picture, (height, width, channels); None if it is damaged.

    `names` are those of its channels: red, green and blue, and opacity, of one format.
    """
    # What the library says of damaged files it prints.
    with _printing, redirect_stdout(StringIO()), suppress(RuntimeError, ValueError):
        threads = settings.current().threads or -1
        channels = OpenEXR.File(os.fspath(path), num_threads=threads).channels()
        if list(channels) == ["".join(names)]:
            return np.asarray(channels["".join(names)].pixels)
    return None


def open_file(path: str | os.PathLike[str]) -> "ExrFile | None":
    """Open an OpenEXR file; return None if it is missing, damaged or of another format."""
    if much := why_too_much(path):
        raise MapError(f"{os.fspath(path)}: {much}, which is too much; export it again")
    source = _open_image(path)
    if source is None or source.format_name() != "openexr":
        return None
    return ExrFile(os.fspath(path), source)


@quiet
def _open_image(path: str | os.PathLike[str]) -> Any:
    """Open an image of any format; return None where that fails.

    The library's error is fetched, because otherwise it would be printed when the process ends.
    """
    try:
        source = oiio.ImageInput.open(os.fspath(path))
    except TypeError:  # the name is not UTF-8
        return None
    with suppress(UnicodeDecodeError):
        oiio.geterror()
    return source


class ExrFile(StoredFile):
    """An opened OpenEXR file."""

    def __init__(self, path: str, source: Any) -> None:
        self.path = path
        self._source = source
        self.first = ExrPart(path, source, 0, source.spec())
        self.part_count = max(source.spec().get_int_attribute("oiio:subimages"), 1)

    @cached_property
    def parts(self) -> tuple[StoredPart, ...]:
        return tuple(self._part_by_part())

    def _part_by_part(self) -> Iterator[StoredPart]:
        index = 0
        while self._source.seek_subimage(index, 0):
            yield ExrPart(self.path, self._source, index, self._source.spec())
            index += 1
        with suppress(UnicodeDecodeError):
            self._source.geterror()


class ExrPart(StoredPart):
    """One part of an opened OpenEXR file."""

    def __init__(self, path: str, source: Any, index: int, spec: Any) -> None:
        self.path = path
        # The name may hold bytes that cannot be printed.
        self.name = re.sub(r"[^ -~]", "?", spec.get_string_attribute("oiio:subimagename"))
        self.width, self.height = spec.width, spec.height
        self.channel_names = tuple(spec.channelnames)
        self.border_sampled = bool(spec.get_int_attribute("oiio:sampleborder"))
        self._source, self._index, self._spec = source, index, spec

    def attribute(self, name: str) -> Any:
        value = self._spec.getattribute(name)
        # The bytes of a type that nobody knows come as an array, whose comparisons are no truth.
        return tuple(value.tolist()) if isinstance(value, np.ndarray) else value

    def holds(self, names: Sequence[str]) -> bool:
        spec = self._spec
        numbers = {str(spec.channelformat(k)) for k in range(spec.nchannels)}
        is_flat = not spec.deep and numbers <= {"half", "float"}
        return is_flat and sorted(self.channel_names) == sorted(names)

    @quiet
    def read(self, names: Sequence[str]) -> Array:
        self._source.seek_subimage(self._index, 0)
        pixels = self._source.read_image(self._index, 0, 0, len(self.channel_names), "float")
        if pixels is None:
            with suppress(UnicodeDecodeError):
                self._source.geterror()
            raise MapError(f"{self.path}: damaged or truncated; make it again with shrm prefilter")
        if not np.isfinite(pixels).all():
            raise MapError(f"{self.path}: holds NaN or infinite coefficients; make it again")
        return np.asarray(pixels)[..., [self.channel_names.index(name) for name in names]]
