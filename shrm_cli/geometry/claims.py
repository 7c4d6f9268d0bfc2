"""What PLY and STL files claim to hold, counted before any memory is taken for it."""

import io
import re

from shrm_cli.errors import MeshError
from shrm_cli.geometry.mesh import MOST_FACES, too_many

_MOST_TEXT = 2**27
_MOST_ROWS = 2**22
"""The most bytes of text, and rows of PLY as text, which take 250 bytes each to be read."""
_MOST_LINE = 2**20
"""The most bytes of a line of text, whose words take a hundred times as much."""
_MOST_SOLIDS = 2**10
_MOST_HEADER = 2**16
_MOST_PROPERTIES = 256
_BYTES = {
    "char": 1, "uchar": 1, "int8": 1, "uint8": 1, "short": 2, "ushort": 2, "int16": 2, "uint16": 2,
    "int": 4, "uint": 4, "float": 4, "int32": 4, "uint32": 4, "float32": 4, "double": 8,
    "float64": 8, "int64": 8, "uint64": 8,
}  # fmt: skip
_STL_HEADER, _STL_TRIANGLE = 84, 50
_WORDS = re.compile(rb"\s*solid\b.*?facet\s+normal\b", re.DOTALL | re.IGNORECASE)


def check_ply(name: str, data: bytes) -> None:
    """Check that a PLY file is long enough for the elements that its header declares.

    Raises MeshError if it is not, or the header is damaged.
    """
    end = data.find(b"end_header", 0, _MOST_HEADER)
    if end < 0:
        raise MeshError(f"{name}: its PLY header does not end; export it again")
    lines = data[:end].decode("utf-8", "replace").split("\n")
    binary = any(line.split()[:2] == ["format", "binary_little_endian"] for line in lines) or any(
        line.split()[:2] == ["format", "binary_big_endian"] for line in lines
    )
    rows: list[tuple[str, int, int]] = []  # elements: name, count, least bytes of a row
    for line in lines[1:]:
        words = line.split()
        if words[:1] == ["element"]:
            if len(words) != 3 or not words[2].isascii() or not words[2].isdigit():
                raise MeshError(f"{name}: an element of its PLY header is damaged; export it again")
            rows.append((words[1], int(words[2][:18]), 0))
        elif words[:1] == ["property"] and rows:
            kind = words[2] if words[1:2] == ["list"] and len(words) > 2 else words[-2]
            if kind not in _BYTES:
                raise MeshError(f"{name}: its PLY header has no type {kind!r}; export it again")
            element, count, size = rows[-1]
            rows[-1] = element, count, size + (_BYTES[kind] if binary else 2)
    if len(lines) > _MOST_PROPERTIES:
        raise MeshError(f"{name}: its PLY header is too long; export it again")
    _check_rows(name, rows, len(data) - end)
    if not binary:
        _check_text(name, data)
        declared = sum(count for _, count, _ in rows)
        if max(declared, data.count(b"\n", end)) > _MOST_ROWS:
            raise MeshError(f"{name}: more than {_MOST_ROWS:,} rows of text; export it as binary")


def _check_rows(name: str, rows: list[tuple[str, int, int]], left: int) -> None:
    for element, count, size in rows:
        if count and count * max(size, 1) > left + 2:
            raise MeshError(
                f"{name}: it declares {count:,} of {element[:40]!r}, more than the file holds; "
                "copy or export it again"
            )
        if element == "face" and count > MOST_FACES:
            raise too_many(name, count)
        left -= count * size


def check_stl(name: str, data: bytes) -> None:
    """Check that a binary STL file is as long as its triangles, and that others are text.

    Raises MeshError if it is neither.
    """
    count = int.from_bytes(data[_STL_HEADER - 4 : _STL_HEADER], "little")
    if len(data) >= _STL_HEADER and len(data) == _STL_HEADER + count * _STL_TRIANGLE:
        if count > MOST_FACES:
            raise too_many(name, count)
        return
    if _WORDS.match(data[:_MOST_HEADER]) is None:
        held = max(len(data) - _STL_HEADER, 0) // _STL_TRIANGLE
        raise MeshError(
            f"{name}: neither STL text nor binary STL (it declares {count:,} triangles and has "
            f"bytes for {held:,}); copy or export it again"
        )
    _check_text(name, data)
    if data.lower().count(b"endsolid") > _MOST_SOLIDS:
        raise MeshError(f"{name}: more than {_MOST_SOLIDS:,} solids; export them as one")


def _check_text(name: str, data: bytes) -> None:
    if len(data) > _MOST_TEXT:
        raise MeshError(f"{name}: {len(data):,} bytes of text; export it as binary")
    if max(map(len, io.BytesIO(data)), default=0) > _MOST_LINE:
        raise MeshError(f"{name}: a line of more than {_MOST_LINE:,} bytes; export it as binary")
