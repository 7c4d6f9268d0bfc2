"""Light and BRDF, expanded as far as a map of the two can show them, and how much of that is wrong.

The tolerance asks for orders F and P, and F decides the size of the cubes. The texels of a cube of
that size support several times F, and it costs no byte to use them. Maps therefore carry all orders
whose part of the reflected light is visible, and fade out where that is not possible, so that no
truncated series rings beside a lamp.

A relative RMS error under lamps is that of the lamps' reflections. What people see is how many
pixels are wrong. So the reflected light is computed with and without what the map leaves out, at
some central directions and for some views of each, and it is counted where the two differ. The
light of a map's error is that of the lobes' errors, so that one sum over both tells; see
`shrm_cli.maps.lobes_lit`.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache, cached_property, partial

import numpy as np

from shrm_cli.arrays import Array, Indices
from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.cache import remembered
from shrm_cli.brdf.coefficients import BrdfCoefficients
from shrm_cli.brdf.lobe_expansion import Expansion as Lobe
from shrm_cli.brdf.lobe_expansion import LobeExpander, light_rule
from shrm_cli.maps.base import Map
from shrm_cli.maps.lobes_lit import Lobes, lit, points, sample_views, together
from shrm_cli.maps.size import Band, furthest_order, largest_f, shrm_look_up_error, supported_order
from shrm_cli.orders import Orders, extended
from shrm_cli.probe.lighting import Lighting, Projection
from shrm_cli.records import record
from shrm_cli.reflected import (
    energy_beyond,
    error_bound,
    last_visible,
    predicted_error,
    reflected_rms,
    visible_beyond,
    visible_beyond_p,
    weighted_power,
)
from shrm_cli.sphere.directions import bisector
from shrm_cli.sphere.harmonics import degrees, legendre_table, order_of
from shrm_cli.sphere.quadrature import scrambled, spiral_directions
from shrm_cli.vocabulary import LUMINANCE, MAX_ORDER_F, SEEN_FLOOR, WRONG, Center, Sampling

_KNOWN = 0.75
"""The part of the computed orders beyond which nothing may be visible. What is visible at the end
of the coefficients goes on beyond them."""
_UNKNOWN = 0.02
"""The part of the predicted squared error that may be an estimate."""


@record(eq=False)
class Expansion:
    """A BRDF and the light of a probe in the frequency domain, and the orders of their map."""

    brdf: Brdf
    orders: Orders
    """The orders F and P that the tolerance asks for, or that were given."""
    coefficients: BrdfCoefficients
    """The coefficients of the BRDF, to at least the orders that are kept."""
    lighting: Lighting
    """The light, to at least the order of the coefficients."""
    size: int
    band: Band
    """The degrees of the light that the map keeps."""
    views: Band
    """The degrees of the view that it keeps, 0 to P."""

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

    `lighting` is the light, to at least the order of the coefficients. `order_f` and `order_p` are
    the orders F and P that the tolerance asks for.
    """
    beyond = visible_beyond(lighting, coefficients, order_p)
    limit = max(supported_order(size, order_p), order_f)
    furthest = max(furthest_order(size, order_p), order_f)
    most = max(largest_f(order_p), order_f)
    known = min(coefficients.order_f, lighting.resolved_order, most)
    return Band.of(beyond, limit, furthest, known, order_f)


def view_band(lighting: Lighting, coefficients: BrdfCoefficients, order_p: int) -> Band:
    """Choose how the degrees of the view end that a map has."""
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

    `coefficients` are the coefficients of the BRDF, to at least the orders. `is_exact` tells
    whether to carry nothing beyond F. `is_exact_view` tells whether to keep every degree of the
    view up to P as it is.
    """
    f, p = orders.order_f, orders.order_p
    most = min(largest_f(p), MAX_ORDER_F)
    wanted = max(f, min(supported_order(size, p), most))
    # Lobes that are the same for all views are known further in no time, and so is what is wrong.
    times = 2 if brdf.zonal else 1
    while True:
        lighting = light.to_order(max(coefficients.order_f, wanted))
        band = Band.exact(f) if is_exact else carried_band(lighting, coefficients, f, p, size)
        views = Band.exact(p) if is_exact_view else view_band(lighting, coefficients, p)
        made = Expansion(brdf, orders, coefficients, lighting, size, band, views)
        if band.fades:
            wanted = max(f, min(furthest_order(size, p), most))
        known = coefficients.order_f
        is_known = is_exact or band.last <= _KNOWN * known
        enough = min(times * wanted, MAX_ORDER_F)
        if known >= enough or (is_known and made.estimated <= _UNKNOWN * made.error**2):
            return made
        further = min(2 * known, enough)
        coefficients = extended(brdf, coefficients, orders.eps, further)


_MAX_Q = 6
"""The largest azimuthal order q of lobes. Hardly any energy lies beyond, whatever P is."""
_NODES = 60, 18
"""The least numbers of nodes in theta_i and phi at which lobes are sampled."""
_NODES_A_DEGREE, _ENOUGH = 1.5, 480
"""The least number of nodes in theta_i for each degree of the lobes, below which high degrees are
noise; and a number that is enough for any lobe, because nodes crowd where sharp lobes are."""
_MOST_SAMPLES = 2**19
"""The most samples of a BRDF at a time."""
_ACCURACY = 5e-4, 0.3
"""The part of the lobes' energy that their sampling may miss: at most this, and in units of the
squared error of the map. What it does miss is far less than what it is estimated to."""
_APART = 4
"""Of so many central directions one is looked up in a map, as light fields take seconds for all."""


def predicted_wrong_share(expansions: Sequence[Expansion]) -> float:
    """Predict the share of what is visible of an SHRM whose luminance is wrong by more than 5 %.

    `expansions` are light and BRDF, and the orders that the map keeps; for each term of a sum.

    Returns it in 0 .. 1, without the errors of filtering and of rounding.
    """
    if all(each.error == 0 for each in expansions):
        return 0.0
    return wrong_share(_light_of(expansions), [_lobes_of(each) for each in expansions])


def wrong_share(lighting: Lighting, lobes: Sequence[Lobes]) -> float:
    """Return the share of points whose luminance is wrong by more than `WRONG`, in 0 .. 1.

    `lighting` is the light, to at least the order of the lobes. `lobes` are those of each term;
    they reflect their light at the same points.
    """
    if not any(each.error.any() for each in lobes):
        return 0.0
    groups = together(lobes)
    whole, error = lit(lighting.coefficients * LUMINANCE, groups)
    lamps = lamps_beside.get()
    if lamps is None or not lamps.isotropic:
        return _share(lighting, groups, whole, error)
    shape = points(groups[0].center)[1].shape[:-1]
    whole, error = np.broadcast_to(whole, shape), np.broadcast_to(error, shape)
    at, shares = _some_points(shape)
    lit_by_lamps = lamps.lit_at(groups[0].center, at)
    floor = SEEN_FLOOR * _mean(lighting.coefficients[:1] + lamps.first, groups)
    limit = WRONG * np.maximum(whole[at] + lit_by_lamps, floor)
    known = [each.to_order(order_of(len(lamps.wrong))) for each in groups]
    wrong, _ = lit(lamps.wrong_to(known[0].order) * LUMINANCE, known)
    wrong = np.broadcast_to(wrong, shape)[at]
    return float((np.abs(error[at] + wrong) > limit).ravel() @ shares.ravel())


@record(eq=False)
class LampsBeside:
    """Lamps beside a map, whose light hides errors of the map, and has errors of its own."""

    flux: Array
    """The integral of their radiance, shape (3,)."""
    wrong: Array
    """The coefficients of what is wrong with it, and not in the map: true light less that of the
    lamps, (n, 3)."""
    radiance: Callable[[Array, Array], Array]
    """From normals and views to what is reflected of them, shape (..., 3)."""
    isotropic: bool = True
    """Whether the tangents of the points at which lobes are lit do not matter."""

    @property
    def first(self) -> Array:
        """Their light's coefficients of degree 0, shape (1, 3)."""
        return self.flux[None] / np.sqrt(4 * np.pi)

    @cached_property
    def _known(self) -> dict[Center, Array]:
        return {}

    def wrong_to(self, order: int) -> Array:
        """Return what is wrong to an order, as far as it is known.

        It fades out over an octave, as it would ring around all lamps otherwise.
        """
        result = np.zeros(((order + 1) ** 2, 3))
        known = self.wrong[: len(result)]
        degree = degrees(order_of(len(known)))
        part = np.maximum(2 * degree / (degree[-1] + 1) - 1, 0.0)
        result[: len(known)] = known * np.cos(np.pi / 2 * part)[:, None] ** 2
        return result

    def lit_at(self, center: Center, at: tuple[Indices, ...]) -> Array:
        """Return what lobes reflect of them at some of the points, in the units of lobes."""
        if center not in self._known:
            normals, views = np.broadcast_arrays(*points(center))
            normals, views = normals[at], views[at]
            self._known[center] = 2 * np.pi * self.radiance(normals, views) @ LUMINANCE
        return self._known[center]

    @cached_property
    def visible(self) -> Array:
        """The luminance of what is reflected of them at all `visible_pairs`, shape (n,)."""
        mirrored, views = visible_pairs()
        return self.radiance(bisector(mirrored, views), views) @ LUMINANCE


lamps_beside: ContextVar[LampsBeside | None] = ContextVar("lamps_beside", default=None)
"""The lamps together with which maps are judged, where there are any."""


@contextmanager
def beside_lamps(lamps: LampsBeside | None) -> Iterator[None]:
    """Count wrong and negative pixels of maps as they are seen together with lamps beside them."""
    token = lamps_beside.set(lamps)
    try:
        yield
    finally:
        lamps_beside.reset(token)


_PAIRS = 4096
"""The number of pairs of a mirror direction and a view that are looked at."""


@cache
def visible_pairs(count: int = _PAIRS) -> tuple[Array, Array]:
    """Return the mirror directions and the views, which are always the same; read-only."""
    directions = spiral_directions(count)
    views = directions[scrambled(count)]
    for each in (directions, views):
        each.setflags(write=False)
    return directions, views


def _some_points(shape: tuple[int, ...]) -> tuple[tuple[Indices, ...], Array]:
    """Return the indices of some of the sample points, and the share that each stands for.

    Lamps take long to integrate. Each direction has every third of the views, at one azimuth.
    """
    directions, views, azimuths = shape
    direction = np.arange(directions)[:, None]
    view = np.arange(views // 3) * 3 + direction % 3
    shares = sample_views("reflection", views)[1][view]
    return (direction, view, (direction + view) % azimuths), shares / float(shares.sum())


def shown_wrong_share(expansions: Sequence[Expansion], map_: Map) -> float | None:
    """Return the share of a map that was made from SHRMs, with the errors of its own form.

    `expansions` are light and BRDF, for each term of a sum. The radiance of `map_` is looked up at
    the sample points, exactly and not as on a GPU.

    Returns it in 0 .. 1, or None about the tangent, which normals and views do not tell.
    """
    groups = together(_lobes_of(each) for each in expansions)
    center = groups[0].center
    if center == "tangent":
        return None
    lighting = _light_of(expansions)
    whole, _ = lit(lighting.coefficients * LUMINANCE, groups)
    # Lobes are those of 2 pi times the BRDF.
    normals, views = (each[::_APART] for each in points(center))
    shown = 2 * np.pi * map_.radiance(normals, views) @ LUMINANCE
    return _share(lighting, groups, whole[::_APART], shown - whole[::_APART])


def map_wrong_share(expansions: Sequence[Expansion], map_: Map) -> float | None:
    """Return the share of an SHRM or of a sum of them; compression adds errors of its own."""
    if map_.info.added_error:
        return shown_wrong_share(expansions, map_)
    return predicted_wrong_share(expansions)


def _light_of(expansions: Sequence[Expansion]) -> Lighting:
    """Return the light that suffices for all terms."""
    return max((each.lighting for each in expansions), key=lambda each: each.order)


def _share(lighting: Lighting, groups: Sequence[Lobes], whole: Array, error: Array) -> float:
    """Return the share of points at which the error is too large."""
    limit = WRONG * np.maximum(whole, SEEN_FLOOR * _mean(lighting.coefficients[:1], groups))
    shares = sample_views(groups[0].center, error.shape[1])[1]
    return float((np.abs(error) > limit).mean(axis=(0, 2)) @ shares)


def _mean(first: Array, groups: Sequence[Lobes]) -> float:
    """Return the mean luminance of all pixels, for the light's coefficients of degree 0, (1, 3)."""
    # Only degree 0 has a mean over all central directions.
    light = first * LUMINANCE
    means = sum(each.whole[0, 0].real * light[0] for each in groups).sum(axis=-1)
    views = max(each.whole.shape[2] for each in groups)
    return float(np.sum(means * sample_views(groups[0].center, views)[1]))


def _lobes_of(expansion: Expansion) -> Lobes:
    """Return lobes and what an SHRM leaves out of them."""
    brdf, known = expansion.brdf, expansion.coefficients
    beyond = visible_beyond(expansion.lighting, known)
    order = last_visible(beyond)
    order_p = expansion.orders.order_p
    if brdf.zonal:  # the same lobe for all views
        angles: Array = np.zeros(1)
        whole = known.values[None, : order + 1, :1, 0] * np.sqrt(np.pi)
    else:
        angles, _ = sample_views(brdf.center)
        accuracy = min(_ACCURACY[0], _ACCURACY[1] * expansion.error**2)
        whole = _sampled(brdf, order, _MAX_Q, angles, accuracy)
    error = whole.copy()
    functions = 2 * np.pi * legendre_table(order_p, np.cos(angles))
    for q in range(min(order_p, len(whole) - 1) + 1):
        kept = expansion.kept[: order + 1, q:, q, : whole.shape[-1]]
        error[q, : len(kept)] -= np.einsum("lpc,po->loc", kept, functions[q, : order_p + 1 - q])
    light = weighted_power(expansion.lighting, order)
    return Lobes(whole, error, brdf.center).ended(beyond, light)


def _sampled(brdf: Brdf, order: int, max_q: int, angles: Array, accuracy: float) -> Array:
    """Sample lobes until they miss no more of the energy than allowed, or as finely as allowed."""
    count, azimuth_count = _NODES
    count = 12 * int(np.ceil(max(count, min(_NODES_A_DEGREE * order, _ENOUGH)) / 12))

    @cache
    def expander() -> LobeExpander:
        return LobeExpander(brdf, light_rule(brdf), order, max_q)

    def sample(nodes: int, azimuths: int) -> Lobe:
        return expander().expand(angles, nodes, azimuths)

    while True:
        what = "lobes", order, max_q, angles.tobytes(), count, azimuth_count
        found = remembered(brdf, what, partial(sample, count, azimuth_count))
        by_theta, by_phi = (
            each.sum() / max(found.energy.sum(), 1e-300)
            for each in (found.error_theta, found.error_phi)
        )
        finer = (
            count * (2 if by_theta > accuracy / 2 else 1),
            azimuth_count * (2 if by_phi > accuracy / 2 else 1),
        )
        if by_theta + by_phi <= accuracy or len(angles) * finer[0] * finer[1] > _MOST_SAMPLES:
            return found.values
        count, azimuth_count = finer
