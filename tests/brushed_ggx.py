"""Brushed GGX written out again in world axes; nothing here shares code with shrm."""

import numpy as np


def lobe(alphas, frame, view, light):
    """Return ``f_DV N.L`` and ``(1 - V.H)^5`` for lights (n, 3).

    The formulae are eq. 85, 86 and 99 of Heitz 2014. The frame has the rows x, y and N.
    """
    v, to = frame @ view, light @ frame.T
    h = to + v
    h = h / np.linalg.norm(h, axis=-1, keepdims=True)
    ax, ay = alphas
    d = 1 / (np.pi * ax * ay * ((h[:, 0] / ax) ** 2 + (h[:, 1] / ay) ** 2 + h[:, 2] ** 2) ** 2)
    height = np.maximum(to[:, 2], 1e-12)
    squares = [((ax * w[..., 0]) ** 2 + (ay * w[..., 1]) ** 2) for w in (v, to)]
    lambdas = sum(
        (np.sqrt(1 + s / c**2) - 1) / 2 for s, c in zip(squares, (v[2], height), strict=True)
    )
    value = np.where(to[:, 2] > 0, d / (1 + lambdas) / (4 * v[2]), 0.0)
    return value, (1 - np.clip(h @ v, 0, 1)) ** 5


def directions(rings):
    """Return directions of equal solid angle on a lat-long-like grid, (n, 3), and that angle."""
    z, azimuth = (np.arange(rings) + 0.5) / rings * 2 - 1, (np.arange(2 * rings) + 0.5) / rings
    z, azimuth = (each.ravel() for each in np.meshgrid(z, np.pi * azimuth, indexing="ij"))
    sine = np.sqrt(1 - z**2)
    light = np.stack([sine * np.cos(azimuth), z, sine * np.sin(azimuth)], axis=1)
    return light, 4 * np.pi / len(light)
