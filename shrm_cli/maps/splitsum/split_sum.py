"""The split sum of game engines: light prefiltered at some roughnesses, times a table."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.brdf.centers import central_directions
from shrm_cli.brdf.environment.environment_brdf import DirectionalAlbedo
from shrm_cli.maps.info import MapInfo
from shrm_cli.maps.light_map import EngineMap, Shaded
from shrm_cli.maps.splitsum.roughness import blend
from shrm_cli.sphere.sampling import CubeSampler
from shrm_cli.vocabulary import LEVEL_MAPPINGS, LevelMapping, Sampling

Array = NDArray[np.floating]


@dataclass(frozen=True)
class SplitSum(EngineMap):
    """Light prefiltered by the lobes of GGX for N = V = R, one cube for each roughness.

    Attributes
    ----------
    levels : tuple of ndarray, shape (6 N_k, N_k, 3)
        Means of the light over R, OpenEXR cubes that do not grow. What is made of truncated
        expansions may be slightly negative beside very bright light.
    roughness : tuple of float
        Perceptual, of each level; rising.
    mapping : {"linear", "filament", "unreal"}
        How levels are mixed; see `shrm_cli.maps.splitsum.roughness`.
    info : MapInfo
    sampling : {"center", "border"}
    level_info : tuple of MapInfo
        Orders, domain and predicted error of each level; `info` for all by default.

    References
    ----------
    Karis 2013, Real shading in Unreal Engine 4; Silvennoinen et al. 2025, section 3.2.
    """

    levels: tuple[Array, ...]
    roughness: tuple[float, ...]
    mapping: LevelMapping
    info: MapInfo
    sampling: Sampling = "center"
    level_info: tuple[MapInfo, ...] = ()

    representation = "splitsum"
    center = "reflection"

    def __post_init__(self) -> None:
        if not self.level_info:
            object.__setattr__(self, "level_info", (self.info,) * len(self.levels))
        if not 0 < len(self.levels) == len(self.roughness) == len(self.level_info):
            raise ValueError(f"{len(self.levels)} levels, {len(self.roughness)} roughnesses")
        for level in self.levels:
            if level.ndim != 3 or level.shape != (6 * level.shape[1], level.shape[1], 3):
                raise ValueError(f"a level of shape {level.shape}, not (6N, N, 3)")
        if any(b.shape[1] > a.shape[1] for a, b in pairwise(self.levels)):
            raise ValueError("levels that grow")
        if any(b <= a for a, b in pairwise(self.roughness)):
            raise ValueError("roughnesses that do not rise")
        if self.mapping not in LEVEL_MAPPINGS:
            raise ValueError(f"mapping {self.mapping!r}")

    @property
    def size(self) -> int:
        """Texels along an edge of the first level."""
        return self.levels[0].shape[1]

    @property
    def roughness_range(self) -> tuple[float, float]:
        """Of the first level and the last."""
        return self.roughness[0], self.roughness[-1]

    def images(self) -> tuple[Array, ...]:
        """The levels."""
        return self.levels

    @classmethod
    def of_levels(
        cls,
        levels: Sequence[Array],
        roughness: Sequence[float],
        mapping: LevelMapping,
        sampling: Sampling,
        level_info: Sequence[MapInfo],
    ) -> "SplitSum":
        """A split sum whose `info` is what is known of all levels together."""
        # Roughness 0 is the probe itself, in neither domain.
        domains = {i.domain for i, r in zip(level_info, roughness, strict=True) if r > 0}
        name = level_info[-1].brdf.get("name")
        whole = replace(
            level_info[-1],
            order_f=max(info.order_f for info in level_info),
            captured=min(info.captured for info in level_info),
            predicted_error=max(info.predicted_error for info in level_info),
            brdf={"name": name, "parameters": {"roughness": list(roughness)}},
            domain="angular" if "angular" in domains else "frequency",
        )
        return cls(tuple(levels), tuple(roughness), mapping, whole, sampling, tuple(level_info))

    def prefiltered(self, roughness: float, directions: ArrayLike) -> Array:
        """Prefiltered light at a roughness, mixed from two levels, each filtered between texels.

        Parameters
        ----------
        roughness : float
        directions : array_like, shape (..., 3)
            R, world axes.

        Returns
        -------
        ndarray, shape (..., 3)
        """
        low, weight = blend(roughness, self.roughness, self.mapping)
        value = self._sampled(low, directions)
        if weight == 0:
            return value
        return (1 - weight) * value + weight * self._sampled(low + 1, directions)

    def shaded(self, roughness: float, f0: Sequence[float]) -> "ShadedSplitSum":
        """A material under this light.

        Parameters
        ----------
        roughness : float
            Perceptual, in 0 .. 1.
        f0 : sequence of 3 float
            Reflectance at normal incidence, linear RGB, in 0 .. 1.

        Raises
        ------
        MapError
            If they are out of range.
        """
        red, green, blue = (float(channel) for channel in f0)
        return ShadedSplitSum(self, float(roughness), (red, green, blue))

    def _sampled(self, level: int, directions: ArrayLike) -> Array:
        if level not in self._samplers:
            self._samplers[level] = CubeSampler(self.levels[level], self.sampling)
        values = self._samplers[level](directions)
        # The cubic filter overshoots beside lamps; nothing is darker than the level's own texels.
        return np.maximum(values, min(float(self.levels[level].min()), 0.0))

    @cached_property
    def _samplers(self) -> dict[int, CubeSampler]:
        """Of the levels that were asked for."""
        return {}


@dataclass(frozen=True)
class ShadedSplitSum(Shaded):
    """A GGX surface under the light of a split sum."""

    light: SplitSum

    def radiance(self, normals: ArrayLike, views: ArrayLike) -> Array:
        """Reflected radiance: the light about R, times ``f0 * scale + bias``.

        Parameters
        ----------
        normals, views : array_like, shape (..., 3), broadcastable
            Unit, world axes; views point to the viewer.

        Returns
        -------
        ndarray, shape (..., 3)
        """
        normals, views = np.asarray(normals, dtype=float), np.asarray(views, dtype=float)
        centers = central_directions("reflection", normals, views)
        light = self.light.prefiltered(self.roughness, centers)
        return light * self._albedo(np.sum(normals * views, axis=-1), self.f0)

    @cached_property
    def _albedo(self) -> DirectionalAlbedo:
        return DirectionalAlbedo(self.roughness)
