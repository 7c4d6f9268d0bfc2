"""OpenEXR files of one picture in scan lines, which most probes are, without OpenImageIO.

OpenEXR's own library writes all maps, so that it is loaded in any case. Loading OpenImageIO as well
takes a tenth of a short run. It reads what is not plain.
"""

import mmap
import struct
import threading
from collections.abc import Iterator
from contextlib import redirect_stdout, suppress
from io import StringIO
from pathlib import Path
from typing import Any, Self

from shrm_cli import settings
from shrm_cli.arrays import Array
from shrm_cli.files.exr_header import MAGIC, header_attributes

MOST_PIXELS = 2**22
"""The most pixels of a file that is decoded as a whole, to 50 or 67 MB."""
_VERSION, _LONG_NAMES = 2, 0x400
"""What follows the first bytes of a file without tiles, depths and parts."""
_NUMBERS = {b"int": "<i", b"float": "<f", b"chromaticities": "<8f", b"box2i": "<4i"}
_CHANNEL = struct.Struct("<iiii")
_FORMATS = {1: "half", 2: "float"}
_COLORS = ["R", "G", "B"], ["R", "G", "B", "A"]
_NAMES = {"PixelAspectRatio": "pixelAspectRatio"}
"""What OpenImageIO calls an attribute, and what OpenEXR does."""
_NOT_PLAIN = frozenset(("aperture", "envmap", "expTime", "isoSpeed", "multiView", "name", "view"))
"""Attributes that OpenImageIO makes others of."""
_lock = threading.Lock()
"""Held while what is printed goes elsewhere, for all threads."""


class PlainExr:
    """What is used of OpenImageIO's `ImageInput` and `ImageSpec`, of a file that is plain.

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
        with (
            suppress(OSError, ValueError, IndexError, KeyError, struct.error),
            open(path, "rb") as stream,
            mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as data,
        ):
            header, formats = _header(data)
            left, top, right, bottom = window = header["dataWindow"]
            is_whole = (left, top) == (0, 0) and window == header["displayWindow"]
            fits = min(right, bottom) >= 0 and (right + 1) * (bottom + 1) <= MOST_PIXELS
            if is_whole and fits and _NOT_PLAIN.isdisjoint(header):
                return cls(path, header, formats)
        return None

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
        pixels = self._decoded() if self._pixels is None else self._pixels
        self._pixels = pixels if end < self.height else None
        return None if pixels is None else pixels[begin:end, :, first:last]

    def _decoded(self) -> Array | None:
        """All pixels, shape (height, width, channels)."""
        import OpenEXR  # browsers have none

        threads = settings.current().threads or -1
        # What the library says of damaged files it prints.
        with _lock, redirect_stdout(StringIO()), suppress(RuntimeError, ValueError):
            planes = OpenEXR.File(str(self._path), num_threads=threads).channels()
            pixels = planes["".join(self.channelnames)].pixels if len(planes) == 1 else None
            if pixels is not None and pixels.shape == (self.height, self.width, self.nchannels):
                return pixels
        return None


def _header(data: mmap.mmap) -> tuple[dict[str, Any], dict[str, str]]:
    """A file's attributes, and the formats of its channels.

    Raises ValueError and other errors if it is no sound file of scan lines with colors.
    """
    (version,) = struct.unpack_from("<I", data, len(MAGIC))
    if version & ~_LONG_NAMES != _VERSION:
        raise ValueError("another version, tiles, depths or parts")
    header: dict[str, Any] = {}
    formats: dict[str, str] = {}
    for name, kind, begin, size in header_attributes(data):
        value: Any = data[begin : begin + size]
        if kind == b"string":
            value = value.decode()
        elif kind == b"chlist":
            formats = dict(_channels(value))
        elif kind in _NUMBERS:
            numbers = struct.unpack(_NUMBERS[kind], value)
            value = numbers if len(numbers) > 1 else numbers[0]
        header[name.decode()] = value
    for colors in _COLORS:
        if sorted(colors) == list(formats) and len(set(formats.values())) == 1:
            return header, {color: formats[color] for color in colors}
    raise ValueError("other channels, or of several formats")


def _channels(value: bytes) -> Iterator[tuple[str, str]]:
    """The names and formats of a list of channels; none are integers, or have fewer pixels."""
    at = 0
    while value[at] != 0:
        end = value.index(b"\0", at)
        kind, _, *sampling = _CHANNEL.unpack_from(value, end + 1)
        if sampling != [1, 1]:
            raise ValueError("fewer pixels than others")
        yield value[at:end].decode(), _FORMATS[kind]
        at = end + 1 + _CHANNEL.size
