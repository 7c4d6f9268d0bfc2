"""Prefiltering in the angular domain, the older method that the frequency domain is compared with.

Equations 5.x are those of chapter 5 of Ramamoorthi's thesis.
"""

from dataclasses import replace

import numpy as np

from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.coefficients import BrdfCoefficients, compute_coefficients
from shrm_cli.brdf.lobe import lobe_tail
from shrm_cli.maps.explicit.prefilter import explicit_form, explicit_kind, view_count
from shrm_cli.maps.explicit.tabulate import tabulate
from shrm_cli.maps.info import provenance
from shrm_cli.maps.prefiltered import Prefiltered
from shrm_cli.maps.request import Request
from shrm_cli.maps.shrm.budget import (
    Choice,
    halved,
    most_order_p,
    refuse_large,
)
from shrm_cli.maps.shrm.shrm import Shrm
from shrm_cli.maps.size import choose_size
from shrm_cli.orders import choose_orders
from shrm_cli.probe.lighting import project
from shrm_cli.probe.probe import Probe
from shrm_cli.progress import using
from shrm_cli.reference import Reference
from shrm_cli.reflected import truncated_lobe_error

_TEXELS_TO_MEASURE = 16
"""The most texels along a face's edge of the SHRM from which the added error is measured."""
_ORDER_TO_MEASURE = 10
"""The order P of the coefficients from which the errors are measured."""
_FINEST_GRID = 0.01
"""The least tolerance from which size and number of views are chosen. A smaller tolerance makes no
finer grid, because some BRDFs have no orders that meet it."""


def prefilter_angular(probe: Probe, request: Request) -> Prefiltered:
    """Prefilter a probe for a BRDF in the angular domain: one integral for each texel and view.

    The fraction `eps` of the lobe may be left out, far from its centre (eq. 5.30). The orders that
    meet it determine the size and the number of views, unless they are given.

    Raises
    ------
    ArgumentError, OrderError, ProbeError, BrdfError, MapError
        If no map fits into the bytes, the tolerance cannot be met, the probe or the BRDF cannot be
        used, or the map would be too large.
    """
    brdf, kind = request.brdf, explicit_kind(request.to)
    size, sampling = request.size, request.sampling
    allowed, finest = request.allowed, max(request.eps, _FINEST_GRID)
    most_p = most_order_p(allowed, size, explicit_form(request).largest_p(allowed))
    with using(None):  # all of this takes a moment beside the images
        orders, chosen = choose_orders(brdf, finest, most_p=most_p)
        _, coefficients = choose_orders(brdf, finest, order_p=_ORDER_TO_MEASURE)
        views = view_count(request)
        views = kind.default_view_count(orders.order_p) if views is None else views
        count = kind.image_count(views)
        if size is None:
            choice = Choice(orders, choose_size(orders.order_f))
            choice = halved(choice, chosen, count, allowed) or choice
            orders, size = choice.orders, choice.size
        orders = replace(orders, eps=request.eps)
        refuse_large(size, count, request.max_size)
        kind.check_images(size, count)
        integral = Reference(probe, brdf, request.source_height, request.eps, exact=True)
        lighting = project(probe, coefficients.order_f)
        tail = _tail_coefficients(brdf, integral.angle, coefficients)
        captured = 1 - tail.total_energy.sum() / max(coefficients.total_energy.sum(), 1e-300)
        orders = replace(orders, captured=float(captured))
        info = replace(
            provenance(probe, brdf, orders),
            predicted_error=truncated_lobe_error(lighting, coefficients, tail),
            domain="angular",
        )
        # The error of interpolating between views is measured in the frequency domain, where it
        # takes little time. A few texels suffice for that.
        smooth = Shrm.from_coefficients(
            lighting.coefficients,
            coefficients.values, brdf.center, info,
            min(size, _TEXELS_TO_MEASURE), dtype=np.float32,
        )  # fmt: skip
        info = replace(info, added_error=kind.from_shrm(smooth, views).info.added_error)
    built = tabulate(kind, integral, brdf.center, info, size, views, sampling)
    return Prefiltered(built, {"error_bound": None, "predicted_wrong_share": None})


def _tail_coefficients(brdf: Brdf, angle: float, whole: BrdfCoefficients) -> BrdfCoefficients:
    """Compute the coefficients of what a lobe truncated at `angle` (radians) lacks.

    They are small, so that an accuracy of one percent suffices.
    """
    return compute_coefficients(lobe_tail(brdf, angle), whole.order_f, whole.order_p, 1e-2)
