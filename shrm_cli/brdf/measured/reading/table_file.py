"""Reading and writing files of `Table`: OpenEXR images, and numpy's .npz archives.

Files may come from anywhere, so all that is read from them is checked. Both kinds hold the values
over the angles (theta_h, theta_d, phi_d), the axes in radians, and settings:

OpenEXR
    The image has one part with the 32-bit float channels R, G and B. The row is the index of
    theta_h, the column is ``j * len(phi_d) + k`` for the indices j of theta_d and k of phi_d. The
    attribute ``shrm:brdf_table`` is a JSON object with the items ``version`` (1), ``axes`` (an
    object of three lists), ``center``, ``includes_cosine``, ``has_horizon`` and ``made_from``.
.npz
    The archive has the arrays ``values``, of shape (theta_h, theta_d, phi_d, 1 or 3), ``theta_h``,
    ``theta_d`` and ``phi_d``, of 32 or 64-bit floats. The array ``settings`` is one string, the
    JSON object without its axes. It may be missing; the values are those of f_r then.
"""

import json
import math
import os
import zipfile
from pathlib import Path
from typing import Any, get_args

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.brdf.measured.reading.file import check_file
from shrm_cli.brdf.measured.table import AXES, Table, TableSettings
from shrm_cli.errors import BrdfError, MapError, OutputError
from shrm_cli.files import npz
from shrm_cli.files.json_text import parse_json
from shrm_cli.files.parts import Part, peek, write_parts
from shrm_cli.files.whole import replacing
from shrm_cli.vocabulary import Center

ATTRIBUTE = "shrm:brdf_table"
TABLE_SUFFIXES = (".exr", ".npz")
MOST_CELLS = 2**24
"""The most values of a table for one channel. Three channels take 200 MB as 32-bit floats."""

_VERSION = 1
"""The version of the format that files hold; files of a later version are refused."""
_ENDS = {"theta_h": math.pi, "theta_d": math.pi / 2, "phi_d": math.pi}
"""The ends of the axes, radians; all axes begin at 0."""
_ROUNDING = 1e-6
"""How far an axis may exceed its range by rounding, radians."""
_AGAIN = "make it again with shrm brdf --save"

Stored = tuple[Array, tuple[Array, ...], TableSettings]


def read_table(path: str | os.PathLike[str]) -> Stored:
    """Read a table, OpenEXR or .npz, whatever its name ends with.

    Parameters
    ----------
    path : path-like

    Returns
    -------
    values : ndarray, shape (theta_h, theta_d, phi_d, 1 or 3)
    axes : tuple of three ndarray
        The angles of the values, radians.
    settings : TableSettings

    Raises
    ------
    BrdfError
        If the file is missing or damaged, or holds something else.
    """
    path = check_file(path)
    try:
        return _read_npz(path) if zipfile.is_zipfile(path) else _read_exr(path)
    except OSError as error:
        raise BrdfError(f"{path}: cannot be read ({error.strerror or error})") from error


def write_table(path: str | os.PathLike[str], table: Table) -> None:
    """Write a table, whole or not at all, as OpenEXR or .npz.

    The same table gives the same bytes.

    Parameters
    ----------
    path : path-like
        The suffix, .exr or .npz, decides on the format.
    table : Table

    Raises
    ------
    OutputError
        If the name has another suffix, or the file cannot be written.
    """
    suffix = Path(path).suffix.lower()
    if suffix == ".npz":
        _write_npz(path, table)
    elif suffix == ".exr":
        _write_exr(path, table)
    else:
        raise OutputError(f"{path}: a table is written as {' or '.join(TABLE_SUFFIXES)}")


def is_table(path: str | os.PathLike[str]) -> bool:
    """Tell whether a file is an OpenEXR image or a .npz that holds a table of a BRDF.

    Whether the table is sound, reading it tells.
    """
    if not os.path.isfile(path):
        return False
    try:
        if zipfile.is_zipfile(path):
            with zipfile.ZipFile(path) as archive:
                return {f"{name}.npy" for name in ("values", *AXES)} <= set(archive.namelist())
    except (OSError, zipfile.BadZipFile, NotImplementedError):
        return False
    found = peek(path)
    return found is not None and bool(found.first.text(ATTRIBUTE))


def _write_exr(path: str | os.PathLike[str], table: Table) -> None:
    rows = table.table.shape[0]
    planes = table.table.reshape(rows, -1, table.table.shape[-1])
    channels = {name: planes[..., k % planes.shape[-1]] for k, name in enumerate("RGB")}
    axes = {name: axis.tolist() for name, axis in zip(AXES, table.axes, strict=True)}
    settings = json.dumps({**_settings_object(table.settings), "axes": axes})
    write_parts(path, [Part(channels, {ATTRIBUTE: settings})], "float")


def _write_npz(path: str | os.PathLike[str], table: Table) -> None:
    arrays: dict[str, Any] = dict(zip(AXES, table.axes, strict=True))
    arrays |= {"values": table.table, "settings": json.dumps(_settings_object(table.settings))}
    with replacing(path) as temporary, open(temporary, "wb") as stream:
        np.savez_compressed(stream, **arrays)


def _settings_object(settings: TableSettings) -> dict[str, Any]:
    """Return the JSON object of a file's settings, without the axes."""
    return {"version": _VERSION, **vars(settings)}


def _read_exr(path: Path) -> Stored:
    found = peek(path)
    if found is None:
        raise BrdfError(f"{path}: damaged or truncated; copy it, or {_AGAIN}")
    part = found.first
    text = part.text(ATTRIBUTE)
    if not text:
        raise BrdfError(f"{path}: an image, but not a table of a BRDF; shrm brdf --save makes one")
    held = _json_object(path, text)
    listed = held.pop("axes", None)
    if not isinstance(listed, dict) or not all(isinstance(listed.get(k), list) for k in AXES):
        raise BrdfError(f"{path}: its {ATTRIBUTE} lacks the axes {', '.join(AXES)}; {_AGAIN}")
    axes = tuple(_axis(path, name, listed[name]) for name in AXES)
    rows, middle, inner = (len(axis) for axis in axes)
    if (part.width, part.height) != (middle * inner, rows):
        raise BrdfError(
            f"{path}: {part.width} x {part.height} pixels do not fit its axes; {_AGAIN}"
        )
    if not part.holds("RGB"):
        raise BrdfError(f"{path}: its channels are not R, G and B; {_AGAIN}")
    _check_cells(path, part.width * part.height)
    try:
        pixels = part.read("RGB")
    except MapError:
        raise BrdfError(
            f"{path}: damaged, truncated, or holds NaN or infinite values; copy it, or {_AGAIN}"
        ) from None
    return _finite(path, pixels.reshape(rows, middle, inner, 3)), axes, _settings(path, held)


def _read_npz(path: Path) -> Stored:
    most = 3 * 8 * MOST_CELLS  # bytes of three channels of doubles
    try:
        with npz.opened(path) as archive:
            missing = [name for name in ("values", *AXES) if name not in archive.names]
            if missing:
                raise BrdfError(f"{path}: no array {missing[0]!r} in it; not a table of a BRDF")
            axes = tuple(_axis(path, name, archive.numbers(name, 1, most)) for name in AXES)
            values = archive.numbers("values", 4, most)
            text = archive.text("settings") if "settings" in archive.names else "{}"
    except ValueError as error:
        raise BrdfError(f"{path}: {error}; copy it, or {_AGAIN}") from error
    lengths = tuple(len(axis) for axis in axes)
    if values.shape not in ((*lengths, 1), (*lengths, 3)):
        raise BrdfError(f"{path}: values of shape {values.shape} do not fit its axes {lengths}")
    return _finite(path, values), axes, _settings(path, _json_object(path, text))


def _axis(path: Path, name: str, values: Any) -> Array:
    """Check that an axis consists of finite, ascending angles within its range, and return it."""
    try:
        axis = np.asarray(values, dtype=float)
    except (ValueError, TypeError, OverflowError):
        axis = np.empty(0)
    sound = axis.ndim == 1 and axis.size > 0 and bool(np.isfinite(axis).all())
    if not sound or (np.diff(axis) <= 0).any():
        raise BrdfError(f"{path}: its axis {name} is not a list of ascending numbers; {_AGAIN}")
    if axis[0] < -_ROUNDING or axis[-1] > _ENDS[name] + _ROUNDING:
        raise BrdfError(
            f"{path}: its axis {name} goes from {axis[0]:g} to {axis[-1]:g}; "
            f"give radians, 0 .. {_ENDS[name]:.6g}"
        )
    return axis


def _check_cells(path: Path, cells: int) -> None:
    if cells > MOST_CELLS:
        raise BrdfError(f"{path}: {cells:,} values are more than {MOST_CELLS:,}; thin it out")


def _finite(path: Path, values: Array) -> Array:
    _check_cells(path, math.prod(values.shape[:3]))
    if not np.isfinite(values).all() or values.max() > np.finfo(np.float32).max:
        raise BrdfError(f"{path}: holds NaN or infinite values; {_AGAIN}")
    return values


def _json_object(path: Path, text: str) -> dict[str, Any]:
    try:
        value = parse_json(text)
    except ValueError:
        value = None
    if not isinstance(value, dict):
        raise BrdfError(f"{path}: its settings are not a JSON object; {_AGAIN}")
    return value


def _settings(path: Path, held: dict[str, Any]) -> TableSettings:
    version = held.get("version", _VERSION)
    if isinstance(version, int) and version > _VERSION:
        raise BrdfError(f"{path}: written by a newer shrm (table format {version}); update shrm")
    center = held.get("center", "reflection")
    flags = [held.get("includes_cosine", False), held.get("has_horizon", True)]
    made_from = held.get("made_from", "")
    sound = center in get_args(Center) and all(isinstance(flag, bool) for flag in flags)
    if not sound or not isinstance(made_from, str):
        raise BrdfError(f"{path}: its settings are wrong: {json.dumps(held)[:80]}; {_AGAIN}")
    return TableSettings(center, flags[0], flags[1], made_from)
