"""Grids of probes that exist already: a table of positions and files."""

import csv
import os
from pathlib import Path

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.errors import MeshError
from shrm_cli.files.whole import note
from shrm_cli.probe.lighting import project
from shrm_cli.probe.open import open_probe
from shrm_cli.progress import Progress
from shrm_cli.rooms.grid import Lattice, ProbeGrid

_MOST_ROWS = 2**16
_MOST_BYTES = 2**24
_EVEN = 1e-3
"""How far positions may be from even rows, in spacings."""
_COLUMNS = ("x", "y", "z", "file")


def read_positions(
    path: str | os.PathLike[str], order: int, progress: Progress | None = None
) -> ProbeGrid:
    """Read a table of probes, and project each of them.

    Parameters
    ----------
    path : path-like
        CSV with the columns x, y, z and file; files are named relative to its folder.
    order : int
        The largest degree of the harmonics.

    Returns
    -------
    ProbeGrid
        What it holds counts as reflected. Of walls it knows nothing.

    Raises MeshError if it is no such table, or its positions are not all points of a lattice.
    Raises ProbeError if a probe cannot be read.
    """
    path = Path(path)
    note(path)
    points, names = _rows(path)
    lattice, places = _lattice(path, points)
    light = np.zeros((lattice.count, (order + 1) ** 2, 3), np.float32)
    for done, (place, name) in enumerate(zip(places, names, strict=True), 1):
        light[place] = project(open_probe(path.parent / name), order).coefficients
        if progress is not None:
            progress(done, len(names))
    alive = np.ones(lattice.count, bool)
    return ProbeGrid(lattice, light, np.zeros_like(light), None, alive)


def _rows(path: Path) -> tuple[Array, list[str]]:
    try:
        if path.stat().st_size > _MOST_BYTES:
            raise MeshError(f"{path}: more than {_MOST_BYTES:,} bytes are no table of probes")
        with open(path, newline="", encoding="utf-8") as stream:
            table = csv.DictReader(stream)
            if not set(_COLUMNS) <= set(table.fieldnames or ()):
                raise MeshError(f"{path}: no table with the columns {', '.join(_COLUMNS)}")
            rows = list(table)
    except OSError as error:
        raise MeshError(f"{path}: cannot be read ({error.strerror})") from error
    except (UnicodeDecodeError, csv.Error) as error:
        raise MeshError(f"{path}: no table as CSV ({error}); export it anew") from error
    if not 1 <= len(rows) <= _MOST_ROWS:
        raise MeshError(f"{path}: has {len(rows):,} rows, but must have 1 .. {_MOST_ROWS:,}")
    points, names = [], []
    for number, row in enumerate(rows, 2):
        try:
            point = [float(row[axis]) for axis in "xyz"]
        except (TypeError, ValueError):
            raise MeshError(f"{path}: line {number} has no three numbers x, y, z") from None
        if not np.isfinite(point).all() or not row["file"]:
            raise MeshError(f"{path}: line {number} has no position or no file")
        points.append(point)
        names.append(row["file"])
    return np.array(points), names


def _lattice(path: Path, points: Array) -> tuple[Lattice, Array]:
    """Return the lattice that points are all of, and the number of each in it."""
    low, high = points.min(axis=0), points.max(axis=0)
    shape, index = [], []
    for axis in range(3):
        span = high[axis] - low[axis]
        steps = np.diff(np.unique(points[:, axis]))
        least = steps[steps > _EVEN * span].min(initial=np.inf) if span > 0 else np.inf
        count = 1 if not np.isfinite(least) else round(span / least) + 1
        place = (points[:, axis] - low[axis]) / (span if span > 0 else 1) * (count - 1)
        if np.abs(place - np.round(place)).max() > _EVEN * count:
            raise MeshError(
                f"{path}: its {'xyz'[axis]} are not evenly spaced; give a whole lattice"
            )
        shape.append(count)
        index.append(np.round(place).astype(np.int64))
    places = np.ravel_multi_index(tuple(index), tuple(shape))
    if len(np.unique(places)) != int(np.prod(shape)) or len(places) != int(np.prod(shape)):
        raise MeshError(
            f"{path}: {len(points):,} positions are not the {' x '.join(map(str, shape))} of a "
            "whole lattice; give each of them once"
        )
    counts = np.array(shape)
    spacing = np.where(counts > 1, (high - low) / np.maximum(counts - 1, 1), 1.0)
    box = low - spacing / 2, high + spacing / 2
    return Lattice(box[0], box[1], (shape[0], shape[1], shape[2])), places
