"""The split sum of game engines: prefiltered light, times a number from a table.

The light is prefiltered for some roughnesses. The table holds the environment-BRDF.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array
from shrm_cli.brdf.environment.environment_brdf import DirectionalAlbedo
from shrm_cli.maps.info import MapInfo
from shrm_cli.maps.light_map import Shaded, SurfaceLightMap
from shrm_cli.maps.splitsum.roughness import blend
from shrm_cli.records import record
from shrm_cli.sphere.directions import central_directions
from shrm_cli.sphere.sampling import CubeSampler
from shrm_cli.vocabulary import LEVEL_MAPPINGS, LevelMapping, Sampling


@record(eq=False)
class SplitSum(SurfaceLightMap):
    """Light prefiltered by the lobes of GGX for N = V = R, one cube for each roughness.

    Attributes
    ----------
    levels : tuple of ndarray, shape (6 N_k, N_k, 3)
        OpenEXR cubes over the mirror direction R; each texel is a mean of the light. No cube is
        larger than the one before it. Levels that were made from truncated expansions may be
        slightly negative beside very bright light.
    roughness : tuple of float
        The perceptual roughness of each level, rising.
    mapping : {"linear", "filament", "unreal"}
        How levels are mixed; see `shrm_cli.maps.splitsum.roughness`.
    info : MapInfo
        How the map was made, for all levels together.
    sampling : {"center", "border"}
        Where the samples of the cubes lie.
    level_info : tuple of MapInfo
        Orders, domain and predicted error of each level; it is `info` for all by default.

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
        """The perceptual roughness of the first level, and of the last."""
        return self.roughness[0], self.roughness[-1]

    @property
    def cube_count(self) -> int:
        """The number of cubes, one for each level."""
        return len(self.levels)

    def planes(self) -> tuple[Array, ...]:
        """Return the cubes of the levels, the sharpest first."""
        return self.levels

    def with_planes(self, planes: Sequence[Array], sampling: Sampling, info: MapInfo) -> "SplitSum":
        """Return a map of the same roughnesses with other cubes."""
        return replace(self, levels=tuple(planes), sampling=sampling, info=info)

    def summary(self) -> dict[str, Any]:
        """Return what users and scripts are told of the map, without the levels of `details`."""
        return {**super().summary(), "size": self.size, "sampling": self.sampling}

    def details(self) -> dict[str, Any]:
        """Return how the levels are mixed, and what each of them is."""
        return {
            "mapping": self.mapping,
            "levels": self.level_rows(),
            "predicted_error": self.info.predicted_error,
        }

    def level_rows(self) -> list[dict[str, Any]]:
        """Return roughness, size, order, domain and predicted error of each level, for JSON."""
        known = zip(self.roughness, self.levels, self.level_info, strict=True)
        return [
            {
                "roughness": roughness,
                "size": level.shape[1],
                "order_f": info.order_f,
                "domain": info.domain if roughness > 0 else "probe",
                "predicted_error": info.predicted_error,
            }
            for roughness, level, info in known
        ]

    @classmethod
    def of_levels(
        cls,
        levels: Sequence[Array],
        roughness: Sequence[float],
        mapping: LevelMapping,
        sampling: Sampling,
        level_info: Sequence[MapInfo],
    ) -> "SplitSum":
        """Make a split sum whose `info` sums up that of its levels.

        It has the largest order and error of any level, and the least part of a lobe captured.
        """
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
        """Return prefiltered light, mixed from two levels and filtered between their texels.

        Parameters
        ----------
        roughness : float
            Perceptual roughness.
        directions : array_like, shape (..., 3)
            Mirror directions R in world axes.

        Returns
        -------
        ndarray, shape (..., 3)
        """
        low, weight = blend(roughness, self.roughness, self.mapping)
        value = self.sampled(low, directions)
        if weight == 0:
            return value
        return (1 - weight) * value + weight * self.sampled(low + 1, directions)

    def shaded(self, roughness: float, f0: Sequence[float]) -> "ShadedSplitSum":
        """Return a GGX surface of a roughness and reflectance under the light; see `Map.shaded`."""
        red, green, blue = (float(channel) for channel in f0)
        return ShadedSplitSum(self, float(roughness), (red, green, blue))

    def sampled(self, level: int, directions: ArrayLike) -> Array:
        """Return the light of a level, filtered between its texels, in directions (..., 3)."""
        if level not in self._samplers:
            self._samplers[level] = CubeSampler(self.levels[level], self.sampling)
        values = self._samplers[level](directions)
        # The cubic filter overshoots beside lamps. Its values must not be lower than the lowest
        # texel of the level, or than 0 where no texel is negative.
        return np.maximum(values, min(float(self.levels[level].min()), 0.0))

    @cached_property
    def _samplers(self) -> dict[int, CubeSampler]:
        """The samplers of the levels that were used so far, by the index of the level."""
        return {}


@record
class ShadedSplitSum(Shaded):
    """A GGX surface under the light of a split sum."""

    light: SplitSum

    def radiance(self, normals: ArrayLike, views: ArrayLike) -> Array:
        """Return the light about R times ``f0 * scale + bias``; see `Map.radiance`."""
        normals, views = np.asarray(normals, dtype=float), np.asarray(views, dtype=float)
        centers = central_directions("reflection", normals, views)
        light = self.light.prefiltered(self.roughness, centers)
        return light * self._albedo(np.sum(normals * views, axis=-1), self.f0)

    @cached_property
    def _albedo(self) -> DirectionalAlbedo:
        return DirectionalAlbedo(self.roughness)
