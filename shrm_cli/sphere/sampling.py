"""Looking up images on the sphere at arbitrary directions, without seams."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.sphere.cube import cube_coordinates, face_axes
from shrm_cli.sphere.grids import Sampling, angular_coordinates, latlong_coordinates

Array = NDArray[np.floating]

_RIM = 2
"""Texels of the neighbouring faces around each face: what a cubic filter reaches."""


class CubeSampler:
    """Cubic filtering of a cube map that takes in the neighbouring faces.

    Each face is surrounded by a rim of texels at the places where its own grid would go on;
    their values are interpolated on the faces that lie there. So the filter never meets an edge.

    Parameters
    ----------
    image : array_like, shape (6 N, N, channels)
        OpenEXR face order and orientation.
    sampling : {"center", "border"}
    """

    def __init__(self, image: ArrayLike, sampling: Sampling = "center") -> None:
        image = np.asarray(image)
        self.sampling = sampling
        self.size = size = image.shape[1]
        faces = image.reshape(6, size, size, -1)
        wide = np.arange(-_RIM, size + _RIM)
        padded = np.empty((6, len(wide), len(wide), faces.shape[-1]), dtype=image.dtype)
        inner = slice(_RIM, -_RIM)
        padded[:, inner, inner] = faces
        rim = np.ones((len(wide), len(wide)), dtype=bool)
        rim[inner, inner] = False
        rows, columns = np.nonzero(rim)
        s, t = self._position(columns - _RIM), self._position(rows - _RIM)
        for face, (right, down, forward) in enumerate(face_axes()):
            outside = forward + s[:, None] * right + t[:, None] * down
            padded[face, rows, columns] = self._on_faces(faces, outside)
        self._padded = padded

    def __call__(self, directions: ArrayLike) -> Array:
        """Values at directions of any length, shape (..., 3): (..., channels)."""
        face, s, t = cube_coordinates(directions)
        columns, across = _cubic(self._index(s))
        rows, along = _cubic(self._index(t))
        result = np.zeros((*face.shape, self._padded.shape[-1]), dtype=self._padded.dtype)
        for i in range(4):
            line = np.zeros_like(result)
            for j in range(4):
                texel = self._padded[face, rows + i + _RIM, columns + j + _RIM]
                line += across[j][..., None] * texel
            result += along[i][..., None] * line
        return result

    def _position(self, index: Array) -> Array:
        """Position in [-1, 1] of texel indices, which may lie outside."""
        if self.sampling == "border":
            return 2 * index / max(self.size - 1, 1) - 1
        return (2 * index + 1) / self.size - 1

    def _index(self, position: Array) -> Array:
        if self.sampling == "border":
            return (position + 1) * ((self.size - 1) / 2)
        return (position + 1) * (self.size / 2) - 0.5

    def _on_faces(self, faces: Array, directions: Array) -> Array:
        """Values from the texels of one face alone, by its own cubic polynomial."""
        face, s, t = cube_coordinates(directions)
        count = min(4, self.size)
        columns, across = _lagrange(self._index(s), count, self.size)
        rows, along = _lagrange(self._index(t), count, self.size)
        result = np.zeros((len(directions), faces.shape[-1]))
        for i in range(count):
            for j in range(count):
                weight = along[i] * across[j]
                result += weight[:, None] * faces[face, rows + i, columns + j]
        return result


def _cubic(x: Array) -> tuple[NDArray[np.intp], list[Array]]:
    """First texel and the four Catmull-Rom weights at positions x, in texels."""
    first = np.floor(x).astype(np.intp) - 1
    f = x - (first + 1)
    return first, [
        f * (-0.5 + f * (1 - 0.5 * f)),
        1 + f * f * (-2.5 + 1.5 * f),
        f * (0.5 + f * (2 - 1.5 * f)),
        f * f * (-0.5 + 0.5 * f),
    ]


def _lagrange(x: Array, count: int, size: int) -> tuple[NDArray[np.intp], list[Array]]:
    """First of `count` texels inside the face, and the weights of the polynomial through them."""
    first = np.clip(np.floor(x).astype(np.intp) - (count - 1) // 2, 0, size - count)
    f = x - first
    weights = []
    for i in range(count):
        weight = np.ones_like(f)
        for j in range(count):
            if j != i:
                weight = weight * (f - j) / (i - j)
        weights.append(weight)
    return first, weights


def sample_latlong(image: ArrayLike, directions: ArrayLike, sampling: Sampling) -> Array:
    """Bilinear values of a lat-long, shape (H, W, channels), at directions (..., 3).

    It wraps around in longitude, and goes on beyond a pole half a turn away.
    """
    image = np.asarray(image)
    height, width = image.shape[:2]
    across, down = latlong_coordinates(directions)
    if sampling == "border":
        x, y = (across + 1) * ((width - 1) / 2), (down + 1) * ((height - 1) / 2)
        period = width - 1
    else:
        x, y = (across + 1) * (width / 2) - 0.5, (down + 1) * (height / 2) - 0.5
        period = width
    column, row = np.floor(x).astype(np.intp), np.floor(y).astype(np.intp)
    fx, fy = (x - column)[..., None], (y - row)[..., None]
    result: Array = np.zeros((), dtype=image.dtype)
    for i, wy in ((row, 1 - fy), (row + 1, fy)):
        beyond = (i < 0) | (i >= height)
        turned = np.where(beyond, period // 2, 0)
        inside = np.clip(np.where(i < 0, -1 - i, np.where(i >= height, 2 * height - 1 - i, i)), 0, height - 1)
        for j, wx in ((column, 1 - fx), (column + 1, fx)):
            result = result + wy * wx * image[inside, (j + turned) % period]
    return result


def sample_angular(image: ArrayLike, directions: ArrayLike, sampling: Sampling) -> Array:
    """Bilinear values of an angular map, shape (N, N, channels), at directions (..., 3)."""
    image = np.asarray(image)
    size = image.shape[0]
    across, down = angular_coordinates(directions)
    scale, shift = ((size - 1) / 2, 0.0) if sampling == "border" else (size / 2, 0.5)
    x, y = ((np.clip(c, -1, 1) + 1) * scale - shift for c in (across, down))
    column = np.clip(np.floor(x).astype(np.intp), 0, max(size - 2, 0))
    row = np.clip(np.floor(y).astype(np.intp), 0, max(size - 2, 0))
    fx, fy = (x - column)[..., None], (y - row)[..., None]
    right, below = np.minimum(column + 1, size - 1), np.minimum(row + 1, size - 1)
    top = (1 - fx) * image[row, column] + fx * image[row, right]
    bottom = (1 - fx) * image[below, column] + fx * image[below, right]
    return (1 - fy) * top + fy * bottom
