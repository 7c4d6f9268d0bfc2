"""The sheen of cloth, whose microfibers stand up from the surface."""

from typing import ClassVar

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Brdf, Parameter
from shrm_cli.brdf.vectors import above_horizon, colored, cosines, half_vector

# The parameters a, b, c, d, e of L(x) for roughness 0 and 1, table 1 of Estevez and Kulla 2017.
_SMOOTH = 25.3245, 3.32435, 0.16801, -1.27393, -4.85967
_ROUGH = 21.5473, 3.82987, 0.19823, -1.97760, -4.32054


class Charlie(Brdf):
    """``f_r = color D G / (4 N.L N.V)`` above the horizon.

    ``D = (2 + 1/r) sin(theta_h)^(1/r) / (2 pi)`` with the roughness r, and ``G = 1 / (1 +
    Lambda(N.L) + Lambda(N.V))`` with the fit of Lambda in the paper (see `source`). The paper's
    softening of the terminator is left out, because it treats light and view differently.

    With ``visibility=neubelt`` it is ``f_r = color D / (4 (N.L + N.V - N.L N.V))``, as Filament and
    Khronos's glTF-IBL-Sampler have it.
    """

    name = "charlie"
    summary = "sheen of cloth, brightest at grazing angles"
    source = "Estevez and Kulla 2017, Production friendly microfacet sheen BRDF"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("roughness", 0.5, 0.002, 1.0, "r: smaller gathers the sheen at the rim"),
        Parameter("color", (1.0, 1.0, 1.0), 0.0, 1.0, "colour of the fibres"),
        Parameter(
            "visibility", "kulla", choices=("kulla", "neubelt"), is_optional=True,
            meaning="how fibres hide each other: the fit of the paper, or as Filament has it",
        ),
    )  # fmt: skip
    roughness_power = 2

    def evaluate(self, light: Array, view: Array) -> Array:
        half = half_vector(light, view)
        light_cosine, view_cosine = cosines(light, view)
        rate = 1 / self.number("roughness")
        sine = np.sqrt(np.minimum(half.square_sine, 1.0))
        distribution = (2 + rate) / (2 * np.pi) * sine**rate
        if self.values.get("visibility") == "neubelt":
            value = distribution / (4 * (light_cosine + view_cosine - light_cosine * view_cosine))
            return colored(above_horizon(value, light, view), self.color("color"))
        shadowed = 1 + self._shadowing(light_cosine) + self._shadowing(view_cosine)
        value = distribution / (4 * light_cosine * view_cosine * shadowed)
        return colored(above_horizon(value, light, view), self.color("color"))

    def _shadowing(self, cosine: Array) -> Array:
        """Lambda(x) of a cosine x: exp(L(x)) for x < 1/2, and exp(2 L(1/2) - L(1 - x)) above."""
        a, b, c, d, e = self.fit
        x = np.where(cosine < 0.5, cosine, 1 - cosine)
        value = a / (1 + b * np.maximum(x, 0.0) ** c) + d * x + e
        middle = a / (1 + b * 0.5**c) + d * 0.5 + e
        return np.exp(np.where(cosine < 0.5, value, 2 * middle - value))

    @property
    def fit(self) -> tuple[float, ...]:
        """The parameters a, b, c, d, e of L(x) for the roughness."""
        smooth = (1 - self.number("roughness")) ** 2
        return tuple(smooth * s + (1 - smooth) * r for s, r in zip(_SMOOTH, _ROUGH, strict=True))
