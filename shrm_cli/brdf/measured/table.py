"""BRDFs as tables over half and difference angles: the format of `shrm` itself.

The coordinates are Rusinkiewicz's: the angle theta_h of the half vector h = (L + V) / |L + V| from
the normal, the angle theta_d between the light and h, and the azimuth phi_d of the light about h,
0 in the plane of h and the normal on the side away from the normal. A glossy lobe lies along
theta_h = 0 for every view, so an axis that is dense there resolves it. Over incoming and outgoing
angles the same lobe is a diagonal ridge, which interpolation turns into a row of bumps. BRDFs here
are isotropic and mirror-symmetric, so that phi_d runs from 0 to pi; reciprocity is not assumed.

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

References: Rusinkiewicz 1998, A New Change of Variables for Efficient BRDF Representation. Matusik
et al. 2003, A Data-Driven Reflectance Model (the square-root spacing of theta_h).
"""

import hashlib
import json
import math
import os
import zipfile
from pathlib import Path
from typing import Any, get_args

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Brdf, check_finite
from shrm_cli.brdf.lobe import cuts_horizon
from shrm_cli.brdf.measured import MeasuredBrdf
from shrm_cli.brdf.measured.reading.file import check_file, file_values
from shrm_cli.brdf.vectors import from_half_angles, half_angles, interpolated_along
from shrm_cli.errors import BrdfError, MapError, OutputError
from shrm_cli.files import npz
from shrm_cli.files.json_text import parse_json
from shrm_cli.files.parts import Part, StoredPart, peek, write_parts
from shrm_cli.files.whole import replacing
from shrm_cli.records import record
from shrm_cli.vocabulary import Center

AXES = ("theta_h", "theta_d", "phi_d")
SHAPE = (128, 72, 64)
"""The shape of the tables that `sample_table` makes, 7.1 MB as 32-bit RGB."""

_EXR = b"\x76\x2f\x31\x01"
_ZIP = b"PK\x03\x04"
_LOWEST = np.sin(np.radians(0.5))  # the cosine of directions that are raised to the horizon
_TINY = 1e-12


@record
class TableSettings:
    """What a table's values mean."""

    center: Center = "reflection"
    includes_cosine: bool = False
    has_horizon: bool = True
    """`includes_cosine` and `has_horizon`: the attributes of that name of a `Brdf`."""
    made_from: str = ""
    """What the table was computed from; empty if it is not known."""


_ORDINARY = TableSettings()


class Table(MeasuredBrdf):
    """A BRDF that is interpolated linearly in each of the three angles.

    `table`, of shape (theta_h, theta_d, phi_d, 1 or 3), are values of f_r (1/sr), or of rho_hat
    where the settings say so; they are not negative. `axes` are the angles of the values, radians,
    ascending. Beyond the ends of an axis the values at its ends go on.
    """

    name = "table"
    summary = "a table over half and difference angles"
    source = "a file"
    reads = "tables that shrm brdf --save wrote, .exr or .npz"
    suffixes = (".exr", ".npz")

    def __init__(
        self,
        table: Array,
        axes: tuple[Array, ...],
        settings: TableSettings = _ORDINARY,
        values: dict[str, str] | None = None,
    ) -> None:
        lengths = tuple(len(axis) for axis in axes)
        if table.shape not in ((*lengths, 1), (*lengths, 3)):
            raise ValueError(f"a table of shape {table.shape} over its axes")
        table = np.maximum(table, 0, dtype=np.float32)  # negative values are noise
        is_grey = bool((table == table[..., :1]).all())
        self.table = np.ascontiguousarray(table[..., :1] if is_grey else table)
        self.axes = axes
        self.settings = settings
        self.center = settings.center
        self.includes_cosine = settings.includes_cosine
        self.has_horizon = settings.has_horizon
        size = " x ".join(str(n) for n in table.shape[:3])
        self.summary = f"{self.summary}, {size}"
        if settings.made_from:
            self.source = f"made from {settings.made_from}"
        self.values = {**(values or {"sha256": self._digest()})}

    @staticmethod
    def recognizes(head: bytes) -> bool:
        # Any OpenEXR or zip file may be a table, and opening it tells.
        return head.startswith((_EXR, _ZIP))

    @classmethod
    def open(cls, path: str | os.PathLike[str]) -> "Table":
        """Read a table from OpenEXR or .npz."""
        values = file_values(path)
        return cls(*read_table(path), values)

    def __repr__(self) -> str:
        file = self.values.get("file")
        return str(file) if file else f"table of {self.settings.made_from or 'values'}"

    def evaluate(self, light: Array, view: Array) -> Array:
        value = self._interpolate(self._angles(light, view))
        value = value.astype(np.result_type(light, view), copy=False)
        if cuts_horizon(self):
            value = value * ((light[..., 2] > 0) & (view[..., 2] > 0))[..., None]
        return np.broadcast_to(value, (*value.shape[:-1], 3))

    @staticmethod
    def _angles(light: Array, view: Array) -> tuple[Array, Array, Array]:
        """Half angles with phi_d folded to 0 .. pi, as the mirror symmetry of the BRDF allows."""
        theta_h, theta_d, phi_d = half_angles(light, view)
        return theta_h, theta_d, np.abs(phi_d)

    def _interpolate(self, angles: tuple[Array, Array, Array]) -> Array:
        """Interpolate values at angles of shape (...); the result has the shape (..., 1 or 3)."""
        axes = []
        _, theta_d, phi_d, channels = self.table.shape
        strides = theta_d * phi_d, phi_d, 1
        for angle, axis, stride in zip(angles, self.axes, strides, strict=True):
            count = len(axis)
            position = np.interp(angle, axis, np.arange(count)).astype(np.float32)
            low = np.clip(position.astype(np.int32), 0, max(count - 2, 0))
            axes.append((low * stride, stride if count > 1 else 0, position - low))
        return interpolated_along(self.table.reshape(-1, channels), axes)

    def _digest(self) -> str:
        digest = hashlib.sha256(repr(self.settings).encode())
        for array in (self.table, *self.axes):
            digest.update(repr(array.shape).encode() + np.ascontiguousarray(array).tobytes())
        return digest.hexdigest()


def sample_table(brdf: Brdf, shape: tuple[int, int, int] = SHAPE) -> Table:
    """Sample another BRDF in a table.

    Nodes of theta_h are the squares of equal steps, as MERL's: 0.01 degrees apart at the mirror
    direction, and 0.7 degrees apart at 10 degrees from it. Nodes of theta_d are sines of equal
    steps, dense at grazing angles, where Fresnel terms rise. Nodes of phi_d have equal steps.
    Nodes whose light or view lies below the horizon, where nothing is known, take the value half a
    degree above it, so that no zero is interpolated into the grazing angles.
    """
    if not brdf.isotropic:
        raise BrdfError(f"{brdf!r}: anisotropic; a table holds isotropic BRDFs only")
    cut = cuts_horizon(brdf)
    # Files hold decimals.
    axes = tuple(np.round(axis, 9) for axis in table_axes(shape, cut, brdf.center))
    values = np.empty((*shape, 3), dtype=np.float32)
    for row, theta_h in enumerate(axes[0]):
        light, view = from_half_angles(theta_h, axes[1][:, None], axes[2])
        if cut:
            light, view = _lifted(light), _lifted(view)
        values[row] = brdf.evaluate(light, view)
    check_finite(values, brdf)
    settings = TableSettings(brdf.center, brdf.includes_cosine, brdf.has_horizon, repr(brdf))
    return Table(values, axes, settings)


def table_axes(shape: tuple[int, ...], cut: bool, center: Center) -> tuple[Array, ...]:
    """Return the nodes that `sample_table` takes, but for its rounding, radians.

    `shape` holds their numbers. `cut` tells whether the BRDF ends at the horizon.
    """
    # A BRDF that goes on below the horizon has half vectors there too. The peak of a fiber is not
    # at theta_h = 0 but at the side, so its nodes have equal steps.
    end, power = (np.pi / 2 if cut else np.pi), (1 if center == "tangent" else 2)
    steps = [np.linspace(0, 1, count) for count in shape]
    return end * steps[0] ** power, np.pi / 2 * np.sin(np.pi / 2 * steps[1]), np.pi * steps[2]


def _lifted(directions: Array) -> Array:
    """Directions raised to just above the horizon, at their azimuth, where they lie below."""
    x, y, z = np.moveaxis(directions, -1, 0)
    across = np.hypot(x, y)
    low = z < _LOWEST
    factor = np.where(low, np.sqrt(1 - _LOWEST**2) / np.maximum(across, _TINY), 1.0)
    straight_down = low & (across < _TINY)
    return np.stack(
        [
            np.where(straight_down, np.sqrt(1 - _LOWEST**2), x * factor),
            y * factor,
            np.where(low, _LOWEST, z),
        ],
        axis=-1,
    )


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

    Returns `values` of shape (theta_h, theta_d, phi_d, 1 or 3); `axes`, the angles of the values,
    radians; and `settings`.
    """
    path = check_file(path)
    try:
        return _read_npz(path) if zipfile.is_zipfile(path) else _read_exr(path)
    except OSError as error:
        raise BrdfError(f"{path}: cannot be read ({error.strerror or error})") from error


def write_table(path: str | os.PathLike[str], table: Table) -> None:
    """Write a table, whole or not at all, as OpenEXR or .npz.

    The same table gives the same bytes.

    The suffix of `path`, .exr or .npz, decides on the format.
    """
    suffix = Path(path).suffix.lower()
    if suffix == ".npz":
        arrays: dict[str, Any] = dict(zip(AXES, table.axes, strict=True))
        arrays |= {"values": table.table, "settings": json.dumps(_settings_object(table.settings))}
        with replacing(path) as temporary, open(temporary, "wb") as stream:
            np.savez_compressed(stream, **arrays)
    elif suffix == ".exr":
        write_parts(path, [table_part(table)], "float")
    else:
        raise OutputError(f"{path}: a table is written as {' or '.join(TABLE_SUFFIXES)}")


def is_table(path: str | os.PathLike[str]) -> bool:
    """Tell whether a file is an OpenEXR image or a .npz that holds a table of a BRDF."""
    if not os.path.isfile(path):
        return False
    if npz.holds(path, {"values", *AXES}):
        return True
    found = peek(path)
    return found is not None and bool(found.first.text(ATTRIBUTE))


def table_part(table: Table, scale: float = 1.0) -> Part:
    """Return a table as a part of an OpenEXR file, its values times `scale`."""
    rows = table.table.shape[0]
    planes = scale * table.table.reshape(rows, -1, table.table.shape[-1])
    channels = {name: planes[..., k % planes.shape[-1]] for k, name in enumerate("RGB")}
    axes = {name: axis.tolist() for name, axis in zip(AXES, table.axes, strict=True)}
    settings = json.dumps({**_settings_object(table.settings), "axes": axes})
    return Part(channels, {ATTRIBUTE: settings})


def _settings_object(settings: TableSettings) -> dict[str, Any]:
    """Return the JSON object of a file's settings, without the axes."""
    return {"version": _VERSION, **vars(settings)}


def _read_exr(path: Path) -> Stored:
    found = peek(path)
    if found is None:
        raise BrdfError(f"{path}: damaged or truncated; copy it, or {_AGAIN}")
    if not found.first.text(ATTRIBUTE):
        raise BrdfError(f"{path}: an image, but not a table of a BRDF; shrm brdf --save makes one")
    return stored_table(found.first)


def stored_table(part: StoredPart) -> Stored:
    """Read a part that `table_part` made, as `read_table` returns it, with its values scaled."""
    path, text = Path(part.path), part.text(ATTRIBUTE)
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
