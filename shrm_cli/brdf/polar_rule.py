"""Quadrature over angles from the central direction C, and samples of BRDFs at its nodes.

Nodes are where BRDFs need them. All rules here are Fejer's first rule in a parameter s, whose nodes
are the middles of equal cells over 0 .. pi, after a substitution theta(s) that is odd about both
ends. An integrand that is a smooth function on the sphere stays one, so the rules keep their
exponential convergence.

Every third node of a rule is the rule with a third of the nodes. The samples of one rule thus give
a second, coarser integral, from which its error is estimated.
"""

import math
from collections.abc import Iterator
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array, slices
from shrm_cli.brdf.base import Brdf
from shrm_cli.records import record
from shrm_cli.sphere.directions import from_angles, tilted_frame, turned
from shrm_cli.sphere.quadrature import colatitude_weights, nodes
from shrm_cli.vocabulary import Center

_EVEN = 0.35
"""The share of the nodes of a focused rule that is spread evenly over all angles."""
_TOWARDS_GRAZING = 0.25
"""The focus of the views about the mirror direction, at the side where they graze."""
_ITERATIONS = 60
"""Halvings of an interval, after which nothing is left of it."""
_SAMPLES_AT_ONCE = 2**15
"""Arrays of so many samples stay in the processor's cache."""
_ROUNDING = 1e-6
"""The part of a cell below the horizon that is none."""
_INSIDE = 1 - 1e-9
"""The part of the way to the horizon at which the value beside it is taken."""


@record
class PolarRule:
    """Nodes in the angle theta from C, of which a part crowds within some distance from C.

    The parameter is ``s(theta) = e theta + (1 - e) 2 atan(tan(theta / 2) / focus)``, with the part
    e of the nodes that is even. The other part is even after a Moebius transform of the sphere.
    """

    focus: float = 1.0
    """The angle from C, radians, within which about a third of the nodes lie; 1 spreads all of them
    evenly over the angle."""

    def parameter(self, theta: ArrayLike) -> Array:
        """The parameter s of angles theta, both in 0 .. pi."""
        theta = np.asarray(theta, dtype=float)
        if self.focus == 1:
            return theta
        moebius = 2 * np.arctan2(np.sin(theta / 2), self.focus * np.cos(theta / 2))
        return np.asarray(_EVEN * theta + (1 - _EVEN) * moebius)

    def nodes(self, count: int) -> tuple[Array, Array]:
        """Angles theta, ascending, and weights for integrals over ``sin(theta) dtheta``.

        Returns `theta` and `weights`, each of shape (count,). The weights sum to 2, up to the
        rule's error.
        """
        s, weights = azimuths(count), colatitude_weights(count)
        if self.focus == 1:
            return s, weights
        theta = _crowded_angles(self, count)
        half = theta / 2
        narrow = self.focus / (self.focus**2 * np.cos(half) ** 2 + np.sin(half) ** 2)
        return theta, weights * np.sin(theta) / (np.sin(s) * (_EVEN + (1 - _EVEN) * narrow))


@record
class SplitRule:
    """Nodes above the horizon about the normal, where BRDFs jump or bend, and maybe below it.

    Each side has Fejer's rule over the cosine, of which the nodes are dense at both ends. The
    parameter s has ``cos(theta) = (1 + cos(s)) / 2`` above the horizon.
    """

    below: bool = False
    """Whether half of the nodes are below the horizon."""
    focus: float = 1.0

    def parameter(self, theta: ArrayLike) -> Array:
        """The parameter s of angles theta, which scaled to 0 .. pi counts nodes."""
        cosine = np.cos(np.asarray(theta, dtype=float))
        s = np.arccos(np.clip(2 * np.abs(cosine) - 1, -1.0, 1.0))
        if not self.below:
            return np.asarray(np.where(cosine >= 0, s, np.pi))
        return np.asarray(np.where(cosine >= 0, s, 2 * np.pi - s) / 2)

    def nodes(self, count: int) -> tuple[Array, Array]:
        """Angles theta, ascending, and weights for integrals over ``sin(theta) dtheta``.

        `count` is even, if nodes are below the horizon.
        """
        each = count // 2 if self.below else count
        cosine, weights = (1 + np.cos(azimuths(each))) / 2, colatitude_weights(each) / 2
        above = np.arccos(cosine)
        if not self.below:
            return above, weights
        return np.append(above, np.pi - above[::-1]), np.append(weights, weights[::-1])


@lru_cache(8)
def view_nodes(center: Center, count: int) -> tuple[Array, Array]:
    """Nodes in the angle theta_o of the view from C, dense where views graze the surface.

    About the mirror direction that is at theta_o = pi. About the normal it is at pi / 2, where
    BRDFs may jump, so each of both sides has a rule of its own. Fibres have no such place.

    `count` is a multiple of 6.

    Returns `theta_o` and `weights`, each of shape (count,), ascending angles in radians, and
    weights for integrals over ``sin(theta_o) dtheta_o``, which sum to 2. Every third node is a node
    of the rule for ``count / 3``.
    """
    if center == "tangent":
        return PolarRule().nodes(count)
    if center == "reflection":
        theta, weights = PolarRule(_TOWARDS_GRAZING).nodes(count)
        return np.pi - theta[::-1], weights[::-1]
    return SplitRule(below=True).nodes(count)


def azimuths(count: int) -> Array:
    """The middles of equal cells over half a turn, radians."""
    return (nodes(count) + 1) * (np.pi / 2)


def squeezed_azimuths(count: int, squeeze: Array) -> tuple[Array, Array]:
    """Azimuths that crowd about 0 and pi, by a substitution that keeps smooth functions smooth.

    With ``tan(phi) = squeeze tan(s)`` they are even in s. That is the azimuth on an ellipse, which
    lobes are where their light grazes.

    `squeeze`, of shape (n,), is in (0, 1]; 1 leaves the azimuths even.

    Returns `phi` and `weights`, each of shape (n, count), radians over half a turn, and weights for
    integrals over dphi, which sum to pi up to the rule's error. Every third is a node of the rule
    for ``count / 3``.
    """
    s, squeeze = azimuths(count), squeeze[:, None]
    across, along = squeeze * np.sin(s), np.cos(s)
    return np.arctan2(across, along), np.pi / count * squeeze / (along**2 + across**2)


@lru_cache(16)
def _crowded_angles(rule: PolarRule, count: int) -> Array:
    """The angles of a focused rule's nodes, by halving intervals; `parameter` ascends."""
    s = azimuths(count)
    low, high = np.zeros_like(s), np.full_like(s, np.pi)
    for _ in range(_ITERATIONS):
        middle = (low + high) / 2
        below = rule.parameter(middle) < s
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return (low + high) / 2


def transfer_samples(
    brdf: Brdf,
    rule: PolarRule | SplitRule,
    count: int,
    theta_o: Array,
    phi: Array,
    is_single: bool = False,
    azimuth: float = 0.0,
) -> Iterator[tuple[slice, Array, Array | None]]:
    """Sample rho_hat on a grid of angles about C, a block of theta_i at a time.

    The horizon N.L = 0 cuts through cells in theta_i. Such a cell counts by the part of it that
    is above the horizon, and if its own sample lies below, it takes the value at the horizon. So
    the integral of a model that jumps at the horizon converges with the square of the cell's
    size, not with the size.

    `rule` is the rule for the angle theta_i of the light from C. `count` is the number of nodes in
    theta_i. `theta_o`, of shape (n,), holds angles of the views from C, radians. `phi`, of shape
    (n, azimuths), holds azimuths of the light from the plane of each view, radians. `is_single`
    tells whether single precision suffices, in which most BRDFs take half the time. Tables of
    measured ones are no more exact than that. `azimuth` is that of the views from the tangent of
    an anisotropic BRDF, radians.

    Yields the slice of theta_i that the block holds, which begins and ends at multiples of 3 nodes,
    or at the last node. Of a BRDF with a horizon no block holds the nodes that are below it for all
    views and azimuths. With it come the samples of rho_hat, shape (block, n, azimuths, 3), and the
    coverage, shape (block, n, azimuths): the part of each cell that lies above the horizon, 0 .. 1,
    or None where all cells do.
    """
    theta_i = rule.nodes(count)[0]
    # About the mirror direction the normal is half way between C and the view.
    tilt = theta_o / 2 if brdf.center == "reflection" else np.zeros_like(theta_o)
    dtype = np.float32 if is_single or brdf.is_measured else np.float64
    view: Array = from_angles(theta_o - tilt, azimuth)[None, :, None].astype(dtype)
    horizon = np.pi / 2 + np.arctan(np.tan(tilt)[:, None] * np.cos(phi))
    ends = rule.parameter(horizon) * (count / np.pi)  # in cells
    last = min(count, 3 * math.ceil(ends.max() / 3)) if brdf.has_horizon else count
    step = 3 * max(1, _SAMPLES_AT_ONCE // (3 * phi.size))
    for rows in slices(last, step):
        cells = np.arange(rows.start, rows.stop)[:, None, None]
        light = _lights(theta_i[rows], phi, tilt, azimuth, dtype)
        if not brdf.has_horizon or rows.stop <= ends.min() + _ROUNDING:
            yield rows, brdf.transfer(light, view), None
            continue
        coverage = np.clip(ends - cells, 0.0, 1.0).astype(dtype, copy=False)
        cut = np.nonzero((coverage > 0) & (coverage <= 0.5))
        edge = from_angles(horizon[cut[1:]] * _INSIDE, phi[cut[1:]])
        light[cut] = turned(tilted_frame(edge, tilt[cut[1]]), azimuth)
        yield rows, brdf.transfer(light, view), coverage


def _lights(theta: Array, phi: Array, tilt: Array, azimuth: float, dtype: type) -> Array:
    """Directions at angles about C, in the frame of the BRDF, shape (rows, n, azimuths, 3).

    Components lie apart in memory, so that functions of them need no gaps to be skipped.

    `theta` is of shape (rows,). `phi` is of shape (n, azimuths). `tilt`, of shape (n,), holds the
    angles between C and the normal.
    """
    theta, tilt = theta[:, None, None], tilt[:, None]
    sine: Array = np.sin(theta).astype(dtype)
    cosine = np.cos(theta)
    lights = np.empty((3, len(theta), *phi.shape), dtype)
    along = np.cos(phi)
    np.multiply(sine, (np.cos(tilt) * along).astype(dtype), out=lights[0])
    lights[0] -= (np.sin(tilt) * cosine).astype(dtype)
    np.multiply(sine, np.sin(phi).astype(dtype), out=lights[1])
    np.multiply(sine, (np.sin(tilt) * along).astype(dtype), out=lights[2])
    lights[2] += (np.cos(tilt) * cosine).astype(dtype)
    return turned(np.moveaxis(lights, 0, -1), azimuth)


def every_third(samples: Array, coverage: Array) -> tuple[Array, Array]:
    """The samples of a block on the rule with a third of the nodes in theta_i.

    `samples` are of shape (3 k, n, azimuths, ...). `coverage`, of shape (3 k, n, azimuths), is one
    of those that `transfer_samples` yields.

    Returns `samples` of shape (k, n, azimuths, ...) and `coverage` of shape (k, n, azimuths).
    """
    middle = samples[1::3]
    first = (coverage[1::3] == 0) & (coverage[::3] > 0)
    if first.any():
        # The middle of the coarse cell is below the horizon, and the first of its cells is not.
        middle = np.where(
            first.reshape(first.shape + (1,) * (middle.ndim - 3)), samples[::3], middle
        )
    return middle, (coverage[::3] + coverage[1::3] + coverage[2::3]) / 3
