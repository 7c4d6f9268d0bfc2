"""Fuzz, such as dust or the fibres of cloth, over any base."""

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Brdf, Parameter, scaled
from shrm_cli.brdf.cache import remembered
from shrm_cli.brdf.layered.parts.layered import BASE, Layered, UnderLayer
from shrm_cli.brdf.layered.parts.table import COSINES, Table, albedos
from shrm_cli.brdf.models.charlie import Charlie
from shrm_cli.brdf.sums import flat_terms
from shrm_cli.brdf.vectors import shared


class Fuzzy(Layered):
    """Charlie's sheen, and below it the base, as far as the sheen lets light pass.

    The base is multiplied by the smaller one of ``1 - E(N.L)`` and ``1 - E(N.V)``, where E is the
    part of light from an angle that the sheen reflects, in its brightest channel.
    """

    name = "fuzzy"
    summary = "fuzz, as of cloth or dust, over any base"
    source = "glTF, KHR_materials_sheen; Estevez and Kulla 2017 for the sheen"
    parameters = (
        Parameter("roughness", 0.5, 0.05, 1.0, "of the fuzz, as of charlie"),
        Parameter("color", (1.0, 1.0, 1.0), 0.0, 1.0, "of the fuzz"),
        BASE,
    )

    def _layers(self) -> Sequence[tuple[float, Brdf]]:
        sheen = Charlie(roughness=self.values["roughness"], color=self.values["color"])
        terms = flat_terms([(1.0, self.base)])
        return [(1.0, sheen), *((weight, UnderFuzz(self, term, sheen)) for weight, term in terms)]


class UnderFuzz(UnderLayer):
    """A term of a base as it is seen through fuzz."""

    def __init__(self, whole: Fuzzy, term: Brdf, sheen: Charlie) -> None:
        super().__init__(whole, term)
        self.sheen = sheen
        self.includes_cosine, self.has_horizon = term.includes_cosine, term.has_horizon

    def evaluate(self, light: Array, view: Array) -> Array:
        passing = self.passing
        least = shared(
            "least", (passing, light, view),
            lambda: np.minimum(passing(light[..., 2]), passing(view[..., 2]))[..., 0],
        )  # fmt: skip
        return scaled(self.term.evaluate(light, view), least)

    @cached_property
    def passing(self) -> Table:
        """What the sheen lets pass, in all channels alike."""
        return remembered(self.sheen, ("passing",), lambda: _passing(self.sheen))


def _passing(sheen: Charlie) -> Table:
    reflected = albedos(sheen, COSINES).max(axis=1, keepdims=True)
    return Table(np.maximum(1 - np.tile(reflected, 3), 0))
