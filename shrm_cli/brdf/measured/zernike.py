"""Files of Zernike coefficients, and of sparse measurements, to which coefficients are fitted.

Koenderink and van Doorn expand BRDFs in Zernike polynomials on the hemisphere. A direction is
mapped to the unit disk by ``r = sqrt(2) sin(theta / 2)``, which keeps areas, and the BRDF is
``sum C_nml H_nml`` with the reciprocal, isotropic, mirror-symmetric functions

    H_nml = N_nml (R_n^l(r_i) R_m^l(r_o) + R_m^l(r_i) R_n^l(r_o)) cos(l (phi_i - phi_o)),

which are orthonormal over both hemispheres in solid angle. In the disk's coordinates they are
polynomials, so nothing is singular at the normal.

References: Koenderink and van Doorn 1998, "Phenomenological description of bidirectional surface
reflection", J. Opt. Soc. Am. A 15(11); Germer 2018, "Full four-dimensional and reciprocal Mueller
matrix bidirectional reflectance distribution function of sintered polytetrafluoroethylene", Applied
Optics (the normalisation, and the files of coefficients).
"""

import os
import re
from collections.abc import Mapping
from functools import cached_property
from math import factorial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Value
from shrm_cli.brdf.measured import MeasuredBrdf
from shrm_cli.brdf.measured.reading import file
from shrm_cli.brdf.measured.reading.spectrum import to_linear_srgb
from shrm_cli.errors import BrdfError
from shrm_cli.records import record
from shrm_cli.sphere.directions import from_angles

MAX_ORDER = 20
"""The largest order; the radial polynomials of larger ones lose their digits to cancellation."""


class Term(NamedTuple):
    """The orders of one function of the basis: n >= m >= azimuth >= 0, all odd or all even."""

    n: int
    m: int
    azimuth: int


def terms_of(order: int) -> list[Term]:
    """List the functions up to an order, which are 5 for order 2 and 55 for order 8."""
    return [
        Term(n, m, azimuth)
        for n in range(order + 1)
        for m in range(n % 2, n + 1, 2)
        for azimuth in range(n % 2, m + 1, 2)
    ]


@record(eq=False)
class ZernikeSeries:
    """An expansion of a BRDF in the functions H."""

    terms: list[Term]
    coefficients: Array
    """The coefficient of each term for linear RGB, 1/sr, shape (t, 3)."""

    def __post_init__(self) -> None:
        if self.coefficients.shape != (len(self.terms), 3) or not self.terms:
            raise ValueError(f"{self.coefficients.shape} coefficients of {len(self.terms)} terms")
        if not set(self.terms) <= set(terms_of(max(term.n for term in self.terms))):
            raise ValueError("orders must be n >= m >= azimuth >= 0, all odd or all even")

    def evaluate(self, light: Array, view: Array) -> Array:
        """Evaluate the series, which can be negative.

        `light` and `view`, each of shape (n, 3), are unit directions of the upper hemisphere.

        Returns an array of shape (n, 3): linear RGB, 1/sr, in double precision.
        """
        radial_i, radial_o, waves = _factors(self._order, light, view)
        total = np.zeros((len(light), 3))
        for wave, at_i, at_o, matrix in zip(waves, radial_i, radial_o, self._matrices, strict=True):
            for channel in range(1 if self._is_grey else 3):
                part = np.einsum("nj,nj->n", at_i @ matrix[..., channel], at_o)
                total[:, channel] += part * wave
        if self._is_grey:
            total[:, 1:] = total[:, :1]
        return total

    @cached_property
    def _order(self) -> int:
        return max(term.n for term in self.terms)

    @cached_property
    def _is_grey(self) -> bool:
        return bool((self.coefficients == self.coefficients[:, :1]).all())

    @cached_property
    def _matrices(self) -> list[Array]:
        """The coefficients for each l as a symmetric matrix between R_n^l and R_m^l, and RGB."""
        order = self._order
        sizes = [(order - azimuth) // 2 + 1 for azimuth in range(order + 1)]
        matrices: list[Array] = [np.zeros((size, size, 3)) for size in sizes]
        for term, coefficient in zip(self.terms, self.coefficients, strict=True):
            j, k = (term.n - term.azimuth) // 2, (term.m - term.azimuth) // 2
            matrices[term.azimuth][j, k] += coefficient * _norm(term)
            matrices[term.azimuth][k, j] += coefficient * _norm(term)
        return matrices


def basis(terms: list[Term], light: Array, view: Array) -> Array:
    """Evaluate the t functions H at unit directions (n, 3) above the horizon; shape (n, t)."""
    radial_i, radial_o, waves = _factors(max(term.n for term in terms), light, view)
    columns = []
    for term in terms:
        at_i, at_o = radial_i[term.azimuth], radial_o[term.azimuth]
        j, k = (term.n - term.azimuth) // 2, (term.m - term.azimuth) // 2
        pair = at_i[:, j] * at_o[:, k] + at_i[:, k] * at_o[:, j]
        columns.append(_norm(term) * pair * waves[term.azimuth])
    return np.stack(columns, axis=-1)


def fit_zernike(
    theta_i: ArrayLike,
    phi_i: ArrayLike,
    theta_r: ArrayLike,
    phi_r: ArrayLike,
    values: ArrayLike,
    order: int = 8,
    smoothing: float = 0.0,
) -> ZernikeSeries:
    """Fit a series to measurements by least squares; every measurement counts the same.

    The fit minimizes the mean square of the errors, plus the smoothing times the sum of ``(k C)^2``
    over the coefficients C, where k is ``n(n+2) + m(m+2)`` relative to its largest. So a
    coefficient stays the smaller, the less the measurements determine it and the faster its
    function varies.

    `theta_i`, `phi_i`, `theta_r` and `phi_r`, each of shape (n,), are angles of the directions to
    the light and to the viewer, radians. A negative theta means the other side of the normal.
    `values`, of shape (n,) or (n, 3), are the BRDF (1/sr), grey or linear RGB. `order` is 0 to 20.
    With a `smoothing` of 0 the fit reproduces published coefficients. With 1e-3 a fit to sparse
    measurements does not run away where nothing was measured.
    """
    if not 0 <= order <= MAX_ORDER:
        raise BrdfError(f"order {order} of a Zernike expansion is outside 0 .. {MAX_ORDER}")
    light, view = from_angles(theta_i, phi_i), from_angles(theta_r, phi_r)
    values = np.asarray(values, dtype=float)
    if not len(values):
        raise BrdfError("there is no measurement to fit")
    terms = terms_of(order)
    columns = values[:, None] if values.ndim == 1 else values
    functions = basis(terms, light, view)
    if smoothing > 0:
        roughness = np.array([n * (n + 2) + m * (m + 2) for n, m, _ in terms], dtype=float)
        weights = np.sqrt(smoothing * len(columns)) * roughness / max(roughness.max(), 1.0)
        functions = np.concatenate([functions, np.diag(weights)])
        columns = np.concatenate([columns, np.zeros((len(terms), columns.shape[1]))])
    found = np.linalg.lstsq(functions, columns, rcond=None)[0]
    return ZernikeSeries(terms, np.ascontiguousarray(np.broadcast_to(found, (len(terms), 3))))


def _norm(term: Term) -> float:
    """The factor N_nml that makes H_nml orthonormal."""
    n, m, azimuth = term
    doubled = (2 if n == m else 1) * (2 if azimuth == 0 else 1)
    return float(np.sqrt((n + 1) * (m + 1) / doubled) / (2 * np.pi))


def _factors(order: int, light: Array, view: Array) -> tuple[list[Array], list[Array], list[Array]]:
    """The factors of the functions H, for each azimuthal order l.

    Returns lists of arrays: ``R_n^l(r) / r^l`` of the light and of the view, of shape (n, (order -
    l) // 2 + 1), and waves of shape (n,), ``(r_i r_o)^l cos(l (phi_i - phi_o))``, by the recurrence
    for cosines of multiples.
    """
    light, view = light.astype(float), view.astype(float)
    # A direction is (x, y) / sqrt(1 + z) on the disk, and its squared radius there is 1 - z.
    square_i, square_o = 1 - light[:, 2], 1 - view[:, 2]
    across = light[:, 0] * view[:, 0] + light[:, 1] * view[:, 1]
    product = across / np.sqrt((1 + light[:, 2]) * (1 + view[:, 2]))
    waves: list[Array] = [np.ones(len(light)), product]
    for _ in range(order - 1):
        waves.append(2 * product * waves[-1] - square_i * square_o * waves[-2])
    powers = np.arange(order // 2 + 1)
    powers_i, powers_o = square_i[:, None] ** powers, square_o[:, None] ** powers
    radial = [_radial(order, azimuth) for azimuth in range(order + 1)]
    return (
        [powers_i[:, : len(r)] @ r for r in radial],
        [powers_o[:, : len(r)] @ r for r in radial],
        waves[: order + 1],
    )


def _radial(order: int, azimuth: int) -> Array:
    """Coefficients of ``R_n^l(r) / r^l``: rows are powers of r^2, columns n = l, l + 2 .."""
    size = (order - azimuth) // 2 + 1
    table = np.zeros((size, size))
    for column in range(size):
        n = azimuth + 2 * column
        for s in range(column + 1):
            below = factorial(s) * factorial(azimuth + column - s) * factorial(column - s)
            table[column - s, column] = (-1) ** s * factorial(n - s) // below
    return table


MAX_ROWS = 2**16

_SMOOTHING = 1e-3
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
        data = (line for line in file.first_lines(head) if line and not line.startswith("#"))
        first = next(data, "")
        return _is_table(first) or _COEFFICIENT_ROW.match(first) is not None

    @classmethod
    def open(cls, path: str | os.PathLike[str]) -> "Zernike":
        """Read a file of coefficients or of measurements."""
        lines = file.read_lines(path, "a file of BRDF measurements or Zernike coefficients")
        if not lines:
            raise BrdfError(f"{path}: holds no numbers; copy the file again")
        if len(lines) > MAX_ROWS:
            raise BrdfError(f"{path}: {len(lines):,} rows, more than {MAX_ROWS:,}; thin them out")
        if not _is_table(lines[0][1]):
            return cls(_coefficients(Path(path), lines), file.file_values(path))
        series, ceiling = _measurements(Path(path), lines)
        return cls(series, file.file_values(path), ceiling)

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
    numbers = file.parse_numbers(path, number, line.replace(",", " "), columns)
    if max(map(abs, numbers)) > file.LARGEST:
        raise BrdfError(f"{path}: line {number}: a number is beyond {file.LARGEST:g}; correct it")
    return numbers
