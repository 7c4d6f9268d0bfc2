"""The pixels of spheres that are brushed around +Y, as `shrm render` and `shrm compare` draw them.

Their tangents are horizontal. Where the angle of the view from the normal N and its azimuth from
the tangent are known, all N are still as frequent, and each has one central direction C. Seen the
other way round, a C has up to two normals, at polar angles alpha from +Y with

    C.Y = cos h cos(alpha) - sin h sin(azimuth) sin(alpha) = R cos(alpha - delta),

where h is the angle between C and N. Which part of all normals is reflected about C follows from
the alpha at both ends of its share of the sphere.
"""

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.sphere.directions import horizontal_tangents
from shrm_cli.vocabulary import Center


def both_surfaces(
    center: Center, theta_o: Array, azimuth: Array, frames: Array, any_way: Array, twists: Array
) -> tuple[Array, Array]:
    """Return `azimuths` and `parts` of the pixels of any brushed surface, then of such spheres.

    `any_way`, of shape (2,), are the azimuths on any surface, and `twists`, of shape (directions,),
    what azimuths are told from; the rest is as `horizontal` takes it.

    Returns arrays of shape (directions, views, 4).
    """
    around, parts = horizontal(center, theta_o, azimuth, frames)
    others = np.broadcast_to(any_way, around.shape)
    azimuths = np.concatenate([others, around - twists[:, None, None]], axis=2)
    return azimuths, np.concatenate([np.ones_like(others), parts], axis=2)


def horizontal(
    center: Center, theta_o: Array, azimuth: Array, frames: Array
) -> tuple[Array, Array]:
    """Find the views about each central direction with which the tangents are horizontal.

    `theta_o` and `azimuth`, of shape (views,), are their angles from it and their azimuths from the
    tangent, radians. `frames` are those about the central directions, shape (directions, 3, 3).

    Returns the azimuths of the views in these frames, of shape (directions, views, 2), and, of the
    same shape, how many of the pixels of a view each stands for, 1 in the mean. The alpha of the
    first is ``delta + arccos(C.Y / R)``. Where there is no such normal, its part is 0.
    """
    centers = frames[..., 2]
    of_center = theta_o / 2 if center == "reflection" else np.zeros_like(theta_o)
    of_view = theta_o - of_center
    across = -np.sin(of_center) * np.sin(azimuth)
    most, delta = np.hypot(np.cos(of_center), across), np.arctan2(across, np.cos(of_center))

    def alphas(height: Array) -> Array:
        """Return both polar angles of normals, from C.Y of shape (n,), shape (n, views, 2)."""
        away = np.arccos(np.clip(height[:, None] / most, -1, 1))
        second = delta - away + np.where(delta < 0, 2 * np.pi, 0)
        return np.clip(np.stack([delta + away, second], axis=-1), 0, np.pi)

    # All directions share the sphere in bands of equal height.
    ends = np.cos(alphas(np.linspace(-1, 1, len(centers) + 1)))
    place = np.argsort(np.argsort(centers[:, 1]))
    parts = np.abs(np.diff(ends, axis=0))[place]
    alpha = alphas(centers[:, 1])
    normals = np.stack([np.sin(alpha), np.cos(alpha), 0 * alpha], axis=-1)
    tangents = horizontal_tangents(normals)
    turn, inwards, outwards = (each[:, None, None] for each in (azimuth, of_center, of_view))
    towards = np.cos(turn) * tangents + np.sin(turn) * np.cross(normals, tangents)
    views = np.cos(outwards) * normals + np.sin(outwards) * towards
    mirrored = np.cos(inwards) * normals - np.sin(inwards) * towards
    # A turn about +Y takes this central direction to the one that was asked for.
    found = _azimuth(views, horizontal_tangents(mirrored), mirrored)
    own = _azimuth(horizontal_tangents(centers), frames[..., 0], centers)
    return found + own[:, None, None], parts / parts.mean(axis=(0, 2), keepdims=True)


def _azimuth(directions: Array, x: Array, z: Array) -> Array:
    """Return the azimuths of directions in the frames of these x and z axes, radians."""
    across = np.sum(directions * np.cross(z, x), axis=-1)
    return np.asarray(np.arctan2(across, np.sum(directions * x, axis=-1)))
