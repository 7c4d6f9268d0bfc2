"""Files of Zernike coefficients, and of sparse measurements, to which coefficients are fitted."""

import os
import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Value
from shrm_cli.brdf.measured import MeasuredBrdf
from shrm_cli.brdf.measured.reading.file import file_values, first_lines, parse_numbers, read_lines
from shrm_cli.brdf.measured.reading.spectrum import to_linear_srgb
from shrm_cli.brdf.measured.reading.zernike_series import (
    MAX_ORDER,
    Term,
    ZernikeSeries,
    fit_zernike,
    terms_of,
)
from shrm_cli.errors import BrdfError

MAX_ROWS = 2**16

_SMOOTHING = 1e-3
_LARGEST = 1e30  # a larger number in a file is an error
_ANGLES = ("theta_i", "phi_i", "theta_r", "phi_r")
_WAVELENGTHS = np.arange(400.0, 701.0, 10.0)
_COEFFICIENT_ROW = re.compile(r"\s*[1-4]\s*[,\s]\s*[1-4](\s*[,\s]\s*\d{1,3}){5}\s*[,\s]\s*[-+.\d]")


class Zernike(MeasuredBrdf):
    """A measured isotropic BRDF as a Zernike expansion.

    Two kinds of files are opened. Files of coefficients, as NIST publishes them, have rows ``i, j,
    n, m, k, l, p, C``, where i = j = 1 is unpolarized light, and p the power of the wavelength in
    um by which the coefficient C is multiplied. Files of measurements are CSV with the header
    ``theta_i,phi_i,theta_r,phi_r,r,g,b``, or one value instead of three, angles in degrees and
    values in 1/sr; a series of order 8 is fitted to them with some smoothing.

    Negative values of a series become 0. Values of a fit end at the largest value that was
    measured, because polynomials overshoot near the horizon.
    """

    name = "zernike"
    summary = "Measured isotropic BRDF, Zernike polynomials on the hemisphere"
    source = "Koenderink and van Doorn 1998; Germer 2018"
    reads = "Koenderink-van Doorn coefficients, CSV of theta_i,phi_i,theta_r,phi_r,r,g,b"
    suffixes = (".csv",)

    def __init__(
        self, series: ZernikeSeries, values: Mapping[str, Value], ceiling: Array | None = None
    ) -> None:
        self.series = series
        self._ceiling = np.full(3, np.inf) if ceiling is None else ceiling
        self.values = {**values}

    @staticmethod
    def recognizes(head: bytes) -> bool:
        data = (line for line in first_lines(head) if line and not line.startswith("#"))
        first = next(data, "")
        return _is_table(first) or _COEFFICIENT_ROW.match(first) is not None

    @classmethod
    def open(cls, path: str | os.PathLike[str]) -> "Zernike":
        """Read a file of coefficients or of measurements."""
        lines = read_lines(path, "a file of BRDF measurements or Zernike coefficients")
        if not lines:
            raise BrdfError(f"{path}: holds no numbers; copy the file again")
        if len(lines) > MAX_ROWS:
            raise BrdfError(f"{path}: {len(lines):,} rows, more than {MAX_ROWS:,}; thin them out")
        if not _is_table(lines[0][1]):
            return cls(_coefficients(Path(path), lines), file_values(path))
        series, ceiling = _measurements(Path(path), lines)
        return cls(series, file_values(path), ceiling)

    def above(self, light: Array, view: Array) -> Array:
        return np.clip(self.series.evaluate(light, view), 0, self._ceiling)


def _is_table(line: str) -> bool:
    """Whether a line is the header of a file of measurements."""
    return tuple(word.strip().lower() for word in line.split(",")[:4]) == _ANGLES


def _measurements(path: Path, lines: list[tuple[int, str]]) -> tuple[ZernikeSeries, Array]:
    """The series fitted to the rows of a file of measurements, and the largest values, (3,)."""
    columns = len(lines[0][1].split(","))
    if columns not in (5, 7):
        raise BrdfError(f"{path}: {columns - 4} values a row; give r,g,b or one")
    rows = np.array([_row(path, number, line, columns) for number, line in lines[1:]])
    if not len(rows):
        raise BrdfError(f"{path}: has a header, but no measurements; copy the file again")
    angles, values = np.radians(rows[:, :4]), rows[:, 4:]
    if (np.abs(rows[:, [0, 2]]) > 90).any():
        raise BrdfError(f"{path}: a theta is beyond 90 degrees; keep what is above the surface")
    if not (values > 0).any():
        raise BrdfError(f"{path}: none of its values is positive; correct the file")
    theta_i, phi_i, theta_r, phi_r = angles.T
    series = fit_zernike(theta_i, phi_i, theta_r, phi_r, values, smoothing=_SMOOTHING)
    return series, np.broadcast_to(np.maximum(values.max(axis=0), 0), 3)


def _coefficients(path: Path, lines: list[tuple[int, str]]) -> ZernikeSeries:
    """The series of unpolarized light in a file of coefficients."""
    known = set(terms_of(MAX_ORDER))
    found: dict[Term, Array] = {}
    for number, line in lines:
        i, j, n, m, k, azimuth, power, coefficient = _row(path, number, line, 8)
        if (i, j) != (1, 1):
            continue
        if (n, m, azimuth) not in known or k != azimuth or power not in range(7):
            raise BrdfError(
                f"{path}: line {number}: there is no function of orders {n:g}, {m:g}, {k:g}, "
                f"{azimuth:g} and power {power:g} up to order {MAX_ORDER}; copy the file again"
            )
        term = Term(int(n), int(m), int(azimuth))
        at_wavelengths = coefficient * (_WAVELENGTHS / 1000) ** power
        found[term] = at_wavelengths + found.get(term, 0.0)
    if not found:
        raise BrdfError(f"{path}: no coefficients of unpolarised light (i = j = 1); name another")
    spectra = np.stack(list(found.values()))
    if (spectra == spectra[:, :1]).all():
        return ZernikeSeries(list(found), np.repeat(spectra[:, :1], 3, axis=1))
    return ZernikeSeries(list(found), to_linear_srgb(_WAVELENGTHS, spectra))


def _row(path: Path, number: int, line: str, columns: int) -> list[float]:
    """The numbers of one line, which must be so many."""
    numbers = parse_numbers(path, number, line.replace(",", " "))
    if len(numbers) != columns:
        raise BrdfError(
            f"{path}: line {number}: {len(numbers)} numbers instead of {columns}; "
            "correct it or copy the file again"
        )
    if max(map(abs, numbers)) > _LARGEST:
        raise BrdfError(f"{path}: line {number}: a number is beyond {_LARGEST:g}; correct it")
    return numbers
