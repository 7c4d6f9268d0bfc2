"""Prefiltering in the angular domain, as it was done before: the baseline of the paper."""

from dataclasses import replace

import numpy as np

from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.coefficients import BrdfCoefficients, compute_coefficients
from shrm_cli.brdf.lobe import lobe_tail
from shrm_cli.maps.explicit.tabulate import tabulate
from shrm_cli.maps.prefiltered import Baked, check_memory, provenance
from shrm_cli.maps.representations import EXPLICIT
from shrm_cli.maps.shrm.shrm import Shrm
from shrm_cli.maps.size import choose_size
from shrm_cli.orders import choose_orders, truncated_lobe_error
from shrm_cli.probe.lighting import project
from shrm_cli.probe.probe import Probe
from shrm_cli.progress import Progress
from shrm_cli.reference import Reference
from shrm_cli.vocabulary import Sampling

_TEXELS_TO_MEASURE = 16
_ORDER_TO_MEASURE = 10
_FINEST_GRID = 0.01
"""Tolerance below which the angular domain makes no finer grid: some BRDFs have no orders."""


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
    check_memory(orders, size, representation, view_count)
    integral = Reference(probe, brdf, source_height, tolerance)
    lighting = project(probe, coefficients.order_f)
    tail = _tail_coefficients(brdf, integral.angle, coefficients)
    captured = 1 - tail.total_energy.sum() / max(coefficients.total_energy.sum(), 1e-300)
    orders = replace(orders, captured=float(captured))
    info = replace(
        provenance(probe, brdf, orders),
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


def _tail_coefficients(brdf: Brdf, angle: float, whole: BrdfCoefficients) -> BrdfCoefficients:
    """Of what a lobe truncated at an angle lacks; it is small, so a percent of it will do."""
    return compute_coefficients(lobe_tail(brdf, angle), whole.order_f, whole.order_p, 1e-2)
