"""The headers of an OpenEXR file as lists of attributes that can be edited and put back.

This is written from the description of the format, without the package and without a library.
"""

import struct
from dataclasses import dataclass

_MAGIC = b"\x76\x2f\x31\x01"
_MULTI_PART = 0x1000  # a flag in the second word of a file
_MOST_CHUNKS = 1000


@dataclass
class Attribute:
    """An attribute: its name, its type and its bytes; `size` is a lie about their number."""

    name: bytes
    kind: bytes
    data: bytes
    size: int | None = None

    def packed(self) -> bytes:
        size = len(self.data) if self.size is None else self.size
        return self.name + b"\0" + self.kind + b"\0" + struct.pack("<i", size) + self.data


@dataclass
class Headers:
    """The first 8 bytes of a file, the attributes of each part, and all that follows."""

    start: bytes
    parts: list[list[Attribute]]
    rest: bytes
    length: int

    def packed(self) -> bytes:
        """Return the file; the places of its chunks move with the length of the headers."""
        headers = [b"".join(each.packed() for each in part) + b"\0" for part in self.parts]
        head = self.start + b"".join(headers) + (b"\0" if _is_multi(self.start) else b"")
        return head + _moved(self.rest, self.length, len(head) - self.length)


def parse(data: bytes) -> Headers | None:
    """Return the headers of a sound file; None for anything else."""
    if len(data) < 9 or data[:4] != _MAGIC:
        return None
    at, parts = 8, []
    try:
        while not parts or (_is_multi(data) and data[at] != 0):
            attributes = []
            while data[at] != 0:
                name, at = _word(data, at)
                kind, at = _word(data, at)
                (size,) = struct.unpack_from("<i", data, at)
                if not 0 <= size <= len(data) - at - 4:
                    return None
                attributes.append(Attribute(name, kind, data[at + 4 : at + 4 + size]))
                at += 4 + size
            at += 1
            parts.append(attributes)
    except (ValueError, IndexError, struct.error):
        return None
    at += 1 if _is_multi(data) else 0
    return Headers(data[:8], parts, data[at:], at)


def _is_multi(data: bytes) -> bool:
    return bool(struct.unpack_from("<I", data, 4)[0] & _MULTI_PART)


def _word(data: bytes, at: int) -> tuple[bytes, int]:
    end = data.index(b"\0", at)
    return data[at:end], end + 1


def _moved(rest: bytes, length: int, step: int) -> bytes:
    """Add a step to the table of the chunks' places, which begins what follows the headers.

    The first chunk lies behind the table, so its place tells how long the table is.
    """
    if step == 0 or len(rest) < 8:
        return rest
    count = (struct.unpack_from("<Q", rest)[0] - length) // 8
    if not 0 < count <= min(_MOST_CHUNKS, len(rest) // 8):
        return rest
    places = struct.unpack_from(f"<{count}Q", rest)
    moved = struct.pack(f"<{count}Q", *((place + step) % 2**64 for place in places))
    return moved + rest[8 * count :]
