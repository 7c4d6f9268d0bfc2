"""How much of what a map shows is negative.

A series that is cut off swings about the light, and where the light is dark beside a lamp it swings
below zero. A screen shows that as black, and tone mapping may do worse.
"""

from dataclasses import replace
from functools import cache

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.maps.base import Map
from shrm_cli.maps.prefiltered import Prefiltered
from shrm_cli.sphere.quadrature import scrambled, spiral_directions
from shrm_cli.vocabulary import LUMINANCE, NEGATIVE_SHARE

_PAIRS = 4096
"""The number of pairs of a mirror direction and a view that are looked at."""


def negative_share(map_: Map) -> float:
    """Estimate the share of what is visible of a map whose luminance is below 0.

    Mirror directions and views are spread evenly over all pairs. These are the pixels of spheres,
    seen in parallel projection from all sides.

    Parameters
    ----------
    map_ : Map

    Returns
    -------
    float
        In 0 .. 1, to about 0.001 where it is small.
    """
    shown = map_.shaded().rough_radiance(*visible_pairs())
    return float(np.mean(shown @ LUMINANCE < 0))


@cache
def visible_pairs(count: int = _PAIRS) -> tuple[Array, Array]:
    """Return the mirror directions and the views, which are always the same; read-only."""
    directions = spiral_directions(count)
    views = directions[scrambled(count)]
    for each in (directions, views):
        each.setflags(write=False)
    return directions, views


def examined(made: Prefiltered) -> Prefiltered:
    """Record the negative share of a map that was just made, and warn of it where it is seen.

    Where that was done, as the share decides which map is made, it is not done again.
    """
    if "negative_share" in made.further:
        return made
    share = negative_share(made.map)
    # It stands behind the facts that are still to be found, so that JSON keeps its order.
    further = {**made.further, "negative_share": lambda: share}
    warnings = (*made.warnings, *negative_warnings(made.map, share))
    return replace(made, further=further, warnings=warnings)


def negative_warnings(map_: Map, share: float) -> tuple[str, ...]:
    """Return a line about the negative share of a map, and what helps, if anybody would see it."""
    if share <= NEGATIVE_SHARE:
        return ()
    return (
        f"{share:.1%} of what is visible is black, mostly beside lamps, for it is negative there; "
        f"{map_.against_negatives}",
    )
