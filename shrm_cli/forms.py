"""The maps of a light that `to` auto chooses from: of principal functions, and SHRMs as good.

What their pictures have to keep is here, too. They know of no lamps that could lie beside a map,
which `shrm_cli.automatic` adds.
"""

import math
from dataclasses import replace
from functools import cached_property

from shrm_cli.brdf.sums import split
from shrm_cli.maps.options import bytes_text
from shrm_cli.maps.principal.proposal import Proposals
from shrm_cli.maps.request import Prefiltered, Request
from shrm_cli.maps.seen import as_candidate, goal_text, judged, known_error
from shrm_cli.maps.shrm.prefilter import prefilter as shrm_prefilter
from shrm_cli.maps.shrm.proposals import ShrmProposals
from shrm_cli.maps.wrong_pixels import Truth, examined, negative_in, truth_of
from shrm_cli.plan import policy
from shrm_cli.plan.search import Candidate, Goal, first_kept, rising
from shrm_cli.probe.lighting import Projection
from shrm_cli.probe.probe import Probe
from shrm_cli.probe.shared import shared
from shrm_cli.records import Replayed, once_each, record

FORM = "form"
"""The heading of the note that says which form was taken and why."""


@record(eq=False)
class Forms:
    """What is asked for, the light, and the maps that could be made of it."""

    probe: Probe
    request: Request
    left: float = 1.0
    """The RMS of what the probe's light makes, over that of all light, where lamps lie beside."""
    most_simple: float = math.inf
    """The most bytes of an SHRM that takes the place of a map of principal functions."""
    whole: Probe | None = None
    """The probe with its lamps, where they lie beside."""
    together: Goal | None = None
    """What a map and the lamps beside it have to keep, in parts of all light."""

    @cached_property
    def light(self) -> Projection:
        """The light of the probe, whose pixels are cut where they are large."""
        fine = self.probe
        if fine.may_be_coarse:
            from shrm_cli.probe.coarse import fine_probe  # which most runs do not need

            fine = fine_probe(fine)
        return Projection(shared(fine))

    @cached_property
    def goal(self) -> Goal:
        """What the picture has to keep."""
        return Goal.of(self.request.error, self.request.seen)

    @property
    def goal_words(self) -> str:
        """What the picture keeps, in words."""
        return goal_text(self.together or self.goal)

    @cached_property
    def truth(self) -> Truth:
        """What is reflected."""
        return truth_of(self.whole or self.light.probe, self.request.brdf)

    @cached_property
    def single_cubes(self) -> Candidate[Prefiltered] | None:
        """The SHRM of a BRDF whose terms are one cube each, if it keeps what is asked for.

        Its size is that which the tolerance asks for: fewer texels would save no kilobytes.
        """
        if not all(term.zonal for term in split(self.request.brdf)):
            return None
        by_eps = replace(self.request, error=None, seen=None)
        made = shrm_prefilter(self.light.probe, by_eps)
        candidate = as_candidate(made)
        return None if made.warnings or not candidate.keeps(self.goal) else candidate

    def make_of_single_cubes(self) -> Prefiltered | None:
        """Make the SHRM of `single_cubes`, if there is one and it shows nothing negative."""
        found = self.single_cubes
        if found is None:
            return None
        return self._make_if_bright(found, f"SHRM, which keeps {self.goal_words}")

    def _make_if_bright(self, found: Candidate[Prefiltered], why: str) -> Prefiltered | None:
        """Make a map with a note about its form, unless anything visible is negative."""
        made = examined(judged(found.make(), found), self.truth)
        return None if negative_in(made).is_seen else with_form_told(made, why)

    @cached_property
    def in_turn(self) -> Replayed[Candidate[Prefiltered]]:
        """Maps of principal functions, of ever less error."""
        return Replayed(rising(self.proposals, self.goal, self.request.allowed))

    @cached_property
    def proposals(self) -> Proposals:
        """The maps of principal functions."""
        asked = replace(self.request, error=self.goal.error, seen=self.goal.wrong_share)
        return Proposals(self.light, asked)

    @cached_property
    def shrms(self) -> ShrmProposals:
        """The SHRMs of a BRDF of a single term, about its own center.

        Principal maps may be about another one, where their transfer functions do not tell.
        """
        request, part = self.request, self.proposals.parts[0]
        if request.center is not None or part.center == request.brdf.center:
            transfer = self.proposals.planners[0].spectrum.transfer
            return ShrmProposals.of(self.light, replace(request, brdf=part), transfer)
        return ShrmProposals.known(self.light, request, self.goal.error)

    def simple_shrm(self, kept: Candidate[Prefiltered]) -> Candidate[Prefiltered] | None:
        """Return the SHRM that keeps the goal in few bytes and coefficients, if there is one."""
        if len(self.proposals.parts) > 1 or not self.request.brdf.isotropic:
            return None  # each term would want an SHRM of its own, with a shader of many look-ups
        # Whoever asks for an error alone asks for the fewest bytes, and not for a picture.
        times = 1 if self.goal.wrong_share is None else policy.SIMPLE_TIMES
        most = min(times * kept.bytes, self.request.allowed, self.most_simple)
        return self._simple_shrm_of(int(most))

    @once_each
    def _simple_shrm_of(self, most: int) -> Candidate[Prefiltered] | None:
        """Return the SHRM of so many bytes at most, which remembers what is predicted of it."""
        if not self.shrms.fits(most) or self._is_no_simple_shrm_good:
            return None
        shrms = self.shrms.within(most, policy.SIMPLE_ORDER_P)
        tried, is_kept = first_kept(rising(shrms, self.goal, most), self.goal)
        return tried[-1] if is_kept else None

    @cached_property
    def _is_no_simple_shrm_good(self) -> bool:
        """Whether SHRMs of so few coefficients show too many wrong pixels, whatever their texels.

        That takes a tenth of the time of the search among them.
        """
        most = self.goal.wrong_share
        return most is not None and self.shrms.wrong_by_views(policy.SIMPLE_ORDER_P) > most

    def make_simple(self, found: Candidate[Prefiltered]) -> Prefiltered | None:
        """Make the SHRM that does as well as a map of principal functions."""
        size = f"{bytes_text(found.bytes)} before packing"
        return self._make_if_bright(found, f"SHRM, which keeps {self.goal_words} in {size}")

    def why_no_shrm(self, made: Prefiltered) -> str:
        """Say what an SHRM of the same error takes, or what one of all the bytes is like."""
        if not self.request.brdf.isotropic:
            return "an SHRM knows no tangent"
        if len(self.proposals.parts) > 1:
            return "an SHRM would hold every term with harmonics of its own"
        if not self.shrms.fits(self.request.allowed):
            return "no SHRM fits"
        best, is_kept = self.shrms.least(known_error(made))
        if is_kept:
            return f"an SHRM of its error takes {bytes_text(best.bytes)}"
        return f"an SHRM of {bytes_text(best.bytes)} would have {best.total_error:.1%} RMS error"


def with_form_told(made: Prefiltered, why: str) -> Prefiltered:
    """Add the note about the form, before all others."""
    return replace(made, notes=((FORM, why), *made.notes))
