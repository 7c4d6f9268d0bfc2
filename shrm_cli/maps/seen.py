"""Making the first map of ever more bytes whose picture is right."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from shrm_cli.maps.lobes_lit import keeping_light
from shrm_cli.maps.options import bytes_text
from shrm_cli.maps.prefiltered import REMEDY, Prefiltered, examined
from shrm_cli.maps.size import stored_bytes, total_error
from shrm_cli.plan import policy
from shrm_cli.plan.search import Candidate, Goal, Propose, least_wrong, rising
from shrm_cli.vocabulary import NEGATIVE_SHARE


@keeping_light()
def kept_or_best(
    propose: Propose,
    goal: Goal,
    max_size: int,
    instead: Callable[[Candidate[Prefiltered]], Prefiltered | None] = lambda kept: None,
) -> Prefiltered:
    """Make the map of the fewest bytes that keeps a goal, and shows nothing negative.

    Parameters
    ----------
    propose : callable
        As `shrm_cli.plan.search.rising` takes it.
    max_size : int
        The most bytes, for the warning.
    instead : callable
        Called with the first candidate that keeps the goal; may return the map of another form.

    Returns
    -------
    Prefiltered
        Where none keeps the goal, the one that misses the least, with a warning that says by how
        much, and what would keep it. Where all are negative somewhere, the least dark one.
    """
    tried: list[Candidate[Prefiltered]] = []
    dark: list[tuple[float, Prefiltered]] = []
    for candidate in rising(propose, goal):
        tried.append(candidate)
        if not candidate.keeps(goal):
            continue
        other = None if dark else instead(candidate)
        if other is not None:
            return other
        made = examined(judged(candidate.make(), candidate))
        share = made.further["negative_share"]()
        if share <= NEGATIVE_SHARE:
            return made
        dark.append((share, made))
        if len(dark) == policy.TRIED_DARK:
            break
    if dark:  # what else is asked is kept; the warning about negative light tells the rest
        least = policy.MISSED * min(share for share, _ in dark)
        return next(made for share, made in dark if share <= least)
    best = least_wrong(tried, goal)
    made = judged(best.make(), best)
    return replace(made, warnings=(*made.warnings, _missed(best, goal, max_size)))


def as_candidate(made: Prefiltered, lamp_error: float = 0.0) -> Candidate[Prefiltered]:
    """Return what is predicted to be seen of a map that is made already.

    Parameters
    ----------
    made : Prefiltered
    lamp_error : float
        What discs in place of lamps change of the reflected light, as a relative RMS error.
    """
    map_, find = made.map, made.further["predicted_wrong_share"]
    error = math.hypot(total_error(map_.info.predicted_error, map_.info.filter_error), lamp_error)
    bytes_, count = stored_bytes(map_.size, map_.cube_count), map_.cube_count
    return Candidate(map_.representation, bytes_, count, error, find, lambda: made)


def judged(made: Prefiltered, candidate: Candidate[Prefiltered]) -> Prefiltered:
    """Record the wrong share that a map was chosen by, so that no report computes it again."""
    share = {"predicted_wrong_share": lambda: candidate.wrong_share}
    return replace(made, further={**made.further, **share})


def goal_text(goal: Goal) -> str:
    """Return a goal in words."""
    error = f"an RMS error of {100 * goal.error:.3g}%"
    return error if goal.wrong_share is None else f"{error} and {goal.wrong_share:.0%} wrong pixels"


def _missed(best: Candidate[Prefiltered], goal: Goal, max_size: int) -> str:
    """Say what the best map misses of the goal, and what would keep it."""
    more = ", or raise `max_size`" if best.can_grow and 2 * best.bytes > max_size else ""
    return (
        f"no map keeps {goal_text(goal)} in {bytes_text(max_size)}; the one made has "
        f"{best.errors_text}, as predicted. Lamps in glossy surfaces need the most: {REMEDY}{more}"
    )
