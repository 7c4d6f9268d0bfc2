"""What the maps for engines have in common: made from the light alone, for BRDFs of their own."""

from collections.abc import Sequence
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from shrm_cli.brdf.base import Center
from shrm_cli.maps.info import MapInfo
from shrm_cli.sphere.grids import Sampling

Array = NDArray[np.floating]

ENGINES = ("irradiance", "splitsum", "she")
"""Their representations."""


class EngineMap:
    """A map that engines use.

    Files, commands and `Map` know the kinds by this class and their `representation`: to load
    one kind does not load the others.
    """

    representation: ClassVar[str]
    frame: ClassVar[Literal["global"]] = "global"
    center: ClassVar[Center]
    info: MapInfo

    @property
    def sampling(self) -> Sampling:
        """Where the edge texels of its cubes lie."""
        raise NotImplementedError

    @property
    def size(self) -> int:
        """Texels along an edge of the largest cube."""
        raise NotImplementedError

    @property
    def roughness_range(self) -> tuple[float, float]:
        """Perceptual roughnesses that it was made for; all, where it has none."""
        return 0.0, 1.0

    def images(self) -> Sequence[Array]:
        """The cubes that a file holds, (6N, N, 3) each."""
        raise NotImplementedError
