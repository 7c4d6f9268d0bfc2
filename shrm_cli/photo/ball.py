"""Photographs of a mirror ball, unwrapped into a probe.

A ball shows nearly all of its surroundings: what is seen in the direction d is reflected where the
normal halves the angle between d and the way to the camera. From afar that is at the same distance
from the middle for all d at the same angle from the camera, and pixels have equal solid angles.
What lies behind the ball is squeezed to its rim, and the camera stands in its middle: a photograph
from another side shows both well, and each direction is taken from where it is seen best.
"""

import os
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array
from shrm_cli.errors import ArgumentError, ProbeError
from shrm_cli.messages import several, whole_number
from shrm_cli.probe.image_file import ImageFile, open_picture
from shrm_cli.progress import report
from shrm_cli.records import record
from shrm_cli.sphere.directions import from_azimuth_elevation, horizontal_tangents
from shrm_cli.sphere.grid.base import bilinear
from shrm_cli.sphere.grid.latlong import latlong_points

_PREFERENCE = 4
"""The power of the squared sine of the angle from the camera by which a photograph is preferred:
with 1, a tenth of a photographer in the middle of the first shines through, with 4 a thousandth."""
_TABLE = 2**14
"""Normals between which those of a near camera are interpolated, to a thousandth of a pixel."""
_PARTS = 3
"""Rows and columns of points of each pixel that are looked up, so that small lamps keep energy."""
LEAST_DISTANCE = 2.0
"""The least distance of a camera in radii of the ball, from its centre."""
_SQUARE = 0.02
"""How far the sides of a picture may differ that a ball fills."""
_BOTH = 0.3
"""Where two photographs are both preferred as much, they see the same well enough to compare."""
_COMPARED = 128
"""The rows of the lat-longs that are compared."""
_TINY = 1e-9
_ROWS = 16
LARGEST = 8192
"""The most rows of a probe."""
Circle = tuple[float, float, float]
"""Where a ball is: x and y of its middle from the left and the top, and its radius, in pixels."""


@record(eq=False)
class Unwrapped:
    """A probe of mirror balls."""

    pixels: NDArray[np.float32]
    """A lat-long, shape (H, 2H, 3)."""
    gains: Array
    """What each photograph was multiplied with to agree with the first, shape (n, 3)."""
    differences: tuple[float, ...]
    """How much each differs from the first where both see well: the median of the relative
    difference, 0 of the first."""
    chromaticities: tuple[float, ...] | None = None
    """CIE x and y of red, green, blue and white, where the first tells them."""
    cameras: tuple[tuple[float, float], ...] = ()
    """The azimuth and elevation that the camera of each photograph was given, or taken, to have."""


def unwrap_balls(
    paths: Sequence[str | os.PathLike[str]] | str | os.PathLike[str],
    cameras: Sequence[tuple[float, float]] | None = None,
    circles: Sequence[Circle] | None = None,
    distance: float = np.inf,
    size: int | None = None,
    linearize: bool = False,
    reflectance: float = 1.0,
) -> Unwrapped:
    """Unwrap photographs of a mirror ball into a lat-long probe.

    Parameters
    ----------
    paths : sequence of path-like, or one
        One photograph, or more from different sides, upright and linear.
    cameras : sequence of (azimuth, elevation), optional
        Where the camera stood for each, seen from the ball, degrees. At azimuth 0 it looks along
        -Z; 90 is to its right. By default the first is at 0, and each next one 90 further.
    circles : sequence of Circle, optional
        Where the ball is in each. By default it fills the picture.
    distance : float
        How far the camera is from the ball's middle, in radii of the ball. The picture is taken to
        be as from afar by default.
    size : int, optional
        Rows of the probe. By default its pixels are as fine as those of the first ball.
    linearize : bool
        Whether to decode integers as the file says, or else as sRGB.
    reflectance : float
        The part of the light that the ball reflects, by which its picture is divided.

    Raises
    ------
    ArgumentError
        If the numbers do not fit each other.
    ProbeError
        If a photograph cannot be read, or the ball is not within it.

    Examples
    --------
    >>> made = shrm.unwrap_balls(["probes/studio.exr"], circles=[(64, 64, 60)], size=16)
    >>> made.pixels.shape
    (16, 32, 3)
    """
    paths = several(paths)
    stood = [(90.0 * k, 0.0) for k in range(len(paths))] if cameras is None else list(cameras)
    if not paths or len(stood) != len(paths):
        raise ArgumentError("camera", "must be given once for each photograph, or not at all")
    if circles and len(circles) != len(paths):
        raise ArgumentError("circle", "must be given once for each photograph, or not at all")
    if not 0 < reflectance <= 1:
        raise ArgumentError("reflectance", "must be above 0, and 1 at most")
    if not distance > LEAST_DISTANCE:
        raise ArgumentError("distance", f"must be above {LEAST_DISTANCE:g} radii of the ball")
    opened = [open_picture(path, linearize) for path in paths]
    given: Sequence[Circle | None] = circles or [None] * len(opened)
    places = [_circle(each, circle) for each, circle in zip(opened, given, strict=True)]
    # A lat-long's equator has pi / H to a pixel, a ball of radius r has 2 / r.
    rows = min(max(round(np.pi * places[0][2] / 2), 2), LARGEST) if size is None else size
    rows = whole_number("size", rows, 2, LARGEST)
    balls = [
        _Ball(each.whole(), circle, from_azimuth_elevation(*camera), distance)
        for each, circle, camera in zip(opened, places, stood, strict=True)
    ]
    gains, differences = _agreement(balls)
    pixels = np.empty((rows, 2 * rows, 3), np.float32)
    for start in range(0, rows, _ROWS):
        report(start, rows)
        part = range(start, min(start + _ROWS, rows))
        seen, trust = _seen_by(balls, part, rows)
        share = trust / trust.sum(axis=0)
        pixels[start : part.stop] = np.einsum("khw,khwc,kc->hwc", share, seen, gains, optimize=True)
    report(rows, rows)
    pixels /= reflectance
    return Unwrapped(pixels, gains, differences, opened[0].chromaticities, tuple(stood))


def ball_points(directions: Array, view: Array, distance: float = np.inf) -> Array:
    """Return where a ball of radius 1 in a picture shows directions.

    `directions`, of shape (..., 3), are unit, from where the light comes. `view`, of shape (3,), is
    unit, towards the camera. `distance` is that of the camera from the ball's middle. The rim has
    the radius 1 in the picture, whatever the distance is.

    Returns an array of shape (..., 2), to the right and up.
    """
    right = horizontal_tangents(view)
    flat = directions @ np.stack([right, np.cross(view, right)], axis=1)
    across = np.hypot(flat[..., 0], flat[..., 1])
    angles = np.arctan2(across, directions @ view)
    return flat * (_from_middle(angles, distance) / np.maximum(across, _TINY))[..., None]


def _from_middle(angles: Array, distance: float) -> Array:
    """Return how far from the ball's middle a picture shows directions at angles from the camera.

    Where the normal is at an angle n from the line to the camera, the camera is seen at an angle c
    beyond it, ``tan c = sin n / (distance - cos n)``, and the light comes from ``2 n + c``.
    """
    if not np.isfinite(distance):
        return np.sin(angles / 2)
    normals = np.linspace(0, np.arccos(1 / distance), _TABLE)
    beyond = np.arctan2(np.sin(normals), distance - np.cos(normals))
    # The rim is where lines from the camera touch the ball.
    radii = np.tan(beyond) * np.sqrt(distance**2 - 1)
    return np.interp(angles, 2 * normals + beyond, radii)


def _circle(opened: ImageFile, circle: Circle | None) -> Circle:
    """Return where a ball is: what is given, or what fills the picture."""
    width, height = opened.width, opened.height
    if circle is None:
        if abs(width - height) > _SQUARE * max(width, height):
            raise ProbeError(
                f"{opened.path}: {width} x {height} pixels, which a ball does not fill; crop it to "
                "the ball, or give its `circle`"
            )
        return width / 2, height / 2, min(width, height) / 2
    x, y, radius = circle
    if not (radius >= 1 and radius <= min(x, y, width - x, height - y) + 1):
        raise ProbeError(
            f"{opened.path}: a ball at {x:g}, {y:g} of radius {radius:g} is not within its "
            f"{width} x {height} pixels; give the `circle` in pixels from the top left"
        )
    return circle


@record(eq=False)
class _Ball:
    """A photograph: its pixels, where the ball is in it, and where the camera stood."""

    image: Array
    circle: Circle
    view: Array
    distance: float

    def seen(self, directions: Array) -> Array:
        """Return what the ball shows in directions, shape (..., 3)."""
        x, y, radius = self.circle
        points = ball_points(directions, self.view, self.distance)
        # Pixels at the rim show what is beside the ball, too.
        reach = np.maximum(np.linalg.norm(points, axis=-1, keepdims=True), _TINY)
        right, up = np.moveaxis(points * np.minimum(1, (1 - 1 / radius) / reach), -1, 0)
        return bilinear(self.image, x + radius * right - 0.5, y - radius * up - 0.5)

    def trust(self, directions: Array) -> Array:
        """Return how far it is preferred in directions, shape (...)."""
        return np.asarray((1 - (directions @ self.view) ** 2) ** _PREFERENCE + _TINY)


def _seen_by(balls: Sequence[_Ball], part: range, rows: int) -> tuple[Array, Array]:
    """Return what balls show of some rows of a lat-long, and how far each is preferred there.

    Returns `seen` of shape (balls, len(part), 2 rows, 3) and `trust` of shape (balls, len(part), 2
    rows).
    """
    steps = (np.arange(_PARTS) + 0.5) / _PARTS
    down = 2 * (np.array(part)[:, None] + steps) / rows - 1
    across = (np.arange(2 * rows)[:, None] + steps) / rows - 1
    directions = latlong_points(across.ravel(), down.reshape(-1, 1))
    shape = len(part), _PARTS, 2 * rows, _PARTS

    def mean(values: Array) -> Array:
        return np.asarray(values.reshape(*shape, *values.shape[2:]).mean(axis=(1, 3)))

    seen = np.stack([mean(each.seen(directions)) for each in balls])
    return seen, np.stack([mean(each.trust(directions)) for each in balls])


def _agreement(balls: Sequence[_Ball]) -> tuple[Array, tuple[float, ...]]:
    """Return what makes photographs agree with the first, and how far they differ even so."""
    seen, trust = _seen_by(balls, range(_COMPARED), _COMPARED)
    gains, differences = [np.ones(3)], [0.0]
    for pixels, its in zip(seen[1:], trust[1:], strict=True):
        both = (np.minimum(its, trust[0]) > _BOTH) & (np.minimum(pixels, seen[0]) > 0).all(axis=-1)
        ratios = seen[0][both] / pixels[both] if both.any() else np.ones((1, 3))
        gains.append(np.median(ratios, axis=0))
        differences.append(float(np.median(np.abs(ratios / gains[-1] - 1))))
    return np.array(gains), tuple(differences)
