"""Laws of the time of each part, fitted to measurements by least squares.

A power law tells by which power of each quantity a time grows, to be held beside Ramamoorthi's
table 5.3. A sum of terms, none negative, tells what a case that was not measured will take.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import nnls

from shrm_cli.maps.size import supported_order

Array = NDArray[np.floating]


@dataclass(frozen=True)
class PowerLaw:
    """A constant times powers of quantities.

    Attributes
    ----------
    constant : float
        Seconds where all quantities are 1.
    exponents : ndarray
        One for each quantity.
    spread : float
        The RMS of the logarithms' residuals: 0.1 means that the law is off by a tenth.
    """

    constant: float
    exponents: Array
    spread: float


def fit_powers(quantities: ArrayLike, seconds: ArrayLike) -> PowerLaw:
    """Fit a power law by least squares of logarithms.

    Parameters
    ----------
    quantities : array_like, shape (cases, quantities)
        All positive.
    seconds : array_like, shape (cases,)
        All positive.
    """
    logs, wanted = np.log(np.asarray(quantities, float)), np.log(np.asarray(seconds, float))
    rows = np.column_stack([np.ones(len(logs)), logs])
    found = np.linalg.lstsq(rows, wanted, rcond=None)[0]
    spread = float(np.sqrt(np.mean((rows @ found - wanted) ** 2)))
    return PowerLaw(float(np.exp(found[0])), found[1:], spread)


@dataclass(frozen=True)
class Case:
    """What the time of a prefilter depends on.

    Attributes
    ----------
    rows : int
        The height of the probe, a lat-long.
    order_f : int
        The order F to which the light is carried.
    order_p : int
        The order P.
    size : int
        Texels along a face's edge, S.
    """

    rows: int
    order_f: int
    order_p: int
    size: int

    @property
    def pixels(self) -> int:
        return 2 * self.rows**2

    @property
    def light(self) -> int:
        """The order L to which the light is projected: all that the texels and the probe tell.

        A map of lower orders needs it too, for the errors that it predicts.
        """
        most = max(self.order_f, supported_order(self.size, self.order_p))
        return max(1, min(most, self.rows - 1))

    @property
    def maps(self) -> int:
        """The coefficient maps of one colour's SHRM."""
        return (self.order_p + 1) ** 2

    @property
    def values(self) -> int:
        """The numbers in an SHRM."""
        return 18 * self.size**2 * self.maps


Term = Callable[[Case], float]
TERMS: Mapping[str, Mapping[str, Term]] = {
    "read": {"1": lambda c: 1, "pixels": lambda c: c.pixels},
    "hash": {"1": lambda c: 1, "pixels": lambda c: c.pixels},
    "project": {
        "1": lambda c: 1, "pixels": lambda c: c.pixels, "L^2 rows": lambda c: c.light**2 * c.rows,
        "L^3": lambda c: c.light**3,
    },
    "couple": {
        "F": lambda c: c.order_f, "P (P+1)": lambda c: c.order_p * (c.order_p + 1),
        "F P (P+1)^2": lambda c: c.order_f * c.order_p * c.maps,
        "F^2 P (P+1)^2": lambda c: c.order_f**2 * c.order_p * c.maps,
    },
    "synthesise": {
        "1": lambda c: 1, "(P+1)^2": lambda c: c.maps,
        "(P+1)^2 (F+P)^3": lambda c: c.maps * _band(c) ** 3,
        "(P+1)^2 F S": lambda c: c.maps * _band(c) * c.size,
        "(P+1)^2 S^2": lambda c: c.maps * c.size**2,
        "(P+1)^2 F S^2": lambda c: c.maps * _band(c) * c.size**2,
    },
    "predict": {
        "1": lambda c: 1, "(P+1)^2": lambda c: c.maps, "F^2": lambda c: c.order_f**2,
        "F (P+1)^2": lambda c: c.order_f * c.maps, "F^3": lambda c: c.order_f**3,
        "(P+1)^2 S^2": lambda c: c.maps * c.size**2,
    },
    "encode": {"1": lambda c: 1, "values": lambda c: c.values},
    "write": {"1": lambda c: 1, "values": lambda c: c.values},
}  # fmt: skip
"""The terms that the time of each part may have."""


def _band(case: Case) -> int:
    return case.order_f + case.order_p


@dataclass(frozen=True)
class Sum:
    """A sum of terms.

    Attributes
    ----------
    factors : dict of str to float
        Seconds by the names of terms; those that measurements gave nothing are left out.
    terms : mapping of str to callable
    spread : float
        The RMS of the relative residuals.
    """

    factors: dict[str, float]
    terms: Mapping[str, Term]
    spread: float

    def seconds(self, case: Case) -> float:
        return sum(factor * self.terms[name](case) for name, factor in self.factors.items())


def fit_sum(terms: Mapping[str, Term], cases: Sequence[Case], seconds: Sequence[float]) -> Sum:
    """Fit a sum of terms without negative ones, by least squares of relative residuals.

    Parameters
    ----------
    terms : mapping of str to callable
    cases : sequence of Case
    seconds : sequence of float
        All positive.
    """
    wanted = np.asarray(seconds, float)
    rows = np.array([[term(case) for term in terms.values()] for case in cases], float)
    rows /= wanted[:, None]
    scale = rows.max(axis=0)  # the terms are of very different sizes
    found, _ = nnls(rows / scale, np.ones(len(wanted)))
    spread = float(np.sqrt(np.mean((rows / scale @ found - 1) ** 2)))
    factors = dict(zip(terms, (found / scale).tolist(), strict=True))
    return Sum({name: each for name, each in factors.items() if each > 0}, terms, spread)
