"""What is asked of a map: the arguments of prefiltering, checked and resolved once.

The makers of maps take a `Request`, files record it, and batches compare their outputs with it.
"""

from collections.abc import Iterable, Mapping
from dataclasses import field
from types import MappingProxyType
from typing import Any, Self, cast

from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.library import foreign_modules
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.errors import ArgumentError
from shrm_cli.maps import registry
from shrm_cli.maps.info import record_of
from shrm_cli.maps.options import SHARED, Representation, listing, owners
from shrm_cli.maps.size import stored_bytes
from shrm_cli.probe.probe import Probe
from shrm_cli.records import record
from shrm_cli.sources import package_digest
from shrm_cli.vocabulary import (
    AUTO,
    DEFAULT_EPS,
    DEFAULT_MAX_SIZE,
    EXPANDED,
    Domain,
    Frame,
    Sampling,
)


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

        `to` is the representation, or ``auto``. `given` are the arguments of
        `shrm_cli.prefilter.prefilter` by name. One that is None counts as not given. `probe` is the
        light, in whose primaries the colours of the BRDF are taken.

        Raises ArgumentError or BrdfError if an argument does not apply, or has a value that it
        cannot have.
        """
        to = resolved_form(to, given)
        named = {name: value for name, value in given.items() if value is not None}
        check_arguments(to, named)
        brdf = _material(named.pop("brdf"), probe) if "brdf" in named else None
        named = checked_options(to, named)
        values = {**registry.description(to).defaults, **named}
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
    unasked: set[str] = set()
    if {"error", "seen"} & set(given):
        unasked = {"eps"}.union(*form.steps)
    defaults = form.defaults
    return _listed({name: value for name, value in defaults.items() if name not in unasked})


def _listed(values: Mapping[str, Any]) -> dict[str, Any]:
    return {
        name: list(value) if isinstance(value, tuple) else value for name, value in values.items()
    }


def resolved_form(to: str, given: Mapping[str, Any]) -> str:
    """Return the representation that is asked for: with arguments of SHRMs, ``auto`` is one.

    `to` is the representation, or ``auto``. `given` are the arguments of
    `shrm_cli.prefilter.prefilter` by name. One that is None counts as not given.
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
    options = {**SHARED, **{each.name: each for each in registry.description(to).options}}
    return {name: options[name].checked(value) for name, value in given.items()}


def check_arguments(to: str, given: Iterable[str]) -> None:
    """Check that a representation is known, obeys all given arguments, and has all that it needs.

    `given` holds names of the arguments of `shrm_cli.prefilter.prefilter` that are given.
    """
    chosen, given = registry.description(to), set(given)
    known = registry.descriptions(to)
    for name in sorted(given - chosen.arguments):
        raise _not_for(name, chosen, known)
    if chosen.needs_brdf and "brdf" not in given:
        raise ArgumentError("brdf", f"is missing; `to` {to} needs one")


def _material(brdf: object, probe: Probe) -> Brdf:
    """Return a BRDF from itself or from its specification, with the probe's primaries."""
    if isinstance(brdf, str):
        return parse_spec(brdf, primaries=probe.chromaticities)
    if not isinstance(brdf, Brdf):
        raise ArgumentError("brdf", f"{brdf!r} is neither a BRDF nor the specification of one")
    return brdf


def _not_for(
    name: str, chosen: Representation, known: Mapping[str, Representation]
) -> ArgumentError:
    """Return the error that refuses an argument which a representation does not obey."""
    of = owners(known, name)
    if not of:
        return ArgumentError(name, "is no argument of prefilter")
    why = f"; {chosen.why_no_brdf}" if name == "brdf" else ""
    return ArgumentError(name, f"applies with `to` {listing(of, 'or')}{why}")
