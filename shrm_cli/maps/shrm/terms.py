"""Prefiltering a sum term by term, each about its own central direction."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from shrm_cli.brdf.sums import split
from shrm_cli.errors import ArgumentError, BrdfError
from shrm_cli.maps.expansion import Chosen, Expansion, carry, map_wrong_share
from shrm_cli.maps.info import provenance
from shrm_cli.maps.joint import joint_error
from shrm_cli.maps.request import Prefiltered, Request
from shrm_cli.maps.shrm.make import affordable, from_expansion, most_order_p, shortfall
from shrm_cli.maps.shrm.rows import fitting
from shrm_cli.maps.shrm.shrm import CompressedShrm, Shrm, compressed
from shrm_cli.maps.shrm.summed import SummedShrm
from shrm_cli.maps.size import check_size
from shrm_cli.orders import Orders, choose_orders, coefficient_count, least_orders
from shrm_cli.plan import policy
from shrm_cli.probe.lighting import Lighting, Projection
from shrm_cli.records import record
from shrm_cli.reflected import predicted_error, reflected_rms


@record(eq=False)
class Plan:
    """A BRDF that is split into terms whose combined error is at most that of the whole."""

    terms: tuple[Chosen, ...]
    whole: Chosen
    """The whole BRDF, with the orders that it would have as one map."""
    light: Projection
    """The light of the probe that the plan was made for."""
    request: Request
    """What is asked of the whole."""
    is_closer: bool = False
    """Whether the whole falls short of its tolerance within these bytes, and the terms make less
    error."""

    @property
    def counts(self) -> tuple[int, int]:
        """The numbers of coefficients of all terms, and of the whole."""
        of_whole, *own = (
            coefficient_count(each.orders, each.coefficients) for each in (self.whole, *self.terms)
        )
        return sum(own), of_whole

    @property
    def pays(self) -> bool:
        """Whether the terms need fewer coefficients than the whole, or come closer than it can."""
        return self.is_closer or self.counts[0] < self.counts[1]


def plan_terms(light: Projection, request: Request, whole: Chosen | None = None) -> Plan | None:
    """Split a BRDF into terms, with orders that cause no larger error than those of the whole.

    The energy of a diffuse term is in its mean, and that of a glossy term is in its peak, so that
    the tolerance of the whole would ask too much of one of them. Therefore the terms are compared
    with the whole by the error of the reflected light, as it is predicted for this probe.

    A size in `request` is that of every term.

    Returns None if there is nothing to split, or the terms cannot reach the error of the whole
    within the bytes.
    """
    eps, allowed = request.eps, request.allowed
    terms = split(request.brdf)
    if len(terms) == 1:
        return None
    whole = whole or affordable(light, request)
    most_p = most_order_p(allowed, request.size)
    try:
        found = [choose_orders(term, eps, most_p=most_p)[1] for term in terms]
    except BrdfError:
        return None

    def least(eps: float) -> tuple[Chosen, ...]:
        """Return the terms with the least orders that meet a tolerance."""
        return tuple(
            Chosen.of(term, (least_orders(each, eps), each), request.size)
            for term, each in zip(terms, found, strict=True)
        )

    lighting = light.to_order(max(each.order_f for each in [whole.coefficients, *found]))
    together = reflected_rms(lighting, whole.coefficients)
    goal = _total_error([whole], lighting, together)
    if not whole.is_met:
        shared = _shared(least(eps), light, request)
        if shared is None or _total_error(shared, lighting, together) >= goal:
            return None
        return Plan(shared, whole, light, request, is_closer=True)
    enough = max(_truncation_error([whole], lighting), policy.NO_ERROR)
    for factor in policy.LOOSER:
        looser = least(min(factor * eps, policy.LARGEST_TOLERANCE))
        if sum(term.bytes for term in looser) > allowed:
            return None
        is_close = _truncation_error(looser, lighting) <= enough
        if is_close and _total_error(looser, lighting, together) <= goal:
            return Plan(looser, whole, light, request)
    return None


def _shared(
    terms: Sequence[Chosen], light: Projection, request: Request
) -> tuple[Chosen, ...] | None:
    """Share the bytes of a map among terms, as each needs or alike; None if one does not fit."""
    made = list(terms)
    needs = [term.bytes if term.is_met else np.inf for term in made]
    left = request.allowed
    for done, index in enumerate(np.argsort(needs, kind="stable")):
        share = left // (len(made) - done)
        if needs[index] > share:
            try:
                # Where the edge texels lie tells no form from another.
                part = replace(request, max_size=share, sampling="center")
                made[index] = fitting(light, made[index], part)
            except ArgumentError:
                return None
        left -= made[index].bytes
    return tuple(made)


def _truncation_error(terms: Sequence[Chosen], light: Lighting) -> float:
    """Return the error of terms that end at F and P, and are bright in the same places.

    It judges the orders alone. The light that maps carry beyond F hides what a small F leaves out
    of them, but it is F that decides their sizes.
    """
    errors = [
        predicted_error(light, each.coefficients, each.orders.order_f, each.orders.order_p)
        for each in terms
    ]
    strengths = _strengths(terms, light)
    return joint_error(strengths, errors, sum(strengths))


def _total_error(terms: Sequence[Chosen], light: Lighting, whole: float) -> float:
    """Predict the error of the map of a sum, with look-ups; the sum reflects the RMS `whole`."""
    errors = [Expansion.known(each, light).total_error for each in terms]
    return joint_error(_strengths(terms, light), errors, whole)


def _strengths(terms: Sequence[Chosen], light: Lighting) -> list[float]:
    """Return the RMS of the light that each term reflects."""
    return [reflected_rms(light, term.coefficients) for term in terms]


def prefilter_terms(plan: Plan, dtype: type = np.float32) -> Prefiltered:
    """Prefilter the terms of a plan for its probe. `dtype` is as `prefilter_shrm` takes it."""
    probe, light = plan.light.probe, plan.light
    sampling = plan.request.sampling
    expansions = [carry(light, term, sampling=sampling) for term in plan.terms]
    strengths = [reflected_rms(each.lighting, each.coefficients) for each in expansions]
    whole = provenance(probe, plan.whole.brdf, _joint_orders(plan))
    of_whole = plan.whole.coefficients
    together = reflected_rms(light.to_order(of_whole.order_f), of_whole)
    maps = [_term_map(each, plan, dtype) for each in expansions]
    maps = [replace(each, info=replace(each.info, brdf=whole.brdf)) for each in maps]
    infos = [each.info for each in maps]
    info = replace(
        whole,
        predicted_error=joint_error(strengths, [e.predicted_error for e in infos], together),
        added_error=joint_error(strengths, [e.added_error for e in infos], together),
        filter_error=joint_error(strengths, [e.filter_error for e in infos], together),
        carried=max(each.order_carried for each in infos),
    )
    bounds = np.array([each.bound for each in expansions])
    bound = float(bounds @ strengths / max(together, 1e-300))
    warnings = list(dict.fromkeys(each.remark for each in expansions if each.remark is not None))
    if not (plan.whole.is_met or all(term.is_met for term in plan.terms)):
        worst = min(plan.terms, key=lambda term: term.orders.captured)
        missed = shortfall(worst, plan.request.allowed, info.predicted_error)
        warnings += [] if missed is None else [missed]
    made = SummedShrm(tuple(maps), info)

    facts = {"error_bound": bound}
    further = {"predicted_wrong_share": partial(map_wrong_share, expansions, made)}
    return Prefiltered(made, facts, warnings=tuple(warnings), further=further)


def _joint_orders(plan: Plan) -> Orders:
    """Return the largest orders of the terms, and the energy that they capture together."""
    orders = [term.orders for term in plan.terms]
    energies = np.array([term.coefficients.total_energy.sum() for term in plan.terms])
    captured = energies @ [each.captured for each in orders] / max(energies.sum(), 1e-300)
    return Orders(
        max(each.order_f for each in orders),
        max(each.order_p for each in orders),
        plan.whole.orders.eps,
        float(captured),
    )


def _term_map(expansion: Expansion, plan: Plan, dtype: type) -> Shrm | CompressedShrm:
    """Make the map of a term; a term of low order has few components to keep."""
    orders, compress = expansion.orders, plan.request.own.get("compress")
    check_size(orders.order_f, orders.order_p, expansion.size)
    few = min(compress, (orders.order_p + 1) ** 2) if isinstance(compress, int) else compress
    made = from_expansion(expansion, plan.light.probe, plan.request.frame, dtype)
    return compressed(made, few)
