"""How much of a map is negative where it is seen: black and coloured spots, mostly beside lamps.

A series of few degrees swings below 0 beside what is bright. From most sides nobody may see any of
that, and from one that faces the lamps much of a rim. So it is counted from each side by itself.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Brdf
from shrm_cli.maps.base import Map
from shrm_cli.maps.request import Prefiltered
from shrm_cli.maps.sphere_pixels import Side, all_sides, one_side
from shrm_cli.maps.wrong_pixels import lamps_beside
from shrm_cli.probe.probe import Probe
from shrm_cli.progress import using
from shrm_cli.records import record
from shrm_cli.sphere.directions import bisector
from shrm_cli.vocabulary import LUMINANCE, NEGATIVE_FROM_A_SIDE, NEGATIVE_SHARE, SEEN_FLOOR, WRONG

Truth = Callable[[Array, Array], Array]
"""Takes normals and views; returns what is reflected, shape (n, 3)."""
_PIXELS = 128
"""The number of pixels from each side. From some side 1 % and more are negative of `microfacet`
under a bare sun, in a forest, a room and at sunrise; among 4,096 pixels from any side of the last
none was."""
_CLOSER, _PIXELS_CLOSER = 4, 1024
"""How many of the darkest sides are looked at once more, and in how many pixels: one of
128 may be dark by chance."""
_TRUE, _TRUE_CLOSER = 1024, 256
"""The numbers of dark pixels whose truth is looked at, about, of all sides and of one."""


@record
class Negative:
    """Which part of what is visible of a map has a luminance below 0, in 0 .. 1."""

    share: float
    """From all sides, to about 0.0003 where it is small."""
    worst: float
    """From the worst of the sides."""

    @property
    def badness(self) -> float:
        """The larger of both, in units of what nobody needs to be told of."""
        return max(self.share / NEGATIVE_SHARE, self.worst / NEGATIVE_FROM_A_SIDE)

    @property
    def is_seen(self) -> bool:
        return self.badness > 1

    def warnings(self, map_: Map) -> tuple[str, ...]:
        """Return a line about it, and what helps, if anybody would see it."""
        if not self.is_seen:
            return ()
        if self.share > NEGATIVE_SHARE:
            part = f"{self.share:.1%} of what is visible"
        else:
            part = f"{self.worst:.1%} of what is visible from the worst side"
        return (
            f"{part} is black, mostly beside lamps, for it is negative there; "
            f"{map_.against_negatives}",
        )


def truth_of(probe: Probe, brdf: Brdf) -> Truth:
    """Return what looks up what a BRDF reflects of a probe, by normals and views."""

    def radiance(normals: Array, views: Array) -> Array:
        from shrm_cli.reference import Reference  # which maps that are not negative do not need

        with using(None):
            return Reference(probe, brdf).radiance(normals, views)

    return radiance


def negative_of(map_: Map, truth: Truth | None = None) -> Negative:
    """Count what is visible of a map and has a luminance below 0.

    Lamps that are to lie beside the map light it. `truth` is what is reflected, where it is known:
    what is black in truth may be so in the map.
    """
    seen = _Seen(map_, all_sides(_PIXELS))
    by_side = seen.is_dark.reshape(-1, _PIXELS).mean(axis=1)
    darkest = np.argsort(-by_side, kind="stable")[:_CLOSER]
    darkest = darkest[by_side[darkest] > NEGATIVE_FROM_A_SIDE]
    closer = [_Seen(map_, one_side(int(each), _PIXELS_CLOSER)) for each in darkest]
    found = Negative(seen.share, max((each.share for each in closer), default=0.0))
    if truth is None or not found.is_seen:
        return found
    black = WRONG * SEEN_FLOOR * seen.mean
    return Negative(
        seen.share * seen.lit_part(truth, black, _TRUE),
        max((each.share * each.lit_part(truth, black, _TRUE_CLOSER) for each in closer), default=0),
    )


class _Seen:
    """What is visible of a map, with the lamps that lie beside it."""

    def __init__(self, map_: Map, side: Side) -> None:
        beside = lamps_beside.get()
        self._side, self._lamps = side, None if beside is None else beside.lit
        shown = map_.shaded()
        self._shown = shown.rough_radiance(*side.points) @ LUMINANCE
        self.is_dark = self._shown < 0
        """Which pixels have a negative luminance, shape (n,)."""
        # The nearest texel of a dark one may be over the edge of a shadow, where it is black.
        where = np.flatnonzero(self.is_dark)
        mirrored, views = (each[where] for each in side.points)
        self._shown[where] = shown.radiance(bisector(mirrored, views), views) @ LUMINANCE
        self.is_dark[where] = self._shown[where] < 0
        if self._lamps is not None:
            where = np.flatnonzero(self.is_dark | self._lamps.may_darken)
            self.is_dark[where] = self._shown[where] + self._lamps.visible_at(side, where) < 0

    @property
    def share(self) -> float:
        """The share of these pixels."""
        return float(self.is_dark.mean())

    @property
    def mean(self) -> float:
        """The mean luminance of what is not negative, by some of the pixels."""
        some = np.arange(0, len(self._shown), 4)
        shown = self._shown[some]
        if self._lamps is not None:
            shown = shown + self._lamps.visible_at(self._side, some)
        return float(np.maximum(shown, 0).mean())

    def lit_part(self, truth: Truth, black: float, count: int) -> float:
        """Return the part of the dark pixels that should be brighter than what is as good as black.

        The truth of about so many of them tells.
        """
        dark = np.flatnonzero(self.is_dark)
        dark = dark[:: max(len(dark) // count, 1)]
        mirrored, views = (each[dark] for each in self._side.points)
        return float(np.mean(truth(bisector(mirrored, views), views) @ LUMINANCE > black))


def negative_in(made: Prefiltered) -> Negative:
    """Return what was counted in an examined map."""
    return Negative(made.further["negative_share"](), made.further["worst_negative_share"]())


def examined(made: Prefiltered, truth: Truth | None = None) -> Prefiltered:
    """Record the negative shares of a map that was just made, and warn of them where they are seen.

    Where that was done, as they decide which map is made, it is not done again. The truth is that
    of `negative_of`.
    """
    if "negative_share" in made.further:
        return made
    found = negative_of(made.map, truth)
    # They stand behind the facts that are still to be found, so that JSON keeps its order.
    shares = {"negative_share": lambda: found.share, "worst_negative_share": lambda: found.worst}
    warnings = (*made.warnings, *found.warnings(made.map))
    return replace(made, further={**made.further, **shares}, warnings=warnings)
