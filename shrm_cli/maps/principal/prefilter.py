"""How maps with a BRDF's own functions of the view are made, in the frequency domain."""

from dataclasses import replace

from shrm_cli.brdf.base import Brdf
from shrm_cli.errors import ArgumentError
from shrm_cli.maps.options import bytes_text
from shrm_cli.maps.prefiltered import Prefiltered
from shrm_cli.maps.principal.proposal import Proposal, Proposals
from shrm_cli.maps.principal.terms import Wanted, kept_form
from shrm_cli.maps.seen import kept_or_best
from shrm_cli.plan.search import Goal
from shrm_cli.probe.lighting import Projection
from shrm_cli.probe.probe import Probe
from shrm_cli.progress import Progress
from shrm_cli.vocabulary import DEFAULT_EPS, DEFAULT_MAX_SIZE, Sampling

_ANY_SIZE = 2**32
"""More bytes than maps may have."""
_ROUNDING = 1 + 1e-9
"""How much more than what was asked for counts as the same."""


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
        return kept_or_best(proposals.candidate, goal, max_size)
    proposal = proposals.propose()
    unmet = _unmet(proposal, error, max_size)
    if unmet and error is not None:
        unmet += _sufficient(proposals, proposal)
    return proposal.make([unmet] if unmet else [])


def _unmet(proposal: Proposal, error: float | None, max_size: int) -> str:
    """Return a line about an error or a tolerance that the map does not keep, or nothing."""
    total = proposal.total_error
    if error is not None and total > error * _ROUNDING:
        return (
            f"`error` {error:g} cannot be kept within `max_size` {bytes_text(max_size)}; the best "
            f"map has {total:.1%}"
        )
    if error is None and not all(term.is_met for term in proposal.terms):
        eps = proposal.info.tolerance
        return (
            f"{bytes_text(max_size)} hold no map that misses only `eps` {eps:g}; the best one has "
            f"an error of {total:.1%}, bilinear look-ups included; raise `max_size`"
        )
    return ""


def _sufficient(proposals: Proposals, proposal: Proposal) -> str:
    """Return which number of bytes would keep the errors of all terms, or nothing."""
    needed = 0
    for planner, want in zip(proposals.planners, proposal.wanted, strict=True):
        free = replace(want, max_size=_ANY_SIZE)
        form, is_met = kept_form(planner, want.error or 0.0, free)
        if not is_met:
            return ""
        needed = max(needed, form.bytes)
    # Every broad term gets the same share. It is rounded up to what `bytes_text` shows.
    needed *= proposals.broad
    step = 10 ** max(len(str(needed)) - 2, 0)
    return f"; it takes `max_size` {bytes_text(-(-needed // step) * step)}"
