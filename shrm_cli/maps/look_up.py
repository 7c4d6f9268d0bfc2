"""What bilinear look-ups in the cubes of a map cost: predicted, or found from the cubes."""

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.brdf.coefficients import BrdfCoefficients
from shrm_cli.probe.lighting import Lighting
from shrm_cli.reflected import filtering_error
from shrm_cli.sphere.harmonics import degrees
from shrm_cli.vocabulary import Sampling

_ORDERS_A_TEXEL = 2
"""Texels show no more degrees than this many for each of them along an edge."""
_PLACES_ORDER = 16
"""The largest degree that tells where on the faces the details lie."""
_FEW_TEXELS = 16
"""The most texels along an edge of cubes that are looked through instead of predicted."""
_FEW_TEXELS_ALONE = 48
"""The same for maps of a single cube."""
_FEW_HARMONICS = 4
"""The largest P of SHRMs whose cubes are looked through."""


def shrm_look_up_error(
    lighting: Lighting,
    coefficients: BrdfCoefficients,
    factors: Array,
    order_p: int,
    size: int,
    sampling: Sampling = "center",
) -> float:
    """Return the relative RMS error of looking an SHRM up by bilinear filtering.

    Small cubes are looked through, because a prediction is up to a fifth off where they show a
    single lamp.

    Parameters
    ----------
    lighting, coefficients, order_p, size, sampling
        The same as for `shrm_cli.reflected.filtering_error`.
    factors : ndarray, shape (F+1, P+1)
        What the map multiplies each degree of the light and each one of the view with.

    Returns
    -------
    float
        The error of the map as it is made, without that of its orders; 0 for black light.
    """
    order_f = len(factors) - 1
    most = _FEW_TEXELS if order_p else _FEW_TEXELS_ALONE
    if size > most or order_p > _FEW_HARMONICS:
        return filtering_error(
            lighting, coefficients, order_f, order_p, size, sampling, factors=factors
        )
    from shrm_cli.maps.coupling import coupled, separated
    from shrm_cli.sphere.between_texels import lost_between_texels

    kept = coefficients.truncated(order_f, order_p) * factors[..., None, None]
    light = separated(lighting.coefficients[: (order_f + 1) ** 2], order_f)
    lost = whole = 0.0
    for p in range(order_p + 1):
        series = coupled(light, kept[:, p, : p + 1, None])
        series = series.reshape(len(series), -1)
        lost += float(lost_between_texels(series, size, sampling).sum())
        whole += float(np.sum(series**2))
    return float(np.sqrt(lost / whole)) if whole > 0 else 0.0


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
    from shrm_cli.sphere.bilinear import bilinear_errors, detail_places
    from shrm_cli.sphere.grid.cube import Cube

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
