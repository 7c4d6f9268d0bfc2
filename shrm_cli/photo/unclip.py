"""A lamp that a camera clipped, made as bright as a reading says.

A sun has a hundred thousand times the radiance of its sky, which hardly any exposure holds. A grey
card under it, or a light meter, tells the irradiance of sun and sky together. What the probe gives
without its lamp is known; the rest is the lamp's.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.arrays import Array
from shrm_cli.errors import ArgumentError, ProbeError
from shrm_cli.lights.lamp import Light
from shrm_cli.lights.pixels import SpherePixels, clusters
from shrm_cli.probe.open import AnyProbe, as_probe
from shrm_cli.probe.probe import Probe
from shrm_cli.probe.resample import to_grid
from shrm_cli.records import record
from shrm_cli.sphere.directions import as_directions
from shrm_cli.vocabulary import LUMINANCE

PLATEAU = 0.95
"""What is so much of the largest brightness was clipped, too. The glow about a sun is darker: with
.5 the shipped sky, clipped at 40, lights other surfaces 4 % wrong, with .95 .2 %."""
LARGEST = 0.3
"""The solid angle of what may be a lamp, sr: a disc of 18 degrees in radius. Skies are larger."""


@record(eq=False)
class Unclipped:
    """A probe whose brightest lamp gives what a reading says."""

    probe: Probe
    """The probe that was given."""
    pixels: NDArray[np.float32]
    """On the probe's grid, in world axes."""
    direction: Array
    """The unit direction of the lamp, shape (3,)."""
    solid_angle: float
    """What its pixels take together, sr."""
    factors: Array
    """What its light was multiplied with, shape (3,)."""
    radiance: Array
    """The most that its pixels have now, shape (3,)."""


def unclip(
    probe: AnyProbe,
    irradiance: ArrayLike | None = None,
    ratio: float | None = None,
    normal: ArrayLike = (0.0, 1.0, 0.0),
) -> Unclipped:
    """Make the brightest lamp of a probe as bright as a reading says.

    Parameters
    ----------
    probe : Probe, path-like or array
    irradiance : array_like, scalar or shape (3,), optional
        What a surface receives from all light, in the probe's units: pi times the radiance of a
        grey card over its albedo.
    ratio : float, optional
        Instead, the reading of a light meter over its reading in the lamp's shadow.
    normal : array_like, shape (3,)
        Where the card or the meter faced, world axes; up by default.

    Returns
    -------
    Unclipped

    Raises
    ------
    ArgumentError
        If not one of both readings is given, or it asks for less than the probe gives already.
    ProbeError
        If the probe has no lamp, or none that the surface faces.

    Examples
    --------
    >>> made = shrm.unclip("probes/sky.exr", ratio=10)
    >>> made.factors.round(1).tolist()
    [8.3, 8.3, 8.3]
    """
    if (irradiance is None) == (ratio is None):
        raise ArgumentError("irradiance", "or `ratio` must be given, and not both")
    reading = np.asarray(irradiance if ratio is None else ratio, dtype=float)
    argument = "irradiance" if ratio is None else "ratio"
    if reading.shape not in ((), (3,)) or not np.isfinite(reading).all():
        raise ArgumentError(argument, f"is {reading.tolist()}; give a finite number, or three")
    (facing,) = as_directions(normal=normal)
    probe = as_probe(probe)
    image, grid = to_grid(probe, probe.grid), probe.grid
    numbers, lamp = _lamp(probe, image)
    own = (lamp.areas * np.maximum(lamp.directions @ facing, 0)) @ lamp.radiance
    cosines = np.maximum(grid.directions() @ facing, 0) * grid.weights()
    rest = np.einsum("hw,hwc->c", cosines, image, dtype=float) - own
    if own.min() <= 0:
        raise ProbeError(
            f"{probe.name}: its brightest lamp does not light a surface that faces so; give the "
            "direction that the card or the meter faced"
        )
    if ratio is not None:
        factors = np.full(3, (ratio - 1) * (rest @ LUMINANCE) / (own @ LUMINANCE))
    else:
        factors = (reading - rest) / own
    # A channel that was not clipped may be a little less, by the noise of the reading.
    grows = ((factors - 1) * own) @ LUMINANCE > 0
    if not (grows and np.isfinite(factors).all() and factors.min() > 0):
        there = ", ".join(f"{each:.4g}" for each in own + rest)
        raise ArgumentError(
            argument,
            f"is below the irradiance {there} that {probe.name} gives already (a ratio of "
            f"{(own + rest) @ LUMINANCE / (rest @ LUMINANCE):.4g}); check its units, its albedo "
            "and where it faced",
        )
    grown = lamp.radiance * factors
    image.reshape(-1, 3)[numbers] = grown
    area = float(lamp.areas.sum())
    return Unclipped(probe, image, lamp.axis, area, factors, grown.max(axis=0))


def _lamp(probe: Probe, image: Array) -> tuple[NDArray[np.intp], Light]:
    """Return the pixels about as bright as the brightest one, and next to it: numbers and light."""
    brightness = (image @ LUMINANCE).ravel()
    numbers = np.flatnonzero(brightness >= PLATEAU * brightness.max())
    pixels = SpherePixels(probe.grid)
    areas = pixels.areas(numbers)
    if areas.sum() > LARGEST:
        raise ProbeError(
            f"{probe.name}: no lamp stands out of its light, of which {areas.sum():.3g} sr is "
            "about as bright as its brightest pixel"
        )
    radiance = image.reshape(-1, 3)[numbers].astype(float)
    light = Light(pixels.directions(numbers), radiance, areas)
    labels = clusters(light.directions, 2 * pixels.pitch)
    near = labels == labels[np.argmax(brightness[numbers])]
    return numbers[near], light.where(near)
