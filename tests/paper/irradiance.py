"""Chapter 4's claim: nine coefficients are within 1 % of the light on average, and 5 % at most."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from shrm_cli.maps.irradiance.prefilter import bake_irradiance
from shrm_cli.probe.lighting import project
from shrm_cli.probe.probe import Probe, open_probe

Array = NDArray[np.floating]

CLAIMED = 0.01, 0.05
"""Average and maximum error, as fractions of the light's total intensity (section 4.3.1)."""
PROVEN = 0.0307, 0.094
"""The same for any light whatever: the mean and the largest error of order 2 for one distant
light, of which all others are sums. The thesis rounds to 3 % and 9 %."""

_NORMALS = 2000
_BLOCK = 4  # pixels along an edge that are taken together
_AT_ONCE = 2**13


@dataclass(frozen=True)
class IrradianceRow:
    """How far the irradiance of nine coefficients is from the truth under one probe.

    Errors are fractions of the light's total intensity (the integral of the radiance), of the
    worst channel.

    Attributes
    ----------
    name : str
        Of the probe.
    average, maximum : float
        Over the normals, without a window.
    minimum : float
        Least irradiance of any normal and channel, as such a fraction.
    window : str
        The factors of the degrees that `auto` chose.
    auto_average, auto_maximum, auto_minimum : float
        The same with it.
    auto_change : float
        Relative RMS difference of the irradiance with it and without.
    degree_4 : float
        Amplitude of the light's degree 4 over that of its mean, ``sqrt(sum_m L_4m^2) / L_00``:
        the first degree that is left out, and most of the error. A single distant light has 3.
    """

    name: str
    average: float
    maximum: float
    minimum: float
    window: str
    auto_average: float
    auto_maximum: float
    auto_minimum: float
    auto_change: float
    degree_4: float

    @property
    def keeps_claim(self) -> bool:
        return self.average < CLAIMED[0] and self.maximum < CLAIMED[1]


def irradiance_rows(probes: Sequence[Path]) -> list[IrradianceRow]:
    """The claim under each of several center-sampled lat-longs."""
    return [irradiance_row(open_probe(path)) for path in probes]


def irradiance_row(probe: Probe) -> IrradianceRow:
    """The claim under one probe."""
    directions, light = small_lights(probe.image())
    normals = _spread(_NORMALS)
    truth, total = integrate(normals, directions, light), light.sum(axis=0)
    plain, windowed = bake_irradiance(probe), bake_irradiance(probe, window="auto")
    found, damped = plain.map.irradiance(normals), windowed.map.irradiance(normals)
    errors, damped_errors = (np.abs(each - truth) / total for each in (found, damped))
    window, power = windowed.map.window, project(probe, 4).power().sum(axis=1)
    return IrradianceRow(
        Path(probe.name).stem,
        float(errors.mean(axis=0).max()),
        float(errors.max()),
        float((found / total).min()),
        ", ".join(f"{factor:.2f}" for factor in window.factors) or "none",
        float(damped_errors.mean(axis=0).max()),
        float(damped_errors.max()),
        float((damped / total).min()),
        float(np.sqrt(np.sum((damped - found) ** 2) / np.sum(found**2))),
        float(np.sqrt(power[4] / power[0])),
    )


def irradiance_table(rows: Sequence[IrradianceRow]) -> tuple[list[str], list[list[str]]]:
    """Head and body of the page's table."""
    head = [
        "probe", "average", "maximum", "claim kept", "least E", "window auto", "average",
        "maximum", "least E", "RMS change by the window", "degree 4 of the light over its mean",
    ]  # fmt: skip
    body = [
        [
            row.name, f"{row.average:.2%}", f"{row.maximum:.2%}",
            "yes" if row.keeps_claim else "**no**", f"{row.minimum:.2%}", row.window,
            f"{row.auto_average:.2%}", f"{row.auto_maximum:.2%}", f"{row.auto_minimum:.2%}",
            f"{row.auto_change:.2%}", f"{row.degree_4:.2f}",
        ]
        for row in rows
    ]  # fmt: skip
    return head, body


def small_lights(image: Array) -> tuple[Array, Array]:
    """A lat-long as lights: unit directions and radiance times solid angle, shape (n, 3) each.

    Neighbouring pixels are taken together, in the direction that their light comes from.
    """
    directions, solid = latlong_pixels(image.shape[0])
    light = image.astype(float) * solid[..., None]
    weights = light.sum(axis=-1, keepdims=True) + 1e-9 * solid[..., None]
    together, power = _blocks(directions * weights), _blocks(light)
    return together / np.linalg.norm(together, axis=1, keepdims=True), power


def latlong_pixels(height: int) -> tuple[Array, Array]:
    """Directions of a lat-long's pixels, (height, 2 height, 3), and solid angles, (height, 1)."""
    width = 2 * height
    edges = np.cos(np.pi * np.arange(height + 1) / height)
    solid = (edges[:-1] - edges[1:])[:, None] * (2 * np.pi / width)
    polar = np.pi * (np.arange(height) + 0.5)[:, None] / height
    turn = 2 * np.pi * (0.5 - (np.arange(width) + 0.5) / width)
    directions = np.stack(
        np.broadcast_arrays(
            np.sin(polar) * np.sin(turn), np.cos(polar), np.sin(polar) * np.cos(turn)
        ),
        axis=-1,
    )
    return directions, solid


def integrate(normals: Array, directions: Array, light: Array) -> Array:
    """Irradiance by the sum over all lights (eq. 4.1), shape (len(normals), 3)."""
    result = np.zeros((len(normals), 3))
    facing, lights = normals.astype(np.float32), directions.astype(np.float32).T
    power = light.astype(np.float32)
    for start in range(0, len(light), _AT_ONCE):
        part = slice(start, start + _AT_ONCE)
        cosines = facing @ lights[:, part]
        result += np.maximum(cosines, 0, out=cosines) @ power[part]
    return result


def _blocks(values: Array) -> Array:
    """Sums over blocks of neighbours, in one row, shape (n, channels)."""
    rows, columns, channels = values.shape
    split = values.reshape(rows // _BLOCK, _BLOCK, columns // _BLOCK, _BLOCK, channels)
    return split.sum(axis=(1, 3)).reshape(-1, channels)


def _spread(count: int) -> Array:
    """Normals spread evenly: the golden angle's spiral."""
    z = (2 * np.arange(count) + 1) / count - 1
    turn = np.arange(count) * np.pi * (3 - np.sqrt(5))
    return np.stack(
        [np.sqrt(1 - z**2) * np.cos(turn), np.sqrt(1 - z**2) * np.sin(turn), z], axis=-1
    )
