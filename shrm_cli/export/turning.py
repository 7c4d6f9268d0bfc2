"""From our cubes to those that an engine looks up.

An engine looks up its cube at ``T d``, where d is the direction in world axes, and T is its own
habit: it exchanges or mirrors axes. The graphics interface then finds face and texel as OpenGL
defines it, faces +X -X +Y -Y +Z -Z, the first row on top. What is written is a permutation of
texels, so that nothing is lost.
"""

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array
from shrm_cli.layouts import FACES
from shrm_cli.sphere.cube import face_axes, turned_face


def mirrored(*signs: int) -> Array:
    """Return the matrix T that multiplies x, y and z by signs: shape (3, 3)."""
    return np.diag(np.array(signs, dtype=float))


WORLD = mirrored(1, 1, 1)
"""Lookups at the world direction itself."""


def to_lookup(cube: Array, lookup: ArrayLike = WORLD) -> Array:
    """Return the faces that an engine must have so that it finds the light of a cube.

    Parameters
    ----------
    cube : ndarray, shape (6N, N, ...)
        An OpenEXR cube in world axes, sampled at texel centers.
    lookup : array_like, shape (3, 3)
        The matrix T of the engine, a permutation of the axes with signs.

    Returns
    -------
    ndarray, shape (6, N, N, ...)
        Faces in OpenGL's order and orientation, whose texel at the lookup direction c holds the
        light from ``T^-1 c``.
    """
    back = np.asarray(lookup, dtype=float).T  # the inverse of a signed permutation
    images = cube.reshape(6, -1, *cube.shape[1:])
    result = np.empty_like(images)
    for face, axes in enumerate(face_axes("gl")):
        # The right, down and forward axes of the engine's face, seen from our world.
        turned = axes @ back.T
        source = _face_along(turned[2])
        result[face] = turned_face(images[source], turned, source)
    return result


def _face_along(direction: Array) -> int:
    """Return the index into `FACES` of the face whose middle lies in a direction."""
    axis = int(np.argmax(np.abs(direction)))
    return FACES.index(("+" if direction[axis] > 0 else "-") + "XYZ"[axis])
