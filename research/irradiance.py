"""The claim that the irradiance of nine coefficients has an error of 1 % on average, 5 % at most.

It is made in chapter 4 of Ramamoorthi's thesis, "A Signal-Processing Framework for Forward and
Inverse Rendering" (2002). Equations 4.x are those of that chapter.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from shrm_cli.maps.irradiance.irradiance import Irradiance
from shrm_cli.maps.request import Request
from shrm_cli.prefilter import make
from shrm_cli.probe.lighting import project
from shrm_cli.probe.open import open_probe
from shrm_cli.probe.probe import Probe

Array = NDArray[np.floating]

CLAIMED = 0.01, 0.05
"""The claimed average and maximum error, as fractions of the light's total intensity (section 4.3.1
of the thesis)."""
PROVEN = 0.0307, 0.094
"""Proven bounds of the same errors for any light: the mean and the largest error of order 2 for one
distant light. All other lights are sums of such lights. The thesis rounds to 3 % and 9 %."""

_NORMALS = 2000
"""The number of normals where irradiance is compared."""
_BLOCK = 4
"""Blocks of pixels with this many along an edge are taken together as one light."""
_AT_ONCE = 2**13
"""The number of lights that are summed over at a time."""


@dataclass(frozen=True)
class IrradianceRow:
    """How far the irradiance of nine coefficients is from the truth under one probe.

    Errors are fractions of the light's total intensity, which is the integral of the radiance. They
    are those of the worst channel.

    Attributes
    ----------
    name : str
        The name of the probe.
    average, maximum : float
        The errors over the normals, without a window.
    minimum : float
        Least irradiance of any normal and channel, as a fraction of the total intensity.
    window : str
        The factors of the degrees that the window ``auto`` chose.
    auto_average, auto_maximum, auto_minimum : float
        The same as `average`, `maximum` and `minimum`, with this window.
    auto_change : float
        Relative RMS difference of the irradiance with this window and without.
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
    """Test the claim under each of several probes, which must be center-sampled lat-longs."""
    return [irradiance_row(open_probe(path)) for path in probes]


def _made(probe: Probe, window: str) -> Irradiance:
    made = make(probe, Request.of("irradiance", {"window": window}, probe)).map
    assert isinstance(made, Irradiance)
    return made


def irradiance_row(probe: Probe) -> IrradianceRow:
    """Test the claim under one probe."""
    directions, light = small_lights(probe.image())
    normals = _spread(_NORMALS)
    truth, total = integrate(normals, directions, light), light.sum(axis=0)
    plain, windowed = (_made(probe, window) for window in ("none", "auto"))
    found, damped = plain.irradiance(normals), windowed.irradiance(normals)
    errors, damped_errors = (np.abs(each - truth) / total for each in (found, damped))
    window, power = windowed.window, project(probe, 4).power().sum(axis=1)
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
    """Return head and body of the page's table."""
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
    """Turn a lat-long into n lights: unit directions and radiance times solid angle, both (n, 3).

    Neighbouring pixels are taken together as one light, in the mean direction of their light.
    """
    directions, solid = latlong_pixels(image.shape[0])
    light = image.astype(float) * solid[..., None]
    weights = light.sum(axis=-1, keepdims=True) + 1e-9 * solid[..., None]
    together, power = _blocks(directions * weights), _blocks(light)
    return together / np.linalg.norm(together, axis=1, keepdims=True), power


def latlong_pixels(height: int) -> tuple[Array, Array]:
    """Return directions and solid angles of a lat-long's pixels.

    Their shapes are (height, 2 height, 3) and (height, 1).
    """
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
    """Compute irradiance by the sum over all lights (eq. 4.1), shape (len(normals), 3)."""
    result = np.zeros((len(normals), 3))
    facing, lights = normals.astype(np.float32), directions.astype(np.float32).T
    power = light.astype(np.float32)
    for start in range(0, len(light), _AT_ONCE):
        part = slice(start, start + _AT_ONCE)
        cosines = facing @ lights[:, part]
        result += np.maximum(cosines, 0, out=cosines) @ power[part]
    return result


def _blocks(values: Array) -> Array:
    """Sum over blocks of neighbours, and list the sums, shape (n, channels)."""
    rows, columns, channels = values.shape
    split = values.reshape(rows // _BLOCK, _BLOCK, columns // _BLOCK, _BLOCK, channels)
    return split.sum(axis=(1, 3)).reshape(-1, channels)


def _spread(count: int) -> Array:
    """Spread normals evenly along the spiral of the golden angle."""
    z = (2 * np.arange(count) + 1) / count - 1
    turn = np.arange(count) * np.pi * (3 - np.sqrt(5))
    return np.stack(
        [np.sqrt(1 - z**2) * np.cos(turn), np.sqrt(1 - z**2) * np.sin(turn), z], axis=-1
    )
