"""Harmonics about a central direction, taken apart by azimuthal orders q.

The harmonics of one degree in world axes tell those about any direction C by their values at as
many directions about it, and no matrix of a rotation is needed: in a plane through C where only
``cos(q phi)`` counts, and on a cone about C where ``sin(q phi)`` does, too.
"""

from functools import lru_cache

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.maps.principal.functions import MAX_Q
from shrm_cli.sphere.harmonics import harmonic_planes, legendre_table

_CONES = 400
"""The cones of which the best one is taken."""


def orders_in_plane(degree: int, centers: Array, across: Array, bundles: Array) -> Array:
    """Take bundles of harmonics in world axes apart by the orders q that count in a plane.

    `centers` and `across`, each of shape (n, 3), are orthonormal vectors of the plane. `bundles`,
    of shape (n, bundles, 2 degree + 1, 3), are coefficients of the harmonics of the degree.

    Returns an array of shape (n, bundles, degree+1, 3).
    """
    angles, inverse = plane_rule(degree)
    cosines, sines = np.cos(angles)[:, None, None], np.sin(angles)[:, None, None]
    return inverse @ _values(degree, cosines * centers + sines * across, bundles)


@lru_cache(MAX_Q + 1)
def plane_rule(degree: int) -> tuple[Array, Array]:
    """Return angles in a plane through C, and how values at them are taken apart by q.

    A function of one degree, with coefficients b_q along the plane, has the values ``sum_q b_q
    f_q(angle)`` in it, with the normalized Legendre functions of that degree.

    Returns `angles` of shape (degree+1,), radians from C; and `inverse` of shape (degree+1,
    degree+1), from values at the angles to the b_q, in the convention of `legendre_table`.
    """
    # Spread over half a turn, they tell all orders well apart: rounding of the cubes grows fivefold
    # at degree 12, where it would grow a hundred thousand times with angles over a quarter turn.
    even = np.pi * (np.arange(degree + 1) + 0.5) / (degree + 1)
    # Shaders are given the tangents of half the angles, and this makes them exact there: the sum
    # over the angles would be wrong by ten roundings of 32-bit floats at degree 12.
    angles = 2 * np.arctan(np.tan(even / 2).astype(np.float32).astype(float))
    table = legendre_table(degree, np.cos(angles))
    functions = np.stack([table[q, degree - q] for q in range(degree + 1)], axis=1)
    return angles, np.linalg.inv(functions)


def orders_about(degree: int, centers: Array, across: Array, bundles: Array) -> Array:
    """Take bundles of harmonics in world axes apart by the orders q about C.

    `centers` and `across`, each of shape (n, 3), are orthonormal vectors; azimuths are counted from
    the second about the first. `bundles`, of shape (n, bundles, 2 degree + 1, 3), are coefficients
    of the harmonics of the degree.

    Returns an array of shape (n, bundles, 2 degree + 1, 3): the parts of ``cos(q phi)`` for q = 0
    .. p, and of ``sin(q phi)`` for q = 1 .. p.
    """
    angle, azimuths, inverse = cone_rule(degree)
    cosines, sines = np.cos(azimuths)[:, None, None], np.sin(azimuths)[:, None, None]
    around = cosines * across + sines * np.cross(centers, across)
    return inverse @ _values(degree, np.cos(angle) * centers + np.sin(angle) * around, bundles)


def _values(degree: int, directions: Array, bundles: Array) -> Array:
    """Evaluate bundles (n, bundles, k, 3) at directions (m, n, 3): shape (n, bundles, m, 3)."""
    harmonics = harmonic_planes(degree, directions, first=degree)
    return np.ascontiguousarray(harmonics.T)[:, None] @ bundles


@lru_cache(MAX_Q + 1)
def cone_rule(degree: int) -> tuple[float, Array, Array]:
    """Return directions on a cone about C, and how values there are taken apart by q.

    A function of one degree has the values ``sum_q f_q(angle) (b_q cos(q phi) + b_-q sin(q phi))``,
    with the normalized Legendre functions of that degree.

    Returns `angle`, that of the cone, radians; `azimuths` of shape (2 degree + 1,), even azimuths
    on it; and `inverse` of shape (2 degree + 1, 2 degree + 1), from values at the directions to
    ``b_0 .. b_p, b_-1 .. b_-p``. No function of the degree is small there.
    """
    # Shaders are given its tangent of half the angle, as `plane_rule` has it.
    angles = np.linspace(0, np.pi / 2, _CONES + 1)[1:]
    angles = 2 * np.arctan(np.tan(angles / 2).astype(np.float32).astype(float))
    table = legendre_table(degree, np.cos(angles))
    functions = np.stack([table[q, degree - q] for q in range(degree + 1)])
    weighted = np.abs(functions) * np.where(np.arange(degree + 1) == 0, 1, np.sqrt(0.5))[:, None]
    best = int(np.argmax(weighted.min(axis=0)))
    azimuths = 2 * np.pi * np.arange(2 * degree + 1) / (2 * degree + 1)
    q = np.arange(degree + 1)[:, None]
    waves = np.concatenate([np.cos(q * azimuths), np.sin(q * azimuths)[1:]])
    scale = np.concatenate([functions[:, best], functions[1:, best]])
    norm = np.where(np.arange(2 * degree + 1) == 0, 1.0, 2.0) / (2 * degree + 1)
    return float(angles[best]), azimuths, waves * (norm / scale)[:, None]
