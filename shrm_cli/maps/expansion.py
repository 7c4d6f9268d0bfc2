"""Light and BRDF, expanded as far as a map of the two can show them, and how much of that is wrong.

The tolerance asks for orders F and P, and F decides the size of the cubes. The texels of a cube of
that size support several times F, and it costs no byte to use them. Maps therefore carry all orders
whose part of the reflected light is visible, and fade out where that is not possible, so that no
truncated series rings beside a lamp.
"""

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np

from shrm_cli import reflected
from shrm_cli.arrays import Array, kept_order
from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.cache import cached_lobes
from shrm_cli.brdf.coefficients import BrdfCoefficients, ExpandedLobes
from shrm_cli.maps.base import Map
from shrm_cli.maps.lobes_lit import Lobes, judged, lit, together
from shrm_cli.maps.size import (
    Band,
    choose_size,
    furthest_order,
    largest_f,
    shrm_look_up_error,
    stored_bytes,
    supported_order,
    total_error,
)
from shrm_cli.maps.sphere_pixels import sample_views
from shrm_cli.maps.wrong_pixels import (
    LookUps,
    are_look_ups_seen,
    lamps_beside,
    share_of_points,
    wrong_share,
)
from shrm_cli.orders import Orders, coefficients_to
from shrm_cli.probe.lighting import Lighting, Projection
from shrm_cli.records import record
from shrm_cli.sphere.cube import bilinear_filtering
from shrm_cli.sphere.harmonics import legendre_table
from shrm_cli.vocabulary import LUMINANCE, MAX_ORDER_F, Sampling

_KNOWN = 0.75
"""The part of the computed orders beyond which nothing may be visible. What is visible at the end
of the coefficients goes on beyond them."""
_UNKNOWN = 0.02
"""The part of the predicted squared error that may be an estimate."""


@record(eq=False)
class Chosen:
    """A BRDF, and the orders and the size of its SHRM."""

    brdf: Brdf
    orders: Orders
    """The orders F and P that the tolerance asks for, or that were given."""
    coefficients: BrdfCoefficients
    """The coefficients of the BRDF, to at least the orders that are kept."""
    size: int

    @classmethod
    def of(cls, brdf: Brdf, found: tuple[Orders, BrdfCoefficients], size: int | None) -> "Chosen":
        """Choose the size by F where it is not given; orders are as `choose_orders` finds them."""
        return cls(brdf, *found, choose_size(found[0].order_f) if size is None else size)

    @property
    def bytes(self) -> int:
        """The bytes of its cubes in half precision, before they are packed."""
        return stored_bytes(self.size, (self.orders.order_p + 1) ** 2)

    @property
    def is_met(self) -> bool:
        """Whether the orders keep the tolerance, also where it is stated as what they miss."""
        return 1 - self.orders.captured <= self.orders.eps


@record(eq=False)
class Expansion(Chosen):
    """A BRDF and the light of a probe in the frequency domain, and the orders of their map."""

    lighting: Lighting
    """The light, to at least the order of the coefficients."""
    band: Band
    """The degrees of the light that the map keeps."""
    views: Band
    """The degrees of the view that it keeps, 0 to P."""
    sampling: Sampling = "center"

    @classmethod
    def known(
        cls, chosen: Chosen, lighting: Lighting, sampling: Sampling = "center"
    ) -> "Expansion":
        """Expand as far as coefficients are known and the size supports it, whatever F is."""
        form = chosen.brdf, chosen.orders, chosen.coefficients, chosen.size
        order_p = chosen.orders.order_p
        band = carried_band(lighting, chosen.coefficients, 0, order_p, chosen.size)
        views = view_band(lighting, chosen.coefficients, order_p)
        return cls(*form, lighting, band, views, sampling)

    @cached_property
    def error(self) -> float:
        """The predicted relative RMS error of the reflected light; see `predicted_error`."""
        return reflected.predicted_error(self.lighting, self.coefficients, *self._form)

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
        whole = reflected.reflected_rms(self.lighting, self.coefficients) ** 2
        return (
            reflected.energy_beyond(self.lighting, self.coefficients) / whole if whole > 0 else 0.0
        )

    @cached_property
    def filter_error(self) -> float:
        """The relative RMS error of bilinear look-ups, which takes far longer to be known."""
        form = self._factors, self.size, self.sampling
        return shrm_look_up_error(self.lighting, self.coefficients, *form)

    @property
    def least_error(self) -> float:
        return total_error(self.error)

    @cached_property
    def total_error(self) -> float:
        """The relative RMS error, with bilinear look-ups and half precision."""
        return total_error(self.error, self.filter_error)

    @property
    def bound(self) -> float:
        """The conservative relative RMS error of eq. 5.19; see `error_bound`."""
        return reflected.error_bound(self.lighting, self.coefficients, *self._form)

    @property
    def _form(self) -> tuple[int, int, Array]:
        """The largest l and p that are kept, and what each l and p is multiplied with."""
        return self.band.last, self.orders.order_p, self._factors

    @cached_property
    def _factors(self) -> Array:
        return np.outer(self.band.factors, self.views.factors)


def carried_band(
    lighting: Lighting, coefficients: BrdfCoefficients, order_f: int, order_p: int, size: int
) -> Band:
    """Choose the degrees of the light that a map carries.

    `lighting` is the light, to at least the order of the coefficients. `order_f` and `order_p` are
    the orders F and P that the tolerance asks for.
    """
    beyond = reflected.visible_beyond(lighting, coefficients, order_p)
    limit = max(supported_order(size, order_p), order_f)
    furthest = max(furthest_order(size, order_p), order_f)
    most = max(largest_f(order_p), order_f)
    known = min(coefficients.order_f, lighting.resolved_order, most)
    return Band.of(beyond, limit, furthest, known, order_f)


def view_band(lighting: Lighting, coefficients: BrdfCoefficients, order_p: int) -> Band:
    """Choose how the degrees of the view end that a map has."""
    return Band.of_views(reflected.visible_beyond_p(lighting, coefficients, order_p), order_p)


def carry(
    light: Projection,
    chosen: Chosen,
    is_exact: bool = False,
    is_exact_view: bool = False,
    sampling: Sampling = "center",
) -> Expansion:
    """Choose how far a map carries the light beyond F, and extend the coefficients as needed.

    `is_exact` tells whether to carry nothing beyond F. `is_exact_view` tells whether to keep every
    degree of the view up to P as it is.
    """
    brdf, orders, coefficients, size = chosen.brdf, chosen.orders, chosen.coefficients, chosen.size
    f, p = orders.order_f, orders.order_p
    most = min(largest_f(p), MAX_ORDER_F)
    wanted = max(f, min(supported_order(size, p), most))
    # Lobes that are the same for all views are known further in no time, and so is what is wrong.
    times = 2 if brdf.zonal else 1
    while True:
        lighting = light.to_order(max(coefficients.order_f, wanted))
        band = Band.exact(f) if is_exact else carried_band(lighting, coefficients, f, p, size)
        views = Band.exact(p) if is_exact_view else view_band(lighting, coefficients, p)
        made = Expansion(brdf, orders, coefficients, size, lighting, band, views, sampling)
        if band.fades:
            wanted = max(f, min(furthest_order(size, p), most))
        known = coefficients.order_f
        is_known = is_exact or band.last <= _KNOWN * known
        enough = min(times * wanted, MAX_ORDER_F)
        if known >= enough or (is_known and made.estimated <= _UNKNOWN * made.error**2):
            return made
        further = min(2 * known, enough)
        coefficients = coefficients_to(brdf, orders.eps, further, coefficients.order_p)


_MAX_Q = 6
"""The largest azimuthal order q of lobes, at least. Maps of a larger P have lobes of more orders,
as cloth does: in an interior 2.5 % of the pixels of `charlie` seemed wrong with P = 30, where 5.7 %
are, and 5.6 % with as many orders."""
_NODES = 60, 18
"""The least numbers of nodes in theta_i and phi at which lobes are sampled."""
_NODES_A_DEGREE = 1.5
"""The least number of nodes in theta_i for each degree of the lobes, and of those in phi, over half
a turn, for each azimuthal order. With fewer high degrees are noise. Nodes crowd where a lobe is
sharp, but some BRDFs are broad besides: with 480 nodes for 512 degrees of `coated`, 70 % of an
SHRM's pixels seemed wrong in an interior, and 34 % are."""
_MOST_SAMPLES = 2**19
"""The most samples of a BRDF at a time."""
_ACCURACY = 5e-4, 0.3
"""The part of the lobes' energy that their sampling may miss: at most this, and in units of the
squared error of the map. What it does miss is far less than what it is estimated to."""
_APART = 4
"""One of so many central directions is looked up in a map, as light fields take seconds for all."""


def predicted_wrong_share(expansions: Sequence[Expansion], made: Map | None = None) -> float:
    """Predict the share of what is visible of an SHRM whose luminance is wrong by more than 5 %.

    `expansions` are light and BRDF, and the orders that the map keeps; for each term of a sum.
    `made` is the map, whose look-ups count; without it nothing is lost by these.

    Returns it in 0 .. 1, without the errors of rounding.
    """
    is_exact = lamps_beside.get() is None and made is None
    if is_exact and all(each.error == 0 for each in expansions):
        return 0.0
    missed, held = zip(*(_lobes_of(each) for each in expansions), strict=True)
    look_ups = None if made is None else LookUps(made.shaded().brushed_radiance, held)
    return wrong_share(_light_of(expansions), missed, look_ups)


def shown_wrong_share(expansions: Sequence[Expansion], map_: Map) -> float:
    """Return the share of a map that was made from SHRMs, with the errors of its own form.

    `expansions` are light and BRDF, for each term of a sum. The radiance of `map_` is looked up at
    the sample points, as on a GPU.

    Returns it in 0 .. 1.
    """
    groups = together(_lobes_of(each)[0] for each in expansions)
    lighting = _light_of(expansions)
    whole, _ = lit(lighting.coefficients * LUMINANCE, groups)
    # Lobes are those of 2 pi times the BRDF.
    at = judged(groups)
    places = np.ix_(np.arange(0, len(whole), _APART), *map(np.arange, whole.shape[1:]))
    normals = np.broadcast_to(at.normals, at.views.shape)[places]
    points = normals, at.tangents(places), at.views[places]
    with bilinear_filtering():
        shown = 2 * np.pi * map_.shaded().brushed_radiance(*points) @ LUMINANCE
    return share_of_points(lighting, groups, whole[::_APART], shown - whole[::_APART], _APART)


def map_wrong_share(expansions: Sequence[Expansion], map_: Map) -> float:
    """Return the share of an SHRM or of a sum of them; compression adds errors of its own."""
    info = map_.info
    if info.added_error:
        return shown_wrong_share(expansions, map_)
    are_seen = are_look_ups_seen(info.predicted_error, info.filter_error)
    return predicted_wrong_share(expansions, map_ if are_seen else None)


def _light_of(expansions: Sequence[Expansion]) -> Lighting:
    """Return the light that suffices for all terms."""
    return max((each.lighting for each in expansions), key=lambda each: each.order)


def _lobes_of(expansion: Expansion) -> tuple[Lobes, Lobes]:
    """Return lobes with what an SHRM leaves out of them, and the lobes that it holds."""
    brdf, known = expansion.brdf, expansion.coefficients
    beyond = reflected.visible_beyond(expansion.lighting, known)
    order = reflected.last_visible(beyond)
    order_p = expansion.orders.order_p
    if brdf.zonal:  # the same lobe for all views
        angles: Array = np.zeros(1)
        whole = known.values[None, : order + 1, :1, 0] * np.sqrt(np.pi)
    else:
        angles, _ = sample_views(brdf.center)
        accuracy = min(_ACCURACY[0], _ACCURACY[1] * expansion.error**2)
        whole = _sampled(brdf, order, min(max(order_p, _MAX_Q), order), angles, accuracy)
    held = np.zeros_like(whole)
    functions = 2 * np.pi * legendre_table(order_p, np.cos(angles))
    for q in range(min(order_p, order) + 1):
        kept = expansion.kept[: order + 1, q:, q, : whole.shape[-1]]
        held[q, : len(kept)] = np.einsum("lpc,po->loc", kept, functions[q, : order_p + 1 - q])
    light = reflected.weighted_power(expansion.lighting, order)
    missed = Lobes(whole, whole - held, brdf.center).ended(beyond, light)
    return missed, Lobes(held, np.zeros_like(held), brdf.center)


def _sampled(brdf: Brdf, order: int, max_q: int, angles: Array, accuracy: float) -> Array:
    """Sample lobes until they miss no more of the energy than allowed, or as finely as allowed.

    Degrees to the `kept_order` are sampled, because probes that differ need some each.
    """
    least, least_azimuths = _NODES
    known = kept_order(order)
    count = 12 * int(np.ceil(max(least, _NODES_A_DEGREE * known) / 12))
    azimuth_count = 3 * int(np.ceil(max(least_azimuths, _NODES_A_DEGREE * max_q) / 3))
    while True:
        counts = count, azimuth_count
        found = cached_lobes(brdf, (known, max_q), counts, tuple(angles.tolist()), _expanded)
        by_theta, by_phi = (
            each.sum() / max(found.energy.sum(), 1e-300)
            for each in (found.error_theta, found.error_phi)
        )
        finer = (
            count * (2 if by_theta > accuracy / 2 else 1),
            azimuth_count * (2 if by_phi > accuracy / 2 else 1),
        )
        if by_theta + by_phi <= accuracy or len(angles) * finer[0] * finer[1] > _MOST_SAMPLES:
            return found.values[:, : order + 1]
        count, azimuth_count = finer


def _expanded(brdf: Brdf, *asked: Any) -> ExpandedLobes:
    """Expand lobes, by modules that whoever finds them in the cache goes without."""
    from shrm_cli.brdf.lobe_expansion import expand_lobes

    return expand_lobes(brdf, *asked)
