"""GGX written out again in world axes; nothing here shares code with shrm."""

import numpy as np


def lobe(roughness, normal, view, light):
    """Return ``f_DV N.L`` and ``(1 - V.H)^5`` for lights (..., 3), each of shape (...).

    The formulae are eq. 33 of Walter et al. 2007, eq. 99 of Heitz 2014, and Schlick 1994.
    """
    a2 = roughness**4
    half = light + view
    half = half / np.maximum(np.sqrt(np.sum(half**2, axis=-1, keepdims=True)), 1e-300)
    height, depth = light @ normal, view @ normal
    off = half - (half @ normal)[..., None] * normal  # perpendicular to N: exact for small angles
    d = a2 / (np.pi * (np.sum(off**2, axis=-1) + a2 * (half @ normal) ** 2) ** 2)
    above = np.maximum(height, 1e-12)
    lambdas = sum((np.sqrt(1 + a2 * (1 / c**2 - 1)) - 1) / 2 for c in (above, depth))
    value = np.where(height > 0, d / (1 + lambdas) / (4 * depth), 0.0)
    return value, (1 - np.clip(half @ view, 0, 1)) ** 5


def reflected(roughness, normals, views, light, radiance):
    """Return E_0 and E_1 of eq. 6 and 7 of Silvennoinen et al. 2025, shape (2, n, channels).

    `radiance` (m, channels) is the radiance of the lights times their solid angles.
    """
    result = np.empty((2, len(normals), radiance.shape[1]))
    for k, (normal, view) in enumerate(zip(normals, views, strict=True)):
        above = light @ normal > 0
        base, tail = lobe(roughness, normal, view, light[above])
        result[:, k] = np.stack([base, base * tail]) @ radiance[above]
    return result


def moments(roughness, cosine, polar=800, azimuths=1300):
    """Integrate the lobe times 1, N.L and T.L, without and with (1 - V.H)^5, shape (2, 3).

    The sum is over a million samples of L in polar coordinates (t, p) about R; those below the
    surface count as 0. The angle t is ``pi u^3``, so that sharp lobes and tails both get samples.
    """
    normal, view = np.array([0.0, 0, 1]), np.array([np.sqrt(1 - cosine**2), 0, cosine])
    mirror, side = np.array([-view[0], 0, cosine]), np.array([cosine, 0, view[0]])
    u = (np.arange(polar)[:, None] + 0.5) / polar
    t, p = np.pi * u**3, np.pi * (np.arange(azimuths) + 0.5) / azimuths
    weight = 2 * np.pi / azimuths * np.sin(t) * 3 * np.pi * u**2 / polar
    light = np.cos(t)[..., None] * mirror + (np.sin(t) * np.cos(p))[..., None] * side
    light[..., 1] += np.sin(t) * np.sin(p)
    above = light[..., 2] > 0
    weight, light = np.broadcast_to(weight, above.shape)[above], light[above]
    base, tail = lobe(roughness, normal, view, light)
    first = np.stack([np.ones(len(light)), light[:, 2], -light[:, 0]])
    return np.stack([first @ (base * weight), first @ (base * tail * weight)])
