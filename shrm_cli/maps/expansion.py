"""Light and BRDF, expanded as far as a map of the two can show them.

The tolerance asks for orders F and P, and F decides the size of the cubes. The texels of a cube of
that size support several times F, and it costs no byte to use them. Maps therefore carry all orders
whose part of the reflected light is visible, and fade out where that is not possible, so that no
truncated series rings beside a lamp.
"""

from functools import cached_property

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.coefficients import BrdfCoefficients
from shrm_cli.maps.size import Band, furthest_order, largest_f, shrm_look_up_error, supported_order
from shrm_cli.orders import Orders, extended
from shrm_cli.probe.lighting import Lighting, Projection
from shrm_cli.records import record
from shrm_cli.reflected import (
    energy_beyond,
    error_bound,
    predicted_error,
    reflected_rms,
    visible_beyond,
    visible_beyond_p,
)
from shrm_cli.vocabulary import MAX_ORDER_F, Sampling

_KNOWN = 0.75
"""The part of the computed orders beyond which nothing may be visible. What is visible at the end
of the coefficients goes on beyond them."""
_UNKNOWN = 0.02
"""The part of the predicted squared error that may be an estimate."""


@record(eq=False)
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
    band : Band
        The degrees of the light that the map keeps.
    views : Band
        The degrees of the view that it keeps, 0 to P.
    """

    brdf: Brdf
    orders: Orders
    coefficients: BrdfCoefficients
    lighting: Lighting
    size: int
    band: Band
    views: Band

    @cached_property
    def error(self) -> float:
        """The predicted relative RMS error of the reflected light; see `predicted_error`."""
        return predicted_error(
            self.lighting, self.coefficients, *self._orders, factors=self._factors
        )

    @property
    def carried(self) -> int:
        """The largest order of the light that the map keeps, F or more."""
        return max(self.band.last, self.orders.order_f)

    @cached_property
    def kept(self) -> Array:
        """The coefficients of the BRDF as the map has them, to the last degree and to P."""
        values = self.coefficients.truncated(self.band.last, self.orders.order_p)
        return values * self._factors[..., None, None]

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
        """Return the relative RMS error of bilinear look-ups; see `shrm_look_up_error`."""
        form = self.orders.order_p, self.size, sampling
        return shrm_look_up_error(self.lighting, self.coefficients, self._factors, *form)

    @property
    def bound(self) -> float:
        """The conservative relative RMS error of eq. 5.19; see `error_bound`."""
        return error_bound(self.lighting, self.coefficients, *self._orders, factors=self._factors)

    @property
    def _orders(self) -> tuple[int, int]:
        return self.band.last, self.orders.order_p

    @cached_property
    def _factors(self) -> Array:
        return np.outer(self.band.factors, self.views.factors)


def carried_band(
    lighting: Lighting, coefficients: BrdfCoefficients, order_f: int, order_p: int, size: int
) -> Band:
    """Choose the degrees of the light that a map carries.

    Parameters
    ----------
    lighting : Lighting
        The light, to at least the order of the coefficients.
    coefficients : BrdfCoefficients
    order_f, order_p : int
        The orders F and P that the tolerance asks for.
    size : int
        Texels along a face's edge of the map.
    """
    beyond = visible_beyond(lighting, coefficients, order_p)
    limit = max(supported_order(size, order_p), order_f)
    furthest = max(furthest_order(size, order_p), order_f)
    most = max(largest_f(order_p), order_f)
    known = min(coefficients.order_f, lighting.resolved_order, most)
    return Band.of(beyond, limit, furthest, known, order_f)


def view_band(lighting: Lighting, coefficients: BrdfCoefficients, order_p: int) -> Band:
    """Choose how the degrees of the view end that a map has.

    Parameters
    ----------
    lighting : Lighting
        The light, to at least the order of the coefficients.
    coefficients : BrdfCoefficients
    order_p : int
        The order P of the map.
    """
    return Band.of_views(visible_beyond_p(lighting, coefficients, order_p), order_p)


def carry(
    light: Projection,
    brdf: Brdf,
    orders: Orders,
    coefficients: BrdfCoefficients,
    size: int,
    is_exact: bool = False,
    is_exact_view: bool = False,
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
    is_exact_view : bool
        Whether to keep every degree of the view up to P as it is.

    Raises
    ------
    ProbeError, BrdfError
        If the probe cannot be read, or the coefficients cannot be extended.
    """
    f, p = orders.order_f, orders.order_p
    most = min(largest_f(p), MAX_ORDER_F)
    wanted = max(f, min(supported_order(size, p), most))
    while True:
        lighting = light.to_order(max(coefficients.order_f, wanted))
        band = Band.exact(f) if is_exact else carried_band(lighting, coefficients, f, p, size)
        views = Band.exact(p) if is_exact_view else view_band(lighting, coefficients, p)
        made = Expansion(brdf, orders, coefficients, lighting, size, band, views)
        if band.fades:
            wanted = max(f, min(furthest_order(size, p), most))
        known = coefficients.order_f
        is_known = is_exact or band.last <= _KNOWN * known
        if known >= wanted or (is_known and made.estimated <= _UNKNOWN * made.error**2):
            return made
        further = min(2 * known, wanted)
        coefficients = extended(brdf, coefficients, orders.eps, further)
