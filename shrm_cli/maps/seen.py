"""Making maps in turn, until one keeps what is asked of its picture.

SHRMs and maps of principal functions are predicted before they are made, and proposed in ever more
bytes. Other forms have few settings, whose makers search nothing. `Representation.steps` names
them, from the coarsest on, and they are made in turn. Where not even the finest keeps what is
asked, as where a form has a fixed number of views, the best one is made, and a warning says what it
misses.
"""

from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import cache

from shrm_cli.maps import registry
from shrm_cli.maps.base import DISCS, REMEDY
from shrm_cli.maps.lobes_lit import keeping_light
from shrm_cli.maps.options import SHARED, bytes_text
from shrm_cli.maps.request import Prefiltered, Request
from shrm_cli.maps.size import stored_bytes, total_error
from shrm_cli.maps.wrong_pixels import Truth, examined, negative_in
from shrm_cli.plan import policy
from shrm_cli.plan.search import Candidate, Goal, least_wrong
from shrm_cli.probe.probe import Probe


@keeping_light()
def kept_or_best(
    candidates: Iterable[Candidate[Prefiltered]],
    goal: Goal,
    max_size: int,
    better: Callable[[Candidate[Prefiltered], bool], Prefiltered | None] = lambda *_: None,
    truth: Truth | None = None,
    left: float = 1.0,
    size: int | None = None,
) -> Prefiltered:
    """Make the map of the fewest bytes that keeps a goal, and shows nothing negative.

    `candidates` are those of `shrm_cli.plan.search.rising`. `max_size` is the most bytes, for the
    warning. `better` is called with each candidate that keeps the goal and True, and with the best
    one and False where none keeps it, or all are negative somewhere; may return a map that is
    better. `truth` is that of `negative_of`. `left` is the RMS of the light that the map is of,
    over that of all light, of which the warning tells; 1 where there is no other. `size` is that of
    all candidates, where it was asked for.

    Where none keeps the goal, the one that misses the least is returned, with a warning that says
    by how much, and what would keep it. Where all are negative somewhere, it is the least dark one.
    """
    tried: list[Candidate[Prefiltered]] = []
    dark: list[tuple[float, Candidate[Prefiltered], Prefiltered]] = []
    for candidate in candidates:
        tried.append(candidate)
        if not candidate.keeps(goal):
            continue
        if (other := better(candidate, True)) is not None:
            return other
        made = examined(judged(candidate.make(), candidate), truth)
        found = negative_in(made)
        if not found.is_seen:
            return made
        dark.append((found.badness, candidate, made))
        if len(dark) == policy.TRIED_DARK:
            break
    if dark:  # what else is asked is kept; the warning about negative light tells the rest
        least = policy.MISSED * min(bad for bad, *_ in dark)
        best, made = next((each, made) for bad, each, made in dark if bad <= least)
        other = better(best, False)
        if other is not None and not negative_in(other).is_seen:
            return other
        return made
    best = least_wrong(tried, goal)
    if (other := better(best, False)) is not None:
        return other
    made = judged(best.make(), best)
    return replace(made, warnings=(*made.warnings, _missed(best, goal, max_size, left, size)))


def as_candidate(made: Prefiltered) -> Candidate[Prefiltered]:
    """Return what is predicted to be seen of a map that is made already."""
    map_, find = made.map, made.further.get("predicted_wrong_share", lambda: None)
    count = map_.cube_count
    bytes_ = stored_bytes(map_.size, count) + map_.table_bytes
    return Candidate(map_.representation, bytes_, count, known_error(made), find, lambda: made)


def judged(made: Prefiltered, candidate: Candidate[Prefiltered]) -> Prefiltered:
    """Record the wrong share that a map was chosen by, so that no report computes it again."""
    share = {"predicted_wrong_share": lambda: candidate.wrong_share}
    return replace(made, further={**made.further, **share})


def goal_text(goal: Goal, of: str = "") -> str:
    """Return a goal in words; `of` says what the error is a part of."""
    error = f"an RMS error of {100 * goal.error:.3g}%{of}"
    return error if goal.wrong_share is None else f"{error} and {goal.wrong_share:.0%} wrong pixels"


def _missed(
    best: Candidate[Prefiltered], goal: Goal, max_size: int, left: float, size: int | None
) -> str:
    """Say what the best map misses of the goal, and what would keep it."""
    # No less than the least error is tried, however many bytes there are.
    larger = best.can_grow and best.total_error > policy.LEAST_ERROR
    more = ", or raise `max_size`" if larger and 2 * best.bytes > max_size else ""
    why = f"lamps and other bright places in sharp lobes need the most: {REMEDY}{more}"
    within, of = f"in {bytes_text(max_size)}", ""
    if size is not None and not more:
        within, why = f"in cubes of {size} texels", "leave `size` out, which chooses them"
    why = best.limit or why
    if left < 1:  # what is allowed of so little light would read as an error of all
        of, share = " of all light", best.wrong_share
        goal = replace(goal, error=left * goal.error)
        error, find_share = left * best.total_error, lambda: share
        best = replace(best, total_error=error, find_wrong_share=find_share, find_least_share=None)
    return (
        f"no map keeps {goal_text(goal, of)} {within}; the one made has "
        f"{best.errors_text}, as predicted. {why[0].upper()}{why[1:]}"
    )


def with_discs_told(
    made: Prefiltered, turned_down: Iterable[Candidate[Prefiltered]], goal: Goal, allowed: int
) -> Prefiltered:
    """Say in the warnings about lamps how much less is wrong beside discs, where it is less.

    `turned_down` are maps with lamps beside them, which were not better by enough to be made
    unasked. `allowed` are the most bytes.
    """
    most = as_candidate(made).badness(goal) / policy.MISSED
    for each in turned_down:
        if each.bytes <= allowed and each.badness(goal) <= most:
            would = f"which would have {each.errors_text} in {bytes_text(each.bytes)}"
            better = f"{DISCS}, {would}, or {REMEDY}"
            lines = [line.replace(REMEDY, better) for line in made.warnings]
            return replace(made, warnings=tuple(lines))
    return made


def first_that_keeps(
    make: Callable[[Probe, Request], Prefiltered], probe: Probe, request: Request
) -> Prefiltered:
    """Make the map of the coarsest settings that keeps the error, and the share, of a request.

    `request` has an error, or a share of wrong pixels, or both.

    Where none keeps them, the map of the least error is returned.
    """
    form = registry.description(request.to)
    goal = Goal.of(request.error, request.seen)
    tried: list[Candidate[Prefiltered]] = []
    for step in form.steps:
        made = make(probe, _with_step(request, step))
        # Further facts are found once, for choice and reports.
        further = {name: cache(find) for name, find in made.further.items()}
        tried.append(as_candidate(replace(made, further=further)))
        if tried[-1].keeps(goal):
            return tried[-1].make()
        # What a form cannot represent stays: finer settings would only take longer.
        last = [each.badness(goal) for each in tried[-2:]]
        if len(last) > 1 and last[1] > policy.NEARLY_BEST * last[0]:
            break
    best = min(tried, key=lambda each: each.badness(goal))
    made = best.make()
    remedy = "auto" if form.needs_brdf else "principal or splitsum for glossy surfaces"
    unkept = (
        f"no {form.title} map keeps {goal_text(goal)}: the best one has {best.errors_text}, as "
        f"predicted; take `to` {remedy}"
    )
    return replace(made, warnings=(*made.warnings, unkept))


def _with_step(request: Request, step: dict[str, object]) -> Request:
    """Return a request for settings, in which no error is asked for."""
    shared = {name: value for name, value in step.items() if name in SHARED}
    own = {name: value for name, value in step.items() if name not in SHARED}
    asked = replace(request, error=None, seen=None, own={**request.own, **own})
    return replace(asked, **shared)  # type: ignore[arg-type]


def known_error(made: Prefiltered) -> float:
    """Return the relative RMS error that is predicted of a map, all causes together."""
    return total_error(made.map.stated_error)
