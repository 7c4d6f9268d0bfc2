"""BRDFs as tables over half and difference angles: the format of `shrm` itself.

The coordinates are Rusinkiewicz's: the angle theta_h of the half vector h = (L + V) / |L + V| from
the normal, the angle theta_d between the light and h, and the azimuth phi_d of the light about h,
0 in the plane of h and the normal on the side away from the normal. A glossy lobe lies along
theta_h = 0 for every view, so an axis that is dense there resolves it. Over incoming and outgoing
angles the same lobe is a diagonal ridge, which interpolation turns into a row of bumps. BRDFs here
are isotropic and mirror-symmetric, so that phi_d runs from 0 to pi; reciprocity is not assumed.

References
----------
Rusinkiewicz 1998, A New Change of Variables for Efficient BRDF Representation.
Matusik et al. 2003, A Data-Driven Reflectance Model (the square-root spacing of theta_h).
"""

import hashlib
import os

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.half_angles import from_half_angles, half_angles
from shrm_cli.brdf.lobe import cuts_horizon
from shrm_cli.brdf.measured import MeasuredBrdf
from shrm_cli.brdf.measured.reading.file import file_values
from shrm_cli.errors import BrdfError
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
    """What a table's values mean.

    Attributes
    ----------
    center : {"reflection", "normal", "tangent"}
    includes_cosine, has_horizon : bool
        The attributes of that name of a `Brdf`.
    made_from : str
        What the table was computed from; empty if it is not known.
    """

    center: Center = "reflection"
    includes_cosine: bool = False
    has_horizon: bool = True
    made_from: str = ""


_ORDINARY = TableSettings()


class Table(MeasuredBrdf):
    """A BRDF that is interpolated linearly in each of the three angles.

    Attributes
    ----------
    table : ndarray of float32, shape (theta_h, theta_d, phi_d, 1 or 3)
        Values of f_r (1/sr), or of rho_hat where the settings say so; they are not negative.
    axes : tuple of three ndarray
        The angles of the values, radians, ascending. Beyond the ends of an axis the values at
        its ends go on.
    settings : TableSettings
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
        """Read a table from OpenEXR or .npz.

        Raises
        ------
        BrdfError
            If the file is missing or damaged, or holds something else.
        """
        from shrm_cli.brdf.measured.reading.table_file import read_table

        values = file_values(path)
        return cls(*read_table(path), values)

    def __repr__(self) -> str:
        file = self.values.get("file")
        return str(file) if file else f"table of {self.settings.made_from or 'values'}"

    def evaluate(self, light: Array, view: Array) -> Array:
        value = self._interpolate(self._angles(light, view))
        value = value.astype(np.result_type(light, view), copy=False)
        if self.has_horizon or not self.includes_cosine:
            value = value * ((light[..., 2] > 0) & (view[..., 2] > 0))[..., None]
        return np.broadcast_to(value, (*value.shape[:-1], 3))

    @staticmethod
    def _angles(light: Array, view: Array) -> tuple[Array, Array, Array]:
        """Half angles with phi_d folded to 0 .. pi, as the mirror symmetry of the BRDF allows."""
        theta_h, theta_d, phi_d = half_angles(light, view)
        return theta_h, theta_d, np.abs(phi_d)

    def _interpolate(self, angles: tuple[Array, Array, Array]) -> Array:
        """Interpolate values at angles of shape (...); the result has the shape (..., 1 or 3)."""
        corners, fractions, strides = [], [], self._strides()
        for angle, axis, stride in zip(angles, self.axes, strides, strict=True):
            count = len(axis)
            position = np.interp(angle, axis, np.arange(count)).astype(np.float32)
            low = np.clip(position.astype(np.int32), 0, max(count - 2, 0))
            corners.append((low * stride, np.minimum(low + 1, count - 1) * stride))
            fractions.append((1 - (position - low), position - low))
        flat = self.table.reshape(-1, self.table.shape[-1])
        total: Array = np.zeros((1,), dtype=np.float32)
        for h in (0, 1):
            for d in (0, 1):
                weight = fractions[0][h] * fractions[1][d]
                index = corners[0][h] + corners[1][d]
                for p in (0, 1):
                    corner = np.take(flat, index + corners[2][p], axis=0)
                    total = total + (weight * fractions[2][p])[..., None] * corner
        return total

    def _strides(self) -> tuple[int, int, int]:
        _, theta_d, phi_d = self.table.shape[:3]
        return theta_d * phi_d, phi_d, 1

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

    Parameters
    ----------
    brdf : Brdf
    shape : tuple of three int
        The numbers of nodes of theta_h, theta_d and phi_d.

    Raises
    ------
    BrdfError
        If the BRDF is anisotropic, or not finite.
    """
    if not brdf.isotropic:
        raise BrdfError(f"{brdf!r}: anisotropic; a table holds isotropic BRDFs only")
    cut = cuts_horizon(brdf)
    # A BRDF that goes on below the horizon has half vectors there too. The peak of a fiber is not
    # at theta_h = 0 but at the side, so its nodes have equal steps.
    end, power = (np.pi / 2 if cut else np.pi), (1 if brdf.center == "tangent" else 2)
    steps = [np.linspace(0, 1, count) for count in shape]
    spaced = end * steps[0] ** power, np.pi / 2 * np.sin(np.pi / 2 * steps[1]), np.pi * steps[2]
    axes = tuple(np.round(axis, 9) for axis in spaced)  # because files hold decimals
    values = np.empty((*shape, 3), dtype=np.float32)
    for row, theta_h in enumerate(axes[0]):
        light, view = from_half_angles(theta_h, axes[1][:, None], axes[2])
        if cut:
            light, view = _lifted(light), _lifted(view)
        values[row] = brdf.evaluate(light, view)
    if not np.isfinite(values).all():
        raise BrdfError(f"{brdf!r}: its value is not finite everywhere")
    settings = TableSettings(brdf.center, brdf.includes_cosine, brdf.has_horizon, repr(brdf))
    return Table(values, axes, settings)


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
