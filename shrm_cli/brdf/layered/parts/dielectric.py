"""Borders between air and a clear medium, smooth or rough: Fresnel, Snell, and lobes of GGX."""

from functools import partial

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Brdf, grey, scaled
from shrm_cli.brdf.film import Film, covered, film_reflectance
from shrm_cli.brdf.models.ggx import Ggx
from shrm_cli.brdf.vectors import (
    Half,
    above_horizon,
    cosines,
    half_vector,
    refracted_cosine,
    shared,
)


def fresnel(cosine: Array, ior: float) -> Array:
    """Fresnel's reflectance of unpolarized light that comes through air, exact.

    `cosine` is that of the angle in air, 0 .. 1. `ior` is the medium's index of refraction.
    """
    below = refracted_cosine(cosine, ior)
    across = (cosine - ior * below) / (cosine + ior * below)
    along = (ior * cosine - below) / (ior * cosine + below)
    return np.asarray((across**2 + along**2) / 2)


def refracted(directions: Array, ior: float) -> Array:
    """Directions (..., 3) in air as they go on in the medium, away from its border, as they do.

    Directions below the horizon become those that graze in air.
    """
    return shared(("refracted", ior), (directions,), lambda: _refracted(directions, ior))


def _refracted(directions: Array, ior: float) -> Array:
    z = refracted_cosine(np.clip(directions[..., 2], 0.0, 1.0), ior)
    return np.moveaxis(np.stack([directions[..., 0] / ior, directions[..., 1] / ior, z]), 0, -1)


def swerve(inner: Array, ior: float) -> Array:
    """How far a tilted facet of the border turns light in the medium, in parts of its tilt.

    `inner` is the cosine of the light in the medium.
    """
    outer = np.sqrt(np.maximum(1 - ior**2 * (1 - inner**2), 0.0))
    return np.asarray(inner - outer / ior)


class CoatLobe(Ggx):
    """What the rough border of a clear medium reflects: `Ggx` with Fresnel's equations."""

    name = "coat-lobe"
    summary = "reflection at the border of a clear medium"

    def __init__(self, roughness: float, ior: float, film: Film | None = None) -> None:
        super().__init__(roughness=roughness)
        self.values = {"roughness": roughness, "ior": ior}
        self.film = covered(self, film)

    def reflectance(self, cosine: Array) -> Array:
        ior = self.number("ior")
        if self.film:
            return film_reflectance(cosine, (((ior - 1) / (ior + 1)) ** 2,) * 3, *self.film)
        return grey(fresnel(cosine, ior))


class ThroughCoat(Brdf):
    """GGX as it is seen through a rough border: light is turned on its way in and on its way out.

    The square of its alpha grows by those of the border's alpha times `swerve`, of light and view.
    By variances alone it would be a quarter, since a turn of the light tilts the half vector by
    half of it; but the tails of GGX are long, and add up to about this. Where light
    goes to and fro, the lobe is twice as wide, and the facets of the border that reflect it add
    theirs.
    """

    name = "ggx-through-coat"
    summary = "GGX seen through a coat"

    def __init__(self, whole: Ggx, coat: CoatLobe, is_later: bool) -> None:
        self.whole, self.isotropic = whole, whole.isotropic
        self.factor = 4 if is_later else 1
        self.coat, self.ior = coat.number("roughness") ** 4, coat.number("ior")
        self.values = {**whole.values, "coat": repr(coat)}

    def __repr__(self) -> str:
        return repr(self.whole)

    def evaluate(self, light: Array, view: Array) -> Array:
        half = half_vector(light, view)
        seen = shared(
            ("facets", self.whole.alphas, self.coat, self.ior, self.factor), (light, view),
            lambda: self._facets(half, light, view),
        )  # fmt: skip
        whole = self.whole
        found = shared("reflectance", (whole, half), lambda: whole.reflectance(half.cosine))
        return scaled(found, seen)

    def _facets(self, half: Half, light: Array, view: Array) -> Array:
        """What the facets reflect if they are mirrors, shape (...)."""
        turned = sum(
            shared(("swerve", self.ior), (each,), partial(_square_swerve, each, self.ior))
            for each in (light, view)
        )
        added = self.coat * (turned + self.factor - 1)
        squares = [np.minimum(self.factor * alpha**2 + added, 1) for alpha in self.whole.alphas]
        stretched = half.x**2 / squares[0] + half.y**2 / squares[1] + half.z**2
        lit, seen = cosines(light, view)
        shadowed = seen * _projected(light, lit, squares)
        masked = lit * _projected(view, seen, squares)
        area = np.pi * np.sqrt(squares[0] * squares[1])
        return above_horizon(1 / (2 * area * stretched**2 * (shadowed + masked)), light, view)


def _square_swerve(directions: Array, ior: float) -> Array:
    return swerve(np.clip(directions[..., 2], 0, 1), ior) ** 2


def _projected(direction: Array, cosine: Array, squares: list[Array]) -> Array:
    """As of `Ggx`, with squares of alphas that depend on light and view."""
    x, y = direction[..., 0], direction[..., 1]
    return np.asarray(np.sqrt(squares[0] * x**2 + squares[1] * y**2 + cosine**2))
