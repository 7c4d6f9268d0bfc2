"""How SHRMs are made for a request: as one map or term by term, and from other maps.

The method is that of section 5.6.2 of Ramamoorthi's thesis.
"""

import math
from dataclasses import replace
from typing import Any

import numpy as np

from shrm_cli.brdf.sums import split as split_terms
from shrm_cli.errors import ArgumentError
from shrm_cli.maps.base import Map
from shrm_cli.maps.options import counted
from shrm_cli.maps.request import Prefiltered, Request, error_lines, unkept_error
from shrm_cli.maps.shrm import make
from shrm_cli.maps.size import converted_bytes, most_cubes, total_error
from shrm_cli.messages import refuse_arguments
from shrm_cli.probe.lighting import Projection
from shrm_cli.probe.probe import Probe
from shrm_cli.vocabulary import Frame


def prefilter(probe: Probe, request: Request) -> Prefiltered:
    """Prefilter a probe for a BRDF."""
    if request.seen is not None and (request.frame != "global" or "compress" in request.own):
        name = "compress" if request.frame == "global" else "frame"
        raise ArgumentError(name, "does not apply with `seen`")
    request, notes = make.centered(request)
    # Each term of a sum has a center of its own, and orders that are chosen from the tolerance, so
    # that neither can be given.
    is_whole = not request.is_free or request.center is not None
    brdf, split = request.brdf, request.own.get("split")
    if split and is_whole:
        raise ArgumentError(
            "split", "applies with neither `center` nor orders; leave one of them out"
        )
    if split and len(split_terms(brdf)) == 1:
        raise ArgumentError(
            "split",
            f"applies to sums, and to BRDFs with a diffuse part; {brdf!r} has a single term",
        )
    light = Projection(probe)
    if request.seen is not None:
        # Only maps that are judged by what is seen need these modules.
        from shrm_cli.maps.seen import kept_or_best
        from shrm_cli.maps.shrm.proposals import ShrmProposals
        from shrm_cli.maps.wrong_pixels import truth_of
        from shrm_cli.plan.search import Goal, rising

        goal, allowed = Goal.of(request.error, request.seen), request.allowed
        candidates = rising(ShrmProposals.known(light, request, goal.error), goal, allowed)
        truth = truth_of(probe, brdf)
        made = kept_or_best(candidates, goal, allowed, truth=truth, size=request.size)
        return replace(made, notes=notes)
    if request.error is not None:
        return replace(_within_error(light, request, request.error), notes=notes)
    unsplit: tuple[str, ...] = ()
    chosen = None
    if not is_whole and split is not False and len(split_terms(brdf)) > 1:
        from shrm_cli.maps.shrm.terms import plan_terms, prefilter_terms

        chosen = make.affordable(light, request)
        plan = plan_terms(light, request, chosen)
        if plan is not None:
            takes = split or plan.pays
            as_terms, as_one = plan.counts
            count = f"{as_terms:,} coefficients as terms, {as_one:,} as one map"
            if plan.is_closer:
                count += " of more error"
            notes = (*notes, ("split" if takes else "not split", count))
            if takes:
                return replace(prefilter_terms(plan), notes=notes)
        elif split:
            unsplit = (f"{brdf!r} is not split: its terms cannot keep the error of the whole",)
    made = make.prefilter_shrm(light, request, chosen)
    warnings = (*unsplit, *make.order_warnings(made, request), *made.warnings)
    return replace(made, notes=notes, warnings=warnings)


def _within_error(light: Projection, request: Request, error: float) -> Prefiltered:
    """Make the SHRM of the fewest bytes that keeps an error, or the best one."""
    # Plain runs search nothing.
    from shrm_cli.maps.shrm.proposals import ShrmProposals, sufficient_tolerance

    shrms = ShrmProposals.known(light, request, error, sufficient_tolerance(error))
    found, is_met = shrms.least(error)
    made = shrms.made(found, np.float32)
    if is_met:
        return made
    info = made.map.info
    total = total_error(info.predicted_error, info.filter_error)
    line = unkept_error(error, total, request.allowed, "take `to` auto")
    return replace(made, warnings=(*made.warnings, line))


def converted(
    source: Map,
    to: str,
    order_p: int | None = None,
    frame: Frame | None = None,
    compress: int | float | None = None,
    max_size: int | None = None,
    **options: Any,
) -> Map:
    """Return the SHRM that another map holds or that fits it best, compressed if that is asked.

    `order_p` is that of the source by default, or the largest one of at most `max_size` bytes,
    before it is compressed. `frame` is local by default if the source is a local SHRM, else global.
    `compress` is as `shrm_cli.maps.shrm.shrm.compressed` takes it.
    """
    from shrm_cli.maps.shrm.shrm import compressed  # most maps are not

    refuse_arguments("an SHRM", **options)
    is_local = source.representation == to and source.frame == "local"
    own: Frame = "local" if is_local else "global"
    found = source.to_shrm(order_p, frame or own)
    most = converted_bytes(source.size, source.cube_count, max_size)
    cubes = max(most_cubes(found.size, most), 1)
    if order_p is None and found.cube_count > cubes:
        found = source.to_shrm(math.isqrt(cubes) - 1, frame or own)
    make.refuse_large(found.size, found.cube_count, max_size)
    return compressed(found, compress)


def report(result: dict[str, Any]) -> list[str]:
    """Return the lines for people about an SHRM, from what ``--json`` prints."""
    size, maps = result["size"], result["maps"]
    unit = "component" if "components" in result else "coefficient"
    what = f"{result['frame']} SHRM, 6 x {size} x {size} texels of {counted(maps, unit)}"
    return [what, *error_lines(result, "leaving out principal components")]
