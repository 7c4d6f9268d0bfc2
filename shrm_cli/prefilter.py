"""Prefiltering: from a probe, a BRDF and options to a map. The command and the library call this.

`shrm_cli.maps.request` says what the arguments mean, and which representation they apply to.
"""

import warnings
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from shrm_cli.brdf.spec import AnyBrdf
from shrm_cli.errors import ShrmWarning
from shrm_cli.maps import registry
from shrm_cli.maps.base import DISCS, REMEDY, Map
from shrm_cli.maps.request import Prefiltered, Request
from shrm_cli.probe.open import AnyProbe, as_probe
from shrm_cli.probe.probe import Probe
from shrm_cli.progress import Progress, Rising, using
from shrm_cli.vocabulary import AUTO, Domain, Frame, Sampling

if TYPE_CHECKING:
    from shrm_cli.lights.beside import Beside


def prefilter(
    probe: AnyProbe,
    brdf: AnyBrdf | None = None,
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
    sun: str | None = None,
    progress: Progress | None = None,
    **own: Any,
) -> Map:
    """Prefilter a light probe.

    Parameters
    ----------
    probe : Probe, path-like or array
        The light. A path is opened with the defaults of `open_probe`, and an array is read as
        `Probe.from_array` reads it.
    brdf : Brdf, str or path-like, optional
        A BRDF, or its specification, such as ``"ggx:roughness=0.4"`` or the path of a measured
        file. Irradiance and SH exponentials are made without one, and a split sum is of GGX
        without one.
    to : str
        The representation: one of ``shrm``, ``cabral``, ``kautz-mccool``, ``lightfield``,
        ``principal``, ``irradiance``, ``splitsum`` and ``she``, or that of an installed package; or
        ``auto``, the default: the form of the fewest bytes whose picture is right. With arguments
        that only SHRMs obey, such as `eps`, orders or `frame`, that is an SHRM.
    eps : float, optional
        The fraction of the BRDF's energy that may be missed, in (0, 1), by default
        `vocabulary.DEFAULT_EPS`. The orders F and P are chosen from it; of ``principal``, the
        bytes, of which the best map is made. Without it, ``principal`` keeps what ``auto`` does.
    error : float, optional
        The relative RMS error of the reflected light of this probe that the map may have, with
        bilinear look-ups and half precision, in (0, 1). The map of the fewest bytes is made that
        keeps it, instead of `eps`; of forms other than ``auto``, ``shrm`` and ``principal`` the
        first of a few settings. Of ``splitsum`` it is the error of each level.
    seen : float, optional
        The share of what is visible that may be wrong by more than 5 %, as it is predicted, in
        (0, 1), with `error` or without. For forms that are made for a BRDF.
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
        Texels along a face's edge; chosen from F by default. With it and `eps`, ``principal``
        takes the fewest functions that keep this.
    sampling : {"center", "border"}, optional
        Where the edge texels of the map lie; ``center`` by default.
    max_size : int or str, optional
        The most bytes that the cubes of a map for a BRDF take in half precision, as a number or
        as text such as ``"32MB"``; `vocabulary.DEFAULT_MAX_SIZE` by default. Where they are too
        few for the orders that `eps` asks for, the best map within them is made.
    sun : {"split", "keep"}, optional
        Take the lamps out of the light as `shrm_cli.lights.split.split_lamps` does, and make the
        map of what is left. They are kept beside it as discs, whose reflection `radiance` adds.
        What is asked of the map is asked of what is left, but an error with `seen`, or by default
        of ``auto`` and ``principal``, of all light. The errors that it states are relative to all
        of the reflected light. ``keep`` leaves them in the map. By default ``auto`` takes them out
        where no map keeps what is asked otherwise, and other forms keep them.
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

    Examples
    --------
    >>> made = shrm.prefilter("probes/studio.exr", "phong:exponent=8", eps=0.1)
    >>> made.representation, made.info.order_f, made.info.order_p
    ('shrm', 4, 0)
    """
    given = {
        "brdf": brdf, "eps": eps, "error": error, "seen": seen, "order_f": order_f,
        "order_p": order_p, "center": center, "domain": domain, "source_height": source_height,
        "frame": frame, "size": size, "sampling": sampling, "max_size": max_size, "sun": sun, **own,
    }  # fmt: skip
    light = as_probe(probe)
    found = prefilter_with_facts(light, to, given, progress)
    for line in (*light.report.warnings(), *found.warnings):
        warnings.warn(line, ShrmWarning, stacklevel=2)
    return found.map


def prefilter_with_facts(
    probe: Probe, to: str, given: Mapping[str, Any], progress: Progress | None = None
) -> Prefiltered:
    """Prefilter a light probe, and keep all that is known of how the map was made, for reports.

    `given` holds the other arguments of `prefilter` by name. An argument that is None counts as not
    given.
    """
    return make(probe, Request.of(to, given, probe), progress)


def make(probe: Probe, request: Request, progress: Progress | None = None) -> Prefiltered:
    """Make the map that a request asks for; see `prefilter_with_facts`."""
    needs_brdf = registry.description(request.to).needs_brdf
    if request.to == AUTO:  # several forms may be tried, and lamps be looked for
        from shrm_cli.probe.shared import shared

        probe = shared(probe)
    # Maps for a BRDF take one attempt after another at its coefficients.
    is_rising = needs_brdf and (request.domain != "angular" or request.splits)
    work = Rising(progress) if is_rising else progress
    with using(work):
        light, lamps = _split(probe, request)
        if lamps is None:
            found = _make(_fine(light, request), request)
        else:
            from shrm_cli.maps.wrong_pixels import beside_lamps

            asked = request if request.seen is None else lamps.asked(request)
            with beside_lamps(lamps.lamps):
                found = _make(_fine(light, request), asked)
        info = replace(found.map.info, options=request.record(probe))
        found = replace(found, map=found.map.with_info(info))
        if needs_brdf:  # maps of light alone have words of their own for what is negative
            if lamps is not None:
                from shrm_cli.lights.beside import with_lamps

                found = with_lamps(found, lamps)
            # Maps of light alone are not looked at.
            from shrm_cli.maps.wrong_pixels import examined, truth_of

            found = examined(found, truth_of(probe, request.brdf))
            found = _advised(found, probe, request)
    if isinstance(work, Rising):
        work.end()
    return found


def _split(probe: Probe, request: Request) -> tuple[Probe, "Beside | None"]:
    """Return the light that the map is made of, and the lamps if they are to be beside it."""
    if not request.splits or request.to == AUTO:  # which does it by itself
        return probe, None
    from shrm_cli.lights.beside import ANY, splits_for
    from shrm_cli.plan.search import Goal

    # Maps of the angular domain are made of pixels.
    goal = ANY if request.domain == "angular" else Goal.of(request.error, request.seen)
    found = next(splits_for(probe, request.brdf, goal))
    return found.rest, found


def _fine(probe: Probe, request: Request) -> Probe:
    """Return light whose pixels are small, where cubes show it.

    Forms without cubes hold few degrees of the light, of which the middles of pixels tell enough.
    """
    if request.to == AUTO:  # it looks at lamps of the probe as it is, and cuts pixels by itself
        return probe
    described = registry.description(request.to)
    has_cubes = described.needs_brdf and "size" in described.takes
    if not probe.may_be_coarse or request.domain == "angular" or not has_cubes:
        return probe
    from shrm_cli.probe.coarse import fine_probe  # which most runs do not need

    return fine_probe(probe)


def _advised(made: Prefiltered, probe: Probe, request: Request) -> Prefiltered:
    """Say in warnings about lamps where it would help to put these beside the map."""
    untold = [line for line in made.warnings if REMEDY in line and DISCS not in line]
    if request.splits or not untold:
        return made
    from shrm_cli.lights.beside import MUCH, lamps_share
    from shrm_cli.maps.lamps.lobe import bytes_of_table

    brdf = request.brdf
    if brdf.center == "tangent" or lamps_share(probe) <= MUCH:
        return made
    table = bytes_of_table(brdf)
    fits = table is not None and table <= request.allowed
    is_better = any(DISCS in line for line in made.warnings)
    if request.to == AUTO and request.sun is None and fits and not is_better:  # that was tried
        better = f"discs in their place (`sun` split) miss as much; {REMEDY}"
    else:
        better = f"{DISCS}, or {REMEDY}"
    told = [line.replace(REMEDY, better) if line in untold else line for line in made.warnings]
    return replace(made, warnings=tuple(told))


def _make(probe: Probe, request: Request) -> Prefiltered:
    """Make a map, or the first of several that keeps the error that is asked for."""
    asks = request.error is not None or request.seen is not None
    if not (asks and registry.description(request.to).steps):
        return _maker(request.to)(probe, request)
    # Runs that ask for no error are spared the search.
    from shrm_cli.maps.seen import first_that_keeps

    return first_that_keeps(_maker(request.to), probe, request)


def _maker(to: str) -> Callable[[Probe, Request], Prefiltered]:
    """Return the function that makes the maps of a representation, or of the best one."""
    if to == AUTO:
        from shrm_cli.automatic import prefilter as choose

        return choose
    return registry.module(to, "prefilter").prefilter
