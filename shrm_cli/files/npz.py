"""Numpy's .npz archives: reading those that may come from anywhere, and writing them in pieces.

Nothing in an archive is taken for what it says: sizes are checked before anything is unpacked, and
only plain numbers and texts are read. Whoever reads turns the ValueErrors into errors of their own
that name the file.
"""

import io
import math
import os
import stat
import struct
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from shrm_cli.errors import ShrmError
from shrm_cli.files.whole import note, replacing

MOST_TEXT = 2**20
"""The most bytes of a text in an archive, and of what an array has besides its numbers."""
_MOST_RATIO = 1032
"""The most bytes that one byte of an archive unpacks to: no better ratio exists."""
_CHUNK = 2**24
"""Bytes that are read or written at a time."""
_UNREADABLE = (
    zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError, struct.error,
    UnicodeDecodeError,
)  # fmt: skip
"""What the reader of archives raises: also for passwords, for names that are no text, and for
records that are cut off."""
_FIRST_DAY = (1980, 1, 1, 0, 0, 0)
"""The date of all that is written, so that the same arrays give the same bytes."""


class Archive:
    """An open archive.

    `names` are the names of the arrays, without ``.npy``.
    """

    def __init__(self, archive: zipfile.ZipFile, size: int) -> None:
        self._archive, self._size = archive, size
        members = {info.filename: info for info in archive.infolist()}
        self._members = {
            name.removesuffix(".npy"): info
            for name, info in members.items()
            if name.endswith(".npy")
        }
        self.names = self._members.keys()

    def numbers(self, name: str, dimensions: int, most: int | None = None) -> NDArray[np.floating]:
        """Return an array of 32 or 64-bit floats.

        `most` is the most bytes of its numbers. By default they must not be packed, so that they
        are no more than what the file holds.

        Raises ValueError if there is no such array, or it is another one than expected.
        """
        limit = self._stored(name) if most is None else most + MOST_TEXT
        return self._array(name, dimensions, "f", range(4, 9, 4), limit)

    def integers(self, name: str, dimensions: int) -> NDArray[np.integer]:
        """Return an array of 32-bit integers, as `numbers` does."""
        return self._array(name, dimensions, "i", range(4, 5), self._stored(name))

    def those_of(self, dimensions: Mapping[str, int]) -> dict[str, NDArray[Any]]:
        """Return the arrays that there are among some, given by their numbers of axes.

        Raises ValueError if one is another than expected.
        """
        return {
            name: self.numbers(name, axes)
            for name, axes in dimensions.items()
            if name in self.names
        }

    def text(self, name: str) -> str:
        """Return a single text.

        Raises ValueError if there is none of this name, or it holds what is no character. Python
        would make a string of that, but fail later.
        """
        (text,) = _texts(self._array(name, 0, "U", range(4, MOST_TEXT), MOST_TEXT).reshape(1))
        return text

    def texts(self, name: str) -> list[str]:
        """Return a list of texts, which must not be packed.

        Raises ValueError if there is none of this name, or one holds what is no character.
        """
        return _texts(self._array(name, 1, "U", range(4, MOST_TEXT), self._stored(name)))

    def _stored(self, name: str) -> int:
        """Bytes of an array that is not packed.

        Raises ValueError if it is packed.
        """
        info = self._members.get(name)
        if info is not None and info.compress_type != zipfile.ZIP_STORED:
            raise ValueError(f"{info.filename} is packed")
        return self._size

    def _array(
        self, name: str, dimensions: int, kind: str, sizes: range, most: int
    ) -> NDArray[Any]:
        if name not in self._members:
            raise ValueError(f"no array {name!r} in it")
        info = self._members[name]
        name = info.filename
        if info.file_size > min(most, _MOST_RATIO * min(info.compress_size, self._size)):
            raise ValueError(f"{name} unpacks to {info.file_size:,} bytes, which is too much")
        with self._archive.open(info) as stream:
            shape, fortran, dtype = _header(name, stream)
            if dtype.kind != kind or dtype.itemsize not in sizes or len(shape) != dimensions:
                raise ValueError(f"{name} holds {dtype} of shape {shape}, which is wrong")
            if math.prod(shape) * dtype.itemsize > info.file_size:
                raise ValueError(f"{name} is truncated")
            result = np.empty(math.prod(shape), dtype)
            target = memoryview(result.view(np.uint8).data)
            for start in range(0, len(target), _CHUNK):
                piece = stream.read(min(_CHUNK, len(target) - start))
                if len(piece) != min(_CHUNK, len(target) - start):
                    raise ValueError(f"{name} is truncated")
                target[start : start + len(piece)] = piece
        return result.reshape(shape, order="F" if fortran else "C")


@contextmanager
def opened(path: Path) -> Iterator[Archive]:
    """Yield an archive; what its reader says of damage within the block becomes a ValueError.

    Raises ValueError if the archive is damaged or truncated, or no regular file: a pipe would be
    waited for, and a device may never end. Raises OSError if it cannot be read.
    """
    if not stat.S_ISREG(os.stat(path).st_mode):
        raise ValueError("not a regular file")
    try:
        with zipfile.ZipFile(path) as archive:
            yield Archive(archive, os.path.getsize(path))
    except _UNREADABLE as error:
        raise ValueError("damaged or truncated") from error


@contextmanager
def checked_archive(
    path: Path, error: type[ShrmError], missing: str, again: str
) -> Iterator[Archive]:
    """Yield an archive that a command reads; what is wrong with it becomes one line of an error.

    `missing` and `again` are what to do where there is no such file, and where it is damaged or not
    what is sought, as a ValueError or a KeyError within the block tells.
    """
    note(path)
    try:
        if not path.exists():
            raise error(f"{path}: no such file; {missing}")
        with opened(path) as archive:
            yield archive
    except (ValueError, KeyError) as found:
        raise error(f"{path}: {found}; {again}") from found
    except OSError as found:
        raise error(f"{path}: cannot be read ({found.strerror or found})") from found


def holds(path: str | os.PathLike[str], names: set[str]) -> bool:
    """Tell whether a file is an archive with such arrays; whether it is sound, reading it tells."""
    try:
        with opened(Path(path)) as archive:
            return names <= archive.names
    except (ValueError, OSError):
        return False


def is_cut_off(path: str | os.PathLike[str]) -> bool:
    """Tell whether a file is empty, or begins as archives do and has not their end."""
    with Path(path).open("rb") as file:
        return b"PK".startswith(file.read(2)) and not zipfile.is_zipfile(path)


def read_npy(content: bytes) -> NDArray[Any]:
    """Return the array of a .npy file, of which no more memory is taken than its bytes are.

    Raises ValueError if it is no array of plain numbers.
    """
    stream = io.BytesIO(content)
    shape, fortran, dtype = _header("it", stream)
    size = math.prod(shape) * dtype.itemsize
    if dtype.kind not in "fiu" or size > len(content) - stream.tell():
        raise ValueError(f"it holds {dtype} of shape {shape}, which is wrong, or is cut off")
    flat = np.frombuffer(content, dtype, math.prod(shape), stream.tell())
    return flat.reshape(shape, order="F" if fortran else "C")


def write_npz(path: str | os.PathLike[str], arrays: Mapping[str, Any]) -> None:
    """Write arrays, and texts, whole or not at all; the same arrays give the same bytes.

    Numbers are written as they lie, in pieces, so that arrays on disk are never in memory whole.
    They are not packed: what is large here hardly becomes smaller.
    """
    with replacing(path) as temporary, zipfile.ZipFile(temporary, "w") as archive:
        for name, value in arrays.items():
            array = np.asanyarray(value)
            info = zipfile.ZipInfo(f"{name}.npy", _FIRST_DAY)
            with archive.open(info, "w", force_zip64=True) as stream:
                facts = {"descr": array.dtype.str, "fortran_order": False, "shape": array.shape}
                npy.write_array_header_1_0(stream, facts)
                rows = array.reshape(len(array) if array.ndim else 1, -1)
                step = max(1, _CHUNK // max(1, rows[:1].nbytes))
                for start in range(0, len(rows), step):
                    stream.write(rows[start : start + step].tobytes())


def _texts(array: NDArray[Any]) -> list[str]:
    """Decode an array of texts, which numpy keeps as numbers of 32 bits each."""
    size = array.dtype.itemsize
    data = array.astype(array.dtype.newbyteorder("<")).tobytes()
    rows = (data[start : start + size] for start in range(0, len(data), size))
    return [row.decode("utf-32-le").rstrip("\0") for row in rows]


def _header(name: str, stream: Any) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    readers = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}
    found: tuple[tuple[int, ...], bool, np.dtype[Any]]
    try:
        found = readers[npy.read_magic(stream)](stream)
    except Exception as error:  # numpy has Python parse the text, which fails in many ways
        raise ValueError(f"{name} is not an array of numpy's") from error
    if not all(type(length) is int and length >= 0 for length in found[0]):
        raise ValueError(f"{name} is not an array of numpy's")
    return found
