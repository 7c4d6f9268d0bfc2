"""The split sum of game engines: prefiltered light, times a number from a table.

The light is prefiltered for some roughnesses. The table holds the environment-BRDF: that of GGX,
or the directional albedo of the BRDF whose lobes the levels are of.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property, partial
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array, node_before
from shrm_cli.brdf.base import Brdf, Color
from shrm_cli.brdf.environment.environment_brdf import DirectionalAlbedo
from shrm_cli.brdf.environment.lobe import GgxLobe
from shrm_cli.brdf.environment.material_albedo import MaterialAlbedo
from shrm_cli.brdf.library import is_built_in, parse_recorded
from shrm_cli.brdf.models.ggx import Ggx
from shrm_cli.errors import BrdfError, MapError
from shrm_cli.maps.base import REMEDY
from shrm_cli.maps.info import MapInfo, record_of, spec_of
from shrm_cli.maps.kinds import BrushedLight, LightMap, Shaded
from shrm_cli.maps.splitsum.roughness import blend, level_numbers
from shrm_cli.records import once_each, record
from shrm_cli.sphere.cube import CubeSampler
from shrm_cli.sphere.directions import as_directions, central_directions, surface_frames
from shrm_cli.vocabulary import (
    DEFAULT_EVEN_TAPS,
    DEFAULT_TAPS,
    LEVEL_MAPPINGS,
    NO_TAPS,
    Center,
    LevelMapping,
    Sampling,
)


@record(eq=False)
class SplitSum(LightMap):
    """Light prefiltered by the lobes of GGX for N = V = R, one cube for each roughness.

    They may be those of any other isotropic BRDF that has a roughness, such as cloth.

    References: Karis 2013, Real shading in Unreal Engine 4; Silvennoinen et al. 2025, section 3.2.
    """

    levels: tuple[Array, ...]
    """OpenEXR cubes over the mirror direction R; each texel is a mean of the light, of shape (6
    N_k, N_k, 3) each. No cube is larger than the one before it. Levels that were made from
    truncated expansions may be slightly negative beside very bright light."""
    roughness: tuple[float, ...]
    """The perceptual roughness of each level, rising."""
    mapping: LevelMapping
    """How levels are mixed; see `shrm_cli.maps.splitsum.roughness`."""
    info: MapInfo
    sampling: Sampling = "center"
    level_info: tuple[MapInfo, ...] = ()
    """Orders, domain and predicted error of each level; it is `info` for all by default."""
    center: Center = "reflection"
    """The direction that the cubes are looked up with, which is the normal for BRDFs about it."""
    given: Brdf | None = None
    """The BRDF of another lobe than GGX's, where the map was made in this process. Files hold the
    record of it, which tells nothing of a class of the user's."""
    path: str = ""
    """The file that it was read from, for messages."""

    representation = "splitsum"
    against_negatives = REMEDY

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
        return self.roughness[0], self.roughness[-1]

    @property
    def cube_count(self) -> int:
        return len(self.levels)

    def planes(self) -> tuple[Array, ...]:
        return self.levels

    def with_planes(self, planes: Sequence[Array], sampling: Sampling, info: MapInfo) -> "SplitSum":
        return replace(self, levels=tuple(planes), sampling=sampling, info=info)

    def summary(self) -> dict[str, Any]:
        return {**super().summary(), "size": self.size, "sampling": self.sampling}

    def details(self) -> dict[str, Any]:
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
                "domain": "probe" if _is_probe(roughness, info) else info.domain,
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
        center: Center = "reflection",
    ) -> "SplitSum":
        """Make a split sum whose `info` sums up that of its levels.

        It has the largest order and error of any level, and the least part of a lobe captured.
        """
        pairs = zip(roughness, level_info, strict=True)
        domains = {info.domain for value, info in pairs if not _is_probe(value, info)}
        whole = replace(
            level_info[-1],
            order_f=max(info.order_f for info in level_info),
            captured=min(info.captured for info in level_info),
            predicted_error=max(info.predicted_error for info in level_info),
            brdf=_record_of_all(roughness, level_info),
            domain="angular" if "angular" in domains else "frequency",
        )
        return cls(
            tuple(levels), tuple(roughness), mapping, whole, sampling, tuple(level_info), center
        )

    @cached_property
    def material(self) -> Brdf | None:
        """The BRDF whose lobes the levels are of, at any roughness; None for GGX."""
        if self.is_ggx or self.given is not None:
            return self.given
        info = self.level_info[-1]
        try:
            return parse_recorded(spec_of(info.brdf), primaries=info.chromaticities)
        except BrdfError as error:
            what = f"{self.path}: a split sum" if self.path else self.what
            raise MapError(
                f"{what} of {spec_of(info.brdf)}, which cannot be evaluated "
                f"({str(error).partition(';')[0]}); if it is a class in a file of yours, compare "
                "and view take that as `brdf`, with `probe`"
            ) from error

    def with_class(self, brdf: Brdf | None) -> "SplitSum":
        if self.is_ggx or self.given is not None:
            return self
        if brdf is not None and not is_built_in(type(brdf)) and brdf.name == self.lobe:
            values = self.level_info[-1].brdf.get("parameters")
            own = brdf.with_values(**values) if isinstance(values, dict) else brdf
            return replace(self, given=own)
        _ = self.material  # raises where nobody knows it
        return self

    def mixed(self, matrix: Array, info: MapInfo) -> "SplitSum":
        """Return the map in other primaries, unless its BRDF has colors, which stay in theirs."""
        values = self.level_info[-1].brdf.get("parameters")
        is_colored = isinstance(values, dict) and any(isinstance(v, list) for v in values.values())
        if is_colored and not self.is_ggx:
            raise MapError(
                f"{self.what} of {self.lobe}, whose colours stay as they are; make it again with "
                "`working`"
            )
        return super().mixed(matrix, info)  # type: ignore[return-value]

    @property
    def is_ggx(self) -> bool:
        """Whether the lobes are those of GGX, so that the map is shown with any reflectance f0."""
        return _is_of_ggx(self.level_info[-1])

    @property
    def lobe(self) -> str:
        """The name of the BRDF whose lobes the levels are of, such as ``ggx``."""
        return "ggx" if self.is_ggx else str(self.level_info[-1].brdf["name"])

    def prefiltered(self, roughness: float, directions: ArrayLike) -> Array:
        """Return light mixed of two levels, filtered between their texels, shape (..., 3).

        `directions`, of shape (..., 3), are mirror directions R in world axes, or normals where
        they are the center.
        """
        low, weight = blend(roughness, self.roughness, self.mapping)
        value = self.sampled(low, directions)
        if weight == 0:
            return value
        return (1 - weight) * value + weight * self.sampled(low + 1, directions)

    @property
    def surface_arguments(self) -> tuple[str, ...]:  # type: ignore[override]
        """What of the surface is chosen; a map of another BRDF than GGX has colors of its own."""
        return ("roughness", "f0", "anisotropy") if self.is_ggx else ("roughness",)

    def surface(self, roughness: float, f0: Color, anisotropy: float, taps: int | None) -> Shaded:
        if self.material is not None:
            return ShadedMaterial(self, float(roughness), (1.0, 1.0, 1.0))
        red, green, blue = (float(channel) for channel in f0)
        if anisotropy:
            brush = anisotropy, taps or DEFAULT_TAPS
            return BrushedSplitSum(self, roughness, (red, green, blue), *brush)
        count = DEFAULT_EVEN_TAPS if taps is None else taps
        if count == NO_TAPS:
            return ShadedSplitSum(self, float(roughness), (red, green, blue))
        return TappedSplitSum(self, float(roughness), (red, green, blue), count)

    def sampled(self, level: int, directions: ArrayLike) -> Array:
        """Return the light of a level, filtered between its texels, in directions (..., 3)."""
        values = self._sampler(level)(directions)
        # The cubic filter overshoots beside lamps. Its values must not be lower than the lowest
        # texel of the level, or than 0 where no texel is negative.
        return np.maximum(values, min(float(self.levels[level].min()), 0.0))

    @once_each
    def _sampler(self, level: int) -> CubeSampler:
        return CubeSampler(self.levels[level], self.sampling)


@record
class ShadedSplitSum(Shaded):
    """A GGX surface under the light of a split sum."""

    light: SplitSum

    def radiance(self, normals: ArrayLike, views: ArrayLike) -> Array:
        """Return the light about the center times the albedo; see `Map.radiance`."""
        normals, views = as_directions(normals=normals, views=views)
        centers = central_directions(self.light.center, normals, views)
        light = self.light.prefiltered(self.roughness, centers)
        return light * self._albedo(np.sum(normals * views, axis=-1))

    @cached_property
    def _albedo(self) -> Callable[[Array], Array]:
        """A function of N.V, which is the directional albedo: ``f0 * scale + bias``."""
        return partial(DirectionalAlbedo(self.roughness), f0=self.f0)


@record
class TappedSplitSum(ShadedSplitSum):
    """A GGX surface whose light is looked up where its lobe lies, as ``shrm_even`` has it.

    A lobe leans towards the normal, the more the rougher it is and the more its view grazes.
    """

    taps: int = DEFAULT_EVEN_TAPS

    def radiance(self, normals: ArrayLike, views: ArrayLike) -> Array:
        from shrm_cli.brdf.environment.taps import even_taps

        normals, views = as_directions(normals=normals, views=views)
        found = even_taps(self.roughness, normals, views, self.taps)
        light = _prefiltered(self.light, found.roughness, found.directions)
        cosines = np.sum(normals * views, axis=-1)
        return np.einsum("...k,...kc->...c", found.weights, light) * self._albedo(cosines)


@record
class ShadedMaterial(ShadedSplitSum):
    """A surface of the BRDF whose lobes a split sum is of, under its light; f0 says nothing."""

    @property
    def info(self) -> MapInfo:
        return replace(self.light.info, brdf=record_of(self._brdf))

    @cached_property
    def _brdf(self) -> Brdf:
        material = self.light.material
        assert material is not None
        return material.at_roughness(self.roughness)

    @cached_property
    def _albedo(self) -> Callable[[Array], Array]:
        return MaterialAlbedo(self._brdf)


def _is_probe(roughness: float, info: MapInfo) -> bool:
    """Whether a level is the light itself, in neither domain, as a mirror reflects it.

    That of another BRDF than GGX is it where the light was resampled, which makes no error.
    """
    is_resampled = info.domain == "angular" and info.predicted_error == 0
    return roughness == 0 and (is_resampled or _is_of_ggx(info))


def _is_of_ggx(info: MapInfo) -> bool:
    """Whether a level is of GGX, as those of files are that name no BRDF."""
    return info.brdf.get("name") in (None, GgxLobe.name)


def _record_of_all(roughness: Sequence[float], level_info: Sequence[MapInfo]) -> dict[str, Any]:
    """Return the BRDF of all levels, as they record it: what varies becomes a list."""
    records = [info.brdf for info in level_info]
    name, last = records[-1].get("name"), records[-1].get("parameters")
    if _is_of_ggx(level_info[-1]) or not isinstance(last, dict):
        return {"name": name, "parameters": {"roughness": list(roughness)}}
    parts = [record.get("parameters") for record in records]
    each = [part if isinstance(part, dict) else {} for part in parts]
    varied = {key: [values.get(key) for values in each] for key in last}
    same = {key: all(value == values[0] for value in values) for key, values in varied.items()}
    return {
        "name": name,
        "parameters": {key: last[key] if same[key] else values for key, values in varied.items()},
    }


# ---- brushed GGX: a few look-ups, times numbers of the usual table -------------------------------
# A brushed surface reflects of a uniform environment what an even one of another alpha reflects.
# That alpha depends on how the view lies to the brush marks, and it is not the same for all of the
# light and for the part that Schlick's term adds. For a view (x, y, z) in the frame of the surface
# it is
#
#     alpha^2 = (ax^2 + ay^2) / 2 + (c + d z) (x^2 - y^2) (ax^2 - ay^2) / 2,
#
# with the c and d that `research.taps` fits by least squares to the integrals themselves.

TURNS = {"total": (-1.06, 1.354), "bias": (0.964, 0.286)}
"""The numbers c and d, for ``scale + bias`` and for the bias."""


@record
class BrushedSplitSum(BrushedLight, Shaded):
    """A brushed GGX surface under the light of a split sum, as `shrm_brushed` of its code has it.

    `anisotropy` is that of glTF, in 0 .. 1. `taps` says how many directions the light is looked up
    in.
    """

    light: SplitSum
    anisotropy: float = 0.0
    taps: int = DEFAULT_TAPS

    @property
    def brdf(self) -> Ggx:
        return Ggx(roughness=self.roughness, anisotropy=self.anisotropy, f0=self.f0)

    @property
    def info(self) -> MapInfo:
        return replace(self.light.info, brdf=record_of(self.brdf))

    def brushed_radiance(self, normals: ArrayLike, tangents: ArrayLike, views: ArrayLike) -> Array:
        from shrm_cli.brdf.environment.taps import taps

        normals, tangents, views = np.broadcast_arrays(
            *(np.asarray(each, dtype=float) for each in (normals, tangents, views))
        )
        frames = surface_frames(normals, tangents)
        local = np.einsum("...ij,...j->...i", frames, views)
        local[..., 2] = np.maximum(local[..., 2], 1e-5)
        found = taps(self.brdf.alphas, local, self.taps)
        directions = found.directions @ frames
        light = _prefiltered(self.light, found.roughness, directions)
        return np.einsum("...k,...kc->...c", found.weights, light) * self._albedo(local)

    def _albedo(self, local: Array) -> Array:
        """The directional albedo, shape (..., 3)."""
        from shrm_cli.maps.shader.source import ggx_moments

        moments = ggx_moments()
        total, bias = (
            _filtered(moments[..., column], equal_roughness(part, self.brdf.alphas, local), local)
            for part, column in (("total", 0), ("bias", 3))
        )
        return (total - bias)[..., None] * np.array(self.f0) + bias[..., None]


def equal_roughness(part: str, alphas: tuple[float, float], views: ArrayLike) -> Array:
    """Return the perceptual roughness of the even surface that reflects as much, shape (...).

    `part`, one of ``total``, ``bias``, says which integral is to be the same. `alphas` are along x
    and y. `views`, of shape (..., 3), are unit vectors in the frame of the surface.
    """
    x, y, z = np.moveaxis(np.asarray(views, dtype=float), -1, 0)
    (c, d), (ax2, ay2) = TURNS[part], (alpha**2 for alpha in alphas)
    square = (ax2 + ay2 + (c + d * z) * (x * x - y * y) * (ax2 - ay2)) / 2
    return np.asarray(np.clip(square, 0, 1) ** 0.25)


def _filtered(table: Array, roughness: Array, local: Array) -> Array:
    """Look up a table of roughness and N.V as shaders do."""
    size = len(table)
    places = [np.clip(each * size - 0.5, 0, size - 1) for each in (roughness, local[..., 2])]
    (row, column), (down, across) = zip(
        *(node_before(place, size) for place in places), strict=True
    )
    above = (1 - across) * table[row, column] + across * table[row, column + 1]
    below = (1 - across) * table[row + 1, column] + across * table[row + 1, column + 1]
    return np.asarray((1 - down) * above + down * below)


def _prefiltered(light: SplitSum, roughness: Array, directions: Array) -> Array:
    """Return light of many roughnesses (...) in directions (..., 3), filtered as for one."""
    level, share = node_before(
        level_numbers(roughness, light.roughness, light.mapping), len(light.roughness)
    )
    result = np.zeros(directions.shape)
    for number in range(len(light.roughness)):
        parts = np.where(level == number, 1 - share, 0) + np.where(level + 1 == number, share, 0)
        near = parts > 0
        if near.any():
            result[near] += parts[near][:, None] * light.sampled(number, directions[near])
    return result
