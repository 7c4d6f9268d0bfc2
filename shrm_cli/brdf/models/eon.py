"""The rough diffuse surface of OpenPBR, a model of Oren and Nayar's kind that loses no light."""

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Brdf, Color, Parameter, added
from shrm_cli.brdf.vectors import GRAZING, colored, tangential

_GIVEN = 0.5 - 2 / (3 * np.pi)
_MEAN = 2 / 3 - 28 / (15 * np.pi)
"""The constants of the albedo along the normal and of the mean albedo."""


class Eon(Brdf):
    """``f_r = albedo / pi A (1 + roughness s/t)``, and what the walls reflect to each other.

    Here ``A = 1 / (1 + (1/2 - 2 / (3 pi)) roughness)``, s is ``L.V - N.L N.V``, and t the larger of
    N.L and N.V where s is positive, else 1. A white surface reflects all light at every roughness.
    As `OrenNayar` has it, views from below the surface see the mirror image of those above it.
    """

    name = "eon"
    summary = "rough diffuse reflection that keeps all light, as OpenPBR has it"
    source = "Portsmouth, Kutz and Hill 2025, EON: A practical energy-preserving rough diffuse BRDF"
    parameters = (
        Parameter("roughness", 0.5, 0.0, 1.0, "0 is Lambertian"),
        Parameter("albedo", (1.0, 1.0, 1.0), 0.0, 1.0, "fraction that a wall reflects"),
    )
    center = "normal"

    def evaluate(self, light: Array, view: Array) -> Array:
        roughness = self.number("roughness")
        lit, seen = (np.maximum(np.abs(each[..., 2]), GRAZING) for each in (light, view))
        swing = tangential(light, view)
        swing = np.where(swing > 0, swing / np.maximum(lit, seen), swing)
        once = self.scale * (1 + roughness * swing) / np.pi * (light[..., 2] > 0)
        again = self._lost(lit) * self._lost(seen) * (light[..., 2] > 0)
        return added([colored(once, self.color("albedo")), colored(again, self.again)])

    @property
    def scale(self) -> float:
        """A."""
        return 1 / (1 + _GIVEN * self.number("roughness"))

    @property
    def again(self) -> Color:
        """What is reflected after some walls, of light that white ones would not reflect at once
        for the light's angle and the view's.
        """
        mean = self.scale * (1 + _MEAN * self.number("roughness"))
        colors, whole = np.array(self.color("albedo")), max(1 - mean, 1e-12) * np.pi
        red, green, blue = (colors**2 * mean / (1 - colors * (1 - mean)) / whole).tolist()
        return red, green, blue

    def _lost(self, cosine: Array) -> Array:
        """The light from an angle that white walls do not reflect at once."""
        sine = np.sqrt(np.maximum(1 - cosine**2, 0))
        angle = np.arccos(np.minimum(cosine, 1))
        bend = sine * (angle - sine * cosine) + 2 / 3 * (sine / cosine * (1 - sine**3) - sine)
        return np.asarray(1 - self.scale * (1 + self.number("roughness") / np.pi * bend))
