"""From a tolerance to orders (F, P).

F is the largest degree l of the light that a map keeps, and P the largest degree p of the view.
Equations and sections 5.x are those of chapter 5 of Ramamoorthi's thesis.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from typing import Self

import numpy as np
from numpy.typing import NDArray

from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.cache import cached_coefficients, cached_first_order
from shrm_cli.brdf.coefficients import (
    FIRST_ORDER_F,
    BrdfCoefficients,
    FirstOrder,
    energy_above,
    octaves_to_come,
)
from shrm_cli.errors import BrdfError, OrderError
from shrm_cli.records import record
from shrm_cli.vocabulary import MAX_ORDER_F, MAX_ORDER_P, Center

_LOST = 4.0
"""Where a P that cannot be raised misses this times what a higher F would find, F is enough."""
_FIRST_ORDER_P = 8
"""The order P to which coefficients are computed first; it doubles until it suffices."""


@record
class Orders:
    """The orders of a map: the largest l and p that it keeps."""

    order_f: int
    order_p: int
    """`order_f` and `order_p`: the largest l and the largest p, inclusive."""
    eps: float
    """The fraction of the BRDF's energy that the orders were allowed to miss."""
    captured: float
    """The fraction of the BRDF's energy that the orders capture."""

    @classmethod
    def capturing(cls, order_f: int, order_p: int, captured: float) -> Self:
        """Return orders that were allowed to miss what they miss; by rounding that may be < 0."""
        return cls(order_f, order_p, max(1 - captured, 0.0), captured)


def choose_orders(
    brdf: Brdf,
    eps: float,
    order_f: int | None = None,
    order_p: int | None = None,
    most_p: Callable[[int], int] | None = None,
) -> tuple[Orders, BrdfCoefficients]:
    """Find the least orders that capture all but `eps` of a BRDF's energy (eq. 5.17, 5.18).

    The coefficients are computed to growing orders until at most a fifth of the tolerance is
    missing beyond their F, and the tolerance is met by their P, or the limits are reached. What
    lies between the chosen orders and these larger ones is the error that
    `reflected.predicted_error` counts. Then P is reduced as far as the tolerance allows, and then
    F (section 5.6.2).

    `eps` is the fraction of the energy of all colour channels together that may be missed, in (0,
    1). `order_f` and `order_p` are orders to use instead of the chosen ones; `eps` may then not be
    met. `most_p` returns the largest P that may be chosen with an order F. With it, a tolerance
    that cannot be met is no error: the coefficients then reach that P, and the orders are their
    largest.

    Returns `orders`; and `coefficients`, the coefficients of the BRDF, to orders at least as high
    as `orders`.
    """
    if not 0 < eps < 1:
        raise OrderError(f"the tolerance must lie between 0 and 1, not {eps:g}")
    for name, order, most in (("F", order_f, MAX_ORDER_F), ("P", order_p, MAX_ORDER_P)):
        if order is not None and not 0 <= order <= most:
            raise OrderError(f"order {name} = {order} is outside 0 .. {most}")
    least = order_f or 0, order_p or 0
    coefficients = _sufficient_coefficients(brdf, eps, *least, most_p)
    if most_p is None and order_f is None and order_p is None:
        return sufficient_orders(brdf, coefficients, eps), coefficients
    return least_orders(coefficients, eps, order_f, order_p), coefficients


def known_coefficients(brdf: Brdf, eps: float) -> BrdfCoefficients:
    """Compute coefficients that meet a tolerance and every larger one, or those to the limits."""
    return _sufficient_coefficients(brdf, eps, 0, 0, None)


def sufficient_orders(brdf: Brdf, coefficients: BrdfCoefficients, eps: float) -> Orders:
    """Find the least orders that meet a tolerance among those of known coefficients.

    `coefficients` are what `known_coefficients` returns for this tolerance or a smaller one. `eps`
    is the fraction of the energy that may be missed.
    """
    missed = 1 - coefficients.captured[-1, -1]
    if missed > eps:
        raise OrderError(
            f"{brdf!r}: tolerance {eps:g} cannot be met within F = {MAX_ORDER_F} and "
            f"P = {MAX_ORDER_P}; they reach {missed:.3g}; ask for more than that, or "
            "name the orders and see what they miss"
        )
    return least_orders(coefficients, eps)


def least_orders(
    coefficients: BrdfCoefficients,
    eps: float,
    order_f: int | None = None,
    order_p: int | None = None,
) -> Orders:
    """Find the least P, and then the least F, that capture all but `eps` of the energy.

    Where the coefficients reach no orders that meet the tolerance, their largest ones are taken.

    `order_f` and `order_p` are orders to use instead of the chosen ones; a P above that of the
    coefficients is lowered.
    """
    captured = coefficients.captured
    enough = captured >= 1 - eps
    p = first_enough(enough[-1]) if order_p is None else min(order_p, coefficients.order_p)
    # A forced P may be too small for the tolerance. Then F must keep all but that fraction of
    # the energy that this P can capture.
    goal = (1 - eps) * (1 if enough[-1, p] else captured[-1, p])
    f = first_enough(captured[:, p] >= goal) if order_f is None else order_f
    return Orders(f, p, eps, float(captured[f, p]))


def choose_center(brdf: Brdf, eps: float) -> tuple[Brdf, dict[Center, int]]:
    """Recenter a BRDF about the direction that needs the fewest coefficients (section 5.3.1).

    A BRDF that is central about the tangent keeps that centre.

    Returns `brdf`, the BRDF about the best centre; and `counts`, the number of coefficients that
    each centre would need. Centres about which the tolerance cannot be met are left out; if it can
    be met about none, the BRDF keeps its own.
    """
    candidates: list[Center] = ["reflection", "normal"]
    if brdf.center == "tangent":
        candidates = ["tangent"]
    counts: dict[Center, int] = {}
    for center in candidates:
        with suppress(OrderError, BrdfError):  # the BRDF may be too sharp about this centre
            found = choose_orders(brdf.recentered(center), eps)
            counts[center] = coefficient_count(*found)
    needs = {brdf.center: math.inf} | counts
    best = min(needs, key=lambda center: (needs[center], center != brdf.center))
    return brdf.recentered(best), counts


def coefficient_count(orders: Orders, coefficients: BrdfCoefficients) -> int:
    """Count the coefficients of the reflected light.

    Each harmonic of the view has a map of (F+1)^2 coefficients. There are (P+1)^2 such harmonics,
    or P + 1 for a BRDF that does not depend on the azimuth.
    """
    maps = orders.order_p + 1
    return (orders.order_f + 1) ** 2 * (maps if coefficients.azimuth_free else maps**2)


def first_enough(enough: NDArray[np.bool_]) -> int:
    """Return the first index that is enough, or the last index where none is."""
    return int(np.argmax(enough)) if enough.any() else len(enough) - 1


def coefficients_to(brdf: Brdf, eps: float, order_f: int, order_p: int) -> BrdfCoefficients:
    """Compute coefficients of a BRDF, or take them from the cache.

    `eps` is the fraction of the energy that may be missed, which sets the accuracy of sampling.
    """
    accuracy = max(eps / (30 if brdf.is_measured else 300), 1e-5)
    return cached_coefficients(brdf, order_f, order_p, accuracy, _computed)


def _computed(brdf: Brdf, order_f: int, order_p: int, accuracy: float) -> BrdfCoefficients:
    """Compute coefficients, by modules that whoever finds them in the cache goes without."""
    from shrm_cli.brdf.transfer import compute_coefficients

    return compute_coefficients(brdf, order_f, order_p, accuracy)


def _sufficient_coefficients(
    brdf: Brdf, eps: float, order_f: int, order_p: int, most_p: Callable[[int], int] | None
) -> BrdfCoefficients:
    """Compute coefficients to orders at which a tolerance is met, and at least to those given.

    Where the limits of the orders do not meet the tolerance, the coefficients reach the limits.
    """
    f = max(_first_order_f(brdf), order_f)
    p = 0 if brdf.zonal else max(_FIRST_ORDER_P, order_p)
    largest = MAX_ORDER_P
    while True:
        coefficients = coefficients_to(brdf, eps, f, p)
        total = coefficients.total_energy.sum()
        if total == 0:
            return coefficients
        missing = 1 - coefficients.captured[-1, -1]
        # Every try takes the time to sample the BRDF, and sharp lobes need many orders.
        octaves = octaves_to_come(coefficients, eps / 5)
        if octaves > 0 and f < MAX_ORDER_F and not _is_lost_to_p(coefficients, most_p):
            f = min(2**octaves * f, MAX_ORDER_F)
            continue
        if most_p is not None:
            known = np.cumsum(coefficients.degree_energy.sum(axis=-1))
            largest = most_p(first_enough(known >= (1 - eps) * known[-1]))
        if missing > eps and p < largest and not brdf.zonal:
            before = 1 - coefficients.captured[-1, p // 2]
            # Whoever misses too much even if that falls exponentially need not try twice the P.
            p = min((4 if missing**3 > eps * before**2 else 2) * p, largest)
        else:
            return coefficients


def _first_order_f(brdf: Brdf) -> int:
    """Return the order F to which coefficients are computed first."""
    if brdf.zonal or brdf.center != "reflection":
        return FIRST_ORDER_F
    return cached_first_order(brdf, _first_order)


def _first_order(brdf: Brdf) -> FirstOrder:
    """Find it by a module that whoever finds it in the cache goes without."""
    from shrm_cli.brdf.lobe_expansion import first_order_f

    return FirstOrder(first_order_f(brdf))


def _is_lost_to_p(coefficients: BrdfCoefficients, most_p: Callable[[int], int] | None) -> bool:
    """Tell whether the largest P allowed misses so much that no higher F is worth its time."""
    if most_p is None or coefficients.order_p < most_p(coefficients.order_f):
        return False
    by_degree = coefficients.degree_energy.sum(axis=-1)
    lost = by_degree.sum() - coefficients.captured[-1, -1] * coefficients.total_energy.sum()
    return bool(lost > _LOST * energy_above(by_degree))
