"""Probe -> Lighting: the spherical harmonic coefficients of the incident light."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shrm_cli.probe.probe import Probe
from shrm_cli.sphere.harmonics import order_of
from shrm_cli.sphere.rotation import transform_coefficients
from shrm_cli.sphere.synthesis import integrate_cube
from shrm_cli.sphere.transform import LatLongAnalysis, analyze_angular

Array = NDArray[np.floating]
Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class Lighting:
    """Incident light in the frequency domain.

    Attributes
    ----------
    coefficients : ndarray, shape ((order+1)^2, 3)
        L_lm over the real harmonics of world axes, index l(l+1)+m.
    energy : ndarray, shape (3,)
        The integral of the squared radiance (eq. 5.15), of all frequencies.
    """

    coefficients: Array
    energy: Array

    def __post_init__(self) -> None:
        if self.coefficients.shape != ((self.order + 1) ** 2, 3) or self.energy.shape != (3,):
            raise ValueError(f"lighting coefficients of shape {self.coefficients.shape}")

    @property
    def order(self) -> int:
        return order_of(len(self.coefficients))

    def power(self) -> Array:
        """``sum_m |L_lm|^2`` of each degree and channel, shape (order+1, 3)."""
        starts = np.arange(self.order + 1) ** 2
        return np.add.reduceat(self.coefficients**2, starts)


def project(probe: Probe, order: int, progress: Progress | None = None) -> Lighting:
    """Project a probe onto the spherical harmonics (eq. 5.20, 5.21).

    Parameters
    ----------
    probe : Probe
    order : int
    progress : callable, optional
        Called with rows done and rows in all.

    Returns
    -------
    Lighting
        A lat-long is integrated by Fejer's or Clenshaw and Curtis's rule, exactly for images
        band-limited below half its height; texels of cubes and angular maps by their solid
        angle. Degrees that are finer than the pixels are 0.
    """
    energy = np.zeros(3)
    resolved = min(order, _resolved_order(probe))
    coefficients: Array = np.zeros(((resolved + 1) ** 2, 3))
    latlong = None
    if probe.grid == "latlong":
        latlong = LatLongAnalysis(probe.width, probe.height, resolved, probe.sampling)
    for start, pixels, weights in probe.blocks():
        energy += _squared(pixels, weights)
        if latlong is not None:
            latlong.add(start, pixels)
        elif probe.grid == "cube":
            weighted = (pixels * weights[..., None]).transpose(2, 0, 1)
            coefficients = integrate_cube(weighted, resolved, probe.sampling)
        else:
            weighted = pixels * weights[..., None]
            coefficients = analyze_angular(weighted, resolved, probe.sampling)
        if progress is not None:
            progress(start + len(pixels), probe.height)
    if latlong is not None:
        coefficients = latlong.coefficients()
    if not np.array_equal(probe.matrix, np.eye(3)):
        coefficients = transform_coefficients(coefficients, probe.matrix)
    result = np.zeros(((order + 1) ** 2, 3))
    result[: (resolved + 1) ** 2] = coefficients
    return Lighting(result, energy)


def _resolved_order(probe: Probe) -> int:
    """The largest degree whose waves are at least two pixels long.

    Sums over the pixels with shorter ones are aliases: a constant would have them.
    """
    shared = 1 if probe.sampling == "border" and probe.width > 1 else 0
    if probe.grid == "latlong":
        half_turn = probe.height - shared
    elif probe.grid == "cube":
        half_turn = 2 * (probe.width - shared)
    else:
        half_turn = (probe.width - shared) // 2
    return max(half_turn - 1, 0)


def _squared(pixels: Array, weights: Array) -> Array:
    """Integral of the squared radiance of each channel."""
    if weights.shape[1] == 1:
        return np.asarray(weights[:, 0] @ np.einsum("ijc,ijc->ic", pixels, pixels, dtype=float))
    return np.asarray(np.einsum("ijc,ijc,ij->c", pixels, pixels, weights, dtype=float))
