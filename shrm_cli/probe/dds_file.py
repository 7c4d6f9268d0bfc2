"""DDS files of half and 32-bit floats, which image libraries do not read, and checks of all DDS.

Cubes in this form came with the DirectX SDK. A header of 128 bytes is followed by the faces, each
with all its mip levels; only the first level is read.
"""

import math
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.errors import ProbeError
from shrm_cli.probe.encoding import Encoding
from shrm_cli.probe.image_file import file_bytes
from shrm_cli.records import record
from shrm_cli.vocabulary import FACES

_MAGIC = b"DDS "
_HEADER = struct.Struct("<4s I 4x 2I 4x 2I 44x 8x 4s 20x 4x I 12x")
"""Magic; size; height, width; depth, mip levels; code of the pixel format; second word of caps."""
_EXTENSION = struct.Struct("<5I")
"""What follows where that code is DX10: format, dimension, flags, count, alpha."""
_IS_CUBE, _ALL_FACES, _IS_VOLUME = 0x200, 0xFC00, 0x200000
_DX10_CUBE = 0x4
_LEGACY = {113: "<f2", 116: "<f4"}
"""D3DFMT_A16B16G16R16F and D3DFMT_A32B32G32R32F."""
_DXGI = {10: "<f2", 2: "<f4"}
_MOST_ON_A_SIDE = 2**15
_CHANNELS = 4


@record
class DdsFile:
    """A `ProbeImage` in a DDS file of floats: a lat-long, or six faces stacked."""

    path: Path
    width: int
    height: int
    """`width` and `height`: of the picture, which is one face wide and six high where it is a
    cube."""
    envmap: str
    """What it says that it is: ``cube``, or nothing."""
    _dtype: str
    _start: int
    _levels: int

    file_format = "dds"
    border_sampled = False
    chromaticities = None
    proxy = None
    encoding = Encoding()
    notes = ()
    largest = given = None
    row_multiple = 1

    @classmethod
    def open(cls, path: Path) -> "DdsFile | None":
        """Open a file; None where it is no DDS file, or one that image libraries can read."""
        with open(path, "rb") as stream:
            head = stream.read(_HEADER.size + _EXTENSION.size)
        if not head.startswith(_MAGIC):
            return None
        if len(head) < _HEADER.size:
            raise ProbeError(f"{path}: damaged or truncated; copy or export it again")
        _, size, height, width, depth, levels, code, caps = _HEADER.unpack_from(head)
        # Old files have a number in place of a code of four letters.
        kind = _LEGACY.get(int.from_bytes(code, "little"))
        is_cube, start = bool(caps & _IS_CUBE), _HEADER.size
        if code == b"DX10" and len(head) == _HEADER.size + _EXTENSION.size:
            dxgi, _, flags, count, _ = _EXTENSION.unpack_from(head, _HEADER.size)
            kind, start = _DXGI.get(dxgi), start + _EXTENSION.size
            is_cube = is_cube or bool(flags & _DX10_CUBE)
            if count > 1:
                raise ProbeError(f"{path}: an array of {count} textures; export one of them")
        if caps & _IS_CUBE and caps & _ALL_FACES != _ALL_FACES:
            missing = [face for k, face in enumerate(FACES) if not caps & (0x400 << k)]
            raise ProbeError(
                f"{path}: a cube without its faces {', '.join(missing)}; export all six"
            )
        if kind is None:
            return None
        if size != 124 or (caps & _IS_VOLUME and depth > 1):
            raise ProbeError(f"{path}: a volume or a damaged header; export a cube or a lat-long")
        if not (0 < width <= _MOST_ON_A_SIDE and 0 < height <= _MOST_ON_A_SIDE):
            raise ProbeError(
                f"{path}: {width} x {height} pixels are not 1 .. {_MOST_ON_A_SIDE} on a side; "
                "scale it down"
            )
        if is_cube and width != height:
            raise ProbeError(f"{path}: faces of {width} x {height} are not square; export it again")
        levels = min(max(levels, 1), 1 + int(math.log2(max(width, height))))
        faces = len(FACES) if is_cube else 1
        found = cls(path, width, faces * height, "cube" if is_cube else "", kind, start, levels)
        if path.stat().st_size < found._end:
            raise ProbeError(f"{path}: damaged or truncated; copy or export it again")
        return found

    @property
    def name(self) -> str:
        """The path, as text."""
        return str(self.path)

    @property
    def _rows(self) -> int:
        """Rows of a face, or of the whole picture."""
        return self.height // len(FACES) if self.envmap else self.height

    @property
    def _row_bytes(self) -> int:
        return self.width * _CHANNELS * np.dtype(self._dtype).itemsize

    @property
    def _face_bytes(self) -> int:
        """Bytes of a face with all its mip levels."""
        pixel = _CHANNELS * np.dtype(self._dtype).itemsize
        sides = ((max(self.width >> k, 1), max(self._rows >> k, 1)) for k in range(self._levels))
        return pixel * sum(width * height for width, height in sides)

    @property
    def _end(self) -> int:
        """The byte behind the last pixel of the first mip levels."""
        before = (self.height // self._rows - 1) * self._face_bytes
        return self._start + before + self._rows * self._row_bytes

    def read(self, start: int, stop: int) -> Array:
        pieces = []
        with open(self.path, "rb") as stream:
            while start < stop:
                face, row = divmod(start, self._rows)
                count = min(self._rows - row, stop - start)
                stream.seek(self._start + face * self._face_bytes + row * self._row_bytes)
                data = stream.read(count * self._row_bytes)
                if len(data) < count * self._row_bytes:
                    raise ProbeError(f"{self.path}: damaged or truncated; copy or export it again")
                pieces.append(np.frombuffer(data, self._dtype).reshape(count, self.width, -1))
                start += count
        return np.concatenate(pieces)[..., :3].astype(np.float32)

    def facts(self) -> dict[str, Any]:
        """What was taken of the file, and how its numbers are encoded."""
        return {"channels": ["R", "G", "B"], "encoding": self.encoding.name}

    def contents(self) -> Iterator[bytes]:
        return file_bytes(self.path)
