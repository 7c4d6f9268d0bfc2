"""The colour of light in words: chromaticity and correlated colour temperature."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.color import xyz_matrix

_COLDEST, _HOTTEST, _FARTHEST = 1000.0, 25000.0, 0.05
"""Temperatures in kelvin, and the distance from the black body in CIE 1960 u and v, within which a
correlated colour temperature means something."""


def chromaticity(rgb: ArrayLike, primaries: Sequence[float] | None) -> tuple[float, float] | None:
    """CIE 1931 x and y of linear RGB; None of black."""
    xyz = xyz_matrix(primaries) @ np.asarray(rgb, dtype=float)
    total = float(xyz.sum())
    return None if total <= 0 else (float(xyz[0] / total), float(xyz[1] / total))


def color_temperature(x: float, y: float) -> float | None:
    """Correlated colour temperature in kelvin; None where light has none.

    Parameters
    ----------
    x, y : float
        CIE 1931 chromaticity.

    References
    ----------
    McCamy 1992: within 2 K of the black body from 2856 K to 6504 K, and within 3 % from 2000 K to
    12500 K.
    """
    if y == 0.1858 or abs(blackbody_distance(x, y)) > _FARTHEST:
        return None
    n = (x - 0.3320) / (0.1858 - y)
    found = 449 * n**3 + 3525 * n**2 + 6823.3 * n + 5520.33
    return float(found) if _COLDEST <= found <= _HOTTEST else None


def blackbody_distance(x: float, y: float) -> float:
    """Distance from the black body's curve in CIE 1960 u and v, above 0 for greenish light.

    References
    ----------
    Ohno 2014, "Practical use and calculation of CCT and Duv", eq. 6 to 8.
    """
    denominator = -2 * x + 12 * y + 3
    u, v = 4 * x / denominator, 6 * y / denominator
    radius = float(np.hypot(u - 0.292, v - 0.24))
    angle = np.arccos(np.clip((u - 0.292) / max(radius, 1e-12), -1, 1))
    curve = np.polyval(
        [-0.00616793, 0.0893944, -0.5179722, 1.5317403, -2.4243787, 1.925865, -0.471106], angle
    )
    return float(radius - curve)
