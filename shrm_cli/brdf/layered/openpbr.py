"""OpenPBR's surface, of which other materials are special cases, as far as it is opaque."""

import warnings
from collections.abc import Iterator, Sequence
from typing import ClassVar

from shrm_cli.brdf.base import Brdf, Color, Parameter, Value, value_text
from shrm_cli.brdf.film import Film
from shrm_cli.brdf.layered.coated import Coated
from shrm_cli.brdf.layered.fuzzy import Fuzzy
from shrm_cli.brdf.layered.parts.opaque import BorderLobe, MetalLobe, UnderBorder, modulated
from shrm_cli.brdf.models.eon import Eon
from shrm_cli.brdf.models.lambertian import Lambertian
from shrm_cli.brdf.sums import Sum, joined
from shrm_cli.errors import BrdfError, ShrmWarning
from shrm_cli.vocabulary import MIN_ROUGHNESS

Terms = Sequence[tuple[float, Brdf]]

_WHITE: Color = (1.0, 1.0, 1.0)
_REFUSED = {
    "transmission_weight": "light that passes through it",
    "subsurface_weight": "light that leaves it elsewhere",
}
"""Parameters that must be 0, and what is not held where they are not."""
_LEFT_OUT: dict[str, tuple[Value, str]] = {
    "coat_roughness_anisotropy": (0.0, "the coat is not brushed"),
    "coat_darkening": (1.0, "the coat darkens its base as it does in nature"),
    "emission_luminance": (0.0, "what it emits is left out"),
    "geometry_opacity": (1.0, "it is opaque"),
}
"""Parameters without which the rest is as it was: the values that mean nothing, and what is said
where they have others."""
_UNUSED = (
    "transmission_color", "transmission_depth", "transmission_scatter",
    "transmission_scatter_anisotropy", "transmission_dispersion_scale",
    "transmission_dispersion_abbe_number", "subsurface_color", "subsurface_radius",
    "subsurface_radius_scale", "subsurface_scatter_anisotropy", "emission_color",
    "geometry_thin_walled",
)  # fmt: skip
"""Parameters of what is refused or left out."""


class OpenPbr(Sum):
    """A mix of metal and dielectric, under a coat, under fuzz, with OpenPBR's parameters.

    Each lobe is a term, to be prefiltered as it wants it. `Coated` and `Fuzzy` are its layers;
    fuzz is `Charlie` of the square of its roughness, and no lobe is narrower than a roughness of
    0.05. Parameters of what passes through the surface are known, and refused where they have a
    weight.
    """

    name = "openpbr"
    summary = "OpenPBR's surface: metal or dielectric, coat and fuzz; also of .mtlx and .gltf files"
    source = "OpenPBR Surface 1.1, Academy Software Foundation 2024"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("base_weight", 1.0, meaning="multiplies base_color"),
        Parameter("base_color", (0.8, 0.8, 0.8), meaning="of the diffuse surface and of the metal"),
        Parameter("base_diffuse_roughness", 0.0, meaning="of the diffuse surface, as of eon"),
        Parameter("base_metalness", 0.0, meaning="the part that is metal"),
        Parameter("specular_weight", 1.0, meaning="multiplies reflectance along the normal"),
        Parameter("specular_color", _WHITE, meaning="of the border's reflection; the metal's rim"),
        Parameter("specular_roughness", 0.3, meaning="of border and metal, as of ggx"),
        Parameter("specular_roughness_anisotropy", 0.0, meaning="as of ggx, mapping=openpbr"),
        Parameter("specular_ior", 1.5, 1.0, 3.0, "the dielectric's index of refraction"),
        Parameter("coat_weight", 0.0, meaning="the part of the surface that is coated"),
        Parameter("coat_color", _WHITE, meaning="what passes the coat along the normal and back"),
        Parameter("coat_roughness", 0.0, meaning="of the coat, as of ggx"),
        Parameter("coat_ior", 1.6, 1.0, 3.0, "the coat's index of refraction"),
        Parameter("thin_film_weight", 0.0, meaning="the part of the base that a thin film covers"),
        Parameter("thin_film_thickness", 0.5, 0.0, 5.0, "the film's thickness, micrometers"),
        Parameter("thin_film_ior", 1.4, 1.0, 3.0, "the film's index of refraction"),
        Parameter("fuzz_weight", 0.0, meaning="multiplies fuzz_color"),
        Parameter("fuzz_color", _WHITE, meaning="of the fuzz"),
        Parameter("fuzz_roughness", 0.5, meaning="its square is that of charlie"),
    )
    roughness_names = ("specular_roughness",)

    def __init__(self, **values: Value) -> None:
        Brdf.__init__(self, **_held(values))
        self._hold(list(self._terms()))
        for name, (harmless, effect) in _LEFT_OUT.items():
            if values.get(name, harmless) != harmless:
                line = f"openpbr: {name}={value_text(values[name])} is left out: {effect}"
                warnings.warn(line, ShrmWarning, stacklevel=2)

    def __repr__(self) -> str:
        defaults = {each.name: each.checked(each.default) for each in self.parameters}
        given = {key: each for key, each in self.values.items() if each != defaults[key]}
        inside = ",".join(f"{key}={value_text(value)}" for key, value in given.items())
        return f"{self.name}:{inside}" if inside else self.name

    def _terms(self) -> Iterator[tuple[float, Brdf]]:
        weight = self.number("coat_weight")
        terms = [(weight * share, term) for share, term in self._coated()] if weight else []
        if weight < 1:
            terms += [((1 - weight) * share, term) for share, term in self._base(1.0)]
        fuzz = tuple(self.number("fuzz_weight") * each for each in self.color("fuzz_color"))
        if max(fuzz) > 0:
            roughness = max(self.number("fuzz_roughness") ** 2, MIN_ROUGHNESS)
            return iter(Fuzzy(joined(terms), roughness=roughness, color=fuzz).terms)
        return iter(terms)

    def _coated(self) -> Terms:
        ior = self.number("coat_ior")
        roughness = max(self.number("coat_roughness"), MIN_ROUGHNESS)
        base, color = joined(self._base(ior)), self.values["coat_color"]
        return Coated(base, roughness=roughness, ior=ior, color=color).terms

    def _base(self, outside: float) -> Terms:
        """The base within a medium of an index of refraction, with the film that covers it."""
        covered = self.number("thin_film_weight")
        film = 1000 * self.number("thin_film_thickness") * outside, self.number("thin_film_ior")
        parts = (1 - covered, None), (covered, (film[0], film[1] / outside))
        return [
            (share * weight, term)
            for share, each in parts
            if share > 0
            for weight, term in self._under(each, outside)
        ]

    def _under(self, film: Film | None, outside: float) -> Terms:
        """The base that is covered by a film, or the one that is not."""
        metal, weight = self.number("base_metalness"), self.number("specular_weight")
        facets, tint = self._facets(), self.color("specular_color")
        red, green, blue = (self.number("base_weight") * each for each in self.color("base_color"))
        color = red, green, blue
        found: list[tuple[float, Brdf]] = [(metal * weight, MetalLobe(facets, color, tint, film))]
        below: Brdf = Lambertian(albedo=color)
        if self.number("base_diffuse_roughness") > 0:
            below = Eon(roughness=self.number("base_diffuse_roughness"), albedo=color)
        ior = modulated(self.number("specular_ior") / outside, weight)
        if ior > 1 or film:
            border = BorderLobe(facets, ior, tint, film)
            found.append(((1 - metal) * (max(tint) > 0), border))
            below = UnderBorder(border, below)
        found.append(((1 - metal) * (max(color) > 0), below))
        return [term for term in found if term[0] > 0] or [(1.0, Lambertian(albedo=0.0))]

    def _facets(self) -> dict[str, Value]:
        """The roughness of the base, as `Ggx` takes it."""
        roughness = max(self.number("specular_roughness"), MIN_ROUGHNESS)
        brushed = self.values["specular_roughness_anisotropy"]
        if not brushed:
            return {"roughness": roughness}
        return {"roughness": roughness, "anisotropy": brushed, "mapping": "openpbr"}


def _held(values: dict[str, Value]) -> dict[str, Value]:
    """The parameters that decide the surface."""
    for name, what in _REFUSED.items():
        if values.get(name, 0.0) != 0:
            given = value_text(values[name])
            raise BrdfError(f"openpbr: {name}={given}: {what} is not held by maps; make it 0")
    unheld = {*_REFUSED, *_LEFT_OUT, *_UNUSED}
    return {name: value for name, value in values.items() if name not in unheld}
