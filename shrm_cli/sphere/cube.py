"""Cube maps: faces, orientations, directions and solid angles.

A cube image stacks six N x N faces, shape (6N, N), in the order of `FACES`. Seen from inside,
in OpenEXR's orientation (ImfEnvmap.h), right and down of each face are::

    +X  +Z -Y      -X  -Z -Y      +Y  +X -Z      -Y  +X +Z      +Z  -X -Y      -Z  +X -Y
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.sphere.grids import nodes
from shrm_cli.vocabulary import Orientation, Sampling

Array = NDArray[np.floating]

FACES = ("+X", "-X", "+Y", "-Y", "+Z", "-Z")

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


def cube_coordinates(directions: ArrayLike) -> tuple[NDArray[np.intp], Array, Array]:
    """Face and position on it of directions.

    Parameters
    ----------
    directions : array_like, shape (..., 3)
        Of any non-zero length.

    Returns
    -------
    face : ndarray of int, shape (...)
        Index into `FACES`.
    s, t : ndarray, shape (...)
        Position to the right and down, in [-1, 1].
    """
    directions = np.asarray(directions)
    axis = np.argmax(np.abs(directions), axis=-1)
    major = np.take_along_axis(directions, axis[..., None], axis=-1)[..., 0]
    face = 2 * axis + (major < 0)
    right, down, _ = np.moveaxis(face_axes(), 1, 0)
    scale = 1 / np.abs(major)
    s = np.sum(directions * right[face], axis=-1) * scale
    t = np.sum(directions * down[face], axis=-1) * scale
    return face, s, t


def cube_solid_angles(size: int, sampling: Sampling = "center") -> Array:
    """Solid angle of the cell around each texel of one face, shape (size, size).

    Border-sampled texels own the cell that reaches half way to their neighbours, cut at the
    face's edge. The six faces sum to 4 pi.
    """
    s = nodes(size, sampling)
    edges = np.concatenate([[-1.0], (s[1:] + s[:-1]) / 2, [1.0]])
    x, y = edges[None, :], edges[:, None]
    corner = np.arctan2(x * y, np.sqrt(x**2 + y**2 + 1))
    return corner[1:, 1:] - corner[:-1, 1:] - corner[1:, :-1] + corner[:-1, :-1]


def reorient(faces: ArrayLike, orientation: Orientation) -> Array:
    """Faces of another orientation as OpenEXR faces, by exact index permutation.

    Parameters
    ----------
    faces : array_like, shape (6, N, N, ...)
        In the order of `FACES`.
    orientation : {"openexr", "gl"}
        The orientation that they are in.
    """
    faces = np.asarray(faces)
    result = np.empty_like(faces)
    for face, (source, target) in enumerate(zip(face_axes(orientation), face_axes(), strict=True)):
        # Right and down are the same axes in both orientations, of the same or opposite sign.
        horizontal, vertical = (int(source[k] @ target[k]) for k in (0, 1))
        result[face] = faces[face, ::vertical, ::horizontal]
    return result
