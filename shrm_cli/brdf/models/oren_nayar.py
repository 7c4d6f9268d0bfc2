"""Oren and Nayar's rough diffuse surface: V-shaped cavities with Lambertian walls."""

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Brdf, Parameter
from shrm_cli.brdf.vectors import GRAZING, colored, tangential


class OrenNayar(Brdf):
    """``f_r = albedo / pi (A + B max(0, cos(phi_i - phi_o)) sin(a) tan(b))``.

    Here a is the larger and b the smaller of theta_i and theta_o, ``A = 1 - sigma^2 / (2 sigma^2 +
    0.66)``, and ``B = 0.45 sigma^2 / (sigma^2 + 0.09)``. This is the paper's qualitative model,
    which leaves out the interreflection of the walls. Seen from 80 degrees it reflects up to 1 %
    more than it receives. The tangent grows without bound where light and view graze on the same
    side; it is cut off 0.0006 degrees from the horizon.

    A view from below the surface is never seen, but a map about the normal is expanded over it. It
    takes the value of its mirror image above, so that there is no jump at the horizon.
    """

    name = "oren-nayar"
    summary = "rough diffuse reflection, brighter towards the light"
    source = "Oren and Nayar 1994, Generalization of Lambert's reflectance model"
    parameters = (
        Parameter("sigma", 0.3, 0.0, 1.5, "standard deviation of the walls' slope, radians"),
        Parameter("albedo", (1.0, 1.0, 1.0), 0.0, 1.0, "fraction that a wall reflects"),
    )
    center = "normal"

    @property
    def factors(self) -> tuple[float, float]:
        """What is the same for all azimuths, and what swings with them: A and B."""
        square = self.number("sigma") ** 2
        return 1 - 0.5 * square / (square + 0.33), 0.45 * square / (square + 0.09)

    def evaluate(self, light: Array, view: Array) -> Array:
        first, second = self.factors
        # sin(a) tan(b) cos(phi) is sin(a) sin(b) cos(phi) over cos(b), the larger of the cosines.
        larger = np.maximum(light[..., 2], np.abs(view[..., 2]))
        swing = np.maximum(tangential(light, view), 0.0) / np.maximum(larger, GRAZING)
        value = (first + second * swing) / np.pi
        return colored(value * (light[..., 2] > 0), self.color("albedo"))
