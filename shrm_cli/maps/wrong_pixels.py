"""The shares of what is visible of a map whose luminance is wrong, or negative, beside its lamps.

A relative RMS error under lamps is that of the lamps' reflections. What people see is how many
pixels are wrong. So the reflected light is computed with and without what the map leaves out, at
some central directions and for some views of each, and it is counted where the two differ. The
light of a map's error is that of the lobes' errors, so that one sum over both tells; see
`shrm_cli.maps.lobes_lit`.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import field, replace

import numpy as np

from shrm_cli.arrays import Array, Indices
from shrm_cli.brdf.base import Brdf
from shrm_cli.maps.base import Map
from shrm_cli.maps.lobes_lit import Lobes, judged, lit, reflected, together
from shrm_cli.maps.request import Prefiltered
from shrm_cli.maps.sphere_pixels import Pixels, Side, all_sides, one_side, sample_views
from shrm_cli.probe.lighting import Lighting
from shrm_cli.probe.probe import Probe
from shrm_cli.progress import using
from shrm_cli.records import once_each, record
from shrm_cli.sphere.cube import bilinear_filtering
from shrm_cli.sphere.directions import bisector, horizontal_tangents
from shrm_cli.vocabulary import LUMINANCE, NEGATIVE_FROM_A_SIDE, NEGATIVE_SHARE, SEEN_FLOOR, WRONG

Points = tuple[Indices, ...]
"""The indices of some of the pixels: their directions, views and azimuths."""


@record(eq=False)
class LookUps:
    """A map that is made, of which texels are looked up between."""

    radiance: Callable[[Array, Array, Array], Array]
    """Takes normals, tangents and views; returns what the map shows, shape (..., 3)."""
    held: Sequence[Lobes] | None
    """The lobes of its series, for each term; or none where they are too coarse for what look-ups
    lose. Between the views of brushed lobes tables are interpolated, which is 3 % off for gold
    under a sunset, where look-ups lose 1 %."""

    def lost_at(self, at: Pixels, places: Points, lighting: Lighting) -> Array:
        """Return what a GPU loses of the luminance at some of the pixels, as lobes tell it.

        Without lobes the map is looked up once more by cubic interpolation, which loses less: of
        `charlie` on 12 texels in a courtyard it tells 1.7 % wrong pixels, lobes 2.9 %, and 3.2 %
        are.
        """
        points = at.normals[places], at.tangents(places), at.views[places]
        own: Array
        if self.held is None:
            own = 2 * np.pi * self.radiance(*points) @ LUMINANCE
        else:
            lights, _ = lit(lighting.coefficients * LUMINANCE, together(self.held), at)
            own = np.broadcast_to(lights, at.views.shape[:-1])[places]
        with bilinear_filtering():
            return np.asarray(own - 2 * np.pi * self.radiance(*points) @ LUMINANCE)


def are_look_ups_seen(error: float, filter_error: float) -> bool:
    """Tell whether look-ups make pixels wrong that are not wrong already.

    `error` and `filter_error` are the relative RMS errors of what a map misses, and of look-ups.
    """
    return filter_error > _LOOKED_UP * error


def wrong_share(
    lighting: Lighting, lobes: Sequence[Lobes], look_ups: LookUps | None = None
) -> float:
    """Return the share of points whose luminance is wrong by more than `WRONG`, in 0 .. 1.

    `lighting` is the light, to at least the order of the lobes. `lobes` are those of each term;
    they reflect their light at the same points. Where `look_ups` are given, what they lose counts.
    """
    is_all_known = lamps_beside.get() is None and look_ups is None
    if is_all_known and not any(each.error.any() for each in lobes):
        return 0.0
    groups = together(lobes)
    # Texels are finer than what lobes show. Lamps take too long at as many points.
    is_dense = look_ups is not None and look_ups.held is not None and lamps_beside.get() is None
    at = judged(groups, is_dense)
    whole, error = lit(lighting.coefficients * LUMINANCE, groups, at)
    return share_of_points(lighting, groups, whole, error, look_ups=look_ups, at=at)


def share_of_points(
    lighting: Lighting, groups: Sequence[Lobes], whole: Array, error: Array, apart: int = 1,
    look_ups: LookUps | None = None, at: Pixels | None = None,
) -> float:  # fmt: skip
    """Return the share of points at which the error is too large.

    `whole` and `error`, of shape (directions, views, azimuths), are what `lit` returns for light
    and lobes; or those of every direction that is so many `apart`. What `look_ups` lose is added to
    the error. `at` are the points, by default those of `judged`.
    """
    lamps, first, at = lamps_beside.get(), lighting.coefficients[:1], at or judged(groups)
    floor = SEEN_FLOOR * _mean(first if lamps is None else first + lamps.lit.first, groups)

    def badness(seen: Array, wrong: Array) -> Array:
        return np.asarray(np.abs(wrong) / (WRONG * np.maximum(seen, floor)))

    parts, found = np.broadcast_to(at.parts, at.views.shape[:-1])[::apart], []
    by_view = sample_views(at.center, error.shape[1])[1]
    for each in at.surfaces:
        own = parts[..., each]
        seen, wrong = (
            np.broadcast_to(values, parts.shape)[..., each].ravel() for values in (whole, error)
        )
        shares: Array = (own * by_view[:, None]).ravel()
        some = np.arange(len(shares))
        if lamps is not None:
            # They take long, so that they are known of some points.
            some = _some_points(own, _POINTS_BESIDE // len(at.surfaces))
            places = _places(some, own.shape, each, apart)
            shares = shares[some]
            seen = seen[some] + lamps.lit.seen_at(at, places)
            wrong = wrong[some] + lamps.wrong_at(at, places)
        shares = shares / float(shares.sum())
        bad = badness(seen, wrong)
        share = float(np.sum(shares, where=bad > 1))
        if look_ups is not None:
            # These take long, too, and change little.
            drawn, stand_for = _drawn(shares, bad, _LOOK_UPS // len(at.surfaces))
            places = _places(some[drawn], own.shape, each, apart)
            lost = look_ups.lost_at(at, places, lighting)
            more = 1.0 * (badness(seen[drawn], wrong[drawn] + lost) > 1) - (bad[drawn] > 1)
            share = min(max(share + float(more @ stand_for), 0.0), 1.0)
        found.append(share)
    return max(found)


def _places(some: Indices, shape: tuple[int, ...], surface: slice, apart: int) -> Points:
    """Return where points of a surface stand among the pixels, whose directions are so many apart.

    `some` are their indices among all points of the surface, which are of a `shape`.
    """
    direction, view, azimuth = np.unravel_index(some, shape)
    return direction * apart, view, azimuth + (surface.start or 0)


def _some_points(parts: Array, most: int) -> Indices:
    """Return the indices of some points of a surface, of which `parts` are those of `Pixels`.

    Where all azimuths count alike there are `most` of them: each direction has a few of the views,
    at one azimuth, which stands for all of them. Where tangents are horizontal, most points have
    hardly any normals, and the few others are all taken: of every sixth of the views 4.5 % seemed
    wrong of gold under a sunrise, and 6 % were.
    """
    if np.ptp(parts) > 0:
        return np.flatnonzero(parts)
    directions, views, azimuths = parts.shape
    direction = np.arange(0, directions, max(directions // most, 1))[:, None]
    count = max(most // directions, 1)
    view = np.arange(count) * (views // count) + direction % (views // count)
    return np.ravel((direction * views + view) * azimuths + (direction + view) % azimuths)


def _drawn(shares: Array, bad: Array, count: int) -> tuple[Indices, Array]:
    """Draw points for look-ups, more of them where these may decide whether a pixel is wrong.

    `shares` are the parts of all pixels that points stand for, and `bad` is how wrong they are
    without look-ups, 1 where they are just wrong; both of shape (n,).

    Returns the indices of some, and what each of them stands for, shape (count,).
    """
    density = shares * np.where((bad > 1 / _NEAR) & (bad < _NEAR), _MORE, 1.0)
    sums = np.cumsum(density)
    step = float(sums[-1]) / count
    found = np.searchsorted(sums, step * (np.arange(count) + 0.5))
    return found, step * shares[found] / density[found]


def _mean(first: Array, groups: Sequence[Lobes]) -> float:
    """Return the mean luminance of all pixels, for the light's coefficients of degree 0, (1, 3)."""
    # Only degree 0 has a mean over all central directions.
    light = first * LUMINANCE
    means = sum(each.whole[0, 0].real * light[0] for each in groups).sum(axis=-1)
    views = max(each.whole.shape[2] for each in groups)
    return float(np.sum(means * sample_views(groups[0].center, views)[1]))


@record(eq=False)
class LampsLit:
    """What is reflected of lamps beside a map, whatever that map holds."""

    flux: Array
    """The integral of their radiance, shape (3,)."""
    radiance: Callable[[Array, Array, Array], Array]
    """Takes normals, tangents and views; returns what is reflected, shape (..., 3)."""
    may_darken: bool = False
    """Whether some of their radiance is negative."""
    _known: dict[object, Array] = field(default_factory=dict, init=False, repr=False)
    _visible: dict[Side, Array] = field(default_factory=dict, init=False, repr=False)

    @property
    def first(self) -> Array:
        """The coefficients of degree 0 of the lamps' light, shape (1, 3)."""
        return self.flux[None] / np.sqrt(4 * np.pi)

    def seen_at(self, at: Pixels, places: Points) -> Array:
        """Return the luminance of it at some of the pixels, as lobes tell it."""
        known = at, *(each.tobytes() for each in places)
        if known not in self._known:
            normals, views = at.normals[places], at.views[places]
            light = self.radiance(normals, at.tangents(places), views)
            self._known[known] = 2 * np.pi * light @ LUMINANCE
        return self._known[known]

    def visible_at(self, side: Side, where: Indices) -> Array:
        """Return the luminance of it at some pixels of spheres, by their indices, shape (n,).

        Each of them is found once.
        """
        found = self._visible.setdefault(side, np.full(len(side.points[0]), np.nan))
        new = where[np.isnan(found[where])]
        if len(new):
            mirrored, views = (each[new] for each in side.points)
            normals = bisector(mirrored, views)
            light = self.radiance(normals, horizontal_tangents(normals), views)
            found[new] = light @ LUMINANCE
        return found[where]


@record(eq=False)
class LampsBeside:
    """Lamps beside a map, whose light hides errors of the map, and has errors of its own."""

    lit: LampsLit
    wrong: Array
    """The coefficients of what is wrong with their light, and not in the map: true light less
    theirs, (n, 3)."""
    lobes: Lobes
    """Those of the BRDF, to the degrees of what is wrong. The map may know fewer degrees of the
    light that is left for it."""
    pixels: LampsLit | None = None
    """What is reflected of the lamps' own pixels, where lobes do not tell what is wrong."""

    def wrong_at(self, at: Pixels, places: Points) -> Array:
        """Return the luminance of what lobes reflect of that, as `LampsLit.seen_at`."""
        if self.pixels is not None:
            return self.pixels.seen_at(at, places) - self.lit.seen_at(at, places)
        return self._wrong_about(at)[places]

    @once_each
    def _wrong_about(self, at: Pixels) -> Array:
        return np.broadcast_to(reflected(self.lobes, self.wrong, at), at.views.shape[:-1])


lamps_beside: ContextVar[LampsBeside | None] = ContextVar("lamps_beside", default=None)
"""The lamps together with which maps are judged, where there are any."""


@contextmanager
def beside_lamps(lamps: LampsBeside | None) -> Iterator[None]:
    """Count wrong and negative pixels of maps as they are seen together with lamps beside them."""
    token = lamps_beside.set(lamps)
    try:
        yield
    finally:
        lamps_beside.reset(token)


_LOOKED_UP = 0.1
"""The error of look-ups, in units of that of functions and orders, from which it shows. With a half
4.6 % wrong pixels were predicted of `charlie` in a studio, and an engine showed 7.6 %."""
_POINTS_BESIDE = 3840
"""The number of points at which lamps are integrated, on all surfaces together, as long as all
points count alike."""
_LOOK_UPS = 7680
"""The number of points at which look-ups are made, on all surfaces together. Of 3,840 that are
drawn evenly 2.4 to 3.5 % are wrong of `oren-nayar` at night, of these 2.7 to 2.9 %."""
_NEAR, _MORE = 3.0, 4.0
"""Points that are wrong by a third to three times of what shows are drawn so many times as often
for look-ups."""


# ---- what is negative ----------------------------------------------------------------------------
# A series of few degrees swings below 0 beside what is bright. From most sides nobody may see any
# of that, and from one that faces the lamps much of a rim. So each side is counted by itself.

Truth = Callable[[Array, Array], Array]
"""Takes normals and views; returns what is reflected, shape (n, 3)."""
_PIXELS = 128
"""The number of pixels from each side. From some side 1 % and more are negative of `microfacet`
under a bare sun, in a forest, a room and at sunrise; 64 pixels missed that of a larger map under
the sun."""
_CLOSER, _PIXELS_CLOSER = 4, 1024
"""How many of the darkest sides are looked at once more, and in how many pixels: one of
128 may be dark by chance."""
_FAINT = 0.1
"""The part of the mean luminance below which texels are looked up between, not the nearest ones.
With dark ones alone 26 % seemed negative of a map of large texels, of which 29 % are; with nearest
ones .2 % of a matt sphere at the edge of its shadow, where none is."""
_TRUE, _TRUE_CLOSER = 1024, 256
"""The numbers of dark pixels whose truth is looked at, about, of all sides and of one."""


@record
class Negative:
    """Which part of what is visible of a map has a luminance below 0, in 0 .. 1."""

    share: float
    """From all sides, to about 0.0005 where it is small."""
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
        seen.lit_share(truth, black, _TRUE),
        max((each.lit_share(truth, black, _TRUE_CLOSER) for each in closer), default=0.0),
    )


class _Seen:
    """What is visible of a map, with the lamps that lie beside it."""

    def __init__(self, map_: Map, side: Side) -> None:
        beside = lamps_beside.get()
        self._side, self._lamps = side, None if beside is None else beside.lit
        shown = map_.shaded()
        self._shown = shown.rough_radiance(*side.points) @ LUMINANCE
        if (self._shown < 0).any():
            # The nearest texel of a point may lie beyond the edge of a shadow, where it is black.
            faint = np.flatnonzero(self._shown < _FAINT * np.abs(self._shown).mean())
            mirrored, views = (each[faint] for each in side.points)
            self._shown[faint] = shown.radiance(bisector(mirrored, views), views) @ LUMINANCE
        self.is_dark = self._shown < 0
        """Which pixels have a negative luminance, shape (n,)."""
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

    def lit_share(self, truth: Truth, black: float, count: int) -> float:
        """Return the share of pixels that are dark, and brighter than black in truth.

        The truth of about so many of them tells.
        """
        dark = np.flatnonzero(self.is_dark)
        if not len(dark):  # those seen from afar were dark by chance
            return 0.0
        dark = dark[:: max(len(dark) // count, 1)]
        mirrored, views = (each[dark] for each in self._side.points)
        is_lit = truth(bisector(mirrored, views), views) @ LUMINANCE > black
        return self.share * float(is_lit.mean())


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
