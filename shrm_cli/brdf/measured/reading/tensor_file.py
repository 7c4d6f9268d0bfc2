"""RGL's tensor files: named arrays in one file, whose header is checked before any is read."""

import os
import struct
from collections.abc import Mapping
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shrm_cli.brdf.measured.reading.file import check_file, readable
from shrm_cli.errors import BrdfError
from shrm_cli.records import record

MAGIC = b"tensor_file\0"

_VERSION = bytes([1, 0])
_TYPES = dict(enumerate(("u1", "i1", "u2", "i2", "u4", "i4", "u8", "i8", "f2", "f4", "f8"), 1))
_MOST_FIELDS = 256
_MOST_AXES = 8
_MOST_NAME = 256
_MOST_HEADER = 2**17
_MOST_BYTES = 2**28  # of one array in memory


@record
class Field:
    """The type and shape of an array, and where it begins in the file."""

    name: str
    dtype: np.dtype[Any]
    shape: tuple[int, ...]
    offset: int

    @property
    def size(self) -> int:
        """The size of the array in bytes."""
        return prod(self.shape) * self.dtype.itemsize


@record
class TensorFile:
    """A tensor file whose header is sound: its fields lie inside the file and do not overlap."""

    path: Path
    fields: Mapping[str, Field]

    @classmethod
    def open(cls, path: str | os.PathLike[str]) -> "TensorFile":
        """Read the header of a file."""
        path = check_file(path)
        with readable(path, "copy it again") as stream:
            size = os.fstat(stream.fileno()).st_size
            header = _Header(stream.read(_MOST_HEADER), path)
        fields = header.fields()
        _check_places(fields, header.at, size, path)
        return cls(path, {field.name: field for field in fields})

    def read(self, name: str) -> NDArray[Any]:
        """Read the array of a field, in the type that it is stored in."""
        if name not in self.fields:
            raise damaged(self.path, f"there is no field {name!r}")
        field = self.fields[name]
        if field.size > _MOST_BYTES:
            raise BrdfError(
                f"{self.path}: its field {name!r} has {field.size:,} bytes, more than "
                f"{_MOST_BYTES:,}; use the RGB file of the material"
            )
        with readable(self.path, "copy it again") as stream:
            stream.seek(field.offset)
            values = np.fromfile(stream, dtype=field.dtype, count=prod(field.shape))
        if values.size != prod(field.shape):  # the file has shrunk meanwhile
            raise damaged(self.path, f"its field {name!r} ends too early")
        return values.reshape(field.shape)


def damaged(path: Path, what: str) -> BrdfError:
    """Make the error of a tensor file that is not as it was written."""
    return BrdfError(f"{path}: a damaged tensor file ({what}); copy it again")


class _Header:
    """A reader of the fields of a header, which keeps its place in the first bytes of a file."""

    def __init__(self, head: bytes, path: Path) -> None:
        if not head.startswith(MAGIC):
            raise BrdfError(f"{path}: not an RGL tensor file; name another file")
        self.head, self.path, self.at = head, path, len(MAGIC)
        if self._bytes(2) != _VERSION:
            raise BrdfError(f"{path}: a tensor file of a version other than 1.0; convert it first")

    def fields(self) -> list[Field]:
        (count,) = self._numbers("<I")
        if count > _MOST_FIELDS:
            raise damaged(self.path, f"{count:,} fields, more than {_MOST_FIELDS}")
        fields = [self._field() for _ in range(count)]
        names = [field.name for field in fields]
        if len(set(names)) != len(names):
            raise damaged(self.path, "two fields have the same name")
        return fields

    def _field(self) -> Field:
        (length,) = self._numbers("<H")
        if length > _MOST_NAME:
            raise damaged(self.path, f"a field's name of {length:,} bytes")
        name = self._bytes(length).decode("ascii", errors="backslashreplace")
        axes, kind, offset = self._numbers("<HBQ")
        if axes > _MOST_AXES:
            raise damaged(self.path, f"a field of {axes:,} axes")
        if kind not in _TYPES:
            raise damaged(self.path, f"a field of unknown type {kind}")
        return Field(name, np.dtype("<" + _TYPES[kind]), self._numbers(f"<{axes}Q"), offset)

    def _numbers(self, layout: str) -> tuple[int, ...]:
        return struct.unpack(layout, self._bytes(struct.calcsize(layout)))

    def _bytes(self, count: int) -> bytes:
        if self.at + count > len(self.head):
            raise damaged(self.path, "its header ends too early")
        self.at += count
        return self.head[self.at - count : self.at]


def _check_places(fields: list[Field], start: int, size: int, path: Path) -> None:
    """Check that fields lie behind the header and within the file, and do not overlap."""
    for field in sorted(fields, key=lambda field: field.offset):
        if 0 in field.shape:
            raise damaged(path, f"its field {field.name!r} is empty")
        if field.offset < start:
            raise damaged(path, f"its field {field.name!r} lies over another or the header")
        start = field.offset + field.size
        if start > size:
            raise damaged(path, f"its field {field.name!r} ends beyond the file")
