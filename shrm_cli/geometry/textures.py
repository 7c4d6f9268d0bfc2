"""Textures under pixels: mip-mapped, and averaged over what each pixel covers of them.

A pixel covers a parallelogram of the texture. Along its longer side several places are looked up,
at the level whose texels are as large as its shorter side is; that is anisotropic filtering. Both
are halved once more, because bilinear filtering of texels as large as the pixel blurs it.
"""

from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.arrays import Array
from shrm_cli.errors import MeshError
from shrm_cli.files.texture import read_texture
from shrm_cli.geometry.mesh import Texture, Wrap
from shrm_cli.records import record

MOST_PIXELS = 2**27
"""The most pixels of all textures of a picture, which take 11 bytes each."""
_MOST_TAPS = 16
"""The most places along the longer side of what a pixel covers."""
_WITHIN = 0.5
"""Pixels as small as this, in texels, are one place."""
FINER = 2
"""How many places a pixel has where its parallelogram is a square, along each side."""
_FAR = 2.0**24
"""The largest texture coordinate, and change of one from a pixel to the next. Files hold single
precision, which has no fractions beyond."""
_LARGEST = 6e4
"""The largest number that half floats hold, about."""


@record(eq=False)
class Pyramid:
    """An image and its means in halving sizes, one after the other."""

    pixels: Array
    """All rows of all sizes, half floats of shape (n, 4)."""
    sizes: NDArray[np.int64]
    """Width and height of each, shape (levels, 2)."""

    @cached_property
    def starts(self) -> NDArray[np.int64]:
        """Where each size begins."""
        return np.concatenate([[0], np.cumsum(self.sizes.prod(axis=1))])

    def level(self, number: int) -> Array:
        """Return the image of a size, shape (H, W, 4)."""
        width, height = self.sizes[number]
        start, stop = self.starts[number : number + 2]
        return self.pixels[start:stop].reshape(height, width, 4)


class MipMap:
    """A texture over a mesh, in halving sizes."""

    def __init__(self, pyramid: Pyramid, texture: Texture) -> None:
        self._pyramid, self._texture = pyramid, texture
        self._matrix = np.reshape(texture.matrix, (2, 3))

    def range(self, channel: int) -> tuple[float, float]:
        """Return the least and the largest value of a channel of the texture itself."""
        values = self._pyramid.level(0)[..., channel]
        return float(values.min()), float(values.max())

    @property
    def is_gray(self) -> bool:
        """Whether red, green and blue are the same all over it."""
        top = self._pyramid.level(0)
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

    def at(self, uvs: Array, steps: Array, finer: int = FINER) -> Array:
        """Return means over pixels, shape (n, 4).

        `uvs`, of shape (n, 2), are texture coordinates at the middle, v upwards. `steps`, of shape
        (n, 2, 2), are how these change to the next pixel, (u, v) by (right, up). `finer`, one of 1,
        2, is how many places there are along the sides of a square; 1 will do for parts of pixels.
        """
        uvs, steps = (np.clip(np.nan_to_num(each), -_FAR, _FAR) for each in (uvs, steps))
        down = np.column_stack([uvs[:, 0], 1 - uvs[:, 1]])
        places = down @ self._matrix[:, :2].T + self._matrix[:, 2]
        size = self._pyramid.sizes[0]
        moves = (self._matrix[:, :2] @ (steps * [[1], [-1]])) * size[:, None]
        long, short, angle = _ellipse(moves)
        towards = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        along = towards * long[:, None] / size
        across = towards[:, ::-1] * [-1, 1] * short[:, None] / size
        is_small = long <= _WITHIN
        ratio = np.clip(np.ceil(long / np.maximum(short, 1)), 1, _MOST_TAPS // finer)
        taps = np.where(is_small, 1, finer * ratio).astype(np.int64)
        rows = np.where(short <= _WITHIN, 1, finer)
        width = np.maximum(long / taps, short / rows)
        level = np.clip(np.log2(np.maximum(width, 1)), 0, len(self._pyramid.sizes) - 1)
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
        share = level - low
        result = self._bilinear(low, places)
        between = np.flatnonzero(share)
        if len(between):
            above = self._bilinear(low[between] + 1, places[between])
            result[between] += share[between, None] * (above - result[between])
        return result

    def _bilinear(self, level: NDArray[np.int64], places: Array) -> Array:
        width, height = self._pyramid.sizes[level].T
        x, y = places[:, 0] * width - 0.5, places[:, 1] * height - 0.5
        if self._texture.is_nearest:
            x, y = (np.where(level == 0, np.round(each), each) for each in (x, y))
        left, top = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
        across, under = x - left, y - top
        side, end = self._texture.wrap
        start = self._pyramid.starts[level]
        result = np.zeros((len(places), 4))
        for row, row_weight in ((top, 1 - under), (top + 1, under)):
            first = start + _wrapped(row, height, end) * width
            for column, weight in ((left, 1 - across), (left + 1, across)):
                found = self._pyramid.pixels[first + _wrapped(column, width, side)]
                result += (row_weight * weight)[:, None] * found
        return result


def _ellipse(moves: Array) -> tuple[Array, Array, Array]:
    """Return the singular values of matrices (n, 2, 2), and the angle of the first one's vector.

    They are the axes of the ellipse that a circle becomes.
    """
    (a, b), (c, d) = np.moveaxis(moves, 0, -1)
    xx, yy, xy = a * a + b * b, c * c + d * d, a * c + b * d
    long = np.sqrt((xx + yy) / 2 + np.hypot((xx - yy) / 2, xy))
    short = np.abs(a * d - b * c) / np.where(long > 0, long, 1)
    return long, short, np.arctan2(2 * xy, xx - yy) / 2


class Shelf:
    """Textures that are open, each picture once, and so many pixels of them.

    `otherwise` is what else users may do about what cannot be read, for messages.
    """

    def __init__(self, otherwise: str = "leave its materials out by `plain`") -> None:
        self.otherwise = otherwise
        self._known: dict[tuple[Path | bytes | str, bool], Pyramid] = {}
        self._left = MOST_PIXELS

    def open(self, name: str, texture: Texture) -> MipMap:
        """Read a texture. `name` is the mesh's file, for messages."""
        key = texture.picture, texture.is_srgb
        try:
            if key not in self._known:
                self._known[key] = self._read(*key)
        except ValueError as error:
            raise MeshError(f"{name}: {error}; or {self.otherwise}") from None
        return MipMap(self._known[key], texture)

    def _read(self, picture: Path | bytes | str, is_srgb: bool) -> Pyramid:
        if isinstance(picture, str):
            raise ValueError(picture)
        pixels = read_texture(picture, is_srgb)
        self._left -= pixels.shape[0] * pixels.shape[1]
        if self._left < 0:
            raise ValueError(f"its textures have more than {MOST_PIXELS:,} pixels; scale them down")
        return pyramid_of(pixels)


def pyramid_of(pixels: ArrayLike) -> Pyramid:
    """Return an image and its means in halving sizes, down to one pixel.

    Sizes are rounded down; pixels then count by how much of them lies within the larger one.

    `pixels` are of shape (H, W, 4).
    """
    level = np.asarray(pixels, dtype=np.float32)
    levels = [level]
    while max(level.shape[:2]) > 1:
        level = _halved(_halved(level).swapaxes(0, 1)).swapaxes(0, 1)
        levels.append(level)
    sizes = np.array([each.shape[1::-1] for each in levels])
    flat = [np.clip(each, -_LARGEST, _LARGEST).reshape(-1, 4) for each in levels]
    return Pyramid(np.concatenate(flat, dtype=np.float16, casting="same_kind"), sizes)


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


def _wrapped(index: NDArray[np.int64], count: NDArray[np.int64], wrap: Wrap) -> NDArray[np.int64]:
    if wrap == "clamp":
        return np.clip(index, 0, count - 1)
    if wrap == "repeat":
        return index % count
    folded = index % (2 * count)
    return np.minimum(folded, 2 * count - 1 - folded)
