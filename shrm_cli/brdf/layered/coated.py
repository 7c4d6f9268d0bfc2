"""A clear coat, such as lacquer, over any base."""

from collections.abc import Iterator, Sequence
from functools import partial

from shrm_cli.brdf.base import Brdf, Parameter
from shrm_cli.brdf.film import FILM, film_of
from shrm_cli.brdf.layered.parts.dielectric import CoatLobe, ThroughCoat
from shrm_cli.brdf.layered.parts.interior import GlossyPart, Interior, UnderCoat
from shrm_cli.brdf.layered.parts.layered import BASE, Layered
from shrm_cli.brdf.models.ggx import Ggx
from shrm_cli.brdf.sums import flat_terms, split
from shrm_cli.vocabulary import MIN_ROUGHNESS


class Coated(Layered):
    """The coat's lobe, and the base through the coat, where light goes to and fro between both.

    Directions are refracted on the way in and out, so that lobes of the base widen. What the coat
    reflects does not reach the base. `shrm_cli.brdf.layered.parts.interior` has the formulas.
    """

    name = "coated"
    summary = "a clear coat of lacquer or varnish over any base"
    source = "Weidlich and Wilkie 2007; rounds between coat and base: Saunderson 1942"
    parameters = (
        Parameter("roughness", 0.1, MIN_ROUGHNESS, 1.0, "of the coat, as of ggx"),
        Parameter("ior", 1.5, 1.0, 3.0, "the coat's index of refraction"),
        Parameter("color", (1.0, 1.0, 1.0), 0.0, 1.0, "what passes it along the normal and back"),
        Parameter("weight", 1.0, 0.0, 1.0, "the part of the surface that is coated"),
        *FILM,
        BASE,
    )

    def _layers(self) -> Sequence[tuple[float, Brdf]]:
        weight, ior = self.number("weight"), self.number("ior")
        film = film_of(self)
        coat = CoatLobe(self.number("roughness"), ior, film)
        parts = list(_parts(self.base))
        diffuse = [(share, part) for share, part in parts if part.center == "normal"]
        glossy = [_glossy(share, part, coat) for share, part in parts if part.center != "normal"]
        inside = Interior(coat, self.color("color"), glossy, diffuse)
        glossy_terms = [
            (weight * part.weight, UnderCoat(self, part.lobe, ior, partial(inside.glossy_lobes, k)))
            for k, part in enumerate(glossy)
        ]
        diffuse_terms = [
            (weight * share, UnderCoat(self, part, ior, partial(inside.diffuse_lobes, k)))
            for k, (share, part) in enumerate(diffuse)
        ]
        border = [(weight, coat)] if ior > 1 or film else []
        return [*border, *glossy_terms, *diffuse_terms, (1 - weight, self.base)]


def _glossy(share: float, part: Brdf, coat: CoatLobe) -> GlossyPart:
    if not isinstance(part, Ggx):
        return GlossyPart(share, part, part, part)
    return GlossyPart(share, part, *(ThroughCoat(part, coat, later) for later in (False, True)))


def _parts(base: Brdf) -> Iterator[tuple[float, Brdf]]:
    """The terms of a base; a measurement comes apart into a diffuse and a glossy one."""
    for weight, term in flat_terms([(1.0, base)]):
        for part in split(term) if term.is_measured else [term]:
            yield weight, part
