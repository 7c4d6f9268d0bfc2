"""An error for forms whose makers search nothing: the coarsest of a few maps that keeps it.

SHRMs and maps of principal functions are predicted before they are made, and their makers find the
one of the fewest bytes. Other forms have few settings. `Representation.steps` names them, from the
coarsest on, and they are made in turn. Where not even the finest keeps what is asked, as where a
form has a fixed number of views, the best one is made, and a warning says what it misses.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np

from shrm_cli.errors import ArgumentError
from shrm_cli.maps import registry
from shrm_cli.maps.options import SHARED
from shrm_cli.maps.prefiltered import Prefiltered
from shrm_cli.maps.request import Request
from shrm_cli.maps.size import HALF_ERROR
from shrm_cli.plan import policy
from shrm_cli.plan.search import Candidate, Goal
from shrm_cli.probe.probe import Probe

Maker = Callable[[Probe, Request], Prefiltered]


def first_that_keeps(make: Maker, probe: Probe, request: Request) -> Prefiltered:
    """Make the map of the coarsest settings that keeps the error, and the share, of a request.

    Parameters
    ----------
    make : callable
        The maker of the form.
    request : Request
        With an error, or a share of wrong pixels, or both.

    Returns
    -------
    Prefiltered
        Where none keeps them, the map of the least error.

    Raises
    ------
    ArgumentError
        If a setting is given that the error chooses.
    OrderError, ProbeError, BrdfError, MapError
        As the maker has them.
    """
    form = registry.description(request.to)
    asking = "error" if request.seen is None else "seen"
    chosen = {name for step in form.steps for name in step}
    for name in sorted(request.given.keys() & (chosen | {"order_p"})):
        raise ArgumentError(name, f"does not apply with `{asking}`, which chooses it")
    goal = Goal.of(request.error, request.seen)
    tried: list[Candidate[Prefiltered]] = []
    for step in form.steps:
        tried.append(_candidate(make(probe, _with_step(request, step))))
        if tried[-1].keeps(goal):
            return tried[-1].make()
        # What a form cannot represent stays: finer settings would only take longer.
        last = [each.badness(goal) for each in tried[-2:]]
        if len(last) > 1 and last[1] > policy.NEARLY_BEST * last[0]:
            break
    best = min(tried, key=lambda each: each.badness(goal))
    made = best.make()
    return replace(made, warnings=(*made.warnings, _missed(best, goal)))


def _with_step(request: Request, step: dict[str, object]) -> Request:
    """Return a request for settings, in which no error is asked for."""
    shared = {name: value for name, value in step.items() if name in SHARED}
    own = {name: value for name, value in step.items() if name not in SHARED}
    asked = replace(request, error=None, seen=None, own={**request.own, **own})
    return replace(asked, **shared)  # type: ignore[arg-type]


def _candidate(made: Prefiltered) -> Candidate[Prefiltered]:
    """Return a map that was made, whose further facts are found once, for choice and reports."""
    found = replace(made, further={name: cache(find) for name, find in made.further.items()})
    share = found.further.get("predicted_wrong_share", lambda: None)
    of_map = found.map
    return Candidate(
        of_map.representation, 0, of_map.cube_count, known_error(found), share, lambda: found
    )


def known_error(made: Prefiltered) -> float:
    """Return the relative RMS error that is predicted of a map, all causes together."""
    info = made.map.info
    parts = info.predicted_error, info.added_error, info.fit_residual, info.filter_error
    return float(np.linalg.norm([*parts, HALF_ERROR]))


def _missed(best: Candidate[Prefiltered], goal: Goal) -> str:
    """Say what the best map of a form misses."""
    from shrm_cli.maps.seen import goal_text

    form = registry.description(best.form)
    remedy = "auto" if form.needs_brdf else "principal or splitsum for glossy surfaces"
    return (
        f"no {form.title} map keeps {goal_text(goal)}: the best one has {best.errors_text}, as "
        f"predicted; take `to` {remedy}"
    )
