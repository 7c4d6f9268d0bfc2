"""The simplified microfacet model of Ramamoorthi's thesis (2002), section 5.7.1."""

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Brdf, Parameter, grey


class Microfacet(Brdf):
    """``rho_hat = exp(-(theta_h / sigma)^2) / (4 pi sigma^2)`` above the horizon.

    theta_h is the angle between the normal and the half vector. Light from below the surface
    (N.L < 0) is not reflected. It is eq. 5.34 of the thesis.
    """

    name = "microfacet"
    summary = "Gaussian lobe in the half angle, a transfer function"
    source = "Ramamoorthi 2002, eq. 5.34, after Torrance and Sparrow 1967"
    parameters = (Parameter("sigma", 0.2, 0.005, 1.0, "surface roughness, radians"),)
    includes_cosine = True

    def evaluate(self, light: Array, view: Array) -> Array:
        half = light + view
        x, y = half[..., 0], half[..., 1]
        # atan2 is exact for small angles, where the arc cosine of N.H is not.
        angle = np.arctan2(np.sqrt(x * x + y * y), half[..., 2])
        sigma = self.number("sigma")
        return grey(np.exp(-((angle / sigma) ** 2)) / (4 * np.pi * sigma**2))
