"""Rusinkiewicz's angles, of the half vector and the difference, along which reflection lobes lie.

The half vector H is (L + V) / |L + V|. The difference angle is the light's angle from H.

References
----------
Rusinkiewicz 1998, "A New Change of Variables for Efficient BRDF Representation".
"""

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.sphere.directions import from_angles


def half_angles(light: Array, view: Array) -> tuple[Array, Array, Array]:
    """Compute the half and difference angles of pairs of directions.

    Parameters
    ----------
    light, view : ndarray, shape (..., 3)
        Unit vectors in the frame of the normal, z = N.

    Returns
    -------
    theta_h : ndarray, shape (...)
        The angle of the half vector from the normal, radians.
    theta_d : ndarray, shape (...)
        The angle of the light from the half vector, radians.
    phi_d : ndarray, shape (...)
        The azimuth of the light about the half vector, radians in -pi .. pi; it is 0 on the side
        away from the normal.
    """
    total, difference = light + view, light - view
    x, y, z = np.moveaxis(total, -1, 0)
    u, v, w = np.moveaxis(difference, -1, 0)
    across, length = np.sqrt(x * x + y * y), np.sqrt(x * x + y * y + z * z)
    spread = np.sqrt(u * u + v * v + w * w)
    # L - V is perpendicular to the half vector. These are its components along the half vector's
    # theta and phi directions, both multiplied by `across`, so that nothing is divided by zero
    # where theta_h = 0.
    along_theta = np.where(across > 0, z * (u * x + v * y) - across * across * w, u)
    along_phi = np.where(across > 0, (v * x - u * y) * length, v)
    return (
        np.arctan2(across, z),
        np.arctan2(spread, length),
        np.arctan2(along_phi, along_theta),
    )


def from_half_angles(theta_h: Array, theta_d: Array, phi_d: Array) -> tuple[Array, Array]:
    """Compute the light and the view, shape (..., 3) each, that have given angles.

    It is the inverse of `half_angles`, with the half vector in the plane of x and z.
    """
    cosine, sine = np.cos(theta_h), np.sin(theta_h)
    result = []
    for turn in (0.0, np.pi):
        x, y, z = np.moveaxis(from_angles(theta_d, phi_d + turn), -1, 0)
        parts = np.broadcast_arrays(cosine * x + sine * z, y, cosine * z - sine * x)
        result.append(np.stack(parts, axis=-1))
    return result[0], result[1]
