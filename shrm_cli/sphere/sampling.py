"""Looking up images on the sphere at arbitrary directions, without seams."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.arrays import Array
from shrm_cli.sphere.cube import cube_coordinates, face_axes
from shrm_cli.vocabulary import Sampling

_RIM = 2
"""Texels of the faces beside it that are put around each face: as far as a cubic filter reaches."""
_VALUES_AT_ONCE = 2**17
"""Values that are interpolated at a time, so that they stay in a processor's cache."""


class CubeSampler:
    """Cubic filtering of a cube map that takes in the neighboring faces.

    Each face is surrounded by a rim of texels at the places where its own grid would go on.
    Their values are interpolated on the faces that lie there, so the filter never meets an edge.

    Parameters
    ----------
    image : array_like, shape (6 N, N, channels)
        Faces in OpenEXR's order and orientation.
    sampling : {"center", "border"}
    """

    def __init__(self, image: ArrayLike, sampling: Sampling = "center") -> None:
        image = np.asarray(image)
        image = image.astype(np.result_type(image, np.float32), copy=False)
        self.size = size = image.shape[1]
        self.sampling = sampling if size > 1 else "center"
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
        channels = self._padded.shape[-1]
        result: Array = np.empty((face.size, channels), dtype=self._padded.dtype)
        step = max(_VALUES_AT_ONCE // channels, 1)
        for start in range(0, face.size, step):
            part = slice(start, start + step)
            result[part] = self._between(
                face.reshape(-1)[part], s.reshape(-1)[part], t.reshape(-1)[part]
            )
        return result.reshape(*face.shape, channels)

    def _between(self, face: NDArray[np.intp], s: Array, t: Array) -> Array:
        """Values at positions (s, t) on faces, each of shape (n,): (n, channels)."""
        columns, across = catmull_rom(self._index(s))
        rows, along = catmull_rom(self._index(t))
        result: Array = np.zeros((len(face), self._padded.shape[-1]), dtype=self._padded.dtype)
        for i in range(4):
            line = np.zeros_like(result)
            for j in range(4):
                texel = self._padded[face, rows + i + _RIM, columns + j + _RIM]
                line += across[j][..., None] * texel
            result += along[i][..., None] * line
        return result

    def _position(self, index: NDArray[np.intp]) -> Array:
        """Positions of texels on the face, [-1, 1]; indices outside the face give others."""
        scale, shift = _scale(self.size, self.sampling)
        return np.asarray((index + shift) / scale - 1)

    def _index(self, position: Array) -> Array:
        return _index(position, self.size, self.sampling)

    def _on_faces(self, faces: Array, directions: Array) -> Array:
        """Values at directions, shape (n, 3), each interpolated within the face that it meets."""
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


def nearest_texels(
    directions: ArrayLike, size: int, sampling: Sampling
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Find the texels of a cube that lie nearest to directions.

    Parameters
    ----------
    directions : array_like, shape (..., 3)
        They may have any length but 0.
    size : int
        Texels along a face's edge.
    sampling : {"center", "border"}

    Returns
    -------
    rows, columns : ndarray of int, shape (...)
        Indices into an image of 6 size rows and size columns.
    """
    face, s, t = cube_coordinates(directions)
    sampling = sampling if size > 1 else "center"
    row, column = (
        np.clip(np.rint(_index(position, size, sampling)), 0, size - 1).astype(np.intp)
        for position in (t, s)
    )
    return face * size + row, column


def _scale(size: int, sampling: Sampling) -> tuple[float, float]:
    """Texels for each unit of position, and how many texels position -1 lies before texel 0."""
    return ((size - 1) / 2, 0.0) if sampling == "border" else (size / 2, 0.5)


def _index(position: Array, size: int, sampling: Sampling) -> Array:
    """Texel indices, not rounded, of positions in [-1, 1]."""
    scale, shift = _scale(size, sampling)
    return np.asarray((position + 1) * scale - shift)


def catmull_rom(x: Array) -> tuple[NDArray[np.intp], list[Array]]:
    """The first of four texels and Catmull and Rom's cubic weights of all four, at x, in texels."""
    first = np.floor(x).astype(np.intp) - 1
    f = x - (first + 1)
    return first, [
        f * (-0.5 + f * (1 - 0.5 * f)),
        1 + f * f * (-2.5 + 1.5 * f),
        f * (0.5 + f * (2 - 1.5 * f)),
        f * f * (-0.5 + 0.5 * f),
    ]


def _lagrange(x: Array, count: int, size: int) -> tuple[NDArray[np.intp], list[Array]]:
    """The first of `count` texels of a face, and their weights in the polynomial through them."""
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


class LatLongSampler:
    """Bilinear filtering of a lat-long.

    It wraps around in longitude, and goes on beyond a pole half a turn away.

    Parameters
    ----------
    image : array_like, shape (H, W, channels)
    sampling : {"center", "border"}
    """

    def __init__(self, image: ArrayLike, sampling: Sampling) -> None:
        self._image = np.asarray(image)
        self._sampling = sampling

    def __call__(self, directions: ArrayLike) -> Array:
        """Values at directions of any length, shape (..., 3): (..., channels)."""
        from shrm_cli.sphere.latlong import latlong_coordinates

        image = self._image
        height, width = image.shape[:2]
        across, down = latlong_coordinates(directions)
        x, y = _index(across, width, self._sampling), _index(down, height, self._sampling)
        column, row = np.floor(x).astype(np.intp), np.floor(y).astype(np.intp)
        fx, fy = (x - column)[..., None], (y - row)[..., None]
        result: Array = np.zeros((), dtype=image.dtype)
        for i, wy in ((row, 1 - fy), (row + 1, fy)):
            turned = np.where((i < 0) | (i >= height), width // 2, 0)
            i = np.minimum(np.maximum(i, -1 - i), height - 1)  # -1 is row 0, height the last
            for j, wx in ((column, 1 - fx), (column + 1, fx)):
                result = result + wy * wx * image[i, (j + turned) % width]
        return result


def sample_latlong_cubic(image: ArrayLike, directions: ArrayLike) -> Array:
    """Cubically filtered values of a center-sampled lat-long.

    The filter is more exact than that of `LatLongSampler` for smooth images, but overshoots beside
    bright pixels.

    Parameters
    ----------
    image : array_like, shape (H, W, channels)
    directions : array_like, shape (..., 3)
        They may have any length but 0.

    Returns
    -------
    ndarray, shape (..., channels)
    """
    from shrm_cli.sphere.latlong import latlong_coordinates

    image = np.asarray(image)
    height, width = image.shape[:2]
    across, down = latlong_coordinates(directions)
    columns, along = catmull_rom(_index(across, width, "center"))
    rows, below = catmull_rom(_index(down, height, "center"))
    result: Array = np.zeros((*across.shape, image.shape[2]), dtype=image.dtype)
    for i in range(4):
        row = rows + i
        turned = np.where((row < 0) | (row >= height), width // 2, 0)
        row = np.where(row < 0, -1 - row, np.minimum(row, 2 * height - 1 - row))
        line = np.zeros_like(result)
        for j in range(4):
            line += along[j][..., None] * image[row, (columns + j + turned) % width]
        result += below[i][..., None] * line
    return result


class AngularSampler:
    """Bilinear filtering of an angular map, which goes on beyond its rim on the other side.

    What the image holds outside its rim does not count.

    Parameters
    ----------
    image : array_like, shape (N, N, channels)
    sampling : {"center", "border"}
    """

    def __init__(self, image: ArrayLike, sampling: Sampling) -> None:
        self._image = np.asarray(image)
        self._sampling = sampling
        self._padded = _beyond_rim(self._image, sampling) if len(self._image) > 1 else self._image

    def __call__(self, directions: ArrayLike) -> Array:
        """Values at directions of any length, shape (..., 3): (..., channels)."""
        from shrm_cli.sphere.angular import angular_coordinates

        across, down = angular_coordinates(directions)
        if len(self._image) == 1:
            return np.broadcast_to(self._image[0, 0], (*across.shape, self._image.shape[2]))
        return _bilinear(self._padded, across, down, self._sampling)


def _bilinear(padded: Array, across: Array, down: Array, sampling: Sampling) -> Array:
    """Values at positions in [-1, 1] of a square image with one more texel on every side."""
    size = len(padded) - 2
    x, y = _index(across, size, sampling) + 1, _index(down, size, sampling) + 1
    column = np.clip(np.floor(x).astype(np.intp), 0, size)
    row = np.clip(np.floor(y).astype(np.intp), 0, size)
    fx, fy = (x - column)[..., None], (y - row)[..., None]
    top = (1 - fx) * padded[row, column] + fx * padded[row, column + 1]
    bottom = (1 - fx) * padded[row + 1, column] + fx * padded[row + 1, column + 1]
    return np.asarray((1 - fy) * top + fy * bottom)


def _beyond_rim(image: Array, sampling: Sampling) -> Array:
    """An angular map that goes on beyond its rim, with one more texel on every side.

    The way through -Z leads to the other side of the image: from radius r > 1 to radius 2 - r,
    half a turn away. A bilinear filter can trust texels up to a distance from the rim; beyond it
    values are interpolated between the last ones of this side and those of the other side.
    """
    size = len(image)
    padded = np.pad(image, ((1, 1), (1, 1), (0, 0)), mode="edge")
    scale, shift = _scale(size, sampling)
    s = (np.arange(-1, size + 1) + shift) / scale - 1
    radius = np.hypot(s[:, None], s)
    reach = 1.5 / scale  # a bilinear filter reaches less than a texel's diagonal
    rows, columns = np.nonzero((radius > 1) & (radius < 1 + reach))
    r = radius[rows, columns]
    x, y = s[columns] / r * (1 - reach), s[rows] / r * (1 - reach)
    far = ((r - 1 + reach) / (2 * reach))[:, None]
    here, there = _bilinear(padded, x, y, sampling), _bilinear(padded, -x, -y, sampling)
    padded[rows, columns] = (1 - far) * here + far * there
    return padded
