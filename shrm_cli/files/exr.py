"""The OpenEXR container: files of one or more parts, which are written whole or not at all.

OpenEXR's own library writes them, and reads plain pictures; OpenImageIO reads all others.
"""

import os
import re
import threading
from collections.abc import Iterator, Sequence
from contextlib import redirect_stdout, suppress
from functools import cached_property
from io import StringIO
from typing import Any

import numpy as np
import OpenEXR

from shrm_cli import settings
from shrm_cli.arrays import Array
from shrm_cli.errors import MapError
from shrm_cli.files.exr_header import SEAL, UNSEALED, ends_whole, seal, why_too_much
from shrm_cli.files.openimageio import oiio, quiet
from shrm_cli.files.parts import LARGE, Part, StoredFile, StoredPart
from shrm_cli.files.whole import cut_off_error, replacing
from shrm_cli.progress import in_order

_printing = threading.Lock()
"""Held while what is printed goes elsewhere, for all threads."""
_ENVMAPS = {"openexr": OpenEXR.ENVMAP_CUBE, "latlong": OpenEXR.ENVMAP_LATLONG}


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
