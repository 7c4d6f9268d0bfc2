"""Cook and Torrance's microfacets: Beckmann's distribution of slopes, in V-shaped cavities."""

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.brdf import vectors
from shrm_cli.brdf.base import Brdf, Parameter, scaled


class CookTorrance(Brdf):
    """``f_r = F D G / (4 N.L N.V)`` above the horizon.

    D is Beckmann's ``exp(-tan(theta_h)^2 / m^2) / (pi m^2 cos(theta_h)^4)``, G the geometric term
    of Torrance and Sparrow, ``min(1, 2 N.H N.V / V.H, 2 N.H N.L / V.H)``, and F Schlick's
    approximation of Fresnel's reflectance. Cook and Torrance have pi in the place of 4, and
    their surface reflects more than it receives; 4 is the Jacobian of the half vector.
    """

    name = "cook-torrance"
    summary = "microfacets with Beckmann's distribution in V-shaped cavities"
    source = "Cook and Torrance 1982, A reflectance model for computer graphics; Schlick 1994"
    parameters = (
        Parameter("roughness", 0.3, 0.005, 1.0, "m: root mean square slope"),
        vectors.NORMAL_REFLECTANCE,
    )
    roughness_power = 2

    def evaluate(self, light: Array, view: Array) -> Array:
        half = vectors.half_vector(light, view)
        light_cosine, view_cosine = vectors.cosines(light, view)
        m2 = self.number("roughness") ** 2
        z2 = np.maximum(half.z, vectors.GRAZING) ** 2
        distribution = np.exp(-half.square_sine / (z2 * m2)) / (np.pi * m2 * z2 * z2)
        larger = np.maximum(light_cosine, view_cosine)
        cavity = 2 * half.z / (np.maximum(half.cosine, vectors.GRAZING) * larger)
        visibility = np.minimum(cavity, 1 / (light_cosine * view_cosine)) / 4
        value = vectors.above_horizon(distribution * visibility, light, view)
        return scaled(vectors.schlick(self.color("f0"), half.cosine), value)
