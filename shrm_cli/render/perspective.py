"""The perspective camera before a mesh, and where it has to stand to see all of it.

It looks along -V towards its target, upright as the `Viewer` is. Its angle of view belongs to the
shorter edge of the picture. The surroundings behind a mesh are seen by the same camera.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array
from shrm_cli.errors import ArgumentError
from shrm_cli.records import record
from shrm_cli.render.camera import SPHERE_FILL, Viewer, in_world
from shrm_cli.sphere.directions import normalize

DEFAULT_FOV = 35.0
"""Angle of view by default, degrees."""
LIMITS = (0.01, 170.0)
"""The least and the largest angle of view, degrees."""


@record
class Lens:
    """What a camera has in common in all frames of a turntable."""

    width: int
    height: int
    """`width` and `height`: of the picture, pixels."""
    fov: float = DEFAULT_FOV
    """The angle that the shorter edge spans, degrees."""

    def __post_init__(self) -> None:
        low, high = LIMITS
        if not low <= self.fov <= high:
            raise ArgumentError("fov", f"is {self.fov:g}, outside {low:g} .. {high:g} degrees")

    @property
    def pixel(self) -> float:
        """Width of a pixel at distance 1."""
        return float(2 * np.tan(np.radians(self.fov / 2)) / min(self.width, self.height))

    def directions(self, viewer: Viewer, x: Array, y: Array) -> Array:
        """Return the directions in which points of the picture look.

        `x` and `y`, each of shape (...), are offsets from the picture's centre to the right and
        upwards, pixels.

        Returns an array of shape (..., 3): unit, world axes.
        """
        return normalize(in_world(viewer, x * self.pixel, y * self.pixel, -1.0))

    def background_rows(self) -> int:
        """Rows of a lat-long whose pixels are no larger than those of the picture."""
        return min(int(np.ceil(np.pi / self.pixel)), 2**16)


@record(eq=False)
class Aim:
    """Where a camera looks and from how far."""

    target: Array
    """The point in the middle of the picture, world axes, shape (3,)."""
    distance: float
    """From the target to the camera."""

    def eye(self, viewer: Viewer) -> Array:
        """Return where the camera stands, shape (3,)."""
        return self.target + self.distance * viewer.direction


def aimed(
    vertices: Array,
    viewers: Sequence[Viewer],
    lens: Lens,
    target: ArrayLike | None = None,
    distance: float | None = None,
) -> Aim:
    """Return where cameras stand that see all of a mesh from several sides.

    All of them have the same target and distance, so that a turning mesh does not shrink or jump.

    `vertices` are of shape (n, 3). `target`, of shape (3,), is by default the middle of the mesh's
    bounds. `distance` is by default the least at which every vertex is within 0.9 of the picture's
    width and height in all views, which is how much of a picture a sphere fills.
    """
    if distance is not None and not (np.isfinite(distance) and distance > 0):
        raise ArgumentError("distance", f"is {distance:g}; it must be a positive number")
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    middle = (low + high) / 2 if target is None else np.asarray(target, dtype=float)
    if not np.isfinite(middle).all():
        raise ArgumentError("target", "must be three finite numbers")
    if distance is not None:
        return Aim(middle, float(distance))
    slope = SPHERE_FILL * lens.pixel / 2 * np.array([lens.width, lens.height])
    least = 0.0
    for viewer in viewers:
        right, up, towards = viewer.axes() @ (vertices - middle).T
        # A point at height z before the target is at distance d - z from the camera, and within
        # the picture if |x| <= slope (d - z).
        for across, limit in ((right, slope[0]), (up, slope[1])):
            least = max(least, float(np.max(np.abs(across) / limit + towards)))
    return Aim(middle, least)
