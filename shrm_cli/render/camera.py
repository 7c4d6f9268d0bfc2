"""The viewer of a sphere, and what each pixel of the picture shows.

The picture is square. The viewer stands infinitely far away (orthographic), so one direction V
serves every pixel. The sphere fills `SPHERE_FILL` of the picture. An infinitely distant eye would
see a single direction of the surroundings. Their picture is therefore taken by a perspective eye
with the same axes and the angle of view `FIELD_OF_VIEW`. It looks along -V, as from inside the
probe, so that letters in a probe are not mirrored.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array
from shrm_cli.errors import ArgumentError
from shrm_cli.messages import check_fields
from shrm_cli.records import record
from shrm_cli.sphere.directions import from_azimuth_elevation, normalize

SPHERE_FILL = 0.9
"""Diameter of the sphere as a fraction of the picture's width."""

FIELD_OF_VIEW = 50.0
"""Angle that the picture of the surroundings spans, degrees."""

_STRIPS_PER_PIXEL = 16
"""Strips into which `sphere_coverage` divides a pixel on the silhouette."""


@record
class Viewer:
    """A distant viewer.

    Attributes
    ----------
    azimuth, elevation : float
        Direction to the viewer in degrees, as in `from_azimuth_elevation`: 0, 0 is +Z.

    Examples
    --------
    >>> shrm.Viewer(90, 0).direction.round(3).tolist()
    [1.0, 0.0, 0.0]
    """

    azimuth: float = 0.0
    elevation: float = 0.0

    def __post_init__(self) -> None:
        check_fields(self)

    @property
    def direction(self) -> Array:
        """Unit vector V to the viewer, shape (3,)."""
        return from_azimuth_elevation(self.azimuth, self.elevation)

    def axes(self) -> Array:
        """Return the picture's right and up, and V, in world axes.

        They are the rows of a rotation, shape (3, 3). For V = +Z they are +X, +Y, +Z. Right
        depends on the azimuth alone, so the picture from straight above or below is the limit of
        the pictures at the same azimuth.
        """
        azimuth = np.radians(self.azimuth)
        right = np.array([np.cos(azimuth), 0.0, -np.sin(azimuth)])
        return np.array([right, np.cross(self.direction, right), self.direction])

    def turned(self, degrees: float) -> "Viewer":
        """Return the viewer turned about +Y by an angle, from +Z towards +X."""
        return Viewer(self.azimuth + degrees, self.elevation)


def pixel_centers(size: int, start: int, stop: int) -> tuple[Array, Array]:
    """Return the offsets from the picture's centre to the pixel centres of some rows.

    The rows are `start` .. `stop` - 1.

    Returns `x` and `y`, each of shape (stop - start, size), offsets to the right and upwards, in
    pixels.
    """
    right = np.arange(size) + 0.5 - size / 2
    up = size / 2 - 0.5 - np.arange(start, stop)
    x, y = np.broadcast_arrays(right[None, :], up[:, None])
    return x, y


def sphere_radius(size: int) -> float:
    """Return the radius, in pixels, of the sphere in a picture of a width in pixels."""
    return SPHERE_FILL * size / 2


def sphere_normals(viewer: Viewer, x: Array, y: Array) -> Array:
    """Return the normals of the sphere at points where the viewer sees it.

    `x` and `y`, each of shape (...), are offsets to the right and upwards from the sphere's centre,
    in radii. Points off the sphere get the normal of the nearest point on the silhouette.

    Returns an array of shape (..., 3): unit, world axes.
    """
    beyond = np.maximum(np.hypot(x, y), 1.0)
    x, y = x / beyond, y / beyond
    z = np.sqrt(np.maximum(1 - x**2 - y**2, 0))
    return in_world(viewer, x, y, z)


def background_directions(viewer: Viewer, size: int, start: int, stop: int) -> Array:
    """Return the directions in which the pixels of some rows see the surroundings.

    The rows are `start` .. `stop` - 1.

    Returns an array of shape (stop - start, size, 3): unit, world axes.
    """
    x, y = pixel_centers(size, start, stop)
    distance = size / 2 / np.tan(np.radians(FIELD_OF_VIEW / 2))
    return normalize(in_world(viewer, x, y, -distance))


def background_rows(size: int) -> int:
    """Rows of a lat-long whose pixels are no larger than those of a picture of the surroundings."""
    pixel = 2 * np.tan(np.radians(FIELD_OF_VIEW / 2)) / size
    return int(np.ceil(np.pi / pixel))


def in_world(viewer: Viewer, x: Array, y: Array, z: Array | float) -> Array:
    """Return vectors with components along right, up and V in world axes, shape (..., 3)."""
    result = np.empty((*x.shape, 3))
    # A matrix product with so few columns would take BLAS ten times as long.
    for axis, (right, up, direction) in enumerate(viewer.axes().T):
        result[..., axis] = right * x + up * y + direction * z
    return result


def whole_coverage(size: int) -> Array:
    """Return the fraction of each pixel of a picture that the sphere covers, shape (size, size)."""
    return sphere_coverage(size, *pixel_centers(size, 0, size))


def sphere_coverage(size: int, x: Array, y: Array) -> Array:
    """Return the fraction of each pixel that the sphere covers, shape (...).

    The area is integrated exactly along the axis in which the pixel lies farther from the centre,
    and by the midpoint rule along the other axis. The fraction is right to 0.001.

    `x` and `y`, each of shape (...), are offsets of pixel centres from the picture's centre, in
    pixels.
    """
    radius = sphere_radius(size)
    distance = np.hypot(x, y)
    coverage = (distance < radius).astype(float)
    # Only pixels whose centre is within half a diagonal, 0.71, can meet the silhouette.
    edge = np.abs(distance - radius) < 1
    x, y = np.abs(x[edge]), np.abs(y[edge])
    along, across = np.maximum(x, y), np.minimum(x, y)
    offsets = (np.arange(_STRIPS_PER_PIXEL) + 0.5) / _STRIPS_PER_PIXEL - 0.5
    chord = np.sqrt(np.maximum(radius**2 - (across[:, None] + offsets) ** 2, 0))
    coverage[edge] = np.clip(chord - along[:, None] + 0.5, 0, 1).mean(axis=-1)
    return coverage


# ---- the perspective camera before a mesh --------------------------------------------------------
# It looks along -V towards its target, upright as the `Viewer` is. Its angle of view belongs to the
# shorter edge of the picture. The surroundings behind a mesh are seen by the same camera.


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
    """How far the camera is from the target."""

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
