"""Lobes of a BRDF for given views, expanded into harmonics of the light about C; their errors."""

from collections import OrderedDict

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array
from shrm_cli.brdf import polar_rule
from shrm_cli.brdf.base import Brdf, check_finite
from shrm_cli.brdf.coefficients import FIRST_ORDER_F, ExpandedLobes, both_signs, power_of_two_times
from shrm_cli.progress import at_once
from shrm_cli.records import record
from shrm_cli.sphere.directions import from_angles, tilted_frame, turned
from shrm_cli.sphere.harmonics import legendre_table
from shrm_cli.vocabulary import MAX_ORDER_F

SHARP = 0.5
"""The width of a lobe, radians, above which the nodes in theta_i are spread evenly."""
_RADII = 1e-4, 3.1, 120
"""The least and the largest angle from the mirror direction in `lobe_width`, and their number."""
_WAVES_A_LOBE = 4.0
"""Few lobes have enough with an F below this over their width in radians. Most need more."""
_SCOUTS = 0.1, 0.3, 0.5, 0.7, 0.85, 0.95
"""The angles of the views in `lobe_width`, as parts of the way from the normal to the horizon."""
_TABLE_BYTES = 200 * 2**20
"""The most that tables of Legendre functions take together; the last one is kept in any case."""
_NODES_AT_ONCE = 3 * 2**6
"""The nodes for which Legendre functions are computed together: a multiple of 3."""
_LARGE = 2**18
"""The values of Legendre functions above which several threads are worth their start."""
_LEAST_COSINE, _SQUEEZE = 1e-3, 0.5
"""Near grazing, azimuths crowd as this power of the cosine of the view's angle from the normal.

A sharp lobe is an ellipse there, with that cosine as the ratio of its axes. Its root shares the
trouble with the angle theta_i."""
FINER = 8.0
"""How often the error of a rule goes into its difference to the rule with a third of its nodes.

It is 8 for the second order of convergence, which kinks and the horizon have; smooth integrands
converge much faster.
"""


def light_rule(brdf: Brdf) -> polar_rule.PolarRule | polar_rule.SplitRule:
    """The rule for the angle of the light from C that suits a BRDF."""
    if brdf.center == "normal":
        return polar_rule.SplitRule(below=not brdf.has_horizon and brdf.includes_cosine)
    width = lobe_width(brdf)
    return polar_rule.PolarRule(width if brdf.center == "reflection" and width < SHARP else 1.0)


def first_order_f(brdf: Brdf) -> int:
    """The order F to which a BRDF is expanded first.

    A try that does not suffice is time lost, which for sharp measured lobes is several seconds.
    """
    if brdf.zonal or brdf.center != "reflection":
        return FIRST_ORDER_F
    return power_of_two_times(FIRST_ORDER_F, _WAVES_A_LOBE / lobe_width(brdf), MAX_ORDER_F)


def lobe_width(brdf: Brdf) -> float:
    """The angle from the mirror direction within which half of a BRDF's energy lies, radians.

    It is found from few samples, and tells how dense nodes must be. For a BRDF about the tangent
    it is 1, because its lobes are cones. Of an anisotropic BRDF it is the least.
    """
    if brdf.center == "tangent":
        return 1.0
    return min(width_for(brdf, azimuth) for azimuth in view_azimuths(brdf))


def view_azimuths(brdf: Brdf) -> tuple[float, ...]:
    """Azimuths of views, radians, that stand for all: along the tangent and across it."""
    return (0.0,) if brdf.isotropic else (0.0, np.pi / 2)


def width_for(brdf: Brdf, azimuth: float) -> float:
    """The `lobe_width` for views of one azimuth."""
    radius = np.geomspace(*_RADII)
    views = np.pi / 2 * np.array(_SCOUTS)
    squares = squared_lobes(brdf, radius, polar_rule.azimuths(12), views, azimuth)[1].sum(axis=2)
    return _half_within(radius, squares @ np.sin(2 * views))


def axis_widths(brdf: Brdf) -> tuple[float, float]:
    """The `lobe_width` along the tangent and across it, for the view along the normal."""
    radius, axes = np.geomspace(*_RADII), np.array([0.0, np.pi / 2])
    along, across = squared_lobes(brdf, radius, axes, np.zeros(1), 0.0)[1][:, 0].T
    return _half_within(radius, along), _half_within(radius, across)


def _half_within(radius: Array, squares: Array) -> float:
    """The one of even ratios of radii within which half of the energy of squares (n,) lies."""
    inside = np.cumsum(squares * np.sin(radius) * radius)
    return float(radius[np.searchsorted(inside, inside[-1] / 2)]) if inside[-1] > 0 else 1.0


def squared_lobes(
    brdf: Brdf, theta: Array, phi: Array, from_normal: Array, azimuth: float
) -> tuple[Array, Array]:
    """Sample the squares of lobes about the mirror direction.

    `theta`, of shape (i,), and `phi`, of shape (p,), are angles of the light about the mirror
    direction, radians; azimuth 0 is towards the view. `from_normal`, of shape (o,), holds angles of
    the views from the normal, radians. `azimuth` is that of the views from the tangent, radians.

    Returns `light` of shape (i, o, p, 3), its directions in the frame of the BRDF; and `squares`
    of shape (i, o, p), ``rho_hat^2``, its channels added.
    """
    # The mirror direction is tilted from the normal towards -X, the view towards +X.
    light = tilted_frame(from_angles(theta[:, None], phi)[:, None], from_normal[:, None])
    light = turned(light, azimuth)
    view = from_angles(from_normal, azimuth)[None, :, None]
    return light, np.sum(brdf.transfer(light, view) ** 2, axis=-1)


def expand_lobes(
    brdf: Brdf, order_f: int, max_q: int, counts: tuple[int, int], angles: tuple[float, ...]
) -> ExpandedLobes:
    """Expand the lobes of a BRDF for views at angles from C, radians.

    `order_f` and `max_q` are the largest l and q. `counts` are the numbers of nodes in theta_i and
    phi; see `LobeExpander.expand`.
    """
    expander = LobeExpander(brdf, light_rule(brdf), order_f, max_q)
    return expander.expand(np.array(angles), *counts)


class LobeExpander:
    """Expands lobes of one BRDF, to fixed orders, at whatever numbers of nodes.

    `rule` is the rule for the angle of the light from C. `order_f` and `max_q` are the largest l
    and q. `is_single` tells whether the BRDF is evaluated in single precision.
    """

    def __init__(
        self,
        brdf: Brdf,
        rule: polar_rule.PolarRule | polar_rule.SplitRule,
        order_f: int,
        max_q: int,
        is_single: bool = False,
    ) -> None:
        self.brdf, self.rule, self.order_f, self.max_q = brdf, rule, order_f, max_q
        self._is_single = is_single
        self._tables: OrderedDict[int, tuple[Array, Array]] = OrderedDict()
        self._orders = np.arange(max_q + 1)
        if not brdf.isotropic:  # cosines, then sines
            self._orders = np.tile(self._orders, 2)
        self._sign = both_signs(len(self._orders) - 1)

    def expand(
        self, theta_o: Array, count: int, azimuth_count: int, azimuth: float = 0.0
    ) -> ExpandedLobes:
        """Expand the lobes for views at angles from C.

        `theta_o`, of shape (n,), is in radians. `count` and `azimuth_count` are the numbers of
        nodes in theta_i and, over half a turn, in phi: multiples of 3. `azimuth` is that of the
        views from the tangent of an anisotropic BRDF, radians.
        """
        weights, coarse_weights = (self.rule.nodes(n)[1] for n in (count, count // 3))
        # phi runs over half a circle, and its mirror image doubles that; the other 2 pi is the
        # factor of eq. 5.22 of Ramamoorthi's thesis.
        phi, phi_weights = polar_rule.squeezed_azimuths(azimuth_count, self._squeeze(theta_o))
        if not self.brdf.isotropic:  # its mirror image is not the same
            phi, phi_weights = np.hstack([phi, -phi]), np.hstack([phi_weights, phi_weights]) / 2
        phi_weights = _with_thirds(4 * np.pi * phi_weights[..., None])
        waves = (phi_weights[..., None] * self._waves(phi)[:, :, None]).reshape(*phi.shape, -1)
        sums: _Sums | None = None
        for rows, samples, coverage in polar_rule.transfer_samples(
            self.brdf, self.rule, count, theta_o, phi, self._is_single, azimuth
        ):
            if samples.strides[-1] == 0:
                samples = samples[..., :1]
            if sums is None:
                sums = _Sums.zeros(count, len(theta_o), samples.shape[-1], len(self._orders))
                waves = waves.astype(samples.dtype)
                phi_weights = phi_weights.astype(samples.dtype)
            for channel in range(samples.shape[-1]):
                values = np.ascontiguousarray(samples[..., channel])
                sums.add(rows, channel, values, coverage, waves, phi_weights)
        assert sums is not None
        energy = np.tensordot(weights, sums.squares, 1)
        energies = energy[..., 0], np.tensordot(coarse_weights, sums.coarse_squares, 1)
        check_finite(energies[0].sum() + energies[1].sum(), self.brdf)
        table, coarse_table = self._table(count)
        values = self._projected(table, sums.waved[..., : len(self._orders)])
        by_theta = values - self._projected(coarse_table, sums.coarse)
        # By Parseval all l together have the energy of the integral over theta_i.
        thin = sums.waved[..., len(self._orders) :]
        by_phi = np.einsum("i,ivcq,q->v", weights, thin**2, self._sign) / (2 * np.pi)
        by_theta = np.einsum("q,qlvc->v", self._sign, by_theta**2)
        return ExpandedLobes(
            values,
            energies[0],
            _error(by_theta / (2 * np.pi), energies[0] - energies[1]),
            _error(by_phi / (2 * np.pi), energy[..., 1]),
        )

    def _waves(self, phi: Array) -> Array:
        """What the lobes are integrated with at azimuths (n, azimuths): (n, azimuths, waves)."""
        angles = phi[..., None] * self._orders[: self.max_q + 1]
        if self.brdf.isotropic:
            return np.cos(angles)
        return np.concatenate([np.cos(angles), np.sin(angles)], axis=-1)

    def _squeeze(self, theta_o: Array) -> Array:
        """How far azimuths crowd for each view; 1 where the lobe is wide, or not about C."""
        if self.rule.focus == 1:
            return np.ones_like(theta_o)
        return np.maximum(np.cos(theta_o / 2), _LEAST_COSINE) ** _SQUEEZE

    def _projected(self, table: Array, samples: Array) -> Array:
        """Integrate over theta_i, with Legendre functions: shape (waves, F+1, n, channels)."""
        count, views, channels, _ = samples.shape
        by_q = np.moveaxis(samples.astype(table.dtype, copy=False), -1, 0)
        by_q = by_q.reshape(-1, count, views * channels)
        result = np.zeros((len(self._orders), self.order_f + 1, views * channels))
        for wave, q in enumerate(self._orders):
            if q <= self.order_f:
                result[wave, q:] = table[q, : self.order_f + 1 - q] @ np.ascontiguousarray(
                    by_q[wave]
                )
        return result.reshape(len(self._orders), self.order_f + 1, views, channels)

    def prepare(self, count: int) -> None:
        """Make the table for a number of nodes in theta_i; no `expand` may run meanwhile.

        Calls of `expand` with that number may then run at the same time.
        """
        if count in self._tables:
            self._tables.move_to_end(count)
            return
        theta, weights = self.rule.nodes(count)
        coarse_weights = self.rule.nodes(count // 3)[1]
        shape = self.max_q + 1, self.order_f + 1
        # Sums of single samples are no more exact for factors in double precision.
        dtype = np.float32 if self._is_single else np.float64
        functions: Array = np.empty((*shape, count), dtype)
        coarse: Array = np.empty((*shape, count // 3), dtype)

        def fill(start: int) -> None:
            rows = slice(start, start + _NODES_AT_ONCE)
            thirds = slice(start // 3, (start + _NODES_AT_ONCE) // 3)
            table = legendre_table(self.order_f, np.cos(theta[rows]), max_m=self.max_q)
            coarse[..., thirds] = table[..., 1::3] * coarse_weights[thirds]
            functions[..., rows] = table * weights[rows]

        at_once(fill, range(0, count, _NODES_AT_ONCE), functions.size > _LARGE)
        self._tables[count] = functions, coarse
        kept = sum(part.nbytes for pair in self._tables.values() for part in pair)
        while len(self._tables) > 1 and kept > _TABLE_BYTES:
            kept -= sum(part.nbytes for part in self._tables.popitem(last=False)[1])

    def _table(self, count: int) -> tuple[Array, Array]:
        """Legendre functions [q, l - q, node] times weights, of all nodes and of every third."""
        if count not in self._tables:
            self.prepare(count)
        return self._tables[count]


def _error(squares: Array, energy: Array) -> Array:
    """The energy that a rule misses of each view, from its differences to the coarser rule.

    `squares`, of shape (n,), are the energy of the difference of both results. `energy`, of shape
    (n, channels), is the difference of their energies.
    """
    return np.asarray(np.maximum(squares / FINER**2, np.abs(energy).sum(axis=1) / FINER))


def _with_thirds(weights: Array) -> Array:
    """Add to weights [view, azimuth, 1] what changes if only every third azimuth counts."""
    thirds = -weights
    thirds[:, 1::3] += 3 * weights[:, 1::3]
    return np.append(weights, thirds, axis=2)


_DOUBLED = 3.0
"""How often the error of a rule goes into its difference to the rule with half of its nodes.

It is 3 for the second order of convergence, as `FINER` is 8."""


class Views:
    """The lobes of the views at all nodes of theta_o, as far as they are known.

    `levels`, of shape (n, 2), are the numbers of nodes in theta_i and phi. `values` and `energy`,
    of shapes (max_q+1, F+1, n, channels) and (n, channels), are as `ExpandedLobes` has them.
    `errors`, of shape (n, 2), is the energy that the rules in theta_i and phi are estimated to
    miss.
    """

    def __init__(self, theta_o: Array, weights: Array, levels: object) -> None:
        self.theta_o, self.weights = theta_o, weights
        self.levels = np.array(np.broadcast_to(np.array(levels), (len(theta_o), 2)))
        self.values, self.energy = np.zeros((0, 0, 0, 0)), np.zeros((0, 0))
        self.errors = np.full((len(theta_o), 2), np.inf)
        self._sampled = np.zeros_like(self.levels)  # the levels of what is known; 0: nothing is
        self._trust = np.ones((len(theta_o), 2))  # the errors, as parts of a third's estimates

    def put(self, which: NDArray[np.intp], found: ExpandedLobes) -> None:
        """Keep what was found for some of the views, at their levels.

        A rule that was doubled errs no more than its change tells, and one that was not doubled no
        more than before. A third of the nodes may be too few for the highest degrees, and then
        tells far more than the rule itself errs. By how much, a view tells those beside it.
        """
        if not self.values.size:
            orders, channels = found.values.shape[:2], found.values.shape[3]
            self.values = np.zeros((*orders, len(self.theta_o), channels))
            self.energy = np.zeros((len(self.theta_o), channels))
        estimate = np.stack([found.error_theta, found.error_phi], axis=-1)
        is_doubled = self.levels[which] > self._sampled[which]
        least = np.where(is_doubled, self._change(which, found)[:, None], self.errors[which])
        self.errors[which] = np.minimum(estimate * self._trust[which], least)
        self._trust[which] = self.errors[which] / np.maximum(estimate, 1e-300)
        self.values[:, :, which], self.energy[which] = found.values, found.energy
        self._sampled[which] = self.levels[which]

    def _change(self, which: NDArray[np.intp], found: ExpandedLobes) -> Array:
        """The energy that views still miss, from their change by doubling; shape (views,)."""
        signs = both_signs(len(found.values) - 1)
        squares = np.empty((len(which), len(found.values)))
        for k, view in enumerate(which):
            change = found.values[:, :, k] - self.values[:, :, view]
            squares[k] = np.einsum("qlc,qlc->q", change, change)
        by_values = squares @ signs / (2 * np.pi)
        by_energy = np.abs(found.energy - self.energy[which]).sum(axis=1)
        error = np.maximum(by_values / _DOUBLED**2, by_energy / _DOUBLED)
        return np.where(self._sampled[which, 0] > 0, error, np.inf)

    def known_energy(self) -> float:
        """The energy of all views and channels, as far as they tell that are known."""
        known = np.isfinite(self.errors[:, 0])
        weights = self.weights[known]
        return float(2 * (weights @ self.energy[known].sum(axis=1)) / weights.sum())

    def total(self) -> Array:
        """The energy of all views, shape (channels,)."""
        return self.weights @ self.energy

    def refined(self, theta_o: Array, weights: Array) -> "Views":
        """Other nodes of theta_o, of which none is known, that begin as those beside them ended."""
        after = np.clip(np.searchsorted(self.theta_o, theta_o), 1, len(self.theta_o) - 1)
        result = Views(theta_o, weights, self.levels[0])
        result._begin(np.arange(len(theta_o)), self, after - 1, after)
        return result

    def begin_beside(self, which: NDArray[np.intp], known: NDArray[np.intp]) -> None:
        """Let some views begin as the known ones beside them ended."""
        at = np.searchsorted(known, which)
        self._begin(
            which, self, known[np.maximum(at - 1, 0)], known[np.minimum(at, len(known) - 1)]
        )

    def _begin(
        self,
        which: NDArray[np.intp],
        others: "Views",
        before: NDArray[np.intp],
        after: NDArray[np.intp],
    ) -> None:
        """Take over levels, and what estimates are worth, from the views on both sides."""
        self.levels[which] = np.maximum(others.levels[before], others.levels[after])
        self._trust[which] = np.maximum(others._trust[before], others._trust[after])


@record(eq=False)
class _Sums:
    """Integrals of samples over the azimuth, as far as they are known; 0 elsewhere.

    The second half of the last axis of `waved` and `squares` is what changes if only every third
    azimuth counts.
    """

    waved: Array
    """The integrals with waves, at all nodes of theta_i, shape (count, n, channels, 2
    (max_q+1))."""
    coarse: Array
    """Those of the rule with a third of the nodes in theta_i, shape (count / 3, n, channels,
    max_q+1)."""
    squares: Array
    """The integrals of the squares, shape (count, n, channels, 2)."""
    coarse_squares: Array
    """Shape (count / 3, n, channels)."""

    @classmethod
    def zeros(cls, count: int, views: int, channels: int, waves: int) -> "_Sums":
        return cls(
            np.zeros((count, views, channels, 2 * waves)),
            np.zeros((count // 3, views, channels, waves)),
            np.zeros((count, views, channels, 2)),
            np.zeros((count // 3, views, channels)),
        )

    def add(
        self,
        rows: slice,
        channel: int,
        values: Array,
        coverage: Array | None,
        waves: Array,
        phi_weights: Array,
    ) -> None:
        """Integrate samples [row, view, azimuth] with waves and weights [view, azimuth, ...]."""
        thirds = slice(rows.start // 3, rows.stop // 3)
        covered = values if coverage is None else values * coverage
        waved, squares = _integrated(covered, waves), _integrated(covered * values, phi_weights)
        self.waved[rows, :, channel], self.squares[rows, :, channel] = waved, squares
        if coverage is None:
            self.coarse[thirds, :, channel] = waved[1::3, :, : self.coarse.shape[-1]]
            self.coarse_squares[thirds, :, channel] = squares[1::3, :, 0]
            return
        middle, part = polar_rule.every_third(values, coverage)
        covered = middle * part
        waves, phi_weights = waves[..., : self.coarse.shape[-1]], phi_weights[..., :1]
        self.coarse[thirds, :, channel] = _integrated(covered, waves)
        squares = _integrated(covered * middle, phi_weights)
        self.coarse_squares[thirds, :, channel] = squares[..., 0]


def _integrated(samples: Array, weights: Array) -> Array:
    """Integrate samples [row, view, azimuth] with [view, azimuth, k]: [row, view, k]."""
    return np.swapaxes(np.swapaxes(samples, 0, 1) @ weights, 0, 1)
