"""How SHRMs are made: in the frequency domain, as one map or term by term.

The method is that of section 5.6.2 of Ramamoorthi's thesis.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.coefficients import BrdfCoefficients
from shrm_cli.errors import ArgumentError
from shrm_cli.maps.base import Map
from shrm_cli.maps.expansion import Expansion, carry
from shrm_cli.maps.prefiltered import Prefiltered
from shrm_cli.maps.remarks import unkept_error, wrong_light
from shrm_cli.maps.shrm.budget import (
    SHRM_FORM,
    Choice,
    Form,
    affordable,
    allowed_bytes,
    halved,
    refuse_large,
    shortfall,
    within_error,
)
from shrm_cli.maps.shrm.single import from_expansion
from shrm_cli.maps.size import check_size, choose_size, total_error
from shrm_cli.orders import choose_center, choose_orders
from shrm_cli.plan import policy
from shrm_cli.probe.probe import Probe
from shrm_cli.progress import Progress
from shrm_cli.vocabulary import DEFAULT_EPS, Frame, Sampling

if TYPE_CHECKING:
    from shrm_cli.probe.lighting import Projection

Notes = tuple[tuple[str, str], ...]
"""Headings and texts that tell people what was chosen automatically."""


def prefilter(
    probe: Probe,
    brdf: Brdf,
    eps: float | None = None,
    error: float | None = None,
    seen: float | None = None,
    order_f: int | None = None,
    order_p: int | None = None,
    center: str | None = None,
    split: bool | None = None,
    frame: Frame = "global",
    size: int | None = None,
    sampling: Sampling = "center",
    compress: int | float | None = None,
    domain: str = "frequency",
    source_height: int | None = None,
    max_size: int | None = None,
    progress: Progress | None = None,
) -> Prefiltered:
    """Prefilter a probe for a BRDF; the arguments are those of `shrm_cli.prefilter.prefilter`.

    Raises
    ------
    ArgumentError, OrderError, ProbeError, BrdfError, MapError
    """
    from shrm_cli.brdf.sums import split as split_terms
    from shrm_cli.probe.lighting import Projection

    if domain == "angular":
        raise ArgumentError(
            "domain",
            "angular does not apply to an SHRM, which is made in the frequency domain only; take "
            "`to` cabral, kautz-mccool or lightfield",
        )
    if source_height is not None:
        raise ArgumentError("source_height", "applies with `domain` angular")
    asking = "error" if seen is None else "seen"
    if error is not None or seen is not None:
        given = {"eps": eps, "order_f": order_f, "order_p": order_p, "split": split}
        for name in (name for name, value in given.items() if value is not None):
            raise ArgumentError(name, f"does not apply with `{asking}`, which chooses the orders")
    if seen is not None and (frame, compress) != ("global", None):
        name = "compress" if frame == "global" else "frame"
        raise ArgumentError(name, "does not apply with `seen`")
    eps = DEFAULT_EPS if eps is None else eps
    brdf, notes = centered(brdf, eps, center, progress)
    # Each term of a sum has a center of its own, and orders that are chosen from the tolerance, so
    # that neither can be given.
    is_free = (order_f, order_p, center) == (None, None, None)
    if split and not is_free:
        raise ArgumentError(
            "split", "applies with neither `center` nor orders; leave one of them out"
        )
    if split and len(split_terms(brdf)) == 1:
        raise ArgumentError(
            "split",
            f"applies to sums, and to BRDFs with a diffuse part; {brdf!r} has a single term",
        )
    light = Projection(probe, progress)
    if seen is not None:
        # Only maps that are judged by what is seen need these modules.
        from shrm_cli.maps.seen import kept_or_best
        from shrm_cli.maps.shrm.proposal import ShrmProposals
        from shrm_cli.plan.search import Goal

        goal, allowed = Goal.of(error, seen), allowed_bytes(max_size, size)
        shrms = ShrmProposals.known(light, brdf, goal.error, allowed, size, sampling)
        return replace(kept_or_best(shrms.proposing(allowed), goal, allowed), notes=notes)
    if error is not None:
        made = _within_error(
            light, brdf, error, size, frame, sampling, compress, allowed_bytes(max_size, size)
        )
        return replace(made, notes=notes)
    unsplit: tuple[str, ...] = ()
    chosen = None
    if is_free and split is not False and len(split_terms(brdf)) > 1:
        from shrm_cli.maps.shrm.terms import plan_terms, prefilter_terms

        allowed = allowed_bytes(max_size, size)
        chosen = affordable(light, brdf, eps, allowed, size, sampling)
        plan = plan_terms(light, brdf, eps, allowed, size, chosen)
        if plan is not None:
            takes = split or plan.pays
            count = f"{plan.count:,} coefficients as terms, {plan.whole.count:,} as one map"
            if plan.is_closer:
                count += " of more error"
            notes = (*notes, ("split" if takes else "not split", count))
            if takes:
                made = prefilter_terms(plan, frame, sampling, np.float32, compress)
                return replace(made, notes=notes)
        elif split:
            unsplit = (f"{brdf!r} is not split: its terms cannot keep the error of the whole",)
    made = prefilter_shrm(
        light, brdf, eps, order_f, order_p, size, frame, sampling, np.float32, compress, max_size,
        chosen=chosen,
    )  # fmt: skip
    warnings = () if is_chosen(order_f, order_p) else order_warnings(made, brdf, eps, order_p)
    return replace(made, notes=notes, warnings=(*unsplit, *warnings, *made.warnings))


def _within_error(
    light: Projection,
    brdf: Brdf,
    error: float,
    size: int | None,
    frame: Frame,
    sampling: Sampling,
    compress: int | float | None,
    max_size: int,
) -> Prefiltered:
    """Make the SHRM of the fewest bytes that keeps an error, or the best one."""
    choice, coefficients, is_met = within_error(light, brdf, error, max_size, size, sampling)
    made = prefilter_shrm(
        light, brdf, choice.orders.tolerance, size=choice.size, frame=frame, sampling=sampling,
        dtype=np.float32, compress=compress, max_size=max_size, chosen=(choice, coefficients),
    )  # fmt: skip
    if is_met:
        return made
    info = made.map.info
    total = total_error(info.predicted_error, info.filter_error)
    line = unkept_error(error, total, max_size, "take `to` auto")
    return replace(made, warnings=(*made.warnings, line))


def is_chosen(order_f: int | None, order_p: int | None) -> bool:
    """Return whether both orders are chosen from the tolerance, because neither is given."""
    return order_f is None and order_p is None


def centered(
    brdf: Brdf, tolerance: float, center: str | None, progress: Progress | None = None
) -> tuple[Brdf, Notes]:
    """Recenter a BRDF about the center that is asked for.

    Parameters
    ----------
    brdf : Brdf
    tolerance : float
        The fraction of the BRDF's energy that may be missed.
    center : {"auto", "reflection", "normal", "tangent"}, optional
        ``auto`` is the center that needs the fewest coefficients; None is the BRDF's own.
    progress : callable, optional
        As `choose_orders` takes it.

    Returns
    -------
    brdf : Brdf
    notes : Notes
        How the center was chosen; empty unless it is ``auto``.

    Raises
    ------
    BrdfError, OrderError
        If the BRDF cannot be expanded about that center.
    """
    if center is None:
        return brdf, ()
    if center != "auto":
        return brdf.recentered(center), ()  # type: ignore[arg-type]
    brdf, counts = choose_center(brdf, tolerance, progress)
    needs = ", ".join(f"{count:,} about the {name}" for name, count in counts.items())
    why = f"coefficients: {needs}" if counts else "too sharp to count coefficients"
    return brdf, (("centre", f"{brdf.center} ({why})"),)


def order_warnings(
    made: Prefiltered, brdf: Brdf, tolerance: float, order_p: int | None
) -> tuple[str, ...]:
    """Return a line for each way in which the orders of a map fall short of what was asked for.

    Parameters
    ----------
    made : Prefiltered
    brdf : Brdf
    tolerance : float
        The fraction of the BRDF's energy that may be missed.
    order_p : int, optional
        The order P that was asked for.
    """
    info, lines = made.map.info, []
    if order_p is not None and order_p > info.order_p:
        lines.append(f"{brdf.name} does not depend on the view, so P = 0 only")
    if info.captured < 1 - tolerance and info.predicted_error > policy.ERROR:
        why = f"for F = {info.order_f} and P = {info.order_p} are too few orders of {brdf!r}"
        lines.append(wrong_light(info.predicted_error, why, "leave them to `eps`"))
    return tuple(lines)


def prefilter_shrm(
    light: Projection,
    brdf: Brdf,
    tolerance: float,
    order_f: int | None = None,
    order_p: int | None = None,
    size: int | None = None,
    frame: Frame = "global",
    sampling: Sampling = "center",
    dtype: type = np.float64,
    compress: int | float | None = None,
    max_size: int | None = None,
    chosen: tuple[Choice, BrdfCoefficients] | None = None,
) -> Prefiltered:
    """Prefilter a probe for a BRDF, and make one SHRM about the BRDF's own center.

    Parameters
    ----------
    light : Projection
        The light of the probe.
    brdf : Brdf
    tolerance : float
        The fraction of the BRDF's energy that may be missed.
    order_f, order_p : int, optional
        Orders to use instead of the chosen ones. With `order_f` nothing is carried beyond it.
    size, frame, sampling, dtype
        The form of the map, as `Shrm.from_coefficients` takes it.
    compress : int or float, optional
        How far the map is compressed, as `compressed` takes it.
    max_size : int, optional
        The most bytes of the map. By default a map whose orders are chosen takes at most
        `vocabulary.DEFAULT_MAX_SIZE`, and orders that are given are obeyed.
    chosen : tuple of Choice and BrdfCoefficients, optional
        What `affordable` returns, where it is known.

    Returns
    -------
    Prefiltered
        The map, and what it misses of the tolerance as a warning, if the orders are chosen.

    Raises
    ------
    ArgumentError
        If no map fits into `max_size`, or those of the given orders do not.
    OrderError, ProbeError, BrdfError, MapError
        If the tolerance cannot be met with a given order, the probe or the BRDF cannot be used, or
        the map would be too large.
    """
    expansion, warnings = expand(
        light, brdf, tolerance, order_f, order_p, size, sampling, max_size, SHRM_FORM, chosen
    )
    made = from_expansion(expansion, light.probe, frame, sampling, dtype, light.progress)
    kept: Map = made
    if compress is not None:
        from shrm_cli.maps.shrm.compressed import compressed  # most maps are not

        kept = compressed(made, compress)

    def share() -> float | None:
        # Only a whole summary needs this module, which `--quiet` runs do without.
        from shrm_cli.maps.wrong_share import predicted_wrong_share, shown_wrong_share

        if kept.info.added_error:  # compression adds errors of its own
            return shown_wrong_share([expansion], kept)
        return predicted_wrong_share([expansion])

    facts = {"error_bound": expansion.bound}
    further = {"predicted_wrong_share": share}
    return Prefiltered(kept, facts, warnings=warnings, further=further)


def expand(
    light: Projection,
    brdf: Brdf,
    tolerance: float,
    order_f: int | None,
    order_p: int | None,
    size: int | None,
    sampling: Sampling,
    max_size: int | None,
    form: Form,
    chosen: tuple[Choice, BrdfCoefficients] | None = None,
) -> tuple[Expansion, tuple[str, ...]]:
    """Choose the orders and the size of a map within its bytes, and expand light and BRDF.

    Parameters
    ----------
    light, brdf, tolerance, order_f, order_p, size, sampling, max_size, chosen
        The same as for `prefilter_shrm`.
    form : Form
        What the map holds that the SHRM is made for. Both have to fit into `max_size`.

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
    allowed = allowed_bytes(max_size, size)
    is_free = is_chosen(order_f, order_p)
    is_sized = size is not None
    if is_free:
        most = form.largest_p(allowed)
        choice, coefficients = chosen or affordable(
            light, brdf, tolerance, allowed, size, sampling, most
        )
    else:
        if order_f is not None and not brdf.zonal:
            check_size(order_f, order_p or 0, size)
        orders, coefficients = choose_orders(
            brdf, tolerance, order_f, order_p, progress=light.progress
        )
        choice = Choice(orders, choose_size(orders.order_f) if size is None else size)
    count = form.images(choice.orders.order_p)
    if is_free and not is_sized:
        choice = halved(choice, coefficients, count, allowed) or choice
    orders, size = choice.orders, choice.size
    refuse_large(size, count, max_size)
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
