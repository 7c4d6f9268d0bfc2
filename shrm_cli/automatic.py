"""`to` auto: the form of the fewest bytes whose picture is right, and one line that says why.

What is asked is what is seen: few pixels may be wrong, the light's RMS error is small, and nothing
visible is negative. An SHRM is made wherever it keeps that in few bytes, because its shader is the
simplest; a map of principal functions otherwise, which keeps it in the fewest bytes of all.
"""

from dataclasses import replace
from functools import partial

from shrm_cli.brdf.sums import split
from shrm_cli.maps.negative import negative_share
from shrm_cli.maps.options import bytes_text
from shrm_cli.maps.prefiltered import Prefiltered
from shrm_cli.maps.principal.proposal import Proposals
from shrm_cli.maps.request import Request
from shrm_cli.maps.seen import goal_text, kept_or_best
from shrm_cli.maps.shrm.prefilter import prefilter as shrm_prefilter
from shrm_cli.maps.shrm.proposal import ShrmProposals
from shrm_cli.maps.size import total_error
from shrm_cli.plan import policy
from shrm_cli.plan.search import Candidate, Goal, first_kept
from shrm_cli.probe.lighting import Projection
from shrm_cli.probe.probe import Probe
from shrm_cli.records import record
from shrm_cli.vocabulary import NEGATIVE_SHARE


@record(eq=False)
class _Asked:
    """What is asked for, and the light."""

    light: Projection
    request: Request
    goal: Goal

    @property
    def max_size(self) -> int:
        """The most bytes of the map."""
        return self.request.allowed


def prefilter(probe: Probe, request: Request) -> Prefiltered:
    """Choose a form and make its map.

    Returns
    -------
    Prefiltered
        With a note that says which form was taken and why. Where no form keeps what is asked for,
        the best one, and a warning that says by how much and what would.

    Raises
    ------
    ArgumentError, ProbeError, BrdfError
    """
    asked = _Asked(Projection(probe), request, Goal.of(request.error, request.seen))
    is_single = all(term.zonal for term in split(request.brdf))
    made = _of_single_cubes(asked) if is_single else None
    return made or _of_functions(asked)


def _of_single_cubes(asked: _Asked) -> Prefiltered | None:
    """Make the SHRM of a BRDF whose terms are one cube each, if it keeps what is asked for.

    Its size is that which the tolerance asks for: fewer texels would save no kilobytes.
    """
    by_eps = replace(asked.request, error=None, seen=None)
    made = shrm_prefilter(asked.light.probe, by_eps)
    info = made.map.info
    total = total_error(info.predicted_error, info.filter_error)
    find = made.further["predicted_wrong_share"]
    candidate = Candidate("shrm", 0, 0, total, find, lambda: made)
    if made.warnings or not candidate.keeps(asked.goal) or _is_dark(made):
        return None
    return _noted(made, f"SHRM, which keeps {goal_text(asked.goal)}")


def _of_functions(asked: _Asked) -> Prefiltered:
    """Make a map of principal functions, or an SHRM where it does as well."""
    proposals = Proposals(asked.light, replace(asked.request, error=asked.goal.error))
    instead = partial(_simple_shrm, asked, proposals)
    made = kept_or_best(proposals.candidate, asked.goal, asked.max_size, instead)
    if made.map.representation == "shrm":
        return made
    return _noted(made, f"principal: {_why_no_shrm(asked, proposals, made)}")


def _simple_shrm(
    asked: _Asked, proposals: Proposals, kept: Candidate[Prefiltered]
) -> Prefiltered | None:
    """Make the SHRM that keeps the goal in few bytes and coefficients, if there is one."""
    if len(proposals.parts) > 1:
        return None  # each term would want an SHRM of its own, with a shader of many look-ups
    # Whoever asks for an error alone asks for the fewest bytes, and not for a picture.
    times = 1 if asked.goal.wrong_share is None else policy.SIMPLE_TIMES
    most, shrms = min(times * kept.bytes, asked.max_size), _shrms(asked, proposals)
    if not shrms.fits(most):
        return None
    tried, is_kept = first_kept(shrms.proposing(most, policy.SIMPLE_ORDER_P), asked.goal)
    if not is_kept:
        return None
    made = tried[-1].make()
    if _is_dark(made):
        return None
    bytes_ = bytes_text(tried[-1].bytes)
    return _noted(made, f"SHRM, which keeps {goal_text(asked.goal)} in {bytes_}")


def _shrms(asked: _Asked, proposals: Proposals) -> ShrmProposals:
    """Return the SHRMs of a BRDF of a single term, about its own center.

    Principal maps may be about another one, where their transfer functions do not tell.
    """
    form = asked.request.size, asked.request.sampling
    part, brdf = proposals.parts[0], asked.request.brdf
    if asked.request.center is not None or part.center == brdf.center:
        return ShrmProposals.of(asked.light, part, proposals.planners[0].spectrum.transfer, *form)
    return ShrmProposals.known(asked.light, brdf, asked.goal.error, asked.max_size, *form)


def _why_no_shrm(asked: _Asked, proposals: Proposals, made: Prefiltered) -> str:
    """Say what an SHRM of the same error takes, or what one of all the bytes would be like."""
    if len(proposals.parts) > 1:
        return "an SHRM would hold every term with harmonics of its own"
    error = total_error(made.map.info.predicted_error, made.map.info.filter_error)
    best = _shrms(asked, proposals).least(error, asked.max_size)
    if best is None:
        return "no SHRM fits"
    if best.total_error <= error:
        return f"an SHRM of its error takes {bytes_text(best.bytes)}"
    return f"an SHRM of {bytes_text(best.bytes)} would have {best.total_error:.1%} RMS error"


def _is_dark(made: Prefiltered) -> bool:
    """Tell whether anything visible is negative."""
    return negative_share(made.map) > NEGATIVE_SHARE


def _noted(made: Prefiltered, why: str) -> Prefiltered:
    """Add the note about the form, before all others."""
    return replace(made, notes=(("form", why), *made.notes))
