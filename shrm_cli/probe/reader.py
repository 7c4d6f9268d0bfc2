"""Image files that are open for reading, of which a process has only so many at once.

A data set has thousands of probes, and a process may have a few hundred files open. The file that
was read longest ago is closed for one more, and opened again when it is read.
"""

import os
import threading
from pathlib import Path
from typing import Any, Self
from weakref import WeakValueDictionary

from shrm_cli.arrays import Array
from shrm_cli.errors import ProbeError
from shrm_cli.files.exr_header import plain_header, why_too_much
from shrm_cli.files.openimageio import caught, oiio
from shrm_cli.files.whole import check_regular, fault_of_name, note
from shrm_cli.messages import is_url, shown

_MOST_OPEN = 64
_open: "WeakValueDictionary[int, Reader]" = WeakValueDictionary()
"""The readers of open files that are still in use, by their identity; the one that was read last
comes last."""
_lock = threading.Lock()
MOST_PIXELS = 2**22
"""The most pixels of a plain file, which is decoded as a whole, to 50 or 67 MB."""
_NAMES = {"PixelAspectRatio": "pixelAspectRatio"}
"""What OpenImageIO calls an attribute, and what OpenEXR does."""
_NOT_PLAIN = frozenset(("aperture", "envmap", "expTime", "isoSpeed", "multiView", "name", "view"))
"""Attributes that OpenImageIO makes others of."""


class PlainExr:
    """An OpenEXR file of one picture in scan lines, as most probes are, read without OpenImageIO.

    It has what is used of the library's `ImageInput` and `ImageSpec`. OpenEXR's own library writes
    all maps, so that it is loaded in any case; to load OpenImageIO as well takes a tenth of a short
    run.

    The pixels are kept from when some are asked for until the last row has been.
    """

    x = y = z = full_x = full_y = tile_width = tile_height = 0
    deep = False

    def __init__(self, path: Path, header: dict[str, Any], formats: dict[str, str]) -> None:
        self._path, self._header, self._formats = path, header, list(formats.values())
        self._pixels: Array | None = None
        self.channelnames = list(formats)
        self.width, self.height = (last + 1 for last in header["dataWindow"][2:])
        self.full_width, self.full_height = self.width, self.height

    @classmethod
    def open(cls, path: Path) -> Self | None:
        """Read a file's header; None where it is not plain, or damaged."""
        header, formats = plain_header(path) or ({}, {})
        left, top, right, bottom = window = header.get("dataWindow", (0, 0, -1, -1))
        is_whole = (left, top) == (0, 0) and window == header.get("displayWindow")
        fits = min(right, bottom) >= 0 and (right + 1) * (bottom + 1) <= MOST_PIXELS
        is_plain = is_whole and fits and _NOT_PLAIN.isdisjoint(header)
        return cls(path, header, formats) if is_plain else None

    def format_name(self) -> str:
        return "openexr"

    def spec(self) -> Self:
        return self

    def current_subimage(self) -> int:
        return 0

    def seek_subimage(self, index: int, level: int) -> bool:
        return (index, level) == (0, 0)

    def geterror(self) -> str:
        return ""

    def channelformat(self, channel: int) -> str:
        return self._formats[channel]

    @property
    def nchannels(self) -> int:
        return len(self._formats)

    def getattribute(self, name: str) -> Any:
        return self._header.get(_NAMES.get(name, name))

    def get_string_attribute(self, name: str, default: str = "") -> str:
        value = self.getattribute(name)
        return value if isinstance(value, str) else default

    def get_int_attribute(self, name: str, default: int = 0) -> int:
        value = self.getattribute(name)
        return value if isinstance(value, int) else default

    def get_float_attribute(self, name: str, default: float = 0.0) -> float:
        value = self.getattribute(name)
        return float(value) if isinstance(value, int | float) else default

    def to_xml(self) -> str:
        """All that tells this header from others."""
        return repr((self._header, self._formats))

    @property
    def is_decoded(self) -> bool:
        """Whether pixels are at hand; otherwise the file has to be there still."""
        return self._pixels is not None

    def read_scanlines(
        self, part: int, level: int, begin: int, end: int, z: int, first: int, last: int, _: str
    ) -> Array | None:
        """Return rows `begin` .. `end` - 1 of some channels; None where the file is damaged."""
        pixels = self._pixels
        if pixels is None:
            from shrm_cli.files.exr import decoded  # browsers have no OpenEXR

            pixels = decoded(self._path, self.channelnames)
        if pixels is None or pixels.shape != (self.height, self.width, self.nchannels):
            return None
        self._pixels = pixels if end < self.height else None
        return pixels[begin:end, :, first:last]


class Reader:
    """OpenImageIO's reader of one image of a file."""

    def __init__(self, path: Path, source: Any) -> None:
        """Take a reader of OpenImageIO that stands at the image that is to be read."""
        self._path, self._index = path.absolute(), source.current_subimage()
        self.spec = source.spec()
        self._source: Any = source
        self._use()

    def __getstate__(self) -> dict[str, Any]:
        return {"path": self._path, "index": self._index}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self._path, self._index = state["path"], state["index"]
        self._source = self._opened()
        self.spec = self._source.spec()
        self._use()

    @property
    def source(self) -> Any:
        """OpenImageIO's reader, which is open.

        Raises ProbeError if the file was closed, and is no more what it was.
        """
        source = self._source
        if source is None or (isinstance(source, PlainExr) and not source.is_decoded):
            source = self._opened()
            if source.spec().to_xml() != self.spec.to_xml():
                raise self._changed()
            self._source = source
        self._use()
        return source

    def _opened(self) -> Any:
        source = open_input(check_file(self._path))
        if source is None or not source.seek_subimage(self._index, 0):
            raise self._changed()
        return source

    def _changed(self) -> ProbeError:
        return ProbeError(f"{self._path}: not the image that it was; open it again")

    def _use(self) -> None:
        """Let this file stay open longer than others. Threads that read one still have it."""
        with _lock:
            _open.pop(id(self), None)
            _open[id(self)] = self
            while len(_open) > _MOST_OPEN:
                oldest = next(iter(_open.values()))
                del _open[id(oldest)]
                oldest._source = None


def check_file(name: str | os.PathLike[str]) -> Path:
    """The path of a file, without what would block, mislead, or make noise when it is opened."""
    if not os.fspath(name):
        raise ProbeError("the name of a probe is empty; name an image file")
    path = Path(name)
    try:
        str(path).encode()  # image libraries take no other names
    except UnicodeEncodeError:
        raise ProbeError(f"{path}: {fault_of_name(path)}, or rename it") from None
    if is_url(path) and not path.exists():
        raise ProbeError(
            f"{shown(os.fspath(name))}: no such file; shrm batch reads URLs; else fetch it"
        )
    status = check_regular(path, ProbeError, "an image file", "check its name")
    if not os.access(path, os.R_OK):
        raise ProbeError(f"{path}: no permission to read it; change its mode")
    if status.st_size == 0:
        raise ProbeError(f"{path}: the file is empty; copy or export it again")
    if much := why_too_much(path):
        raise ProbeError(f"{path}: {much}, which is too much; export it again")
    note(path)
    return path


def open_input(path: Path) -> Any:
    """Return a reader of a file as OpenImageIO has them; None where there is none."""
    if path.suffix.lower() == ".exr" and (plain := PlainExr.open(path)) is not None:
        return plain
    hints = oiio.ImageSpec()  # what it leaves as it is, or turns upright
    hints.attribute("oiio:UnassociatedAlpha", 1)  # or color comes multiplied by alpha
    hints.attribute("pnm:pfmflip", 1)  # PFM stores its bottom row first
    with caught():
        return oiio.ImageInput.open(str(path), hints)
