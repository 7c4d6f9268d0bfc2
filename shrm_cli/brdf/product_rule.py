"""Quadrature over the directions of the light, with nodes where a BRDF's lobe is.

Lobes about the mirror direction are functions of the half vector H between light and view, which
is near the normal in all of a lobe however the view grazes. So the rule for them is one in the
polar angle eta and the azimuth psi of H, and ``dL = 4 (V.H) dH``. With the view at the angle theta
from the normal, and psi counted from its azimuth, the light is above the horizon where ``eta < pi/4
+ atan(tan(theta) cos(psi)) / 2``. The radii of each azimuth end there, so that no sample is beyond
the horizon and the integrand is smooth on all of its domain, for which rules of Gauss and Legendre
converge exponentially. That bound rises steeply where psi is a right angle and the view grazes;
azimuths crowd there.

BRDFs about the normal have a rule in the light's own polar coordinates, and so have those that have
no horizon, about their central direction.
"""

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.lobe import cuts_horizon
from shrm_cli.brdf.lobe_expansion import lobe_width
from shrm_cli.brdf.polar_rule import PolarRule, SplitRule
from shrm_cli.records import record
from shrm_cli.sphere.directions import from_angles, local_frame, to_angles
from shrm_cli.sphere.quadrature import gauss_legendre

_LEAST_COSINE = 1e-3
"""The least N.V that the crowding of azimuths knows."""


@record
class LightRule:
    """Nodes over the light for any view."""

    center: str
    """What the nodes crowd about. One of "reflection", "normal" and "tangent"."""
    width: float
    """The angle from it within which about half of a BRDF's energy lies, radians."""
    has_horizon: bool
    """Whether the nodes are above the horizon only."""

    @classmethod
    def of(cls, brdf: Brdf) -> "LightRule":
        """Return the rule that suits a BRDF."""
        width = lobe_width(brdf) if brdf.center == "reflection" else 1.0
        return cls(brdf.center, min(width, 1.0), cuts_horizon(brdf))

    def nodes(self, views: Array, along: int, around: int) -> tuple[Array, Array]:
        """Return directions to the light, and their weights, for each view.

        `views`, of shape (n, 3), are directions to the viewer in the frame of the normal, z = N,
        with the tangent along x. `along` and `around` are the numbers of nodes along a radius, and
        around it, of which the latter is a multiple of 4.

        Returns `directions` of shape (n, along * around, 3), unit, in the same frame; and `weights`
        of shape (n, along * around), they sum to the solid angle, 2 pi or 4 pi.
        """
        if self.has_horizon and self.center == "reflection":
            return self._of_half_vectors(views, along, around)
        return self._of_lights(views, along, around)

    def _of_half_vectors(self, views: Array, along: int, around: int) -> tuple[Array, Array]:
        theta, azimuth = (angle[:, None] for angle in to_angles(views))
        psi, psi_weights = _azimuths(theta, around)
        slope = np.sin(theta) * np.cos(psi)
        end = np.pi / 4 + np.arctan2(slope, np.maximum(np.cos(theta), 0.0)) / 2
        eta, weights = _radii(end, self.width / 2, along)
        turned = (psi + azimuth)[..., None]
        half = from_angles(eta, turned)
        weights = weights * psi_weights[..., None] * np.sin(eta)
        cosine = np.einsum("nijk,nk->nij", half, views)
        directions = 2 * cosine[..., None] * half - views[:, None, None]
        shape = len(views), along * around
        return directions.reshape(*shape, 3), (4 * weights * cosine).reshape(shape)

    def _of_lights(self, views: Array, along: int, around: int) -> tuple[Array, Array]:
        is_half = self.has_horizon and self.center == "normal"
        rule = SplitRule() if is_half else PolarRule(self.width)
        theta, weights = rule.nodes(along)
        psi = 2 * np.pi * (np.arange(around) + 0.5) / around
        local = from_angles(theta[:, None], psi).reshape(-1, 3)
        directions = local @ local_frame(*to_angles(self._centers(views))).swapaxes(1, 2)
        weights = np.repeat(weights * (2 * np.pi / around), around)
        return directions, np.broadcast_to(weights, directions.shape[:2])

    def _centers(self, views: Array) -> Array:
        if self.center == "reflection":
            return views * np.array([-1.0, -1.0, 1.0])
        axis = np.array([0.0, 0.0, 1.0] if self.center == "normal" else [1.0, 0.0, 0.0])
        return np.broadcast_to(axis, views.shape)


def _azimuths(theta: Array, count: int) -> tuple[Array, Array]:
    """Azimuths that crowd about both right angles, for each view: (n, count), and their weights.

    Four quarters of the circle begin at the right angles, with nodes that crowd there within the
    cosine of the view's angle theta, shape (n, 1).
    """
    crowding = np.arcsinh(1 / np.maximum(np.cos(theta), _LEAST_COSINE))
    nodes, weights = gauss_legendre(count // 4)
    u = crowding * (nodes + 1) / 2
    scale = np.pi / 2 / np.sinh(crowding)
    away = np.sinh(u) * scale
    weights = weights / 2 * crowding * np.cosh(u) * scale
    quarters = [side * (np.pi / 2 + way * away) for side in (1, -1) for way in (1, -1)]
    return np.concatenate(quarters, axis=1), np.tile(weights, (1, 4))


def _radii(end: Array, width: float, count: int) -> tuple[Array, Array]:
    """Nodes within 0 .. end that crowd within a width: (..., count), and their weights."""
    end = end[..., None]
    crowding = np.arcsinh(end / width)
    nodes, weights = gauss_legendre(count)
    u = crowding * (nodes + 1) / 2
    return width * np.sinh(u), weights / 2 * crowding * width * np.cosh(u)
