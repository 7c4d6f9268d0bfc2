"""How maps with a BRDF's own functions of the view are made, in the frequency domain."""

from dataclasses import replace

from shrm_cli.errors import ArgumentError
from shrm_cli.maps.options import bytes_text
from shrm_cli.maps.prefiltered import Prefiltered, unkept_error, wrong_light
from shrm_cli.maps.principal.proposal import Proposal, Proposals
from shrm_cli.maps.principal.terms import kept_form
from shrm_cli.maps.request import Request
from shrm_cli.maps.seen import kept_or_best
from shrm_cli.plan import policy
from shrm_cli.plan.search import ROUNDING, Goal
from shrm_cli.probe.lighting import Projection
from shrm_cli.probe.probe import Probe

_ANY_SIZE = 2**32
"""More bytes than maps may have."""


def prefilter(probe: Probe, request: Request) -> Prefiltered:
    """Prefilter a probe for a BRDF.

    Raises
    ------
    ArgumentError, OrderError, ProbeError, BrdfError
    """
    for asking in ("error", "seen"):
        if asking in request.given and "maps" in request.own:
            raise ArgumentError("maps", f"does not apply with `{asking}`, which chooses them")
    goal = None if request.seen is None else Goal.of(request.error, request.seen)
    asked = request if goal is None else replace(request, error=goal.error)
    proposals = Proposals(Projection(probe), asked)
    if goal is not None:
        return kept_or_best(proposals.candidate, goal, request.allowed)
    proposal = proposals.propose()
    unmet = _unmet(proposals, proposal, request.error, request.allowed)
    return proposal.make([] if unmet is None else [unmet])


def _unmet(
    proposals: Proposals, proposal: Proposal, error: float | None, max_size: int
) -> str | None:
    """Say that an error is not kept, or that light is wrong because a tolerance is not."""
    total = proposal.total_error
    if error is not None:
        if total <= error * ROUNDING:
            return None
        return unkept_error(error, total, max_size, _sufficient(proposals, proposal))
    if total <= policy.ERROR or all(term.is_met for term in proposal.terms):
        return None
    why = f"bilinear look-ups included: {bytes_text(max_size)} before packing hold too little of it"
    return wrong_light(total, why, "raise `max_size`")


def _sufficient(proposals: Proposals, proposal: Proposal) -> str:
    """Return which number of bytes would keep the errors of all terms, or what helps without."""
    needed = 0
    for planner, want in zip(proposals.planners, proposal.wanted, strict=True):
        free = replace(want, max_size=_ANY_SIZE)
        form, is_met = kept_form(planner, want.error or 0.0, free)
        if not is_met:
            return "dim the lamps with `clamp`"
        needed = max(needed, form.bytes)
    # Every broad term gets the same share. It is rounded up to what `bytes_text` shows.
    needed *= proposals.broad
    step = 10 ** max(len(str(needed)) - 2, 0)
    return f"raise `max_size` to {bytes_text(-(-needed // step) * step)}"
