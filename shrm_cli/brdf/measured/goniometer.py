"""Goniometer files: BRDFs sampled at scattered directions, interpolated by radial functions."""

import os
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from shrm_cli.arrays import Array, slices
from shrm_cli.brdf.base import Value
from shrm_cli.brdf.measured import MeasuredBrdf
from shrm_cli.brdf.measured.reading import file
from shrm_cli.brdf.measured.reading.spectrum import to_linear_srgb
from shrm_cli.brdf.vectors import half_angles, interpolated_along
from shrm_cli.errors import BrdfError
from shrm_cli.progress import at_once
from shrm_cli.sphere.directions import from_angles

MAX_SAMPLES = 4096
"""The most samples of a file. One linear system for all of them takes seconds, and 0.1 GB."""
MAX_WAVELENGTHS = 1024

# These three numbers were chosen by leaving out a fifth of the samples of three paints, from rough
# to glossy, and predicting them.
_DIFFERENCE_SCALE = 0.5
_SMOOTHING = 3e-4
_LOG_OFFSET = 0.03  # times the median; of smaller values the difference counts, not the ratio

_NODES = (64, 64, 16)  # of the table, in theta_h, theta_d and phi_d
_NODES_AT_ONCE = 512
_ROWS_AT_ONCE = 16
_RECORD = 4  # floats of a node in memory, of which three are used: four are fetched faster


class Goniometer(MeasuredBrdf):
    """An isotropic BRDF sampled at scattered directions, as Cornell University measured paints.

    Radial basis functions of the half vector and the difference angle interpolate the logarithm
    of the samples' colors. Lobes are smooth in these angles, and keep their place. The logarithm
    makes relative errors count, and nothing negative. By reciprocity and mirror symmetry each
    sample stands at four places. Nearer to the horizon than any sample, theta_d is reduced to that
    of the lowest sample. No value exceeds the largest measured one. The result is sampled in a
    table, which is interpolated trilinearly.

    References: Kautz, Sloan and Snyder 2002, "Fast, arbitrary BRDF shading for low-frequency
    lighting using spherical harmonics", section 3 (tabulated data by radial basis functions);
    Rusinkiewicz 1998 (the angles); Wendland 2005, "Scattered Data Approximation", chapter 8 (the
    kernel -r^1.5 is conditionally positive definite of order 1, so a constant beside it suffices).
    """

    name = "goniometer"
    summary = "Measured isotropic BRDF, spectral samples at scattered directions"
    source = "Cornell University, light measurement laboratory"
    reads = "Cornell's goniometer samples"
    suffixes = (".brdf", ".dat")

    def __init__(
        self, light: Array, view: Array, colors: Array, values: Mapping[str, Value]
    ) -> None:
        self.values = {**values}
        self._table, self._offset = _sampled_table(light, view, np.maximum(colors, 0))

    @staticmethod
    def recognizes(head: bytes) -> bool:
        # The data begins with a count alone on its line, and so many wavelengths follow. Where the
        # comment announces the count, what stands in its place may be damaged, but is no row of a
        # table, which another format could recognize.
        lines = file.first_lines(head)
        data = [line for line in lines if line and not line.startswith("#")]
        if any(line.startswith("#") and line[1:].split() == ["num", "wls"] for line in lines):
            return not data or len(data[0].replace(",", " ").split()) < 4
        return len(data) > 1 and data[0].isdecimal() and _are_wavelengths(data[1])

    @classmethod
    def open(cls, path: str | os.PathLike[str]) -> "Goniometer":
        """Read a file of spectral samples; this takes about a second."""
        wavelengths, rows = _read(Path(path))
        try:
            colors = to_linear_srgb(wavelengths, rows[:, 4:])
        except BrdfError as error:
            raise BrdfError(f"{path}: {error}") from error
        if not (colors > 0).any():
            raise BrdfError(f"{path}: none of its values is positive; copy the file again")
        theta_i, phi_i, theta_s, phi_s = rows[:, :4].T
        light, view = from_angles(theta_i, phi_i), from_angles(theta_s, phi_s)
        return cls(light, view, colors, file.file_values(path))

    def above(self, light: Array, view: Array) -> Array:
        axes = []
        for k, part in enumerate(_unit_angles(light, view)):
            position, stride = part * (_NODES[k] - 1), int(np.prod(_NODES[k + 1 :]))
            low = np.minimum(position.astype(np.intp), _NODES[k] - 2)
            share = np.minimum(position - low.astype(position.dtype), 1)
            axes.append((low * stride, stride, share))
        found = interpolated_along(self._table, axes)[:, :3]
        return np.maximum(np.exp(found) - self._offset, 0)


def _unit_angles(light: Array, view: Array) -> tuple[Array, Array, Array]:
    """Coordinates of the table, 0 .. 1: the root of theta_h, theta_d, and phi_d folded twice.

    Pairs of directions that reciprocity or the mirror plane through the normal exchange have the
    same coordinates.
    """
    theta_h, theta_d, phi_d = half_angles(light, view)
    phi_d = np.abs(phi_d)
    phi_d = np.minimum(phi_d, phi_d.dtype.type(np.pi) - phi_d)
    scale = light.dtype.type(2 / np.pi)
    return np.sqrt(theta_h * scale), theta_d * scale, phi_d * scale


def _positions(unit_angles: tuple[Array, ...]) -> Array:
    """The points between which radial functions measure distances, shape (n, 3).

    The half vector, flattened to a disk, is x and y, and a multiple of the difference angle is z.
    """
    rho, delta, phi = unit_angles
    radius, phi = np.sqrt(np.pi / 2) * rho, np.pi / 2 * phi
    depth = _DIFFERENCE_SCALE * np.pi / 2 * delta
    return np.stack([radius * np.cos(phi), radius * np.sin(phi), depth], axis=-1)


def _kernel(at: Array, samples: Array) -> Array:
    """The mean of -r^1.5 over the four places of each sample, shape (n, samples)."""
    total = np.zeros((len(at), len(samples)))
    # One product of matrices gives squared distances: |a|^2 - 2 a.b + |b|^2.
    places = np.column_stack([-2 * samples, np.ones(len(samples)), (samples**2).sum(axis=1)])
    rows = np.column_stack([at, (at**2).sum(axis=1), np.ones(len(at))])
    # So few rows at a time stay in the processor's cache.
    for part in slices(len(at), _ROWS_AT_ONCE):
        sums = total[part]
        for mirror in ((1, 1, 1, 1, 1), (1, -1, 1, 1, 1), (-1, 1, 1, 1, 1), (-1, -1, 1, 1, 1)):
            distance = (rows[part] * mirror) @ places.T
            np.sqrt(np.abs(distance, out=distance), out=distance)
            distance *= np.sqrt(distance)
            sums -= distance
    return total / 4


def _sampled_table(light: Array, view: Array, colors: Array) -> tuple[Array, float]:
    """The interpolant ``log(value + offset)`` at the table's nodes, (nodes, 4), and the offset."""
    samples = _positions(_unit_angles(light, view))
    offset = max(_LOG_OFFSET * float(np.median(colors.max(axis=1))), 1e-6 * float(colors.max()))
    count = len(samples)
    system = np.ones((count + 1, count + 1))

    def fill(start: int) -> None:
        part = slice(start, min(start + _NODES_AT_ONCE, count))
        system[part, :count] = _kernel(samples[part], samples)

    at_once(fill, range(0, count, _NODES_AT_ONCE))
    system[np.arange(count), np.arange(count)] += _SMOOTHING
    system[count, count] = 0
    known = np.append(np.log(colors + offset), np.zeros((1, 3)), axis=0)
    weights = np.linalg.solve(system, known)

    grid = np.meshgrid(*(np.linspace(0, 1, nodes) for nodes in _NODES), indexing="ij")
    most = float(np.arccos(np.clip(min(light[:, 2].min(), view[:, 2].min()), 0, 1)))
    at = _positions(_measured_part(grid[0].ravel(), grid[1].ravel(), grid[2].ravel(), most))
    at, places = np.unique(
        at, axis=0, return_inverse=True
    )  # half of them are moved to the same places
    found = np.empty((len(at), 3))

    def interpolate(start: int) -> None:
        part = slice(start, start + _NODES_AT_ONCE)
        found[part] = _kernel(at[part], samples) @ weights[:count] + weights[count]

    at_once(interpolate, range(0, len(at), _NODES_AT_ONCE))
    largest = colors.max(axis=0)
    table = np.zeros((*_NODES, _RECORD), dtype=np.float32)
    logs = np.clip(found, np.log(offset), np.log(largest + offset))
    table[..., :3] = logs[places].reshape(*_NODES, 3)
    # Where theta_d = 0, light and view are the same, and phi_d has no meaning.
    table[:, 0] = table[:, 0].mean(axis=1, keepdims=True)
    return table.reshape(-1, _RECORD), offset


def _measured_part(rho: Array, delta: Array, phi: Array, most: float) -> tuple[Array, ...]:
    """Coordinates with theta_d reduced so far that neither light nor view is lower than a sample.

    `most` is the largest angle of a sample from the normal. Lobes, which depend on theta_h above
    all, so keep their place towards the horizon.
    """
    theta_h = np.minimum(np.pi / 2 * rho**2, most)
    # The lower of the two is at cos(theta) = along cos(theta_d) - across sin(theta_d).
    along, across = np.cos(theta_h), np.sin(theta_h) * np.cos(np.pi / 2 * phi)
    lowest = np.arccos(np.clip(np.cos(most) / np.hypot(along, across), -1, 1))
    largest = np.maximum(lowest - np.arctan2(across, along), 0)
    return np.sqrt(theta_h * 2 / np.pi), np.minimum(delta, largest * 2 / np.pi), phi


def _are_wavelengths(line: str) -> bool:
    """Whether a line holds nothing but numbers that may be wavelengths in nm."""
    try:
        numbers = [float(word) for word in line.split()]
    except ValueError:
        return False
    return all(100 <= number <= 1e5 for number in numbers)


def _read(path: Path) -> tuple[Array, Array]:
    """Wavelengths (n,) in nm, and rows (samples, 4 + n) of four angles in radians and n values."""
    lines = file.read_lines(path, "a file of goniometer samples")
    if not lines or not lines[0][1].isdecimal() or not lines[0][1].isascii():
        raise BrdfError(f"{path}: does not begin with a number of wavelengths; name another file")
    if len(lines[0][1]) > 6 or not 1 <= (count := int(lines[0][1])) <= MAX_WAVELENGTHS:
        raise BrdfError(
            f"{path}: says that it has {lines[0][1][:20]} wavelengths, not 1 .. "
            f"{MAX_WAVELENGTHS}; copy the file again"
        )
    wavelengths: list[float] = []
    first = 1
    while len(wavelengths) < count and first < len(lines):
        wavelengths += file.parse_numbers(path, *lines[first])
        first += 1
    if len(wavelengths) != count:
        raise BrdfError(f"{path}: {len(wavelengths)} wavelengths instead of {count}; copy it again")
    if not (min(wavelengths) < 780 and max(wavelengths) > 360):
        raise BrdfError(f"{path}: no wavelength is visible; give nanometres, 360 to 780")
    samples = lines[first:]
    if not samples:
        raise BrdfError(f"{path}: has no samples; copy the file again")
    if len(samples) > MAX_SAMPLES:
        raise BrdfError(f"{path}: {len(samples):,} samples, more than {MAX_SAMPLES:,}; thin it out")
    rows = np.empty((len(samples), 4 + count))
    for row, (number, line) in zip(rows, samples, strict=True):
        row[:] = file.parse_numbers(path, number, line, len(row))
        if max(abs(row[0]), abs(row[2])) > np.pi / 2 or np.abs(row).max() > file.LARGEST:
            raise BrdfError(
                f"{path}: line {number}: theta beyond pi/2 (angles are radians), or a number "
                f"beyond {file.LARGEST:g}; correct it"
            )
    return np.array(wavelengths), rows
