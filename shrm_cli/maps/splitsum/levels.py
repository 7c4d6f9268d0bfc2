"""The levels of a split sum: expanded, or the core of their lobe summed over the pixels."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shrm_cli.brdf.cache import cached_coefficients
from shrm_cli.brdf.coefficients import BrdfCoefficients, compute_coefficients
from shrm_cli.brdf.environment.ggx_lobe import GgxLobe
from shrm_cli.brdf.lobe import lobe_angle
from shrm_cli.maps.info import MapInfo
from shrm_cli.maps.size import choose_size
from shrm_cli.probe.lighting import Lighting
from shrm_cli.probe.probe import Probe
from shrm_cli.probe.resample import to_grid
from shrm_cli.progress import Progress
from shrm_cli.reference import Reference
from shrm_cli.sphere.cube import cube_directions
from shrm_cli.sphere.directions import from_angles
from shrm_cli.sphere.grid.cube import Cube
from shrm_cli.sphere.grid.latlong import LatLong
from shrm_cli.sphere.harmonics import degrees, legendre_degrees
from shrm_cli.sphere.quadrature import gauss_legendre
from shrm_cli.sphere.synthesis import synthesize_cube
from shrm_cli.vocabulary import MAX_ORDER_F, Sampling

Array = NDArray[np.floating]

# Seconds, measured on one core: projection and synthesis go with the cube of the order, direct
# integration with the pairs of a texel and a pixel within the lobe.
_SECONDS_A_CUBED_ORDER = 3e-8
_SECONDS_A_TEXEL_AND_ORDER = 3e-9
_SECONDS_A_PAIR = 1e-8
_SOON = 1.0
"""Seconds that an expansion may take in any case: it is exact, and levels share it."""
_ACCURACY = 1e-5
LEAST_ORDER = 256
"""Of the light's expansion where the core of a lobe is integrated directly."""
_KINK = 1e-3
"""What a broad lobe, which is not smooth where the light grazes, may lack beyond that order, as
relative RMS in white light: higher ones would fall slowly, and integration costs most there."""
_MOST_TAIL = 0.03
"""The part of such a lobe that the frequency domain may take; where more is cut off, which pixels
fall within the edge begins to show."""
_LEAST_TAIL = 1e-4
_CORE_NODES = 256
_ROWS_A_LOBE = 1.5
"""Rows of pixels, over half a turn, times ggx_alpha: with fewer, what lies between the pixels is
interpolated. There a uniform probe ripples by up to 3 %, with twice as many by 0.01 %."""
_MOST_ROWS = 1024
"""Or twice the least rows: averaged down to these, a probe has lost nothing that a lobe shows."""


@dataclass(frozen=True)
class LevelLobe:
    """A level's lobe, its order for white light, and whether the frequency domain pays."""

    brdf: GgxLobe
    coefficients: BrdfCoefficients
    order: int
    in_frequency: bool


def frequency_pays(order: int, alpha: float, rows: int, largest: int) -> bool:
    """Whether an expansion to an order costs less than direct integration, by what was measured.

    Parameters
    ----------
    order : int
    alpha : float
        ggx_alpha of the lobe.
    rows : int
        Height of the probe as a lat-long.
    largest : int
        Texels along an edge that the level may have.
    """
    texels = 6 * min(choose_size(order), largest) ** 2
    expansion = _SECONDS_A_CUBED_ORDER * order**3 + _SECONDS_A_TEXEL_AND_ORDER * texels * order
    # All but a^2 / (a^2 + t^2) of the lobe is within t = tan(angle / 2).
    cap = alpha**2 * (1 - _MOST_TAIL) / (_MOST_TAIL + alpha**2 * (1 - _MOST_TAIL))
    pixels = 2 * _source_rows(rows, alpha) ** 2 * cap
    return expansion <= max(_SECONDS_A_PAIR * texels * pixels, _SOON)


def level_lobe(roughness: float, error: float, rows: int, largest: int) -> LevelLobe:
    """A lobe, and the domain where its level is made; white light is the worst that there is."""
    brdf = GgxLobe(roughness=roughness)
    coefficients = cached_coefficients(brdf, MAX_ORDER_F, 0, _ACCURACY, compute_coefficients)
    missed = 1 - coefficients.captured()[:, 0]
    enough = missed <= error**2
    order = int(np.argmax(enough)) if enough.any() else MAX_ORDER_F + 1
    if missed[LEAST_ORDER] <= _KINK**2:
        order = min(order, LEAST_ORDER)
    pays = order <= MAX_ORDER_F and frequency_pays(order, brdf.ggx_alpha, rows, largest)
    return LevelLobe(brdf, coefficients, order, pays)


def mirror(
    probe: Probe, known: MapInfo, size: int, sampling: Sampling, progress: Progress | None
) -> tuple[Array, MapInfo]:
    """The level of roughness 0: the probe; its order is what its texels can hold.

    `known`, here and below, is what the levels share.
    """
    info = replace(known, order_f=4 * size // 10, brdf=_named(0.0), domain="angular")
    return to_grid(probe, Cube(size, sampling), progress), info


def expanded(
    lobe: LevelLobe, lighting: Lighting, known: MapInfo, largest: int, sampling: Sampling
) -> tuple[Array, MapInfo]:
    """A level as one product of coefficients, and one synthesis."""
    errors = expansion_errors(lighting, lobe.coefficients)
    enough = errors <= known.tolerance
    order = int(np.argmax(enough)) if enough.any() else len(errors) - 1
    size = min(choose_size(order), largest)
    passed = _multipliers(lobe.coefficients)[: order + 1]
    cube = _synthesized(lighting, passed / passed[0], size, sampling)
    info = replace(
        known,
        order_f=order,
        captured=float(lobe.coefficients.captured()[order, 0]),
        predicted_error=float(errors[order]),
        brdf=_named(lobe.brdf.number("roughness")),
    )
    return cube, info


def _named(roughness: float) -> dict[str, Any]:
    return {"name": GgxLobe.name, "parameters": {"roughness": roughness}}


def expansion_errors(lighting: Lighting, coefficients: BrdfCoefficients) -> Array:
    """Relative RMS error of a level that is expanded to each order that the light was.

    By Parseval, as `orders.predicted_error`, and with what the light holds beyond its own
    expansion; see `_unknown_light`.

    Parameters
    ----------
    lighting : Lighting
    coefficients : BrdfCoefficients
        Zonal, to at least the light's order.

    Returns
    -------
    ndarray, shape (order + 1,)
    """
    passed = _multipliers(coefficients) ** 2
    light = lighting.power().sum(axis=1) * passed[: lighting.order + 1]
    beyond = _unknown_light(lighting, passed)
    whole = light.sum() + beyond
    missing = np.cumsum(light[::-1])[::-1] - light + beyond
    return np.sqrt(missing / whole) if whole > 0 else np.zeros_like(light)


def _unknown_light(lighting: Lighting, passed: Array) -> float:
    """The integral of the squared light beyond its expansion that a squared lobe lets pass.

    It goes on as white light does, ``(2l+1)`` times the mean power of the last degrees; or all
    the energy that is left sits where the lobe passes most of it, if that is less.
    """
    known = lighting.order + 1
    power = lighting.power().sum(axis=1)
    rest = max(float(lighting.energy.sum() - power.sum()), 0.0)
    width = 2 * np.arange(len(passed)) + 1
    last = slice(max(known - 16, 0), known)
    density = power[last].sum() / width[last].sum()
    white = density * float(width[known:] @ passed[known:])
    return min(white, rest * float(passed[known:].max(initial=0.0)))


def _multipliers(coefficients: BrdfCoefficients) -> Array:
    """What a zonal lobe multiplies the light's degrees with: for l = 0 its integral."""
    values = coefficients.values[:, 0, 0, 0]
    return values / np.sqrt(2 * np.arange(len(values)) + 1)


def integrated(
    probe: Probe,
    lobe: LevelLobe,
    lighting: Lighting,
    known: MapInfo,
    largest: int,
    sampling: Sampling,
    rows: int,
    progress: Progress | None,
) -> tuple[Array, MapInfo]:
    """A level whose lobe is cut: its core sums the pixels, its smooth tail is expanded."""
    whole = _multipliers(lobe.coefficients)
    light = lighting.power().sum(axis=1) @ whole[: lighting.order + 1] ** 2
    light += _unknown_light(lighting, whole**2)
    part, predicted = 2 * _MOST_TAIL, 2 * known.tolerance
    while predicted > known.tolerance and part > _LEAST_TAIL:
        part /= 2
        tail = whole - _core_multipliers(lobe.brdf, lobe_angle(lobe.brdf, part))
        predicted = float(np.sqrt(_unknown_light(lighting, tail**2) / light)) if light > 0 else 0.0
    wanted = _source_rows(rows, lobe.brdf.ggx_alpha)
    height = None if wanted == rows else wanted
    integral = Reference(probe, lobe.brdf, height, part, progress=progress)
    order = min(lobe.order, MAX_ORDER_F)
    size = min(choose_size(order), largest)
    directions = cube_directions(size, sampling)
    cube = integral.radiance(directions, directions) + _synthesized(lighting, tail, size, sampling)
    brdf = _named(lobe.brdf.number("roughness"))
    info = replace(known, order_f=order, predicted_error=predicted, brdf=brdf, domain="angular")
    return cube, info


def _core_multipliers(brdf: GgxLobe, angle: float) -> Array:
    """`_multipliers` of the part of a lobe that is within an angle, to F = 512."""
    nodes, weights = gauss_legendre(_CORE_NODES)
    theta = (nodes + 1) / 2 * angle
    lobe = brdf.evaluate(from_angles(theta, 0.0), np.array([0.0, 0.0, 1.0]))[:, 0]
    rings = angle / 2 * weights * np.sin(theta) * lobe
    return np.array(
        [
            2 * np.pi * np.sqrt(4 * np.pi / (2 * degree + 1)) * float(legendre[0] @ rings)
            for degree, legendre in legendre_degrees(MAX_ORDER_F, np.cos(theta), max_m=0)
        ]
    )


def _synthesized(lighting: Lighting, passed: Array, size: int, sampling: Sampling) -> Array:
    """The light with its degrees multiplied, to the lesser of both orders: (6N, N, 3)."""
    degree = degrees(min(lighting.order, len(passed) - 1))
    series = lighting.coefficients[: len(degree)] * passed[degree, None]
    return np.ascontiguousarray(synthesize_cube(series, size, sampling).transpose(1, 2, 0))


def _source_rows(rows: int, alpha: float) -> int:
    """Height of the lat-long that a lobe is to be summed over, given that of the probe."""
    least = int(np.ceil(_ROWS_A_LOBE / alpha))
    if rows < least:
        return min(rows * -(-least // rows), LatLong.largest)
    return min(rows, max(2 * least, _MOST_ROWS))
