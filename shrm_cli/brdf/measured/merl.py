"""MERL's `.binary` files: isotropic BRDFs as tables over half and difference angles."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Brdf, Value, check_finite
from shrm_cli.brdf.measured import MeasuredBrdf
from shrm_cli.brdf.measured.reading.file import LARGEST, check_file, file_values, readable
from shrm_cli.brdf.vectors import from_half_angles, half_angles, interpolated_along
from shrm_cli.errors import BrdfError
from shrm_cli.files.whole import replacing

CELLS = (90, 90, 180)
"""The numbers of cells in theta_h (which varies slowest), theta_d and phi_d (fastest)."""
SCALE = np.array([1.0, 1.15, 1.66]) / 1500
"""The factors that make a stored red, green and blue number a BRDF, 1/sr."""

_HEADER = np.array(CELLS, dtype="<i4").tobytes()
_FILE_BYTES = len(_HEADER) + 3 * 8 * int(np.prod(CELLS))
_INVALID = -1.0
_RECORD = 4  # floats of a cell in memory, of which three are used: four are fetched faster


class Merl(MeasuredBrdf):
    """A measured isotropic BRDF, tabulated over Rusinkiewicz's half and difference angles.

    The value of a cell belongs to its center, since MERL's own reader finds the cell of a
    direction by truncation. The center of the cell (i, j, k) is at ``i + 1/2 = 90 sqrt(2 theta_h /
    pi)``, ``j + 1/2 = theta_d`` and ``k + 1/2 = phi_d``, both in degrees, phi_d modulo 180 by
    Helmholtz's reciprocity. Values are trilinear between the centers, and constant beyond the
    outermost ones.

    Cells with a negative number are invalid: they were not measured, or lie below the horizon.
    They take the mean of the valid cells in the smallest block of cells around them that has any.

    References: Matusik et al. 2003, "A data-driven reflectance model"; Rusinkiewicz 1998, "A new
    change of variables for efficient BRDF representation".
    """

    name = "merl"
    summary = "Measured isotropic BRDF, a table over half and difference angles"
    source = "MERL BRDF database format, Matusik et al. 2003"
    reads = "MERL's .binary tables"
    suffixes = own_suffixes = (".binary",)

    def __init__(self, cells: Array, values: Mapping[str, Value]) -> None:
        if cells.shape != (*CELLS, 3):
            raise ValueError(f"cells of shape {cells.shape}, not {(*CELLS, 3)}")
        self.values = {**values}
        # The first cell in phi_d follows the last.
        table = np.zeros((CELLS[0], CELLS[1], CELLS[2] + 1, _RECORD), dtype=np.float32)
        table[:, :, :-1, :3] = cells
        table[:, :, -1] = table[:, :, 0]
        self._table = table.reshape(-1, _RECORD)

    @staticmethod
    def recognizes(head: bytes) -> bool:
        return head.startswith(_HEADER)

    @classmethod
    def open(cls, path: str | os.PathLike[str]) -> "Merl":
        """Read a file; one that is not whole is refused."""
        path = check_file(path)
        with readable(path, "copy it again") as stream:
            cells = _read_cells(stream, path)
        return cls(_pulled(cells)[..., :3], file_values(path))

    def above(self, light: Array, view: Array) -> Array:
        i, j, k = _places(light, view)
        low_i, part_i = _split(np.clip(i, 0, CELLS[0] - 1), CELLS[0] - 2)
        low_j, part_j = _split(np.clip(j, 0, CELLS[1] - 1), CELLS[1] - 2)
        floor_k = np.floor(k)
        part_k = k - floor_k
        low_k = floor_k.astype(np.intp) % CELLS[2]
        row = CELLS[2] + 1
        slab = CELLS[1] * row
        axes = (low_i * slab, slab, part_i), (low_j * row, row, part_j), (low_k, 1, part_k)
        return interpolated_along(self._table, axes)[:, :3]


def _places(light: Array, view: Array) -> tuple[Array, Array, Array]:
    """Where directions lie in the table: indices in theta_h, theta_d and phi_d, shape (...) each.

    They are whole at centers of cells. That in phi_d is in -180.5 .. 179.5, and has the period 180.
    """
    theta_h, theta_d, phi_d = half_angles(light, view)
    degrees = 180 / np.pi
    i = CELLS[0] * np.sqrt(theta_h * (2 / np.pi))
    return i - 0.5, theta_d * degrees - 0.5, phi_d * degrees - 0.5


def cell_directions(row: int) -> tuple[Array, Array]:
    """Compute light and view at the centers of the cells of one theta_h, (90, 180, 3) each."""
    theta_h = np.pi / 2 * ((row + 0.5) / CELLS[0]) ** 2
    theta_d = (np.arange(CELLS[1]) + 0.5) * (np.pi / 2 / CELLS[1])
    phi_d = (np.arange(CELLS[2]) + 0.5) * (np.pi / CELLS[2])
    return from_half_angles(np.asarray(theta_h), theta_d[:, None], phi_d)


def write_merl(path: str | os.PathLike[str], brdf: Brdf) -> None:
    """Write any BRDF about a normal as a MERL file: 35 MB.

    The format holds reciprocal BRDFs only. So the BRDF is sampled at the centers of the cells, also
    with light and view exchanged, and the mean is written. Cells below the horizon are invalid.
    """
    if brdf.center == "tangent" or not brdf.isotropic:
        raise BrdfError(f"{brdf!r}: MERL files hold isotropic BRDFs about a normal alone")
    cells = np.empty((*CELLS, 3))
    for row in range(CELLS[0]):
        light, view = cell_directions(row)
        mean = (_reflectance(brdf, light, view) + _reflectance(brdf, view, light)) / 2
        check_finite(mean, brdf)
        above = (light[..., 2] > 0) & (view[..., 2] > 0)
        cells[row] = np.where(above[..., None], np.maximum(mean, 0) / SCALE, _INVALID)
    with replacing(path) as temporary, open(temporary, "wb") as stream:
        stream.write(_HEADER)
        for channel in range(3):
            stream.write(cells[..., channel].astype("<f8").tobytes())


def _reflectance(brdf: Brdf, light: Array, view: Array) -> Array:
    """Values of f_r; those of a model that includes the cosine are divided by it.

    Such a model's value is 0 where the light is not above the surface.
    """
    cosine = light[..., 2:]
    value = brdf.evaluate(light, view)
    if not brdf.includes_cosine:
        return value
    return np.where(cosine > 0, value / np.where(cosine > 0, cosine, 1.0), 0.0)


def _split(index: Array, most: int) -> tuple[NDArray[np.intp], Array]:
    """The whole part of a non-negative index, at most `most`, and what remains of the index."""
    low = np.minimum(index.astype(np.intp), most)
    return low, index - low.astype(index.dtype)


def _read_cells(stream: BinaryIO, path: Path) -> NDArray[np.float32]:
    """The BRDF (1/sr) of every cell, and a weight of 1, or 0 if it is invalid: (90, 90, 180, 4)."""
    size = os.fstat(stream.fileno()).st_size
    header = np.frombuffer(stream.read(len(_HEADER)).ljust(len(_HEADER), b"\0"), dtype="<i4")
    if tuple(header) != CELLS:
        found = " x ".join(str(n) for n in header)
        raise BrdfError(
            f"{path}: not a MERL file of 90 x 90 x 180 cells (it says {found}); name another file"
        )
    if size != _FILE_BYTES:
        raise BrdfError(f"{path}: {size:,} bytes instead of {_FILE_BYTES:,}; copy the file again")
    cells = np.empty((*CELLS, _RECORD), dtype=np.float32)
    valid = np.ones(CELLS, dtype=bool)
    for channel in range(3):
        plane = np.fromfile(stream, dtype="<f8", count=valid.size)
        if plane.size != valid.size:  # the file has shrunk meanwhile
            raise BrdfError(f"{path}: ends too early; copy the file again")
        if not (plane.min() >= -LARGEST and plane.max() <= LARGEST):  # or one is NaN
            raise BrdfError(
                f"{path}: holds values that are not numbers, infinite or beyond {LARGEST:g}; "
                "copy the file again"
            )
        plane = plane.reshape(CELLS)
        valid &= plane >= 0
        cells[..., channel] = plane
        cells[..., channel] *= SCALE[channel]
    if not valid.any():
        raise BrdfError(f"{path}: all its cells are marked invalid; name another file")
    cells[..., 3] = 1.0
    cells[~valid] = 0.0
    return cells


def _pulled(cells: NDArray[np.float32]) -> NDArray[np.float32]:
    """Fill cells of weight 0 with the mean of the smallest block around them that has others.

    This is the "pull-push" of image processing. The edge of a block doubles from step to step, so
    that all steps take little longer than the first.

    `cells`, of shape (a, b, c, 4), are three channels, which are multiplied by the weight already,
    and the weight.

    Returns an array of shape (a, b, c, 4): the same array, filled in place.
    """
    missing = cells[..., 3] == 0
    if not missing.any():
        return cells
    coarse = np.pad(cells, [(0, n % 2) for n in cells.shape[:3]] + [(0, 0)])
    for axis in range(3):
        paired = np.moveaxis(coarse, axis, 0)
        coarse = np.moveaxis(paired[::2] + paired[1::2], 0, axis)
    weight = coarse[..., 3:]
    np.divide(coarse, weight, out=coarse, where=weight > 0)
    coarse = _pulled(coarse)
    a, b, c = np.nonzero(missing)
    cells[a, b, c] = coarse[a // 2, b // 2, c // 2]
    return cells
