"""The whole way from a probe and a BRDF to a map."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.coefficients import BrdfCoefficients, compute_coefficients
from shrm_cli.brdf.lobe import lobe_tail
from shrm_cli.maps.info import MapInfo
from shrm_cli.maps.representations import EXPLICIT, Compression, Map, map_count, represent
from shrm_cli.maps.shrm import Frame, Shrm, check_size, choose_size
from shrm_cli.maps.tabulate import tabulate
from shrm_cli.orders import (
    Orders,
    choose_orders,
    error_bound,
    predicted_error,
    truncated_lobe_error,
)
from shrm_cli.probe.lighting import Progress, project
from shrm_cli.probe.probe import Probe
from shrm_cli.reference import Reference
from shrm_cli.sphere.grids import Sampling

_TEXELS_TO_MEASURE = 16
_ORDER_TO_MEASURE = 10
_FINEST_GRID = 0.01
"""Tolerance below which the angular domain makes no finer grid: some BRDFs have no orders."""


@dataclass(frozen=True)
class Baked:
    """A map, and what is known of its error.

    Attributes
    ----------
    map : Map
    orders : Orders
    error_bound : float or None
        Conservative relative RMS error (eq. 5.19) of the orders; None where the map was not
        made from them.
    """

    map: Map
    orders: Orders
    error_bound: float | None

    def summary(self) -> dict[str, Any]:
        """The numbers that users and scripts ask for."""
        info = self.map.info
        return {
            "representation": self.map.representation,
            "frame": self.map.frame,
            "center": self.map.center,
            "size": self.map.size,
            "sampling": self.map.sampling,
            "maps": map_count(self.map),
            "domain": info.domain,
            "order_f": info.order_f,
            "order_p": info.order_p,
            "epsilon": info.tolerance,
            "brdf_energy_captured": info.captured,
            "predicted_error": info.predicted_error,
            "added_error": info.added_error,
            "error_bound": self.error_bound,
            "brdf": info.brdf,
            "probe": info.probe,
            "probe_sha256": info.probe_sha256,
        }


def bake(
    probe: Probe,
    brdf: Brdf,
    tolerance: float,
    order_f: int | None = None,
    order_p: int | None = None,
    size: int | None = None,
    frame: Frame = "global",
    sampling: Sampling = "center",
    dtype: type = np.float64,
    representation: str = "shrm",
    view_count: int | None = None,
    compression: Compression | None = None,
    progress: Progress | None = None,
) -> Baked:
    """Prefilter a probe for a BRDF in the frequency domain (section 5.6.2).

    Parameters
    ----------
    probe : Probe
    brdf : Brdf
    tolerance : float
        Fraction of the BRDF's energy that may be missed.
    order_f, order_p : int, optional
        Orders to use instead of the chosen ones.
    size, frame, sampling, dtype
        As `Shrm.build` takes them.
    representation, view_count, compression
        As `represent` takes them.
    progress : callable, optional
        Called with rows read and rows in all.

    Raises
    ------
    OrderError, ProbeError, BrdfError, MapError
    """
    if order_f is not None and not brdf.zonal:
        check_size(order_f, order_p or 0, size)
    orders, coefficients = choose_orders(brdf, tolerance, order_f, order_p)
    _check_size(orders, size, representation, view_count)
    lighting = project(probe, coefficients.order_f, progress)
    f, p = orders.order_f, orders.order_p
    power = lighting.power()
    info = replace(
        _provenance(probe, brdf, orders),
        predicted_error=predicted_error(power, coefficients, f, p),
    )
    built = Shrm.build(
        lighting.coefficients, coefficients.truncated(f, p), brdf.center, info,
        size, frame, sampling, dtype,
    )  # fmt: skip
    bound = error_bound(power, lighting.energy, coefficients, f, p)
    return Baked(represent(built, representation, view_count, compression), orders, bound)


def bake_angular(
    probe: Probe,
    brdf: Brdf,
    tolerance: float,
    representation: str,
    view_count: int | None = None,
    size: int | None = None,
    sampling: Sampling = "center",
    source_height: int | None = None,
    progress: Progress | None = None,
) -> Baked:
    """Prefilter a probe for a BRDF in the angular domain: one integral for each texel and view.

    Parameters
    ----------
    probe : Probe
    brdf : Brdf
    tolerance : float
        The part of the lobe, about its centre, that may be left out (eq. 5.30). It chooses size
        and number of views too, by the orders that it asks for.
    representation : str
        One of `EXPLICIT`.
    view_count, size, sampling
        As `tabulate` takes them.
    source_height : int, optional
        Average the probe down to a lat-long of this height first.
    progress : callable, optional
        Called with images done and images in all.

    Raises
    ------
    OrderError, ProbeError, BrdfError, MapError
    """
    kind = EXPLICIT[representation]
    orders, _ = choose_orders(brdf, max(tolerance, _FINEST_GRID))
    _, coefficients = choose_orders(brdf, orders.tolerance, order_p=_ORDER_TO_MEASURE)
    orders = replace(orders, tolerance=tolerance)
    size = choose_size(orders.order_f) if size is None else size
    view_count = kind.default_view_count(orders.order_p) if view_count is None else view_count
    _check_size(orders, size, representation, view_count)
    integral = Reference(probe, brdf, source_height, tolerance)
    lighting = project(probe, coefficients.order_f)
    tail = _tail_coefficients(brdf, integral.angle, coefficients)
    captured = 1 - tail.total_energy.sum() / max(coefficients.total_energy.sum(), 1e-300)
    orders = replace(orders, captured=float(captured))
    info = replace(
        _provenance(probe, brdf, orders),
        predicted_error=truncated_lobe_error(lighting.power(), coefficients, tail),
        domain="angular",
    )
    # What lies between the views is known from the frequency domain at once; some texels will do.
    smooth = Shrm.build(
        lighting.coefficients,
        coefficients.values, brdf.center, info,
        min(size, _TEXELS_TO_MEASURE), dtype=np.float32,
    )  # fmt: skip
    info = replace(info, added_error=kind.from_shrm(smooth, view_count).info.added_error)
    built = tabulate(kind, integral, brdf.center, info, size, view_count, sampling, progress)
    return Baked(built, orders, None)


def _check_size(
    orders: Orders, size: int | None, representation: str, view_count: int | None
) -> None:
    """Refuse before the work what could not be kept in memory."""
    check_size(orders.order_f, orders.order_p, size)
    if representation in EXPLICIT:
        kind = EXPLICIT[representation]
        views = kind.default_view_count(orders.order_p) if view_count is None else view_count
        size = choose_size(orders.order_f) if size is None else size
        kind.check_memory(size, kind.image_count(views))


def _provenance(probe: Probe, brdf: Brdf, orders: Orders) -> MapInfo:
    return MapInfo(
        orders.order_f,
        orders.order_p,
        orders.tolerance,
        orders.captured,
        0.0,
        {"name": brdf.name, "parameters": dict(brdf.values)},
        probe.name.replace("\\", "/").rsplit("/", 1)[-1],
        probe.digest(),
        probe.chromaticities,
    )


def _tail_coefficients(brdf: Brdf, angle: float, whole: BrdfCoefficients) -> BrdfCoefficients:
    """Of what a lobe truncated at an angle lacks; it is small, so a percent of it will do."""
    return compute_coefficients(lobe_tail(brdf, angle), whole.order_f, whole.order_p, 1e-2)
