"""Probe -> Lighting: the spherical harmonic coefficients of the incident light."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shrm_cli.probe.probe import Probe
from shrm_cli.sphere.grids import angular_directions
from shrm_cli.sphere.rotation import transform_coefficients
from shrm_cli.sphere.synthesis import integrate_cube
from shrm_cli.sphere.transform import LatLongAnalysis, analyze_samples

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
        count = int(np.sqrt(len(self.coefficients)))
        if self.coefficients.shape != (count**2, 3) or self.energy.shape != (3,):
            raise ValueError(f"lighting coefficients of shape {self.coefficients.shape}")

    @property
    def order(self) -> int:
        return int(np.sqrt(len(self.coefficients))) - 1

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
        band-limited below its height; texels of cubes and angular maps by their solid angle.
    """
    energy = np.zeros(3)
    latlong = LatLongAnalysis(probe.width, probe.height, order, probe.sampling)
    coefficients = None
    for start, pixels, weights in probe.blocks():
        energy += _squared(pixels, weights)
        if probe.grid == "latlong":
            latlong.add(start, pixels)
        elif probe.grid == "cube":
            weighted = (pixels * weights[..., None]).transpose(2, 0, 1)
            coefficients = integrate_cube(weighted, order, probe.sampling)
        else:
            directions, inside = angular_directions(probe.width, probe.sampling)
            coefficients = analyze_samples(
                directions[inside], weights[inside], pixels[inside], order
            )
        if progress is not None:
            progress(start + len(pixels), probe.height)
    if coefficients is None:
        coefficients = latlong.coefficients()
    if not np.array_equal(probe.matrix, np.eye(3)):
        coefficients = transform_coefficients(coefficients, probe.matrix)
    return Lighting(coefficients, energy)


def _squared(pixels: Array, weights: Array) -> Array:
    """Integral of the squared radiance of each channel."""
    if weights.shape[1] == 1:
        return np.asarray(weights[:, 0] @ np.einsum("ijc,ijc->ic", pixels, pixels, dtype=float))
    return np.einsum("ijc,ijc,ij->c", pixels, pixels, weights, dtype=float)
