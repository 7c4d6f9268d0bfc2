"""Prefiltering a sum term by term, each about its own central direction."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.coefficients import BrdfCoefficients
from shrm_cli.brdf.sums import split
from shrm_cli.errors import BrdfError, OrderError
from shrm_cli.maps.prefiltered import Baked, provenance
from shrm_cli.maps.representations import Compression, represent
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
"""Tolerances of the terms that are tried, in units of the whole's: from 64 to a half."""
_LARGEST_TOLERANCE = 0.7


@dataclass(frozen=True)
class Term:
    """A term of a sum with its orders.

    Attributes
    ----------
    brdf : Brdf
    coefficients : BrdfCoefficients
        To higher orders.
    orders : Orders
    """

    brdf: Brdf
    coefficients: BrdfCoefficients
    orders: Orders

    @property
    def count(self) -> int:
        return coefficient_count(self.orders, self.coefficients)


@dataclass(frozen=True)
class Plan:
    """A BRDF come apart into terms whose error together is that of the whole.

    Attributes
    ----------
    terms : tuple of Term
    whole : Term
    light : Lighting
        Of the probe that it was made for, to the orders of all coefficients.
    """

    terms: tuple[Term, ...]
    whole: Term
    light: Lighting

    @property
    def count(self) -> int:
        """Coefficients of all terms."""
        return sum(term.count for term in self.terms)

    @property
    def pays(self) -> bool:
        """Whether the terms need fewer coefficients."""
        return self.count < self.whole.count


def plan_terms(
    brdf: Brdf, tolerance: float, probe: Probe, progress: Progress | None = None
) -> Plan | None:
    """The terms of a BRDF, to orders that make no larger error than those of the whole.

    The energy of a diffuse term is in its mean, that of a glossy one in its peak: one and the
    same tolerance would ask too much of one of them. So what counts is the error of the light
    that is reflected, as predicted for this probe.

    Parameters
    ----------
    brdf : Brdf
    tolerance : float
        Of the whole.
    probe : Probe
    progress : callable, optional
        Called with rows read and rows in all.

    Returns
    -------
    Plan or None
        None where there is nothing to split, or terms cannot reach that error.
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
    """Relative RMS error of a sum, from independent errors of its terms.

    Each counts by the light that its term reflects.
    """
    power = light.power()
    strengths = np.array([reflected_rms(power, term.coefficients) for term in terms])
    errors = [
        predicted_error(power, term.coefficients, term.orders.order_f, term.orders.order_p)
        for term in terms
    ]
    return float(np.linalg.norm(strengths * errors) / max(strengths.sum(), 1e-300))


def bake_terms(
    probe: Probe,
    plan: Plan,
    size: int | None = None,
    frame: Frame = "global",
    sampling: Sampling = "center",
    dtype: type = np.float64,
    compression: Compression | None = None,
) -> Baked:
    """Prefilter the terms of a plan for its probe; the arguments are those of `bake`.

    Raises
    ------
    MapError
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
        built = Shrm.build(
            light.coefficients, term.coefficients.truncated(f, p), term.brdf.center, own,
            size, frame, sampling, dtype,
        )  # fmt: skip
        few = compression
        if few is not None and few.count is not None:  # a diffuse term has a single map
            few = replace(few, count=min(few.count, (p + 1) ** 2))
        maps.append(represent(built, "shrm", None, few))
        added = float(np.hypot(added, share * maps[-1].info.added_error))
        bound += float(share * error_bound(power, light.energy, term.coefficients, f, p))
    info = replace(info, added_error=added)
    return Baked(SummedShrm(tuple(maps), info), orders, bound)  # type: ignore[arg-type]
