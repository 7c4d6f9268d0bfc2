"""Disney's diffuse term: retroreflection at grazing angles that grows with roughness."""

import numpy as np

from shrm_cli.brdf.base import Array, Brdf, Parameter
from shrm_cli.brdf.vectors import colored, fifth_power, tangential


class DisneyDiffuse(Brdf):
    """``f_r = color / pi (1 + g (1 - N.L)^5) (1 + g (1 - N.V)^5)``.

    ``g = 2 roughness (L.H)^2 - 1/2``. It was fitted to measurements, and reflects more than it
    receives where it is rough and the view grazes: 1.28 times as much at 80 degrees, roughness 1.

    A view from below is never seen. It takes the value from above, which spares the map a jump.
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
        # (L.H)^2 = (1 + L.V) / 2
        cosine = light_cosine * view_cosine + tangential(light, view)
        g = self.number("roughness") * (1 + cosine) - 0.5
        value = (1 + g * fifth_power(1 - light_cosine)) * (1 + g * fifth_power(1 - view_cosine))
        return colored(value / np.pi * (light[..., 2] > 0), self.color("color"))
