"""Brdf -> rho_hat_lq(theta_o): its lobes as harmonics of the light, as functions of the view.

With both directions in the local frame of the central direction C, whose z axis is C,

    2 pi rho_hat(w_i', w_o') =
        sum over l, q of rho_hat_lq(theta_o') conj(Y_lq(w_i')) exp(i q phi_o').

Expanding rho_hat_lq over theta_o gives the coefficients rho_hat_lpq, see
`shrm_cli.brdf.coefficients`. Equations 5.x are those of chapter 5 of Ramamoorthi's thesis, "A
Signal-Processing Framework for Forward and Inverse Rendering" (2002).
"""

import math
from dataclasses import field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from shrm_cli import progress
from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.coefficients import (
    BrdfCoefficients,
    ExpandedLobes,
    Sampled,
    both_signs,
    octaves_to_come,
    power_of_two_times,
)
from shrm_cli.brdf.lobe_expansion import (
    FINER,
    LobeExpander,
    Views,
    first_order_f,
    light_rule,
    lobe_width,
)
from shrm_cli.brdf.polar_rule import PolarRule, view_nodes
from shrm_cli.brdf.sums import Sum
from shrm_cli.errors import BrdfError
from shrm_cli.progress import Stages, in_order
from shrm_cli.records import record
from shrm_cli.sphere.harmonics import legendre_degrees, legendre_table
from shrm_cli.sphere.quadrature import colatitude_weights, nodes
from shrm_cli.vocabulary import MAX_ORDER_P

_MOST_SAMPLES = 2**25, 2**23
"""The most samples of a BRDF in all, of models and of measured ones, which take longer."""
_WORST = 0.02
"""The estimated error, as a part of the energy, up to which a model is accepted at the most
samples. Measured ones are accepted whatever it is: their noise is no fault of the sampling."""
_VIEWS = 48, 384
"""The fewest and the most nodes in theta_o."""
_RESOLVING = 0.042
"""The nodes in theta_o that are taken first, for an order and an accuracy of 1. Found by trial."""
_LIGHTS = 48, 12288
"""The fewest and the most nodes in theta_i."""
_AZIMUTHS = 12, 3072
"""The fewest and the most nodes over half a turn in phi."""
_SINGLE = 5e-5
"""The accuracy from which on BRDFs are evaluated in single precision, which has a part of 1e-13 of
the energy for its rounding errors."""
_ROUNDING = 1e-24, 1e-12
"""The part of the energy that is taken for rounding errors, in double and in single precision."""
_ZONAL_NODES = 2**7, 2**15
"""The fewest and the most nodes for a zonal BRDF."""
_ZONAL_VIEWS = 12
_VIEWS_AT_ONCE = 8
"""The most views that a thread expands together."""
_COMMON = 10.0
"""The accuracy over what terms of a sum may have beyond the degrees to which they are known."""
_LARGE = 2**17
"""The number of samples above which several threads are worth their start."""
_SCALE = 1000
"""The number of steps in which progress is reported."""


@record(eq=False)
class TransferFunctions(Sampled):
    """The lobes of a BRDF for all views, as harmonics of the light about the central direction."""

    values: Array
    """rho_hat_lq(theta_o) for q >= 0, indexed [q, l, node, channel]: ``2 pi`` times the integral
    over the light of ``rho_hat f_lq(theta_i) cos(q phi)``, for views at azimuth 0, shape (max_q+1,
    F+1, n, 3). It is zero where q > l, and the same for -q. Then ``rho_hat_lpq = sum over nodes of
    weights f_pq(theta_o) values``. They are of 32 bits where the lobes were sampled in single
    precision."""
    theta_o: Array
    weights: Array
    """`theta_o` and `weights`: the angles of the views from C, radians, ascending, and weights for
    the integral over ``sin(theta_o) dtheta_o``, shape (n,). They are dense where views graze the
    surface."""
    total_energy: Array
    """``2 pi int int int rho_hat^2 sin(theta_i) sin(theta_o) dtheta_i dtheta_o dphi`` of each
    channel, the right side of eq. 5.18, shape (3,)."""
    samples: tuple[int, int, int]
    """The largest numbers of nodes in theta_i, theta_o and phi (over half a turn)."""
    accuracy: float
    """The part of the energy that the sampling is estimated to miss."""
    asked: float
    """The accuracy that was asked for."""
    azimuths: Array = field(default_factory=lambda: np.zeros(0))
    """Of an anisotropic BRDF the azimuths of the views from the tangent; see
    `shrm_cli.brdf.brushed_transfer`, shape (n,). Empty for an isotropic one."""

    def __post_init__(self) -> None:
        count = len(self.theta_o)
        if self.values.ndim != 4 or self.values.shape[2:] != (count, 3):
            raise ValueError(f"transfer functions of shape {self.values.shape}")
        if self.weights.shape != (count,) or self.total_energy.shape != (3,):
            raise ValueError("weights or energies of another shape")

    @property
    def order_f(self) -> int:
        return self.values.shape[1] - 1

    @property
    def max_q(self) -> int:
        return self.values.shape[0] - 1

    @cached_property
    def degree_energy(self) -> Array:
        """The energy of each l, with azimuthal orders up to max_q but every p: shape (F+1, 3).

        The functions of theta_o are complete in p, and their squares integrate to 1 / (2 pi), so
        that the energy over all p is an integral over theta_o.
        """
        squares = np.einsum("qloc,qloc,o->qlc", self.values, self.values, self.weights)
        return np.asarray(np.tensordot(both_signs(self.max_q), squares, 1) / (2 * np.pi))

    @cached_property
    def spread(self) -> Array:
        """How energy of unknown azimuthal orders is spread over l, (F+1, 3), in proportions.

        It is that of the next order, if that falls from the last one as the last one fell.
        """
        last = np.einsum("loc,loc,o->lc", self.values[-1], self.values[-1], self.weights)
        if self.max_q == 0:
            return last
        before = np.einsum("loc,loc,o->lc", self.values[-2], self.values[-2], self.weights)
        return last * np.minimum(last / np.maximum(before, 1e-300), 1.0)

    def projected(self, order_p: int) -> Array:
        """rho_hat_lpq up to the order P, shape (F+1, P+1, P+1, 3), indexed [l, p, q, channel]."""
        return _projected(self.values, self.theta_o, self.weights, order_p)


def compute_transfer(
    brdf: Brdf, order_f: int, max_q: int, accuracy: float = 1e-5
) -> TransferFunctions:
    """Compute the transfer functions of a BRDF by quadrature, sampled until they have converged.

    The lobe of each view is integrated on a grid of its own, in polar coordinates about C, whose
    nodes crowd about C as much as the lobe does. A third of the same samples gives a coarser
    result, and the difference of both an estimate of the error. The numbers of nodes in theta_i
    and in phi are doubled for the views, and that in theta_o for all of them, whose error is too
    large. The error is the energy of the difference, or the difference of the energies.

    A zonal BRDF needs only one integral over the cosine of the angle, for which Fejer's rule is
    exact where the BRDF is a polynomial; the rule is doubled until nothing changes at all.

    `order_f` and `max_q` are the largest l and q. `accuracy` is the fraction of the energy that the
    sampling may miss.

    Where the samples were not enough for the accuracy, as with noise and kinks of measured data,
    the result tells the accuracy that they reached.
    """
    if not brdf.isotropic:
        raise BrdfError(
            f"{brdf!r}: anisotropic, which this representation cannot hold; take `to` principal"
        )
    if brdf.zonal:
        return _zonal_transfer(brdf, order_f, max_q, accuracy)
    # So many nodes in theta_o tell all p up to the largest q apart.
    found = LobeSampling(brdf, order_f, max_q, accuracy).result(6 * (max_q + 1))
    _refuse_unresolved(brdf, found.accuracy, accuracy, found.samples)
    return found


def _refuse_unresolved(
    brdf: Brdf, reached: float, asked: float, samples: tuple[int, int, int]
) -> None:
    """Raise an error if a model is missed by too much, as sharp lobes about the normal are."""
    if reached > max(_WORST, asked) and not brdf.is_measured:
        raise BrdfError(
            f"{brdf!r}: its coefficients have not converged at {samples} samples; "
            "make it smoother or the tolerance larger"
        )


class LobeSampling:
    """The search for numbers of nodes that suffice, as `compute_transfer` describes it."""

    def __init__(
        self, brdf: Brdf, order_f: int, max_q: int, accuracy: float, share: int = 1
    ) -> None:
        self.brdf, self.accuracy = brdf, accuracy
        self.order_f, self.max_q = order_f, max_q
        self.center = brdf.center
        rule = light_rule(brdf)
        self._is_single = bool(brdf.is_measured or accuracy >= _SINGLE)
        self._expander = LobeExpander(brdf, rule, order_f, max_q, self._is_single)
        self._budget = _MOST_SAMPLES[brdf.is_measured] // share
        # A sharp lobe that lies elsewhere than about C must not fall between the nodes.
        cells = 0 if brdf.center == "reflection" else 6 / lobe_width(brdf)
        # Where nodes are even, or noise has all frequencies, too few of them would alias.
        per_order = 1.5 if rule.focus == 1 or brdf.is_measured else 0.5
        azimuths = max(_AZIMUTHS[0], 3 * (max_q + 1))
        while True:
            self._first = (
                power_of_two_times(_LIGHTS[0], max(per_order * order_f, cells), _LIGHTS[1]),
                power_of_two_times(azimuths, cells, _AZIMUTHS[1]),
            )
            if cells < _LIGHTS[0] or _VIEWS[0] * np.prod(self._first) <= self._budget // 8:
                break
            cells /= 2  # the first sampling shall leave the most for others

    def result(self, least: int = 0, azimuth: float = 0.0) -> TransferFunctions:
        """Sample the lobes for views of one azimuth, with so many nodes in theta_o at least."""
        self._azimuth, self._shown, self._spent = azimuth, 0, 0
        # The rule in theta_o converges with the square of the step at least, and the energies of
        # high degrees change the faster with theta_o. To begin anew would take twice the time.
        resolving = 6 * math.ceil(_RESOLVING * math.sqrt(self.order_f / self.accuracy) / 6)
        count = max(_VIEWS[0], min(resolving, _VIEWS[1] // 2), least)
        views = Views(*view_nodes(self.center, count), self._first)
        while True:
            self._sample(views)
            error = self._view_error(views)
            missing = error + np.sum(views.weights @ views.errors)
            cost = 2 * int(np.sum(views.levels.prod(axis=1)))
            is_enough = missing <= self.accuracy * views.total().sum()
            if is_enough or 2 * count > _VIEWS[1] or self._spent + cost > self._budget:
                break
            count *= 2
            views = views.refined(*view_nodes(self.center, count))
        total = views.total()
        reached = float(missing / total.sum()) if total.sum() > 0 else 0.0
        lights, phis = (int(n) for n in views.levels.max(axis=0))
        values = _without_rounding(views.values, _ROUNDING[self._is_single])
        if self._is_single:  # as they were sampled, so that this loses nothing
            values = values.astype(np.float32)
        return TransferFunctions(
            of_channels(values), views.theta_o, views.weights,
            np.array(np.broadcast_to(total, 3)), (lights, count, phis), reached, self.accuracy,
        )  # fmt: skip

    def _sample(self, views: Views) -> None:
        """Expand the lobes of all views. Every third view tells the others where to begin."""
        thirds = np.arange(1, len(views.theta_o), 3)
        others = np.setdiff1d(np.arange(len(views.theta_o)), thirds)
        self._refine(views, thirds, self._spent + (self._budget - self._spent) // 4)
        reached = 3 * views.weights[thirds] @ views.errors[thirds].sum(axis=1)
        lights, phis = (int(n) for n in views.levels[thirds].max(axis=0))
        if views.known_energy() > 0:
            # That saves the other two thirds of the time that a refusal takes.
            reached = float(reached / views.known_energy())
            _refuse_unresolved(
                self.brdf, reached, self.accuracy, (lights, len(views.theta_o), phis)
            )
        views.begin_beside(others, thirds)
        self._refine(views, others, self._budget)

    def _refine(self, views: Views, which: NDArray[np.intp], budget: int) -> None:
        """Expand the lobes of some views, and again with more nodes where that is needed."""
        while len(which):
            self._expand(views, which)
            # All views together may miss a third of the accuracy in each angle, all to equal parts.
            limit = self.accuracy / 3 * views.known_energy() / len(views.weights)
            missing = views.weights[which, None] * views.errors[which]
            finer = np.where(missing > limit, 2, 1) * views.levels[which]
            finer = np.minimum(finer, (_LIGHTS[1], _AZIMUTHS[1]))
            changed = (finer != views.levels[which]).any(axis=1)
            # The largest errors come first where not all views can be refined.
            order = np.argsort(-missing.sum(axis=1), kind="stable")
            order = order[changed[order]]
            affordable = np.cumsum(finer[order].prod(axis=1)) <= budget - self._spent
            chosen = np.sort(order[affordable])
            views.levels[which[chosen]] = finer[chosen]
            which = which[chosen]

    def _expand(self, views: Views, which: NDArray[np.intp]) -> None:
        pending = int(np.sum(views.levels[which].prod(axis=1)))
        for count in np.unique(views.levels[which, 0]):
            # Views of the same number of nodes in theta_i share a large table.
            self._expander.prepare(int(count))
            jobs = _blocks(views.levels, which[views.levels[which, 0] == count])

            def expanded(block: NDArray[np.intp]) -> ExpandedLobes:
                lights, azimuths = (int(n) for n in views.levels[block[0]])
                return self._expander.expand(views.theta_o[block], lights, azimuths, self._azimuth)

            is_large = sum(views.levels[block].prod(axis=1).sum() for block in jobs) > _LARGE
            for block, found in zip(jobs, in_order(expanded, jobs, is_large), strict=True):
                views.put(block, found)
                size = int(views.levels[block].prod(axis=1).sum())
                self._spent, pending = self._spent + size, pending - size
                self._show(self._spent / (self._spent + pending + 1))

    def _show(self, part: float) -> None:
        # Refinements come as a surprise, so that the estimate is held rather than turned back.
        self._shown = max(self._shown, int(part * (_SCALE - 1)))
        progress.report(self._shown, _SCALE)

    def _view_error(self, views: Views) -> float:
        """The energy that the rule in theta_o is estimated to miss."""
        third = slice(1, None, 3)
        coarse_theta, coarse_weights = view_nodes(self.center, len(views.theta_o) // 3)
        order_p = min(max(_VIEWS[0] // 6 - 1, self.max_q), len(views.theta_o) // 6 - 1)
        change = 0.0
        # Of anisotropic BRDFs the sines come behind the cosines.
        for values in np.split(views.values, len(views.values) // (self.max_q + 1)):
            fine = _projected(values, views.theta_o, views.weights, order_p)
            coarse = _projected(values[:, :, third], coarse_theta, coarse_weights, order_p)
            change += float(np.sum((fine - coarse) ** 2 * both_signs(order_p)[:, None]))
        signs = both_signs(len(views.values) - 1)
        by_degree = np.einsum("q,qloc->loc", signs, views.values**2) / (2 * np.pi)
        degrees = views.weights @ by_degree - coarse_weights @ by_degree[:, third]
        energy = views.total() - coarse_weights @ views.energy[third]
        return float(
            max(change / FINER**2, np.abs(degrees).sum() / FINER, np.abs(energy).sum() / FINER)
        )


def _blocks(levels: NDArray[np.integer], which: NDArray[np.intp]) -> list[NDArray[np.intp]]:
    """Split views into blocks that have the same numbers of nodes, and few views each."""
    blocks = []
    for level in np.unique(levels[which], axis=0):
        same = which[(levels[which] == level).all(axis=1)]
        blocks += np.array_split(same, -(-len(same) // _VIEWS_AT_ONCE))
    return blocks


def _projected(values: Array, theta_o: Array, weights: Array, order_p: int) -> Array:
    """Expand functions of theta_o, [q, l, node, channel], into harmonics: [l, p, q, channel]."""
    functions = legendre_table(order_p, np.cos(theta_o)) * weights
    result = np.zeros((values.shape[1], order_p + 1, order_p + 1, values.shape[3]))
    for q in range(min(len(values), order_p + 1)):
        result[q:, q:, q] = functions[q, : order_p + 1 - q] @ values[q, q:]
    return result


def of_channels(values: Array) -> Array:
    """Give transfer functions, [..., channel], three channels, which share the memory of one."""
    return np.broadcast_to(values, (*values.shape[:-1], 3))


def _without_rounding(values: Array, rounding: float) -> Array:
    """Set the azimuthal orders that hold no more than a part of the energy to exactly 0."""
    energy = np.sum(values**2, axis=(1, 2, 3))
    nothing = energy <= rounding * energy.sum()
    return np.where(nothing[:, None, None, None], 0.0, values)


def _zonal_transfer(brdf: Brdf, order_f: int, max_q: int, accuracy: float) -> TransferFunctions:
    """The transfer functions of a zonal BRDF, which are the same for all views, and 0 for q > 0.

    With rho_hat = u(C.L) and the normalized Legendre functions f_l0 they are
    ``2 pi 2 pi int u(z) f_l0(z) dz``.
    """
    least, most = _ZONAL_NODES
    count = max(least, 2 * order_f)
    lobe, energy = _zonal_integrals(brdf, order_f, count)
    while count < most:
        finer, energy_finer = _zonal_integrals(brdf, order_f, 2 * count)
        count *= 2
        change = np.sum((finer - lobe) ** 2) / np.pi, abs(energy_finer.sum() - energy.sum())
        lobe, energy = finer, energy_finer
        if max(change) <= 1e-14 * energy.sum():
            break
    theta_o, weights = PolarRule().nodes(_ZONAL_VIEWS)
    values = np.zeros((max_q + 1, order_f + 1, len(theta_o), 3))
    values[0] = lobe[:, None]
    return TransferFunctions(values, theta_o, weights, energy, (count, 1, 1), 0.0, accuracy)


def _zonal_integrals(brdf: Brdf, order_f: int, count: int) -> tuple[Array, Array]:
    """The integrals of `_zonal_transfer`, (F+1, 3), and the energy, (3,), with `count` nodes."""
    z = (np.cos((nodes(count) + 1) * (np.pi / 2)) + 1) / 2
    weights = colatitude_weights(count) / 2
    sine = np.sqrt(1 - z**2)
    light = np.stack([sine, np.zeros_like(z), z], axis=-1)
    lobe = brdf.transfer(light, np.array([0.0, 0.0, 1.0]))
    values = np.empty((order_f + 1, 3))
    for degree, legendre in legendre_degrees(order_f, z, max_m=0):
        values[degree] = 4 * np.pi**2 * (legendre[0] * weights) @ lobe
    return values, 8 * np.pi**2 * weights @ lobe**2


def compute_coefficients(
    brdf: Brdf, order_f: int, order_p: int, accuracy: float = 1e-5
) -> BrdfCoefficients:
    """Compute coefficients of a BRDF by quadrature (eq. 5.22), sampled until they have converged.

    They are those of `compute_transfer`, expanded over theta_o.

    `order_f` and `order_p` are the largest l and p. A zonal BRDF has p = 0 only, whatever `order_p`
    is.
    """
    order_p = 0 if brdf.zonal else order_p
    if isinstance(brdf, Sum):
        return _summed(brdf, order_f, order_p, accuracy)
    transfer = compute_transfer(brdf, order_f, order_p, accuracy)
    return BrdfCoefficients.of(transfer, order_p, brdf.zonal)


def _summed(brdf: Sum, order_f: int, order_p: int, accuracy: float) -> BrdfCoefficients:
    """Add the coefficients of the terms of a sum about its own center.

    Each term is sampled as its own lobe wants it, and to the degrees that it has. The whole would
    want the nodes that are densest among them everywhere: a sharp lobe on a diffuse base takes four
    times as long.

    The energy of a sum is that of its terms and twice what each pair of them has in common, which
    is a sum of products of coefficients. It is counted up to the largest p that maps have, and for
    the q that are known; terms that both have much beyond are alike, and sharp.
    """
    total, by_degree = np.zeros(3), np.zeros((order_f + 1, 3))
    added = np.zeros((order_f + 1, MAX_ORDER_P + 1, MAX_ORDER_P + 1, 3))
    signs, missed, samples = both_signs(MAX_ORDER_P)[:, None], 0.0, []
    stages = Stages(progress.current(), len(brdf.terms))
    for number, (weight, term) in enumerate(brdf.terms, 1):
        term = term.recentered(brdf.center)
        with progress.using(stages.within):
            each = _to_its_degrees(term, order_f, order_p, accuracy)
        stages.done(number, len(brdf.terms))
        projected = np.zeros_like(added)
        known = 1 if term.zonal else MAX_ORDER_P + 1  # few views tell all of a zonal lobe
        degrees = slice(each.order_f + 1)
        projected[degrees, :known, :known] = weight * each.projected(known - 1)
        shared = 2 * np.sum(added * projected * signs, axis=(1, 2))
        added += projected
        by_degree[degrees] += weight**2 * each.degree_energy
        by_degree += shared
        total += weight**2 * each.total_energy + shared.sum(axis=0)
        missed += weight * np.sqrt(each.accuracy * each.total_energy.sum())
        samples.append(each.samples)
    values = added[:, : order_p + 1, : order_p + 1]
    lights, views, azimuths = (max(counts) for counts in zip(*samples, strict=True))
    reached = float(missed**2 / total.sum()) if total.sum() > 0 else 0.0
    return BrdfCoefficients(
        values.copy(), total, by_degree, (lights, views, azimuths), reached, accuracy
    )


def _to_its_degrees(term: Brdf, order_f: int, order_p: int, accuracy: float) -> TransferFunctions:
    """The transfer functions of a term of a sum, to the degrees that it has, up to an order F.

    A wide lobe has nothing at most degrees of a sharp one, and took most of the time there. Its
    order is raised until no more than a part of the accuracy lies beyond it: a part, because what
    it has there in common with other terms is missed, too.
    """
    order = first_order_f(term)
    while True:
        order = min(order, order_f)
        found = compute_transfer(term, order, order_p, accuracy)
        octaves = octaves_to_come(found, accuracy / _COMMON)
        if order == order_f or octaves == 0:
            return found
        order *= 2**octaves
