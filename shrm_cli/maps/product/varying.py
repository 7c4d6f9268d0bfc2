"""Product textures of a BRDF of which parameters vary over the surface.

Textures for a few values of the parameters are joined with weights that are interpolated linearly
between these values. Those of one parameter are as the slices of a 3D texture.

References: Kautz, Sloan and Snyder 2002, section 3: "we just need a higher-dimensional c_i(v, q)
table indexed by whichever parameters q are to be spatially varied".
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array
from shrm_cli.maps.info import MapInfo
from shrm_cli.maps.product.product import ProductMap, ProductTexture
from shrm_cli.maps.product.steps import Steps
from shrm_cli.records import record


@record(eq=False)
class VaryingProduct(ProductMap):
    """Product textures that are joined by the values of parameters."""

    textures: tuple[ProductTexture, ...]
    """Of one order and size."""
    steps: Steps
    """The values of the parameters, and the weights of the textures."""
    info: MapInfo
    """How the map was made, with the largest errors of any texture. Its BRDF has the middles of the
    ranges, which are shown where nothing tells the parameters."""

    def __post_init__(self) -> None:
        if self.steps.weights.shape[-1] != len(self.textures):
            raise ValueError(f"{len(self.textures)} textures for other weights")
        if len({each.table.shape for each in self.textures}) > 1:
            raise ValueError("textures of several shapes")

    @classmethod
    def of(cls, textures: Sequence[ProductTexture], steps: Steps) -> "VaryingProduct":
        """Join textures; those of grey BRDFs among coloured ones become coloured."""
        channels = max(each.table.shape[3] for each in textures)
        same = [
            replace(each, table=np.repeat(each.table, channels // each.table.shape[3], axis=3))
            for each in textures
        ]
        infos = [each.info for each in textures]
        info = replace(
            infos[0],
            brdf=steps.recorded([each.brdf for each in infos], 0.5),
            captured=min(each.captured for each in infos),
            **{
                name: max(getattr(each, name) for each in infos)
                for name in ("eps", "predicted_error", "added_error", "filter_error")
            },
        )
        return cls(tuple(same), steps, info)

    @property
    def ways(self) -> Mapping[str, tuple[float, float]]:
        return self.steps.ways

    def details(self) -> dict[str, Any]:
        return {**self.steps.summary(), "textures": len(self.textures)}

    def with_info(self, info: MapInfo) -> "VaryingProduct":
        textures = tuple(replace(each, info=each.info.read_as(info)) for each in self.textures)
        return replace(self, textures=textures, info=info)

    def at(self, shares: ArrayLike) -> ProductTexture:
        weights = self.weights(shares).tolist()
        pairs = [(w, each) for w, each in zip(weights, self.textures, strict=True) if w]
        table = sum((w * each.table for w, each in pairs), np.zeros_like(self.textures[0].table))
        return ProductTexture(table, self.info_at(shares))

    def weights(self, shares: ArrayLike) -> Array:
        return self.steps.at(shares)

    def info_at(self, shares: ArrayLike) -> MapInfo:
        return replace(self.info, brdf=self.steps.recorded([self.info.brdf], shares))

    def values(self, local_views: ArrayLike, shares: ArrayLike = 0.5) -> Array:
        views = np.asarray(local_views, dtype=float)
        flat, weights = views.reshape(-1, 3), self.weights(shares)
        weights = np.broadcast_to(weights, (*views.shape[:-1], len(self.textures)))
        result = np.zeros((len(flat), *self.textures[0].table.shape[2:]))
        for texture, own in zip(self.textures, weights.reshape(len(flat), -1).T, strict=True):
            near = np.flatnonzero(own)
            result[near] += own[near, None, None] * texture.values(flat[near])
        return result.reshape(*views.shape[:-1], *result.shape[1:])
