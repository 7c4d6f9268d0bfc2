"""The GGX microfacet model of most renderers."""

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Brdf, Parameter, scaled
from shrm_cli.brdf.vectors import NORMAL_REFLECTANCE, above_horizon, cosines, half_vector, schlick
from shrm_cli.vocabulary import MIN_ROUGHNESS


class Ggx(Brdf):
    """``f_r = F D G / (4 N.L N.V)`` above the horizon, with ``a = roughness^2``.

    D is ``1 / (pi a^2 (tan(theta_h)^2 / a^2 + 1)^2 cos(theta_h)^4)``, G is Smith's for correlated
    heights of light and view, and F Schlick's approximation of Fresnel's reflectance. Light that
    meets several facets is lost.
    """

    name = "ggx"
    summary = "microfacets with the long tails of real surfaces, as most renderers have them"
    source = "Walter et al. 2007, eq. 33; G: Heitz 2014, eq. 99; a = roughness^2: Burley 2012"
    parameters = (
        Parameter(
            "roughness", 0.4, MIN_ROUGHNESS, 1.0, "perceptual roughness, the root of GGX's alpha"
        ),
        NORMAL_REFLECTANCE,
    )

    def evaluate(self, light: Array, view: Array) -> Array:
        half = half_vector(light, view)
        light_cosine, view_cosine = cosines(light, view)
        a2 = self.number("roughness") ** 4
        distribution = 1 / (np.pi * a2 * (half.square_sine / a2 + half.z**2) ** 2)
        masking = light_cosine * np.sqrt(a2 + (1 - a2) * view_cosine**2)
        shadowing = view_cosine * np.sqrt(a2 + (1 - a2) * light_cosine**2)
        value = above_horizon(distribution / (2 * (masking + shadowing)), light, view)
        return scaled(schlick(self.color("f0"), half.cosine), value)
