"""`choose`: every form of a probe and a material, and the one to ship.

SHRMs and maps of principal functions come in rows of ever more cubes, known by bytes and errors
before any is made, so that hundreds of them can be searched. Forms of which no error is predicted,
and the light itself, are made to be known.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.environment.lobe import perceptual_roughness
from shrm_cli.brdf.spec import AnyBrdf, as_brdf
from shrm_cli.choose.offer import Choice, Offer, decided
from shrm_cli.errors import ArgumentError, MapError, PluginError, ShrmError
from shrm_cli.lights.beside import split_of
from shrm_cli.maps import registry
from shrm_cli.maps.base import Map, ReflectedLight
from shrm_cli.maps.expansion import Expansion
from shrm_cli.maps.kinds import LightMap
from shrm_cli.maps.lamps.map import LampMap
from shrm_cli.maps.lobes_lit import keeping_light
from shrm_cli.maps.offers import LookUp, Setting
from shrm_cli.maps.options import counted, parse_bytes
from shrm_cli.maps.principal.plan import Joint
from shrm_cli.maps.principal.proposal import Proposals
from shrm_cli.maps.principal.selection import bundle_degrees
from shrm_cli.maps.principal.terms import planner_of
from shrm_cli.maps.request import Prefiltered, Request
from shrm_cli.maps.seen import as_candidate
from shrm_cli.maps.shader.cost import Cost, cost_of, principal_cost, shrm_cost
from shrm_cli.maps.shrm.proposals import ShrmProposals
from shrm_cli.maps.size import total_error
from shrm_cli.maps.wrong_pixels import Truth as Reflected
from shrm_cli.maps.wrong_pixels import negative_in, negative_of, truth_of
from shrm_cli.messages import several
from shrm_cli.plan import policy
from shrm_cli.plan.search import Candidate, Goal, Row, kept_in_fewest
from shrm_cli.prefilter import prefilter_with_facts
from shrm_cli.probe.coarse import fine_probe
from shrm_cli.probe.lighting import Projection
from shrm_cli.probe.open import AnyProbe, as_probe
from shrm_cli.probe.probe import Probe
from shrm_cli.probe.shared import shared
from shrm_cli.progress import Progress, Rising, Stages, using
from shrm_cli.records import record
from shrm_cli.reference import Reference
from shrm_cli.render.seen import seen_errors
from shrm_cli.render.sphere import Reflecting
from shrm_cli.sphere.directions import bisector
from shrm_cli.sphere.quadrature import scrambled, spiral_directions
from shrm_cli.vocabulary import AUTO, DEFAULT_ERROR, DEFAULT_MAX_SIZE, DEFAULT_SEEN

ASKED = Request("principal", error=policy.LEAST_ERROR)
"""What all maps are proposed for: the BRDF is sampled once, as far as the best of them need it."""


@record(eq=False)
class Known:
    """A map that could be made, and what it takes to look it up."""

    candidate: Candidate[Prefiltered]
    what: str
    """Its cubes in words."""
    cost: Cost
    arguments: Mapping[str, Any] | None
    """What `shrm_cli.prefilter.prefilter` is given; None where no arguments make it."""


@record(eq=False)
class Making:
    """What makes the map of an offer, also where the offer is pickled for another process."""

    probe: Probe
    brdf: Brdf
    arguments: Mapping[str, Any] | None
    """What `shrm_cli.prefilter.prefilter` is given; None where no arguments make it."""
    known: Callable[[], Map] | None = None
    """Makes it of what is known here already; it is left out where this is pickled."""

    def __call__(self, progress: Progress | None = None) -> Map:
        if self.known is not None:
            return self.known()
        if self.arguments is None:
            raise MapError("no arguments make this map; choose anew, and make it in that process")
        given = dict(self.arguments)
        to = given.pop("to")
        needed = {"brdf": self.brdf} if registry.description(to).needs_brdf else {}
        return prefilter_with_facts(self.probe, to, {**given, **needed}, progress).map

    def __getstate__(self) -> dict[str, Any]:
        return {**vars(self), "known": None}

    def __deepcopy__(self, memo: object) -> Self:
        return self


Rows = list[list[Known]]
"""Maps of a form, in each row by rising bytes. Those of a row have cubes of one size, so that
hardly any is more often wrong than the one before; that none has more error is nearly true."""


def principal_rows(proposals: Proposals) -> Rows:
    """Return the maps of principal functions."""

    def known(joint: Joint) -> Known:
        forms = joint.forms
        cost = Cost(0, 0)
        for form, part in zip(forms, proposals.parts, strict=True):
            cost += principal_cost(bundle_degrees(form.counts), part.center)
        what = " + ".join(f"{counted(form.cubes, 'cube')} of {form.size}" for form in forms)
        arguments: dict[str, Any] | None = None
        if len(forms) == 1:
            arguments = {"to": "principal", "maps": forms[0].cubes, "size": forms[0].size}
        return Known(proposals.rough(joint), what, cost, arguments)

    rows = proposals.sharing.rows(DEFAULT_MAX_SIZE)
    return [[known(joint) for joint in row.every()] for row in rows]


def shrm_rows(light: Projection, brdf: Brdf, principal: Proposals) -> Rows:
    """Return SHRMs of every order P and size, about the center of the `principal` maps.

    A sum, which has no single center there, is expanded about its own.
    """
    if len(principal.parts) == 1:
        part, planner = principal.parts[0], principal.planners[0]
    else:
        part, planner = brdf, planner_of(light, brdf, ASKED)
    proposals = ShrmProposals.of(light, replace(ASKED, brdf=part), planner.spectrum.transfer)

    def known(expansion: Expansion) -> Known:
        size, order_p = expansion.size, expansion.orders.order_p
        arguments: dict[str, Any] = {"to": "shrm", "order_p": order_p, "size": size}
        if part.center != brdf.center:
            arguments["center"] = part.center
        what = f"P = {order_p}, {counted((order_p + 1) ** 2, 'cube')} of {size}"
        cost = shrm_cost(order_p, part.center)
        return Known(proposals.proposed(expansion), what, cost, arguments)

    rows = proposals.expansions(DEFAULT_MAX_SIZE)
    return [[known(each) for each in row.every()] for row in rows]


_POINTS = 400
"""The pairs of a mirror direction and a view. A share of 5 % is known to 1.1 % of all by them."""
_ROWS = 256
"""Rows of the probe for the truth: with half as many it is wrong by 2 % in sharp lobes."""


class Truth:
    """The light that a BRDF reflects of a probe, spread evenly over the pixels of spheres."""

    def __init__(self, probe: Probe, brdf: Brdf, progress: Progress | None = None) -> None:
        self._probe, self._brdf, self._progress = probe, brdf, progress
        mirrored = spiral_directions(_POINTS)
        self._views = mirrored[scrambled(_POINTS)]
        self._normals = bisector(mirrored, self._views)

    @cached_property
    def _radiance(self) -> Array:
        height = _ROWS if self._probe.grid.latlong_rows > _ROWS else None
        truth = Reference(self._probe, self._brdf, height, progress=self._progress)
        return truth.radiance(self._normals, self._views)

    def errors(self, shown: Reflecting, scale: ArrayLike = 1.0) -> tuple[float, float]:
        """Measure a map.

        `scale`, of shape (3,), is what its light is multiplied with.

        Returns `error`, the relative RMS error; 0 where nothing is reflected and nothing shown; and
        `wrong_share`, the share of points whose luminance is wrong by more than 5 %.
        """
        found = shown.radiance(self._normals, self._views) * np.asarray(scale)
        truth = self._radiance
        missed, whole = np.linalg.norm(found - truth), np.linalg.norm(truth)
        error = missed / whole if whole > 0 else np.inf if missed > 0 else 0.0
        return float(error), seen_errors(found, truth).wrong_share


def others_of(brdf: Brdf, missing: list[str]) -> list[tuple[str, Setting]]:
    """Return the maps of other forms that can hold a material: the forms, and what to ask of them.

    They are the forms whose descriptions say that they are offered, of installed packages too.

    `missing` gets why a form is left out that an installed package offers, and that cannot be used.
    """
    found: list[tuple[str, Setting]] = []
    for form in registry.names():
        try:
            if registry.description(form).is_offered:
                settings = registry.module(form, "offers").settings(brdf)
                found += [(form, setting) for setting in settings]
        except PluginError as reason:
            missing.append(f"no {form}: {reason}")
    return found


def made_offers(
    form: str,
    setting: Setting,
    probe: Probe,
    brdf: Brdf,
    truth: Truth,
    progress: Progress | None = None,
) -> list[Offer]:
    """Make a map once, and measure it as it is looked up in each way."""
    make = Making(probe, brdf, {"to": form, **setting.arguments})
    made = make(progress)
    looked_up = registry.module(form, "offers").look_up
    return [
        _measured(made, looked_up(made, brdf, taps), taps, setting, brdf, truth, make)
        for taps in setting.taps or (None,)
    ]


def _measured(
    made: Map,
    look_up: LookUp,
    taps: int | None,
    setting: Setting,
    brdf: Brdf,
    truth: Truth,
    make: Callable[[], Map],
) -> Offer:
    """Measure a map, with so many taps where it is looked up with some."""
    shown: ReflectedLight = made.shaded()
    if taps is not None and not brdf.isotropic:
        roughness, anisotropy, f0 = brdf.brushed_surface  # type: ignore[attr-defined]
        shown = made.shaded(roughness, f0, anisotropy, taps)
    elif isinstance(made, LightMap) and "f0" not in made.surface_arguments:  # of that BRDF
        shown = made.shaded(perceptual_roughness(brdf))
    elif isinstance(made, LightMap):
        shown = made.shaded(brdf.number("roughness"), brdf.color("f0"), taps=taps)
    error, share = truth.errors(shown, brdf.color("albedo") if made.is_white else 1.0)
    measured: tuple[str, ...] = ("error", "wrong_share")
    if not isinstance(made, LightMap):
        error, measured = total_error(made.stated_error), ("wrong_share",)
    form, cost = made.representation, look_up.cost
    return Offer(
        form, look_up.what, look_up.bytes, error, share, measured, cost.look_ups,
        cost.multiply_adds, {"to": form, **setting.arguments}, make,
    )  # fmt: skip


# ---- the choice ----------------------------------------------------------------------------------

ERRORS = 0.2, 0.1, 0.05, 0.025, 0.0125
"""The errors for each of which the map of the fewest bytes is offered."""


def choose(
    probe: AnyProbe,
    brdfs: Sequence[AnyBrdf] | AnyBrdf,
    budget: int | str | None = None,
    error: float = DEFAULT_ERROR,
    seen: float = DEFAULT_SEEN,
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
    asked = several(brdfs, "brdfs")
    stages = Stages(progress, len(asked))
    found: list[Choice] = []
    for each in asked:
        brdf = as_brdf(each, light.chromaticities)
        with keeping_light():
            found.append(_chosen(light, brdf, str(each), Goal(error, seen), most, stages.within))
        stages.done(len(found), len(asked))
    return tuple(found)


def checked_budget(budget: int | str | None) -> int | None:
    """Return a number of bytes from itself or from text."""
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
    missing: list[str] = []
    light = Projection(shared(fine_probe(probe)))
    most = DEFAULT_MAX_SIZE if budget is None else min(budget, DEFAULT_MAX_SIZE)
    with using(work):
        principal = Proposals(light, replace(ASKED, brdf=brdf))
        offers += _offers_of(principal_rows(principal), goal, most, probe, brdf)
        if brdf.isotropic:  # an SHRM knows no tangent
            offers += _offers_of(shrm_rows(light, brdf, principal), goal, most, probe, brdf)
    for form, setting in others_of(brdf, missing):
        try:
            offers += made_offers(form, setting, probe, brdf, truth, work)
        except ShrmError as reason:
            missing.append(f"no {form}: {reason}")
    count = 0 if brdf.center == "tangent" else len(split_of(probe).discs)
    found = _without_spots(decided(probe.name, name, goal, budget, offers), truth_of(probe, brdf))
    have_spots = any(each.has_spots for each in found.offers)
    if have_spots or (count and _may_gain_by_lamps_beside(found)):
        made = _automatic(probe, brdf, goal, budget, work)
        if made is not None and not any(made.is_like(each) for each in found.offers):
            found = decided(probe.name, name, goal, budget, [*found.offers, made])
    work.end()
    return replace(found, lamps=count, warnings=tuple(f"{name}: {line}" for line in missing))


def _without_spots(choice: Choice, truth: Reflected) -> Choice:
    """Recommend a map that is negative nowhere where that is seen, if there is one.

    Those whose errors are predicted are looked at, as `to` auto does, one after the other as they
    would be recommended.
    """
    for _ in range(policy.TRIED_DARK):
        best = choice.recommended
        if best is None or best.measured or not choice.is_kept:
            break
        if not negative_of(best.make(), truth).is_seen:
            break
        offers = [replace(each, has_spots=True) if each is best else each for each in choice.offers]
        choice = decided(choice.probe, choice.brdf, choice.goal, choice.budget, offers)
    return choice


def _may_gain_by_lamps_beside(choice: Choice) -> bool:
    """Tell whether `to` auto looks for lamps beside a map: where none of all light is small."""
    best = choice.recommended
    return best is None or not choice.is_kept or best.bytes > policy.LARGE


def _automatic(
    probe: Probe, brdf: Brdf, goal: Goal, budget: int | None, progress: Progress
) -> Offer | None:
    """Return the map that `to` auto makes, if any fits in the budget."""
    given: dict[str, Any] = {}
    if goal != Goal():
        given |= {"error": goal.error, "seen": goal.wrong_share}
    if budget is not None:
        given["max_size"] = budget
    try:
        made = prefilter_with_facts(probe, AUTO, {**given, "brdf": brdf}, progress)
    except ShrmError:  # of a budget in which nothing fits
        return None
    known = as_candidate(made)
    share = known.wrong_share
    assert share is not None  # both forms that are predicted know theirs
    cost, what = cost_of(made.map), f"{counted(known.look_ups, 'cube')} of {made.map.size}"
    if isinstance(made.map, LampMap):
        what += f", {counted(len(made.map.discs), 'disc')} beside"
    arguments = {"to": AUTO, **given}
    return Offer(
        known.form, what, known.bytes, known.total_error, share, (), known.look_ups,
        None if cost is None else cost.multiply_adds,
        arguments, Making(probe, brdf, arguments, lambda: made.map),
        has_spots=negative_in(made).is_seen,
    )  # fmt: skip


def _ladder(rows: Rows) -> Iterator[Known]:
    """Yield the map of the fewest bytes for each of the `ERRORS`, up to what there is."""
    for error in ERRORS:
        found = _least(rows, error, DEFAULT_MAX_SIZE)
        if found is not None:
            yield found
            if found.candidate.total_error > error:
                return


def _for_goal(rows: Rows, goal: Goal, max_size: int) -> Iterator[Known]:
    """Yield the map that keeps the goal in the fewest bytes, or else that of the least error."""
    fitting = [[each for each in row if each.candidate.bytes <= max_size] for row in rows]
    found = kept_in_fewest((_row_of(each) for each in fitting), goal)
    best = next((each for row in fitting for each in row if each.candidate is found), None)
    if best := best or _least(rows, 0.0, max_size):
        yield best


def _least(rows: Rows, error: float, max_size: int) -> Known | None:
    """Return the map of the fewest bytes that keeps an error, or the one of the least error."""
    fitting = [each for row in rows for each in row if each.candidate.bytes <= max_size]
    kept = [each for each in fitting if each.candidate.total_error <= error]
    if kept:
        return min(kept, key=lambda each: each.candidate.bytes)
    return min(fitting, key=lambda each: each.candidate.total_error, default=None)


def _row_of(maps: Sequence[Known]) -> Row[Candidate[Prefiltered]]:
    candidates = [each.candidate for each in maps]
    return Row(len(maps), lambda index: candidates[index].bytes, candidates.__getitem__)


def _offers_of(rows: Rows, goal: Goal, most: int, probe: Probe, brdf: Brdf) -> list[Offer]:
    """Return the maps of a form that are offered, which nothing else holds on to then."""
    known = dict.fromkeys([*_ladder(rows), *_for_goal(rows, goal, most)])
    return [_offer(each, probe, brdf) for each in known]


def _offer(known: Known, probe: Probe, brdf: Brdf) -> Offer:
    """Return a map as an offer, without its cubes, which are made again where they are asked for.

    Those of all offers together take 200 to 300 MB.
    """
    candidate, make = known.candidate.exact, known.candidate.make
    share = candidate.wrong_share
    assert share is not None  # both forms that are predicted know theirs
    known.candidate.let_go()
    return Offer(
        candidate.form, known.what, candidate.bytes, candidate.total_error, share,
        (), known.cost.look_ups, known.cost.multiply_adds, known.arguments,
        Making(probe, brdf, known.arguments, lambda: make().map),
    )  # fmt: skip
