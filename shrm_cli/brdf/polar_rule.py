"""Quadrature over angles from the central direction C, with nodes where BRDFs need them.

All rules here are Fejer's first rule in a parameter s, whose nodes are the middles of equal cells
over 0 .. pi, after a substitution theta(s) that is odd about both ends. An integrand that is a
smooth function on the sphere stays one, so the rules keep their exponential convergence.

Every third node of a rule is the rule with a third of the nodes. The samples of one rule thus give
a second, coarser integral, from which its error is estimated.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array
from shrm_cli.records import record
from shrm_cli.sphere.quadrature import colatitude_weights, nodes
from shrm_cli.vocabulary import Center

_EVEN = 0.35
"""The share of the nodes of a focused rule that is spread evenly over all angles."""
_TOWARDS_GRAZING = 0.25
"""The focus of the views about the mirror direction, at the side where they graze."""
_ITERATIONS = 60
"""Halvings of an interval, after which nothing is left of it."""


@record
class PolarRule:
    """Nodes in the angle theta from C, of which a part crowds within some distance from C.

    The parameter is ``s(theta) = e theta + (1 - e) 2 atan(tan(theta / 2) / focus)``, with the part
    e of the nodes that is even. The other part is even after a Moebius transform of the sphere.

    Attributes
    ----------
    focus : float
        The angle from C, radians, within which about a third of the nodes lie; 1 spreads all of
        them evenly over the angle.
    """

    focus: float = 1.0

    def parameter(self, theta: ArrayLike) -> Array:
        """The parameter s of angles theta, both in 0 .. pi."""
        theta = np.asarray(theta, dtype=float)
        if self.focus == 1:
            return theta
        moebius = 2 * np.arctan2(np.sin(theta / 2), self.focus * np.cos(theta / 2))
        return np.asarray(_EVEN * theta + (1 - _EVEN) * moebius)

    def nodes(self, count: int) -> tuple[Array, Array]:
        """Angles theta, ascending, and weights for integrals over ``sin(theta) dtheta``.

        Returns
        -------
        theta, weights : ndarray, shape (count,)
            The weights sum to 2, up to the rule's error.
        """
        s, weights = _even_nodes(count), colatitude_weights(count)
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

    Attributes
    ----------
    below : bool
        Whether half of the nodes are below the horizon.
    """

    below: bool = False
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

        Parameters
        ----------
        count : int
            Even, if nodes are below the horizon.
        """
        each = count // 2 if self.below else count
        cosine, weights = (1 + np.cos(_even_nodes(each))) / 2, colatitude_weights(each) / 2
        above = np.arccos(cosine)
        if not self.below:
            return above, weights
        return np.append(above, np.pi - above[::-1]), np.append(weights, weights[::-1])


@lru_cache(8)
def view_nodes(center: Center, count: int) -> tuple[Array, Array]:
    """Nodes in the angle theta_o of the view from C, dense where views graze the surface.

    About the mirror direction that is at theta_o = pi. About the normal it is at pi / 2, where
    BRDFs may jump, so each of both sides has a rule of its own. Fibres have no such place.

    Parameters
    ----------
    center : {"reflection", "normal", "tangent"}
    count : int
        A multiple of 6.

    Returns
    -------
    theta_o, weights : ndarray, shape (count,)
        Ascending angles in radians, and weights for integrals over ``sin(theta_o) dtheta_o``,
        which sum to 2. Every third node is a node of the rule for ``count / 3``.
    """
    if center == "tangent":
        return PolarRule().nodes(count)
    if center == "reflection":
        theta, weights = PolarRule(_TOWARDS_GRAZING).nodes(count)
        return np.pi - theta[::-1], weights[::-1]
    return SplitRule(below=True).nodes(count)


def azimuths(count: int) -> Array:
    """The middles of equal cells over half a turn, radians."""
    return _even_nodes(count)


def squeezed_azimuths(count: int, squeeze: Array) -> tuple[Array, Array]:
    """Azimuths that crowd about 0 and pi, by a substitution that keeps smooth functions smooth.

    With ``tan(phi) = squeeze tan(s)`` they are even in s. That is the azimuth on an ellipse, which
    lobes are where their light grazes.

    Parameters
    ----------
    count : int
    squeeze : ndarray, shape (n,)
        In (0, 1]; 1 leaves the azimuths even.

    Returns
    -------
    phi, weights : ndarray, shape (n, count)
        Radians over half a turn, and weights for integrals over dphi, which sum to pi up to the
        rule's error. Every third is a node of the rule for ``count / 3``.
    """
    s, squeeze = azimuths(count), squeeze[:, None]
    across, along = squeeze * np.sin(s), np.cos(s)
    return np.arctan2(across, along), np.pi / count * squeeze / (along**2 + across**2)


@lru_cache(16)
def _crowded_angles(rule: PolarRule, count: int) -> Array:
    """The angles of a focused rule's nodes, by halving intervals; `parameter` ascends."""
    s = _even_nodes(count)
    low, high = np.zeros_like(s), np.full_like(s, np.pi)
    for _ in range(_ITERATIONS):
        middle = (low + high) / 2
        below = rule.parameter(middle) < s
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return (low + high) / 2


def _even_nodes(count: int) -> Array:
    return (nodes(count) + 1) * (np.pi / 2)
