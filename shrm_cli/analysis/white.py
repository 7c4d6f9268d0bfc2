"""The colour of light in words: chromaticity, correlated colour temperature, name of primaries."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.color import REC709

Array = NDArray[np.floating]

_COLDEST, _HOTTEST, _FARTHEST = 1000.0, 25000.0, 0.05
"""Temperatures in kelvin, and the distance from the black body in CIE 1960 u and v, within which a
correlated colour temperature means something."""
_KNOWN = {
    "Rec.709": REC709,
    "Rec.2020": (0.708, 0.292, 0.17, 0.797, 0.131, 0.046, 0.3127, 0.329),
    "P3": (0.68, 0.32, 0.265, 0.69, 0.15, 0.06, 0.3127, 0.329),
    "DCI-P3": (0.68, 0.32, 0.265, 0.69, 0.15, 0.06, 0.314, 0.351),
    "Adobe RGB": (0.64, 0.33, 0.21, 0.71, 0.15, 0.06, 0.3127, 0.329),
    "ACEScg": (0.713, 0.293, 0.165, 0.83, 0.128, 0.044, 0.32168, 0.33767),
    "ACES2065-1": (0.7347, 0.2653, 0.0, 1.0, 0.0001, -0.077, 0.32168, 0.33767),
}
_SAME = 2e-3
"""How far numbers of the same primaries may be apart: files round them."""


def primaries_name(primaries: Sequence[float] | None) -> str:
    """The name of primaries, or what there is to say of them."""
    if primaries is None:
        return "not stated; taken for Rec.709"
    for name, known in _KNOWN.items():
        if np.allclose(primaries, known, rtol=0, atol=_SAME):
            return name
    return "of their own"


def xyz_matrix(primaries: Sequence[float] | None) -> Array:
    """The matrix from linear RGB to CIE XYZ, in which white has Y = 1, shape (3, 3).

    Primaries that are not stated, or that nothing can have, count as Rec.709.

    References
    ----------
    SMPTE RP 177:1993.
    """
    points = np.reshape(REC709 if primaries is None else primaries, (4, 2))
    columns = np.stack([points[:, 0], points[:, 1], 1 - points.sum(axis=1)])
    try:
        with np.errstate(all="ignore"):
            scale = np.linalg.solve(columns[:, :3], columns[:, 3] / points[3, 1])
    except np.linalg.LinAlgError:
        scale = np.full(3, np.nan)
    if not np.isfinite(scale).all():
        return xyz_matrix(None)
    return np.asarray(columns[:, :3] * scale)


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
