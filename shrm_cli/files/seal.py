"""A digest of a file within the file, by which damage is noticed that no library looks for.

An attribute of the first header holds the SHA-256 digest of all other bytes of the file. A file
that was cut off, or overwritten in part, by a full disk or a broken copy, does not fit its digest
any more. Whether it does is told without decoding pixels, in the time that it takes to read it.
"""

import hashlib
import mmap
import os
import struct
from typing import Literal

from shrm_cli.files.exr_header import MAGIC, ends_whole, header_attributes

SEAL = "shrm:digest"
"""The name of the attribute."""
UNSEALED = "0" * 64
"""What it holds until the file is written whole."""

Condition = Literal["intact", "other", "damaged", "unknown"]
"""What `condition` finds of a file."""
_NO_END = bytes(64)
"""No file of compressed scan lines ends in so many zeros, which would have been compressed."""


def seal(path: str | os.PathLike[str]) -> None:
    """Write the digest of a file into it, if its first header has a place for it.

    Parameters
    ----------
    path : path-like
        An OpenEXR file that was just written.
    """
    with open(path, "r+b") as stream, mmap.mmap(stream.fileno(), 0) as data:
        place = _place(data)
        if place is not None:
            data[place : place + len(UNSEALED)] = _digest(data, place)


def condition(path: str | os.PathLike[str]) -> Condition:
    """Return in what condition a file is, by its digest.

    Returns
    -------
    {"intact", "other", "damaged", "unknown"}
        ``intact`` is a file as it was written. ``damaged`` is one whose end is missing or
        overwritten. ``other`` is one whose bytes differ otherwise: somebody has edited it, or it
        is damaged within. ``unknown`` is a file without a digest.

    Raises
    ------
    OSError
        If the file cannot be read.
    """
    if os.path.getsize(path) <= len(MAGIC):
        return "unknown"
    with (
        open(path, "rb") as stream,
        mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as data,
    ):
        place = _place(data)
        if place is None:
            return "unknown"
        if data[place : place + len(UNSEALED)] == _digest(data, place):
            return "intact"
        has_no_end = data[-len(_NO_END) :] == _NO_END
    return "damaged" if has_no_end or not ends_whole(path) else "other"


def _place(data: mmap.mmap) -> int | None:
    """Return where the digest lies, or None for a file without one."""
    try:
        for name, _, begin, size in header_attributes(data):
            if name == SEAL.encode() and size == len(UNSEALED):
                return begin
    except (IndexError, struct.error, ValueError):
        pass
    return None


def _digest(data: mmap.mmap, place: int) -> bytes:
    """Return the digest of all bytes but those that hold it, in hexadecimal digits."""
    digest = hashlib.sha256()
    with memoryview(data) as view, view[:place] as before, view[place + len(UNSEALED) :] as behind:
        digest.update(before)
        digest.update(behind)
    return digest.hexdigest().encode()
