"""Geometry of latitude-longitude maps: between positions on the image and directions.

This is a lat-long seen from inside, with the world axes that it looks at::

        left quarter      center      right quarter        top row: +Y
            +X              +Z             -X              the seam at both ends: -Z
"""

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array
from shrm_cli.sphere.quadrature import nodes
from shrm_cli.vocabulary import Sampling

LATLONG_AXES = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""World axes of a lat-long's own x, y and polar z, as rows: longitude 0 is +Z, 90 degrees +X."""


def latlong_directions(width: int, height: int, sampling: Sampling = "center") -> Array:
    """World directions of the pixels of a lat-long, shape (height, width, 3)."""
    return latlong_points(nodes(width, sampling), nodes(height, sampling)[:, None])


def latlong_points(across: ArrayLike, down: ArrayLike) -> Array:
    """World directions at positions on a lat-long, each in [-1, 1], broadcastable: (..., 3)."""
    theta = (np.asarray(down) + 1) * (np.pi / 2)
    longitude = -np.asarray(across) * np.pi
    x, y, z = np.broadcast_arrays(
        np.sin(theta) * np.sin(longitude), np.cos(theta), np.sin(theta) * np.cos(longitude)
    )
    return np.stack([x, y, z], axis=-1)


def latlong_coordinates(directions: ArrayLike) -> tuple[Array, Array]:
    """Position across and down a lat-long, each in [-1, 1], of directions, shape (..., 3)."""
    x, y, z = np.moveaxis(np.asarray(directions), -1, 0)
    return -np.arctan2(x, z) / np.pi, np.arctan2(np.hypot(x, z), y) * (2 / np.pi) - 1
