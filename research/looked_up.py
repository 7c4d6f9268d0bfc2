"""What a GPU shows of a map: bilinear look-ups in cubes of half-precision floats."""

import numpy as np
from numpy.typing import NDArray

from research.bilinear import look_up
from shrm_cli.maps.base import Map
from shrm_cli.maps.principal.principal import PrincipalMap
from shrm_cli.maps.shrm.shrm import Shrm
from shrm_cli.sphere.directions import central_directions
from shrm_cli.sphere.harmonics import real_harmonics

Array = NDArray[np.floating]


def looked_up(made: Map, normals: Array, views: Array) -> Array:
    """Evaluate a global SHRM or a principal map as a shader does, shape (n, 3).

    Parameters
    ----------
    made : Shrm or PrincipalMap
    normals, views : ndarray, shape (n, 3)
        Unit vectors in world axes.

    Raises
    ------
    TypeError
        If it is another map.
    """
    planes = [_in_half(plane) for plane in made.planes()]
    if isinstance(made, PrincipalMap):
        result = np.zeros(normals.shape)
        for lobe, plane in zip(made.lobes, planes, strict=True):
            centers = central_directions(lobe.center, normals, views)
            # A lobe takes anything that returns the values of its cubes at directions.
            result += lobe.radiance(
                lambda at, own=plane: look_up(own, at, made.sampling), centers, views
            )
        return result
    if not isinstance(made, Shrm) or made.frame != "global":
        raise TypeError(f"{type(made).__name__} is neither a global SHRM nor a principal map")
    centers = central_directions(made.center, normals, views)
    values = look_up(planes[0], centers, made.sampling).reshape(len(normals), -1, 3)
    return np.einsum("nk,nkc->nc", real_harmonics(made.order_p, views), values)


def _in_half(plane: Array) -> Array:
    """Round to half precision, as files do where no value exceeds its range."""
    with np.errstate(over="ignore"):
        half = plane.astype(np.float16)
    return half if np.isfinite(half).all() else plane
