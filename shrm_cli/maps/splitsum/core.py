"""A sharp lobe in two parts: a core that is summed over pixels, and a tail that is expanded.

The core fades out smoothly with the angle from the lobe's axis, so that the tail is smooth and a
few hundred degrees hold it. Behind a core that ended abruptly the tail would begin with a step,
whose expansion rings about lamps, far into dark places.
"""

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.brdf.coefficients import BrdfCoefficients
from shrm_cli.brdf.environment.lobe import NormalLobe
from shrm_cli.maps.splitsum.expansion import DARK_ERROR, multipliers, unknown_light
from shrm_cli.probe.lighting import Lighting
from shrm_cli.sphere.directions import from_angles
from shrm_cli.sphere.harmonics import legendre_degrees
from shrm_cli.sphere.quadrature import gauss_legendre
from shrm_cli.vocabulary import MAX_ORDER_F

_NODES = 256
"""Gauss's nodes over the angle of a core."""
_LEAST_ANGLE = 9.0
"""The angle, radians, at which the smallest core ends that is tried, times the light's order."""
_GROWTH = 1.25
"""How much wider each core is than the one that was tried before it."""


class LobeCore(NormalLobe):
    """The part of a lobe about its axis that fades out at an angle.

    With ``x = sin(theta / 2) / sin(angle / 2)`` it is the lobe times ``1 - I_x(8, 4)``, where I is
    the regularized incomplete beta function. The tail begins as x^8, which outweighs the lobe's
    own fall (GGX falls with theta^-4), and it joins the lobe with three derivatives at the angle.

    Parameters
    ----------
    angle : float
        Where the core ends, radians.
    """

    def __init__(self, lobe: NormalLobe, angle: float) -> None:
        self.name, self.values, self.width = lobe.name, lobe.values, lobe.width
        self.lobe, self.angle = lobe, angle
        self._end = float(np.sin(angle / 2))

    def radial(self, square_sine: Array) -> Array:
        x = np.minimum(np.sqrt(square_sine) / self._end, 1)
        x4 = (x * x) * (x * x)
        # In powers of 1 - x, which do not cancel where the core is small.
        y = 1 - x
        y2 = y * y
        kept = (
            y2 * y2 * (1 + x * (4 + x * (10 + 20 * x)) + x4 * (35 + x * (56 + x * (84 + 120 * x))))
        )
        value: Array = self.lobe.radial(square_sine) * kept
        return value

    def multipliers(self) -> Array:
        """Compute what the core multiplies the light's degrees with: shape (513,)."""
        nodes, weights = gauss_legendre(_NODES)
        theta = (nodes + 1) / 2 * self.angle
        values = self.evaluate(from_angles(theta, 0.0), np.array([0.0, 0.0, 1.0]))[:, 0]
        rings = self.angle / 2 * weights * np.sin(theta) * values
        return np.array(
            [
                2 * np.pi * np.sqrt(4 * np.pi / (2 * degree + 1)) * float(legendre[0] @ rings)
                for degree, legendre in legendre_degrees(MAX_ORDER_F, np.cos(theta), max_m=0)
            ]
        )


def split_lobe(
    lobe: NormalLobe, coefficients: BrdfCoefficients, lighting: Lighting, tolerance: float
) -> tuple[LobeCore, Array, float]:
    """Find the narrowest core whose tail loses little where the light's expansion ends.

    Parameters
    ----------
    coefficients : BrdfCoefficients
        Coefficients of the lobe, to order 512.
    tolerance : float
        The relative RMS error that the tail may leave. It is kept small beside the mean radiance
        too, as in an expansion of the whole lobe.

    Returns
    -------
    core : LobeCore
    tail : ndarray, shape (513,)
        What the rest of the lobe multiplies the light's degrees with.
    error : float
        The predicted relative RMS error of the level.
    """
    whole = multipliers(coefficients)
    power = lighting.power().sum(axis=1)
    light = float(power @ whole[: lighting.order + 1] ** 2) + unknown_light(lighting, whole**2)
    allowed = min(tolerance**2 * light, DARK_ERROR**2 * float(power[0]) * whole[0] ** 2)
    angle = _LEAST_ANGLE / max(lighting.order, 1)
    while True:
        core = LobeCore(lobe, min(angle, np.pi / 2))
        tail = whole - core.multipliers()
        lost = unknown_light(lighting, tail**2)
        if lost <= allowed or angle >= np.pi / 2:
            return core, tail, float(np.sqrt(lost / light)) if light > 0 else 0.0
        angle *= _GROWTH
