"""Ideal diffuse reflection."""

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Brdf, Parameter
from shrm_cli.brdf.vectors import colored


class Lambertian(Brdf):
    """``f_r = albedo / pi``: equally bright from every direction."""

    name = "lambertian"
    summary = "ideal diffuse reflection, f_r = albedo / pi"
    source = "Lambert 1760; Ramamoorthi and Hanrahan 2001, eq. 4.12 for its coefficients"
    parameters = (
        Parameter("albedo", (1.0, 1.0, 1.0), 0.0, 1.0, "fraction of the light that is reflected"),
    )
    center = "normal"
    zonal = True

    def evaluate(self, light: Array, view: Array) -> Array:
        shape = np.broadcast_shapes(light.shape[:-1], view.shape[:-1])
        value = np.full((), 1 / np.pi, dtype=np.result_type(light, view))
        return colored(np.broadcast_to(value, shape), self.color("albedo"))
