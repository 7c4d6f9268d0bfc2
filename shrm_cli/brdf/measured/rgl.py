"""RGL's `.bsdf` files: isotropic measurements on a grid that adapts to the material."""

import os
from collections.abc import Mapping
from math import prod
from pathlib import Path

import numpy as np

from shrm_cli.brdf.base import Array, Value
from shrm_cli.brdf.hemisphere import evaluate_above
from shrm_cli.brdf.measured import MeasuredBrdf
from shrm_cli.brdf.measured.reading.file import check_file, file_values
from shrm_cli.brdf.measured.reading.rgl_warp import Grid, Slices, Warp
from shrm_cli.brdf.measured.reading.spectrum import to_linear_srgb
from shrm_cli.brdf.measured.reading.tensor_file import MAGIC, TensorFile, damaged
from shrm_cli.errors import BrdfError

# Limits of what is taken for sound: of numbers, of a density's integral, of sizes.
_LARGEST = 1e30
_SMALLEST = 1e-30
_MOST_DENSITIES = 2**22
_MOST_BYTES = 2**29
_ZEMAX_WORDS = b"SpectralContent", b"ScatterType", b"SampleRotation", b"AngleOfIncidence"
_HEAD = 4096


class Rgl(MeasuredBrdf):
    """A measured isotropic BRDF, parameterized by the visible normals of its microfacets.

    For a viewer at the angle theta, the cumulative distribution of visible normals maps the half
    vector h to a point u of the unit square, over which the measurement M is smooth. Then
    ``rho_hat = M(u) D(h) / (4 sigma(theta))``, which includes the cosine of the light's angle. As
    in the database's own evaluator the grid adapts to the direction of the viewer, and values
    between measured angles are linear. Spectra become linear sRGB.

    Measured numbers below zero are noise; where the interpolated value is negative, it becomes 0.

    References
    ----------
    Dupuy and Jakob 2018, "An adaptive parameterization for efficient material acquisition and
    rendering"; the RGL material database's reference code.
    """

    name = "rgl"
    summary = "Measured isotropic BRDF of the RGL database, a transfer function"
    source = "RGL material database format, Dupuy and Jakob 2018"
    includes_cosine = True
    reads = "RGL's .bsdf tensor files"
    suffixes = own_suffixes = (".bsdf",)

    def __init__(self, file: TensorFile, values: Mapping[str, Value]) -> None:
        self.values = {**values}
        self._nodes = _angles(file)
        count = len(self._nodes)
        self._warp = Warp(_density(file, count))
        colors = _colors(file, count)
        self._measured = Grid(colors)
        self._normals, self._area = _profile(file, "ndf"), _profile(file, "sigma")
        if self._area.min() <= 0:
            raise damaged(file.path, "its field 'sigma' is not positive")
        if not _flag(file, "jacobian"):  # the measurement is the transfer function itself
            self._normals = np.ones(2, dtype=np.float32)
            self._area = self._normals / 4
        largest = np.abs(colors).max() * float(self._normals.max()) / float(self._area.min())
        if largest > _LARGEST:
            raise damaged(file.path, f"its values reach {largest:g}")

    @staticmethod
    def recognizes(head: bytes) -> bool:
        return head.startswith(MAGIC)

    @classmethod
    def open(cls, path: str | os.PathLike[str]) -> "Rgl":
        """Read a file.

        Raises
        ------
        BrdfError
            If it cannot be read, is Zemax's file of the same suffix, anisotropic, or damaged.
        """
        path = check_file(path)
        _refuse_others(path)
        file = TensorFile.open(path)
        _refuse_anisotropic(file)
        if path.stat().st_size > _MOST_BYTES:  # before all of it is read for its digest
            raise BrdfError(f"{path}: larger than {_MOST_BYTES:,} bytes; use the RGB file instead")
        return cls(file, file_values(path))

    def evaluate(self, light: Array, view: Array) -> Array:
        return evaluate_above(self._interpolated, light, view)

    def _interpolated(self, light: Array, view: Array) -> Array:
        """Values at directions above the horizon, shape (n, 3)."""
        x, y, z = np.moveaxis(light + view, -1, 0)
        view_x, view_y, view_z = np.moveaxis(view, -1, 0)
        theta_m = np.arctan2(np.sqrt(x * x + y * y), z)
        theta = np.arctan2(np.sqrt(view_x * view_x + view_y * view_y), view_z)
        # In an isotropic material only the azimuth between half vector and viewer counts.
        turn = (np.arctan2(y, x) - np.arctan2(view_y, view_x)) * (0.5 / np.pi) + 0.5
        u_theta, u_phi = _unit(theta_m), turn - np.floor(turn)
        slices = Slices(self._nodes, theta)
        value = self._measured(*self._warp.invert(u_theta, u_phi, slices), slices)
        normals, area = _lookup(self._normals, u_theta), _lookup(self._area, _unit(theta))
        return np.maximum(value * (normals / (4 * area))[:, None], 0)


def _unit(theta: Array) -> Array:
    """The coordinate of an angle from the normal, which is 0 .. 1 over the hemisphere."""
    return np.sqrt(theta * (2 / np.pi))


def _lookup(profile: Array, u: Array) -> Array:
    """Interpolate linearly between samples at equal steps over 0 .. 1."""
    scaled = np.clip(u, 0, 1) * (len(profile) - 1)
    low = np.minimum(scaled.astype(np.intp), len(profile) - 2)
    part = scaled - low.astype(u.dtype)
    start = profile.take(low)
    return start + part * (profile.take(low + 1) - start)


def _refuse_others(path: Path) -> None:
    """Refuse files that are no tensor files, such as Zemax's text files of the same suffix."""
    try:
        with open(path, "rb") as stream:
            head = stream.read(_HEAD)
    except OSError as error:
        raise BrdfError(f"{path}: cannot be read ({error.strerror}); copy it again") from error
    if head.startswith(MAGIC):
        return
    if any(word in head for word in _ZEMAX_WORDS):
        raise BrdfError(
            f"{path}: a Zemax .bsdf text file; only RGL's binary one is read; name another"
        )
    raise BrdfError(f"{path}: not an RGL .bsdf file (it does not start as one); name another file")


def _refuse_anisotropic(file: TensorFile) -> None:
    azimuths = file.fields["phi_i"].shape if "phi_i" in file.fields else ()
    if len(azimuths) != 1:
        raise damaged(file.path, "its field 'phi_i' is missing or no list")
    if azimuths[0] > 2:
        raise BrdfError(
            f"{file.path}: anisotropic (measured at {azimuths[0]:,} azimuths); "
            "only isotropic materials can be prefiltered, name another"
        )


def _angles(file: TensorFile) -> Array:
    """The measured angles of the viewer from the normal, shape (n,), radians."""
    nodes = _read(file, "theta_i", (None,))
    if len(nodes) < 2 or nodes[0] < 0 or nodes[-1] > 1.6 or not (np.diff(nodes) > 0).all():
        raise damaged(file.path, "its angles 'theta_i' do not increase from 0 to 90 degrees")
    return nodes


def _density(file: TensorFile, count: int) -> Array:
    """The density of visible normals at each angle of the viewer, shape (n, rows, columns)."""
    shape = file.fields["vndf"].shape if "vndf" in file.fields else ()
    if prod(shape) > _MOST_DENSITIES:
        raise damaged(file.path, f"its field 'vndf' has {prod(shape):,} values")
    # If there are two azimuths, the second is the first after a whole turn.
    density = _read(file, "vndf", (None, count, None, None))[0]
    if min(density.shape[1:]) < 2 or density.min() < 0:
        raise damaged(file.path, "its field 'vndf' is no density")
    if (np.sum(density, axis=(1, 2), dtype=np.float64) <= _SMALLEST).any():
        raise damaged(file.path, "its field 'vndf' vanishes")
    return density


def _colors(file: TensorFile, count: int) -> Array:
    """The measurement in linear sRGB at each angle of the viewer, shape (n, rows, columns, 3)."""
    if "rgb" in file.fields or "spectra" not in file.fields:
        colors = np.moveaxis(_read(file, "rgb", (None, count, 3, None, None))[0], 1, -1)
    else:
        wavelengths = _read(file, "wavelengths", (None,))
        spectra = _read(file, "spectra", (None, count, len(wavelengths), None, None))[0]
        try:
            colors = np.stack([to_linear_srgb(wavelengths, each.T).T for each in spectra])
        except BrdfError as error:
            raise BrdfError(f"{file.path}: {error}") from error
        colors = np.moveaxis(colors, 1, -1)
    if min(colors.shape[1:3]) < 2:
        raise damaged(file.path, "its measurement has no area")
    return colors


def _profile(file: TensorFile, name: str) -> Array:
    """A field that is the same at every azimuth, as a function of the angle alone, shape (n,)."""
    values = _read(file, name, (None, None)).mean(axis=0)
    if len(values) < 2 or values.min() < 0:
        raise damaged(file.path, f"its field {name!r} is negative or too short")
    return values


def _flag(file: TensorFile, name: str) -> bool:
    values = file.read(name)
    if values.shape != (1,) or values.dtype.kind != "u":
        raise damaged(file.path, f"its field {name!r} is no flag")
    return bool(values[0])


def _read(file: TensorFile, name: str, shape: tuple[int | None, ...]) -> Array:
    """Read a field of finite real numbers; None in `shape` stands for any length."""
    if name in file.fields:
        found, dtype = file.fields[name].shape, file.fields[name].dtype
        fits = len(found) == len(shape) and all(
            want in (None, n) for n, want in zip(found, shape, strict=True)
        )
        if not fits or dtype.kind != "f":
            size = " x ".join(str(n) for n in found)
            raise damaged(file.path, f"its field {name!r} is {size} of {dtype.name}")
    values = file.read(name)
    if not (values.min() >= -_LARGEST and values.max() <= _LARGEST):  # or one is NaN
        raise damaged(file.path, f"its field {name!r} holds values that are not finite")
    return values.astype(np.float32, copy=False)
