"""What an OpenEXR file's headers claim, counted before any library reads them.

Libraries take minutes for a file of a hundred thousand attributes, and cannot be interrupted in
that time. This reads nothing but names and lengths, stops at a limit, and leaves damaged headers to
the libraries, which say what is wrong with them.

References
----------
"OpenEXR File Layout", Academy Software Foundation.
"""

import mmap
import os
import struct
from pathlib import Path

from shrm_cli.vocabulary import MAX_ORDER_P

MAGIC = b"\x76\x2f\x31\x01"

MOST_ATTRIBUTES = 512
"""The most attributes of a part; files have about thirty."""
MOST_CHANNELS = 3 * (MAX_ORDER_P + 1) ** 2
"""The most channels of a part: those of an SHRM of the largest order."""
MOST_PARTS = 2**14
"""The most parts of a file: those of a light field of 128 x 128 views."""

_MULTI_PART = 0x1000
_MOST_NAME = 256
_CHANNEL = 16  # bytes of a channel behind its name


def excess(path: str | os.PathLike[str]) -> str:
    """Return what a file has too many of to be read; empty for other files.

    Parameters
    ----------
    path : path-like
        A regular file of any format.

    Raises
    ------
    OSError
        If it cannot be read.
    """
    if Path(path).stat().st_size < len(MAGIC):
        return ""
    with open(path, "rb") as stream:
        if stream.read(len(MAGIC)) != MAGIC:
            return ""
        with mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as data:
            return _excess(data)


def _excess(data: mmap.mmap) -> str:
    """Walk through the headers as far as they are sound."""
    at, parts = 2 * len(MAGIC), 0
    try:
        (flags,) = struct.unpack_from("<I", data, len(MAGIC))
        while parts == 0 or (flags & _MULTI_PART and data[at] != 0):
            attributes = channels = 0
            while data[at] != 0:
                name, at = _word(data, at)
                type_name, at = _word(data, at)
                (size,) = struct.unpack_from("<i", data, at)
                at += 4
                if not 0 <= size <= len(data) - at:
                    return ""
                # A list of channels takes as long to read under any name.
                if name == b"channels" or type_name == b"chlist":
                    channels += _count_channels(data, at, at + size)
                if channels > MOST_CHANNELS:
                    return f"more than {MOST_CHANNELS:,} channels"
                at += size
                attributes += 1
                if attributes > MOST_ATTRIBUTES:
                    return f"more than {MOST_ATTRIBUTES} attributes"
            at += 1
            parts += 1
            if parts > MOST_PARTS:
                return f"more than {MOST_PARTS:,} parts"
    except (IndexError, struct.error, ValueError):
        pass
    return ""


def _word(data: mmap.mmap, at: int) -> tuple[bytes, int]:
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
