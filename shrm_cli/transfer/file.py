"""Files of transfer: numpy's .npz archives, which may come from anywhere.

An archive holds the arrays ``vectors`` and ``albedo`` of a `Transfer`, ``direct``, ``matrices`` and
``frames`` if it has them, and ``settings``: one text, a JSON object with ``version`` (1, and 2 of
textures) and what `Facts` says. Textures have ``rows``, ``texcoords`` and ``positions``, as
`geometry.texels.Texels` says. Those of vertices have arrays for other programs, which reading
leaves alone: ``positions`` and ``normals``, a row each for every row of the vectors, ``faces``,
whose triangles name these rows, ``vertex_of_row``, the vertex of the mesh's file that each row is,
and ``row_of_vertex``, the other way round (the first row of several; -1 for vertices without a
triangle).
Arrays are not packed, so that a file is never smaller than what it unpacks to.

Other programs read the vectors alone: irradiance-like, without 1/pi and albedo, over the real
harmonics of world axes without the Condon-Shortley phase, index l(l+1)+m.

glTF (.glb)
    One primitive with POSITION, NORMAL and the attributes ``_TRANSFER_0``, ``_TRANSFER_1``, ... of
    floats, and ``_VERTEX``, the number of the vertex in the mesh's file, as a float (exact below
    2^24). Grey transfer is four coefficients an attribute (VEC4), the last one filled with zeros;
    coloured transfer one coefficient an attribute, R, G and B (VEC3).
PLY (.ply)
    Binary, little-endian. After x y z nx ny nz a vertex has the properties ``transfer_000``, ...,
    coloured ones ``transfer_000_r``, ``_g``, ``_b``, and last ``file_vertex``, the number of the
    vertex in the mesh's file.
PIFu (.txt)
    A line of 9 numbers for each vertex of the mesh's file, in its order (zeros for those without a
    triangle), and ``face.npy`` beside it with the triangles, which name these lines, as
    `prt_util.py` of PIFu writes them (Saito et al. 2019). Its directions are those of its harmonics
    turned by half a turn about z, which cancels its Condon-Shortley phase: its basis is this one.
"""

import json
import os
import re
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from shrm_cli.arrays import Array, slices
from shrm_cli.errors import OutputError, TransferError
from shrm_cli.files import npz
from shrm_cli.files.json_text import parse_json
from shrm_cli.files.whole import replacing, together
from shrm_cli.geometry.mesh import Mesh
from shrm_cli.geometry.texels import Texels
from shrm_cli.transfer.transfer import Facts, Transfer
from shrm_cli.vocabulary import MAX_TRANSFER_ORDER

_VERSION = 2
_DIMENSIONS = {"vectors": 3, "direct": 3, "albedo": 2, "matrices": 4, "frames": 3}
_ROUNDING = 1e-3
"""How far frames may be from orthonormal."""
_AT_ONCE = 2**22
"""Numbers that are checked at a time."""
_AGAIN = "make it again with shrm transfer"
_COMMENT = "comment shrm transfer, order {}, bounces {}"
_PLY_COMMENT = re.compile(_COMMENT.format(r"(\d{1,3})", r"(\d{1,3})").encode())
"""What a PLY says of its transfer."""
_PIFU_LINES = re.compile(rb"(?:(?:-?\d+\.\d{8} ){8}-?\d+\.\d{8}\n){2}")
_MOST_HEADER = 2**16
"""Bytes within which meshes say what their transfer is: their headers are a tenth of it at most."""


def write_transfer(
    path: str | os.PathLike[str], transfer: Transfer, mesh: Mesh | None = None
) -> None:
    """Write a transfer, whole or not at all; the same transfer gives the same bytes."""
    arrays: dict[str, Any] = {"vectors": transfer.vectors, "albedo": transfer.albedo}
    if transfer.direct is not None:
        arrays["direct"] = transfer.direct
    if transfer.matrices is not None and transfer.frames is not None:
        arrays |= {"frames": transfer.frames, "matrices": transfer.matrices}
    texels = transfer.texels
    if texels is not None:
        arrays |= {
            "rows": texels.rows.astype("<i4"),
            "texcoords": texels.texcoords.astype("<f4"),
            "positions": texels.positions.astype("<f4"),
        }
    elif mesh is not None:
        arrays |= {
            "positions": mesh.vertices.astype("<f4"),
            "normals": mesh.normals.astype("<f4"),
            "faces": mesh.faces.astype("<i4"),
            "vertex_of_row": mesh.file_vertices.astype("<i4"),
            "row_of_vertex": mesh.file_rows.astype("<i4"),
        }
    version = 1 if texels is None else _VERSION
    settings = json.dumps({"version": version, **vars(transfer.facts)})
    npz.write_npz(path, {**arrays, "settings": settings})


def read_transfer(path: str | os.PathLike[str]) -> Transfer:
    """Read a transfer."""
    if os.path.isfile(path) and not _may_be_archive(path):
        raise TransferError(
            f"{os.fspath(path)}: no transfer file (those for engines are not read); name the .npz "
            "that shrm transfer MESH -o x.npz writes"
        )
    missing = "name a transfer that shrm transfer wrote"
    with npz.checked_archive(Path(path), TransferError, missing, _AGAIN) as archive:
        arrays = archive.those_of(_DIMENSIONS)
        texels = _texels(archive) if "rows" in archive.names else None
        if "settings" in archive.names and not {"vectors", "albedo"} <= set(arrays):
            raise ValueError("not a transfer")  # but another archive, such as a grid of probes
        facts = _facts(parse_json(archive.text("settings")))
        _check(arrays)
        return Transfer(facts=facts, texels=texels, **arrays)


def _may_be_archive(path: str | os.PathLike[str]) -> bool:
    """Tell whether a file is a ZIP, which may be cut, or cannot be opened, as reading it tells."""
    try:
        with open(path, "rb") as stream:
            return stream.read(2) in (b"PK", b"P", b"")
    except OSError:
        return True


def is_pifu(path: str | os.PathLike[str]) -> bool:
    """Tell whether a file is one of `write_pifu`, with its triangles beside it."""
    path = Path(path)
    if path.suffix.lower() != ".txt" or not (path.is_file() and path.with_name(FACES).is_file()):
        return False
    with open(path, "rb") as stream:
        return _PIFU_LINES.match(stream.read(1024)) is not None


def read_pifu_facts(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Return what is known of a file of `write_pifu`."""
    with open(path, "rb") as stream:
        count = sum(piece.count(b"\n") for piece in iter(lambda: stream.read(2**20), b""))
    return {"vertices": count, "order": PIFU_ORDER, "bytes": os.path.getsize(path)}


def read_baked_facts(path: str | os.PathLike[str]) -> dict[str, Any] | None:
    """Return what .glb and .ply that `WRITERS` wrote say of their transfer; None of other files."""
    with open(path, "rb") as stream:
        start = stream.read(_MOST_HEADER)
    if found := _PLY_COMMENT.search(start.partition(b"end_header")[0]):
        return {"order": int(found[1]), "bounces": int(found[2])}
    try:
        (length,) = struct.unpack_from("<I", start, 12)
        (mesh,) = parse_json(start[20 : 20 + length].decode())["meshes"]
        return dict(mesh["extras"]["shrm:transfer"])
    except (struct.error, ValueError, TypeError, KeyError):
        return None


def _texels(archive: npz.Archive) -> Texels:
    """Read a texture.

    Raises ValueError if it is not sound.
    """
    rows = archive.integers("rows", 2)
    corners, positions = archive.numbers("texcoords", 3), archive.numbers("positions", 2)
    shapes = corners.shape[1:], positions.shape[1:]
    if min(rows.shape) < 2 or rows.min() < -1 or shapes != ((3, 2), (3,)):
        raise ValueError("its texture is wrong")
    if not (np.isfinite(corners).all() and np.isfinite(positions).all()):
        raise ValueError("its texture holds NaN or infinite values")
    return Texels(rows, np.clip(corners, 0, 1), positions.astype(float))


def is_transfer(path: str | os.PathLike[str]) -> bool:
    """Tell whether a file holds a transfer; whether it is sound, reading it tells."""
    return npz.holds(path, {"vectors", "albedo", "settings"})


def _check(arrays: dict[str, Array]) -> None:
    """Check what the shapes of a `Transfer` do not tell."""
    for name, array in arrays.items():
        flat = array.reshape(-1)
        if not all(np.isfinite(flat[part]).all() for part in slices(len(flat), _AT_ONCE)):
            raise ValueError(f"{name} holds NaN or infinite values")
    vectors, albedo, frames = (arrays.get(name) for name in ("vectors", "albedo", "frames"))
    if vectors is None or not 0 < vectors.shape[1] <= (MAX_TRANSFER_ORDER + 1) ** 2:
        raise ValueError("its order is out of range")
    if not vectors.size:
        raise ValueError("it has no vertices")
    if albedo is None or albedo.min(initial=0) < 0 or albedo.max(initial=0) > 1:
        raise ValueError("its albedo is outside 0 .. 1")
    if frames is not None:
        if frames.shape[1:] != (3, 3):
            raise ValueError(f"frames of shape {frames.shape}")
        for some in slices(len(frames), _AT_ONCE // 9):
            part = frames[some]
            if np.abs(part @ np.swapaxes(part, 1, 2) - np.eye(3)).max(initial=0) > _ROUNDING:
                raise ValueError("its frames are not orthonormal")


def _facts(held: Any) -> Facts:
    """Return the facts of a JSON object.

    Raises ValueError if they are not sound.
    """
    if not isinstance(held, dict):
        raise ValueError("its settings are not a JSON object")
    version = held.get("version")
    if isinstance(version, int) and version > _VERSION:
        raise ValueError(f"written by a newer shrm (transfer format {version})")
    texts = [held.get(name) for name in ("mesh", "mesh_sha256")]
    brdf = held.get("brdf", "")
    numbers = [held.get(name) for name in ("bounces", "samples")]
    sound = all(isinstance(text, str) for text in (*texts, brdf))
    if not sound or not all(type(number) is int and number >= 0 for number in numbers):
        raise ValueError(f"its settings are wrong: {json.dumps(held)[:80]}")
    (mesh, digest), (bounces, count) = texts, numbers
    return Facts(mesh, digest, bounces, count, brdf)  # type: ignore[arg-type]


# ---- formats of other programs -------------------------------------------------------------------


Writer = Callable[[str | os.PathLike[str], Mesh, Transfer], None]

PIFU_ORDER = 2
"""The order of PIFu's files."""
FACES = "face.npy"
"""The name of the file of triangles beside a file of PIFu's."""

_MOST_GLB = 2**32 - 1
_FLOAT, _UNSIGNED = 5126, 5125
_VERTICES, _INDICES = 34962, 34963
"""glTF's numbers for component types and for what a part of the buffer is."""


def write_glb(path: str | os.PathLike[str], mesh: Mesh, transfer: Transfer) -> None:
    """Write a mesh with transfer vectors as binary glTF 2, whole or not at all."""
    attributes = {
        "POSITION": mesh.vertices,
        "NORMAL": mesh.normals,
        **{f"_TRANSFER_{k}": part for k, part in enumerate(_gltf_parts(transfer.vectors))},
        "_VERTEX": mesh.file_vertices[:, None],
    }
    arrays = [np.ascontiguousarray(part, "<f4") for part in attributes.values()]
    arrays.append(np.ascontiguousarray(mesh.faces, "<u4").reshape(-1, 1))
    starts = np.cumsum([0] + [array.nbytes for array in arrays])
    if starts[-1] > _MOST_GLB // 2:
        raise OutputError(f"{path}: {starts[-1]:,} bytes are more than a .glb holds; write .npz")
    low, high = (getattr(arrays[0], which)(axis=0).tolist() for which in ("min", "max"))
    content = {
        "asset": {"version": "2.0", "generator": "shrm"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [
            {
                "primitives": [
                    {
                        "attributes": {name: k for k, name in enumerate(attributes)},
                        "indices": len(attributes),
                    }
                ],
                "extras": {"shrm:transfer": transfer.summary()},
            }
        ],
        "buffers": [{"byteLength": int(starts[-1])}],
        "bufferViews": [
            {
                "buffer": 0,
                "byteOffset": int(start),
                "byteLength": array.nbytes,
                "target": _INDICES if array.dtype == "<u4" else _VERTICES,
            }
            for start, array in zip(starts[:-1], arrays, strict=True)
        ],
        "accessors": [_accessor(k, array) for k, array in enumerate(arrays)],
    }
    content["accessors"][0] |= {"min": low, "max": high}  # type: ignore[index]
    text = json.dumps(content, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    length = 12 + 8 + len(text) + 8 + int(starts[-1])
    with replacing(path) as temporary, open(temporary, "wb") as stream:
        stream.write(struct.pack("<4sII", b"glTF", 2, length))
        stream.write(struct.pack("<I4s", len(text), b"JSON") + text)
        stream.write(struct.pack("<I4s", int(starts[-1]), b"BIN\0"))
        for array in arrays:
            stream.write(array.data)


def write_ply(path: str | os.PathLike[str], mesh: Mesh, transfer: Transfer) -> None:
    """Write a mesh with transfer vectors as binary PLY, whole or not at all."""
    count, size, channels = transfer.vectors.shape
    colors = [""] if channels == 1 else ["_r", "_g", "_b"]
    names = [*("x", "y", "z", "nx", "ny", "nz")]
    names += [f"transfer_{k:03d}{color}" for k in range(size) for color in colors]
    flat = transfer.vectors.reshape(count, -1)
    faces = np.empty(len(mesh.faces), [("count", "u1"), ("corners", "<i4", 3)])
    faces["count"], faces["corners"] = 3, mesh.faces
    header = [
        "ply",
        "format binary_little_endian 1.0",
        _COMMENT.format(transfer.order, transfer.facts.bounces),
        f"element vertex {count}",
        *(f"property float {name}" for name in names),
        "property int file_vertex",
        f"element face {len(mesh.faces)}",
        "property list uchar int vertex_indices",
        "end_header",
    ]
    with replacing(path) as temporary, open(temporary, "wb") as stream:
        stream.write("\n".join(header).encode() + b"\n")
        rows = np.empty(count, [("numbers", "<f4", len(names)), ("vertex", "<i4")])
        rows["numbers"] = np.hstack([mesh.vertices, mesh.normals, flat])
        rows["vertex"] = mesh.file_vertices
        stream.write(rows.data)
        stream.write(faces.data)


def write_pifu(path: str | os.PathLike[str], mesh: Mesh, transfer: Transfer) -> None:
    """Write the first 9 coefficients as PIFu does, and the triangles beside them."""
    columns = (PIFU_ORDER + 1) ** 2
    if transfer.order < PIFU_ORDER or transfer.vectors.shape[2] != 1:
        raise OutputError(f"{path}: PIFu's files hold grey transfer of order 2; write .npz")
    is_there = mesh.file_rows >= 0
    lines = np.zeros((len(is_there), columns))
    lines[is_there] = transfer.vectors[mesh.file_rows[is_there], :columns, 0]
    with together():
        with replacing(path) as temporary, open(temporary, "w") as stream:
            np.savetxt(stream, lines, fmt="%.8f")
        beside = Path(path).with_name(FACES)
        with replacing(beside) as temporary, open(temporary, "wb") as stream:
            npy.write_array(stream, mesh.file_vertices[mesh.faces], allow_pickle=False)


WRITERS: dict[str, Writer] = {".glb": write_glb, ".ply": write_ply, ".txt": write_pifu}
"""What writes files of each suffix."""


def _gltf_parts(vectors: Array) -> list[Array]:
    count, size, channels = vectors.shape
    if channels == 3:
        return [vectors[:, k] for k in range(size)]
    filled = np.zeros((count, -(-size // 4) * 4), np.float32)
    filled[:, :size] = vectors[..., 0]
    return np.split(filled, filled.shape[1] // 4, axis=1)


def _accessor(view: int, array: NDArray[Any]) -> dict[str, Any]:
    kinds = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}
    return {
        "bufferView": view,
        "componentType": _UNSIGNED if array.dtype == "<u4" else _FLOAT,
        "count": len(array),
        "type": kinds[array.shape[1]],
    }
