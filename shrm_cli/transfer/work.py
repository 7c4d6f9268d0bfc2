"""Arrays that a long computation fills block by block, in memory or in a file beside its output.

A file lets a run that was interrupted go on where it stopped. It begins with a header of fixed
length, which names what is computed by a digest of all inputs and options. Then come one 64-bit
mark for each block, and the arrays. A mark holds the CRC-32 of its block's bytes, so that a block
which did not reach the disk whole is computed again. A file of other inputs is replaced by a new
one, and a process that works on it keeps it, without a name.
"""

import math
import os
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import slices
from shrm_cli.errors import OutputError
from shrm_cli.files.whole import replacing

Floats = NDArray[np.float32]
Shapes = Mapping[str, tuple[int, ...]]
"""The names and shapes of the arrays; the first axis of each is cut into blocks."""

SUFFIX = ".part"
"""What follows the output's name in the name of the file."""

_MAGIC = b"shrm transfer, unfinished 1\n"
_HEADER = 128
_AT_ONCE = 2**20
"""The bytes of a new file that are written at a time."""
_WRITTEN = 1 << 32
"""The bit of a mark that tells a written block, whose CRC-32 may be 0, from one that is not."""


class Work:
    """Arrays of 32-bit floats in memory."""

    def __init__(self, shapes: Shapes, step: int) -> None:
        self.shapes, self.step = dict(shapes), step
        self.arrays: dict[str, Floats] = self._arrays()

    def blocks(self, name: str) -> list[slice]:
        """The blocks of an array that are still to be computed."""
        count = self.shapes[name][0]
        return [part for part in slices(count, self.step) if not self._is_done(name, part)]

    def put(self, name: str, part: slice, values: Floats) -> None:
        """Store the values of a block; different blocks may come from different threads."""
        self.arrays[name][part] = values

    def _arrays(self) -> dict[str, Floats]:
        return {name: np.empty(shape, np.float32) for name, shape in self.shapes.items()}

    def _is_done(self, name: str, part: slice) -> bool:
        return False


class FileWork(Work):
    """Arrays in a file, of which blocks may have been computed by an earlier run.

    `key` is a digest of everything that the arrays depend on, in hexadecimal digits. `shapes` and
    `step` are as of `Work`.
    """

    def __init__(self, path: Path, key: str, shapes: Shapes, step: int) -> None:
        counts = {name: math.ceil(shape[0] / step) for name, shape in shapes.items()}
        self._first_mark, marks = {}, 0
        for name, count in counts.items():
            self._first_mark[name], marks = marks, marks + count
        size = _HEADER + 8 * marks + 4 * sum(map(math.prod, shapes.values()))
        header = (_MAGIC + key.encode()).ljust(_HEADER)
        begun = _begun(path, header, size)
        self.resumed = begun is not None
        with begun or _new(path, header, size) as self._stream:
            self._marks = np.memmap(self._stream, "<u8", "r+", _HEADER, (marks,))
            self._start = _HEADER + 8 * marks
            super().__init__(shapes, step)

    def put(self, name: str, part: slice, values: Floats) -> None:
        """Store the values of a block, and mark it as done."""
        super().put(name, part, values)
        self._marks[self._mark(name, part)] = self._sum(name, part)

    def _arrays(self) -> dict[str, Floats]:
        found: dict[str, Floats] = {}
        start = self._start
        for name, shape in self.shapes.items():
            found[name] = np.memmap(self._stream, "<f4", "r+", start, shape)
            start += 4 * math.prod(shape)
        return found

    def _is_done(self, name: str, part: slice) -> bool:
        mark = int(self._marks[self._mark(name, part)])
        return bool(mark & _WRITTEN) and mark == self._sum(name, part)

    def _mark(self, name: str, part: slice) -> int:
        return self._first_mark[name] + part.start // self.step

    def _sum(self, name: str, part: slice) -> int:
        return _WRITTEN | zlib.crc32(np.ascontiguousarray(self.arrays[name][part]).data)


@contextmanager
def unfinished(output: Path, key: str, shapes: Shapes, step: int) -> Iterator[FileWork]:
    """Yield the arrays in a file beside an output; it is removed when the block succeeds.

    A block that fails or is interrupted leaves the file, and the next run goes on with it.
    """
    path = output.with_name(output.name + SUFFIX)
    try:
        yield FileWork(path, key, shapes, step)
        path.unlink(missing_ok=True)
    except OSError as error:
        reason = error.strerror or error
        raise OutputError(f"{path}: cannot be written ({reason}); name another output") from error


def _begun(path: Path, header: bytes, size: int) -> BinaryIO | None:
    """The opened file of this work if it exists, whole as far as its length tells."""
    if path.is_symlink() or not path.exists():
        return None
    stream = open(path, "rb+")  # noqa: SIM115, which the caller closes
    if os.fstat(stream.fileno()).st_size == size and stream.read(len(header)) == header:
        return stream
    stream.close()
    return None


def _new(path: Path, header: bytes, size: int) -> BinaryIO:
    """A new file, opened, which has all its room on the disk.

    Without that, a disk that gets full while the arrays are filled would end the process.
    """
    with replacing(path) as temporary:
        stream = open(temporary, "wb+")  # noqa: SIM115, which the caller closes
        stream.write(header)
        for start in range(len(header), size, _AT_ONCE):
            stream.write(bytes(min(_AT_ONCE, size - start)))
        stream.flush()
    return stream
