"""Textures under pixels: mip-mapped, and averaged over what each pixel covers of them.

A pixel covers a parallelogram of the texture. Along its longer side several places are looked up,
at the level whose texels are as large as its shorter side is; that is anisotropic filtering. Both
are halved once more, because bilinear filtering of texels as large as the pixel blurs it.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.arrays import Array
from shrm_cli.errors import MeshError
from shrm_cli.files.texture import read_texture
from shrm_cli.geometry.surface import Texture, Wrap
from shrm_cli.memo import Memo

MOST_PIXELS = 2**27
"""The most pixels of all textures of a mesh, which take 11 bytes each."""
_MOST_TAPS = 16
"""The most places along the longer side of what a pixel covers."""
_FINER = 2
"""How many places a pixel has where its parallelogram is a square, along each side."""
_FAR = 1e6
"""The largest texture coordinate, and change of one from a pixel to the next."""
_LARGEST = 6e4
"""The largest number that half floats hold, about."""

_known_levels = Memo(2**29)


class MipMap:
    """A texture in halving sizes.

    Parameters
    ----------
    levels : sequence of ndarray, shape (H_k, W_k, 4)
        As `mip_levels` returns them.
    texture : Texture
        How it lies over a mesh.
    """

    def __init__(self, levels: Sequence[Array], texture: Texture) -> None:
        self._levels, self._texture = levels, texture
        self._matrix = np.reshape(texture.matrix, (2, 3))

    @property
    def pixels(self) -> int:
        """The number of pixels of the texture itself."""
        return self._levels[0].shape[0] * self._levels[0].shape[1]

    @property
    def is_gray(self) -> bool:
        """Whether red, green and blue are the same all over it."""
        top = self._levels[0]
        return bool((top[..., 0] == top[..., 1]).all() and (top[..., 0] == top[..., 2]).all())

    @property
    def axes(self) -> Array:
        """The directions of the texture's own axes, v upwards, in those of the coordinates.

        They are the columns, shape (2, 2).
        """
        a, b, c, d = self._matrix[:, :2].ravel()
        # The inverse of [[a, -b], [-c, d]], but for a factor, which the lengths take away.
        found = np.sign(a * d - b * c) * np.array([[d, b], [c, a]])
        length = np.linalg.norm(found, axis=0)
        return found / length if (length > 0).all() else np.eye(2)

    def at(self, uvs: Array, steps: Array) -> Array:
        """Return means over pixels, shape (n, 4).

        Parameters
        ----------
        uvs : ndarray, shape (n, 2)
            Texture coordinates at the middle, v upwards.
        steps : ndarray, shape (n, 2, 2)
            How these change to the next pixel, (u, v) by (right, up).
        """
        uvs, steps = (np.clip(np.nan_to_num(each), -_FAR, _FAR) for each in (uvs, steps))
        down = np.column_stack([uvs[:, 0], 1 - uvs[:, 1]])
        places = down @ self._matrix[:, :2].T + self._matrix[:, 2]
        sizes = np.array(self._levels[0].shape[1::-1])
        moves = (self._matrix[:, :2] @ (steps * [[1], [-1]])) * sizes[:, None]
        left, lengths, _ = np.linalg.svd(moves)
        long, short = lengths.T
        along = left[:, :, 0] * long[:, None] / sizes
        across = left[:, :, 1] * short[:, None] / sizes
        is_small = long <= 0.5  # a pixel within a texel
        ratio = np.clip(np.ceil(long / np.maximum(short, 1)), 1, _MOST_TAPS // _FINER)
        taps = np.where(is_small, 1, _FINER * ratio).astype(np.int64)
        rows = np.where(short <= 0.5, 1, _FINER)
        width = np.maximum(long / taps, short / rows)
        level = np.clip(np.log2(np.maximum(width, 1)), 0, len(self._levels) - 1)
        result = np.zeros((len(uvs), 4))
        for key in np.unique(taps * 4 + rows):
            count, lines = divmod(int(key), 4)
            own = np.flatnonzero((taps == count) & (rows == lines))
            for x in (np.arange(count) + 0.5) / count - 0.5:
                for y in (np.arange(lines) + 0.5) / lines - 0.5:
                    at = places[own] + x * along[own] + y * across[own]
                    result[own] += self._trilinear(at, level[own]) / (count * lines)
        return result

    def _trilinear(self, places: Array, level: Array) -> Array:
        low = np.floor(level).astype(np.int64)
        share = (level - low)[:, None]
        result = np.zeros((len(places), 4))
        for number in np.unique(low):
            own = np.flatnonzero(low == number)
            value = self._bilinear(int(number), places[own])
            if share[own].any():
                above = self._bilinear(int(number) + 1, places[own])
                value = (1 - share[own]) * value + share[own] * above
            result[own] = value
        return result

    def _bilinear(self, level: int, places: Array) -> Array:
        pixels = self._levels[level]
        height, width = pixels.shape[:2]
        x, y = (places * [width, height] - 0.5).T
        if level == 0 and self._texture.is_nearest:
            x, y = np.round(x), np.round(y)
        left, top = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
        across, under = (x - left)[:, None], (y - top)[:, None]
        side, end = self._texture.wrap
        result = np.zeros((len(places), 4))
        for row, row_weight in ((top, 1 - under), (top + 1, under)):
            rows = _wrapped(row, height, end)
            for column, weight in ((left, 1 - across), (left + 1, across)):
                result += row_weight * weight * pixels[rows, _wrapped(column, width, side)]
        return result


def open_texture(name: str, texture: Texture) -> MipMap:
    """Read a texture.

    Parameters
    ----------
    name : str
        The mesh's file, for messages.
    texture : Texture

    Raises
    ------
    MeshError
        If it is missing, damaged or too large.
    """
    picture = texture.picture
    try:
        if isinstance(picture, str):
            raise ValueError(picture)
        known = None if isinstance(picture, bytes) else picture.stat().st_mtime_ns
        key = picture, known, texture.is_srgb
        levels = _known_levels.get(key, lambda: mip_levels(read_texture(picture, texture.is_srgb)))
    except (ValueError, OSError) as error:
        raise MeshError(f"{name}: {error}; or draw it without its surface") from None
    return MipMap(levels, texture)


def mip_levels(pixels: ArrayLike) -> tuple[Array, ...]:
    """Return an image and its means in halving sizes, down to one pixel, as half floats.

    Sizes are rounded down; pixels then count by how much of them lies within the larger one.

    Parameters
    ----------
    pixels : array_like, shape (H, W, 4)
    """
    level = np.asarray(pixels, dtype=np.float32)
    levels = [level]
    while max(level.shape[:2]) > 1:
        level = _halved(_halved(level).swapaxes(0, 1)).swapaxes(0, 1)
        levels.append(level)
    return tuple(np.clip(each, -_LARGEST, _LARGEST).astype(np.float16) for each in levels)


def _halved(rows: Array) -> Array:
    """Return the means of what lies within rows of twice the height."""
    count = len(rows)
    if count == 1:
        return rows
    half = count // 2
    if count % 2 == 0:
        return (rows[::2] + rows[1::2]) / 2
    first = (np.arange(half, dtype=np.float32)[:, None, None] + 1) / count
    last = first[::-1]
    return last * rows[:-2:2] + half / count * rows[1:-1:2] + first * rows[2::2]


def _wrapped(index: NDArray[np.int64], count: int, wrap: Wrap) -> NDArray[np.int64]:
    if wrap == "clamp":
        return np.clip(index, 0, count - 1)
    if wrap == "repeat":
        return index % count
    folded = index % (2 * count)
    return np.minimum(folded, 2 * count - 1 - folded)
