"""Prefiltering for diffuse surfaces: the lighting coefficients, windowed (section 4.3.1)."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shrm_cli.brdf.models.lambertian import Lambertian
from shrm_cli.errors import MapError, OrderError
from shrm_cli.maps.info import MapInfo
from shrm_cli.maps.irradiance.irradiance import (
    POLYNOMIAL_ORDER,
    Irradiance,
    irradiance_energies,
    lambert_factors,
)
from shrm_cli.maps.irradiance.window import make_window, parse_window
from shrm_cli.maps.prefiltered import provenance
from shrm_cli.maps.size import check_size, choose_size
from shrm_cli.orders import Orders
from shrm_cli.probe.lighting import Lighting, project
from shrm_cli.probe.probe import Probe
from shrm_cli.progress import Progress
from shrm_cli.vocabulary import MAX_ORDER_F, Sampling

Array = NDArray[np.floating]

_HIGH_ORDER = 64
"""Up to which the light is projected at least, for the error of what is left out."""
_LAST_DEGREES = 16


@dataclass(frozen=True)
class BakedIrradiance:
    """An irradiance map, and what is known of it.

    Attributes
    ----------
    map : Irradiance
    asked_window : str
        As it was asked for.
    minimum_before, minimum : float
        Least irradiance of any normal and channel, without and with the window.
    """

    map: Irradiance
    asked_window: str
    minimum_before: float
    minimum: float

    def summary(self) -> dict[str, Any]:
        """The numbers that users and scripts ask for."""
        made, info = self.map, self.map.info
        is_polynomial = made.order_f <= POLYNOMIAL_ORDER
        return {
            "representation": made.representation,
            "frame": made.frame,
            "center": made.center,
            "size": made.size,
            "sampling": made.sampling,
            "order_f": made.order_f,
            "coefficients": len(made.coefficients),
            "brdf_energy_captured": info.captured,
            "predicted_error": info.predicted_error,
            "added_error": info.added_error,
            "window": {
                "asked": self.asked_window,
                "name": made.window.name,
                "width": made.window.width,
                "factors": list(made.window.factors) or [1.0] * (made.order_f + 1),
                "energy_lost": made.window.energy_lost,
                "change": made.window.change,
            },
            "minimum_irradiance": self.minimum,
            "minimum_without_window": self.minimum_before,
            "lighting_coefficients": made.coefficients.tolist(),
            "irradiance_matrices": made.matrices().tolist() if is_polynomial else None,
            "brdf": info.brdf,
            "probe": info.probe,
            "probe_sha256": info.probe_sha256,
        }


def bake_irradiance(
    probe: Probe,
    order_f: int = POLYNOMIAL_ORDER,
    window: str = "none",
    size: int | None = None,
    sampling: Sampling = "center",
    progress: Progress | None = None,
) -> BakedIrradiance:
    """Project a probe, and keep what a diffuse surface reflects of it.

    Parameters
    ----------
    probe : Probe
    order_f : int
        Largest degree to keep; 2 makes nine coefficients.
    window : str
        As `make_window` takes it.
    size : int, optional
        Texels along an edge of the cube; from the order by default.
    sampling : {"center", "border"}
        Of the cube.
    progress : callable, optional
        Called with rows read and rows in all.

    Raises
    ------
    OrderError, MapError, ProbeError
    """
    if not 0 <= order_f <= MAX_ORDER_F:
        raise OrderError(f"order F = {order_f} is outside 0 .. {MAX_ORDER_F}")
    parse_window(window)
    size = choose_size(order_f) if size is None else size
    check_size(order_f, 0, size)
    high = min(max(_HIGH_ORDER, 2 * order_f), MAX_ORDER_F)
    lighting = project(probe, high, progress)
    if not np.isfinite(lighting.coefficients).all():
        raise MapError(f"{probe.name}: its light is beyond 32-bit floats; dim it")
    captured = _captured(order_f)
    orders = Orders(order_f, 0, max(1 - captured, 0.0), captured)
    info = replace(
        provenance(probe, Lambertian(), orders), predicted_error=_missing(lighting, order_f)
    )
    whole = Irradiance(lighting.coefficients[: (order_f + 1) ** 2], info, size, sampling)
    return _windowed(whole, window)


def _windowed(whole: Irradiance, spec: str) -> BakedIrradiance:
    """A map with a window, and its least irradiance before and after."""
    before = whole.minimum()
    window = make_window(spec, whole.series)
    if not window.factors:
        return BakedIrradiance(whole, spec, before, before)
    info: MapInfo = replace(whole.info, added_error=window.change)
    made = replace(whole, coefficients=window.apply(whole.coefficients), info=info, window=window)
    return BakedIrradiance(made, spec, before, made.minimum())


def _missing(lighting: Lighting, order_f: int) -> float:
    """Relative RMS of what degrees above an order would add to the irradiance (Parseval)."""
    energies = irradiance_energies(lighting.power()).sum(axis=1)
    beyond = _unknown(lighting)
    whole = energies.sum() + beyond
    return float(np.sqrt((energies[order_f + 1 :].sum() + beyond) / whole)) if whole > 0 else 0.0


def _unknown(lighting: Lighting) -> float:
    """The energy of the irradiance of what the light holds beyond its expansion.

    The light goes on as white light does, ``(2l+1)`` times the mean power of the last degrees;
    or all the energy that is left is in the next degree, if that is less.
    """
    power = lighting.power().sum(axis=1)
    known = int(np.flatnonzero(power).max(initial=0)) + 1  # beyond the pixels' it is 0
    rest = max(float(lighting.energy.sum() - power.sum()), 0.0)
    last = slice(max(known - _LAST_DEGREES, 0), known)
    density = power[last].sum() / (2 * np.arange(known) + 1)[last].sum()
    white = density * 4 * np.pi * (2 * np.pi / 3) * (1 - _captured(known - 1))
    following = lambert_factors(known + 1)[known:]  # one of two is 0
    return float(min(white, rest * np.max(following**2)))


def _captured(order_f: int) -> float:
    """The part of the clamped cosine's energy, 2 pi / 3, up to an order (eq. 5.18)."""
    measure = (2 * np.arange(order_f + 1) + 1) / (4 * np.pi)
    return float(lambert_factors(order_f) ** 2 @ measure / (2 * np.pi / 3))
