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
"""

import json
import os
from pathlib import Path
from typing import Any

import numpy as np

from shrm_cli.arrays import Array, slices
from shrm_cli.errors import TransferError
from shrm_cli.files import npz
from shrm_cli.files.json_text import parse_json
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


def write_transfer(
    path: str | os.PathLike[str], transfer: Transfer, mesh: Mesh | None = None
) -> None:
    """Write a transfer, whole or not at all; the same transfer gives the same bytes.

    `mesh` is the mesh of the transfer, which tells which row is which vertex of its file. Raises
    OutputError if the file cannot be written.
    """
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
    """Read a transfer.

    Raises TransferError if the file is missing or damaged, or holds something else.
    """
    missing = "name a transfer that shrm transfer wrote"
    with npz.told(Path(path), TransferError, missing, _AGAIN) as archive:
        arrays = archive.those_of(_DIMENSIONS)
        texels = _texels(archive) if "rows" in archive.names else None
        facts = _facts(parse_json(archive.text("settings")))
        if "vectors" not in arrays or "albedo" not in arrays:
            raise ValueError("not a transfer")
        _check(arrays)
        return Transfer(facts=facts, texels=texels, **arrays)


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
