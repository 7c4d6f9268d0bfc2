"""Forms that are made to be known, and the light itself, for what no error is predicted of."""

from collections.abc import Callable
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.lobe_expansion import lobe_width
from shrm_cli.choose.offer import Offer
from shrm_cli.errors import PluginError
from shrm_cli.maps import registry
from shrm_cli.maps.base import Map, ReflectedLight
from shrm_cli.maps.kinds import LightMap
from shrm_cli.maps.offers import LookUp, Setting
from shrm_cli.maps.prefiltered import visible_pairs
from shrm_cli.maps.size import total_error
from shrm_cli.prefilter import prefilter_with_facts
from shrm_cli.probe.probe import Probe
from shrm_cli.progress import Progress
from shrm_cli.reference import Reference
from shrm_cli.render.seen import seen_errors
from shrm_cli.render.sphere import Reflecting
from shrm_cli.sphere.directions import bisector

_POINTS = 400
"""The pairs of a mirror direction and a view. A share of 5 % is known to 1.1 % of all by them."""
_ROWS_OF_LOBE = 24.0
"""Rows of the probe for the truth times the width of the lobe, as `shrm compare` takes them."""
_ROWS = 64, 256
"""The fewest and the most rows. More would take longer than the maps that are measured."""


class Truth:
    """The light that a BRDF reflects of a probe, spread evenly over the pixels of spheres.

    `progress` is called with the number of points done, and of points in all.
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

        `scale`, of shape (3,), is what its light is multiplied with.

        Returns `error`, the relative RMS error; 0 where nothing is reflected and nothing shown; and
        `wrong_share`, the share of points whose luminance is wrong by more than 5 %.
        """
        found = shown.radiance(self._normals, self._views) * np.asarray(scale)
        truth = self._radiance
        missed, whole = np.linalg.norm(found - truth), np.linalg.norm(truth)
        error = missed / whole if whole > 0 else np.inf if missed > 0 else 0.0
        return float(error), seen_errors(found, truth).wrong_share


def others_of(brdf: Brdf, missing: list[str] | None = None) -> list[tuple[str, Setting]]:
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
            if missing is not None:
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
    """Make a map once, and measure it as it is looked up in each way.

    Raises ShrmError if it cannot be made.
    """
    needed = {"brdf": brdf} if registry.description(form).needs_brdf else {}

    def make(progress: Progress | None = None) -> Map:
        return prefilter_with_facts(probe, form, {**setting.arguments, **needed}, progress).map

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
    """Measure a map, with so many taps where the surface is brushed."""
    shown: ReflectedLight = made.shaded()
    if taps is not None:
        roughness, anisotropy, f0 = brdf.brushed_surface  # type: ignore[attr-defined]
        shown = made.shaded(roughness, f0, anisotropy, taps)
    elif isinstance(made, LightMap):
        shown = made.shaded(brdf.number("roughness"), brdf.color("f0"))
    error, share = truth.errors(shown, brdf.color("albedo") if made.is_white else 1.0)
    measured: tuple[str, ...] = ("error", "wrong_share")
    if not isinstance(made, LightMap):
        info = made.info
        missing = float(np.hypot(info.predicted_error, info.added_error))
        error, measured = total_error(missing, info.filter_error), ("wrong_share",)
    form, cost = made.representation, look_up.cost
    return Offer(
        form, look_up.what, look_up.bytes, error, share, measured, cost.look_ups,
        cost.multiply_adds, {"to": form, **setting.arguments}, make,
    )  # fmt: skip
