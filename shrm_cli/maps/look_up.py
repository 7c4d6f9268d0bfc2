"""What bilinear look-ups in the cubes of a map cost, found from the cubes alone."""

import numpy as np
from numpy.typing import NDArray

from shrm_cli.sphere.bilinear import bilinear_errors, detail_places
from shrm_cli.sphere.grid.cube import Cube
from shrm_cli.sphere.harmonics import degrees
from shrm_cli.vocabulary import Sampling

Array = NDArray[np.floating]

_ORDERS_A_TEXEL = 2
"""Texels show no more degrees than this many for each of them along an edge."""
_PLACES_ORDER = 16
"""The largest degree that tells where on the faces the details lie."""


def look_up_error(cube: Array, sampling: Sampling, order: int) -> float:
    """Predict the relative RMS error of looking a cube up by bilinear filtering.

    `shrm_cli.reflected.filtering_error` predicts it from light and BRDF before a map is made; this
    is for maps that have neither any more. Each degree that the texels show loses what
    `bilinear_errors` says.

    Parameters
    ----------
    cube : ndarray, shape (6N, N, channels)
        Functions over the sphere, that count by their energy.
    sampling : {"center", "border"}
        Where the edge texels lie.
    order : int
        The largest degree of the functions; what is beyond is the rounding of files.

    Returns
    -------
    float
        The error against what the texels show; 0 for a black cube.
    """
    size = cube.shape[1]
    order = min(order, _ORDERS_A_TEXEL * size)
    grid = Cube(size, sampling)
    analysis = grid.analysis(order)
    analysis.add(0, cube, grid.weights())
    coefficients = analysis.coefficients()
    degree = degrees(order)
    energy = np.bincount(degree, weights=np.sum(coefficients**2, axis=1))
    if not energy.any():
        return 0.0
    places = detail_places(coefficients[degree <= _PLACES_ORDER])
    errors = bilinear_errors(order, size, sampling, places)
    return float(np.sqrt(errors @ energy / energy.sum()))
