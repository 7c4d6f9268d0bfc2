"""The environment BRDF of brushed GGX, by the table of even GGX.

A brushed surface reflects of a uniform environment what an even one of another alpha reflects. That
alpha depends on how the view lies to the brush marks, and it is not the same for all of the light
and for the part that Schlick's term adds. For a view (x, y, z) in the frame of the surface it is

    alpha^2 = (ax^2 + ay^2) / 2 + (c + d z) (x^2 - y^2) (ax^2 - ay^2) / 2,

with the c and d that `research.taps` fits by least squares to the integrals themselves.
"""

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array

TURNS = {"total": (-1.06, 1.354), "bias": (0.964, 0.286)}
"""The numbers c and d, for ``scale + bias`` and for the bias."""


def equal_roughness(part: str, alphas: tuple[float, float], views: ArrayLike) -> Array:
    """Return the perceptual roughness of the even surface that reflects as much.

    Parameters
    ----------
    part : {"total", "bias"}
        Which integral is to be the same.
    alphas : tuple of 2 float
        Along x and y.
    views : array_like, shape (..., 3)
        Unit vectors in the frame of the surface.

    Returns
    -------
    ndarray, shape (...)
    """
    x, y, z = np.moveaxis(np.asarray(views, dtype=float), -1, 0)
    (c, d), (ax2, ay2) = TURNS[part], (alpha**2 for alpha in alphas)
    square = (ax2 + ay2 + (c + d * z) * (x * x - y * y) * (ax2 - ay2)) / 2
    return np.asarray(np.clip(square, 0, 1) ** 0.25)
