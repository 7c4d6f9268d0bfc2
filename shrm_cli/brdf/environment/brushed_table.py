"""The environment BRDF of brushed GGX: what it reflects of a white, uniform environment."""

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli import progress
from shrm_cli.arrays import Array
from shrm_cli.brdf.environment.views import unit_rule
from shrm_cli.brdf.models.ggx import Ggx
from shrm_cli.brdf.vectors import GRAZING, fifth_power
from shrm_cli.errors import BrdfError

AZIMUTHS = 0.0, np.pi / 4, np.pi / 2
"""Views along the stretched axis, between both, and across it."""
_SLOPES = 40
_TURNS = 192
"""Nodes of the integral over the length and the azimuth of the slope of the half vector."""
_VIEWS_AT_ONCE = 8


def brushed_totals(alphas: tuple[float, float], cosines: ArrayLike, azimuth: float) -> Array:
    """Integrate GGX's lobe without Fresnel's term, and with ``(1 - V.H)^5``.

    The integral is over the slopes of half vectors, which have the length ``sinh(x)`` where the
    alphas are the units of length. Along a ray of slopes light comes from above up to a root of a
    quadratic equation.

    `alphas` are along x and y. `cosines`, of shape (n,), are N.V; values below 1e-5 count as 1e-5.
    `azimuth` is that of the view from the x axis, radians.

    Returns an array of shape (2, n): exact to 5e-5 down to N.V = 0.004.
    """
    view = np.clip(np.asarray(cosines, dtype=float), GRAZING, 1.0)
    result = np.empty((2, len(view)))
    for start in range(0, len(view), _VIEWS_AT_ONCE):
        part = slice(start, start + _VIEWS_AT_ONCE)
        result[:, part] = _totals(alphas, view[part, None, None], azimuth)
    return result


def _totals(alphas: tuple[float, float], z: Array, azimuth: float) -> Array:
    """Compute `brushed_totals` for N.V of shape (n, 1, 1)."""
    ax, ay = alphas
    sine = np.sqrt(1 - z**2)
    x, y = sine * np.cos(azimuth), sine * np.sin(azimuth)
    turns = (np.arange(_TURNS)[:, None] + 0.5) * 2 * np.pi / _TURNS
    unit_x, unit_y = ax * np.cos(turns), ay * np.sin(turns)
    along, square = unit_x * x + unit_y * y, unit_x**2 + unit_y**2
    # N.L > 0 is ``z + 2 along t - z square t^2 > 0``; the form of the root does not cancel.
    root = np.sqrt(along**2 + z**2 * square)
    positive = (along + root) / (z * square)
    negative = z / np.maximum(root - along, np.finfo(float).tiny)
    end = np.arcsinh(np.where(along > 0, positive, negative))
    nodes, weights = unit_rule(_SLOPES)
    steps = end * nodes
    length = np.sinh(steps)
    facing = z + along * length  # V.H / N.H
    cosine2 = 1 / (1 + square * length**2)
    scale = 2 * cosine2 * facing
    light = [scale * unit_x * length - x, scale * unit_y * length - y]
    height = np.maximum(scale - z, 0.0)
    masking = np.sqrt((ax * x) ** 2 + (ay * y) ** 2 + z**2)
    shadowing = np.sqrt((ax * light[0]) ** 2 + (ay * light[1]) ** 2 + height**2)
    # With t = sinh(x), D cos(theta_h) dH = 2 t / (1 + t^2)^2 dt dphi / (2 pi).
    measure = end * weights * 2 * length / np.cosh(steps) ** 3 / _TURNS
    both = np.maximum(height * masking + z * shadowing, np.finfo(float).tiny)
    base = measure * 2 * facing * height / both
    tail = base * fifth_power(1 - np.minimum(facing * np.sqrt(cosine2), 1.0))
    return np.stack([base.sum(axis=(1, 2)), tail.sum(axis=(1, 2))])


def brushed_table(brdf: Ggx, size: int) -> Array:
    """Compute scale and bias of f0 for every roughness, in three azimuths of the view.

    Between the azimuths both are quadratic in ``w = cos(2 phi)``, which is 1, 0 and -1 there.

    `brdf` is one whose anisotropy, and the mapping of it, all rows have. `size` is the number of
    rows, over the perceptual roughness, and of columns, over N.V. Both are sampled at texel
    centers, ``(k + 0.5) / size``. The first row is the smoothest.

    Returns an array of shape (size, size, 6): scale and bias along, between and across. Raises
    BrdfError if the BRDF has alphas of its own, a roughness or a reflectance.
    """
    usual = Ggx().values
    if any(brdf.values.get(key) != value for key, value in usual.items()):
        raise BrdfError(
            f"{brdf!r}: all roughnesses are made, for any f0; give only anisotropy and mapping"
        )
    centers = (np.arange(size) + 0.5) / size
    table = np.empty((size, size, 6))
    for row, roughness in enumerate(centers.tolist()):
        alphas = brdf.at_roughness(roughness).alphas
        for column, azimuth in enumerate(AZIMUTHS):
            total, bias = brushed_totals(alphas, centers, azimuth)
            table[row, :, 2 * column : 2 * column + 2] = np.stack([total - bias, bias], axis=-1)
        progress.report(row + 1, size)
    return table
