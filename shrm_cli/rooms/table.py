"""Tables of probes that exist already: where each of them is, and its file."""

import csv
import os
import warnings
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.errors import MeshError, ShrmWarning
from shrm_cli.files.json_text import read_toml
from shrm_cli.files.whole import check_regular, note
from shrm_cli.probe.image_file import is_stage
from shrm_cli.probe.light_file import stays_below
from shrm_cli.probe.lighting import project
from shrm_cli.probe.open import open_probe
from shrm_cli.probe.probe import Probe
from shrm_cli.progress import Progress, tell
from shrm_cli.rooms.grid import Lattice, ProbeGrid, color_facts

_MOST_ROWS = 2**16
_MOST_BYTES = 2**24
_TOO_LARGE = f"more than {_MOST_BYTES:,} bytes are no table of probes"
_TOLD = 4
"""The most warnings about the pixels of its probes."""
_EVEN = 1e-3
"""How far positions may be from even rows, in spacings."""
_COLUMNS = ("x", "y", "z", "file")


def is_table(name: str) -> bool:
    """Whether a file is a table of positions and probes, by its suffix."""
    return name.lower().endswith((".csv", ".toml")) or is_stage(name)


def read_positions(
    path: str | os.PathLike[str], order: int, progress: Progress | None = None
) -> ProbeGrid:
    """Read a table of probes, and project each of them.

    `path` is CSV with the columns x, y, z and file; TOML whose tables ``[[probe]]`` have ``file``
    and ``at``, three numbers; or a stage of USD, each of whose dome lights is the light of the
    place where it stands. Files are named relative to its folder.

    What the grid holds counts as reflected. Of walls it knows nothing. Probes of other primaries
    than those of the first one are converted to them.
    """
    path = Path(path)
    note(path)
    points, opening = _domes(path) if is_stage(path.name) else _rows(path)
    lattice, places = _lattice_of(path, points)
    light = np.zeros((lattice.count, (order + 1) ** 2, 3), np.float32)
    colors, told = opening[0]().chromaticities, list[str]()
    for done, (place, opened) in enumerate(zip(places, opening, strict=True), 1):
        probe = opened()
        light[place] = project(probe.in_primaries(colors), order).coefficients
        told += probe.warnings()
        tell(progress, done, len(opening))
    if len(told) > _TOLD:
        told[_TOLD:] = [f"{path}: {len(told) - _TOLD:,} more lines like these about its probes"]
    for line in told:
        warnings.warn(line, ShrmWarning, stacklevel=2)
    alive = np.ones(lattice.count, bool)
    return ProbeGrid(lattice, light, np.zeros_like(light), None, alive, color_facts(colors))


Opening = list[Callable[[], Probe]]
"""What opens each probe of a table."""


def _domes(path: Path) -> tuple[Array, Opening]:
    """Return where the dome lights of a stage are, shape (n, 3), and what opens their probes."""
    from shrm_cli.probe.usd import open_domes

    found = open_domes(str(path), open_probe)
    if not found:
        raise MeshError(f"{path}: no table of probes; put a DomeLight where each of them was")
    return np.array([place for place, _ in found]), [partial(_itself, each) for _, each in found]


def _itself(probe: Probe) -> Probe:
    return probe


def _rows(path: Path) -> tuple[Array, Opening]:
    """Return the positions of a table, shape (n, 3), and what opens their probes."""
    rows = _csv_rows(path) if path.suffix.lower() == ".csv" else _toml_rows(path)
    if not 1 <= len(rows) <= _MOST_ROWS:
        raise MeshError(f"{path}: has {len(rows):,} rows, but must have 1 .. {_MOST_ROWS:,}")
    points = []
    opening: Opening = []
    for where, place, file in rows:
        try:
            point = [float(each) for each in place]
        except (TypeError, ValueError, OverflowError):
            point = []
        if len(point) != 3:
            raise MeshError(f"{path}: {where} has no three numbers x, y, z")
        if not np.isfinite(point).all() or not isinstance(file, str) or not file:
            raise MeshError(f"{path}: {where} has no position or no file")
        if not stays_below(file, path.parent):
            raise MeshError(
                f"{path}: {where}: {file!r:.100} leaves the table's folder; put the probe into it"
            )
        points.append(point)
        opening.append(partial(open_probe, path.parent / file))
    return np.array(points), opening


_Row = tuple[str, Sequence[Any], Any]
"""What a row is called, where its probe is, and its file, unchecked."""


def _csv_rows(path: Path) -> list[_Row]:
    try:
        if check_regular(path, MeshError, "a table", "check its name").st_size > _MOST_BYTES:
            raise MeshError(f"{path}: {_TOO_LARGE}")
        with open(path, newline="", encoding="utf-8-sig") as stream:
            table = csv.DictReader(stream, skipinitialspace=True)
            if not set(_COLUMNS) <= set(table.fieldnames or ()):
                raise MeshError(f"{path}: no table with the columns {', '.join(_COLUMNS)}")
            return [
                (f"line {number}", [row[axis] for axis in "xyz"], row["file"])
                for number, row in enumerate(table, 2)
            ]
    except OSError as error:
        raise MeshError(f"{path}: cannot be read ({error.strerror})") from error
    except (UnicodeDecodeError, csv.Error) as error:
        raise MeshError(f"{path}: no table as CSV ({error}); export it anew") from error


def _toml_rows(path: Path) -> list[_Row]:
    found, _ = read_toml(path, "a table of probes", _MOST_BYTES, _TOO_LARGE, MeshError)
    probes = found.get("probe")
    if set(found) != {"probe"} or not isinstance(probes, list):
        raise MeshError(f"{path}: no table of probes; give [[probe]] alone, with 'file' and 'at'")
    rows: list[_Row] = []
    for number, each in enumerate(probes, 1):
        if not isinstance(each, dict) or set(each) != {"file", "at"}:
            raise MeshError(f"{path}: probe {number} must have 'file' and 'at', and no other key")
        place = each["at"] if isinstance(each["at"], list) else ()
        rows.append((f"probe {number}", place, each["file"]))
    return rows


def _lattice_of(path: Path, points: Array) -> tuple[Lattice, Array]:
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
