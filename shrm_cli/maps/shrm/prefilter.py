"""How SHRMs are made: in the frequency domain, as one map or term by term.

The method is that of section 5.6.2 of Ramamoorthi's thesis.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from shrm_cli.brdf.coefficients import BrdfCoefficients
from shrm_cli.errors import ArgumentError
from shrm_cli.maps.base import Map
from shrm_cli.maps.expansion import Expansion, carry
from shrm_cli.maps.prefiltered import Prefiltered, error_lines, unkept_error, wrong_light
from shrm_cli.maps.request import Request
from shrm_cli.maps.shrm.budget import (
    SHRM_FORM,
    Choice,
    Form,
    affordable,
    halved,
    refuse_large,
    shortfall,
    within_error,
)
from shrm_cli.maps.shrm.shrm import from_expansion
from shrm_cli.maps.size import check_size, choose_size, total_error
from shrm_cli.orders import choose_center, choose_orders
from shrm_cli.probe.probe import Probe

if TYPE_CHECKING:
    from shrm_cli.probe.lighting import Projection

Notes = tuple[tuple[str, str], ...]
"""Headings and texts that tell people what was chosen automatically."""


def prefilter(probe: Probe, request: Request) -> Prefiltered:
    """Prefilter a probe for a BRDF.

    Raises
    ------
    ArgumentError, OrderError, ProbeError, BrdfError, MapError
    """
    from shrm_cli.brdf.sums import split as split_terms
    from shrm_cli.probe.lighting import Projection

    _refuse_contradictions(request)
    request, notes = centered(request)
    # Each term of a sum has a center of its own, and orders that are chosen from the tolerance, so
    # that neither can be given.
    is_whole = not request.is_free or request.center is not None
    brdf, split = request.brdf, request.own.get("split")
    if split and is_whole:
        raise ArgumentError(
            "split", "applies with neither `center` nor orders; leave one of them out"
        )
    if split and len(split_terms(brdf)) == 1:
        raise ArgumentError(
            "split",
            f"applies to sums, and to BRDFs with a diffuse part; {brdf!r} has a single term",
        )
    light = Projection(probe)
    if request.seen is not None:
        # Only maps that are judged by what is seen need these modules.
        from shrm_cli.maps.seen import kept_or_best
        from shrm_cli.maps.shrm.proposal import ShrmProposals
        from shrm_cli.plan.search import Goal

        goal, allowed = Goal.of(request.error, request.seen), request.allowed
        form = request.size, request.sampling
        shrms = ShrmProposals.known(light, brdf, goal.error, allowed, *form)
        return replace(kept_or_best(shrms.proposing(allowed), goal, allowed), notes=notes)
    if request.error is not None:
        return replace(_within_error(light, request, request.error), notes=notes)
    unsplit: tuple[str, ...] = ()
    chosen = None
    if not is_whole and split is not False and len(split_terms(brdf)) > 1:
        from shrm_cli.maps.shrm.terms import plan_terms, prefilter_terms

        chosen = affordable(light, request)
        plan = plan_terms(light, request, chosen)
        if plan is not None:
            takes = split or plan.pays
            count = f"{plan.count:,} coefficients as terms, {plan.whole.count:,} as one map"
            if plan.is_closer:
                count += " of more error"
            notes = (*notes, ("split" if takes else "not split", count))
            if takes:
                return replace(prefilter_terms(plan), notes=notes)
        elif split:
            unsplit = (f"{brdf!r} is not split: its terms cannot keep the error of the whole",)
    made = prefilter_shrm(light, request, chosen)
    warnings = (*unsplit, *order_warnings(made, request), *made.warnings)
    return replace(made, notes=notes, warnings=warnings)


def _refuse_contradictions(request: Request) -> None:
    """Refuse arguments of which one leaves another without effect."""
    if request.domain == "angular":
        raise ArgumentError(
            "domain",
            "angular does not apply to an SHRM, which is made in the frequency domain only; take "
            "`to` cabral, kautz-mccool or lightfield",
        )
    if request.source_height is not None:
        raise ArgumentError("source_height", "applies with `domain` angular")
    if request.error is None and request.seen is None:
        return
    asking = "error" if request.seen is None else "seen"
    for name in ("eps", "order_f", "order_p", "split"):
        if name in request.given:
            raise ArgumentError(name, f"does not apply with `{asking}`, which chooses the orders")
    if request.seen is not None and (request.frame != "global" or "compress" in request.own):
        name = "compress" if request.frame == "global" else "frame"
        raise ArgumentError(name, "does not apply with `seen`")


def _within_error(light: Projection, request: Request, error: float) -> Prefiltered:
    """Make the SHRM of the fewest bytes that keeps an error, or the best one."""
    allowed, form = request.allowed, (request.size, request.sampling)
    choice, coefficients, is_met = within_error(light, request.brdf, error, allowed, *form)
    found = replace(request, eps=choice.orders.eps, size=choice.size, max_size=allowed)
    made = prefilter_shrm(light, found, (choice, coefficients))
    if is_met:
        return made
    info = made.map.info
    total = total_error(info.predicted_error, info.filter_error)
    line = unkept_error(error, total, allowed, "take `to` auto")
    return replace(made, warnings=(*made.warnings, line))


def centered(request: Request) -> tuple[Request, Notes]:
    """Recenter the BRDF of a request about the center that is asked for.

    Returns
    -------
    request : Request
    notes : Notes
        How the center was chosen; empty unless it is ``auto``, the one of the fewest coefficients.

    Raises
    ------
    BrdfError, OrderError
        If the BRDF cannot be expanded about that center.
    """
    brdf, center = request.brdf, request.center
    if center is None:
        return request, ()
    if center != "auto":
        return replace(request, brdf=brdf.recentered(center)), ()  # type: ignore[arg-type]
    brdf, counts = choose_center(brdf, request.eps)
    needs = ", ".join(f"{count:,} about the {name}" for name, count in counts.items())
    why = f"coefficients: {needs}" if counts else "too sharp to count coefficients"
    return replace(request, brdf=brdf), (("centre", f"{brdf.center} ({why})"),)


def order_warnings(made: Prefiltered, request: Request) -> tuple[str, ...]:
    """Return a line for each way in which orders that are given fall short of what was asked for.

    Parameters
    ----------
    request : Request
        What it was made for.
    """
    if request.is_free:
        return ()
    from shrm_cli.plan import policy  # most orders are chosen

    info, brdf, lines = made.map.info, request.brdf, []
    if request.order_p is not None and request.order_p > info.order_p:
        lines.append(f"{brdf.name} does not depend on the view, so P = 0 only")
    if info.captured < 1 - request.eps and info.predicted_error > policy.ERROR:
        why = f"for F = {info.order_f} and P = {info.order_p} are too few orders of {brdf!r}"
        lines.append(wrong_light(info.predicted_error, why, "leave them to `eps`"))
    return tuple(lines)


def prefilter_shrm(
    light: Projection,
    request: Request,
    chosen: tuple[Choice, BrdfCoefficients] | None = None,
    dtype: type = np.float32,
) -> Prefiltered:
    """Prefilter a probe for a BRDF, and make one SHRM about the BRDF's own center.

    Parameters
    ----------
    light : Projection
        The light of the probe.
    chosen : tuple of Choice and BrdfCoefficients, optional
        What `affordable` returns, where it is known.
    dtype : type
        As `Shrm.from_coefficients` takes it.

    Returns
    -------
    Prefiltered
        The map, and what it misses of the tolerance as a warning, if the orders are chosen.

    Raises
    ------
    ArgumentError
        If no map fits into the bytes, or those of the given orders do not.
    OrderError, ProbeError, BrdfError, MapError
        If the tolerance cannot be met with a given order, the probe or the BRDF cannot be used, or
        the map would be too large.
    """
    expansion, warnings = expand(light, request, SHRM_FORM, chosen)
    made = from_expansion(expansion, light.probe, request, dtype)
    kept: Map = made
    compress = request.own.get("compress")
    if compress is not None:
        from shrm_cli.maps.shrm.compressed import compressed  # most maps are not

        kept = compressed(made, compress)

    def share() -> float | None:
        # Only a whole summary needs this module, which `--quiet` runs do without.
        from shrm_cli.maps.expansion import predicted_wrong_share, shown_wrong_share

        if kept.info.added_error:  # compression adds errors of its own
            return shown_wrong_share([expansion], kept)
        return predicted_wrong_share([expansion])

    facts = {"error_bound": expansion.bound}
    further = {"predicted_wrong_share": share}
    return Prefiltered(kept, facts, warnings=warnings, further=further)


def expand(
    light: Projection,
    request: Request,
    form: Form,
    chosen: tuple[Choice, BrdfCoefficients] | None = None,
) -> tuple[Expansion, tuple[str, ...]]:
    """Choose the orders and the size of a map within its bytes, and expand light and BRDF.

    Parameters
    ----------
    light, request, chosen
        The same as for `prefilter_shrm`.
    form : Form
        What the map holds that the SHRM is made for. Both have to fit into the bytes.

    Returns
    -------
    expansion : Expansion
    warnings : tuple of str
        What the map misses of the tolerance, and BRDFs that were not sampled finely enough.

    Raises
    ------
    ArgumentError, OrderError, ProbeError, BrdfError, MapError
        For the same reasons as `prefilter_shrm`.
    """
    brdf, order_f, order_p, size = request.brdf, request.order_f, request.order_p, request.size
    allowed, is_free, is_sized = request.allowed, request.is_free, size is not None
    if is_free:
        choice, coefficients = chosen or affordable(light, request, form.largest_p(allowed))
    else:
        if order_f is not None and not brdf.zonal:
            check_size(order_f, order_p or 0, size)
        orders, coefficients = choose_orders(brdf, request.eps, order_f, order_p)
        choice = Choice(orders, choose_size(orders.order_f) if size is None else size)
    count = form.images(choice.orders.order_p)
    if is_free and not is_sized:
        choice = halved(choice, coefficients, count, allowed) or choice
    orders, size = choice.orders, choice.size
    refuse_large(size, count, request.max_size)
    check_size(orders.order_f, orders.order_p, size)
    if form.check is not None:
        form.check(size, count)
    expansion = carry(
        light, brdf, orders, coefficients, size,
        is_exact=order_f is not None, is_exact_view=not is_free,
    )  # fmt: skip
    lines = [expansion.remark]
    if is_free:
        lines.append(shortfall(brdf, coefficients, orders, allowed, expansion.error, form))
    return expansion, tuple(line for line in lines if line is not None)


def report(result: dict[str, Any]) -> list[str]:
    """Return the lines for people about an SHRM, from what ``--json`` prints."""
    size, maps = result["size"], result["maps"]
    unit = "components" if "components" in result else "coefficients"
    what = f"{result['frame']} SHRM, 6 x {size} x {size} texels of {maps} {unit}"
    return [what, *error_lines(result, "leaving out principal components")]
