"""How maps with a BRDF's own functions of the view are made, in the frequency domain."""

from shrm_cli.brdf.base import Brdf
from shrm_cli.errors import ArgumentError
from shrm_cli.maps.options import bytes_text
from shrm_cli.maps.prefiltered import Prefiltered, unkept_error, wrong_light
from shrm_cli.maps.principal.proposal import Proposal, Proposals
from shrm_cli.maps.principal.terms import Wanted
from shrm_cli.plan import policy
from shrm_cli.plan.search import ROUNDING, Goal
from shrm_cli.probe.lighting import Projection
from shrm_cli.probe.probe import Probe
from shrm_cli.progress import Progress
from shrm_cli.vocabulary import DEFAULT_EPS, DEFAULT_MAX_SIZE, Sampling

_ANY_SIZE = 2**32
"""More bytes than maps may have."""


def prefilter(
    probe: Probe,
    brdf: Brdf,
    eps: float = DEFAULT_EPS,
    center: str | None = None,
    size: int | None = None,
    sampling: Sampling = "center",
    error: float | None = None,
    seen: float | None = None,
    maps: int | None = None,
    divide: bool = False,
    max_size: int = DEFAULT_MAX_SIZE,
    progress: Progress | None = None,
) -> Prefiltered:
    """Prefilter a probe for a BRDF; the arguments are those of `shrm_cli.prefilter.prefilter`.

    Raises
    ------
    ArgumentError, OrderError, ProbeError, BrdfError
    """
    if error is not None and maps is not None:
        raise ArgumentError("maps", "does not apply with `error`, which chooses them")
    if seen is not None and maps is not None:
        raise ArgumentError("maps", "does not apply with `seen`, which chooses them")
    goal = None if seen is None else Goal.of(error, seen)
    asked = Wanted(eps, error if goal is None else goal.error, maps, max_size, size)
    proposals = Proposals(Projection(probe, progress), brdf, asked, center, sampling, divide)
    if goal is not None:
        # Only maps that are judged by what is seen need this module.
        from shrm_cli.maps.seen import kept_or_best

        return kept_or_best(proposals.candidate, goal, max_size)
    proposal = proposals.propose()
    unmet = _unmet(proposals, proposal, error, max_size)
    return proposal.make([] if unmet is None else [unmet])


def _unmet(
    proposals: Proposals, proposal: Proposal, error: float | None, max_size: int
) -> str | None:
    """Say that an error is not kept, or that light is wrong because a tolerance is not."""
    total = proposal.total_error
    if error is not None:
        if total <= error * ROUNDING:
            return None
        return unkept_error(error, total, max_size, _sufficient(proposals, error))
    if total <= policy.ERROR or all(term.is_met for term in proposal.terms):
        return None
    why = f"bilinear look-ups included: {bytes_text(max_size)} before packing hold too little of it"
    return wrong_light(total, why, "raise `max_size`")


def _sufficient(proposals: Proposals, error: float) -> str:
    """Return which number of bytes would keep the error, or what helps without."""
    free, is_met = proposals.sharing.kept(error, _ANY_SIZE, proposals.asked.size)
    if not is_met:
        return "dim the lamps with `clamp`"
    step = 10 ** max(len(str(free.bytes)) - 2, 0)  # rounded up to what `bytes_text` shows
    return f"raise `max_size` to {bytes_text(-(-free.bytes // step) * step)}"
