"""RGL's `.bsdf` files: measurements on a grid that adapts to the material."""

import os
from collections.abc import Mapping
from math import prod
from pathlib import Path

import numpy as np

from shrm_cli.arrays import Array, Indices
from shrm_cli.brdf.base import Value
from shrm_cli.brdf.measured import MeasuredBrdf
from shrm_cli.brdf.measured.reading.file import LARGEST, check_file, file_values, first_bytes
from shrm_cli.brdf.measured.reading.spectrum import to_linear_srgb
from shrm_cli.brdf.measured.reading.tensor_file import MAGIC, TensorFile, damaged
from shrm_cli.errors import BrdfError

# Limits of what is taken for sound: of numbers, of a density's integral, of sizes.
_SMALLEST = 1e-30
_MOST_DENSITIES = 2**24
_MOST_BYTES = 2**29
_SLACK = 0.01  # of azimuths, radians
_ZEMAX_WORDS = b"SpectralContent", b"ScatterType", b"SampleRotation", b"AngleOfIncidence"
_HEAD = 4096


class Rgl(MeasuredBrdf):
    """A measured BRDF, parameterized by the visible normals of its microfacets.

    For a viewer in the direction v, the cumulative distribution of visible normals maps the half
    vector h to a point u of the unit square, over which the measurement M is smooth. Then
    ``rho_hat = M(u) D(h) / (4 sigma(v))``, which includes the cosine of the light's angle. As in
    the database's own evaluator the grid adapts to the direction of the viewer, and values between
    measured directions are linear in its angles. Spectra become linear sRGB.

    A file of more than two azimuths of the viewer is anisotropic, and its x axis is the tangent.
    Where these span half of the circle or a quarter of it, the material stays as it is under half
    a turn, or under a mirror along each axis.

    Measured numbers below zero are noise; where the interpolated value is negative, it becomes 0.

    References: Dupuy and Jakob 2018, "An adaptive parameterization for efficient material
    acquisition and rendering"; the RGL material database's reference code.
    """

    name = "rgl"
    summary = "Measured BRDF of the RGL database, a transfer function"
    source = "RGL material database format, Dupuy and Jakob 2018"
    includes_cosine = True
    reads = "RGL's .bsdf tensor files"
    suffixes = own_suffixes = (".bsdf",)

    def __init__(self, file: TensorFile, values: Mapping[str, Value]) -> None:
        self.values = {**values}
        azimuths, self._angles = _azimuths(file), _angles(file)
        self.isotropic = len(azimuths) <= 2
        # If there are two azimuths, the second is the first after a whole turn.
        self._azimuths = azimuths[:1] if self.isotropic else azimuths
        self._symmetry = 1 if self.isotropic else _symmetry(file, azimuths)
        measured = len(self._azimuths), len(azimuths), len(self._angles)
        self._warp = Warp(_density(file, *measured))
        colors = _colors(file, *measured)
        self._measured = Grid(colors)
        normals, area = (_profile(file, name, self.isotropic) for name in ("ndf", "sigma"))
        if area.min() <= 0:
            raise damaged(file.path, "its field 'sigma' is not positive")
        if not _flag(file, "jacobian"):  # the measurement is the transfer function itself
            normals = np.ones((2, 2), dtype=np.float32)
            area = normals / 4
        self._normals, self._area = (Grid(each[None, ..., None]) for each in (normals, area))
        largest = np.abs(colors).max() * float(normals.max()) / float(area.min())
        if largest > LARGEST:
            raise damaged(file.path, f"its values reach {largest:g}")

    @staticmethod
    def recognizes(head: bytes) -> bool:
        return head.startswith(MAGIC)

    @classmethod
    def open(cls, path: str | os.PathLike[str]) -> "Rgl":
        """Read a file; Zemax's file of the same suffix is refused."""
        path = check_file(path)
        _refuse_others(path)
        file = TensorFile.open(path)
        if path.stat().st_size > _MOST_BYTES:  # before all of it is read for its digest
            raise BrdfError(f"{path}: larger than {_MOST_BYTES:,} bytes; use the RGB file instead")
        return cls(file, file_values(path))

    def above(self, light: Array, view: Array) -> Array:
        if self._symmetry > 1:
            signs = _to_measured(view, self._symmetry)
            light, view = light * signs, view * signs
        theta_m, phi_m = _polar(light + view)
        theta, phi = _polar(view)
        if self.isotropic:  # only the azimuth between half vector and viewer counts
            phi_m = phi_m - phi
            slices = Slices((self._angles, theta))
        else:
            slices = Slices((self._azimuths, phi), (self._angles, theta))
        turn = phi_m * (0.5 / np.pi) + 0.5
        u_theta, u_phi = _unit(theta_m), turn - np.floor(turn)
        value = self._measured(*self._warp.invert(u_theta, u_phi, slices), slices)
        normals = self._normals(u_theta, u_phi, Slices())
        area = self._area(_unit(theta), phi * (0.5 / np.pi) + 0.5, Slices())
        return np.maximum(value * (normals / (4 * area)), 0)


def _polar(directions: Array) -> tuple[Array, Array]:
    """The angles from the normal and about it, radians; directions need no length of one."""
    x, y, z = np.moveaxis(directions, -1, 0)
    return np.arctan2(np.sqrt(x * x + y * y), z), np.arctan2(y, x)


def _to_measured(view: Array, symmetry: int) -> Array:
    """Factors for x, y and z that bring viewers where they were measured, shape (n, 3)."""
    signs = np.where(np.signbit(view), view.dtype.type(1), view.dtype.type(-1))
    if symmetry == 2:
        signs[:, 0] = signs[:, 1]
    signs[:, 2] = 1
    return signs


def _unit(theta: Array) -> Array:
    """The coordinate of an angle from the normal, which is 0 .. 1 over the hemisphere."""
    return np.sqrt(theta * (2 / np.pi))


def _refuse_others(path: Path) -> None:
    """Refuse files that are no tensor files, such as Zemax's text files of the same suffix."""
    head = first_bytes(path, _HEAD)
    if head.startswith(MAGIC):
        return
    if any(word in head for word in _ZEMAX_WORDS):
        raise BrdfError(
            f"{path}: a Zemax .bsdf text file; only RGL's binary one is read; name another"
        )
    raise BrdfError(f"{path}: not an RGL .bsdf file (it does not start as one); name another file")


def _azimuths(file: TensorFile) -> Array:
    """The measured azimuths of the viewer, shape (n,), radians."""
    azimuths = _read(file, "phi_i", (None,))
    if len(azimuths) > 2 and not (np.diff(azimuths) > 0).all():
        raise damaged(file.path, "its azimuths 'phi_i' do not increase")
    return azimuths


def _symmetry(file: TensorFile, azimuths: Array) -> int:
    """How often the span of the azimuths fits into the circle: 1, 2 or 4 times."""
    symmetry = round(2 * np.pi / float(azimuths[-1] - azimuths[0]))
    last = 2 * np.pi / max(symmetry, 1) - np.pi
    begins, ends = azimuths[0] >= -np.pi - _SLACK, azimuths[-1] <= last + _SLACK
    if symmetry not in (1, 2, 4) or not (begins and ends):
        first, last = np.degrees(azimuths[[0, -1]])
        raise damaged(
            file.path,
            f"its azimuths 'phi_i' go from {first:.4g} to {last:.4g} degrees, not from -180 to "
            "180, 0 or -90",
        )
    return symmetry


def _angles(file: TensorFile) -> Array:
    """The measured angles of the viewer from the normal, shape (n,), radians."""
    nodes = _read(file, "theta_i", (None,))
    if len(nodes) < 2 or nodes[0] < 0 or nodes[-1] > 1.6 or not (np.diff(nodes) > 0).all():
        raise damaged(file.path, "its angles 'theta_i' do not increase from 0 to 90 degrees")
    return nodes


def _density(file: TensorFile, used: int, azimuths: int, angles: int) -> Array:
    """The density of visible normals for each viewer, shape (used * angles, rows, columns)."""
    shape = file.fields["vndf"].shape if "vndf" in file.fields else ()
    if prod(shape) > _MOST_DENSITIES:
        raise damaged(file.path, f"its field 'vndf' has {prod(shape):,} values")
    density = _read(file, "vndf", (azimuths, angles, None, None))[:used]
    density = density.reshape(-1, *density.shape[2:])
    if min(density.shape[1:]) < 2 or density.min() < 0:
        raise damaged(file.path, "its field 'vndf' is no density")
    if (np.sum(density, axis=(1, 2), dtype=np.float64) <= _SMALLEST).any():
        raise damaged(file.path, "its field 'vndf' vanishes")
    return density


def _colors(file: TensorFile, used: int, azimuths: int, angles: int) -> Array:
    """The measurement in linear sRGB for each viewer, shape (used * angles, rows, columns, 3)."""
    if "rgb" in file.fields or "spectra" not in file.fields:
        colors = _read(file, "rgb", (azimuths, angles, 3, None, None))[:used]
        colors = np.moveaxis(colors.reshape(-1, *colors.shape[2:]), 1, -1)
    else:
        wavelengths = _read(file, "wavelengths", (None,))
        shape = azimuths, angles, len(wavelengths), None, None
        spectra = _read(file, "spectra", shape)[:used]
        spectra = spectra.reshape(-1, *spectra.shape[2:])
        try:
            colors = np.stack([to_linear_srgb(wavelengths, each.T).T for each in spectra])
        except BrdfError as error:
            raise BrdfError(f"{file.path}: {error}") from error
        colors = np.moveaxis(colors, 1, -1)
    if min(colors.shape[1:3]) < 2:
        raise damaged(file.path, "its measurement has no area")
    return colors


def _profile(file: TensorFile, name: str, isotropic: bool) -> Array:
    """A field over azimuths and angles; every azimuth has the mean of all if it is isotropic."""
    values = _read(file, name, (None, None))
    if isotropic:
        values = np.tile(values.mean(axis=0), (2, 1))
    if min(values.shape) < 2 or values.min() < 0:
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
    if not (values.min() >= -LARGEST and values.max() <= LARGEST):  # or one is NaN
        raise damaged(file.path, f"its field {name!r} holds values that are not finite")
    return values.astype(np.float32, copy=False)


# ---- bilinear grids that depend on parameters ----------------------------------------------------
# A table holds a grid over the unit square for each combination of some values of the parameters, a
# slice each, and is linear between them in each parameter.


class Slices:
    """Where parameters lie between the slices of a table; those beyond the ends lie at the ends.

    `axes` are for each parameter two arrays: the values of the slices, increasing and two at least,
    and the values that are looked up. Slices of the last parameter follow each other. Without
    parameters the table is a single slice.
    """

    def __init__(self, *axes: tuple[Array, Array]) -> None:
        self._low: Indices = np.zeros(1, dtype=np.intp)
        parts: list[Array] = []
        for nodes, parameter in axes:
            low = np.clip(np.searchsorted(nodes, parameter, side="right") - 1, 0, len(nodes) - 2)
            nodes = nodes.astype(parameter.dtype)
            start, end = nodes[low], nodes[low + 1]
            parts.append(np.clip((parameter - start) / (end - start), 0, 1))
            self._low = self._low * len(nodes) + low
        counts = [len(nodes) for nodes, _ in axes]
        strides = [prod(counts[k + 1 :]) for k in range(len(counts))]
        self._steps = list(zip(strides, parts, strict=True))

    def blend(self, records: Array, index: Indices, per_slice: int) -> Array:
        """Interpolate records between the slices that each point lies between, shape (n, ...).

        `records` are of shape (slices * per_slice, ...). `index`, of shape (n,), is that of a
        record within its slice. `per_slice` is the number of records of a slice.
        """
        steps = [(stride * per_slice, part) for stride, part in self._steps]
        return _blend(records, self._low * per_slice + index, steps)


def _blend(records: Array, at: Indices, steps: list[tuple[int, Array]]) -> Array:
    """Interpolate between records and those a step farther, along each of the steps."""
    if not steps:
        return records.take(at, axis=0)
    (step, part), *inner = steps
    low, high = _blend(records, at, inner), _blend(records, at + step, inner)
    return low + part[(..., *(None,) * (records.ndim - 1))] * (high - low)


class Grid:
    """Values with several channels on a grid in each slice, bilinear between the nodes.

    `values` are of shape (s, rows, columns, channels).
    """

    def __init__(self, values: Array) -> None:
        self.shape = values.shape[1:3]
        # A record holds a node and its right neighbour, so that two fetches serve four corners.
        pairs = np.stack([values[:, :, :-1], values[:, :, 1:]], axis=3)
        pairs = np.pad(pairs, [(0, 0), (0, 0), (0, 1), (0, 0), (0, 0)])
        self._records = np.ascontiguousarray(pairs, dtype=np.float32).reshape(-1, *pairs.shape[3:])

    def __call__(self, x: Array, y: Array, slices: Slices) -> Array:
        """Interpolate values, shape (n, channels), at x (columns) and y (rows), both 0 .. 1."""
        _, right, below, top, bottom = _looked_up(self._records, self.shape, x, y, slices)
        pair = top + below[:, None, None] * (bottom - top)
        return pair[:, 0] + right[:, None] * (pair[:, 1] - pair[:, 0])


class Warp:
    """A map of the unit square to itself that makes a bilinear density uniform.

    The cumulative of the density along a row maps x, and the cumulative of the rows' integrals maps
    y. Both are exact for the density as it is interpolated.

    `density`, of shape (s, rows, columns), is not negative, and has a positive integral in every
    slice, of any scale.

    References: Dupuy and Jakob 2018, "An adaptive parameterization for efficient material
    acquisition and rendering". This is the inverse of the sampling of visible normals there.
    """

    def __init__(self, density: Array) -> None:
        self.shape = density.shape[1:]
        downs = np.empty(density.shape[:2], dtype=np.float32)
        # A record holds the density at a node and at the next node of its row, the cumulative up to
        # the node, and the integral of the whole row.
        records = np.empty((*density.shape, 4), dtype=np.float32)
        for k, each in enumerate(density):  # so that double precision serves one slice at a time
            downs[k], records[k] = _cumulated(each.astype(np.float64))
        self._down: Array = downs.reshape(-1)
        self._records: Array = records.reshape(-1, 4)

    def invert(self, x: Array, y: Array, slices: Slices) -> tuple[Array, Array]:
        """Find the points of the uniform square that the map takes to x (columns) and y (rows).

        Where a row has no density at all, x becomes 0.
        """
        row, right, below, top, bottom = _looked_up(self._records, self.shape, x, y, slices)
        left, after, along, whole = (top + below[:, None] * (bottom - top)).T
        inside = right * (left + right / 2 * (after - left))
        tiny = np.finfo(np.float32).tiny
        source_x = (along + inside) / np.maximum(whole, tiny)
        first, last = top[:, 3], bottom[:, 3]
        source_y = slices.blend(self._down, row, self.shape[0])
        source_y = source_y + below * (first + below / 2 * (last - first))
        return np.clip(source_x, 0, 1), np.clip(source_y, 0, 1)


def _cumulated(density: Array) -> tuple[Array, Array]:
    """The cumulative of the rows, shape (rows,), and the records, shape (rows, columns, 4)."""
    along = np.zeros(density.shape)
    along[:, 1:] = np.cumsum((density[:, :-1] + density[:, 1:]) / 2, axis=1)
    rows = along[:, -1]
    down = np.zeros(rows.shape)
    down[1:] = np.cumsum((rows[:-1] + rows[1:]) / 2)
    following = np.concatenate([density[:, 1:], density[:, -1:]], axis=1)
    whole = np.broadcast_to(rows[:, None], density.shape)
    records = np.stack([density, following, along, whole], axis=-1)
    return down / down[-1], records / down[-1]


def _looked_up(
    records: Array, shape: tuple[int, ...], x: Array, y: Array, slices: Slices
) -> tuple[Indices, Array, Array, Array, Array]:
    """Blend the records of the cells at x (columns) and y (rows), both 0 .. 1.

    `shape` are the rows and columns of a slice.

    Returns the row of each cell; how far x and y are from its left and its top, 0 .. 1; and its
    records at the top and at the bottom.
    """
    rows, columns = shape
    column, right = _cell(x, columns)
    row, below = _cell(y, rows)
    at, count = row * columns + column, rows * columns
    top, bottom = (slices.blend(records, each, count) for each in (at, at + columns))
    return row, right, below, top, bottom


def _cell(coordinate: Array, count: int) -> tuple[Indices, Array]:
    """The cell that a coordinate 0 .. 1 falls into, of a grid of `count` nodes, and where in it."""
    scaled = np.clip(coordinate, 0, 1) * (count - 1)
    low = np.minimum(scaled.astype(np.intp), count - 2)
    return low, scaled - low.astype(scaled.dtype)
