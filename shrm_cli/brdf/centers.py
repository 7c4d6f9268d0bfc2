"""Central directions: what a map of a BRDF is looked up with (section 5.3.1)."""

import numpy as np
from numpy.typing import NDArray

from shrm_cli.brdf.base import Center
from shrm_cli.sphere.directions import horizontal_tangents, normalize, reflect

Array = NDArray[np.floating]

_GRAZING = 1e-6


def central_directions(center: Center, normals: Array, views: Array) -> Array:
    """Central directions C of points of a surface.

    Parameters
    ----------
    center : {"reflection", "normal", "tangent"}
        The mirror direction of the view, the normal, or the tangent, which on a surface known by
        its normals alone is the horizontal one.
    normals, views : ndarray, shape (..., 3), broadcastable
        Unit, world axes.

    Returns
    -------
    ndarray, shape (..., 3)
    """
    if center == "reflection":
        return reflect(views, normals)
    return normals if center == "normal" else horizontal_tangents(normals)


def normals_between(reflections: Array, views: Array) -> Array:
    """Normals, shape (..., 3), that mirror views into reflections (..., 3)."""
    reflections, views = np.broadcast_arrays(reflections, views)
    total = reflections + views
    # Where R = -V every direction at a right angle is a normal: take one.
    grazing = np.linalg.norm(total, axis=-1) < _GRAZING
    axes = np.eye(3)[np.argmin(np.abs(views[grazing]), axis=-1)]
    total[grazing] = np.cross(views[grazing], axes)
    return normalize(total)
