"""Brushed GGX under the light of a split sum: a few look-ups, times numbers of the usual table.

A brushed surface reflects of a uniform environment what an even one of another alpha reflects. That
alpha depends on how the view lies to the brush marks, and it is not the same for all of the light
and for the part that Schlick's term adds. For a view (x, y, z) in the frame of the surface it is

    alpha^2 = (ax^2 + ay^2) / 2 + (c + d z) (x^2 - y^2) (ax^2 - ay^2) / 2,

with the c and d that `research.taps` fits by least squares to the integrals themselves.
"""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array
from shrm_cli.brdf.environment.taps import taps
from shrm_cli.brdf.models.ggx import Ggx
from shrm_cli.maps.info import MapInfo, record_of
from shrm_cli.maps.kinds import Shaded
from shrm_cli.maps.shader.source import TABLE_SIZE, ggx_moments
from shrm_cli.maps.splitsum.roughness import level_numbers
from shrm_cli.records import record
from shrm_cli.sphere.directions import horizontal_tangents, surface_frames
from shrm_cli.vocabulary import DEFAULT_TAPS

if TYPE_CHECKING:
    from shrm_cli.maps.splitsum.split_sum import SplitSum

TURNS = {"total": (-1.06, 1.354), "bias": (0.964, 0.286)}
"""The numbers c and d, for ``scale + bias`` and for the bias."""


@record
class BrushedSplitSum(Shaded):
    """A brushed GGX surface under the light of a split sum, as `shrm_brushed` of its code has it.

    `anisotropy` is that of glTF, in 0 .. 1. `taps` says how many directions the light is looked up
    in.
    """

    light: "SplitSum"
    anisotropy: float = 0.0
    taps: int = DEFAULT_TAPS

    @property
    def brdf(self) -> Ggx:
        return Ggx(roughness=self.roughness, anisotropy=self.anisotropy, f0=self.f0)

    @property
    def info(self) -> MapInfo:
        return replace(self.light.info, brdf=record_of(self.brdf))

    def radiance(self, normals: ArrayLike, views: ArrayLike) -> Array:
        """Return the light of a surface whose tangents run around +Y; see `Map.radiance`."""
        normals, views = np.broadcast_arrays(
            np.asarray(normals, dtype=float), np.asarray(views, dtype=float)
        )
        return self.brushed_radiance(normals, horizontal_tangents(normals), views)

    def brushed_radiance(self, normals: ArrayLike, tangents: ArrayLike, views: ArrayLike) -> Array:
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
    places = [
        np.clip(each * TABLE_SIZE - 0.5, 0, TABLE_SIZE - 1) for each in (roughness, local[..., 2])
    ]
    (row, column), (down, across) = zip(
        *(_split(place, TABLE_SIZE) for place in places), strict=True
    )
    above = (1 - across) * table[row, column] + across * table[row, column + 1]
    below = (1 - across) * table[row + 1, column] + across * table[row + 1, column + 1]
    return np.asarray((1 - down) * above + down * below)


def _split(place: Array, count: int) -> tuple[Array, Array]:
    """Return the index of the node before a place, and how far behind it the place is."""
    index = np.minimum(place.astype(int), max(count - 2, 0))
    return index, place - index


def _prefiltered(light: "SplitSum", roughness: Array, directions: Array) -> Array:
    """Return light of many roughnesses (...) in directions (..., 3), filtered as for one."""
    level, share = _split(
        level_numbers(roughness, light.roughness, light.mapping), len(light.roughness)
    )
    result = np.zeros(directions.shape)
    for number in range(len(light.roughness)):
        parts = np.where(level == number, 1 - share, 0) + np.where(level + 1 == number, share, 0)
        near = parts > 0
        if near.any():
            result[near] += parts[near][:, None] * light.sampled(number, directions[near])
    return result
