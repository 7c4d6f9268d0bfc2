"""The half vector and the difference: angles in which reflection lobes lie along the axes."""

import numpy as np
from numpy.typing import NDArray

from shrm_cli.sphere.directions import from_angles

Array = NDArray[np.floating]


def half_angles(light: Array, view: Array) -> tuple[Array, Array, Array]:
    """Rusinkiewicz's angles of unit directions, shape (..., 3), in the frame of the normal.

    Returns
    -------
    theta_h, theta_d, phi_d : ndarray, shape (...)
        Of the half vector from the normal, of the light from the half vector, and the light's
        azimuth about the half vector, 0 on the side away from the normal, in -pi .. pi; radians.

    References
    ----------
    Rusinkiewicz 1998, A new change of variables for efficient BRDF representation.
    """
    total, difference = light + view, light - view
    x, y, z = np.moveaxis(total, -1, 0)
    u, v, w = np.moveaxis(difference, -1, 0)
    across, length = np.sqrt(x * x + y * y), np.sqrt(x * x + y * y + z * z)
    spread = np.sqrt(u * u + v * v + w * w)
    # The difference stands on the half vector: its parts along that vector's theta and phi, both
    # times `across`, so that at theta_h = 0 nothing is divided by zero.
    along_theta = np.where(across > 0, z * (u * x + v * y) - across * across * w, u)
    along_phi = np.where(across > 0, (v * x - u * y) * length, v)
    return (
        np.arctan2(across, z),
        np.arctan2(spread, length),
        np.arctan2(along_phi, along_theta),
    )


def from_half_angles(theta_h: Array, theta_d: Array, phi_d: Array) -> tuple[Array, Array]:
    """Light and view, shape (..., 3), with the half vector in the plane of x and z."""
    cosine, sine = np.cos(theta_h), np.sin(theta_h)
    result = []
    for turn in (0.0, np.pi):
        x, y, z = np.moveaxis(from_angles(theta_d, phi_d + turn), -1, 0)
        parts = np.broadcast_arrays(cosine * x + sine * z, y, cosine * z - sine * x)
        result.append(np.stack(parts, axis=-1))
    return result[0], result[1]
