"""Product textures of a BRDF of which one parameter varies over the surface.

The table has one more axis: a texture for each of a few values of the parameter, between which the
coefficients are interpolated linearly, as a 3D texture does it.

References
----------
Kautz, Sloan and Snyder 2002, section 3: "we just need a higher-dimensional c_i(v, q) table indexed
by whichever parameters q are to be spatially varied".
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array
from shrm_cli.maps.info import MapInfo
from shrm_cli.maps.product.product import Points, ProductMap, ProductTexture
from shrm_cli.records import record


@record
class VaryingProduct(ProductMap):
    """Product textures for rising values of a parameter."""

    textures: tuple[ProductTexture, ...]
    """Two or more, of one order and size."""
    parameter: str
    """The name of the BRDF's parameter."""
    values: tuple[float, ...]
    """Its value of each texture, rising."""
    info: MapInfo
    """How the map was made, with the largest errors of any texture."""
    step_error: float = 0.0
    """The largest relative RMS error in the middle between two textures, under white noise; 0 where
    nobody has measured it."""

    varies = True

    def __post_init__(self) -> None:
        first = self.textures[0]
        if len(self.textures) != len(self.values) or len(self.values) < 2:
            raise ValueError(f"{len(self.textures)} textures for {len(self.values)} values")
        if any(b <= a for a, b in pairwise(self.values)):
            raise ValueError("values that do not rise")
        if any(each.table.shape != first.table.shape for each in self.textures):
            raise ValueError("textures of several shapes")

    @classmethod
    def of(
        cls,
        textures: Sequence[ProductTexture],
        parameter: str,
        values: Sequence[float],
        step_error: float = 0.0,
    ) -> "VaryingProduct":
        """Join textures; those of grey BRDFs among coloured ones become coloured."""
        channels = max(each.table.shape[3] for each in textures)
        same = [
            replace(each, table=np.repeat(each.table, channels // each.table.shape[3], axis=3))
            for each in textures
        ]
        infos = [each.info for each in textures]
        info = replace(
            infos[0],
            captured=min(each.captured for each in infos),
            **{
                name: max(getattr(each, name) for each in infos)
                for name in ("eps", "predicted_error", "added_error", "filter_error")
            },
        )
        return cls(tuple(same), parameter, tuple(map(float, values)), info, step_error)

    def variation(self) -> dict[str, Any]:
        """Return the parameter, its values, and what lies between them, as files record them."""
        return {
            "parameter": self.parameter,
            "values": list(self.values),
            "step_error": self.step_error,
        }

    def details(self) -> dict[str, Any]:
        """Return the parameter, its values, and what is missed between them."""
        return self.variation()

    def with_info(self, info: MapInfo) -> "VaryingProduct":
        """Return the same textures with another record of how they were made."""
        textures = tuple(replace(each, info=each.info.read_as(info)) for each in self.textures)
        return replace(self, textures=textures, info=info)

    def at(self, share: float) -> ProductTexture:
        """Return the texture for one value of the parameter, interpolated between two."""
        wanted = self.values[0] + share * (self.values[-1] - self.values[0])
        above = int(np.clip(np.searchsorted(self.values, wanted), 1, len(self.values) - 1))
        low, high = self.values[above - 1], self.values[above]
        weight = (wanted - low) / (high - low)
        first, second = self.textures[above - 1], self.textures[above]
        return replace(first, table=(1 - weight) * first.table + weight * second.table)

    def reflected(self, lighting: Array, points: Points, shares: ArrayLike) -> Array:
        """Evaluate what a surface reflects whose parameter varies; see `ProductMap.reflected`."""
        normals, *others = np.broadcast_arrays(*points)
        shares = np.broadcast_to(np.asarray(shares, dtype=float), normals.shape[:-1])
        flat = [each.reshape(-1, 3) for each in (normals, *others)]
        low, high = self.values[0], self.values[-1]
        wanted = low + np.clip(shares.reshape(-1), 0, 1) * (high - low)
        # Where the values lie among those of the textures, as broken indices.
        place = np.interp(wanted, self.values, np.arange(len(self.values)))
        result = np.zeros((len(place), 3))
        for index, texture in enumerate(self.textures):
            weight = np.maximum(1 - np.abs(place - index), 0)
            near = np.flatnonzero(weight)
            found = texture.reflected(lighting, [each[near] for each in flat])
            result[near] += weight[near, None] * found
        return result.reshape(normals.shape)
