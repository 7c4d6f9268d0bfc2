"""`to` auto: the form of the fewest bytes whose picture is right, and one line that says why.

What is asked is what is seen: few pixels may be wrong, the light's RMS error is small, and nothing
visible is negative. An SHRM is made wherever it keeps that in few bytes, because its shader is the
simplest; a map of principal functions otherwise, which keeps it in the fewest bytes of all. What no
map keeps, or only one of megabytes, are lamps in sharp lobes, which then go beside it, as discs.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import field, replace
from functools import cached_property, partial
from itertools import chain
from typing import TYPE_CHECKING, Self

from shrm_cli.forms import FORM, Forms, with_form_told
from shrm_cli.maps.lobes_lit import keeping_light
from shrm_cli.maps.options import bytes_text
from shrm_cli.maps.request import Prefiltered, Request
from shrm_cli.maps.seen import as_candidate, judged, kept_or_best, with_discs_told
from shrm_cli.maps.wrong_pixels import LampsBeside, beside_lamps, examined, negative_in
from shrm_cli.plan import policy
from shrm_cli.plan.search import (
    Candidate,
    Goal,
    first_kept,
    is_worth_lamps,
    kept_in_fewest,
    least_wrong,
)
from shrm_cli.probe.probe import Probe
from shrm_cli.records import Replayed, once_each, record

if TYPE_CHECKING:
    from shrm_cli.lights.beside import Beside

_Way = tuple[Candidate[Prefiltered], Callable[[], Prefiltered | None]]
"""A map that could be made, and what makes it."""


@keeping_light()
def prefilter(probe: Probe, request: Request) -> Prefiltered:
    """Choose a form and make its map.

    Notes say which form was taken and why. Where no form keeps what is asked for, it is the best
    one, and a warning that says by how much and what would.
    """
    if not request.splits:
        return _Choice(Forms(probe, request)).make()
    from shrm_cli.lights.beside import splits_for

    goal = Goal.of(request.error, request.seen)
    ways = [_BesideLamps.of(each, request) for each in splits_for(probe, request.brdf, goal)]
    if len(ways) == 1:
        return ways[0].make()
    return least_wrong([each.foresee() for each in ways], goal).make()


def automatic_choice(probe: Probe, request: Request) -> str:
    """Say what would be made, without making it.

    It leaves out whether the map would be negative anywhere, for which one of more bytes is made.
    """
    best = _Choice(Forms(probe, request)).foresee()
    return f"{best.form} in {bytes_text(best.bytes)} or more, with {best.errors_text} at most"


@record(eq=False)
class _Choice:
    """The choice among the maps of a light, and of what is left of it without its lamps."""

    forms: Forms
    turned_down: list[Candidate[Prefiltered]] = field(default_factory=list)
    """Maps with lamps beside them that were found not to be better by enough to be made unasked."""

    @property
    def request(self) -> Request:
        return self.forms.request

    @property
    def goal(self) -> Goal:
        """What the picture has to keep."""
        return self.forms.goal

    def make(self) -> Prefiltered:
        single = self.forms.make_of_single_cubes()
        return single or self.make_beside_lamps() or self.make_of_functions()

    def foresee(self) -> Candidate[Prefiltered]:
        """Return what would be made, if it is negative nowhere, for which one of more bytes is."""
        if self.forms.single_cubes is not None:
            return self.forms.single_cubes
        if self.kept_beside_lamps is not None:
            return self.kept_beside_lamps
        tried, is_kept = first_kept(self.candidates, self.goal)
        best = tried[-1] if is_kept else least_wrong(tried, self.goal)
        return next((found for found, _ in self.better(best, is_kept)), best)

    def better(self, best: Candidate[Prefiltered], is_kept: bool) -> Iterator[_Way]:
        """Yield what is better than the best map of functions, and how it is made.

        `is_kept` tells whether that keeps what is asked for. What is made may turn out to be no
        better, and is None then.
        """
        if not (is_kept and best.bytes <= policy.LARGE):
            apart = self.foresee_lamps_apart(best, is_kept)
            if apart is not None:
                yield apart, partial(self.make_lamps_apart, apart, best, is_kept)
        simple = self.forms.simple_shrm(best) if is_kept else None
        if simple is not None:
            yield simple, partial(self.forms.make_simple, simple)

    def make_better(self, best: Candidate[Prefiltered], is_kept: bool) -> Prefiltered | None:
        """Make the first map that `better` yields and that turns out to be so, if there is any."""
        return next(filter(None, (make() for _, make in self.better(best, is_kept))), None)

    def make_of_functions(self) -> Prefiltered:
        """Make a map of principal functions, or an SHRM where it does as well."""
        request = self.request
        made = kept_or_best(
            self.candidates, self.goal, request.allowed,
            self.make_better, self.forms.truth, self.forms.left, request.size,
        )  # fmt: skip
        if FORM in dict(made.notes):
            return made
        made = with_discs_told(made, self.turned_down, self.goal, request.allowed)
        return with_form_told(made, f"principal: {self.forms.why_no_shrm(made)}")

    def foresee_lamps_apart(
        self, whole: Candidate[Prefiltered], is_kept: bool
    ) -> Candidate[Prefiltered] | None:
        """Foresee the map of the light without its lamps, with these beside it, where it is better.

        `whole` is the best map of all light. `is_kept` tells whether it keeps what is asked for, as
        this one has to then, in far fewer bytes.
        """
        if not self.may_have_lamps_apart:
            return None
        # No map makes up for what lamps miss, so that most searches in vain end here.
        most = 1.0 if is_kept else max(policy.MISSED * whole.badness(self.goal), 1.0)
        # An SHRM of more would lose what a smaller map of functions wins.
        share = policy.FAR_SMALLER if is_kept else policy.WORTH_LAMPS
        simple = share * whole.bytes
        if self._are_lamps_first:  # the maps that were looked for first
            simple = self._largest_simple
        worth: list[Candidate[Prefiltered]] = []
        for beside in self.splits:
            if beside.split.discs and beside.error <= most * self.goal.error:
                found = self._foresee_beside(beside, simple)
                if not self._is_worth_lamps(found, whole, is_kept):
                    self.turned_down.append(found)
                    continue
                if found.keeps(self.goal):
                    return found
                worth.append(found)
        return least_wrong(worth, self.goal) if worth else None

    @cached_property
    def may_have_lamps_apart(self) -> bool:
        """Whether lamps may be put beside the map, and shaders and pages could show them."""
        if self.request.sun is not None:
            return False
        from shrm_cli.maps.lamps.lobe import bytes_of_table

        own = bytes_of_table(self.request.brdf)
        return own is not None and own <= self.request.allowed

    @cached_property
    def splits(self) -> Replayed["Beside"]:
        """The ways to put lamps beside a map."""
        from shrm_cli.lights.beside import splits_for

        return Replayed(splits_for(self.forms.probe, self.request.brdf, self.goal))

    @once_each
    def _foresee_beside(self, beside: "Beside", most: float) -> Candidate[Prefiltered]:
        """Foresee the map beside lamps, which is an SHRM of so many bytes at most."""
        return _BesideLamps.of(beside, self.request, most).foresee()

    @cached_property
    def kept_beside_lamps(self) -> Candidate[Prefiltered] | None:
        """A map that keeps what is asked with lamps beside it, where any of all light is large.

        To find the best map of all light would take as much time as all else.
        """
        # What tells of code for lamps takes longer to load than most maps to be found.
        if self.request.sun or not (self._are_lamps_first and self.may_have_lamps_apart):
            return None
        for beside in self.splits:
            if beside.split.discs and beside.error <= self.goal.error:
                found = self._foresee_beside(beside, self._largest_simple)
                if self._keeps_within_bytes(found):
                    few = self._few_beside(found)
                    # Where more bytes than few are allowed, a map of either kind is right.
                    is_large = few <= policy.LARGE or self.forms.proposals.is_out_of_reach(
                        few, False
                    )
                    return found if is_large else None
        return None

    @property
    def _are_lamps_first(self) -> bool:
        """Whether all maps of all light that keep what is asked are large, as far as is known."""
        return self._are_surely_large or (self._seem_large and self._kept_in_few is None)

    @cached_property
    def _are_surely_large(self) -> bool:
        """Whether a first look at single lobes tells that, because none keeps it by far.

        The least error tells it of few bytes, and the share of wrong pixels of all bytes only:
        among maps of few it may be a fourth of what the one of the least error has.
        """
        is_missed = self.forms.proposals.is_out_of_reach
        if is_missed(policy.LARGE, True):
            return True
        return is_missed(policy.LARGE, False) and is_missed(self.request.allowed, False)

    @cached_property
    def _seem_large(self) -> bool:
        """Whether maps of all light of ever less error are large before one keeps what is asked."""
        if self.forms.proposals.is_out_of_reach(policy.LARGE, False):
            return True
        for found in self.forms.in_turn:
            if found.bytes > policy.LARGE or found.keeps(self.goal):
                return found.bytes > policy.LARGE
        return False

    @cached_property
    def _kept_in_few(self) -> Candidate[Prefiltered] | None:
        """The map of all light that keeps what is asked and is not large, where most seem to be."""
        if self.request.sun or self._are_surely_large:
            return None
        if not (self._seem_large and self.may_have_lamps_apart):
            return None
        found = kept_in_fewest(self.forms.proposals.rows(policy.LARGE), self.goal)
        return None if found is None else found.exact

    def _few_beside(self, beside: Candidate[Prefiltered]) -> int:
        """Return the most bytes of a map of all light that is better than one with lamps beside."""
        most = max(policy.LARGE, beside.bytes / policy.FAR_SMALLER)
        return int(min(most, self.request.allowed))

    @property
    def _largest_simple(self) -> float:
        """The most bytes of an SHRM beside lamps where no map of all light is known."""
        return min(policy.FAR_SMALLER * policy.LARGE, policy.WORTH_LAMPS * self.request.allowed)

    def _keeps_within_bytes(self, found: Candidate[Prefiltered]) -> bool:
        return found.bytes <= self.request.allowed and found.keeps(self.goal)

    def make_beside_lamps(self) -> Prefiltered | None:
        """Make the map of `kept_beside_lamps`, if there is one."""
        foreseen = self.kept_beside_lamps
        if foreseen is None:
            return None
        most = bytes_text(self._few_beside(foreseen))
        why = f"no map of {most} with them in it (`sun` keep) keeps {self.forms.goal_words}"
        return self._make_beside(foreseen, self._keeps_within_bytes, why)

    def _is_worth_lamps(
        self, found: Candidate[Prefiltered], whole: Candidate[Prefiltered], is_kept: bool
    ) -> bool:
        """Tell whether a map with lamps, and a table of the BRDF, beside it fits and is better."""
        fits = found.bytes <= self.request.allowed
        return fits and is_worth_lamps(found, whole, self.goal, is_kept)

    def make_lamps_apart(
        self, foreseen: Candidate[Prefiltered], whole: Candidate[Prefiltered], is_kept: bool
    ) -> Prefiltered | None:
        """Make what `foresee_lamps_apart` found; say what a map with the lamps in it would be."""
        # What keeps all else is turned down for that alone.
        spots = ", and black spots" if not is_kept and whole.keeps(self.goal) else ""
        why = (
            "with them in the map (`sun` keep) it would have "
            f"{whole.errors_text} in {bytes_text(whole.bytes)}{spots}"
        )
        is_worth = partial(self._is_worth_lamps, whole=whole, is_kept=is_kept)
        made = self._make_beside(foreseen, is_worth, why)
        return None if made is None or (is_kept and negative_in(made).is_seen) else made

    def _make_beside(
        self,
        foreseen: Candidate[Prefiltered],
        is_good: Callable[[Candidate[Prefiltered]], bool],
        why: str,
    ) -> Prefiltered | None:
        """Make a map with lamps beside it, and say why, unless it has more bytes than foreseen."""
        made = foreseen.make()
        found = as_candidate(made)
        if not is_good(found):
            return None
        notes = dict(made.notes)
        form = notes.pop(FORM).partition(":")[0].partition(",")[0]
        made = replace(judged(made, found), notes=tuple(notes.items()))
        return with_form_told(examined(made, self.forms.truth), f"{form}, lamps beside it: {why}")

    @property
    def candidates(self) -> Iterator[Candidate[Prefiltered]]:
        """Maps of principal functions, of ever less error; the same ones whenever asked."""
        first = self._kept_in_few
        return chain([] if first is None else [first], self.forms.in_turn)


@record(eq=False)
class _BesideLamps:
    """The light without its lamps, which lie beside its map, and what is asked of that."""

    rest: _Choice
    beside: "Beside"
    lamps: LampsBeside | None

    @classmethod
    def of(cls, beside: "Beside", request: Request, most_simple: float = math.inf) -> Self:
        """Return what is left of a probe's light for a request about all of it.

        `most_simple` are the most bytes of an SHRM with what lies beside it.
        """
        asked, goal = replace(request, sun="split"), Goal.of(request.error, request.seen)
        most, probe = most_simple - beside.bytes, beside.split.probe
        rest = _Choice(Forms(beside.rest, beside.asked(asked), beside.left, most, probe, goal))
        return cls(rest, beside, beside.lamps)

    def make(self) -> Prefiltered:
        from shrm_cli.lights.beside import with_lamps

        with beside_lamps(self.lamps):
            return with_lamps(self.rest.make(), self.beside)

    def foresee(self) -> Candidate[Prefiltered]:
        """Return what the map would be."""
        with beside_lamps(self.lamps):
            found = self.rest.foresee()
            share = found.wrong_share
        error = math.hypot(self.beside.left * found.total_error, self.beside.error)
        # What is predicted here holds beside the lamps alone.
        return replace(
            found, bytes=found.bytes + self.beside.bytes, total_error=error,
            find_wrong_share=lambda: share, find_least_share=None, make=self.make,
        )  # fmt: skip
