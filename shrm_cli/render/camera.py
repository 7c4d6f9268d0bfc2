"""The viewer of a sphere: what lies in front of each pixel.

The picture is square. The viewer stands infinitely far away (orthographic), so one direction V
serves every pixel, and sees a sphere that fills `SPHERE_FILL` of the picture. An infinitely
distant eye would see a single direction of the surroundings; their picture is taken instead by
a perspective eye with the same axes and the angle of view `FIELD_OF_VIEW`. It looks along -V,
as from inside the probe, so letters in a probe are not mirrored.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shrm_cli.sphere.directions import from_azimuth_elevation, normalize

Array = NDArray[np.floating]

SPHERE_FILL = 0.9
"""Diameter of the sphere as a fraction of the picture's width."""

FIELD_OF_VIEW = 50.0
"""Angle across the picture of the surroundings, degrees."""

_COLUMNS_PER_PIXEL = 16


@dataclass(frozen=True)
class Viewer:
    """A distant viewer.

    Attributes
    ----------
    azimuth, elevation : float
        Of the direction to the viewer, degrees, as in `from_azimuth_elevation`: 0, 0 is +Z.
    """

    azimuth: float = 0.0
    elevation: float = 0.0

    @property
    def direction(self) -> Array:
        """Unit vector V to the viewer, shape (3,)."""
        return from_azimuth_elevation(self.azimuth, self.elevation)

    def axes(self) -> Array:
        """Right and up of the picture, and V: the rows of a rotation, shape (3, 3).

        For V = +Z they are +X, +Y, +Z. Right depends on the azimuth alone, so straight above
        and below the picture is the limit of those at the same azimuth.
        """
        azimuth = np.radians(self.azimuth)
        right = np.array([np.cos(azimuth), 0.0, -np.sin(azimuth)])
        return np.array([right, np.cross(self.direction, right), self.direction])

    def turned(self, degrees: float) -> "Viewer":
        """The viewer after a walk around +Y, from +Z towards +X."""
        return Viewer(self.azimuth + degrees, self.elevation)


def pixel_centers(size: int, start: int, stop: int) -> tuple[Array, Array]:
    """Offsets from the picture's centre to pixel centres of rows `start` .. `stop` - 1.

    Returns
    -------
    x, y : ndarray, shape (stop - start, size)
        To the right and up, in pixels.
    """
    right = np.arange(size) + 0.5 - size / 2
    up = size / 2 - 0.5 - np.arange(start, stop)
    x, y = np.broadcast_arrays(right[None, :], up[:, None])
    return x, y


def sphere_radius(size: int) -> float:
    """Radius of the sphere in pixels."""
    return SPHERE_FILL * size / 2


def sphere_normals(viewer: Viewer, x: Array, y: Array) -> Array:
    """World normals of the sphere where the viewer sees it.

    Parameters
    ----------
    viewer : Viewer
    x, y : ndarray, shape (...)
        To the right and up, in radii. Points off the sphere get the nearest silhouette's normal.

    Returns
    -------
    ndarray, shape (..., 3)
    """
    beyond = np.maximum(np.hypot(x, y), 1.0)
    x, y = x / beyond, y / beyond
    z = np.sqrt(np.maximum(1 - x**2 - y**2, 0))
    return _in_world(viewer, x, y, z)


def background_directions(viewer: Viewer, size: int, start: int, stop: int) -> Array:
    """World directions in which pixels of rows `start` .. `stop` - 1 see the surroundings.

    Returns
    -------
    ndarray, shape (stop - start, size, 3)
        Unit.
    """
    x, y = pixel_centers(size, start, stop)
    distance = size / 2 / np.tan(np.radians(FIELD_OF_VIEW / 2))
    return normalize(_in_world(viewer, x, y, -distance))


def _in_world(viewer: Viewer, x: Array, y: Array, z: Array | float) -> Array:
    """Vectors of so much right, up and V in world axes, shape (..., 3)."""
    result = np.empty((*x.shape, 3))
    # Not a matrix product: with so few columns, BLAS takes ten times as long.
    for axis, (right, up, direction) in enumerate(viewer.axes().T):
        result[..., axis] = right * x + up * y + direction * z
    return result


def sphere_coverage(size: int, x: Array, y: Array) -> Array:
    """Fraction of each pixel that the sphere covers.

    The area is exact along the axis in which the silhouette is steeper, and a midpoint rule
    across it: right to 0.001.

    Parameters
    ----------
    size : int
        Width of the picture.
    x, y : ndarray, shape (...)
        Offsets of pixel centres from the picture's centre, in pixels.
    """
    radius = sphere_radius(size)
    distance = np.hypot(x, y)
    coverage = (distance < radius).astype(float)
    # Half a pixel's diagonal is 0.71: only nearer pixels can meet the silhouette.
    edge = np.abs(distance - radius) < 1
    x, y = np.abs(x[edge]), np.abs(y[edge])
    along, across = np.maximum(x, y), np.minimum(x, y)
    offsets = (np.arange(_COLUMNS_PER_PIXEL) + 0.5) / _COLUMNS_PER_PIXEL - 0.5
    chord = np.sqrt(np.maximum(radius**2 - (across[:, None] + offsets) ** 2, 0))
    coverage[edge] = np.clip(chord - along[:, None] + 0.5, 0, 1).mean(axis=-1)
    return coverage
