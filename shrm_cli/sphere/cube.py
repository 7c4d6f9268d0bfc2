"""Geometry of cube maps: faces, orientations, directions and solid angles.

A cube image stacks six N x N faces, shape (6N, N), in the order of `FACES`. Seen from inside,
in OpenEXR's orientation (ImfEnvmap.h), right and down of each face are::

    +X  +Z -Y      -X  -Z -Y      +Y  +X -Z      -Y  +X +Z      +Z  -X -Y      -Z  +X -Y
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.arrays import Array
from shrm_cli.layouts import FACES
from shrm_cli.sphere.quadrature import cell_edges, nodes
from shrm_cli.vocabulary import Orientation, Sampling

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
    points = forward + right * s[columns][..., None] + down * s[rows % size][..., None]
    return np.asarray(points / np.linalg.norm(points, axis=-1, keepdims=True))


def cube_coordinates(directions: ArrayLike) -> tuple[NDArray[np.intp], Array, Array]:
    """The face that each direction meets, and where on it.

    Parameters
    ----------
    directions : array_like, shape (..., 3)
        They may have any length but 0.

    Returns
    -------
    face : ndarray of int, shape (...)
        Index into `FACES`.
    s, t : ndarray, shape (...)
        Position on the face to the right and down, in [-1, 1].
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


def reorient(faces: ArrayLike, orientation: Orientation) -> Array:
    """Faces of another orientation as OpenEXR faces, by exact index permutation.

    Parameters
    ----------
    faces : array_like, shape (6, N, N, ...)
        Faces in the order of `FACES`.
    orientation : {"openexr", "gl"}
        The orientation that they are in.

    Returns
    -------
    ndarray, of the same shape
    """
    faces = np.asarray(faces)
    result = np.empty_like(faces)
    for face, image in enumerate(faces):
        result[face] = reoriented(image, face, orientation)
    return result


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
    """The square image of a face as it is seen along other axes, by exact index permutation.

    Parameters
    ----------
    image : ndarray, shape (N, N, ...)
    axes : ndarray, shape (>= 2, 3)
        The new right and down, first of all, which are axes of the face or minus those.
    face : int
        Index into `FACES` of the face that the image is in OpenEXR's orientation.

    Returns
    -------
    ndarray, of the same shape
    """
    (along, turned_along), (turned_down, down) = np.rint(axes[:2] @ face_axes()[face, :2].T)
    if along:
        return image[:: int(down), :: int(along)]
    return image.swapaxes(0, 1)[:: int(turned_down), :: int(turned_along)]
