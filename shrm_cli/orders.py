"""From a tolerance to orders (F, P), and what the truncation costs in the reflected light.

F is the largest degree l of the light that a map keeps, and P the largest degree p of the view.
Equations and sections 5.x are those of chapter 5 of Ramamoorthi's thesis.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.cache import cached_coefficients
from shrm_cli.brdf.coefficients import BrdfCoefficients, compute_coefficients
from shrm_cli.errors import BrdfError, OrderError
from shrm_cli.vocabulary import MAX_ORDER_F, MAX_ORDER_P, Center

Array = NDArray[np.floating]

_FIRST_ORDER_F = 32
"""The order F to which coefficients are computed first; it doubles until it suffices."""
_FIRST_ORDER_P = 8
"""The order P to which coefficients are computed first; it doubles until it suffices."""


@dataclass(frozen=True)
class Orders:
    """The orders of a map: the largest l and p that it keeps.

    Attributes
    ----------
    order_f, order_p : int
        The largest l and the largest p, inclusive.
    tolerance : float
        The fraction of the BRDF's energy that the orders were allowed to miss.
    captured : float
        The fraction of the BRDF's energy that the orders capture.
    """

    order_f: int
    order_p: int
    tolerance: float
    captured: float


def choose_orders(
    brdf: Brdf,
    tolerance: float,
    order_f: int | None = None,
    order_p: int | None = None,
) -> tuple[Orders, BrdfCoefficients]:
    """Find the least orders that capture all but `tolerance` of a BRDF's energy (eq. 5.17, 5.18).

    The coefficients are computed to growing orders until at most a fifth of the tolerance is
    missing beyond their F, and the tolerance is met by their P, or the limits are reached. What
    lies between the chosen orders and these larger ones is the error that `predicted_error`
    counts. Then P is reduced as far as the tolerance allows, and then F (section 5.6.2).

    Parameters
    ----------
    brdf : Brdf
    tolerance : float
        The fraction of the energy of all colour channels together that may be missed, in (0, 1).
    order_f, order_p : int, optional
        Orders to use instead of the chosen ones; `tolerance` may then not be met.

    Returns
    -------
    orders : Orders
    coefficients : BrdfCoefficients
        The coefficients of the BRDF, to orders at least as high as `orders`.

    Raises
    ------
    OrderError
        If the tolerance is outside (0, 1) or cannot be met within F = 512 and P = 32, or if a
        given order is outside these limits.
    BrdfError
        If the coefficients of the BRDF cannot be computed.
    """
    if not 0 < tolerance < 1:
        raise OrderError(f"the tolerance must lie between 0 and 1, not {tolerance:g}")
    for name, order, most in (("F", order_f, MAX_ORDER_F), ("P", order_p, MAX_ORDER_P)):
        if order is not None and not 0 <= order <= most:
            raise OrderError(f"order {name} = {order} is outside 0 .. {most}")
    coefficients = _sufficient_coefficients(brdf, tolerance, order_f or 0, order_p or 0)
    captured = coefficients.captured()
    enough = captured >= 1 - tolerance
    if not enough[-1, -1] and order_f is None and order_p is None:
        raise OrderError(
            f"{brdf!r}: tolerance {tolerance:g} cannot be met within F = {MAX_ORDER_F} and "
            f"P = {MAX_ORDER_P}; they reach {1 - captured[-1, -1]:.3g}; ask for more than that, or "
            "name the orders and see what they miss"
        )
    return least_orders(coefficients, tolerance, order_f, order_p), coefficients


def least_orders(
    coefficients: BrdfCoefficients,
    tolerance: float,
    order_f: int | None = None,
    order_p: int | None = None,
) -> Orders:
    """Find the least P, and then the least F, that capture all but `tolerance` of the energy.

    Where the coefficients reach no orders that meet the tolerance, their largest ones are taken.

    Parameters
    ----------
    coefficients : BrdfCoefficients
    tolerance : float
        The fraction of the energy that may be missed.
    order_f, order_p : int, optional
        Orders to use instead of the chosen ones; a P above that of the coefficients is lowered.
    """
    captured = coefficients.captured()
    enough = captured >= 1 - tolerance
    p = _least(enough[-1]) if order_p is None else min(order_p, coefficients.order_p)
    # A forced P may be too small for the tolerance. Then F must keep all but that fraction of
    # the energy that this P can capture.
    goal = (1 - tolerance) * (1 if enough[-1, p] else captured[-1, p])
    f = _least(captured[:, p] >= goal) if order_f is None else order_f
    return Orders(f, p, tolerance, float(captured[f, p]))


def choose_center(brdf: Brdf, tolerance: float) -> tuple[Brdf, dict[Center, int]]:
    """Recenter a BRDF about the direction that needs the fewest coefficients (section 5.3.1).

    A BRDF that is central about the tangent keeps that centre.

    Parameters
    ----------
    brdf : Brdf
    tolerance : float
        The fraction of the BRDF's energy that may be missed, in (0, 1).

    Returns
    -------
    brdf : Brdf
        The BRDF about the best centre.
    counts : dict
        The number of coefficients that each centre would need. Centres about which the tolerance
        cannot be met are left out.

    Raises
    ------
    OrderError, BrdfError
        If the tolerance cannot be met about any centre.
    """
    candidates: list[Center] = ["reflection", "normal"]
    if brdf.center == "tangent":
        candidates = ["tangent"]
    counts: dict[Center, int] = {}
    refusal: Exception | None = None
    for center in candidates:
        try:
            counts[center] = coefficient_count(*choose_orders(brdf.recentered(center), tolerance))
        except (OrderError, BrdfError) as error:  # the BRDF is too sharp about this centre
            refusal = error
    if not counts:
        raise refusal or OrderError(f"{brdf!r}: has no central direction")
    best = min(counts, key=lambda center: (counts[center], center != brdf.center))
    return brdf.recentered(best), counts


def coefficient_count(orders: Orders, coefficients: BrdfCoefficients) -> int:
    """Count the coefficients of the reflected light.

    Each harmonic of the view has a map of (F+1)^2 coefficients. There are (P+1)^2 such harmonics,
    or P + 1 for a BRDF that does not depend on the azimuth.
    """
    maps = orders.order_p + 1
    return (orders.order_f + 1) ** 2 * (maps if coefficients.azimuth_free else maps**2)


def _least(enough: NDArray[np.bool_]) -> int:
    """Return the first index that is enough, or the last index where none is."""
    return int(np.argmax(enough)) if enough.any() else len(enough) - 1


def _sufficient_coefficients(
    brdf: Brdf, tolerance: float, order_f: int, order_p: int
) -> BrdfCoefficients:
    """Compute coefficients to orders at which a tolerance is met, and at least to those given.

    Where the limits of the orders do not meet the tolerance, the coefficients reach the limits.
    """
    f = max(_FIRST_ORDER_F, order_f)
    p = 0 if brdf.zonal else max(_FIRST_ORDER_P, order_p)
    while True:
        accuracy = max(tolerance / (30 if brdf.is_measured else 300), 1e-5)
        coefficients = cached_coefficients(brdf, f, p, accuracy, compute_coefficients)
        total = coefficients.total_energy.sum()
        if total == 0:
            return coefficients
        missing_f = 1 - coefficients.degree_energy.sum() / total
        missing = 1 - coefficients.captured()[-1, -1]
        if missing_f > tolerance / 5 and f < MAX_ORDER_F:
            f = min(2 * f, MAX_ORDER_F)
        elif missing > tolerance and p < MAX_ORDER_P and not brdf.zonal:
            p = min(2 * p, MAX_ORDER_P)
        else:
            return coefficients


def predicted_error(
    lighting_power: Array, coefficients: BrdfCoefficients, order_f: int, order_p: int
) -> float:
    """Predict the relative RMS error of the reflected light over all orientations and views.

    By Parseval, ``int |B|^2 dR dV = sum_lmpq |L_lm|^2 |rho_hat_lpq|^2 4 pi / (2l+1)``. The error is
    the square root of the ratio of the terms with l > F or p > P to the whole sum.

    Parameters
    ----------
    lighting_power : ndarray, shape (>= coefficients.order_f + 1, 3)
        ``sum_m |L_lm|^2`` for each l and channel.
    coefficients : BrdfCoefficients
        The coefficients of the BRDF, to orders well above F and P.
    order_f, order_p : int
        The orders F and P of the map.

    Returns
    -------
    float
        The error, which is 0 for black light.
    """
    power = lighting_power[: coefficients.order_f + 1]
    light = _convolution_measure(coefficients.order_f)[:, None] * power
    whole = np.sum(light * coefficients.degree_energy)
    kept = np.sum(light[: order_f + 1] * _kept(coefficients, order_f, order_p))
    return float(np.sqrt(max(whole - kept, 0.0) / whole)) if whole > 0 else 0.0


def reflected_rms(lighting_power: Array, coefficients: BrdfCoefficients) -> float:
    """Return the root of the integral of the squared reflected light, by Parseval.

    The integral is over all orientations, views and channels.

    Parameters
    ----------
    lighting_power : ndarray, shape (>= coefficients.order_f + 1, 3)
        ``sum_m |L_lm|^2`` for each l and channel.
    coefficients : BrdfCoefficients
    """
    power = lighting_power[: coefficients.order_f + 1]
    light = _convolution_measure(coefficients.order_f)[:, None] * power
    return float(np.sqrt(np.sum(light * coefficients.degree_energy)))


def truncated_lobe_error(
    lighting_power: Array, coefficients: BrdfCoefficients, tail: BrdfCoefficients
) -> float:
    """Return the relative RMS error of leaving out the outer part of the BRDF's lobe.

    The integral is that of `predicted_error`, but the error is the light that the missing part
    of the lobe would reflect, instead of what lies beyond some orders.

    Parameters
    ----------
    lighting_power : ndarray, shape (>= coefficients.order_f + 1, 3)
        ``sum_m |L_lm|^2`` for each l and channel.
    coefficients, tail : BrdfCoefficients
        The coefficients of the whole BRDF and of the part that is missing, to the same order_f.

    Returns
    -------
    float
        The error, which is 0 for black light.
    """
    whole = reflected_rms(lighting_power, coefficients)
    return reflected_rms(lighting_power, tail) / whole if whole > 0 else 0.0


def error_bound(
    lighting_power: Array,
    lighting_energy: Array,
    coefficients: BrdfCoefficients,
    order_f: int,
    order_p: int,
) -> float:
    """Return a conservative relative RMS error, the square root of eps_B of eq. 5.19.

    All that is missing beyond F is taken to sit in mode F + 1, with all the residual energy of
    the light and of the BRDF: ``Lambda_{F+1}^2 (eps_L L_tot) (eps_rho rho_tot)``. (Eq. 5.19 is
    printed with Lambda_{F+1}, but energies go with its square, ``|B_lmpq|^2 = Lambda_l^2 |L_lm|^2
    |rho_hat_lpq|^2``.) The part with l <= F and p > P does not occur in the radially symmetric
    case of eq. 5.19. It is known for each degree, and is added as it is.

    Parameters
    ----------
    lighting_power, coefficients, order_f, order_p
        The same as for `predicted_error`.
    lighting_energy : ndarray, shape (3,)
        The integral L_tot of the squared radiance of each channel (eq. 5.15).

    Returns
    -------
    float
        The error, which is 0 for black light.
    """
    power = lighting_power[: order_f + 1]
    light = _convolution_measure(order_f)[:, None] * power
    kept = _kept(coefficients, order_f, order_p)
    low = coefficients.degree_energy[: order_f + 1]
    light_left = np.maximum(lighting_energy - power.sum(axis=0), 0)
    rho_left = np.maximum(coefficients.total_energy - low.sum(axis=0), 0)
    residual = _convolution_measure(order_f + 1)[-1] * np.sum(light_left * rho_left)
    residual += np.sum(light * (low - kept))
    whole = np.sum(light * kept) + residual
    return float(np.sqrt(residual / whole)) if whole > 0 else 0.0


def _kept(coefficients: BrdfCoefficients, order_f: int, order_p: int) -> Array:
    """Return the energy of the BRDF at each degree l <= F with p <= P, shape (F+1, 3)."""
    return coefficients.energies()[: order_f + 1, : order_p + 1].sum(axis=1)


def _convolution_measure(order: int) -> Array:
    """Return ``Lambda_l^2 = 4 pi / (2l+1)`` of eq. 5.7 for each l, shape (order+1,)."""
    return 4 * np.pi / (2 * np.arange(order + 1) + 1)
