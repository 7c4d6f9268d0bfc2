"""What is in a probe, in numbers: `probe_statistics`."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array
from shrm_cli.color import title_of, xyz_matrix
from shrm_cli.lights.beside import MUCH, SMALL
from shrm_cli.lights.clipping import REACHES, Plateau, suspicion
from shrm_cli.lights.lamp import Lamp
from shrm_cli.lights.split import light_coefficients, split_lamps
from shrm_cli.maps.irradiance.irradiance import lambert_factors
from shrm_cli.messages import whole_number
from shrm_cli.probe.coarse import fine_probe
from shrm_cli.probe.light_sum import LightSum
from shrm_cli.probe.lighting import PolarRows, project
from shrm_cli.probe.open import AnyProbe, as_probe
from shrm_cli.probe.pixels import refuse_overflow
from shrm_cli.progress import report
from shrm_cli.records import record
from shrm_cli.sphere.directions import to_azimuth_elevation
from shrm_cli.sphere.harmonics import degrees, order_of, real_harmonics
from shrm_cli.sphere.rotation import transform_coefficients

AXES = ("+X", "-X", "+Y", "-Y", "+Z", "-Z")
_ORDER = 32
"""Degrees of the light that make the irradiance, but for that of lamps."""
_LOW, _HIGH = 0.01, 0.999
"""Shares of the sphere between whose luminances the range is."""
_LEAST_STOP, _BINS_A_STOP, _STOPS = -60, 64, 160
_LEAST_GREEN = 1e-6
"""Light with less green, over its largest channel, has none: it is what rounding left."""
_COLDEST, _HOTTEST, _FARTHEST = 1000.0, 25000.0, 0.05
"""Temperatures in kelvin, and the distance from the black body in CIE 1960 u and v, within which a
correlated colour temperature means something."""

_UNCLIP = "clipped light is too dim: `shrm probe unclip` mends a sun by a reading"
"""What to do where light reaches an end, which is sure; even lamps look like other plateaus."""


@record(eq=False)
class ProbeStatistics:
    """Numbers about the light of a probe: radiance in its unit, irradiance in that times sr."""

    minimum: Array
    maximum: Array
    mean: Array
    """`minimum`, `maximum` and `mean`: radiance of the pixels; the mean is over the sphere, shape
    (3,)."""
    mean_luminance: float
    """The luminance of the mean, with the weights of the probe's primaries."""
    stops: float
    """Between the luminances that 1 % and 99.9 % of the sphere are below, black pixels left out."""
    stops_whole: float
    """Between the least luminance above 0 and the largest one."""
    irradiance: Array
    """What surfaces get whose normals are `AXES`; +Y is that of the ground, shape (6, 3)."""
    chromaticity: tuple[float, float] | None
    """CIE x and y of the mean."""
    temperature: float | None
    duv: float | None
    """`temperature` and `duv`: correlated colour temperature of the mean in kelvin, and its
    distance from the black body. None where it has none."""
    white_balance: Array | None
    """The mean over its green, shape (3,). None of light without green."""
    direction: Array
    """Unit, world axes: where the light comes from, by the linear harmonics of the luminance. 0 of
    light without a direction, shape (3,)."""
    directionality: float
    """The length of that vector over the mean: 0 of constant light, 1 of light from one point."""
    clipped: str
    """Why the maximum is suspected to be clipped; empty if it is not."""
    primaries: str
    """The name of the primaries."""
    lamps: tuple[Lamp, ...]
    """The brightest, see `shrm_cli.lights`."""
    lamp_shares: tuple[float, ...]
    """The part of the luminance of all light that each of them holds."""

    @property
    def advice(self) -> str:
        """What to do about clipped light, and small lamps that hold much of it; or empty."""
        of_ends = _UNCLIP if REACHES in self.clipped else ""
        return "; ".join(filter(None, (self._split_advice, of_ends)))

    @property
    def _split_advice(self) -> str:
        pairs = zip(self.lamps, self.lamp_shares, strict=True)
        small = [(lamp.radius, share) for lamp, share in pairs if lamp.radius < SMALL]
        sizes, share = [np.degrees(radius) for radius, _ in small], sum(each for _, each in small)
        if share <= MUCH:
            return ""
        low, high = (f"{each:.2g}" for each in (min(sizes), max(sizes)))
        if len(sizes) == 1:
            return f"one lamp of {low} degrees holds {share:.0%} of the light: `--sun split`"
        span = low if low == high else f"{low} to {high}"
        return f"{len(sizes)} lamps of {span} degrees hold {share:.0%} of the light: `--sun split`"

    def summary(self) -> dict[str, Any]:
        """The numbers by name, for JSON. Directions are azimuth and elevation in degrees."""
        white = {
            "over_green": None if self.white_balance is None else self.white_balance.tolist(),
            "xy": None if self.chromaticity is None else list(self.chromaticity),
            "kelvin": self.temperature,
            "duv": self.duv,
        }
        return {
            "minimum": self.minimum.tolist(),
            "maximum": self.maximum.tolist(),
            "mean": self.mean.tolist(),
            "mean_luminance": self.mean_luminance,
            "stops": {"1%_to_99.9%": self.stops, "least_to_most": self.stops_whole},
            "irradiance": dict(zip(AXES, self.irradiance.tolist(), strict=True)),
            "white_balance": white,
            "light_from": {
                "azimuth_elevation": list(to_azimuth_elevation(self.direction)),
                "directionality": self.directionality,
            },
            "clipped": self.clipped,
            "primaries": self.primaries,
            "lamps": [
                {**lamp.summary(), "share": share}
                for lamp, share in zip(self.lamps, self.lamp_shares, strict=True)
            ],
            "advice": self.advice,
        }


def probe_statistics(probe: AnyProbe, lamps: int = 3) -> ProbeStatistics:
    """Read the pixels of a probe, block by block, and say what is in them.

    Parameters
    ----------
    probe : Probe, path-like or array
    lamps : int
        The most lamps to look for; 0 saves the time that it takes.

    Raises
    ------
    ProbeError
        If the probe cannot be read, or its light is beyond 32-bit floats.

    Examples
    --------
    >>> found = shrm.probe_statistics(shrm.open_probe("probes/furnace.exr")).summary()
    >>> found["lamps"]
    []
    """
    probe, lamps = as_probe(probe), whole_number("lamps", lamps, 0, 100)
    to_xyz = xyz_matrix(probe.chromaticities)
    gathered = _Gathered(to_xyz[1])
    order = min(_ORDER, probe.grid.resolved_order)
    analysis = probe.grid.analysis(order)
    polar_rows = PolarRows(probe.grid)
    for start, pixels, weights in probe.blocks():
        gathered.add(pixels, weights)
        analysis.add(start, pixels, weights)
        polar_rows.add(start, pixels)
        report(start + len(pixels), probe.height)
    for polar in polar_rows.lamps():
        weights = probe.grid.weights(polar.start, polar.start + len(polar.excess))
        analysis.add(polar.start, polar.light, weights)
    coefficients = analysis.coefficients()
    refuse_overflow(probe.name, coefficients)
    light = transform_coefficients(coefficients, probe.matrix)
    is_series = isinstance(probe, LightSum) and probe.is_series
    if is_series:  # its pixels are negative nowhere, which coefficients need not be
        light = project(probe, order).coefficients
    mean = light[0] / np.sqrt(4 * np.pi)
    point = chromaticity(mean, probe.chromaticities)
    temperature = None if point is None else color_temperature(*point)
    direction, directionality = _direction(light @ to_xyz[1])
    found = split_lamps(probe).lamps if lamps and mean.any() else ()
    if is_series:
        irradiance = _irradiance(light, ())
    else:
        fine = fine_probe(probe)  # horizons cut large pixels, which are no points
        of_normals = light if fine is probe else project(fine, _ORDER).coefficients
        irradiance = np.maximum(_irradiance(of_normals, found), 0)
    pixel = 4 * np.pi / (probe.grid.shape[0] * probe.grid.shape[1])
    first = probe.images[0]
    total, stated = 4 * np.pi * float(to_xyz[1] @ mean), probe.chromaticities
    return ProbeStatistics(
        minimum=gathered.low,
        maximum=np.array([each.high for each in gathered.plateaus]),
        mean=mean,
        mean_luminance=float(to_xyz[1] @ mean),
        stops=gathered.stops(),
        stops_whole=gathered.stops_whole(),
        irradiance=irradiance,
        chromaticity=point,
        temperature=temperature,
        duv=None if point is None or temperature is None else blackbody_distance(*point),
        white_balance=mean / mean[1] if mean[1] > _LEAST_GREEN * mean.max() else None,
        direction=direction,
        directionality=directionality,
        clipped=suspicion(gathered.plateaus, pixel, mean, first.largest, first.given),
        primaries="not stated; taken for Rec.709" if stated is None else title_of(stated),
        lamps=found[:lamps],
        lamp_shares=tuple(float(to_xyz[1] @ lamp.light.flux) / total for lamp in found[:lamps]),
    )


def _irradiance(light: Array, lamps: Sequence[Lamp]) -> Array:
    """Return the irradiance of surfaces whose normals are `AXES`, shape (6, 3).

    What lies beyond their degrees is small beside that, but much on the dark side of a sun, where
    it would make a sixth of the sky's light: of the pixels of lamps it is added, as the difference
    of the cosine and its expansion.
    """
    order = order_of(len(light))
    axes = np.repeat(np.eye(3), 2, axis=0) * np.tile([1.0, -1.0], 3)[:, None]
    expansion = real_harmonics(order, axes) * lambert_factors(order)[degrees(order)]
    result = expansion @ light
    for each in (lamp.light for lamp in lamps):
        flux = each.radiance * each.areas[:, None]
        result += np.maximum(axes @ each.directions.T, 0) @ flux
        result -= expansion @ light_coefficients(each, order)
    return result


def _direction(luminance: Array) -> tuple[Array, float]:
    """Where light comes from, and how directed it is, by its first four coefficients."""
    if len(luminance) < 4 or luminance[0] <= 0:
        return np.zeros(3), 0.0
    vector = luminance[[3, 1, 2]] / (np.sqrt(3) * luminance[0])
    length = float(np.linalg.norm(vector))
    return (vector / length if length > 1e-6 else np.zeros(3)), length


@dataclass
class _Gathered:
    """What is gathered of the pixels while they are read: extremes, and a histogram."""

    weights_of_channels: Array
    low: Array = field(default_factory=lambda: np.full(3, np.inf))
    least: float = np.inf
    most: float = 0.0
    histogram: Array = field(default_factory=lambda: np.zeros(_STOPS * _BINS_A_STOP))
    plateaus: tuple[Plateau, ...] = field(default_factory=lambda: (Plateau(), Plateau(), Plateau()))
    """The plateau of each channel."""

    def add(self, pixels: Array, weights: Array) -> None:
        """Take in a block of rows."""
        areas = np.broadcast_to(weights, pixels.shape[:2])
        for channel in range(3):
            plane = pixels[..., channel]
            # Numpy takes several times as long for extremes along two axes of three.
            self.low[channel] = min(self.low[channel], float(plane.min()))
            self.plateaus[channel].add(plane, areas)
        luminance = pixels @ self.weights_of_channels.astype(pixels.dtype)
        lit = luminance > 0
        if not lit.any():
            return
        values = luminance[lit]
        self.least = min(self.least, float(values.min()))
        self.most = max(self.most, float(values.max()))
        bins = ((np.log2(values) - _LEAST_STOP) * _BINS_A_STOP).astype(np.intp)
        size = len(self.histogram)
        np.clip(bins, 0, size - 1, out=bins)
        self.histogram += np.bincount(bins, areas[lit], size)

    def stops(self) -> float:
        """Stops between two quantiles of the luminance over the sphere, to 1/64."""
        total = np.cumsum(self.histogram)
        if total[-1] <= 0:
            return 0.0
        low, high = np.searchsorted(total, np.array([_LOW, _HIGH]) * total[-1])
        return float(high - low) / _BINS_A_STOP

    def stops_whole(self) -> float:
        """Stops between the least luminance above 0 and the largest."""
        return float(np.log2(self.most / self.least)) if self.most > 0 else 0.0


def chromaticity(rgb: ArrayLike, primaries: Sequence[float] | None) -> tuple[float, float] | None:
    """CIE 1931 x and y of linear RGB; None of black."""
    xyz = xyz_matrix(primaries) @ np.asarray(rgb, dtype=float)
    total = float(xyz.sum())
    return None if total <= 0 else (float(xyz[0] / total), float(xyz[1] / total))


def color_temperature(x: float, y: float) -> float | None:
    """Correlated colour temperature in kelvin; None where light has none.

    `x` and `y` are CIE 1931 chromaticity.

    References: McCamy 1992: within 2 K of the black body from 2856 K to 6504 K, and within 3 % from
    2000 K to 12500 K.
    """
    if y == 0.1858 or abs(blackbody_distance(x, y)) > _FARTHEST:
        return None
    n = (x - 0.3320) / (0.1858 - y)
    found = 449 * n**3 + 3525 * n**2 + 6823.3 * n + 5520.33
    return float(found) if _COLDEST <= found <= _HOTTEST else None


def blackbody_distance(x: float, y: float) -> float:
    """Distance from the black body's curve in CIE 1960 u and v, above 0 for greenish light.

    References: Ohno 2014, "Practical use and calculation of CCT and Duv", eq. 6 to 8.
    """
    denominator = -2 * x + 12 * y + 3
    u, v = 4 * x / denominator, 6 * y / denominator
    radius = float(np.hypot(u - 0.292, v - 0.24))
    angle = np.arccos(np.clip((u - 0.292) / max(radius, 1e-12), -1, 1))
    curve = np.polyval(
        [-0.00616793, 0.0893944, -0.5179722, 1.5317403, -2.4243787, 1.925865, -0.471106], angle
    )
    return float(radius - curve)
