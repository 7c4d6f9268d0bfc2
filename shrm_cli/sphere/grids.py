"""Pixel grids on the sphere: pixel <-> direction <-> solid angle or quadrature weight.

Two samplings exist. ``center``: pixel i of n covers ((i, i+1) / n) and is sampled at its
centre. ``border``: pixel 0 and pixel n-1 lie on the two ends of the range, as the OpenEXR
environment maps define it.

A lat-long seen from inside, and its axes::

        left quarter      centre      right quarter        top row: +Y
            +X              +Z             -X              the seam at both ends: -Z
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.vocabulary import Sampling

Array = NDArray[np.floating]

LATLONG_AXES = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""Rows: world axes of a lat-long's own x, y and polar z: longitude 0 is +Z, 90 degrees is +X."""


def nodes(size: int, sampling: Sampling = "center") -> Array:
    """The `size` sample positions of one axis, in [-1, 1], ascending."""
    if sampling == "border":
        return np.linspace(-1.0, 1.0, size) if size > 1 else np.zeros(1)
    return (2 * np.arange(size) + 1) / size - 1


def latlong_angles(width: int, height: int, sampling: Sampling = "center") -> tuple[Array, Array]:
    """Polar angle from +Y of each row and longitude from +Z towards +X of each column, radians."""
    return (
        (nodes(height, sampling) + 1) * (np.pi / 2),
        -nodes(width, sampling) * np.pi,
    )


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


def colatitude_weights(height: int, sampling: Sampling = "center") -> Array:
    """Quadrature weights of the rows of a lat-long for the integral over sin(theta) dtheta.

    Fejer's first rule (``center``) or Clenshaw and Curtis's (``border``): exact for every
    trigonometric polynomial of degree below `height`, unlike the usual sin(theta) times the
    row's height.

    Returns
    -------
    ndarray, shape (height,)
        They sum to 2.

    References
    ----------
    Waldvogel 2006, Fast construction of the Fejer and Clenshaw-Curtis quadrature rules.
    """
    intervals = height if sampling == "center" else height - 1
    k = np.arange(intervals // 2 + 1)
    moments = 4 / (1 - 4.0 * k**2)  # twice the integrals of cos(2 k theta) sin(theta)
    moments[0] /= 2
    if intervals % 2 == 0:
        # The last wave is 0 at the centres of the intervals, and counts twice at their ends.
        moments[-1] *= 0 if sampling == "center" else 0.5
    shift = np.exp(1j * np.pi * k / intervals) if sampling == "center" else 1
    weights = np.fft.ifft(moments * shift, n=intervals).real
    if sampling == "border":
        weights = np.append(weights, weights[0])
        weights[[0, -1]] /= 2
    return weights


def gauss_legendre(count: int) -> tuple[Array, Array]:
    """Nodes in (-1, 1), ascending, and weights of the rule exact to degree 2 count - 1.

    References
    ----------
    Golub & Welsch 1969: eigenvalues and first components of the eigenvectors of the Jacobi
    matrix.
    """
    k = np.arange(1, count)
    beside = k / np.sqrt(4.0 * k**2 - 1)
    values, vectors = np.linalg.eigh(np.diag(beside, -1) + np.diag(beside, 1))
    return values, 2 * vectors[0] ** 2


def longitude_weights(width: int, sampling: Sampling = "center") -> Array:
    """Weights of the columns of a lat-long; they sum to 2 pi."""
    if sampling == "center":
        return np.full(width, 2 * np.pi / width)
    # The two end columns are the same meridian and share its weight.
    weights = np.full(width, 2 * np.pi / (width - 1))
    weights[[0, -1]] /= 2
    return weights


def angular_directions(size: int, sampling: Sampling = "center") -> tuple[Array, NDArray[np.bool_]]:
    """Directions of an angular map (light-probe ball) and which pixels lie inside its rim.

    The centre looks along +Z, the angle from it is proportional to the radius, 180 degrees at
    the rim; right is -X (seen from inside) and up is +Y.

    Returns
    -------
    directions : ndarray, shape (size, size, 3)
    inside : ndarray of bool, shape (size, size)
    """
    s = nodes(size, sampling)
    return angular_points(s, s[:, None]), np.hypot(s[None, :], s[:, None]) <= 1


def angular_points(across: ArrayLike, down: ArrayLike) -> Array:
    """Directions at positions on an angular map, broadcastable: (..., 3); -Z beyond the rim."""
    across, down = np.broadcast_arrays(across, down)
    radius = np.minimum(np.hypot(across, down), 1.0)
    # sin(pi r) / r, continued to pi at the centre.
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

    ``d omega = pi sin(pi r) / r dx dy``; pixels that the rim cuts are averaged over sub-pixels.
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
    weights[radius > 1] = 0  # samples outside the rim carry no radiance
    return weights * (4 * np.pi / weights.sum())


def spiral_directions(count: int) -> Array:
    """Directions spread evenly over the sphere, of equal weight, without any regular rows.

    Sums over the rows of other grids resonate with functions that have rows of their own.

    Returns
    -------
    ndarray, shape (count, 3)

    References
    ----------
    Gonzalez 2010, Measurement of areas on a sphere using Fibonacci and latitude-longitude
    lattices.
    """
    k = np.arange(count)
    z = (2 * k + 1) / count - 1
    phi = k * (np.pi * (3 - np.sqrt(5)))
    sine = np.sqrt(1 - z**2)
    return np.stack([sine * np.cos(phi), sine * np.sin(phi), z], axis=-1)
