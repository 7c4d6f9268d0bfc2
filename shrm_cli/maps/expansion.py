"""Light and BRDF, expanded as far as a map of the two can show them.

The tolerance asks for orders F and P, and F decides the size of the cubes. The texels of a cube of
that size support several times F, and it costs no byte to use them. Maps therefore carry all orders
whose part of the reflected light is visible, so that no truncated series rings beside a lamp.
"""

from dataclasses import dataclass
from functools import cached_property

from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.coefficients import BrdfCoefficients
from shrm_cli.maps.size import largest_f, supported_order
from shrm_cli.orders import Orders, extended
from shrm_cli.probe.lighting import Lighting, Projection
from shrm_cli.reflected import (
    carried_order,
    energy_beyond,
    error_bound,
    filtering_error,
    predicted_error,
    reflected_rms,
)
from shrm_cli.vocabulary import MAX_ORDER_F, Sampling

_KNOWN = 0.75
"""The part of the computed orders beyond which nothing may be visible. What is visible at the end
of the coefficients goes on beyond them."""
_UNKNOWN = 0.02
"""The part of the predicted squared error that may be an estimate."""


@dataclass(frozen=True, eq=False)
class Expansion:
    """A BRDF and the light of a probe in the frequency domain, and the orders of their map.

    Attributes
    ----------
    brdf : Brdf
    orders : Orders
        The orders F and P that the tolerance asks for, or that were given.
    coefficients : BrdfCoefficients
        The coefficients of the BRDF, to at least the orders that are kept.
    lighting : Lighting
        The light, to at least the order of the coefficients.
    size : int
        Texels along a face's edge of the map.
    carried : int
        The largest order of the light that the map keeps, F or more.
    """

    brdf: Brdf
    orders: Orders
    coefficients: BrdfCoefficients
    lighting: Lighting
    size: int
    carried: int

    @cached_property
    def error(self) -> float:
        """The predicted relative RMS error of the reflected light; see `predicted_error`."""
        return predicted_error(self.lighting, self.coefficients, self.carried, self.orders.order_p)

    @property
    def remark(self) -> str | None:
        """What a user should know of the BRDF's sampling, in one line; None if it is as asked."""
        remark = self.coefficients.remark
        return None if remark is None else f"{self.brdf!r} is {remark}"

    @cached_property
    def estimated(self) -> float:
        """The energy of the reflected light that is only estimated, relative to all of it."""
        whole = reflected_rms(self.lighting, self.coefficients) ** 2
        return energy_beyond(self.lighting, self.coefficients) / whole if whole > 0 else 0.0

    def filter_error(self, sampling: Sampling = "center") -> float:
        """Predict the relative RMS error of bilinear filtering; see `filtering_error`."""
        orders = self.carried, self.orders.order_p
        return filtering_error(self.lighting, self.coefficients, *orders, self.size, sampling)

    @property
    def bound(self) -> float:
        """The conservative relative RMS error of eq. 5.19; see `error_bound`."""
        return error_bound(self.lighting, self.coefficients, self.carried, self.orders.order_p)


def carry(
    light: Projection,
    brdf: Brdf,
    orders: Orders,
    coefficients: BrdfCoefficients,
    size: int,
    is_exact: bool = False,
) -> Expansion:
    """Choose how far a map carries the light beyond F, and extend the coefficients as needed.

    Parameters
    ----------
    light : Projection
    brdf : Brdf
    orders : Orders
    coefficients : BrdfCoefficients
        The coefficients of the BRDF, to at least the orders.
    size : int
        Texels along a face's edge.
    is_exact : bool
        Whether to carry nothing beyond F.

    Raises
    ------
    ProbeError, BrdfError
        If the probe cannot be read, or the coefficients cannot be extended.
    """
    f, p = orders.order_f, orders.order_p
    limit = max(f, min(supported_order(size, p), largest_f(p), MAX_ORDER_F))
    lighting = light.to_order(max(coefficients.order_f, limit))
    while True:
        visible = carried_order(lighting, coefficients, f, p)
        carried = f if is_exact else min(visible, limit)
        made = Expansion(brdf, orders, coefficients, lighting, size, carried)
        known = coefficients.order_f
        is_known = is_exact or visible <= _KNOWN * known
        if known >= limit or (is_known and made.estimated <= _UNKNOWN * made.error**2):
            return made
        further = min(2 * known, limit)
        coefficients = extended(brdf, coefficients, orders.tolerance, further, light.progress)
