"""Prefiltering in the frequency domain."""

from dataclasses import replace

import numpy as np

from shrm_cli.brdf.base import Brdf
from shrm_cli.maps.prefiltered import Baked, check_memory, provenance
from shrm_cli.maps.representations import Compression, represent
from shrm_cli.maps.shrm.shrm import Shrm
from shrm_cli.maps.size import check_size
from shrm_cli.orders import choose_orders, error_bound, predicted_error
from shrm_cli.probe.lighting import project
from shrm_cli.probe.probe import Probe
from shrm_cli.progress import Progress
from shrm_cli.vocabulary import Frame, Sampling


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
    check_memory(orders, size, representation, view_count)
    lighting = project(probe, coefficients.order_f, progress)
    f, p = orders.order_f, orders.order_p
    power = lighting.power()
    info = replace(
        provenance(probe, brdf, orders),
        predicted_error=predicted_error(power, coefficients, f, p),
    )
    built = Shrm.build(
        lighting.coefficients, coefficients.truncated(f, p), brdf.center, info,
        size, frame, sampling, dtype,
    )  # fmt: skip
    bound = error_bound(power, lighting.energy, coefficients, f, p)
    return Baked(represent(built, representation, view_count, compression), orders, bound)
