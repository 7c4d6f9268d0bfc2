"""Prefiltering a sum term by term, each about its own central direction."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.coefficients import BrdfCoefficients
from shrm_cli.brdf.sums import split
from shrm_cli.errors import BrdfError, OrderError
from shrm_cli.maps.prefiltered import Prefiltered
from shrm_cli.maps.provenance import provenance
from shrm_cli.maps.shrm.compressed import compressed
from shrm_cli.maps.shrm.shrm import Shrm
from shrm_cli.maps.shrm.summed import SummedShrm
from shrm_cli.maps.size import check_size
from shrm_cli.orders import (
    Orders,
    choose_orders,
    coefficient_count,
    error_bound,
    least_orders,
    predicted_error,
    reflected_rms,
)
from shrm_cli.probe.lighting import Lighting, project
from shrm_cli.probe.probe import Probe
from shrm_cli.progress import Progress
from shrm_cli.vocabulary import Frame, Sampling

_LOOSER = 2.0 ** (np.arange(24, -5, -1) / 4)
"""The tolerances that are tried for the terms, in units of the whole BRDF's: from 64 to a half."""
_LARGEST_TOLERANCE = 0.7
"""The largest tolerance that is tried for the terms."""


@dataclass(frozen=True)
class Term:
    """A term of a sum with its orders.

    Attributes
    ----------
    brdf : Brdf
    coefficients : BrdfCoefficients
        The coefficients of the term, to orders at least as high as `orders`.
    orders : Orders
        The orders that are kept.
    """

    brdf: Brdf
    coefficients: BrdfCoefficients
    orders: Orders

    @property
    def count(self) -> int:
        """The number of coefficients that are kept."""
        return coefficient_count(self.orders, self.coefficients)


@dataclass(frozen=True)
class Plan:
    """A BRDF that is split into terms whose combined error is at most that of the whole.

    Attributes
    ----------
    terms : tuple of Term
    whole : Term
        The whole BRDF, with the orders that it would need as one map.
    light : Lighting
        The light of the probe that the plan was made for, to the orders of all coefficients.
    """

    terms: tuple[Term, ...]
    whole: Term
    light: Lighting

    @property
    def count(self) -> int:
        """The number of coefficients of all terms."""
        return sum(term.count for term in self.terms)

    @property
    def pays(self) -> bool:
        """Whether the terms need fewer coefficients than the whole."""
        return self.count < self.whole.count


def plan_terms(
    brdf: Brdf, tolerance: float, probe: Probe, progress: Progress | None = None
) -> Plan | None:
    """Split a BRDF into terms, with orders that cause no larger error than those of the whole.

    The energy of a diffuse term is in its mean, and that of a glossy term is in its peak, so that
    the tolerance of the whole would ask too much of one of them. Therefore the terms are compared
    with the whole by the error of the reflected light, as it is predicted for this probe.

    Parameters
    ----------
    brdf : Brdf
    tolerance : float
        The fraction of the whole BRDF's energy that may be missed.
    probe : Probe
    progress : callable, optional
        Called with the number of rows of the probe that are read, and of all rows.

    Returns
    -------
    Plan or None
        None if there is nothing to split, or the terms cannot reach the error of the whole.

    Raises
    ------
    OrderError, BrdfError, ProbeError
        If the whole BRDF cannot be expanded, or the probe cannot be read.
    """
    terms = split(brdf)
    if len(terms) == 1:
        return None
    whole_orders, whole = choose_orders(brdf, tolerance)
    try:
        found = [choose_orders(term, tolerance)[1] for term in terms]
    except (OrderError, BrdfError):
        return None
    light = project(probe, max(each.order_f for each in [whole, *found]), progress)
    power = light.power()
    goal = predicted_error(power, whole, whole_orders.order_f, whole_orders.order_p)
    for factor in _LOOSER:
        chosen = [
            Term(term, each, least_orders(each, min(factor * tolerance, _LARGEST_TOLERANCE)))
            for term, each in zip(terms, found, strict=True)
        ]
        if combined_error(chosen, light) <= goal:
            return Plan(tuple(chosen), Term(brdf, whole, whole_orders), light)
    return None


def combined_error(terms: Sequence[Term], light: Lighting) -> float:
    """Predict the relative RMS error of a sum, taking the errors of its terms as independent.

    Each error is weighted by the light that its term reflects.
    """
    power = light.power()
    strengths = np.array([reflected_rms(power, term.coefficients) for term in terms])
    errors = [
        predicted_error(power, term.coefficients, term.orders.order_f, term.orders.order_p)
        for term in terms
    ]
    return float(np.linalg.norm(strengths * errors) / max(strengths.sum(), 1e-300))


def prefilter_terms(
    probe: Probe,
    plan: Plan,
    size: int | None = None,
    frame: Frame = "global",
    sampling: Sampling = "center",
    dtype: type = np.float64,
    compress: int | float | None = None,
) -> Prefiltered:
    """Prefilter the terms of a plan for its probe.

    Parameters
    ----------
    probe : Probe
        The probe that the plan was made for.
    plan : Plan
    size, frame, sampling, dtype, compress
        The form of each term's map, as `prefilter_shrm` takes it.

    Raises
    ------
    MapError
        If a term would be too large, or cannot be compressed as asked.
    """
    light = plan.light
    power = light.power()
    energies = np.array([term.coefficients.total_energy.sum() for term in plan.terms])
    kept = np.array([term.orders.captured for term in plan.terms])
    orders = Orders(
        max(term.orders.order_f for term in plan.terms),
        max(term.orders.order_p for term in plan.terms),
        plan.whole.orders.tolerance,
        float(np.sum(energies * kept) / max(energies.sum(), 1e-300)),
    )
    error = combined_error(plan.terms, light)
    info = replace(provenance(probe, plan.whole.brdf, orders), predicted_error=error)
    strengths = np.array([reflected_rms(power, term.coefficients) for term in plan.terms])
    shares = strengths / max(strengths.sum(), 1e-300)
    maps, added, bound = [], 0.0, 0.0
    for term, share in zip(plan.terms, shares, strict=True):
        f, p = term.orders.order_f, term.orders.order_p
        check_size(f, p, size)
        own = replace(info, order_f=f, order_p=p)
        built = Shrm.from_coefficients(
            light.coefficients, term.coefficients.truncated(f, p), term.brdf.center, own,
            size, frame, sampling, dtype,
        )  # fmt: skip
        few = compress
        if isinstance(few, int):  # a term of low order has few components
            few = min(few, (p + 1) ** 2)
        maps.append(compressed(built, few))
        added = float(np.hypot(added, share * maps[-1].info.added_error))
        bound += float(share * error_bound(power, light.energy, term.coefficients, f, p))
    info = replace(info, added_error=added)
    summed = SummedShrm(tuple(maps), info)  # type: ignore[arg-type]
    return Prefiltered(summed, {"error_bound": bound})
