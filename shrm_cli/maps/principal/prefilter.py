"""How maps with a BRDF's own functions of the view are made, in the frequency domain."""

from dataclasses import replace
from typing import Any

from shrm_cli.maps.base import REMEDY
from shrm_cli.maps.options import bytes_text, counted
from shrm_cli.maps.principal.proposal import TABLED, Proposal, Proposals
from shrm_cli.maps.request import Prefiltered, Request, error_lines, unkept_error, wrong_light
from shrm_cli.plan.search import ROUNDING, Goal, rising
from shrm_cli.probe.lighting import Projection
from shrm_cli.probe.probe import Probe
from shrm_cli.vocabulary import DEFAULT_ERROR

_ANY_SIZE = 2**32
"""More bytes than maps may have."""


def prefilter(probe: Probe, request: Request) -> Prefiltered:
    """Prefilter a probe for a BRDF."""
    goal = None if request.seen is None else Goal.of(request.error, request.seen)
    asked = request if goal is None else replace(request, error=goal.error)
    proposals = Proposals(Projection(probe), asked)
    if goal is not None:
        # Only maps that are judged by what is seen need these modules.
        from shrm_cli.maps.seen import kept_or_best
        from shrm_cli.maps.wrong_pixels import truth_of

        candidates = rising(proposals, goal, request.allowed)
        truth, size = truth_of(probe, request.brdf), request.size
        return kept_or_best(candidates, goal, request.allowed, truth=truth, size=size)
    proposal = proposals.propose()
    unmet = _unmet(proposals, proposal, request)
    return proposal.make([] if unmet is None else [unmet])


def _unmet(proposals: Proposals, proposal: Proposal, request: Request) -> str | None:
    """Say that an error is not kept, or that light is wrong because a tolerance is not."""
    total, error = proposal.total_error, request.error
    if error is not None:
        if total <= error * ROUNDING:
            return None
        return unkept_error(error, total, request.allowed, _sufficient(proposals, error))
    if total <= DEFAULT_ERROR or proposal.is_met:
        return None
    before = f"{bytes_text(request.allowed)} before packing"
    why = f"bilinear look-ups included: {before} hold too little of it"
    return wrong_light(total, why, "leave out `eps`, or raise `max_size`")


def _sufficient(proposals: Proposals, error: float) -> str:
    """Return which number of bytes would keep the error, or what helps without."""
    sharing, size = proposals.sharing, proposals.asked.size
    free, is_met = sharing.kept(error, _ANY_SIZE, size)
    if not is_met and sharing.within_error(error, _ANY_SIZE, size)[1]:
        return TABLED
    if not is_met:
        return f"lamps need the most: {REMEDY}"
    step = 10 ** max(len(str(free.bytes)) - 2, 0)  # rounded up to what `bytes_text` shows
    return f"raise `max_size` to {bytes_text(-(-free.bytes // step) * step)}"


def report(result: dict[str, Any]) -> list[str]:
    """Return the lines for people about principal functions, from what ``--json`` prints."""
    size, maps = result["size"], result["maps"]
    what = f"principal functions, 6 x {size} x {size} texels of {counted(maps, 'map')}"
    return [what, *error_lines(result, "resampling")]
