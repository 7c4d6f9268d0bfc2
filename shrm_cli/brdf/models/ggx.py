"""The GGX microfacet model of most renderers, of even and of brushed surfaces."""

import math
from typing import ClassVar

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.brdf import vectors
from shrm_cli.brdf.base import Brdf, Color, Parameter, Value, scaled
from shrm_cli.brdf.film import FILM, film_of, film_reflectance
from shrm_cli.errors import BrdfError
from shrm_cli.vocabulary import MIN_ROUGHNESS

_LEAST_ALPHA = 0.0025
"""The alpha of the least roughness."""


class Ggx(Brdf):
    """``f_r = F D G / (4 N.L N.V)`` above the horizon, with ``a = roughness^2``.

    D is ``1 / (pi a^2 (tan(theta_h)^2 / a^2 + 1)^2 cos(theta_h)^4)``, G is Smith's for correlated
    heights of light and view, and F Schlick's approximation of Fresnel's reflectance. Light that
    meets several facets is lost.

    A brushed surface has an alpha along its x axis and another along y. They are given, as `ax` and
    `ay`, or follow from `roughness` and `anisotropy` s by one of two mappings: that of glTF,
    ``ax = a + (1 - a) s^2, ay = a``, or that of OpenPBR, ``ax = a sqrt(2 / (1 + (1 - s)^2))``,
    ``ay = (1 - s) ax``. Both stretch the lobe along x, so that x runs across the brush marks.

    With a thin film F is exact, of media without absorption: `shrm_cli.brdf.film`.
    """

    name = "ggx"
    summary = "microfacets with the long tails of real surfaces, as most renderers have them"
    source = (
        "Walter et al. 2007, eq. 33; G: Heitz 2014, eq. 86 and 99; a = roughness^2: Burley 2012"
    )
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "roughness", 0.4, MIN_ROUGHNESS, 1.0, "perceptual roughness, the root of GGX's alpha"
        ),
        Parameter(
            "anisotropy", 0.0, 0.0, 1.0, "how far the lobe is stretched along x", is_optional=True
        ),
        Parameter(
            "mapping", "gltf", choices=("gltf", "openpbr"), is_optional=True,
            meaning="whose alphas follow from roughness and anisotropy",
        ),
        Parameter(
            "ax", 0.16, _LEAST_ALPHA, 1.0, "alpha along x, instead of roughness", is_optional=True
        ),
        Parameter(
            "ay", 0.16, _LEAST_ALPHA, 1.0, "alpha along y, with ax", follows="ax", is_optional=True
        ),
        vectors.NORMAL_REFLECTANCE,
        *FILM,
    )  # fmt: skip

    def __init__(self, **values: Value) -> None:
        if "ax" in values:
            values.setdefault("ay", values["ax"])
        super().__init__(**values)
        if values.keys() & {"ax", "ay"}:
            self._check_alphas(values)
            del self.values["roughness"]
        elif "mapping" in values and "anisotropy" not in values:
            raise BrdfError("ggx: mapping applies with anisotropy")
        self.film = film_of(self)
        if self.film and min(self.color("f0")) == 1:
            raise BrdfError("ggx: f0=1 reflects all, with a film or without; give a lower f0")
        self.alphas = self._alphas()
        self.isotropic = self.alphas[0] == self.alphas[1]
        if self.isotropic and "ax" in self.values:  # it is called as all even surfaces are
            roughness = math.sqrt(self.values.pop("ax"))  # type: ignore[arg-type]
            del self.values["ay"]
            self.values = {"roughness": roughness, **self.values}

    def evaluate(self, light: Array, view: Array) -> Array:
        half = vectors.half_vector(light, view)
        light_cosine, view_cosine = vectors.cosines(light, view)
        distribution = self._distribution(half)
        masking = light_cosine * self._projected(view, view_cosine)
        shadowing = view_cosine * self._projected(light, light_cosine)
        value = vectors.above_horizon(distribution / (2 * (masking + shadowing)), light, view)
        return scaled(self.reflectance(half.cosine), value)

    def reflectance(self, cosine: Array) -> Array:
        """The reflectance of a facet that is met at an angle, shape (..., 3)."""
        if self.film:
            return film_reflectance(cosine, self.color("f0"), *self.film)
        return vectors.schlick(self.color("f0"), cosine)

    @property
    def surface(self) -> tuple[float, Color] | None:
        """The roughness and f0 of a surface that they say all of, as maps of light show them."""
        if self.film or not self.isotropic:
            return None
        return self.number("roughness"), self.color("f0")

    @property
    def brushed_surface(self) -> tuple[float, float, Color] | None:
        """The roughness, the anisotropy of glTF and f0 of a surface that they say all of."""
        ax, ay = self.alphas
        if self.film or ax < ay:
            return None
        anisotropy = 0.0 if self.isotropic else math.sqrt((ax - ay) / (1 - ay))
        return math.sqrt(ay), anisotropy, self.color("f0")

    def _distribution(self, half: vectors.Half) -> Array:
        """The distribution D of normals of facets, Heitz 2014, eq. 85."""
        if self.isotropic:
            a2 = self.number("roughness") ** 4
            return 1 / (np.pi * a2 * (half.square_sine / a2 + half.z**2) ** 2)
        ax, ay = self.alphas
        stretched = (half.x / ax) ** 2 + (half.y / ay) ** 2 + half.z**2
        return 1 / (np.pi * ax * ay * stretched**2)

    def _projected(self, direction: Array, cosine: Array) -> Array:
        """The root of ``ax^2 x^2 + ay^2 y^2 + z^2``, which is ``z (1 + 2 Lambda)``."""
        if self.isotropic:
            a2 = self.number("roughness") ** 4
            return np.sqrt(a2 + (1 - a2) * cosine**2)
        ax, ay = self.alphas
        x, y = direction[..., 0], direction[..., 1]
        return np.sqrt((ax * x) ** 2 + (ay * y) ** 2 + cosine**2)

    def _alphas(self) -> tuple[float, float]:
        if "ax" in self.values:
            return self.number("ax"), self.number("ay")
        alpha = self.number("roughness") ** 2
        if "anisotropy" not in self.values:
            return alpha, alpha
        stretch = self.number("anisotropy")
        if self.values.get("mapping") == "openpbr":
            across = alpha * math.sqrt(2 / (1 + (1 - stretch) ** 2))
            return min(across, 1.0), max((1 - stretch) * across, _LEAST_ALPHA)
        return alpha + (1 - alpha) * stretch**2, alpha

    @staticmethod
    def _check_alphas(values: dict[str, Value]) -> None:
        if "ax" not in values:
            raise BrdfError("ggx: ax is missing; ay is given with it")
        for name in ("roughness", "anisotropy", "mapping"):
            if name in values:
                raise BrdfError(f"ggx: {name} does not apply with ax and ay")
