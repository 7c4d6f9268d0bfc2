"""What the maps for engines have in common: made from the light alone, for BRDFs of their own."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from shrm_cli.brdf.base import Color
from shrm_cli.errors import MapError
from shrm_cli.maps.info import MapInfo
from shrm_cli.vocabulary import Center, Sampling

Array = NDArray[np.floating]

ENGINES = ("irradiance", "splitsum", "she")
"""Their representations."""


class EngineMap(ABC):
    """A map that engines use.

    Files, commands and `Map` know the kinds by this class and their `representation`: to load
    one kind does not load the others.
    """

    representation: ClassVar[str]
    frame: ClassVar[Literal["global"]] = "global"
    center: ClassVar[Center]
    info: MapInfo

    @property
    @abstractmethod
    def sampling(self) -> Sampling:
        """Where the edge texels of its cubes lie."""

    @property
    @abstractmethod
    def size(self) -> int:
        """Texels along an edge of the largest cube."""

    @property
    def roughness_range(self) -> tuple[float, float]:
        """Perceptual roughnesses that it was made for; all, where it has none."""
        return 0.0, 1.0

    @abstractmethod
    def images(self) -> Sequence[Array]:
        """The cubes that a file holds, (6N, N, 3) each."""


@dataclass(frozen=True)
class Shaded:
    """A GGX surface under the light of a map; subclasses answer `radiance` as every map does.

    Attributes
    ----------
    light : EngineMap
    roughness : float
        Perceptual, in 0 .. 1.
    f0 : tuple of 3 float
        Reflectance at normal incidence, linear RGB, in 0 .. 1.
    """

    light: EngineMap
    roughness: float
    f0: Color

    def __post_init__(self) -> None:
        if not 0 <= self.roughness <= 1:
            raise MapError(f"roughness {self.roughness:g} is outside 0 .. 1")
        if not all(0 <= channel <= 1 for channel in self.f0):
            raise MapError(f"f0 {'/'.join(f'{x:g}' for x in self.f0)} is outside 0 .. 1")

    @property
    def info(self) -> MapInfo:
        """That of the map, with the surface as its BRDF."""
        parameters = {"roughness": self.roughness, "f0": list(self.f0)}
        return replace(self.light.info, brdf={"name": "ggx", "parameters": parameters})
