"""The best SHRM within a number of bytes.

Where the orders that a tolerance asks for make a file that is too large, there are two ways to a
smaller one: a lower order P, and smaller cubes. Both are errors of the reflected light, which are
known before the map is made, so that the best pair of the two can be chosen.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.coefficients import BrdfCoefficients
from shrm_cli.errors import ArgumentError
from shrm_cli.maps.size import choose_size, most_cubes, stored_bytes, supported_order
from shrm_cli.orders import Orders, choose_orders, least_orders
from shrm_cli.probe.lighting import Lighting, Projection
from shrm_cli.reflected import filtering_error, predicted_error
from shrm_cli.vocabulary import MAX_ORDER_P, Sampling

_SMALLEST = 16
"""The smallest cube that is tried, texels along a face's edge."""


@dataclass(frozen=True)
class Choice:
    """The orders and the size of an SHRM, and what they cost.

    Attributes
    ----------
    orders : Orders
    size : int
        Texels along a face's edge.
    """

    orders: Orders
    size: int

    @property
    def bytes(self) -> int:
        """The bytes of its cubes in half precision, before they are packed."""
        return stored_bytes(self.size, (self.orders.order_p + 1) ** 2)


def most_order_p(max_size: int, size: int | None = None) -> Callable[[int], int]:
    """Return a function that tells the largest P whose map fits, for an order F.

    Cubes of half the size that F asks for are counted with, because a map may be worth that.

    Parameters
    ----------
    max_size : int
        The most bytes of the map.
    size : int, optional
        Texels along a face's edge, where they are given.
    """

    def most(order_f: int) -> int:
        texels = max(choose_size(order_f) // 2, _SMALLEST) if size is None else size
        return _largest_p(most_cubes(texels, max_size))

    return most


def affordable(
    light: Projection,
    brdf: Brdf,
    tolerance: float,
    max_size: int,
    size: int | None = None,
    sampling: Sampling = "center",
) -> tuple[Choice, BrdfCoefficients]:
    """Choose the orders and the size of a map: those that a tolerance asks for, if they fit.

    Parameters
    ----------
    light : Projection
    brdf : Brdf
    tolerance : float
        The fraction of the BRDF's energy that may be missed.
    max_size : int
        The most bytes of the map.
    size : int, optional
        Texels along a face's edge, where they are given.
    sampling : {"center", "border"}

    Returns
    -------
    choice : Choice
    coefficients : BrdfCoefficients
        The coefficients of the BRDF, to at least the orders of the choice.

    Raises
    ------
    ArgumentError
        If no map fits.
    OrderError, BrdfError, ProbeError
        If the tolerance is none, or the BRDF or the probe cannot be used.
    """
    orders, coefficients = choose_orders(brdf, tolerance, most_p=most_order_p(max_size, size))
    choice = Choice(orders, choose_size(orders.order_f) if size is None else size)
    if orders.captured >= 1 - tolerance and choice.bytes <= max_size:
        return choice, coefficients
    lighting = light.to_order(coefficients.order_f)
    return fitting(coefficients, lighting, tolerance, max_size, size, sampling), coefficients


def fitting(
    coefficients: BrdfCoefficients,
    lighting: Lighting,
    tolerance: float,
    max_size: int,
    size: int | None = None,
    sampling: Sampling = "center",
) -> Choice:
    """Choose the orders and the size of the best map that fits.

    Parameters
    ----------
    coefficients : BrdfCoefficients
    lighting : Lighting
        The light, to at least the order of the coefficients.
    tolerance : float
        The fraction of the BRDF's energy that may be missed.
    max_size : int
        The most bytes of the map.
    size : int, optional
        Texels along a face's edge, where they are given.
    sampling : {"center", "border"}

    Raises
    ------
    ArgumentError
        If not even P = 0 fits.
    """
    largest = choose_size(least_orders(coefficients, tolerance).order_f)
    sizes = [2**k for k in range(int(np.log2(_SMALLEST)), int(np.log2(largest)) + 1)]
    found: list[tuple[float, int, Choice]] = []
    for texels in sizes if size is None else [size]:
        p = min(_largest_p(most_cubes(texels, max_size)), coefficients.order_p)
        if p < 0:
            continue
        carried = min(supported_order(texels), coefficients.order_f)
        error = np.hypot(
            predicted_error(lighting, coefficients, carried, p),
            filtering_error(lighting, coefficients, carried, p, texels, sampling),
        )
        orders = least_orders(coefficients, tolerance, order_p=p)
        orders = replace(orders, order_f=min(orders.order_f, carried))
        made = Choice(orders, texels)
        found.append((float(error), made.bytes, made))
    if not found:
        least = stored_bytes(_SMALLEST if size is None else size, 1)
        raise ArgumentError("max_size", f"is too small: the least map takes {least:,} bytes")
    return min(found, key=lambda each: each[:2])[2]


def _largest_p(cubes: int) -> int:
    """Return the largest P with at most so many harmonics of the view; -1 where there is none."""
    return min(math.isqrt(cubes) - 1, MAX_ORDER_P)
