"""Files of probe grids: numpy's .npz archives, which may come from anywhere.

An archive holds the arrays ``reflected``, ``direct``, ``alive`` (1 or 0) and, where walls are
known, ``moments`` of a `ProbeGrid`, the corners of the box as ``box`` (2 x 3), and ``settings``:
one text, a JSON object with ``version`` (1), ``shape`` and ``facts``. docs/grid.md has it all.
"""

import json
import os
from pathlib import Path
from typing import Any

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.errors import MeshError
from shrm_cli.files import npz
from shrm_cli.files.json_text import parse_json
from shrm_cli.rooms.grid import EDGE, MOST, Lattice, ProbeGrid
from shrm_cli.vocabulary import MAX_GRID_ORDER

_VERSION = 1
_DIMENSIONS = {"reflected": 3, "direct": 3, "alive": 1, "moments": 3, "box": 2}


def write_grid(path: str | os.PathLike[str], grid: ProbeGrid) -> None:
    """Write a grid, whole or not at all; the same grid gives the same bytes.

    Raises OutputError if the file cannot be written.
    """
    lattice = grid.lattice
    arrays: dict[str, Any] = {
        "reflected": grid.reflected.astype("<f4"),
        "direct": grid.direct.astype("<f4"),
        "alive": grid.alive.astype("<f4"),
        "box": np.stack([lattice.low, lattice.high]).astype("<f8"),
    }
    if grid.moments is not None:
        arrays["moments"] = grid.moments.astype("<f4")
    settings = {"version": _VERSION, "shape": list(lattice.shape), "facts": dict(grid.facts)}
    npz.write_npz(path, {**arrays, "settings": json.dumps(settings)})


def is_grid(path: str | os.PathLike[str]) -> bool:
    """Tell whether a file holds a grid; whether it is sound, reading it tells."""
    return npz.holds(path, {"reflected", "direct", "box", "settings"})


def read_grid(path: str | os.PathLike[str]) -> ProbeGrid:
    """Read a grid.

    Raises MeshError if the file is missing or damaged, or holds something else.
    """
    missing, again = "name a grid that shrm grid wrote", "make it again with shrm grid"
    with npz.told(Path(path), MeshError, missing, again) as archive:
        return _grid(archive.those_of(_DIMENSIONS), parse_json(archive.text("settings")))


def _grid(arrays: dict[str, Array], settings: object) -> ProbeGrid:
    """Return a grid whose arrays fit each other."""
    if not isinstance(settings, dict) or not isinstance(settings.get("facts"), dict):
        raise ValueError("its settings are not those of a grid")
    version, shape = settings.get("version"), settings.get("shape")
    if isinstance(version, int) and version > _VERSION:
        raise ValueError(f"written by a newer shrm (grid format {version})")
    if not isinstance(shape, list) or len(shape) != 3:
        raise ValueError("its shape is wrong")
    if not all(type(each) is int and 1 <= each <= MOST for each in shape):
        raise ValueError("its shape is wrong")
    for name, array in arrays.items():
        if not np.isfinite(array).all():
            raise ValueError(f"{name} holds NaN or infinite values")
    box = arrays["box"]
    if box.shape != (2, 3) or not (box[1] > box[0]).all():
        raise ValueError("its box is wrong")
    lattice = Lattice(box[0], box[1], (shape[0], shape[1], shape[2]))
    count, order = lattice.count, round(np.sqrt(arrays["reflected"].shape[1])) - 1
    if count > MOST or not 1 <= order <= MAX_GRID_ORDER:
        raise ValueError("its size or its order is out of range")
    expected = {
        "reflected": (count, (order + 1) ** 2, 3),
        "direct": (count, (order + 1) ** 2, 3),
        "alive": (count,),
        "moments": (count, EDGE**2, 2),
    }
    for name, wanted in expected.items():
        if name in arrays and arrays[name].shape != wanted:
            raise ValueError(f"{name} of shape {arrays[name].shape} in a grid of {shape}")
    return ProbeGrid(
        lattice, arrays["reflected"], arrays["direct"], arrays.get("moments"),
        arrays["alive"] > 0.5, settings["facts"],
    )  # fmt: skip
