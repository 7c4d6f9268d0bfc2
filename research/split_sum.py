"""The split sum as engines run it, which the paper on SH exponentials compares with too.

It has an octahedral map for each of some roughnesses. A texel is the mean of the light from 1024
directions, which GGX's distribution chooses for N = V = R, weighted by N.L. (The lobe of such means
is ``D N.L``; the exact lobe has Smith's term too.) This module shares no code with `shrm_cli`.

References
----------
Silvennoinen et al. 2025, Spherical harmonic exponentials for efficient glossy reflections.
Karis 2013, Real shading in Unreal Engine 4 (PrefilterEnvMap). Krivanek and Colbert 2008, Real-time
shading with filtered importance sampling. Cigolle et al. 2014, for the octahedral map.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

Array = NDArray[np.floating]
Indices = NDArray[np.intp]

SAMPLES = 1024
"""Directions for each texel."""
SIZES = (128, 64, 32, 32, 32, 32)
"""Texels along an edge of each map; none has less than 32, as in the paper. A first map of 256
would change the errors by a few percent, or by no more than their noise."""
ROUGHNESSES = tuple(np.linspace(np.sqrt(0.2), 1.0, len(SIZES)).tolist())
"""Perceptual roughnesses of the maps: alpha goes from .2 to 1, as for the exponentials."""
_TEXELS_AT_ONCE = 128
"""The number of texels that are computed at a time."""


@dataclass(frozen=True)
class Source:
    """Several lat-longs of one size and their mips, each half as high as the one before.

    Attributes
    ----------
    heights : tuple of int
        The height of each mip.
    pixels : ndarray, shape (pixels of all mips, 3 * probes)
        The pixels of one mip after the other.
    """

    heights: tuple[int, ...]
    pixels: Array


def source_of(images: Sequence[Array]) -> Source:
    """Make the mips of lat-longs of one size, shape (h, 2h, 3) each."""
    mips = [np.concatenate(list(images), axis=-1).astype(np.float32)]
    while mips[-1].shape[0] > 1:
        above = mips[-1]
        height, width, channels = above.shape
        blocks = above.reshape(height // 2, 2, width // 2, 2, channels)
        mips.append(blocks.mean(axis=(1, 3)))
    flat = [each.reshape(-1, each.shape[-1]) for each in mips]
    return Source(tuple(each.shape[0] for each in mips), np.concatenate(flat))


class PaperSplitSum:
    """The first factor of the split sum, for several probes at once.

    Parameters
    ----------
    source : Source
    directions : ndarray, shape (n, 3)
        The mirror directions R that `at` returns light for. Only texels beside them are made.
    filtered : bool
        Whether a sample reads the mip whose pixels are as large as the part of the lobe that it
        stands for, or always the lat-long itself. Both are filtered between pixels.
    """

    def __init__(self, source: Source, directions: Array, filtered: bool) -> None:
        self._levels = [
            self._level(source, directions, roughness, size, filtered)
            for roughness, size in zip(ROUGHNESSES, SIZES, strict=True)
        ]

    def at(self, roughness: float) -> Array:
        """Return the light about each R, mixed linearly from two levels, shape (n, 3 * probes)."""
        position = float(np.interp(roughness, ROUGHNESSES, np.arange(len(SIZES))))
        low = min(int(position), len(SIZES) - 2)
        weight = position - low
        return (1 - weight) * self._levels[low] + weight * self._levels[low + 1]

    @staticmethod
    def _level(
        source: Source, directions: Array, roughness: float, size: int, filtered: bool
    ) -> Array:
        corners, weights = octahedral_corners(directions, size)
        needed, where = np.unique(corners, return_inverse=True)
        texels = prefilter(source, octahedral_directions(needed, size), roughness**2, filtered)
        found = texels[where.reshape(corners.shape)]
        return np.einsum("nkc,nk->nc", found, weights)


def prefilter(source: Source, normals: Array, alpha: float, filtered: bool) -> Array:
    """Compute means of the light for N = V = R at some normals, shape (n, 3 * probes)."""
    lights, weights, lods = _samples(alpha, source.heights[0])
    lods = lods if filtered else np.zeros_like(lods)
    result = np.empty((len(normals), source.pixels.shape[1]))
    for start in range(0, len(normals), _TEXELS_AT_ONCE):
        part = slice(start, start + _TEXELS_AT_ONCE)
        frames = _frames(normals[part]).astype(np.float32)
        result[part] = _read(source, lights, weights, lods, frames)
    return result


def _samples(alpha: float, height: int) -> tuple[Array, Array, Array]:
    """Return directions L about the normal, their weights, and the mips of a lat-long to read."""
    count = np.arange(SAMPLES)
    first = (count + 0.5) / SAMPLES
    second = np.array([int(f"{k:010b}"[::-1], 2) for k in count]) / SAMPLES
    cosine2 = (1 - second) / (1 + (alpha**2 - 1) * second)  # the square of N.H
    n_l = 2 * cosine2 - 1
    across = np.sqrt(np.maximum(1 - n_l**2, 0))
    turn = 2 * np.pi * first
    lights = np.stack([across * np.cos(turn), across * np.sin(turn), n_l], axis=1)
    distribution = alpha**2 / (np.pi * (1 + (alpha**2 - 1) * cosine2) ** 2)
    # The density of L is D N.H / (4 V.H), which is D / 4 for N = V. The solid angle of a pixel at
    # the equator is (pi / height)^2.
    lods = 0.5 * np.log2(4 / (SAMPLES * distribution) / (np.pi / height) ** 2)
    above = n_l > 0
    return lights[above], n_l[above] / n_l[above].sum(), np.maximum(lods[above], 0)


def _read(source: Source, lights: Array, weights: Array, lods: Array, frames: Array) -> Array:
    """Sum over all weighted samples about each of some frames, shape (n, 3, 3)."""
    columns: list[Indices] = []
    values: list[Array] = []
    offset = 0
    for mip, height in enumerate(source.heights):
        share = np.maximum(1 - np.abs(lods - mip), 0)
        used = share > 0
        if used.any():
            world = lights[used].astype(np.float32) @ frames
            pixels, parts = latlong_corners(world, height)
            columns.append((offset + pixels).reshape(len(frames), -1))
            own = (weights * share)[used].astype(np.float32)
            values.append((parts * own[:, None]).reshape(len(frames), -1))
        offset += 2 * height**2
    column, value = np.concatenate(columns, axis=1), np.concatenate(values, axis=1)
    starts = np.arange(len(frames) + 1) * column.shape[1]
    shape = len(frames), len(source.pixels)
    return csr_array((value.ravel(), column.ravel(), starts), shape=shape) @ source.pixels


def latlong_corners(directions: Array, height: int) -> tuple[Indices, Array]:
    """Find the four pixels of a flat lat-long about each direction, and their weights: (..., 4)."""
    x, y, z = directions[..., 0], directions[..., 1], directions[..., 2]
    across = (0.5 - np.arctan2(x, z) / np.float32(2 * np.pi)) * 2 * height - 0.5
    down = np.arccos(np.clip(y, -1, 1)) * np.float32(height / np.pi) - 0.5
    left, top = np.floor(across).astype(np.int32), np.floor(down).astype(np.int32)
    right_part, lower_part = across - left, down - top
    columns = [left % (2 * height), (left + 1) % (2 * height)]
    rows = [np.clip(row, 0, height - 1) * (2 * height) for row in (top, top + 1)]
    pixels = np.stack([row + column for row in rows for column in columns], axis=-1)
    parts = np.stack(
        [v * h for v in (1 - lower_part, lower_part) for h in (1 - right_part, right_part)], axis=-1
    )
    return pixels, parts


def octahedral_directions(texels: Indices, size: int) -> Array:
    """Return unit vectors to the middles of some texels, shape (n, 3)."""
    rows, columns = np.divmod(texels, size)
    u, v = (2 * (each + 0.5) / size - 1 for each in (columns, rows))
    z = 1 - np.abs(u) - np.abs(v)
    folded_u, folded_v = _fold(u, v)
    vectors = np.stack([np.where(z < 0, folded_u, u), np.where(z < 0, folded_v, v), z], axis=1)
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def octahedral_corners(directions: Array, size: int) -> tuple[Indices, Array]:
    """Find the four texels about each direction, also across edges, and their weights: (n, 4)."""
    x, y, z = (directions / np.abs(directions).sum(axis=1, keepdims=True)).T
    folded_x, folded_y = _fold(x, y)
    across = (np.where(z < 0, folded_x, x) + 1) / 2 * size - 0.5
    down = (np.where(z < 0, folded_y, y) + 1) / 2 * size - 0.5
    left, top = np.floor(across).astype(int), np.floor(down).astype(int)
    columns = np.stack([left, left + 1, left, left + 1], axis=1)
    rows = np.stack([top, top, top + 1, top + 1], axis=1)
    h, v = across - left, down - top
    weights = np.stack([(1 - h) * (1 - v), h * (1 - v), (1 - h) * v, h * v], axis=1)
    # Each edge of the square is joined to itself, the other way round.
    beyond_sides, beyond_ends = (np.isin(each, (-1, size)) for each in (columns, rows))
    columns, rows = np.clip(columns, 0, size - 1), np.clip(rows, 0, size - 1)
    turned_rows = np.where(beyond_sides, size - 1 - rows, rows)
    turned_columns = np.where(beyond_ends, size - 1 - columns, columns)
    return turned_rows * size + turned_columns, weights


def _fold(x: Array, y: Array) -> tuple[Array, Array]:
    """Turn the lower half of the octahedron outwards about the square's inner diamond."""
    return (1 - np.abs(y)) * np.where(x < 0, -1, 1), (1 - np.abs(x)) * np.where(y < 0, -1, 1)


def _frames(normals: Array) -> Array:
    """Return frames of tangent, bitangent and normal as rows, as Karis 2013 has them: (n, 3, 3)."""
    upright = np.abs(normals[:, 2:]) < 0.999
    up = np.where(upright, np.array([0.0, 0, 1]), np.array([1.0, 0, 0]))
    tangents = np.cross(up, normals)
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    return np.stack([tangents, np.cross(normals, tangents), normals], axis=1)
