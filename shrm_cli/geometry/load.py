"""Meshes from files: OBJ, PLY, STL, glTF and GLB.

PLY and STL are read by the package `trimesh`, which belongs to the extra `mesh` and is used by this
module alone. Files may come from anywhere. What a file claims is counted before any memory is taken
for it, and before trimesh sees it, which gets bytes and no way to other files. Only buffers of a
glTF file and materials of an OBJ are opened, in their folder, and textures where a picture is drawn
of them; addresses on the network are never followed.
"""

import contextlib
import io
import logging
import os
import re
import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shrm_cli.errors import MeshError, ShrmError
from shrm_cli.extras import install
from shrm_cli.files.gltf import MOST_BYTES
from shrm_cli.files.whole import check_regular, note
from shrm_cli.geometry.gltf import read_gltf
from shrm_cli.geometry.mesh import MOST_FACES, Mesh, SurfaceMaterial, joined, make_mesh, too_many
from shrm_cli.geometry.mtl import PAINTED, read_materials
from shrm_cli.geometry.obj import read_obj
from shrm_cli.vocabulary import MESH_SUFFIXES

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
    """Check that a PLY file is long enough for the elements that its header declares."""
    end = data.find(b"end_header", 0, _MOST_HEADER)
    if end < 0:
        raise MeshError(f"{name}: its PLY header does not end; export it again")
    lines = data[:end].decode("utf-8", "replace").split("\n")
    formats = ["format", "binary_little_endian"], ["format", "binary_big_endian"]
    binary = any(line.split()[:2] in formats for line in lines)
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
    """Check that a binary STL file is as long as its triangles, and that others are text."""
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


Parts = list[SurfaceMaterial | None]

_CHECKS: Mapping[str, Callable[[str, bytes], None]] = {".ply": check_ply, ".stl": check_stl}
"""What looks at files of a suffix before trimesh reads them."""


def load_mesh(path: str | os.PathLike[str]) -> Mesh:
    """Read a mesh; the parts of a scene are joined where their nodes put them.

    `path` is OBJ, PLY, STL, glTF 2 or GLB. Polygons become fans of triangles. Vertices of STL that
    are at one place are one.

    The normals of the mesh are those of the file, or else smooth. Materials are read from glTF and
    OBJ. The vertices of a file are numbered from 0: the lines `v` of OBJ, the rows of the element
    `vertex` of PLY, the corners of the triangles of STL, and of glTF the elements of the POSITION
    of all primitives of triangles, mesh after mesh.
    """
    name = os.fspath(path)
    note(path)
    data = _bytes(Path(path))
    kind = _kind(name, data)
    try:
        if kind == ".obj":
            return make_mesh(name, **_surfaced(name, read_obj(name, data)))
        if kind not in _CHECKS:
            return read_gltf(name, data)
        _CHECKS[kind](name, data)
        return _joined(name, _parsed(name, data, kind[1:]))
    except ShrmError:
        raise
    except MemoryError:
        raise MeshError(f"{name}: not enough memory to read it; simplify the mesh") from None
    except Exception as error:  # whatever a damaged file makes of a reader
        why = " ".join(str(error).split())[:120] or type(error).__name__
        what = kind[1:].upper()
        raise MeshError(f"{name}: damaged, or not {what} ({why}); export it again") from error


# ---- bytes ---------------------------------------------------------------------------------------


def _bytes(path: Path) -> bytes:
    try:
        size = check_regular(path, MeshError, "a mesh").st_size
        if size > MOST_BYTES:
            raise MeshError(
                f"{path}: {size:,} bytes are more than {MOST_BYTES:,}; simplify the mesh"
            )
        return path.read_bytes()
    except OSError as error:
        raise MeshError(f"{path}: cannot be read ({error.strerror}); name another file") from error


def _kind(name: str, data: bytes) -> str:
    """Return the suffix of the format, which the content must agree with."""
    suffix = Path(name).suffix.lower()
    if suffix not in MESH_SUFFIXES:
        known = ", ".join(MESH_SUFFIXES[:-1])
        raise MeshError(
            f"{name}: the name of a mesh ends in {known} or {MESH_SUFFIXES[-1]}; export one"
        )
    if not data.strip():
        raise MeshError(f"{name}: it is empty; export it again")
    starts = {b"ply": ".ply", b"glTF": ".glb", b"{": ".gltf", b"PK\x03\x04": "zip"}
    head = data[:64].lstrip(b"\xef\xbb\xbf \t\r\n")
    looks = next((kind for start, kind in starts.items() if head.startswith(start)), "")
    if looks == "zip":
        raise MeshError(f"{name}: it is an archive; unpack it")
    if looks != suffix and (looks or suffix in starts.values()):
        what = f"looks like {looks}" if looks else "does not begin like one"
        raise MeshError(f"{name}: its name ends in {suffix}, but it {what}; rename or export it")
    return suffix


# ---- trimesh -------------------------------------------------------------------------------------


def _parsed(name: str, data: bytes, kind: str) -> dict[str, Any]:
    """Return what trimesh's reader of the format finds: arguments of a mesh, or of several.

    The reader itself is called, because the meshes that trimesh makes of it no longer tell whether
    their normals are the file's.
    """
    try:
        from trimesh.exchange.load import mesh_loaders
    except ImportError as error:
        raise MeshError(f"{name}: meshes need the package trimesh; {install('mesh')}") from error
    with warnings.catch_warnings(), _silent():  # numpy's, of text that is no number
        warnings.simplefilter("ignore")
        readers: Any = mesh_loaders
        found: dict[str, Any] = readers[kind](
            file_obj=io.BytesIO(data), file_type=kind, resolver=None
        )
    return found


@contextlib.contextmanager
def _silent() -> Iterator[None]:
    """Within this context trimesh writes no tracebacks of what it survives to its log."""
    log = logging.getLogger("trimesh")
    before = log.level
    log.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        log.setLevel(before)


def _joined(name: str, found: dict[str, Any]) -> Mesh:
    """Return one mesh of what trimesh found."""
    meshes = []
    first = 0  # of the file's vertices, which the parts have one after the other
    for part in found.get("geometry", {"": found}).values():
        if len(part.get("faces", ())):
            meshes.append(_mesh(name, part, first))
        first += len(part.get("vertices", ()))
    if not meshes:
        raise MeshError(f"{name}: it has no triangles; export it with its faces")
    return joined(name, meshes)


def _mesh(name: str, arguments: dict[str, Any], first: int) -> Mesh:
    """Make a mesh of a part, whose vertices are those of the file from a number on."""
    vertices, faces = np.asarray(arguments["vertices"]), _triangles(arguments["faces"])
    if name.lower().endswith(".stl"):  # it repeats each vertex in all of its triangles
        vertices, corner, place = np.unique(
            np.asarray(vertices, dtype=float), axis=0, return_index=True, return_inverse=True
        )
        place = place.reshape(-1)
        return make_mesh(
            name, vertices, place[faces], file_vertices=first + corner,
            file_rows=np.concatenate([np.full(first, -1), place]),
        )  # fmt: skip
    colors = arguments.get("vertex_colors")
    return make_mesh(
        name, vertices, faces, normals=arguments.get("vertex_normals"),
        uvs=getattr(arguments.get("visual"), "uv", None), colors=colors,
        materials=() if colors is None else (PAINTED,),
    )  # fmt: skip


def _surfaced(name: str, found: dict[str, Any]) -> dict[str, Any]:
    """Return arguments of `make_mesh` of what an OBJ file names of materials."""
    libraries, names = found.pop("libraries"), found.pop("material_names")
    owners = found.pop("face_materials")
    known = read_materials(name, libraries, names)
    if found["colors"] is not None:
        owners = np.where(owners < 0, len(known), owners)
        known = [*(replace(each, colored="srgb") for each in known), PAINTED]
    return {**found, "materials": known, "face_materials": owners}


def _triangles(faces: Any) -> NDArray[Any]:
    """Return triangles of polygons, which may have different numbers of corners."""
    table = np.asarray(faces) if len({len(each) for each in faces}) == 1 else None
    if table is not None and table.dtype.kind in "iu":
        fans = [table[:, [0, k, k + 1]] for k in range(1, table.shape[1] - 1)]
        return np.stack(fans, axis=1).reshape(-1, 3) if fans else np.zeros((0, 3), dtype=int)
    rows = [np.asarray(each, dtype=np.int64) for each in faces]
    return np.array(
        [(row[0], row[k], row[k + 1]) for row in rows for k in range(1, len(row) - 1)],
        dtype=np.int64,
    ).reshape(-1, 3)
