"""What putting discs in place of pixels does to the irradiance, over all normals."""

from collections.abc import Sequence

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.lights.lamp import Light
from shrm_cli.maps.irradiance.irradiance import lambert_factors
from shrm_cli.probe.disc import Disc, disc_coefficients
from shrm_cli.records import record
from shrm_cli.sphere.grid.base import Grid
from shrm_cli.sphere.harmonics import degrees, order_of, real_harmonics
from shrm_cli.sphere.quadrature import spiral_directions

ORDER = 32
"""Degrees of the light that are counted, where pixels are fine enough. Of a point's irradiance
those beyond hold 1e-6 of the square."""
_NORMALS = 2048
"""Normals among which the largest difference is looked for: any is within 3 degrees of one."""
_VALUES_AT_ONCE = 2**23


@record(eq=False)
class Proof:
    """How far the irradiance of residual and discs is from that of the probe."""

    rms: float
    maximum: float
    """`rms` and `maximum`: of the difference, over all normals and the channels together, relative
    to `scale`."""
    scale: float
    """The RMS of the probe's irradiance over all normals, channels together."""
    worst: Array
    """The normal of the largest difference, world axes, shape (3,)."""


def order_on(grid: Grid) -> int:
    """The degrees in which light on a grid is compared: no finer ones than its pixels have."""
    return min(ORDER, grid.resolved_order)


def prove(before: Array, residual: Array, discs: Sequence[Disc]) -> Proof:
    """Compare the irradiance of a probe with that of what is left of it and discs.

    Parameters
    ----------
    before, residual : ndarray, shape ((order+1)^2, 3)
        Coefficients of the radiance of the probe and of the residual, world axes.
    """
    difference = residual + disc_coefficients(discs, order_of(len(before))) - before
    irradiance = _irradiance(difference)
    scale = irradiance_rms(before)
    normals = spiral_directions(_NORMALS)
    values = np.linalg.norm(real_harmonics(order_of(len(before)), normals) @ irradiance, axis=1)
    worst = int(np.argmax(values))
    return Proof(
        _over(irradiance_rms(difference), scale), _over(float(values[worst]), scale), scale,
        normals[worst],
    )  # fmt: skip


def irradiance_rms(coefficients: Array) -> float:
    """RMS of the irradiance over all normals, channels together, from those of the radiance."""
    return float(np.sqrt((_irradiance(coefficients) ** 2).sum() / (4 * np.pi)))


def light_coefficients(light: Light, order: int) -> Array:
    """Coefficients of light at points, shape ((order+1)^2, 3), as sums over them."""
    result = np.zeros(((order + 1) ** 2, 3))
    step = max(_VALUES_AT_ONCE // len(result), 1)
    for start in range(0, len(light.areas), step):
        some = slice(start, start + step)
        weighted = light.radiance[some] * light.areas[some, None]
        result += real_harmonics(order, light.directions[some]).T @ weighted
    return result


def _irradiance(coefficients: Array) -> Array:
    order = order_of(len(coefficients))
    return np.asarray(lambert_factors(order)[degrees(order), None] * coefficients)


def _over(value: float, scale: float) -> float:
    return value / scale if scale else 0.0
