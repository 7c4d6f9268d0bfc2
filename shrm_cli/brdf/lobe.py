"""The lobe of a BRDF about its central direction C: its width, and its mean over the azimuth.

Equations with a number 5.x are those of chapter 5 of Ramamoorthi's thesis, "A Signal-Processing
Framework for Forward and Inverse Rendering" (2002).
"""

import numpy as np

from shrm_cli.arrays import Array, slices
from shrm_cli.brdf.base import Brdf, scaled
from shrm_cli.brdf.vectors import interpolated
from shrm_cli.sphere.directions import from_angles, tilted_frame
from shrm_cli.sphere.quadrature import gauss_legendre

# Samples that find the width of a lobe: angles of the light (for any BRDF, and for a zonal one),
# angles of the view, and azimuths.
_ANGLES = 512
_ZONAL_ANGLES = 2**15
_VIEWS = 32
_AZIMUTHS = 32
# Samples of a lobe's mean over the azimuth.
_MEAN_ANGLES = 2048
_MEAN_AZIMUTHS = 96
_SAMPLES_AT_ONCE = 2**17
_NOTHING = 1e-30  # of the peak


def cuts_horizon(brdf: Brdf) -> bool:
    """Whether the BRDF reflects no light from below the surface (N.L < 0)."""
    return brdf.has_horizon or not brdf.includes_cosine


def lobe_angle(brdf: Brdf, tolerance: float) -> float:
    """Find the angle about C within which all but a fraction of the lobe lies (eq. 5.30).

    It solves ``int_0^angle u sin(theta_i) dtheta_i = (1 - tolerance) int_0^pi u sin(theta_i)
    dtheta_i`` where ``u(theta_i)`` is rho_hat, its channels added, integrated over all azimuths
    and all views (sin(theta_o) dtheta_o from 0 to pi).

    `tolerance` is the fraction that may lie outside, 0 .. 1.

    Returns radians, in 0 .. pi. For Phong's lobe ``cos(angle) = tolerance^(1 / (s + 1))``.
    """
    # A zonal lobe ends at 90 degrees, whether it jumps there or not.
    cells, end = (_ZONAL_ANGLES, np.pi / 2) if brdf.zonal else (_ANGLES, np.pi)
    # The cells' edges are squares of equal steps, because narrow lobes need narrow cells near C.
    edges = end * np.linspace(0, 1, cells + 1) ** 2
    middles = end * ((np.arange(cells) + 0.5) / cells) ** 2
    if brdf.zonal:
        lobe = _zonal_lobe(brdf, middles).sum(axis=-1)
    else:
        cosines, weights = gauss_legendre(_VIEWS)
        means = _azimuthal_means(brdf, middles, np.arccos(cosines), _AZIMUTHS)
        lobe = np.einsum("ioc,o->i", means, weights)
    # This is the difference of the cosines of the edges, without cancellation.
    rings = 2 * np.sin((edges[1:] + edges[:-1]) / 2) * np.sin(np.diff(edges) / 2)
    sums = np.concatenate([[0.0], np.cumsum(lobe * rings)])
    if sums[-1] == 0:
        return 0.0
    return float(np.interp((1 - tolerance) * sums[-1], sums, edges))


def _azimuthal_means(brdf: Brdf, theta_i: Array, theta_o: Array, azimuths: int) -> Array:
    """Average rho_hat over the azimuth about C between n angles of light and k of view: (n, k, 3).

    Where the BRDF has a horizon, the quadrature (Gauss and Legendre's) covers only the azimuths
    above it, so that the jump there costs no accuracy.
    """
    nodes, weights = gauss_legendre(azimuths)
    # The view lies in the plane of azimuth 0. About the mirror direction N is half way to the view.
    tilt = theta_o / 2 if brdf.center == "reflection" else np.zeros_like(theta_o)
    view = from_angles(theta_o - tilt, 0.0)[:, None, :]
    result = np.empty((len(theta_i), len(theta_o), 3))
    for rows in slices(len(theta_i), _SAMPLES_AT_ONCE // (len(theta_o) * azimuths)):
        polar = theta_i[rows, None]
        above = np.full((len(polar), len(theta_o)), np.pi)
        if cuts_horizon(brdf):
            # On the horizon N.L = cos(tilt) cos(theta_i) + sin(tilt) sin(theta_i) cos(phi) = 0.
            level, swing = np.cos(tilt) * np.cos(polar), np.sin(tilt) * np.sin(polar)
            above = np.arctan2(np.sqrt(np.maximum(swing**2 - level**2, 0)), -level)
        phi = (nodes + 1) / 2 * above[..., None]
        light = tilted_frame(from_angles(polar[..., None], phi), tilt[:, None])
        samples = brdf.transfer(light, view)
        means = np.einsum("iopc,p->ioc", samples, weights / 2)
        result[rows] = means * (above / np.pi)[..., None]
    return result


def azimuthal_mean(brdf: Brdf, view_theta: float) -> tuple[Array, Array]:
    """Average the lobe over the azimuth, for one angle between C and the view.

    The mean is a function of C.L alone: the radially symmetric BRDF of Kautz and McCool.

    `view_theta` is the angle theta_o' between C and the view, radians.

    Returns `cosines` of shape (n,), ``C.L = 1 - 2 t^2``, falling from 1 to -1, where ``t =
    sin(theta_i' / 2)`` has equal steps; and `values` of shape (n, 3), the mean there.

    References: Kautz and McCool 2000, Approximation of glossy reflection with prefiltered
    environment maps.
    """
    chords = np.linspace(0, 1, _MEAN_ANGLES)
    theta_i = 2 * np.arcsin(chords)
    if brdf.zonal:
        values = _zonal_lobe(brdf, theta_i)
    else:
        values = _azimuthal_means(brdf, theta_i, np.array([view_theta]), _MEAN_AZIMUTHS)[:, 0]
    return 1 - 2 * chords**2, values


def interpolate_mean(cosines: Array, means: Array) -> Array:
    """Interpolate the result of `azimuthal_mean` linearly in t, the sine of half the angle.

    `cosines`, of shape (...), are C.L. `means`, of shape (n, 3), are the values that
    `azimuthal_mean` returned; the result has their precision.

    Returns an array of shape (..., 3): a broadcast view if the means are grey.
    """
    position = np.sqrt(np.clip((1 - cosines) / 2, 0, 1)) * (len(means) - 1)
    row = np.minimum(np.floor(position), len(means) - 2)
    return interpolated(means, row, position - row)


def zonal_support(brdf: Brdf) -> float:
    """Find the angle beyond which a zonal lobe is less than 1e-30 of its peak.

    In single precision what lies beyond is denormal numbers, which are slow.

    Returns radians, 90 degrees at most.
    """
    theta = np.linspace(0, np.pi / 2, _MEAN_ANGLES)
    lobe = _zonal_lobe(brdf, theta).max(axis=-1)
    seen = np.nonzero(lobe > _NOTHING * lobe.max())[0]
    return float(theta[min(seen[-1] + 1, len(theta) - 1)]) if len(seen) else 0.0


def lobe_tail(brdf: Brdf, angle: float) -> Brdf:
    """Make the BRDF of what a lobe truncated at `angle` (radians) from C lacks: the part beyond."""
    bound = np.cos(angle)

    class Tail(Brdf):
        """What a lobe truncated at an angle lacks."""

        name = f"{brdf.name} beyond {np.degrees(angle):g} degrees"
        summary = "what a truncated lobe lacks"
        source = brdf.source
        center = brdf.center
        includes_cosine = True
        has_horizon = cuts_horizon(brdf)
        zonal = brdf.zonal

        def evaluate(self, light: Array, view: Array) -> Array:
            cosine = light[..., 2]
            if brdf.center == "reflection":  # R = (-Vx, -Vy, Vz)
                cosine = cosine * view[..., 2]
                cosine = cosine - light[..., 0] * view[..., 0] - light[..., 1] * view[..., 1]
            return scaled(brdf.transfer(light, view), cosine < bound)

    return Tail()


def _zonal_lobe(brdf: Brdf, theta: Array) -> Array:
    """A zonal BRDF at angles from C, shape (n, 3), evaluated where C, N and V are the same."""
    return brdf.transfer(from_angles(theta, 0.0), np.array([0.0, 0.0, 1.0]))
