"""What an OpenEXR file's headers claim, counted before any library reads them, and its end.

Libraries take minutes for a file of a hundred thousand attributes, and cannot be interrupted in
that time. This reads nothing but names and lengths, stops at a limit, and leaves damaged headers to
the libraries, which say what is wrong with them. Of files that were just written it tells whether
the end is missing, which the library does not, and of any files whether `shrm` has made them.

An attribute of the first header holds the SHA-256 digest of all other bytes of the file. A file
that was cut off, or overwritten in part, by a full disk or a broken copy, does not fit its digest
any more. Whether it does is told without decoding pixels, in the time that it takes to read it.

References: "OpenEXR File Layout", Academy Software Foundation.
"""

import hashlib
import mmap
import os
import struct
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Literal

from shrm_cli.vocabulary import MAX_ORDER_P, RECIPE_ATTRIBUTE

MAGIC = b"\x76\x2f\x31\x01"

_VERSION, _LONG_NAMES = 2, 0x400
"""What follows these bytes in a file without tiles, depths and parts."""
_NUMBERS = {b"int": "<i", b"float": "<f", b"chromaticities": "<8f", b"box2i": "<4i"}
_WINDOWS = b"dataWindow", b"displayWindow"
_CHANNEL_VALUES = struct.Struct("<iiii")
_FORMATS = {1: "half", 2: "float"}
_COLORS = ["R", "G", "B"], ["R", "G", "B", "A"]
MOST_ATTRIBUTES = 512
"""The most attributes of a part; files have about thirty."""
MOST_CHANNELS = 3 * (MAX_ORDER_P + 1) ** 2
"""The most channels of a part: those of an SHRM of the largest order."""
MOST_PARTS = 2**14
"""The most parts of a file: those of a light field of 128 x 128 views."""

_BEGIN = 2 * len(MAGIC)
"""Where the first header begins, behind the version and flags."""
_MULTI_PART = 0x1000
_MOST_NAME = 256
_BEGINNING = 64  # bytes of a value
_MOST_CUT = 2**16
"""The most bytes of a header that is cut off: what is longer may hold pixels, whatever it says."""
_CHANNEL = 16  # bytes of a channel behind its name
_ATTRIBUTES = frozenset(("shrm:representation", "shrm:table", "shrm:textures", "shrm:brdf_table"))
"""What maps, tables, textures for shaders and tables of BRDFs have."""
_OF_MAPS = frozenset(("shrm:brdf", "shrm:representation"))
"""What maps alone have; of a header that is cut off the first one is there sooner."""
_OF_PROBE = b'{"probe"'
"""How the recipe of a made probe begins."""
SEAL = "shrm:digest"
"""The name of the attribute."""
UNSEALED = "0" * 64
"""What it holds until the file is written whole."""
Condition = Literal["intact", "other", "damaged", "unknown"]
"""What `condition` finds of a file."""
_NO_END = bytes(64)
"""No file of compressed scan lines ends in so many zeros, which would have been compressed."""


_UNSOUND = IndexError, struct.error, ValueError
"""What reading raises of a header that is damaged, or of another format."""


@contextmanager
def _mapped(path: str | os.PathLike[str]) -> Iterator[mmap.mmap]:
    with open(path, "rb") as stream, mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as data:
        yield data


def why_too_much(path: str | os.PathLike[str]) -> str:
    """Return what a file has too many of to be read; empty for other files.

    `path` is a regular file of any format. Raises OSError if it cannot be read.
    """
    if Path(path).stat().st_size < len(MAGIC):
        return ""
    with _mapped(path) as data:
        return _excess(data) if data[: len(MAGIC)] == MAGIC else ""


def ends_whole(path: str | os.PathLike[str]) -> bool:
    """Return whether a file of scan lines has all its chunks, to the last byte of the last one."""
    with suppress(*_UNSOUND), _mapped(path) as data:
        return _end_of_chunks(data) == len(data)
    return False


def holds_nothing(path: str | os.PathLike[str]) -> bool:
    """Return whether a file has no byte but zeros, or ends within the headers of an OpenEXR file.

    Full disks and power cuts leave such files, of which no pixel can be had.

    `path` is a regular file of any format. Zeros at its end count for nothing. Of one that cannot
    be read nothing is known.
    """
    try:
        with open(path, "rb") as stream:
            begun = stream.read(_MOST_CUT).rstrip(b"\0")
            if any(block.strip(b"\0") for block in iter(lambda: stream.read(_MOST_CUT), b"")):
                return False
    except OSError:
        return False
    if len(begun) <= len(MAGIC):
        return MAGIC.startswith(begun)
    with suppress(*_UNSOUND):
        return begun[: len(MAGIC)] == MAGIC and _end_of_headers(begun) > len(begun)
    return True


def beginnings(path: str | os.PathLike[str]) -> dict[str, bytes]:
    """Return the attributes of a file's first header by name, as far as it is sound.

    It takes some 20 microseconds, whatever the size of the file.

    `path` is a file of any format; of another one than OpenEXR, or that cannot be read, there are
    none. Returns the first bytes of each value, `_BEGINNING` at most.
    """
    found: dict[str, bytes] = {}
    with suppress(OSError, *_UNSOUND), _mapped(path) as data:
        for name, _, begin, size in header_attributes(data):
            value = data[begin : begin + min(size, _BEGINNING)]
            found[name.decode("ascii", "replace")] = value
            if len(found) > MOST_ATTRIBUTES:
                break
    return found


def header_attributes(data: mmap.mmap) -> Iterator[tuple[bytes, bytes, int, int]]:
    """Name, type, place and size of each attribute of a file's first header.

    Raises IndexError, struct.error or ValueError if the header is damaged, or the file of another
    format.
    """
    if data[: len(MAGIC)] != MAGIC:
        raise ValueError("no OpenEXR file")
    yield from _attributes(data, _BEGIN)


def plain_header(path: str | os.PathLike[str]) -> tuple[dict[str, Any], dict[str, str]] | None:
    """Return the header of a file of one picture in scan lines, with red, green and blue.

    Returns its attributes by name, and the formats of its channels, ``half`` or ``float``, all of
    them the same, in the order R, G, B, A. None for files that are not as plain, or damaged.
    """
    with suppress(OSError, KeyError, *_UNSOUND), _mapped(path) as data:
        return _plain(data)
    return None


def _end_of_chunks(data: mmap.mmap) -> int:
    """Return the place behind the last chunk, or 0 where the tables of chunks have holes."""
    has_parts, at = _has_parts(data), _end_of_headers(data)
    # The tables of all parts follow each other, and behind them is the first chunk.
    (first,) = struct.unpack_from("<Q", data, at)
    table = struct.unpack_from(f"<{(first - at) // 8}Q", data, at)
    if 0 in table:
        return 0
    begin = max(table) + 4 * has_parts + 4  # the numbers of the part and of the line
    (size,) = struct.unpack_from("<i", data, begin)
    return int(begin + 4 + size)


def _end_of_headers(data: mmap.mmap | bytes) -> int:
    """Return the place behind the headers of all parts."""
    has_parts, at = _has_parts(data), _BEGIN
    while at == _BEGIN or (has_parts and data[at] != 0):
        for _, _, begin, size in _attributes(data, at):
            at = begin + size
        at += 1
    return at + has_parts


def _has_parts(data: mmap.mmap | bytes) -> bool:
    """Whether a file has several parts, with a zero behind the last one's header."""
    (flags,) = struct.unpack_from("<I", data, len(MAGIC))
    return bool(flags & _MULTI_PART)


def _excess(data: mmap.mmap) -> str:
    """Walk through the headers as far as they are sound."""
    at, parts = _BEGIN, 0
    try:
        while parts == 0 or (_has_parts(data) and data[at] != 0):
            channels = 0
            for count, (name, type_name, begin, size) in enumerate(_attributes(data, at), 1):
                at = begin + size
                # A list of channels takes as long to read under any name.
                if name == b"channels" or type_name == b"chlist":
                    channels += _count_channels(data, begin, at)
                if channels > MOST_CHANNELS:
                    return f"more than {MOST_CHANNELS:,} channels"
                if count > MOST_ATTRIBUTES:
                    return f"more than {MOST_ATTRIBUTES} attributes"
            at += 1
            parts += 1
            if parts > MOST_PARTS:
                return f"more than {MOST_PARTS:,} parts"
    except _UNSOUND:
        pass
    return ""


def _attributes(data: mmap.mmap | bytes, at: int) -> Iterator[tuple[bytes, bytes, int, int]]:
    """Name, type, place and size of each attribute of the header that begins at a place."""
    while data[at] != 0:
        name, at = _word(data, at)
        type_name, at = _word(data, at)
        (size,) = struct.unpack_from("<i", data, at)
        at += 4
        if not 0 <= size <= len(data) - at:
            raise ValueError("an attribute beyond the end")
        yield name, type_name, at, size
        at += size


def _word(data: mmap.mmap | bytes, at: int) -> tuple[bytes, int]:
    """The text that begins at a place, and the place behind the zero that ends it."""
    end = data.find(b"\0", at, at + _MOST_NAME)
    if end < 0:
        raise ValueError("no end of a name")
    return data[at:end], end + 1


def _count_channels(data: mmap.mmap, at: int, end: int) -> int:
    """Count the channels of a list, but hardly more than are allowed."""
    count = 0
    while at < end and data[at] != 0 and count <= MOST_CHANNELS:
        _, at = _word(data, at)
        at += _CHANNEL
        count += 1
    return count


def _plain(data: mmap.mmap) -> tuple[dict[str, Any], dict[str, str]]:
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
        if name in _WINDOWS and kind != b"box2i":
            raise ValueError("no window")
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
        kind, _, *sampling = _CHANNEL_VALUES.unpack_from(value, end + 1)
        if sampling != [1, 1]:
            raise ValueError("fewer pixels than others")
        yield value[at:end].decode(), _FORMATS[kind]
        at = end + 1 + _CHANNEL_VALUES.size


def is_output(path: str | os.PathLike[str]) -> bool:
    """Return whether a file is a map, a table or a picture that `shrm` made, and so no probe.

    Only its first header is read. Made probes, converted ones, and what is left of a probe without
    its lamps are probes. So is what cannot be read: its reader says what is wrong with it.
    """
    found = beginnings(path)
    is_picture = not found.get(RECIPE_ATTRIBUTE, _OF_PROBE).startswith(_OF_PROBE)
    return is_picture or not _ATTRIBUTES.isdisjoint(found)


def says_map(path: str | os.PathLike[str]) -> bool:
    """Return whether a file's first header says, as far as it goes, that the file is a map."""
    return not _OF_MAPS.isdisjoint(beginnings(path))


def seal(path: str | os.PathLike[str]) -> None:
    """Write the digest of a file into it, if its first header has a place for it."""
    with open(path, "r+b") as stream, mmap.mmap(stream.fileno(), 0) as data:
        place = _place(data)
        if place is not None:
            data[place : place + len(UNSEALED)] = _digest(data, place)


def condition(path: str | os.PathLike[str]) -> Condition:
    """Return in what condition a file is, by its digest.

    ``intact`` is a file as it was written. ``damaged`` is one whose end is missing or overwritten.
    ``other`` is one whose bytes differ otherwise: somebody has edited it, or it is damaged within.
    ``unknown`` is a file without a digest. Raises OSError if the file cannot be read.
    """
    if os.path.getsize(path) <= len(MAGIC):
        return "unknown"
    with _mapped(path) as data:
        place = _place(data)
        if place is None:
            return "unknown"
        if data[place : place + len(UNSEALED)] == _digest(data, place):
            return "intact"
        has_no_end = data[-len(_NO_END) :] == _NO_END
    return "damaged" if has_no_end or not ends_whole(path) else "other"


def _place(data: mmap.mmap) -> int | None:
    """Return where the digest lies, or None for a file without one."""
    with suppress(*_UNSOUND):
        for name, _, begin, size in header_attributes(data):
            if name == SEAL.encode() and size == len(UNSEALED):
                return begin
    return None


def _digest(data: mmap.mmap, place: int) -> bytes:
    """Return the digest of all bytes but those that hold it, in hexadecimal digits."""
    digest = hashlib.sha256()
    with memoryview(data) as view, view[:place] as before, view[place + len(UNSEALED) :] as behind:
        digest.update(before)
        digest.update(behind)
    return digest.hexdigest().encode()
