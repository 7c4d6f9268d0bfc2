"""``shrm prefilter probe.exr --brdf lommel-seeliger:albedo=0.2``."""

import numpy as np

from shrm_cli import Brdf, Parameter


class LommelSeeliger(Brdf):
    """``f_r = albedo / (4 pi (N.L + N.V))``: light scattered once in a dark, deep powder."""

    name = "lommel-seeliger"
    summary = "dark powder: a full moon, as bright at its rim as amid it"
    source = "Seeliger 1888, Zur Theorie der Beleuchtung der grossen Planeten"
    parameters = (Parameter("albedo", 0.2, 0.0, 1.0, "of a grain"),)
    center = "normal"

    def evaluate(self, light, view):
        cosines = np.maximum(light[..., 2], 0) + np.abs(view[..., 2])
        value = self.number("albedo") / (4 * np.pi * np.maximum(cosines, 1e-3))
        value = np.where(light[..., 2] > 0, value, 0).astype(light.dtype)
        return np.repeat(value[..., None], 3, axis=-1)
