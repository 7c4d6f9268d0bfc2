"""Forms that are made to be known, and the light itself, for what no error is predicted of.

Forms that are made to be known: split sums, SH exponentials, irradiance and Cabral's maps.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.lobe_expansion import lobe_width
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
from shrm_cli.maps.base import Map, ReflectedLight
from shrm_cli.maps.kinds import LightMap
from shrm_cli.maps.options import counted
from shrm_cli.maps.prefiltered import visible_pairs
from shrm_cli.maps.size import stored_bytes, total_error
from shrm_cli.prefilter import prefilter_with_facts
from shrm_cli.probe.probe import Probe
from shrm_cli.progress import Progress
from shrm_cli.records import record
from shrm_cli.reference import Reference
from shrm_cli.render.seen import seen_errors
from shrm_cli.render.sphere import Reflecting
from shrm_cli.sphere.directions import bisector
from shrm_cli.vocabulary import TAP_COUNTS

_POINTS = 400
"""The pairs of a mirror direction and a view. A share of 5 % is known to 1.1 % of all by them."""
_ROWS_OF_LOBE = 24.0
"""Rows of the probe for the truth times the width of the lobe, as `shrm compare` takes them."""
_ROWS = 64, 256
"""The fewest and the most rows. More would take longer than the maps that are measured."""


class Truth:
    """The light that a BRDF reflects of a probe, spread evenly over the pixels of spheres.

    Parameters
    ----------
    progress : callable, optional
        Called with the number of points done, and of points in all.
    """

    def __init__(self, probe: Probe, brdf: Brdf, progress: Progress | None = None) -> None:
        self._probe, self._brdf, self._progress = probe, brdf, progress
        mirrored, self._views = visible_pairs(_POINTS)
        self._normals = bisector(mirrored, self._views)

    @cached_property
    def _radiance(self) -> Array:
        rows = int(np.clip(np.ceil(_ROWS_OF_LOBE / lobe_width(self._brdf)), *_ROWS))
        height = rows if self._probe.grid.latlong_rows > rows else None
        truth = Reference(self._probe, self._brdf, height, progress=self._progress)
        return truth.radiance(self._normals, self._views)

    def errors(self, shown: Reflecting, scale: ArrayLike = 1.0) -> tuple[float, float]:
        """Measure a map.

        Parameters
        ----------
        scale : array_like, shape (3,)
            What its light is multiplied with.

        Returns
        -------
        error : float
            The relative RMS error; 0 where nothing is reflected and nothing shown.
        wrong_share : float
            The share of points whose luminance is wrong by more than 5 %.
        """
        found = shown.radiance(self._normals, self._views) * np.asarray(scale)
        truth = self._radiance
        missed, whole = np.linalg.norm(found - truth), np.linalg.norm(truth)
        error = missed / whole if whole > 0 else np.inf if missed > 0 else 0.0
        return float(error), seen_errors(found, truth).wrong_share


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
    taps : tuple of {3, 5, 8}, optional
        How many look-ups a split sum of brushed GGX takes: each number is an offer of its own.
    """

    arguments: Mapping[str, Any]
    needs_brdf: bool = False
    taps: Sequence[int] = ()


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
        found.append(Wanted({"to": "splitsum"}, taps=TAP_COUNTS))
    if brdf.isotropic:
        found.append(Wanted({"to": "cabral", "max_size": _CABRAL}, needs_brdf=True))
    return found


def made_offers(
    wanted: Wanted, probe: Probe, brdf: Brdf, truth: Truth, progress: Progress | None = None
) -> list[Offer]:
    """Make a map once, and measure it as it is looked up in each way.

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
    return [_measured(made, taps, wanted, brdf, truth, make) for taps in wanted.taps or (None,)]


def _measured(
    made: Map, taps: int | None, wanted: Wanted, brdf: Brdf, truth: Truth, make: Callable[[], Map]
) -> Offer:
    """Measure a map, with so many taps if it is a split sum of brushed GGX."""
    form = wanted.arguments["to"]
    shown: ReflectedLight = made.shaded()
    scale = np.ones(3)
    if taps is not None:
        shown = _brushed(made, brdf, taps)
    elif isinstance(made, LightMap):
        shown = made.shaded(brdf.number("roughness"), brdf.color("f0"))
    elif form == "irradiance":
        scale = np.array(brdf.color("albedo"))
    error, share = truth.errors(shown, scale)
    what, stored, cost = _described(made, brdf, taps)
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
