"""Ashikhmin and Shirley's anisotropic Phong model with a diffuse base."""

import math

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Brdf, Parameter, Value, scaled
from shrm_cli.brdf.vectors import (
    GRAZING,
    METALS,
    above_horizon,
    colored,
    cosines,
    fifth_power,
    half_vector,
    schlick,
)


class AshikhminShirley(Brdf):
    """A lobe about the half vector that Fresnel's term strengthens, over a diffuse base.

    The lobe is ``sqrt((nu+1) (nv+1)) / (8 pi) (N.H)^e F / (L.H max(N.L, N.V))`` with ``e = nu
    cos(phi_h)^2 + nv sin(phi_h)^2``. The base is ``28 diffuse / (23 pi) (1 - specular) (1 - (1 -
    N.L/2)^5) (1 - (1 - N.V/2)^5)``. If nu and nv differ, the BRDF is anisotropic.
    """

    name = "ashikhmin-shirley"
    summary = "half-vector lobe with Fresnel's term over a diffuse base; nu, nv: brushed surfaces"
    source = "Ashikhmin and Shirley 2000, An anisotropic Phong BRDF model, eq. 4 and 5"
    parameters = (
        Parameter("nu", 64.0, 0.0, 1e5, "exponent in x: larger is sharper"),
        Parameter("nv", 64.0, 0.0, 1e5, "exponent in y", follows="nu"),
        Parameter(
            "specular", (1.0, 1.0, 1.0), 0.0, 1.0, "reflectance at normal incidence", names=METALS
        ),
        Parameter(
            "diffuse", (0.0, 0.0, 0.0), 0.0, 1.0, "colour of the base, seen where specular < 1"
        ),
    )

    def __init__(self, **values: Value) -> None:
        super().__init__(**values)
        self.isotropic = self.values["nu"] == self.values["nv"]

    def evaluate(self, light: Array, view: Array) -> Array:
        half = half_vector(light, view)
        light_cosine, view_cosine = cosines(light, view)
        nu, nv = self.number("nu"), self.number("nv")
        # (N.H)^e = exp((nu h_x^2 + nv h_y^2) rate) with rate = log(N.H) / sin(theta_h)^2, which
        # goes to -1/2 for small theta_h.
        sine2 = np.clip(half.square_sine, 1e-12, 1 - np.finfo(half.x.dtype).eps)
        rate = np.log1p(-sine2) / (2 * sine2)
        lobe = np.exp((nu * half.x**2 + nv * half.y**2) * rate)
        scale = math.sqrt((nu + 1) * (nv + 1)) / (8 * math.pi)
        near = np.maximum(half.cosine, GRAZING) * np.maximum(light_cosine, view_cosine)
        value = above_horizon(scale * lobe / near, light, view)
        result = scaled(schlick(self.color("specular"), half.cosine), value)
        if max(self.color("diffuse")) == 0:
            return result
        base = (1 - fifth_power(1 - light_cosine / 2)) * (1 - fifth_power(1 - view_cosine / 2))
        lower = above_horizon(base * (28 / (23 * np.pi)), light, view)
        pairs = zip(self.color("diffuse"), self.color("specular"), strict=True)
        red, green, blue = (diffuse * (1 - specular) for diffuse, specular in pairs)
        return result + colored(lower, (red, green, blue))
