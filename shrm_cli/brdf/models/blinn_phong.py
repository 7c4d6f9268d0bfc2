"""Blinn's cosine lobe about the half vector, normalized."""

import math

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Brdf, Parameter
from shrm_cli.brdf.vectors import above_horizon, colored, half_vector


class BlinnPhong(Brdf):
    """``f_r = color (n+2) (n+4) / (8 pi (2^(-n/2) + n)) (N.H)^n`` above the horizon.

    With this factor it reflects exactly `color` of a uniform light when seen along the normal, and
    less from elsewhere.
    """

    name = "blinn-phong"
    summary = "normalised cosine lobe about the half vector"
    source = "Blinn 1977; normalised after Akenine-Moeller et al. 2018, section 9.8"
    parameters = (
        Parameter("exponent", 64.0, 0.0, 1e5, "n: larger is sharper"),
        Parameter("color", (1.0, 1.0, 1.0), 0.0, 1.0, "reflectance seen from the normal"),
    )

    def evaluate(self, light: Array, view: Array) -> Array:
        half = half_vector(light, view)
        n = self.number("exponent")
        # Computed from the sine, (N.H)^n is exact in single precision even for large n.
        sine2 = np.minimum(half.square_sine, 1 - np.finfo(half.x.dtype).eps)
        value = normalization(n) * np.exp(n / 2 * np.log1p(-sine2))
        return colored(above_horizon(value, light, view), self.color("color"))


def normalization(exponent: float) -> float:
    """Compute ``1 / int (N.H)^n N.L dL`` for a view along the normal."""
    return (exponent + 2) * (exponent + 4) / (8 * math.pi * (2 ** (-exponent / 2) + exponent))
