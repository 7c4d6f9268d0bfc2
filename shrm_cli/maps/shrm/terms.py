"""Prefiltering a sum term by term, each about its own central direction.

Transfer functions hold every degree p of the view, so that whoever has them for another form knows
the errors of SHRMs without sampling the BRDF again.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import field, replace
from functools import cache, cached_property, partial

import numpy as np

from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.coefficients import BrdfCoefficients
from shrm_cli.brdf.sums import split
from shrm_cli.brdf.transfer import TransferFunctions
from shrm_cli.errors import ArgumentError, BrdfError
from shrm_cli.maps.expansion import Expansion, carry, map_wrong_share, predicted_wrong_share
from shrm_cli.maps.info import provenance
from shrm_cli.maps.joint import joint_error
from shrm_cli.maps.request import Prefiltered, Request
from shrm_cli.maps.shrm.make import (
    Choice,
    affordable,
    fitting,
    from_expansion,
    map_errors,
    most_order_p,
    prefilter_shrm,
    shortfall,
    sufficient_tolerance,
)
from shrm_cli.maps.shrm.shrm import CompressedShrm, Shrm, compressed
from shrm_cli.maps.shrm.summed import SummedShrm
from shrm_cli.maps.size import (
    TRIED_SIZES,
    check_size,
    choose_size,
    largest_p,
    nothing_fits,
    sizes_of,
    stored_bytes,
    supported_order,
    total_error,
)
from shrm_cli.orders import Orders, choose_orders, coefficient_count, least_orders
from shrm_cli.plan import policy
from shrm_cli.plan.search import Candidate, Rough, Row, fewest_bytes
from shrm_cli.probe.lighting import Lighting, Projection
from shrm_cli.probe.probe import Probe
from shrm_cli.records import record
from shrm_cli.reflected import predicted_error, reflected_rms
from shrm_cli.vocabulary import DEFAULT_EPS, MAX_ORDER_P


@record(eq=False)
class Term:
    """A term of a sum with its orders."""

    brdf: Brdf
    coefficients: BrdfCoefficients
    """The coefficients of the term, to orders at least as high as those of the choice."""
    choice: Choice
    """The orders that are kept, and the size of the map."""

    @property
    def needs(self) -> float:
        """The bytes that meet the tolerance; infinite where the coefficients do not reach it."""
        orders = self.choice.orders
        return self.choice.bytes if orders.captured >= 1 - orders.eps else np.inf

    @property
    def count(self) -> int:
        """The number of coefficients that are kept."""
        return coefficient_count(self.choice.orders, self.coefficients)


@record(eq=False)
class Plan:
    """A BRDF that is split into terms whose combined error is at most that of the whole."""

    terms: tuple[Term, ...]
    whole: Term
    """The whole BRDF, with the orders that it would have as one map."""
    light: Projection
    """The light of the probe that the plan was made for."""
    request: Request
    """What is asked of the whole."""
    is_closer: bool = False
    """Whether the whole falls short of its tolerance within these bytes, and the terms make less
    error."""

    @property
    def count(self) -> int:
        """The number of coefficients of all terms."""
        return sum(term.count for term in self.terms)

    @property
    def bytes(self) -> int:
        """The bytes of all terms in half precision, before they are packed."""
        return sum(term.choice.bytes for term in self.terms)

    @property
    def pays(self) -> bool:
        """Whether the terms need fewer coefficients than the whole, or come closer than it can."""
        return self.is_closer or self.count < self.whole.count


def plan_terms(
    light: Projection, request: Request, chosen: tuple[Choice, BrdfCoefficients] | None = None
) -> Plan | None:
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
    choice, coefficients = chosen or affordable(light, request)
    whole = Term(request.brdf, coefficients, choice)
    most_p = most_order_p(allowed, request.size)
    try:
        found = [choose_orders(term, eps, most_p=most_p)[1] for term in terms]
    except BrdfError:
        return None
    lighting = light.to_order(max(each.order_f for each in [coefficients, *found]))
    together = reflected_rms(lighting, coefficients)
    goal = _total_error([whole], lighting, together)
    if choice.orders.captured < 1 - eps:
        shared = _shared(terms, found, lighting, request)
        if shared is None or _total_error(shared, lighting, together) >= goal:
            return None
        return Plan(shared, whole, light, request, is_closer=True)
    enough = max(_truncation_error([whole], lighting), policy.NO_ERROR)
    for factor in policy.LOOSER:
        looser = min(factor * eps, policy.LARGEST_TOLERANCE)
        plan = Plan(
            tuple(
                _least_term(term, each, looser, request.size)
                for term, each in zip(terms, found, strict=True)
            ),
            whole,
            light,
            request,
        )
        if plan.bytes > allowed:
            return None
        is_close = _truncation_error(plan.terms, lighting) <= enough
        if is_close and _total_error(plan.terms, lighting, together) <= goal:
            return plan
    return None


def _shared(
    terms: Sequence[Brdf],
    coefficients: Sequence[BrdfCoefficients],
    lighting: Lighting,
    request: Request,
) -> tuple[Term, ...] | None:
    """Share the bytes of a map among terms, as each needs or alike; None if one does not fit."""
    pairs = zip(terms, coefficients, strict=True)
    made = [_least_term(brdf, each, request.eps, request.size) for brdf, each in pairs]
    order = sorted(range(len(made)), key=lambda index: made[index].needs)
    left = request.allowed
    for done, index in enumerate(order):
        share, term = left // (len(made) - done), made[index]
        if term.needs > share:
            try:
                # Where the edge texels lie tells no form from another.
                part = replace(request, max_size=share, sampling="center")
                choice, known = fitting(term.brdf, term.coefficients, lighting, part)
            except ArgumentError:
                return None
            made[index] = replace(term, choice=choice, coefficients=known)
        left -= made[index].choice.bytes
    return tuple(made)


def _least_term(brdf: Brdf, coefficients: BrdfCoefficients, eps: float, size: int | None) -> Term:
    """Return a term with the least orders that meet a tolerance."""
    orders = least_orders(coefficients, eps)
    return Term(
        brdf, coefficients, Choice(orders, choose_size(orders.order_f) if size is None else size)
    )


def _truncation_error(terms: Sequence[Term], light: Lighting) -> float:
    """Return the error of terms that end at F and P, and are bright in the same places.

    It judges the orders alone. The light that maps carry beyond F hides what a small F leaves out
    of them, but it is F that decides their sizes.
    """
    orders = [term.choice.orders for term in terms]
    errors = [
        predicted_error(light, term.coefficients, each.order_f, each.order_p)
        for term, each in zip(terms, orders, strict=True)
    ]
    strengths = _strengths(terms, light)
    return joint_error(strengths, errors, sum(strengths))


def _total_error(terms: Sequence[Term], light: Lighting, whole: float) -> float:
    """Predict the error of the map of a sum, with look-ups; the sum reflects the RMS `whole`."""
    errors = []
    for each in terms:
        choice = each.choice
        error, find = map_errors(light, each.coefficients, choice.orders.order_p, choice.size)
        errors.append(total_error(error, find()))
    return joint_error(_strengths(terms, light), errors, whole)


def _strengths(terms: Sequence[Term], light: Lighting) -> list[float]:
    """Return the RMS of the light that each term reflects."""
    return [reflected_rms(light, term.coefficients) for term in terms]


def prefilter_terms(plan: Plan, dtype: type = np.float32) -> Prefiltered:
    """Prefilter the terms of a plan for its probe. `dtype` is as `prefilter_shrm` takes it."""
    probe, light = plan.light.probe, plan.light
    expansions = [
        carry(light, term.brdf, term.choice.orders, term.coefficients, term.choice.size)
        for term in plan.terms
    ]
    strengths = [reflected_rms(each.lighting, each.coefficients) for each in expansions]
    whole = provenance(probe, plan.whole.brdf, _joint_orders(plan))
    of_whole = plan.whole.coefficients
    together = reflected_rms(light.to_order(of_whole.order_f), of_whole)
    maps = [_term_map(each, probe, plan.request, dtype) for each in expansions]
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
    remarks = {each.remark: None for each in expansions if each.remark is not None}
    missed = _shortfall(plan, info.predicted_error)
    warnings = (*remarks, *([] if missed is None else [missed]))
    made = SummedShrm(tuple(maps), info)

    facts = {"error_bound": bound}
    further = {"predicted_wrong_share": partial(map_wrong_share, expansions, made)}
    return Prefiltered(made, facts, warnings=warnings, further=further)


def _shortfall(plan: Plan, error: float) -> str | None:
    """Say what the terms miss of the tolerance, where the whole misses it within the bytes too."""
    eps = plan.whole.choice.orders.eps
    kept = [plan.whole.choice.orders, *(term.choice.orders for term in plan.terms)]
    if kept[0].captured >= 1 - eps or all(e.captured >= 1 - eps for e in kept[1:]):
        return None
    worst = min(plan.terms, key=lambda term: term.choice.orders.captured)
    orders = replace(worst.choice.orders, eps=eps)
    return shortfall(worst.brdf, worst.coefficients, orders, plan.request.allowed, error)


def _joint_orders(plan: Plan) -> Orders:
    """Return the largest orders of the terms, and the energy that they capture together."""
    orders = [term.choice.orders for term in plan.terms]
    energies = np.array([term.coefficients.total_energy.sum() for term in plan.terms])
    captured = energies @ [each.captured for each in orders] / max(energies.sum(), 1e-300)
    return Orders(
        max(each.order_f for each in orders),
        max(each.order_p for each in orders),
        plan.whole.choice.orders.eps,
        float(captured),
    )


def _term_map(
    expansion: Expansion, probe: Probe, request: Request, dtype: type
) -> Shrm | CompressedShrm:
    """Make the map of a term; a term of low order has few components to keep."""
    orders, compress = expansion.orders, request.own.get("compress")
    check_size(orders.order_f, orders.order_p, expansion.size)
    few = min(compress, (orders.order_p + 1) ** 2) if isinstance(compress, int) else compress
    return compressed(from_expansion(expansion, probe, request, dtype), few)


# ---- SHRMs that could be made, known by bytes and errors -----------------------------------------


OTHERS = "other forms may: take `to` auto"
"""What is said where no SHRM keeps what is asked."""


@record
class Tried:
    """Orders and a size of an SHRM, and the errors of its map."""

    choice: Choice
    error: float
    """The relative RMS error of its orders."""
    find_filter_error: Callable[[], float] = field(repr=False, compare=False)
    """Finds that of looking it up, which takes far longer."""

    @property
    def bytes(self) -> int:
        return self.choice.bytes

    @property
    def least_error(self) -> float:
        return total_error(self.error)

    @cached_property
    def total_error(self) -> float:
        return total_error(self.error, self.find_filter_error())


@record(eq=False)
class ShrmProposals:
    """The SHRMs of a probe and a BRDF of a single term."""

    light: Projection
    request: Request
    """What they are asked for: the BRDF, the texels, and the bytes."""
    coefficients: BrdfCoefficients

    @classmethod
    def of(
        cls, light: Projection, request: Request, transfer: TransferFunctions
    ) -> "ShrmProposals":
        """Expand transfer functions into coefficients of the largest P that maps have."""
        is_zonal = request.brdf.zonal
        order_p = 0 if is_zonal else min(MAX_ORDER_P, 2 * len(transfer.theta_o) // 3)
        return cls(light, request, BrdfCoefficients.of(transfer, order_p, is_zonal))

    @classmethod
    def known(cls, light: Projection, request: Request, error: float) -> "ShrmProposals":
        """Compute the coefficients that maps of about an error need."""
        eps, least = sufficient_tolerance(error), sizes_of(request.size)[0]

        def most_p(order_f: int) -> int:
            """Return the largest P of any map: light may need far fewer texels than F does."""
            return largest_p(min(order_f, supported_order(least)), least, request.allowed)

        return cls(light, request, choose_orders(request.brdf, eps, most_p=most_p)[1])

    def rows(
        self, max_size: int, most_p: int = MAX_ORDER_P, eps: float = DEFAULT_EPS
    ) -> Iterator[Row[Tried]]:
        """Yield the SHRMs that fit into a number of bytes, and have at most a P, by their size.

        Their F, which is only stated, may miss a part `eps` of the BRDF's energy.
        """
        for size in sizes_of(self.request.size):
            carried = min(supported_order(size), self.coefficients.order_f)
            most = min(largest_p(carried, size, max_size), self.coefficients.order_p, most_p)
            yield Row(most + 1, partial(_bytes_at, size), partial(self._tried, eps, size))

    @cached_property
    def _tried(self) -> Callable[[float, int, int], Tried]:
        """From `eps`, a size and an order P to an SHRM; searches ask for some again and again."""

        def find(eps: float, size: int, p: int) -> Tried:
            coefficients = self.coefficients
            carried = min(supported_order(size), coefficients.order_f)
            f = min(least_orders(coefficients, eps, order_p=p).order_f, carried)
            captured = float(coefficients.captured[carried, p])
            choice = Choice(Orders(f, p, 1 - captured, captured), size)
            lighting, sampling = self.light.to_order(coefficients.order_f), self.request.sampling
            return Tried(choice, *map_errors(lighting, coefficients, p, size, sampling))

        return cache(find)

    def least(
        self, error: float, max_size: int, eps: float = DEFAULT_EPS
    ) -> tuple[Tried, bool] | None:
        """Return the SHRM of the fewest bytes that keeps an error, or the best one that fits.

        The second of the two is whether it keeps the error; None where no map fits.
        """
        return fewest_bytes(self.rows(max_size, eps=eps), error)

    def wrong_by_views(self, most_p: int) -> float:
        """Predict the share of wrong pixels of SHRMs to a P that lose nothing else.

        They hold all degrees of the light that are known, which takes little time.
        """
        known = self.coefficients
        orders = Orders(known.order_f, min(most_p, known.order_p), DEFAULT_EPS, 1.0)
        form = self.light, self.request.brdf, orders, known, TRIED_SIZES[0]
        return predicted_wrong_share([carry(*form, is_exact=True)])

    def fits(self, max_size: int) -> bool:
        """Tell whether any map fits into a number of bytes."""
        return stored_bytes(sizes_of(self.request.size)[0], 1) <= max_size

    def within(self, max_size: int, most_p: int = MAX_ORDER_P) -> "ShrmsWithin":
        """Return the maps of at most so many bytes, and to a P, as searches ask for them."""
        return ShrmsWithin(self, max_size, most_p)

    def candidate(self, tried: Tried, max_size: int) -> Candidate[Prefiltered]:
        """Return one of these SHRMs as the search knows it."""
        choice, coefficients, asked = tried.choice, self.coefficients, self.request

        def wrong_share() -> float:
            made = carry(self.light, asked.brdf, choice.orders, coefficients, choice.size)
            return predicted_wrong_share([made])

        def make() -> Prefiltered:
            request = Request(
                "shrm", asked.brdf, choice.orders.eps, size=choice.size,
                sampling=asked.sampling, max_size=max_size,
            )  # fmt: skip
            return prefilter_shrm(self.light, request, (choice, coefficients), np.float64)

        look_ups = (choice.orders.order_p + 1) ** 2
        return Candidate(
            "shrm", tried.bytes, look_ups, tried.total_error, wrong_share, make, limit=OTHERS
        )

    def rough(self, tried: Tried, max_size: int) -> Rough[Prefiltered]:
        """Return one of these SHRMs as a search by what is seen knows it."""
        found = self.candidate(tried, max_size)
        return Rough(tried.bytes, tried.total_error, found.find_wrong_share, lambda: found)


@record(eq=False)
class ShrmsWithin:
    """SHRMs of at most so many bytes, and to a P."""

    proposals: ShrmProposals
    max_size: int
    most_p: int

    def candidate(self, error: float) -> Candidate[Prefiltered]:
        found = fewest_bytes(self.proposals.rows(self.max_size, self.most_p), error)
        if found is None:
            raise nothing_fits(self.proposals.request.size)
        return self.proposals.candidate(found[0], self.max_size)

    def rows(self, max_size: int) -> Iterator[Row[Rough[Prefiltered]]]:
        """Yield all maps of at most so many bytes."""
        for row in self.proposals.rows(min(max_size, self.max_size), self.most_p):
            yield row.mapped(lambda tried: self.proposals.rough(tried, self.max_size))


def _bytes_at(size: int, order_p: int) -> int:
    return stored_bytes(size, (order_p + 1) ** 2)
