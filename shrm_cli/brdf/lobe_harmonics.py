"""A BRDF's lobe for given views, as spherical harmonics about its central direction."""

from functools import lru_cache

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Brdf, scaled
from shrm_cli.brdf.polar_rule import PolarRule, azimuths, transfer_samples
from shrm_cli.sphere.harmonics import legendre_table
from shrm_cli.sphere.quadrature import colatitude_weights, nodes


def lobe_harmonics(
    brdf: Brdf, view_theta: Array, order: int, max_m: int, samples: tuple[int, int]
) -> Array:
    """Expand rho_hat over the direction to the light, for views at some angles from C.

    Parameters
    ----------
    brdf : Brdf
    view_theta : ndarray, shape (n,)
        The angles between C and the view, radians; the view lies in the plane of azimuth 0.
    order, max_m : int
        The largest l and m.
    samples : tuple of 2 int
        The number of Fejer's nodes in theta_i, and of nodes over half a turn of the azimuth.

    Returns
    -------
    ndarray, shape (max_m+1, order+1, n, 3)
        Coefficients of the real harmonics with m >= 0, indexed [m, l - m, view, channel]. Those
        with m < 0 vanish, because the lobe is even in the azimuth.
    """
    count, azimuth_count = samples
    by_m = np.zeros((count, len(view_theta), 3, max_m + 1))
    phi = azimuths(azimuth_count)
    waves = np.cos(np.outer(phi, np.arange(max_m + 1)))
    waves *= 2 * np.pi / azimuth_count
    waves[:, 1:] *= np.sqrt(2)
    everywhere = np.broadcast_to(phi, (len(view_theta), azimuth_count))
    for rows, values, coverage in transfer_samples(
        brdf, PolarRule(), count, view_theta, everywhere
    ):
        covered = values if coverage is None else scaled(values, coverage)
        for channel in range(3):
            by_m[rows, :, channel] = covered[..., channel] @ waves
    flat = by_m.reshape(count, -1, max_m + 1).transpose(2, 0, 1)
    return (_weighted_legendre(order, max_m, count) @ flat).reshape(
        max_m + 1, order + 1, len(view_theta), 3
    )


@lru_cache(1)
def _weighted_legendre(order: int, max_m: int, count: int) -> Array:
    """Normalized Legendre functions at Fejer's nodes, times the weights: [m, l - m, node]."""
    cosines = np.cos((nodes(count) + 1) * (np.pi / 2))
    return legendre_table(order, cosines, max_m) * colatitude_weights(count)
