"""Prefiltering: from a probe, a BRDF and options to a map. The command and the library call this.

The meaning and the default of every option, and the representations that it applies to, are
decided here and in the folders of the representations, and nowhere else.
"""

import inspect
import warnings
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import Any

from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.errors import ArgumentError, ShrmWarning
from shrm_cli.maps import registry
from shrm_cli.maps.base import Map
from shrm_cli.maps.negative import examined
from shrm_cli.maps.options import DEFAULTS, SHARED, Representation, listing, owners
from shrm_cli.maps.prefiltered import Prefiltered
from shrm_cli.probe.probe import AnyProbe, Probe, as_probe
from shrm_cli.progress import Progress, Rising
from shrm_cli.vocabulary import AUTO, REPRESENTATIONS, Domain, Frame, Sampling


def prefilter(
    probe: AnyProbe,
    brdf: Brdf | str | None = None,
    *,
    to: str = AUTO,
    eps: float | None = None,
    error: float | None = None,
    seen: float | None = None,
    order_f: int | None = None,
    order_p: int | None = None,
    center: str | None = None,
    domain: Domain | None = None,
    source_height: int | None = None,
    frame: Frame | None = None,
    size: int | None = None,
    sampling: Sampling | None = None,
    max_size: int | str | None = None,
    progress: Progress | None = None,
    **own: Any,
) -> Map:
    """Prefilter a light probe.

    Parameters
    ----------
    probe : Probe, path-like or array
        The light. A path is opened with the defaults of `open_probe`, and an array is read as
        `Probe.from_array` reads it.
    brdf : Brdf or str, optional
        A BRDF, or its specification, such as ``"ggx:roughness=0.4"`` or the path of a measured
        file. Irradiance and SH exponentials are made without one, and a split sum is of GGX
        without one.
    to : str
        The representation: one of ``shrm``, ``cabral``, ``kautz-mccool``, ``lightfield``,
        ``principal``, ``irradiance``, ``splitsum`` and ``she``; or ``auto``, the default: the form
        of the fewest bytes whose picture is right. With arguments that only SHRMs obey, such as
        `eps`, orders or `frame`, that is an SHRM.
    eps : float, optional
        The fraction of the BRDF's energy that may be missed, in (0, 1), by default
        `vocabulary.DEFAULT_EPS`. The orders F and P are chosen from it; of ``principal``, the
        bytes, of which the best map is made.
    error : float, optional
        The relative RMS error of the reflected light of this probe that the map may have, with
        bilinear look-ups and half precision, in (0, 1). The map of the fewest bytes is made that
        keeps it. For ``auto``, ``shrm`` and ``principal``, instead of `eps`.
    seen : float, optional
        The share of what is visible that may be wrong by more than 5 %, as it is predicted, in
        (0, 1). For ``auto``, ``shrm`` and ``principal``, with `error` or without.
    order_f, order_p : int, optional
        Orders to use instead of the chosen ones. With `order_f` nothing is carried beyond it.
    center : {"auto", "reflection", "normal", "tangent"}, optional
        The central direction of the map, which is the BRDF's own by default. ``auto`` takes the
        direction that needs the fewest coefficients. For ``principal`` both are the direction
        about which the lobes gather, which is the normal for rough surfaces and cloth.
    domain : {"frequency", "angular"}, optional
        The domain in which explicit maps are made, ``frequency`` by default.
    source_height : int, optional
        The number of rows that the probe is averaged down to first, in the angular domain only.
    frame : {"global", "local"}, optional
        The axes of the view in an SHRM: those of the world (the default), or those of each
        texel's direction.
    size : int, optional
        Texels along a face's edge; chosen from F by default. With it ``principal`` takes the
        fewest functions that keep `eps`.
    sampling : {"center", "border"}, optional
        Where the edge texels of the map lie; ``center`` by default.
    max_size : int or str, optional
        The most bytes that the cubes of a map for a BRDF take in half precision, as a number or
        as text such as ``"32MB"``; `vocabulary.DEFAULT_MAX_SIZE` by default. Where they are too
        few for the orders that `eps` asks for, the best map within them is made.
    progress : callable, optional
        Called with the amount of work done and the amount in all. What is done never falls.
    **own
        Arguments that belong to single representations: ``split`` (bool) and ``compress`` (a
        number of components, or the error that may be added) of ``shrm``; ``slices`` of
        ``kautz-mccool``; ``views`` of ``lightfield``; ``maps`` (a number of cubes) and ``divide``
        (bool, by the directional albedo) of ``principal``; ``window`` of ``irradiance``;
        ``levels`` (a number, or the roughness of each) and ``mapping`` of ``splitsum``;
        ``p_order``, ``q_order``, ``roughness`` (two numbers) and ``law`` of ``she``.

    Returns
    -------
    Map

    Warns
    -----
    ShrmWarning
        For each remark about the probe or the map that the user should know.

    Raises
    ------
    ArgumentError
        If an argument does not apply, or has a value that it cannot have.
    BrdfError, ProbeError, OrderError, MapError
        If the BRDF or the probe cannot be used, the tolerance cannot be met, or the map would be
        too large.
    """
    given = {
        "brdf": brdf, "eps": eps, "error": error, "seen": seen, "order_f": order_f,
        "order_p": order_p, "center": center, "domain": domain, "source_height": source_height,
        "frame": frame, "size": size, "sampling": sampling, "max_size": max_size, **own,
    }  # fmt: skip
    light = as_probe(probe)
    made = prefilter_with_facts(light, to, given, progress)
    for line in (*light.report.warnings(), *made.warnings):
        warnings.warn(line, ShrmWarning, stacklevel=2)
    return made.map


def prefilter_with_facts(
    probe: Probe, to: str, given: Mapping[str, Any], progress: Progress | None = None
) -> Prefiltered:
    """Prefilter a light probe, and keep all that is known of how the map was made, for reports.

    Parameters
    ----------
    probe : Probe
    to : str
        The representation.
    given : mapping of str to value
        The other arguments of `prefilter` by name. An argument that is None counts as not given.
    progress : callable, optional
        Called with the amount of work done and the amount in all.

    Raises
    ------
    ArgumentError, BrdfError, ProbeError, OrderError, MapError
        For the same reasons as `prefilter`.
    """
    to = resolved_form(to, given)
    given = checked_arguments(to, given, probe)
    make = _maker(to)
    # Maps for a BRDF take one attempt after another at its coefficients.
    is_rising = registry.description(to).needs_brdf and given.get("domain") != "angular"
    work = Rising(progress) if progress is not None and is_rising else progress
    several = to != AUTO and len(registry.module(to, "options").DESCRIPTIONS) > 1
    made: Prefiltered = make(probe, **({"to": to} if several else {}), **given, progress=work)
    if isinstance(work, Rising):
        work.end()
    # Maps of light alone have words of their own for what is negative, or cannot be.
    made = examined(made) if registry.description(to).needs_brdf else made
    info = replace(made.map.info, options=options_of(probe, to, given))
    return replace(made, map=replace(made.map, info=info))  # type: ignore[type-var]


def resolved_form(to: str, given: Mapping[str, Any]) -> str:
    """Return the representation that is asked for: with arguments of SHRMs, ``auto`` is one.

    Parameters
    ----------
    to : str
        The representation, or ``auto``.
    given : mapping of str to value
        The arguments of `prefilter` by name. One that is None counts as not given.
    """
    named = {name for name, value in given.items() if value is not None}
    return "shrm" if to == AUTO and named - registry.description(AUTO).arguments else to


def _maker(to: str) -> Callable[..., Prefiltered]:
    """Return the function that makes the maps of a representation, or of the best one."""
    if to == AUTO:
        from shrm_cli.automatic import prefilter as choose

        return choose
    make: Callable[..., Prefiltered] = registry.module(to, "prefilter").prefilter
    return make


def checked_arguments(to: str, given: Mapping[str, Any], probe: Probe) -> dict[str, Any]:
    """Return the arguments that are given as the makers of maps take them, with a BRDF for its
    specification.

    Raises
    ------
    ArgumentError, BrdfError
        If an argument does not apply, or has a value that it cannot have.
    """
    given = {name: value for name, value in given.items() if value is not None}
    check_arguments(to, given)
    brdf = {name: _material(given.pop(name), probe) for name in ("brdf",) if name in given}
    return brdf | checked_options(to, given)


def checked_options(to: str, given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the arguments but for the BRDF as the makers of maps take them.

    Raises
    ------
    ArgumentError
        If one has a value that it cannot have.
    """
    options = {**SHARED, **{each.name: each for each in registry.description(to).options}}
    return {name: options[name].checked(value) for name, value in given.items()}


def options_of(probe: Probe, to: str, given: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a map records of the options that it is made with.

    Parameters
    ----------
    probe : Probe
    to : str
        The representation.
    given : mapping of str to value
        The arguments of `prefilter` by name. One that is None counts as not given, and has its
        default; the BRDF has a record of its own.

    Returns
    -------
    dict
        Values as JSON has them, and under ``reading`` how the probe was read.
    """
    named = {
        name: list(value) if isinstance(value, tuple) else value
        for name, value in given.items()
        if value is not None and name != "brdf"
    }
    automatic: dict[str, Any] = {}
    if to == AUTO:
        from shrm_cli.plan.search import Goal

        goal = Goal.of(given.get("error"), given.get("seen"))
        automatic = {"to": AUTO, "error": goal.error, "seen": goal.wrong_share}
    return {**automatic, **default_options(to, named), **named, "reading": probe.reading()}


def default_options(to: str, named: Mapping[str, Any]) -> dict[str, Any]:
    """Return the defaults of the arguments that a representation obeys, as a map records them.

    Those that follow from the light and the BRDF are no values yet, and are left out.

    Parameters
    ----------
    to : str
        The representation.
    named : mapping of str to value
        The arguments that are given. An error is asked for instead of a tolerance.
    """
    unasked = {"eps"} if {"error", "seen"} & named.keys() else set()
    obeyed = registry.description(to).arguments - unasked
    own = inspect.signature(_maker(to)).parameters
    found = {name: each.default for name, each in own.items()} | DEFAULTS
    return {
        name: list(value) if isinstance(value, tuple) else value
        for name, value in found.items()
        if name in obeyed and value is not None and value is not inspect.Parameter.empty
    }


def check_arguments(to: str, given: Iterable[str]) -> None:
    """Check that a representation is known, obeys all given arguments, and has all that it needs.

    Parameters
    ----------
    to : str
        The representation.
    given : iterable of str
        Names of the arguments of `prefilter` that are given.

    Raises
    ------
    ArgumentError
        If the representation is unknown, does not obey an argument, or lacks a BRDF.
    """
    if to not in (AUTO, *REPRESENTATIONS):
        raise ArgumentError("to", f"{to!r} is none of {', '.join(REPRESENTATIONS)}")
    known = registry.descriptions()
    chosen, given = registry.description(to), set(given)
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
