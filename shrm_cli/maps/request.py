"""What is asked of a map: the arguments of prefiltering, checked and resolved once.

The makers of maps take a `Request`, files record it, and batches compare their outputs with it.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import field
from types import MappingProxyType
from typing import Any, Self, cast

from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.library import foreign_modules
from shrm_cli.brdf.spec import as_brdf
from shrm_cli.errors import ArgumentError
from shrm_cli.maps import registry
from shrm_cli.maps.base import Map
from shrm_cli.maps.info import record_of
from shrm_cli.maps.options import SHARED, bytes_text, listing, owners
from shrm_cli.maps.size import stored_bytes
from shrm_cli.messages import percent
from shrm_cli.probe.probe import Probe
from shrm_cli.records import record
from shrm_cli.sources import package_digest
from shrm_cli.vocabulary import (
    AUTO,
    DEFAULT_EPS,
    DEFAULT_ERROR,
    DEFAULT_MAX_SIZE,
    DEFAULT_SEEN,
    EXPANDED,
    Domain,
    Frame,
    Sampling,
)

GOALS = "error", "seen"
"""The arguments that ask something of the picture, and choose others."""


@record(eq=False)
class Request:
    """The arguments of `shrm_cli.prefilter.prefilter`, with their defaults.

    `to` is the representation; ``auto`` only where nothing is asked that an SHRM alone obeys.
    `brdf` is None for forms that have a BRDF of their own. `own` are the options of the
    representation itself; one that was not given and has no default is missing. `given` are the
    arguments that were given, but for the BRDF.
    """

    to: str
    brdf: Brdf = cast(Brdf, None)  # whoever needs one is refused without, see `check_arguments`
    eps: float = DEFAULT_EPS
    error: float | None = None
    seen: float | None = None
    order_f: int | None = None
    order_p: int | None = None
    center: str | None = None
    frame: Frame = "global"
    size: int | None = None
    sampling: Sampling = "center"
    max_size: int | None = None
    domain: Domain = "frequency"
    source_height: int | None = None
    sun: str | None = None
    own: Mapping[str, Any] = field(default_factory=dict)
    given: Mapping[str, Any] = field(default_factory=dict)

    @classmethod
    def of(cls, to: str, given: Mapping[str, Any], probe: Probe) -> Self:
        """Check arguments, and resolve what they mean.

        `given` are the arguments of `shrm_cli.prefilter.prefilter` by name. One that is None counts
        as not given. `probe` is the light, in whose primaries the colours of the BRDF are taken.
        """
        to = resolved_form(to, given)
        named = {name: value for name, value in given.items() if value is not None}
        check_arguments(to, named)
        brdf = as_brdf(named.pop("brdf"), probe.chromaticities) if "brdf" in named else None
        named = checked_options(to, named)
        values = {**registry.description(to).defaults, **_default_goal(to, named), **named}
        shared = {name: values.pop(name) for name in SHARED if name in values}
        own, given = MappingProxyType(values), MappingProxyType(named)
        return cls(to, cast(Brdf, brdf), **shared, own=own, given=given)

    @property
    def splits(self) -> bool:
        """Whether the lamps are to be beside the map."""
        return self.sun == "split"

    @property
    def is_free(self) -> bool:
        """Whether both orders are chosen, because neither is given."""
        return self.order_f is None and self.order_p is None

    @property
    def allowed(self) -> int:
        """The most bytes of a map whose orders are chosen.

        A size that is given by hand is obeyed even where the default would not allow it.
        """
        if self.max_size is not None:
            return self.max_size
        return max(DEFAULT_MAX_SIZE, 0 if self.size is None else stored_bytes(self.size, 1))

    def record(self, probe: Probe) -> dict[str, Any]:
        """Return what a map's file records of the request.

        The BRDF has a record of its own, but where a map is made of each of its roughnesses.

        Returns values as JSON has them, under ``reading`` how the probe was read, and under
        ``code`` a digest of the BRDF's, where it is not all of `shrm`.
        """
        automatic: dict[str, Any] = {}
        if self.to == AUTO:
            from shrm_cli.plan.search import Goal  # plain runs search nothing

            goal = Goal.of(self.error, self.seen)
            automatic = {"to": AUTO, "error": goal.error, "seen": goal.wrong_share}
        found = recorded_defaults(self.to, self.given) | automatic | _listed(self.given)
        if self.brdf is not None and not registry.description(self.to).needs_brdf:
            found["brdf"] = record_of(self.brdf)
        if self.brdf is not None and (others := sorted(foreign_modules(self.brdf))):
            from hashlib import sha256

            found["code"] = sha256(b"".join(map(package_digest, others))).hexdigest()[:16]
        return {**found, "reading": probe.reading()}


def recorded_defaults(to: str, given: Iterable[str]) -> dict[str, Any]:
    """Return the defaults of the arguments that a representation obeys, as a map records them.

    Those that follow from the light and the BRDF are no values yet, and are left out.

    `given` are the names of arguments that are given. An error is asked for instead of `eps`.
    """
    form = registry.description(to)
    goal = _default_goal(to, given)
    unasked: set[str] = set()
    if {"error", "seen"} & {*given, *goal}:
        unasked = {"eps"}.union(*form.steps)
    defaults = {**form.defaults, **goal}
    return _listed({name: value for name, value in defaults.items() if name not in unasked})


def _default_goal(to: str, given: Iterable[str]) -> dict[str, float]:
    """Return what a representation asks of the picture, unless given arguments say what is made."""
    instead = registry.description(to).instead_of_seen
    if instead is None or instead & set(given):
        return {}
    return {"seen": DEFAULT_SEEN}


def _listed(values: Mapping[str, Any]) -> dict[str, Any]:
    return {
        name: list(value) if isinstance(value, tuple) else value for name, value in values.items()
    }


def resolved_form(to: str, given: Mapping[str, Any]) -> str:
    """Return the representation that is asked for: with arguments of SHRMs, ``auto`` is one.

    `given` are the arguments of `shrm_cli.prefilter.prefilter` by name. One that is None counts as
    not given.
    """
    named = {name for name, value in given.items() if value is not None}
    return EXPANDED if to == AUTO and named - registry.description(AUTO).arguments else to


def checked_options(to: str, given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the arguments but for the BRDF as the makers of maps take them."""
    is_angular = given.get("domain") == "angular"
    for name in ("order_f", "order_p") if is_angular else ("source_height",):
        if name in given:
            domain = "frequency" if is_angular else "angular"
            raise ArgumentError(name, f"applies with `domain` {domain}")
    asking = next((name for name in reversed(GOALS) if name in given), None)
    for name in sorted(given.keys() & registry.description(to).chosen if asking else ()):
        raise ArgumentError(name, f"does not apply with `{asking}`, which chooses it")
    return registry.checked(to, given)


def over(
    before: Mapping[str, Any], own: Mapping[str, Any], chosen: frozenset[str]
) -> dict[str, Any]:
    """Return arguments over others, without those of the others that do not apply with them.

    `chosen` are the arguments that an error chooses: one that is given takes its place, and the
    reverse.
    """
    dropped: set[str] = set()
    if own.keys() & set(GOALS):
        dropped |= chosen
    if own.keys() & chosen:
        dropped |= set(GOALS)
    return {**{name: each for name, each in before.items() if name not in dropped}, **own}


def check_arguments(to: str, given: Iterable[str]) -> None:
    """Check that a representation is known, obeys all arguments, and has all that it needs."""
    chosen, given = registry.description(to), set(given)
    known = {AUTO: registry.description(AUTO), **registry.descriptions(to)}
    for name in sorted(given - chosen.arguments):
        if not (of := owners(known, name)):
            raise ArgumentError(name, "is no argument of prefilter")
        why = f"; {chosen.why_no_brdf}" if name == "brdf" else ""
        raise ArgumentError(name, f"applies with `to` {listing(of, 'or')}{why}")
    if chosen.needs_brdf and "brdf" not in given:
        raise ArgumentError("brdf", f"is missing; `to` {to} needs one")


# ---- what was made, with facts about it that its file does not keep ------------------------------
# Where its picture is wrong, the functions here say what, by how much, and one thing that helps. A
# series that is cut off swings about the light, and where the light is dark beside a lamp it swings
# below zero, which a screen shows as black: how much of a map is so is looked at here, too.


_WRONG = "the reflected light is wrong by"
"""How all lines about the error of the light begin."""
Notes = tuple[tuple[str, str], ...]
"""Headings and texts that tell people what was chosen automatically."""


@record(eq=False)
class Prefiltered:
    """A map, and what is known of how it was made."""

    map: Map
    facts: dict[str, Any] = field(default_factory=dict)
    """Facts that the map's own `summary` does not have, by the names used in JSON. For maps that
    are made for a BRDF ``error_bound`` is among them: the conservative relative RMS error of eq.
    5.19, or None in the angular domain."""
    notes: Notes = ()
    warnings: tuple[str, ...] = ()
    """Lines that the user should know about the map."""
    further: Mapping[str, Callable[[], Any]] = field(default_factory=dict)
    """Facts that take a while to find, by functions that find them when somebody asks for the
    `summary`. For maps that are made for a BRDF ``predicted_wrong_share`` is here or among the
    facts: the share of what is visible whose luminance is wrong by more than `vocabulary.WRONG`, or
    None where it is not known."""

    def quick_summary(self) -> dict[str, Any]:
        """Return what the `summary` has but for the further facts, which take as long as a map."""
        return {**self.map.summary(), **self.facts, **self.map.info.origin()}

    def summary(self) -> dict[str, Any]:
        """Return the numbers that users and scripts ask for, by the names used in JSON."""
        found = {name: find() for name, find in self.further.items()}
        return {**self.map.summary(), **self.facts, **found, **self.map.info.origin()}


def wrong_light(error: float, why: str, remedy: str) -> str:
    """Return the line about a map whose relative RMS error is seen."""
    return f"{_WRONG} {error:.1%} (RMS), {why}; {remedy}"


def unkept_error(asked: float, error: float, max_size: int, remedy: str) -> str:
    """Return the line about the best map within some bytes, which misses the error asked for."""
    within = f"over `error` {asked:g}, in the best map of {bytes_text(max_size)} before packing"
    return wrong_light(error, within, remedy)


def is_wrong_unsaid(lines: Sequence[str], share: float, error: float, asked: float | None) -> bool:
    """Tell whether warnings leave out that a picture is wrong whose form or error was named.

    `share` is the share of wrong pixels, and `error` the relative RMS error, of which `asked` is
    what may be made, if it is asked for.
    """
    is_dull = asked is None and error > DEFAULT_ERROR and not any(map(_is_of_light, lines))
    return share > DEFAULT_SEEN or is_dull


def _is_of_light(line: str) -> bool:
    return line.startswith(_WRONG)


def with_wrong_share(
    lines: Sequence[str], share: float, error: float, instead: str | None = None
) -> list[str]:
    """Add to the warnings of an SHRM which part of the picture is wrong.

    Whoever asks for an SHRM gets one, but not in silence. One line says it: that about the light's
    error is left out.

    `share` is the share of what is visible that is predicted to be wrong by more than
    `vocabulary.WRONG`. `instead` is what ``auto`` would make, where that is known.
    """
    chosen = "chooses the form that it needs" if instead is None else f"would make {instead}"
    said = (
        f"{percent(share)}% of the picture is predicted to be wrong by more than 5 %, its light by "
        f"{error:.1%} (RMS); `to` auto, without `eps`, `error` or orders, {chosen}"
    )
    return [*(line for line in lines if not _is_of_light(line)), said]


def error_lines(result: dict[str, Any], added_by: str) -> list[str]:
    """Return lines about the orders, the energy and the errors of a map made for a BRDF.

    `result` is the object that `shrm prefilter --json` prints. `added_by` is what causes the added
    error of the map, in words.
    """
    captured, bound = result["brdf_energy_captured"], result["error_bound"]
    energy = f"{captured:.2%} captured"
    if "+" in result["center"]:
        energy = f"{captured:.2%} captured by the terms, whose error together is that of one map"
    if result["domain"] == "angular":
        energy = f"{captured:.2%} in the truncated lobe"
    at_most = "" if bound is None else f", {bound:.2%} at most"
    carried = result["order_carried"]
    further = f"; carried to {carried}" if carried > result["order_f"] else ""
    lines = [
        f"orders         F = {result['order_f']}, P = {result['order_p']}{further}",
        f"BRDF energy    {energy}",
        f"RMS error      {result['predicted_error']:.2%} of the reflected light predicted{at_most}",
    ]
    if result["added_error"] >= 5e-5:
        lines.append(f"and            {result['added_error']:.2%} from {added_by}")
    if result["filter_error"]:
        lines.append(
            f"and            {result['filter_error']:.2%} from bilinear look-ups, as on a GPU"
        )
    if result.get("lamp_error"):
        lines.append(f"and            {result['lamp_error']:.2%} from discs in the lamps' place")
    share = result["predicted_wrong_share"]
    if share is not None:
        lines.append(f"pixels         {share:.1%} predicted to be wrong by more than 5%")
    return lines
