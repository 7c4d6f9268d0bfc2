"""The whole way from a probe and a BRDF to a map."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from shrm_cli.brdf.base import Brdf
from shrm_cli.maps.info import MapInfo
from shrm_cli.maps.shrm import Frame, Shrm, check_size
from shrm_cli.orders import Orders, choose_orders, error_bound, predicted_error
from shrm_cli.probe.lighting import Progress, project
from shrm_cli.probe.probe import Probe
from shrm_cli.sphere.grids import Sampling


@dataclass(frozen=True)
class Baked:
    """A map, and what is known of its error.

    Attributes
    ----------
    map : Shrm
    orders : Orders
    error_bound : float
        Conservative relative RMS error (eq. 5.19).
    """

    map: Shrm
    orders: Orders
    error_bound: float

    def summary(self) -> dict[str, Any]:
        """The numbers that users and scripts ask for."""
        info = self.map.info
        return {
            "representation": self.map.representation,
            "frame": self.map.frame,
            "center": self.map.center,
            "size": self.map.size,
            "sampling": self.map.sampling,
            "order_f": info.order_f,
            "order_p": info.order_p,
            "epsilon": info.tolerance,
            "brdf_energy_captured": info.captured,
            "predicted_error": info.predicted_error,
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
    progress: Progress | None = None,
) -> Baked:
    """Prefilter a probe for a BRDF (section 5.6.2).

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
    progress : callable, optional
        Called with rows read and rows in all.

    Raises
    ------
    OrderError, ProbeError, BrdfError, MapError
    """
    if order_f is not None and not brdf.zonal:
        check_size(order_f, order_p or 0, size)
    orders, coefficients = choose_orders(brdf, tolerance, order_f, order_p)
    check_size(orders.order_f, orders.order_p, size)
    lighting = project(probe, coefficients.order_f, progress)
    f, p = orders.order_f, orders.order_p
    power = lighting.power()
    info = MapInfo(
        f,
        p,
        tolerance,
        orders.captured,
        predicted_error(power, coefficients, f, p),
        {"name": brdf.name, "parameters": dict(brdf.values)},
        probe.name.replace("\\", "/").rsplit("/", 1)[-1],
        probe.digest(),
        probe.chromaticities,
    )
    built = Shrm.build(
        lighting.coefficients, coefficients.truncated(f, p), brdf.center, info,
        size, frame, sampling, dtype,
    )  # fmt: skip
    return Baked(built, orders, error_bound(power, lighting.energy, coefficients, f, p))
