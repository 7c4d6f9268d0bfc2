"""Phong's cosine lobe about the mirror direction."""

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Brdf, Parameter, grey
from shrm_cli.brdf.vectors import power


class Phong(Brdf):
    """``rho_hat = (s + 1) / (2 pi) (R.L)^s`` where R.L > 0.

    R is the mirror direction of the view. The lobe is eq. 5.26 of Ramamoorthi's thesis (2002).
    """

    name = "phong"
    summary = "normalised cosine lobe about the mirror direction, a transfer function"
    source = "Phong 1975; normalised as Ramamoorthi 2002, eq. 5.26"
    parameters = (Parameter("exponent", 32.0, 0.0, 1e5, "s: larger is sharper"),)
    includes_cosine = True
    has_horizon = False
    zonal = True

    def evaluate(self, light: Array, view: Array) -> Array:
        # The mirror direction is R = (-Vx, -Vy, Vz) in the frame of the normal.
        cosine = light[..., 2] * view[..., 2]
        cosine = cosine - light[..., 0] * view[..., 0] - light[..., 1] * view[..., 1]
        exponent = self.number("exponent")
        return grey((exponent + 1) / (2 * np.pi) * power(np.minimum(cosine, 1.0), exponent))
