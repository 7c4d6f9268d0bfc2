"""`choose`: every form of a probe and a material, and the one to ship."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.choose.forms import Forms, Known, PrincipalForms, ShrmForms
from shrm_cli.choose.offer import Choice, Offer, decided
from shrm_cli.choose.others import made_offer, others_of
from shrm_cli.choose.truth import Truth
from shrm_cli.errors import ArgumentError, ShrmError
from shrm_cli.maps.options import parse_bytes
from shrm_cli.plan import policy
from shrm_cli.plan.search import Goal, Row, fewest_bytes
from shrm_cli.probe.lighting import Projection
from shrm_cli.probe.probe import AnyProbe, Probe, as_probe
from shrm_cli.probe.shared import shared
from shrm_cli.progress import Progress, Rising, Stages
from shrm_cli.vocabulary import DEFAULT_MAX_SIZE

ERRORS = 0.2, 0.1, 0.05, 0.025, 0.0125
"""The errors for each of which the map of the fewest bytes is offered."""
_MEASURED = 4
"""How many maps are measured, each with less error, where no share of wrong pixels is predicted."""
_NEAR = 0.9
"""Maps of this part of the bytes that were found, and more, are looked at one by one, too, because
errors do not fall with every cube."""
_SOON = 10**6
"""The bytes of maps that are made and measured in a moment, whatever they are like."""
_MOST_CUBES = 256
"""The most cubes of maps that are measured. SHRMs of 841 cubes take ten seconds to be made."""


def choose(
    probe: AnyProbe,
    brdfs: Sequence[Brdf | str] | Brdf | str,
    budget: int | str | None = None,
    error: float = policy.ERROR,
    seen: float = policy.WRONG_SHARE,
    progress: Progress | None = None,
) -> tuple[Choice, ...]:
    """Say which form of a map to ship for a probe and each of some materials.

    Parameters
    ----------
    probe : Probe, path-like or array
    brdfs : sequence of Brdf or str, or one of them
        The materials, or their specifications.
    budget : int or str, optional
        The most bytes of a map, as a number or as text such as ``"200kB"``.
    error : float
        The relative RMS error of the reflected light that is good enough, in (0, 1).
    seen : float
        The share of what is visible that may be wrong by more than 5 %, in (0, 1).
    progress : callable, optional
        Called with the amount of work done and the amount in all.

    Returns
    -------
    tuple of Choice
        One for each material.

    Raises
    ------
    ArgumentError, ProbeError, BrdfError
    """
    light, most = shared(as_probe(probe)), checked_budget(budget)
    for name, value in (("error", error), ("seen", seen)):
        if not 0 < value < 1:
            raise ArgumentError(name, f"{value:g} is not between 0 and 1")
    asked = [brdfs] if isinstance(brdfs, Brdf | str) else list(brdfs)
    stages = Stages(progress, len(asked))
    found: list[Choice] = []
    for each in asked:
        brdf = parse_spec(each, primaries=light.chromaticities) if isinstance(each, str) else each
        found.append(_chosen(light, brdf, str(each), Goal(error, seen), most, stages.within))
        stages.done(len(found), len(asked))
    return tuple(found)


def checked_budget(budget: int | str | None) -> int | None:
    """Return a number of bytes from itself or from text.

    Raises
    ------
    ArgumentError
        If it is none.
    """
    count = parse_bytes(budget) if isinstance(budget, str) else budget
    if budget is not None and (count is None or count < 1):
        raise ArgumentError("budget", f"{budget!r} is not a number of bytes such as 200kB")
    return count


def _chosen(
    probe: Probe, brdf: Brdf, name: str, goal: Goal, budget: int | None, progress: Progress
) -> Choice:
    """Choose for a probe and a material."""
    work = Rising(progress)
    truth = Truth(probe, brdf, work)
    offers: list[Offer] = []
    warnings: list[str] = []
    light = Projection(probe, work)
    most = DEFAULT_MAX_SIZE if budget is None else min(budget, DEFAULT_MAX_SIZE)
    principal = PrincipalForms(light, brdf)
    shrm = ShrmForms(light, brdf, principal.single)
    for forms in (principal, shrm):
        searched = _Searched(forms, goal, truth)
        kept = min((each.bytes for each in offers if each.keeps(goal)), default=most)
        known = [*searched.ladder(), *searched.for_goal(kept)]
        offers += searched.offers(known, kept)
    for wanted in others_of(brdf):
        try:
            offers.append(made_offer(wanted, probe, brdf, truth, work))
        except ShrmError as reason:
            warnings.append(f"{name}: no {wanted.arguments['to']}: {reason}")
    work.end()
    return decided(probe.name, name, goal, budget, offers, warnings)


@dataclass(frozen=True)
class _Judged:
    """A map by how far it is from the goal: its `total_error` is 1 where it just keeps it."""

    known: Known
    goal: Goal

    @property
    def bytes(self) -> int:
        return self.known.bytes

    @property
    def total_error(self) -> float:
        """The larger of the error and the share of wrong pixels, each over what is asked.

        A share that is not known is no obstacle: it is measured when the search is over.
        """
        share, most = self.known.candidate.wrong_share, self.goal.wrong_share
        seen = 0.0 if share is None or most is None else share / most
        if seen > 1:  # exact errors take longer
            return seen
        return max(seen, self.known.candidate.total_error / self.goal.error)


def _judged_row(row: Sequence[Known], goal: Goal, max_size: int) -> Row[_Judged]:
    """Return those maps of a row that keep the error, as far as it is roughly known."""
    may = [each for each in row if each.total_error <= goal.error and each.bytes <= max_size]
    return Row(len(may), lambda index: may[index].bytes, lambda index: _Judged(may[index], goal))


class _Searched:
    """The maps of a representation, and those that are measured because nothing predicts them."""

    def __init__(self, forms: Forms, goal: Goal, truth: Truth) -> None:
        self._rows, self._goal, self._truth = forms.rows, goal, truth
        self._shares: dict[str, float] = {}

    def ladder(self) -> Iterator[Known]:
        """Yield the map of the fewest bytes for each of the `ERRORS`, up to what there is."""
        for error in ERRORS:
            found = self._least(error, DEFAULT_MAX_SIZE)
            if found is not None:
                yield found
                if found.total_error > error:
                    return

    def for_goal(self, max_size: int) -> Iterator[Known]:
        """Yield maps of which one keeps the goal in the fewest bytes, if any does within them."""
        for step in range(_MEASURED):
            goal = replace(self._goal, error=self._goal.error * policy.FINER**step)
            found = self._judged(goal, max_size)
            if found is None:
                break
            yield found
            if self._offer(found).keeps(self._goal):
                return
        best = self._least(0.0, max_size)
        if best is not None:
            yield best

    def _least(self, error: float, max_size: int) -> Known | None:
        """Return the map of the fewest bytes that keeps an error, or the one of the least error."""
        fitting = [each for row in self._rows for each in row if each.bytes <= max_size]
        kept = [each for each in fitting if each.total_error <= error]
        if kept:
            return min(kept, key=lambda each: each.bytes)
        return min(fitting, key=lambda each: each.total_error, default=None)

    def _judged(self, goal: Goal, max_size: int) -> Known | None:
        """Return the map of the fewest bytes that may keep a goal."""
        found = fewest_bytes((_judged_row(row, goal, max_size) for row in self._rows), 1.0)
        if found is None or not found[1]:
            return None
        best = found[0].known
        near = (
            each
            for row in self._rows
            for each in row
            if _NEAR * best.bytes < each.bytes < best.bytes and each.total_error <= goal.error
        )
        for each in sorted(near, key=lambda each: each.bytes):
            if _Judged(each, goal).total_error <= 1:
                return each
        return best

    def offers(self, known: Iterable[Known], max_size: int) -> list[Offer]:
        """Return maps as offers; what takes long to measure is, if it may be the one to ship."""
        found: list[Offer] = []
        for each in sorted(known, key=lambda each: each.bytes):
            may_be_best = each.candidate.total_error <= self._goal.error and each.bytes <= max_size
            found.append(self._offer(each, may_be_best or each.bytes <= _SOON))
            if found[-1].keeps(self._goal):
                max_size = min(max_size, each.bytes)
        return found

    def _offer(self, known: Known, measures: bool = True) -> Offer:
        """Return a map as an offer; its share of wrong pixels is measured if none is predicted."""
        candidate = known.candidate
        share = candidate.wrong_share
        measured: tuple[str, ...] = ()
        measures = measures and known.cost.look_ups <= _MOST_CUBES
        if share is None and (measures or known.what in self._shares):
            share, measured = self._measured(known), ("wrong_share",)
        return Offer(
            candidate.form, known.what, candidate.bytes, candidate.total_error, share, measured,
            known.cost.look_ups, known.cost.multiply_adds, known.arguments,
            lambda: candidate.make().map,
        )  # fmt: skip

    def _measured(self, known: Known) -> float:
        if known.what not in self._shares:
            _, self._shares[known.what] = self._truth.errors(known.candidate.make().map)
        return self._shares[known.what]
