"""Tolerance -> orders (F, P), and what the truncation costs in the reflected light."""

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
_FIRST_ORDER_P = 8


@dataclass(frozen=True)
class Orders:
    """The orders of a map: the largest l and p kept.

    Attributes
    ----------
    order_f, order_p : int
        Inclusive.
    tolerance : float
        The fraction of the BRDF's energy that they were allowed to miss.
    captured : float
        The fraction that they capture.
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
    """Least orders that capture all but `tolerance` of a BRDF's energy (eq. 5.17, 5.18).

    The coefficients are computed to growing orders until a fifth of the tolerance is missing at
    most beyond their F, and the tolerance is met by their P (or the limits are reached): what
    lies between the chosen orders and these is the error that `predicted_error` counts. Then P
    is reduced as far as the tolerance allows, then F (section 5.6.2).

    Parameters
    ----------
    brdf : Brdf
    tolerance : float
        In (0, 1), over the colour channels together.
    order_f, order_p : int, optional
        Orders to use instead of the chosen ones; `tolerance` may then be missed.

    Returns
    -------
    orders : Orders
    coefficients : BrdfCoefficients
        To orders at least as high.

    Raises
    ------
    OrderError
        If the tolerance is outside (0, 1), or cannot be met within F = 512 and P = 32.
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
    """Least P, then least F, that capture all but `tolerance` of the energy, as far as known.

    Parameters
    ----------
    coefficients : BrdfCoefficients
    tolerance : float
    order_f, order_p : int, optional
        Orders to use instead.
    """
    captured = coefficients.captured()
    enough = captured >= 1 - tolerance
    p = _least(enough[-1]) if order_p is None else min(order_p, coefficients.order_p)
    # A forced P may be too small for the tolerance: then F keeps all but that much of its part.
    goal = (1 - tolerance) * (1 if enough[-1, p] else captured[-1, p])
    f = _least(captured[:, p] >= goal) if order_f is None else order_f
    return Orders(f, p, tolerance, float(captured[f, p]))


def choose_center(brdf: Brdf, tolerance: float) -> tuple[Brdf, dict[Center, int]]:
    """The BRDF about the central direction that needs the fewest coefficients (section 5.3.1).

    Parameters
    ----------
    brdf : Brdf
    tolerance : float
        In (0, 1).

    Returns
    -------
    brdf : Brdf
    counts : dict
        Coefficients that each centre would need; those where the tolerance cannot be met are
        left out.

    Raises
    ------
    OrderError, BrdfError
        If it can be met with none.
    """
    candidates: list[Center] = ["reflection", "normal"]
    if brdf.center == "tangent":
        candidates = ["tangent"]
    counts: dict[Center, int] = {}
    refusal: Exception | None = None
    for center in candidates:
        try:
            counts[center] = coefficient_count(*choose_orders(brdf.recentered(center), tolerance))
        except (OrderError, BrdfError) as error:  # too sharp about this centre
            refusal = error
    if not counts:
        raise refusal or OrderError(f"{brdf!r}: has no central direction")
    best = min(counts, key=lambda center: (counts[center], center != brdf.center))
    return brdf.recentered(best), counts


def coefficient_count(orders: Orders, coefficients: BrdfCoefficients) -> int:
    """Coefficients of the reflected light: (F+1)^2 for each map, P + 1 maps without azimuth."""
    maps = orders.order_p + 1
    return (orders.order_f + 1) ** 2 * (maps if coefficients.azimuth_free else maps**2)


def _least(enough: NDArray[np.bool_]) -> int:
    return int(np.argmax(enough)) if enough.any() else len(enough) - 1


def _sufficient_coefficients(
    brdf: Brdf, tolerance: float, order_f: int, order_p: int
) -> BrdfCoefficients:
    """Coefficients to orders at which a tolerance is met, at least those given."""
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
    """Relative RMS error of the reflected light over all orientations and views, by Parseval.

    ``int |B|^2 dR dV = sum_lmpq |L_lm|^2 |rho_hat_lpq|^2 4 pi / (2l+1)``: the square root of the
    part with l > F or p > P over the whole.

    Parameters
    ----------
    lighting_power : ndarray, shape (>= coefficients.order_f + 1, 3)
        ``sum_m |L_lm|^2`` for each l.
    coefficients : BrdfCoefficients
        To orders well above F and P.
    order_f, order_p : int

    Returns
    -------
    float
        0 for black light.
    """
    power = lighting_power[: coefficients.order_f + 1]
    light = _convolution_measure(coefficients.order_f)[:, None] * power
    whole = np.sum(light * coefficients.degree_energy)
    kept = np.sum(light[: order_f + 1] * _kept(coefficients, order_f, order_p))
    return float(np.sqrt(max(whole - kept, 0.0) / whole)) if whole > 0 else 0.0


def reflected_rms(lighting_power: Array, coefficients: BrdfCoefficients) -> float:
    """Root of the integral of the squared reflected light over all orientations and views.

    Parameters
    ----------
    lighting_power : ndarray, shape (>= order_f + 1, 3)
    coefficients : BrdfCoefficients
    """
    power = lighting_power[: coefficients.order_f + 1]
    light = _convolution_measure(coefficients.order_f)[:, None] * power
    return float(np.sqrt(np.sum(light * coefficients.degree_energy)))


def truncated_lobe_error(
    lighting_power: Array, coefficients: BrdfCoefficients, tail: BrdfCoefficients
) -> float:
    """Relative RMS error of the reflected light without the outer part of the BRDF's lobe.

    The same integral as in `predicted_error`, of what was cut off instead of what lies beyond
    some orders.

    Parameters
    ----------
    lighting_power : ndarray, shape (>= order_f + 1, 3)
    coefficients, tail : BrdfCoefficients
        Of the whole BRDF and of the part that is missing, to the same order_f.

    Returns
    -------
    float
        0 for black light.
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
    """Conservative relative RMS error, the square root of eps_B of eq. 5.19.

    What is missing beyond F is taken to sit in mode F + 1 entirely, with all the residual energy
    of the light and of the BRDF: ``Lambda_{F+1}^2 (eps_L L_tot) (eps_rho rho_tot)``. (The paper
    prints Lambda_{F+1}; energies go with the square, ``|B_lmpq|^2 = Lambda_l^2 |L_lm|^2
    |rho_hat_lpq|^2``.) The part with l <= F and p > P, which the paper's radially symmetric case
    does not have, is known degree by degree and added as it is.

    Parameters
    ----------
    lighting_power, coefficients, order_f, order_p
        As for `predicted_error`.
    lighting_energy : ndarray, shape (3,)
        The integral of the squared radiance, L_tot (eq. 5.15).
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
    """Energy of the BRDF at each degree l <= F with p <= P, shape (F+1, 3)."""
    return coefficients.energies()[: order_f + 1, : order_p + 1].sum(axis=1)


def _convolution_measure(order: int) -> Array:
    """``Lambda_l^2 = 4 pi / (2l+1)`` of eq. 5.7."""
    return 4 * np.pi / (2 * np.arange(order + 1) + 1)
