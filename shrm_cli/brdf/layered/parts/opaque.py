"""The opaque base of OpenPBR's surfaces: metal, and a diffuse surface under a dielectric border."""

import math
from functools import cached_property

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Brdf, Color, Value, excess, multiplied
from shrm_cli.brdf.cache import remembered
from shrm_cli.brdf.film import Film, covered, film_reflectance
from shrm_cli.brdf.layered.parts.dielectric import fresnel
from shrm_cli.brdf.layered.parts.table import COSINES, Table, albedos, strength, transport
from shrm_cli.brdf.models.ggx import Ggx
from shrm_cli.brdf.vectors import colored, fifth_power, schlick

_TINTED = 1 / 7
"""The cosine of 82 degrees, at which the edge of a metal has its tint."""


class MetalLobe(Ggx):
    """`Ggx` with a tint of its rim: at 82 degrees Schlick's reflectance is multiplied by it.

    The reflectance is less by ``b c (1 - c)^6`` with the cosine c, and b as the tint wants it
    (Kutz, Hasan and Edmondson 2021).
    """

    name = "metal-lobe"
    summary = "reflection of a metal with a tinted rim"

    def __init__(
        self, facets: dict[str, Value], color: Color, tint: Color, film: Film | None = None
    ) -> None:
        super().__init__(**facets, f0=list(color))
        self.values["tint"] = list(tint)
        self.film = covered(self, film)

    def reflectance(self, cosine: Array) -> Array:
        if self.film:
            return film_reflectance(cosine, self.color("f0"), *self.film)
        less = colored(cosine * (1 - cosine) * fifth_power(1 - cosine), self.darkening)
        return excess(schlick(self.color("f0"), cosine), less)

    @property
    def darkening(self) -> Color:
        """The b of each channel."""
        color, tint = np.array(self.color("f0")), np.array(self.color("tint"))
        edge = color + (1 - color) * (1 - _TINTED) ** 5
        # Python's own numbers leave the precision of the cosines as it is.
        red, green, blue = (edge * (1 - tint) / (_TINTED * (1 - _TINTED) ** 6)).tolist()
        return red, green, blue


class BorderLobe(Ggx):
    """What the border of a dielectric reflects, by Fresnel's equations, times a color."""

    name = "border-lobe"
    summary = "reflection at the border of a dielectric"

    def __init__(
        self, facets: dict[str, Value], ior: float, tint: Color, film: Film | None = None
    ) -> None:
        super().__init__(**facets)
        self.values.update(ior=ior, tint=list(tint))
        self.film = covered(self, film)

    def reflectance(self, cosine: Array) -> Array:
        ior, tint = self.number("ior"), self.color("tint")
        if self.film:
            found = film_reflectance(cosine, (((ior - 1) / (ior + 1)) ** 2,) * 3, *self.film)
            return found * np.array(tint, found.dtype)
        return colored(fresnel(cosine, ior), tint)

    def albedo(self) -> Array:
        """The part of light from angles that it reflects without its tint, shape (n, 3).

        Of a brushed lobe it is the larger one of those along its axes.
        """
        across, along = self.alphas
        seen = {(across, along), (along, across)}
        lobes = [
            BorderLobe({"ax": ax, "ay": ay}, self.number("ior"), (1.0, 1.0, 1.0), self.film)
            for ax, ay in seen
        ]
        return np.max([albedos(each, COSINES) for each in lobes], axis=0)


class UnderBorder(Brdf):
    """A diffuse surface as it is seen through the border of a dielectric.

    It is multiplied by the same function of the light's angle and of the view's, so that both may
    be exchanged. With the albedo E of the border, that function is such that of even light
    ``1 - E`` times what the surface reflects without it is seen from each angle. Of what passes
    the border, a white surface so loses nothing.
    """

    name = "under-border"
    summary = "a diffuse surface under a dielectric's border"
    center = "normal"

    def __init__(self, border: BorderLobe, diffuse: Brdf) -> None:
        self.border, self.term = border, diffuse
        self.values = {"border": repr(border), "diffuse": repr(diffuse)}

    def evaluate(self, light: Array, view: Array) -> Array:
        value = self.term.evaluate(light, view)
        return multiplied(value, self.passing.at(light), self.passing.at(view))

    @cached_property
    def passing(self) -> Table:
        """The function that it is multiplied by."""
        return remembered(self, ("passing",), self._passing)

    def _passing(self) -> Table:
        # One surface lies under several borders: with a film and without, in air and in a coat.
        matrix = remembered(
            self.term, ("transport",), lambda: transport(self.term, COSINES, COSINES)
        )
        wanted = np.maximum(1 - self.border.albedo(), 0) * matrix.sum(axis=1)
        return Table(strength(matrix, np.ones_like(wanted), wanted))


def modulated(ior: float, weight: float) -> float:
    """The index of refraction whose reflectance along the normal is multiplied by a weight.

    An index below 1, that of a surface which is in a denser coat, counts as its inverse: the angle
    of total reflection would be no other for rays that the coat has refracted already.
    """
    ior = max(ior, 1 / ior)
    root = math.sqrt(weight) * (ior - 1) / (ior + 1)
    return (1 + root) / (1 - root)
