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
from shrm_cli.plan.search import ROUNDING, Goal
from shrm_cli.probe.probe import Probe

Maker = Callable[[Probe, Request], Prefiltered]


def first_that_keeps(make: Maker, probe: Probe, request: Request) -> Prefiltered:
    """Make the map of the coarsest settings that keeps the error, and the share, of a request.

    Parameters
    ----------
    make : callable
        The maker of the form.
    probe : Probe
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
    tried: list[tuple[float, Prefiltered]] = []
    for step in form.steps:
        made = _remembering(make(probe, _with_step(request, step)))
        tried.append((_badness(made, goal), made))
        if tried[-1][0] <= ROUNDING:
            return made
        # What a form cannot represent stays: finer settings would only take longer.
        if len(tried) > 1 and tried[-1][0] > policy.NEARLY_BEST * tried[-2][0]:
            break
    _, best = min(tried, key=lambda each: each[0])
    return replace(best, warnings=(*best.warnings, _missed(best, goal, form.title)))


def _with_step(request: Request, step: dict[str, object]) -> Request:
    """Return a request for settings, in which no error is asked for."""
    shared = {name: value for name, value in step.items() if name in SHARED}
    own = {name: value for name, value in step.items() if name not in SHARED}
    asked = replace(request, error=None, seen=None, own={**request.own, **own})
    return replace(asked, **shared)  # type: ignore[arg-type]


def _remembering(made: Prefiltered) -> Prefiltered:
    """Return a map whose further facts are found once, for the choice and for reports."""
    return replace(made, further={name: cache(find) for name, find in made.further.items()})


def known_error(made: Prefiltered) -> float:
    """Return the relative RMS error that is predicted of a map, all causes together."""
    info = made.map.info
    parts = info.predicted_error, info.added_error, info.fit_residual, info.filter_error
    return float(np.linalg.norm([*parts, HALF_ERROR]))


def _badness(made: Prefiltered, goal: Goal) -> float:
    """Return the larger of both errors, each in units of what may be missed."""
    of_error = known_error(made) / goal.error
    share = made.further.get("predicted_wrong_share", lambda: None)()
    if goal.wrong_share is None or share is None:
        return of_error
    return float(max(of_error, share / goal.wrong_share))


def _missed(best: Prefiltered, goal: Goal, title: str) -> str:
    """Say what the best map of a form misses."""
    from shrm_cli.maps.seen import goal_text

    share = best.further.get("predicted_wrong_share", lambda: None)()
    seen = "" if share is None else f" and {share:.0%} of pixels wrong by more than 5%"
    needs_brdf = registry.description(best.map.representation).needs_brdf
    remedy = "auto" if needs_brdf else "principal or splitsum for glossy surfaces"
    return (
        f"no {title} map keeps {goal_text(goal)}: the best one has {known_error(best):.1%} RMS "
        f"error{seen}, as predicted; take `to` {remedy}"
    )
