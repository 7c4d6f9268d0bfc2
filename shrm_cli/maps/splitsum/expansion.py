"""How far a level's light is expanded in harmonics, and what that leaves out.

A level is the light with each degree l multiplied by a number of the lobe. The least order that
keeps the error decides how many texels the level has, because texels cost storage. Degrees cost
none, so more of them are carried than that. They fade out slowly: an expansion that ends abruptly
rings about lamps, and the rings are large beside the light of dark places.
"""

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.brdf.coefficients import BrdfCoefficients
from shrm_cli.maps.size import Band
from shrm_cli.orders import first_enough
from shrm_cli.probe.lighting import Lighting
from shrm_cli.records import record
from shrm_cli.sphere.synthesis import CubeSeries
from shrm_cli.vocabulary import MAX_ORDER_F, Sampling

DARK_ERROR = 3e-4
"""Degrees are carried until the RMS of what is left beyond them is this part of the mean radiance.
An error that is relative to the RMS of the level says little about dark places, because lamps make
that RMS many times the mean."""
_FADE = 0.05
"""The least number of degrees over which an expansion fades out, as a part of its order."""


@record(eq=False)
class Expansion:
    """What the degrees of the light are multiplied with for a level, and what is known of it."""

    multipliers: Array
    """One number a degree; for l = 0 it is 1, shape (carried + 1,)."""
    order: int
    """The least order that keeps the error, or the largest that the light has."""
    error: float
    """The predicted relative RMS error of the level."""


def expand(lighting: Lighting, coefficients: BrdfCoefficients, tolerance: float) -> Expansion:
    """Choose the degrees of a level: the order that keeps an error, and those carried beyond it.

    `coefficients` are coefficients of a zonal lobe, to at least the light's order. `tolerance` is
    the relative RMS error that the order may leave.
    """
    passed = multipliers(coefficients)
    light, missing = energies(lighting, passed)
    whole = light[0] + missing[0]
    order = first_enough(missing <= tolerance**2 * whole)
    dark = first_enough(missing <= DARK_ERROR**2 * light[0])
    carried = min(max(dark, faded_order(order)), lighting.order)
    fade = Band(order, carried).factors
    lost = float(light[: carried + 1] @ (1 - fade) ** 2 + missing[carried])
    error = float(np.sqrt(lost / whole)) if whole > 0 else 0.0
    return Expansion(passed[: carried + 1] / passed[0] * fade, order, error)


def faded_order(order: int) -> int:
    """Return the order to which the light is to be known, so that an expansion can fade out."""
    return min(int(np.ceil(order * (1 + _FADE))), MAX_ORDER_F)


def unknown_light(lighting: Lighting, passed: Array) -> float:
    """Estimate the energy of the filtered light that is beyond the light's expansion.

    Two estimates are made, and the smaller one counts. In the first, the light goes on as white
    light does, with ``(2l+1)`` times the mean power of its last 16 degrees. In the second, all
    energy of the light that is left sits in the degree that the lobe passes most of.

    `passed`, of shape (degrees,), holds the squared multipliers of the lobe.
    """
    known = lighting.order + 1
    power = lighting.power().sum(axis=1)
    rest = max(float(lighting.energy.sum() - power.sum()), 0.0)
    width = 2 * np.arange(len(passed)) + 1
    last = slice(max(known - 16, 0), known)
    density = power[last].sum() / width[last].sum()
    white = density * float(width[known:] @ passed[known:])
    return min(white, rest * float(passed[known:].max(initial=0.0)))


def multipliers(coefficients: BrdfCoefficients) -> Array:
    """Return what a zonal lobe multiplies the light's degrees with; for l = 0, its integral."""
    values = coefficients.values[:, 0, 0, 0]
    return values / np.sqrt(2 * np.arange(len(values)) + 1)


def synthesized(light: CubeSeries, passed: Array, size: int, sampling: Sampling) -> Array:
    """Synthesize light with its degrees multiplied, to the lower of both orders: (6N, N, 3)."""
    planes = light.planes(size, sampling, factors=passed[: light.order + 1])
    return np.ascontiguousarray(planes.transpose(1, 2, 0))


def energies(lighting: Lighting, passed: Array) -> tuple[Array, Array]:
    """Return the energy of a level in each degree that is known of the light, and beyond each."""
    light = lighting.power().sum(axis=1) * passed[: lighting.order + 1] ** 2
    beyond = unknown_light(lighting, passed**2)
    return light, np.cumsum(light[::-1])[::-1] - light + beyond
