"""Forms that are made to be known: split sums, SH exponentials, irradiance and Cabral's maps."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.models.ggx import Ggx
from shrm_cli.brdf.models.lambertian import Lambertian
from shrm_cli.choose.cost import (
    Cost,
    brushed_cost,
    cabral_cost,
    exponential_cost,
    irradiance_cost,
    split_sum_cost,
)
from shrm_cli.choose.offer import Offer
from shrm_cli.choose.truth import Truth
from shrm_cli.maps.base import Map, ReflectedLight
from shrm_cli.maps.kinds import LightMap
from shrm_cli.maps.options import counted
from shrm_cli.maps.size import stored_bytes, total_error
from shrm_cli.prefilter import prefilter_with_facts
from shrm_cli.probe.probe import Probe
from shrm_cli.progress import Progress
from shrm_cli.records import record
from shrm_cli.vocabulary import TAP_COUNTS

_ORDERS = 2, 4, 8
"""The orders of irradiance that are offered: nine coefficients, 25 and 81."""
_LEVELS = 16, 32, 64, None
"""The sizes of split sums of a single level that are offered; None is their own."""
_CABRAL = 2 * 10**6
"""The most bytes of Cabral's maps. Twelve views miss so much of what is glossy that more texels
help nothing: 27 % in a studio at a roughness of .3 with 24 texels along an edge as with 96."""
_FLOATS = 12
"""The bytes of three 32-bit floats."""


@record
class Wanted:
    """A map of another form.

    Attributes
    ----------
    arguments : dict
        Those of `shrm_cli.prefilter.prefilter`, without the BRDF.
    needs_brdf : bool
    taps : {3, 5, 8}, optional
        How many look-ups a split sum of brushed GGX takes.
    """

    arguments: Mapping[str, Any]
    needs_brdf: bool = False
    taps: int | None = None


def others_of(brdf: Brdf) -> list[Wanted]:
    """Return the maps of other forms that can hold a material."""
    found = []
    if isinstance(brdf, Lambertian):
        found += [Wanted({"to": "irradiance", "order_f": order}) for order in _ORDERS]
    if isinstance(brdf, Ggx) and brdf.surface is not None:
        own, _ = brdf.surface
        found.append(Wanted({"to": "splitsum"}))
        for size in _LEVELS:
            given = {} if size is None else {"size": size}
            found.append(Wanted({"to": "splitsum", "levels": (own,), **given}))
        found.append(Wanted({"to": "she", "roughness": (own, own)}))
    if isinstance(brdf, Ggx) and not brdf.isotropic and brdf.brushed_surface is not None:
        found += [Wanted({"to": "splitsum"}, taps=taps) for taps in TAP_COUNTS]
    if brdf.isotropic:
        found.append(Wanted({"to": "cabral", "max_size": _CABRAL}, needs_brdf=True))
    return found


def made_offer(
    wanted: Wanted, probe: Probe, brdf: Brdf, truth: Truth, progress: Progress | None = None
) -> Offer:
    """Make a map, and measure it.

    Raises
    ------
    ShrmError
        If it cannot be made.
    """
    arguments = dict(wanted.arguments)
    form = arguments.pop("to")

    def make(progress: Progress | None = None) -> Map:
        given = {**arguments, **({"brdf": brdf} if wanted.needs_brdf else {})}
        return prefilter_with_facts(probe, form, given, progress).map

    made = make(progress)
    shown: ReflectedLight = made.shaded()
    scale = np.ones(3)
    if wanted.taps is not None:
        shown = _brushed(made, brdf, wanted.taps)
    elif isinstance(made, LightMap):
        shown = made.shaded(brdf.number("roughness"), brdf.color("f0"))
    elif form == "irradiance":
        scale = np.array(brdf.color("albedo"))
    error, share = truth.errors(shown, scale)
    what, stored, cost = _described(made, brdf, wanted.taps)
    measured: tuple[str, ...] = ("error", "wrong_share")
    if not isinstance(made, LightMap):
        info = made.info
        missing = float(np.hypot(info.predicted_error, info.added_error))
        error, measured = total_error(missing, info.filter_error), ("wrong_share",)
    return Offer(
        form, what, stored, error, share, measured, cost.look_ups, cost.multiply_adds,
        wanted.arguments, make,
    )  # fmt: skip


def _brushed(made: Map, brdf: Any, taps: int) -> ReflectedLight:
    """Return a split sum as brushed GGX shows it."""
    roughness, anisotropy, f0 = brdf.brushed_surface
    return made.shaded(roughness, f0, anisotropy, taps)


def _described(made: Any, brdf: Brdf, taps: int | None) -> tuple[str, int, Cost]:
    """Return a map in words, the bytes that its shader reads, and what that takes."""
    if made.representation == "irradiance":
        count = len(made.coefficients)
        return f"order {made.order_f}", _FLOATS * count, irradiance_cost(made.order_f)
    if made.representation == "she":
        count = len(made.p_coefficients) + len(made.q_coefficients)
        cost = exponential_cost(made.order_p, made.order_q, len(set(brdf.color("f0"))) == 1)
        return f"orders {made.order_p} and {made.order_q}", _FLOATS * count, cost
    planes = made.planes()
    stored = sum(stored_bytes(each.shape[1], 1) for each in planes)
    what = f"{counted(len(planes), 'cube')} of {made.size}"
    if made.representation == "splitsum":
        levels = counted(len(planes), "level")
        if taps is not None:
            return f"{levels} of {made.size}, {taps} taps", stored, brushed_cost(taps)
        return f"{levels} of {made.size}", stored, split_sum_cost()
    return what, stored, cabral_cost(made.center)
