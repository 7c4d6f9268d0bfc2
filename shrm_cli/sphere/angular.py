"""Geometry of angular maps (light-probe balls): between positions on the image and directions.

The center looks along +Z. The angle from it is proportional to the distance from the center, 180
degrees at the rim, a circle that touches the edges of the image. Right is -X (seen from inside)
and up is +Y.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.arrays import Array
from shrm_cli.sphere.quadrature import nodes
from shrm_cli.vocabulary import Sampling


def angular_directions(size: int, sampling: Sampling = "center") -> tuple[Array, NDArray[np.bool_]]:
    """Directions of the pixels of an angular map, and which of them lie inside its rim.

    Returns
    -------
    directions : ndarray, shape (size, size, 3)
        They are -Z outside the rim.
    inside : ndarray of bool, shape (size, size)
    """
    s = nodes(size, sampling)
    return angular_points(s, s[:, None]), np.hypot(s[None, :], s[:, None]) <= 1


def angular_points(across: ArrayLike, down: ArrayLike) -> Array:
    """Directions at positions on an angular map, broadcastable: (..., 3); -Z beyond the rim."""
    across, down = np.broadcast_arrays(across, down)
    radius = np.minimum(np.hypot(across, down), 1.0)
    # sin(pi r) / r, continued to pi at the center.
    ratio = np.pi * np.sinc(radius)
    directions = np.stack([-ratio * across, -ratio * down, np.cos(radius * np.pi)], axis=-1)
    return directions / np.linalg.norm(directions, axis=-1, keepdims=True)


def angular_coordinates(directions: ArrayLike) -> tuple[Array, Array]:
    """Position across and down an angular map, each in [-1, 1], of directions (..., 3)."""
    x, y, z = np.moveaxis(np.asarray(directions), -1, 0)
    sine = np.hypot(x, y)
    x = np.where((sine == 0) & (z < 0), -1.0, x)  # -Z is the whole rim: take its right end
    ratio = np.arctan2(sine, z) / (np.pi * np.where(sine > 0, sine, 1.0))
    return -ratio * x, -ratio * y


def angular_solid_angles(size: int, sampling: Sampling = "center") -> Array:
    """Solid angle of each pixel of an angular map, shape (size, size); they sum to 4 pi.

    ``d omega = pi sin(pi r) / r dx dy``. Pixels that the rim cuts are averaged over sub-pixels,
    and those whose sample lies outside it have none.
    """
    s = nodes(size, sampling)
    step = s[1] - s[0]
    radius = np.hypot(s[None, :], s[:, None])
    weights = np.pi**2 * np.sinc(np.minimum(radius, 1.0)) * step**2
    rim = (radius > 1 - step) & (radius <= 1)
    offsets = nodes(16) * step / 2
    rows, columns = np.nonzero(rim)
    x = s[columns][:, None, None] + offsets[None, None, :]
    y = s[rows][:, None, None] + offsets[None, :, None]
    fine = np.hypot(x, y)
    density = np.pi**2 * np.sinc(np.minimum(fine, 1.0)) * (fine < 1)
    weights[rim] = density.mean(axis=(1, 2)) * step**2
    weights[radius > 1] = 0
    return weights * (4 * np.pi / weights.sum())
