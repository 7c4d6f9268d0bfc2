"""Wavefront OBJ, read line by line into flat arrays.

As glTF, it is not left to trimesh, whose reader takes relative indices for absolute ones where
vertices follow later, and holds all lines as text in memory at once. Materials are other files,
which `mtl` reads.
"""

import io
from array import array
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shrm_cli.errors import MeshError
from shrm_cli.geometry.mesh import MOST_FACES, too_many

_MOST_CORNERS = 4096
"""The most corners of a polygon."""
_MOST_LINE = 2**20
"""The most bytes of a line."""
_WIDTHS = {b"v": 3, b"vt": 2, b"vn": 3}
"""How many numbers of a vertex, its texture coordinates and its normal are used."""
_FACES = (b"f", b"fo")
_NUMERIC = {*_WIDTHS, *_FACES}
"""Lines of numbers, of which all is a comment that follows a `#`."""
MOST_MATERIALS = 2**12
"""The most materials of a mesh, and the most files of them."""
_COLORED = 7  # words of a vertex with a colour


class _Reader:
    """What has been read so far.

    `values` are numbers of positions, texture coordinates and normals. `colors` are three numbers
    for each vertex that has a colour. `corners` are three indices for each corner of the triangles:
    into the `values`, from 0, and -1 for none. `owners` are the places of the triangles' materials,
    and -1 for none. `libraries` are the files of materials that are named. `materials` are the
    materials that are named, and their places.
    """

    def __init__(self, name: str) -> None:
        self.name, self.line = name, 0
        self.values = (array("d"), array("d"), array("d"))
        self.colors = array("d")
        self.corners = array("q")
        self.owners = array("q")
        self.libraries: list[str] = []
        self.materials: dict[str, int] = {}
        self._owner = -1

    def read(self, data: bytes) -> None:
        before: list[bytes] = []  # what goes on in the next line, and its length
        length = 0
        for line in io.BytesIO(data):
            self.line += 1
            if len(line) > _MOST_LINE:  # its words would take a hundred times as much
                if line.lstrip().startswith(b"#"):
                    continue
                raise self.wrong("line", "is too long")
            if line.rstrip(b"\r\n").endswith(b"\\"):  # it goes on in the next line
                before.append(line.rstrip(b"\r\n")[:-1])
                length += len(line)
                if length > _MOST_LINE:
                    raise self.wrong("line", "is too long")
                continue
            words = b" ".join([*before, line]).split()
            if b"#" in line and words and words[0] in _NUMERIC:
                words = _without_comment(words)
            before, length = [], 0
            if not words:
                continue
            if words[0] in _WIDTHS:
                self._value(words)
            elif words[0] in _FACES:
                self._face(words)
            elif words[0] in (b"usemtl", b"mtllib") and len(words) > 1:
                self._named(words[0], b" ".join(words[1:]).decode("utf-8", "replace"))

    def _named(self, key: bytes, text: str) -> None:
        if key == b"usemtl":
            self._owner = self.materials.setdefault(text, len(self.materials))
        elif text not in self.libraries:
            self.libraries.append(text)
        if max(len(self.materials), len(self.libraries)) > MOST_MATERIALS:
            raise self.wrong("line", f"names more than {MOST_MATERIALS:,} materials or their files")

    def _value(self, words: list[bytes]) -> None:
        kind = tuple(_WIDTHS).index(words[0])
        width = _WIDTHS[words[0]]
        try:
            numbers = [float(word) for word in words[1 : width + 1]]
            if kind == 0 and len(words) >= _COLORED:
                self.colors.extend(float(word) for word in words[4:_COLORED])
        except ValueError:
            raise self.wrong("line", "is not made of numbers") from None
        if len(numbers) < width and not (kind == 1 and numbers):  # textures may have one dimension
            raise self.wrong("line", f"has {len(numbers)} numbers")
        self.values[kind].extend(numbers + [0.0] * (width - len(numbers)))

    def _face(self, words: list[bytes]) -> None:
        if not 3 < len(words) <= _MOST_CORNERS + 1:
            raise self.wrong("face in line", f"has {len(words) - 1} corners")
        corners = [self._corner(word) for word in words[1:]]
        for k in range(1, len(corners) - 1):
            for corner in (corners[0], corners[k], corners[k + 1]):
                self.corners.extend(corner)
            self.owners.append(self._owner)
        if len(self.corners) > 9 * MOST_FACES:
            raise too_many(self.name, len(self.corners) // 9)

    def _corner(self, word: bytes) -> tuple[int, int, int]:
        parts = word.split(b"/")
        try:
            found = [self._index(parts[k], k) if k < len(parts) else -1 for k in range(3)]
        except ValueError:
            raise self.wrong("face in line", "is not made of numbers") from None
        if len(parts) > 3 or found[0] < 0:
            raise self.wrong("face in line", "names no vertex")
        return found[0], found[1], found[2]

    def _index(self, part: bytes, kind: int) -> int:
        """Return an index from 0; the file counts from 1, or backwards from here."""
        if not part:
            return -1
        index = int(part)
        known = len(self.values[kind]) // (2 if kind == 1 else 3)
        found = index + known if index < 0 else index - 1
        # What is named before it stands in the file is rare, but no error, if it comes.
        if found < 0 or found >= 2**31:
            raise self.wrong("face in line", f"names {part.decode()[:20]}, which is not there")
        return found

    def wrong(self, what: str, how: str) -> MeshError:
        return MeshError(f"{self.name}: the {what} {self.line:,} {how}; export it again")


def _without_comment(words: list[bytes]) -> list[bytes]:
    return words[: next((k for k, word in enumerate(words) if word.startswith(b"#")), None)]


def read_obj(name: str, data: bytes) -> dict[str, Any]:
    """Read an OBJ file.

    Returns ``vertices``, ``faces`` and more, as `make_mesh` takes them. A vertex is what its
    corners have in common: position, texture coordinates and normal. ``libraries`` are the files
    that hold the materials ``material_names``, whose places ``face_materials`` has.
    """
    if b"\0" in data:
        raise MeshError(f"{name}: it is not text, so it is not OBJ; export it again")
    reader = _Reader(name)
    reader.read(data)
    positions, uvs, normals = (
        np.frombuffer(values, dtype=float).reshape(-1, width) if values else np.zeros((0, width))
        for values, width in zip(reader.values, _WIDTHS.values(), strict=True)
    )
    corners = np.array(reader.corners, dtype=np.int64).reshape(-1, 3)
    if len(corners) == 0:
        raise MeshError(f"{name}: it has no faces, or is not OBJ; export it with its faces")
    for kind, known in enumerate((positions, uvs, normals)):
        if corners[:, kind].max() >= len(known):
            raise MeshError(
                f"{name}: a face names {int(corners[:, kind].max()) + 1:,} of {len(known):,} "
                f"{('vertices', 'texture coordinates', 'normals')[kind]}; export it again"
            )
    colors = np.frombuffer(reader.colors, dtype=float).reshape(-1, 3) if reader.colors else None
    if colors is not None and len(colors) != len(positions):
        colors = None
    named = {
        "libraries": reader.libraries,
        "material_names": list(reader.materials),
        "face_materials": np.array(reader.owners, dtype=np.int64),
    }
    if corners[:, 1:].max() < 0:
        faces = corners[:, 0].reshape(-1, 3)
        own = np.arange(len(positions))
        return {
            "vertices": positions, "faces": faces, "colors": colors, "file_vertices": own, **named
        }  # fmt: skip
    different, place = np.unique(corners, axis=0, return_inverse=True)
    own = different[:, 0]
    return {
        "vertices": positions[own],
        "faces": place.reshape(-1, 3),
        "uvs": _picked(uvs, different[:, 1]),
        "normals": _picked(normals, different[:, 2]),
        "colors": None if colors is None else colors[own],
        "file_vertices": own,
        "file_count": len(positions),
        **named,
    }


def _picked(values: NDArray[np.floating], indices: NDArray[np.int64]) -> NDArray[np.floating]:
    """Return values by their indices; NaN for those of index -1."""
    return np.concatenate([values, np.full((1, values.shape[1]), np.nan)])[indices]
