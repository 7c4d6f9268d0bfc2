"""Disney's diffuse term, whose retroreflection at grazing angles grows with the roughness."""

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Brdf, Parameter
from shrm_cli.brdf.vectors import colored, fifth_power, tangential


class DisneyDiffuse(Brdf):
    """``f_r = color / pi (1 + g (1 - N.L)^5) (1 + g (1 - N.V)^5)``.

    Here ``g = 2 roughness (L.H)^2 - 1/2``. The model was fitted to measurements, and reflects
    more than it receives where it is rough and the view grazes: 1.28 times as much at 80 degrees
    and roughness 1.

    A view from below the surface is never seen, but a map about the normal is expanded over it. It
    takes the value of its mirror image above, so that there is no jump at the horizon.
    """

    name = "disney-diffuse"
    summary = "diffuse reflection with a rim that depends on the roughness"
    source = "Burley 2012, Physically-based shading at Disney, section 5.3"
    parameters = (
        Parameter("roughness", 0.5, 0.0, 1.0, "0 darkens the rim, 1 brightens it"),
        Parameter("color", (1.0, 1.0, 1.0), 0.0, 1.0, "base colour"),
    )
    center = "normal"

    def evaluate(self, light: Array, view: Array) -> Array:
        light_cosine = np.clip(light[..., 2], 0.0, 1.0)
        view_cosine = np.minimum(np.abs(view[..., 2]), 1.0)
        cosine = light_cosine * view_cosine + tangential(light, view)
        g = self.number("roughness") * (1 + cosine) - 0.5  # (L.H)^2 = (1 + L.V) / 2
        value = (1 + g * fifth_power(1 - light_cosine)) * (1 + g * fifth_power(1 - view_cosine))
        return colored(value / np.pi * (light[..., 2] > 0), self.color("color"))
