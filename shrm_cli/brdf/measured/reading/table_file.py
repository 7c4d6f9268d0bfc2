"""Files of `Table`: OpenEXR images, and numpy's .npz archives. Neither is trusted.

Both hold the values over the angles (theta_h, theta_d, phi_d), the axes in radians and settings:

OpenEXR
    One part, 32-bit float channels R, G, B; row theta_h, column ``theta_d * len(phi_d) + phi_d``.
    The attribute ``shrm:brdf_table`` is a JSON object: ``version`` (1), ``axes`` (an object of
    three lists), ``center``, ``includes_cosine``, ``has_horizon``, ``made_from``.
.npz
    Arrays ``values`` (theta_h, theta_d, phi_d, 1 or 3), ``theta_h``, ``theta_d``, ``phi_d``, of
    32 or 64-bit floats, and ``settings``, the JSON object without its axes as one string, which
    may be missing: values are f_r then.
"""

import json
import math
import os
import zipfile
import zlib
from contextlib import suppress
from pathlib import Path
from typing import Any, get_args

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from shrm_cli.brdf.base import Array
from shrm_cli.brdf.measured.reading.file import check_file
from shrm_cli.brdf.measured.table import AXES, Table, TableSettings
from shrm_cli.errors import BrdfError
from shrm_cli.files.whole import replacing
from shrm_cli.vocabulary import Center

ATTRIBUTE = "shrm:brdf_table"
MOST_CELLS = 2**24
"""Of a table: 200 MB in memory."""

_VERSION = 1
_MOST_SETTINGS = 2**20
_ENDS = {"theta_h": math.pi, "theta_d": math.pi / 2, "phi_d": math.pi}
_ROUNDING = 1e-6
_AGAIN = "make it again with shrm brdf --save"

Stored = tuple[Array, tuple[Array, ...], TableSettings]


def read_table(path: str | os.PathLike[str]) -> Stored:
    """Values, shape (theta_h, theta_d, phi_d, 1 or 3), axes (radians) and settings of a table.

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


def write_npz(path: str | os.PathLike[str], table: Table) -> None:
    """Write a table as .npz, whole or not at all; the same table gives the same bytes.

    Raises
    ------
    OutputError
    """
    arrays: dict[str, Any] = dict(zip(AXES, table.axes, strict=True))
    arrays |= {"values": table.table, "settings": json.dumps(settings_object(table.settings))}
    with replacing(path) as temporary, open(temporary, "wb") as stream:
        np.savez_compressed(stream, **arrays)


def settings_object(settings: TableSettings) -> dict[str, Any]:
    """Settings as the JSON of a file, but for the axes."""
    return {"version": _VERSION, **vars(settings)}


def _read_exr(path: Path) -> Stored:
    import OpenImageIO as oiio

    source = oiio.ImageInput.open(str(path))
    if source is None:
        with suppress(UnicodeDecodeError):  # it quotes the file's bytes
            oiio.geterror()  # or it is printed when the process ends
        raise BrdfError(f"{path}: damaged or truncated; copy it, or {_AGAIN}")
    spec = source.spec()
    text = spec.get_string_attribute(ATTRIBUTE)
    if not text:
        raise BrdfError(f"{path}: an image, but not a table of a BRDF; shrm brdf --save makes one")
    held = _json_object(path, text)
    listed = held.pop("axes", None)
    if not isinstance(listed, dict) or not all(isinstance(listed.get(k), list) for k in AXES):
        raise BrdfError(f"{path}: its {ATTRIBUTE} lacks the axes {', '.join(AXES)}; {_AGAIN}")
    axes = tuple(_axis(path, name, listed[name]) for name in AXES)
    rows, middle, inner = (len(axis) for axis in axes)
    if (spec.width, spec.height) != (middle * inner, rows) or spec.deep:
        raise BrdfError(
            f"{path}: {spec.width} x {spec.height} pixels do not fit its axes; {_AGAIN}"
        )
    if tuple(spec.channelnames) != ("R", "G", "B"):
        raise BrdfError(f"{path}: its channels are not R, G and B; {_AGAIN}")
    _check_cells(path, spec.width * spec.height)
    pixels = source.read_image(0, 0, 0, 3, oiio.FLOAT)
    if pixels is None:
        with suppress(UnicodeDecodeError):
            source.geterror()
        raise BrdfError(f"{path}: damaged or truncated; copy it, or {_AGAIN}")
    values = np.asarray(pixels).reshape(rows, middle, inner, 3)
    return _finite(path, values), axes, _settings(path, held)


def _read_npz(path: Path) -> Stored:
    try:
        with zipfile.ZipFile(path) as archive:
            # Sizes come from the archive's directory: nothing is unpacked before they are checked.
            members = {info.filename: info for info in archive.infolist()}
            missing = [name for name in ("values", *AXES) if f"{name}.npy" not in members]
            if missing:
                raise BrdfError(f"{path}: no array {missing[0]!r} in it; not a table of a BRDF")
            axes = tuple(
                _axis(path, name, _array(path, archive, members[f"{name}.npy"], 1)) for name in AXES
            )
            values = _array(path, archive, members["values.npy"], 4)
            text = "{}"
            if "settings.npy" in members:
                text = str(_array(path, archive, members["settings.npy"], 0, kind="U"))
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError) as error:
        raise BrdfError(f"{path}: damaged or truncated; copy it, or {_AGAIN}") from error
    lengths = tuple(len(axis) for axis in axes)
    if values.shape not in ((*lengths, 1), (*lengths, 3)):
        raise BrdfError(f"{path}: values of shape {values.shape} do not fit its axes {lengths}")
    return _finite(path, values), axes, _settings(path, _json_object(path, text))


def _array(
    path: Path, archive: zipfile.ZipFile, info: zipfile.ZipInfo, dimensions: int, kind: str = "f"
) -> NDArray[Any]:
    """An array of an archive, of floats or text, whose size is checked before it is unpacked."""
    name = info.filename
    if info.file_size > (_MOST_SETTINGS if kind == "U" else 3 * 8 * MOST_CELLS + _MOST_SETTINGS):
        raise BrdfError(f"{path}: {name} unpacks to {info.file_size:,} bytes, which is too much")
    with archive.open(info) as stream:
        shape, fortran, dtype = _npy_header(path, name, stream)
        sizes = (4, 8) if kind == "f" else range(4, _MOST_SETTINGS)
        if dtype.kind != kind or dtype.itemsize not in sizes or len(shape) != dimensions:
            raise BrdfError(f"{path}: {name} holds {dtype} of shape {shape}, which is wrong")
        expected = math.prod(shape) * dtype.itemsize
        data = stream.read(min(expected, info.file_size) + 1)
    if len(data) != expected:
        raise BrdfError(f"{path}: {name} is truncated; copy it, or {_AGAIN}")
    return np.frombuffer(data, dtype).reshape(shape, order="F" if fortran else "C")


def _npy_header(path: Path, name: str, stream: Any) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    readers = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}
    try:
        found: tuple[tuple[int, ...], bool, np.dtype[Any]]
        found = readers[npy.read_magic(stream)](stream)
    except (KeyError, ValueError, SyntaxError, RecursionError, MemoryError, TypeError) as error:
        raise BrdfError(f"{path}: {name} is not an array of numpy's; {_AGAIN}") from error
    return found


def _axis(path: Path, name: str, values: Any) -> Array:
    """An axis of finite, ascending angles within its range."""
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
        value = json.loads(text)
    except (ValueError, RecursionError):
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
