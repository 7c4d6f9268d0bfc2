"""Samples of the light that GGX reflects, computed from coefficients of light and lobe.

Samples from the frequency domain have no noise, and take few operations.
"""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Brdf, scaled
from shrm_cli.brdf.models.ggx import Ggx
from shrm_cli.brdf.polar_rule import PolarRule, azimuths, transfer_samples
from shrm_cli.probe.lighting import Lighting
from shrm_cli.records import record
from shrm_cli.sphere.directions import bisector, local_frame
from shrm_cli.sphere.harmonics import legendre_table
from shrm_cli.sphere.quadrature import colatitude_weights, gauss_legendre, nodes
from shrm_cli.sphere.rotation import rotate_to_frames, turn_about_z

_AZIMUTHS = 24
"""Nodes over half a turn of the azimuth, for the integrals that expand a lobe."""
_LEAST_NODES = 64
"""The fewest nodes over the angle from the lobe's center, for the same integrals."""
_MAX_M = 16
"""The largest m of the harmonics that a lobe is expanded into."""
_GOLDEN = (np.sqrt(5) - 1) / 2
"""By this part of a step, a ring of samples is turned from the one before, for even coverage."""


@record(eq=False)
class ReflectanceSamples:
    """Light reflected at pairs of mirror direction R and view V that fill both spheres evenly."""

    normals: Array
    views: Array
    """`normals` and `views`: unit vectors in world axes, shape (S, 3)."""
    weights: Array
    """The weights of the S pairs; they sum to 1, shape (S,)."""
    roughness: tuple[float, ...]
    """Perceptual roughnesses."""
    reflected: Array
    """Base reflectance E_0 and Fresnel's tail E_1 of Silvennoinen et al. 2025, eq. 6 and 7, shape
    (A, 2, S, 3)."""
    mirrored: Array
    """The light around R, averaged over the lobe of N = V = R, which is a split sum's first factor,
    shape (A, S, 3)."""


def sample_reflectance(
    lighting: Lighting, roughness: Sequence[float], rings: int, view_rings: int, azimuths: int
) -> ReflectanceSamples:
    """Sample what GGX reflects, up to the order of the lighting.

    `rings` is the number of rings of mirror directions, which lie at Gauss's nodes over z, with ``3
    rings / 2`` directions on each. `view_rings` is the number of rings of views about R, which lie
    at Gauss's nodes over the cosine between R and V. `azimuths` is the number of views on each
    ring.
    """
    directions, theta, phi, weights = _mirror_directions(rings)
    cosines, view_weights = gauss_legendre(view_rings)
    offsets = _GOLDEN * np.arange(len(directions) * view_rings).reshape(len(directions), -1)
    turns = 2 * np.pi * (offsets[..., None] + np.arange(azimuths)) / azimuths
    views = _views(local_frame(theta, phi), np.arccos(cosines), turns)
    centers = np.broadcast_to(directions[:, None, None], views.shape)
    pairs = np.broadcast_to(
        weights[:, None, None] * view_weights[:, None] / azimuths, views.shape[:-1]
    )
    light = _in_frames(lighting.coefficients, theta.reshape(rings, -1), phi.reshape(rings, -1))
    reflected, mirrored = _reflect(
        light, _lobes(roughness, lighting.order, np.arccos(cosines)), turns
    )
    flat = views.reshape(-1, 3)
    mirrored = np.broadcast_to(mirrored[:, :, None, None], (len(roughness), *views.shape))
    return ReflectanceSamples(
        bisector(centers.reshape(-1, 3), flat),
        flat,
        pairs.ravel() / pairs.sum(),
        tuple(roughness),
        reflected.reshape(len(roughness), 2, -1, 3),
        mirrored.reshape(len(roughness), -1, 3),
    )


def _mirror_directions(rings: int) -> tuple[Array, Array, Array, Array]:
    """Return directions, their polar angles, azimuths and weights, of a rule over the sphere."""
    z, weights = gauss_legendre(rings)
    count = 3 * rings // 2
    turns = (np.arange(count) + _GOLDEN * np.arange(rings)[:, None]) * (2 * np.pi / count)
    theta = np.repeat(np.arccos(z), count)
    phi = turns.ravel()
    return local_frame(theta, phi)[..., 2], theta, phi, np.repeat(weights, count)


def _views(frames: Array, theta: Array, turns: Array) -> Array:
    """Return directions (R, T, K, 3) at angles theta (T,) and azimuths (R, T, K) about frames."""
    sine = np.sin(theta)[:, None]
    height = np.broadcast_to(np.cos(theta)[:, None], turns.shape)
    local = np.stack([sine * np.cos(turns), sine * np.sin(turns), height], axis=-1)
    return np.einsum("rij,rtkj->rtki", frames, local)


def _in_frames(coefficients: Array, theta: Array, phi: Array) -> Array:
    """Rotate light into the frame of each of R mirror directions, shape ((order+1)^2, 3, R).

    The angles of the directions have the shape (rings, directions on each ring).
    """
    # The directions of a ring share their polar angle, so the light is turned about z for each of
    # them first, and then tilted for all directions of a ring at once.
    turned = turn_about_z(coefficients[:, :, None, None], -phi.T)
    framed = rotate_to_frames(turned, theta[:, 0], 0.0)
    return framed.swapaxes(-1, -2).reshape(*coefficients.shape, -1)


def _lobes(roughness: Sequence[float], order: int, view_theta: Array) -> Array:
    """Expand the lobes of base and tail, shape (M+1, A, 2, order+1, T+1).

    The last of the T + 1 views is N = V = R.
    """
    angles = np.append(view_theta, 0.0)
    # With this f0 the red channel has no Fresnel term, and the green channel has Fresnel's tail.
    models = [Ggx(roughness=each, f0=(1.0, 0.0, 0.0)) for each in roughness]
    max_m, nodes = min(order, _MAX_M), (max(2 * order, _LEAST_NODES), _AZIMUTHS)
    lobes = [lobe_harmonics(each, angles, order, max_m, nodes)[..., :2] for each in models]
    return np.stack(lobes, axis=1).transpose(0, 1, 4, 2, 3)


def _reflect(light: Array, lobes: Array, turns: Array) -> tuple[Array, Array]:
    """Sum the products of coefficients of light and lobes.

    `light` holds coefficients of the light in the frame of each mirror direction. `lobes`, of shape
    (M+1, A, 2, order+1, T+1), are coefficients of the lobes, as `_lobes` returns them. `turns`, of
    shape (R, T, K), are azimuths of the views.

    Returns `reflected` of shape (A, 2, R, T, K, 3), the light that base and tail reflect; and
    `mirrored` of shape (A, R, 3), the mean of the light by the lobe of N = V = R.
    """
    order = lobes.shape[3] - 1
    degree = np.arange(order + 1)
    zonal = degree * (degree + 1)
    head = lobes[0, :, 0, :, -1]
    mirrored = np.tensordot(head, light[zonal], 1).swapaxes(-1, -2)
    mirrored /= head[:, :1, None] * np.sqrt(4 * np.pi)
    reflected = np.zeros((*lobes.shape[1:3], *turns.shape, 3))
    for m in range(len(lobes)):
        own = lobes[m, ..., : order + 1 - m, :-1].swapaxes(-1, -2)
        for sign, wave in ((1, np.cos), (-1, np.sin)):
            series = np.tensordot(own, light[zonal[m:] + sign * m], 1)  # shape (A, 2, T, 3, R)
            reflected += series.transpose(0, 1, 4, 2, 3)[..., None, :] * wave(m * turns)[..., None]
    return reflected, mirrored


def lobe_harmonics(
    brdf: Brdf, view_theta: Array, order: int, max_m: int, samples: tuple[int, int]
) -> Array:
    """Expand rho_hat over the direction to the light, for views at some angles from C.

    `view_theta`, of shape (n,), holds the angles between C and the view, radians; the view lies in
    the plane of azimuth 0. `order` and `max_m` are the largest l and m. `samples` is the number of
    Fejer's nodes in theta_i, and of nodes over half a turn of the azimuth.

    Returns an array of shape (max_m+1, order+1, n, 3): coefficients of the real harmonics with m >=
    0, indexed [m, l - m, view, channel]. Those with m < 0 vanish, because the lobe is even in the
    azimuth.
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
