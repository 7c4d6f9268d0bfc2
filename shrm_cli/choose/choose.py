"""`choose`: every form of a probe and a material, and the one to ship."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.choose import forms
from shrm_cli.choose.offer import Choice, Offer, decided
from shrm_cli.errors import ArgumentError, ShrmError
from shrm_cli.lights.split import split_lamps
from shrm_cli.maps.lobes_lit import keeping_light
from shrm_cli.maps.options import counted, parse_bytes
from shrm_cli.plan import policy
from shrm_cli.plan.search import Goal, Row, fewest_bytes
from shrm_cli.probe.coarse import fine_probe
from shrm_cli.probe.lighting import Projection
from shrm_cli.probe.open import AnyProbe, as_probe
from shrm_cli.probe.probe import Probe
from shrm_cli.probe.shared import shared
from shrm_cli.progress import Progress, Rising, Stages, using
from shrm_cli.records import record
from shrm_cli.vocabulary import DEFAULT_MAX_SIZE

ERRORS = 0.2, 0.1, 0.05, 0.025, 0.0125
"""The errors for each of which the map of the fewest bytes is offered."""


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

    Examples
    --------
    >>> (choice,) = shrm.choose("probes/furnace.exr", "lambertian")
    >>> choice.is_kept
    True
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
        with keeping_light():
            found.append(_chosen(light, brdf, str(each), Goal(error, seen), most, stages.within))
        stages.done(len(found), len(asked))
    return tuple(found)


def checked_budget(budget: int | str | None) -> int | None:
    """Return a number of bytes from itself or from text.

    Raises ArgumentError if it is none.
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
    truth = forms.Truth(probe, brdf, work)
    offers: list[Offer] = []
    missing: list[str] = []
    light = Projection(shared(fine_probe(probe)))
    most = DEFAULT_MAX_SIZE if budget is None else min(budget, DEFAULT_MAX_SIZE)
    with using(work):
        principal = forms.PrincipalForms(light, brdf)
        held = [principal.rows]
        if brdf.isotropic:  # an SHRM knows no tangent
            held.append(forms.ShrmForms(light, brdf, principal.single).rows)
        for rows in held:
            known = dict.fromkeys([*_ladder(rows), *_for_goal(rows, goal, most)])
            offers += [_offer(each) for each in known]
    for form, setting in forms.others_of(brdf, missing):
        try:
            offers += forms.made_offers(form, setting, probe, brdf, truth, work)
        except ShrmError as reason:
            missing.append(f"no {form}: {reason}")
    work.end()
    warnings = [f"{name}: {line}" for line in missing]
    found = decided(probe.name, name, goal, budget, offers, warnings)
    return found if found.is_kept else replace(found, warnings=(*warnings, *_aside(probe, brdf)))


def _aside(probe: Probe, brdf: Brdf) -> list[str]:
    """Return a line about lamps, which `to` auto may put beside a map; none where it cannot."""
    count = 0 if brdf.center == "tangent" else len(split_lamps(probe).discs)
    if not count:
        return []
    told = f"the probe has {counted(count, 'lamp')}, with which these maps are made"
    return [f"{told}; shrm prefilter, without `to`, puts lamps beside a map where that is better"]


@record
class _Judged:
    """A map by how far it is from the goal: its `total_error` is 1 where it just keeps it."""

    known: forms.Known
    goal: Goal

    @property
    def bytes(self) -> int:
        return self.known.bytes

    @property
    def least_error(self) -> float:
        """The share of wrong pixels over what is asked; 0 where it is not known."""
        share = self.known.wrong_share
        return share / self.goal.wrong_share if share and self.goal.wrong_share else 0.0

    @property
    def total_error(self) -> float:
        """The larger of the error and the share of wrong pixels, each over what is asked."""
        if self.least_error > 1:
            return self.least_error  # exact errors would change nothing, and take long
        return self.known.candidate.badness(self.goal)


def _ladder(rows: forms.Rows) -> Iterator[forms.Known]:
    """Yield the map of the fewest bytes for each of the `ERRORS`, up to what there is."""
    for error in ERRORS:
        found = _least(rows, error, DEFAULT_MAX_SIZE)
        if found is not None:
            yield found
            if found.total_error > error:
                return


def _for_goal(rows: forms.Rows, goal: Goal, max_size: int) -> Iterator[forms.Known]:
    """Yield the map that keeps the goal in the fewest bytes, or else that of the least error."""
    found = fewest_bytes((_judged_row(row, goal, max_size) for row in rows), 1.0)
    if found is not None and found[1]:
        yield found[0].known
    elif (best := _least(rows, 0.0, max_size)) is not None:
        yield best


def _least(rows: forms.Rows, error: float, max_size: int) -> forms.Known | None:
    """Return the map of the fewest bytes that keeps an error, or the one of the least error."""
    fitting = [each for row in rows for each in row if each.bytes <= max_size]
    kept = [each for each in fitting if each.total_error <= error]
    if kept:
        return min(kept, key=lambda each: each.bytes)
    return min(fitting, key=lambda each: each.total_error, default=None)


def _judged_row(row: Sequence[forms.Known], goal: Goal, max_size: int) -> Row[_Judged]:
    """Return the maps that roughly keep the error, by how far they really are from the goal."""
    may = [each for each in row if each.total_error <= goal.error and each.bytes <= max_size]
    return Row(len(may), lambda index: may[index].bytes, lambda index: _Judged(may[index], goal))


def _offer(known: forms.Known) -> Offer:
    """Return a map as an offer."""
    candidate, share = known.candidate, known.candidate.wrong_share
    assert share is not None  # both forms that are predicted know theirs
    return Offer(
        candidate.form, known.what, candidate.bytes, candidate.total_error, share,
        (), known.cost.look_ups, known.cost.multiply_adds, known.arguments,
        lambda: candidate.make().map,
    )  # fmt: skip
