"""Central directions: what a map of a BRDF is looked up with.

References
----------
Ramamoorthi 2002, "A Signal-Processing Framework for Forward and Inverse Rendering", section 5.3.1.
"""

from shrm_cli.arrays import Array
from shrm_cli.sphere.directions import horizontal_tangents, reflect
from shrm_cli.vocabulary import Center


def central_directions(center: Center, normals: Array, views: Array) -> Array:
    """Compute the central directions C of points of a surface.

    Parameters
    ----------
    center : {"reflection", "normal", "tangent"}
        The mirror direction of the view, the normal, or the tangent. A surface that is known by
        its normals alone has the horizontal tangent.
    normals, views : ndarray, shape (..., 3), broadcastable
        Unit vectors in world axes.

    Returns
    -------
    ndarray, shape (..., 3)
        Unit vectors in world axes.
    """
    if center == "reflection":
        return reflect(views, normals)
    return normals if center == "normal" else horizontal_tangents(normals)
