"""Central directions: what a map of a BRDF is looked up with (section 5.3.1)."""

import numpy as np
from numpy.typing import NDArray

from shrm_cli.sphere.directions import horizontal_tangents, reflect
from shrm_cli.vocabulary import Center

Array = NDArray[np.floating]


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
