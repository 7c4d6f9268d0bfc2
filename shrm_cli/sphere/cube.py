"""Cube maps: faces, orientations, directions and solid angles, and looking images up without seams.

A cube image stacks six N x N faces, shape (6N, N), in the order of `FACES`. Seen from inside,
in OpenEXR's orientation (ImfEnvmap.h), right and down of each face are::

    +X  +Z -Y      -X  -Z -Y      +Y  +X -Z      -Y  +X +Z      +Z  -X -Y      -Z  +X -Y
"""

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.arrays import Array, Memo, relative_rms, slices
from shrm_cli.sphere.directions import normalize
from shrm_cli.sphere.quadrature import cell_edges, nodes
from shrm_cli.vocabulary import FACES, Orientation, Sampling

_ROUNDING = 1e-9
_ROWS_AT_ONCE = 256
"""The rows of a face whose solid angles are computed at a time, with arrays beside them."""

_RIGHT_DOWN: dict[str, str] = {
    "openexr": "+Z-Y -Z-Y +X-Z +X+Z -X-Y +X-Y",
    "gl": "-Z-Y +Z-Y +X+Z +X-Z +X-Y -X-Y",
}


def _axis(name: str) -> Array:
    vector = np.zeros(3)
    vector["XYZ".index(name[1])] = 1.0 if name[0] == "+" else -1.0
    return vector


def face_axes(orientation: Orientation = "openexr") -> Array:
    """Right, down and forward (outward) axes of each face, shape (6, 3, 3)."""
    pairs = _RIGHT_DOWN[orientation].split()
    return np.array(
        [
            [_axis(pair[:2]), _axis(pair[2:]), _axis(face)]
            for face, pair in zip(FACES, pairs, strict=True)
        ]
    )


def cube_directions(size: int, sampling: Sampling = "center") -> Array:
    """Unit directions of the texels of an OpenEXR-oriented cube, shape (6 size, size, 3)."""
    s = nodes(size, sampling)
    right, down, forward = np.moveaxis(face_axes(), 1, 0)[..., None, None, :]
    points = forward + right * s[None, :, None] + down * s[:, None, None]
    points /= np.linalg.norm(points, axis=-1, keepdims=True)
    return points.reshape(6 * size, size, 3)


def texel_directions(
    rows: NDArray[np.intp], columns: NDArray[np.intp], size: int, sampling: Sampling = "center"
) -> Array:
    """Unit directions of some of these texels, given by their rows and columns, shape (..., 3)."""
    s = nodes(size, sampling)
    right, down, forward = np.moveaxis(face_axes(), 1, 0)[:, rows // size]
    return normalize(forward + right * s[columns][..., None] + down * s[rows % size][..., None])


def cube_coordinates(directions: ArrayLike) -> tuple[NDArray[np.intp], Array, Array]:
    """The face that each direction meets, and where on it.

    `directions`, of shape (..., 3), may have any length but 0.

    Returns `face` of shape (...), index into `FACES`; and `s`, `t` of shape (...), position on the
    face to the right and down, in [-1, 1].
    """
    # Component by component: numpy's functions take several times as long along an axis of three.
    x, y, z = np.moveaxis(np.asarray(directions), -1, 0)
    sizes = np.abs(x), np.abs(y), np.abs(z)
    axis = np.where(sizes[1] >= sizes[2], 1, 2)
    axis = np.where(sizes[0] >= np.maximum(sizes[1], sizes[2]), 0, axis)
    major = np.choose(axis, (x, y, z))
    face = 2 * axis + (major < 0)
    right, down, _ = np.moveaxis(face_axes(), 1, 0)
    scale = 1 / np.abs(major)
    s, t = (
        (x * each[face, 0] + y * each[face, 1] + z * each[face, 2]) * scale
        for each in (right, down)
    )
    return face, s, t


def cube_solid_angles(size: int, sampling: Sampling = "center") -> Array:
    """Solid angle of the cell around each texel of one face, shape (size, size).

    Border-sampled texels own the cell that reaches half way to the texels beside them, cut at the
    face's edge. The six faces sum to 4 pi.
    """
    edges = cell_edges(size, sampling)
    result: Array = np.empty((size, size))
    for start in range(0, size, _ROWS_AT_ONCE):
        x, y = edges[None, :], edges[start : start + _ROWS_AT_ONCE + 1, None]
        corner = np.sqrt(x**2 + y**2 + 1)
        np.arctan2(x * y, corner, out=corner)
        result[start : start + _ROWS_AT_ONCE] = np.diff(np.diff(corner, axis=0), axis=1)
    return result


def texel_solid_angles(size: int, sampling: Sampling = "center") -> Array:
    """The solid angles of the texels of all six faces, shape (6 size, size)."""
    return np.tile(cube_solid_angles(size, sampling), (6, 1))


def reoriented(image: Array, face: int, orientation: Orientation) -> Array:
    """One face of another orientation as an OpenEXR face: a view of the image, (N, N, ...)."""
    source, target = face_axes(orientation)[face], face_axes()[face]
    # Right and down are the same axes in both orientations, of the same or opposite sign.
    horizontal, vertical = (int(source[k] @ target[k]) for k in (0, 1))
    return image[::vertical, ::horizontal]


def right_angles(matrix: Array) -> Array | None:
    """A matrix, shape (3, 3), that only exchanges or mirrors axes, freed of rounding; else None."""
    turned = np.rint(matrix)
    return turned if np.allclose(matrix, turned, rtol=0, atol=_ROUNDING) else None


def turned_face(image: Array, axes: Array, face: int) -> Array:
    """The image of a face as seen along other axes, by index permutation, of the same shape.

    `image` is of shape (N, N, ...). `axes`, of shape (>= 2, 3), are the new right and down, first
    of all, which are axes of the face or minus those. `face` is the index into `FACES` of the face
    that the image is in OpenEXR's orientation.
    """
    (along, turned_along), (turned_down, down) = np.rint(axes[:2] @ face_axes()[face, :2].T)
    if along:
        return image[:: int(down), :: int(along)]
    return image.swapaxes(0, 1)[:: int(turned_down), :: int(turned_along)]


_RIM = 2
"""Texels of the faces beside it that are put around each face: as far as a cubic filter reaches."""
_VALUES_AT_ONCE = 2**17
"""Values that are interpolated at a time, so that they stay in a processor's cache."""


_is_bilinear: ContextVar[bool] = ContextVar("_is_bilinear", default=False)
"""Whether cubes are looked up within `bilinear_filtering`."""


_known_rims = Memo(2**24)
"""What `_rim` returns. Faces of 64 texels take 0.8 MB."""


class CubeSampler:
    """Cubic filtering of a cube map that takes in the neighboring faces.

    Each face is surrounded by a rim of texels at the places where its own grid would go on.
    Their values are interpolated on the faces that lie there, so the filter never meets an edge.

    `image`, of shape (6 N, N, channels), holds faces in OpenEXR's order and orientation.
    """

    def __init__(self, image: ArrayLike, sampling: Sampling = "center") -> None:
        image = np.asarray(image)
        image = image.astype(np.result_type(image, np.float32), copy=False)
        self.size = size = image.shape[1]
        self.sampling = sampling if size > 1 else "center"
        faces = image.reshape(6, size, size, -1)
        wide = size + 2 * _RIM
        padded: Array = np.empty((6, wide, wide, faces.shape[-1]), dtype=image.dtype)
        padded[:, _RIM:-_RIM, _RIM:-_RIM] = faces
        self._texels = padded.reshape(-1, padded.shape[-1])
        places, *taps = _known_rims.get((size, self.sampling), lambda: _rim(size, self.sampling))
        inside, rim = image.reshape(-1, faces.shape[-1]), np.zeros((len(places), faces.shape[-1]))
        for texels, weights in zip(*taps, strict=True):
            rim += weights[:, None] * inside.take(texels, axis=0)
        self._texels[places] = rim

    def __call__(self, directions: ArrayLike) -> Array:
        """Values at directions of any length, shape (..., 3): (..., channels)."""
        face, s, t = cube_coordinates(directions)
        channels = self._texels.shape[1]
        result: Array = np.empty((face.size, channels), dtype=self._texels.dtype)
        for part in slices(face.size, _VALUES_AT_ONCE // channels):
            result[part] = self._between(
                face.reshape(-1)[part], s.reshape(-1)[part], t.reshape(-1)[part]
            )
        return result.reshape(*face.shape, channels)

    def _between(self, face: NDArray[np.intp], s: Array, t: Array) -> Array:
        """Values at positions (s, t) on faces, each of shape (n,): (n, channels)."""
        filtering = linear if _is_bilinear.get() else catmull_rom
        columns, across = filtering(self._index(s))
        rows, along = filtering(self._index(t))
        width = self.size + 2 * _RIM
        first = (face * width + rows + _RIM) * width + columns + _RIM
        result: Array = np.zeros((len(face), self._texels.shape[1]), dtype=self._texels.dtype)
        for i, down in enumerate(along):
            line = np.zeros_like(result)
            for j, right in enumerate(across):
                line += right[:, None] * self._texels.take(first + (i * width + j), axis=0)
            result += down[:, None] * line
        return result

    def _index(self, position: Array) -> Array:
        return texel_index(position, self.size, self.sampling)


def _rim(size: int, sampling: Sampling) -> tuple[NDArray[np.intp], NDArray[np.intp], Array]:
    """Return where the texels around the faces of a cube lie, and how faces give their values.

    Returns their places among the padded faces, shape (n,); the texels of the cube that give each
    of them its value, (k, n); and the weights of these, (k, n), in the polynomials through the
    texels of the face that lies there.
    """
    wide = np.arange(-_RIM, size + _RIM)
    is_rim = np.ones((len(wide), len(wide)), dtype=bool)
    is_rim[_RIM:-_RIM, _RIM:-_RIM] = False
    down, right = np.nonzero(is_rim)
    scale, shift = texel_scale(size, sampling)
    s, t = ((wide[each, None] + shift) / scale - 1 for each in (right, down))
    outside = [forward + s * across + t * along for across, along, forward in face_axes()]
    face, s, t = cube_coordinates(np.concatenate(outside))
    count = min(4, size)
    columns, across = _lagrange(texel_index(s, size, sampling), count, size)
    rows, along = _lagrange(texel_index(t, size, sampling), count, size)
    taps = list(np.ndindex(count, count))
    texels = np.stack([(face * size + rows + i) * size + columns + j for i, j in taps])
    weights = np.stack([along[i] * across[j] for i, j in taps])
    return np.flatnonzero(np.tile(is_rim.ravel(), 6)), texels, weights


def relative_change(before: Array, after: Array, old: Sampling, new: Sampling) -> float:
    """Return the relative RMS difference of two cubes of any sizes at the texels of the first."""
    size = before.shape[1]
    weights = texel_solid_angles(size, old)[..., None]
    again = CubeSampler(after, new)(cube_directions(size, old))
    missed = np.sum(weights * (again - before) ** 2)
    return relative_rms(missed, np.sum(weights * before.astype(float) ** 2))


def nearest_texels(
    directions: ArrayLike, size: int, sampling: Sampling
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Find the texels of a cube that lie nearest to directions.

    `directions`, of shape (..., 3), may have any length but 0.

    Returns `rows` and `columns`, each of shape (...), indices into an image of 6 size rows and size
    columns.
    """
    face, s, t = cube_coordinates(directions)
    sampling = sampling if size > 1 else "center"
    row, column = (
        np.clip(np.rint(texel_index(position, size, sampling)), 0, size - 1).astype(np.intp)
        for position in (t, s)
    )
    return face * size + row, column


def texel_scale(size: int, sampling: Sampling) -> tuple[float, float]:
    """Texels for each unit of position, and how many texels position -1 lies before texel 0."""
    return ((size - 1) / 2, 0.0) if sampling == "border" else (size / 2, 0.5)


def texel_index(position: Array, size: int, sampling: Sampling) -> Array:
    """Texel indices, not rounded, of positions in [-1, 1]."""
    scale, shift = texel_scale(size, sampling)
    return np.asarray((position + 1) * scale - shift)


@contextmanager
def bilinear_filtering() -> Iterator[None]:
    """Look cubes up bilinearly, as GPUs do, where it is cubically else."""
    token = _is_bilinear.set(True)
    try:
        yield
    finally:
        _is_bilinear.reset(token)


def linear(x: Array) -> tuple[NDArray[np.intp], list[Array]]:
    """The first of two texels and the weights of both, at x, in texels."""
    first = np.floor(x).astype(np.intp)
    return first, [first + 1 - x, x - first]


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
