"""Probes that are computed instead of photographed: a furnace, an impulse, a studio.

All are lat-longs sampled at pixel centers, with +Y up, +Z in the center column and +X a quarter
of the width left of it.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.arrays import Array, slices
from shrm_cli.errors import ProbeError
from shrm_cli.progress import report
from shrm_cli.records import record
from shrm_cli.sphere.directions import from_azimuth_elevation
from shrm_cli.sphere.grid.latlong import latlong_coordinates, latlong_directions
from shrm_cli.vocabulary import LARGEST_HALF, MAX_LATLONG_HEIGHT

Image = NDArray[np.float32]

BAND_ROWS = 64
"""Rows shaded at a time, few enough to keep the temporaries small beside the image itself."""


@record
class SoftBox:
    """A rectangular light on the tangent plane of a direction, with a smooth edge."""

    azimuth: float
    elevation: float
    """`azimuth` and `elevation`: direction of its center, degrees; see `from_azimuth_elevation`."""
    width: float
    height: float
    """`width` and `height`: angles that it spans at half its radiance, degrees, below 180."""
    color: tuple[float, float, float]
    """Linear RGB, relative to the radiance of the light."""
    edge: float = 0.35
    """Width of the soft edge as a fraction of the half width and of the half height."""


KEY = SoftBox(45, 40, 50, 40, (1.0, 0.94, 0.86))
FILL = SoftBox(-60, 15, 70, 60, (0.80, 0.90, 1.0))
RIM = SoftBox(165, 30, 16, 60, (1.0, 1.0, 1.0))
FILL_RADIANCE, RIM_RADIANCE = 2.0, 10.0
FLOOR_COLOR, CEILING_COLOR = (0.020, 0.019, 0.018), (0.10, 0.105, 0.115)


def furnace(size: int, radiance: ArrayLike = 1.0) -> Image:
    """Constant radiance from everywhere.

    Parameters
    ----------
    size : int
        Height of the image in pixels, at least 2.
    radiance : array_like, scalar or shape (3,)
        Linear RGB, at least 0, within the range of float32.

    Returns
    -------
    ndarray of float32, shape (size, 2 * size, 3)

    Raises
    ------
    ProbeError
        If the size or the radiance is out of its range.

    Examples
    --------
    >>> shrm.furnace(2, 0.5).shape
    (2, 4, 3)
    """
    check_size(size)
    return np.tile(_rgb(radiance).astype(np.float32), (size, 2 * size, 1))


def impulse(size: int, direction: ArrayLike, radiance: ArrayLike | None = None) -> Image:
    """Black but for the one texel that contains a direction.

    Parameters
    ----------
    size : int
        Height of the image in pixels, at least 2.
    direction : array_like, shape (3,)
        World direction, of any length but 0. On the edge between texels it is in the right or
        lower one.
    radiance : array_like, scalar or shape (3,), optional
        Linear RGB of the texel. The default is 1 / its exact solid angle: then the integral of
        radiance over the sphere is 1 in each channel, and so is the irradiance of a surface
        that faces the texel, but for the texel's extent.

    Returns
    -------
    ndarray of float32, shape (size, 2 * size, 3)

    Raises
    ------
    ProbeError
        If the size, the direction or the radiance is out of its range.

    Examples
    --------
    >>> int(np.count_nonzero(shrm.impulse(8, [0, 0, 1]).max(axis=-1)))
    1
    """
    check_size(size)
    vector = np.asarray(direction, dtype=float)
    if vector.shape != (3,) or not np.isfinite(vector).all() or not vector.any():
        raise ProbeError("the impulse's direction must be three finite numbers, not all 0")
    row, column = latlong_texels(vector, size)
    image = np.zeros((size, 2 * size, 3), dtype=np.float32)
    image[row, column] = 1 / latlong_solid_angles(size)[row] if radiance is None else _rgb(radiance)
    return image


def studio(size: int, key: float = 20.0) -> Image:
    """Three soft boxes (warm key, cool fill, neutral rim) before a dark backdrop.

    Parameters
    ----------
    size : int
        Height of the image in pixels, at least 2.
    key : float
        Radiance of the key light, 0 to 65504. Fill (2), rim (10) and backdrop (0.02 below to
        0.1 above) stay as they are, so this sets the contrast of the lighting.

    Returns
    -------
    ndarray of float32, shape (size, 2 * size, 3)
        Linear RGB, once continuously differentiable over the sphere; fits half floats.

    Raises
    ------
    ProbeError
        If the size or the radiance is out of its range.

    Examples
    --------
    >>> float(shrm.studio(32, key=20.0).max())
    20.0
    """
    check_size(size)
    if not 0 <= key <= LARGEST_HALF:
        raise ProbeError(f"the key light's radiance {key:g} is outside 0 .. {LARGEST_HALF:g}")
    lights = [(KEY, key), (FILL, FILL_RADIANCE), (RIM, RIM_RADIANCE)]
    floor, ceiling = np.array(FLOOR_COLOR), np.array(CEILING_COLOR)

    def shade(directions: Array) -> Array:
        height = smoothstep((directions[..., 1, None] + 1) / 2)
        radiance: Array = floor + (ceiling - floor) * height
        for box, intensity in lights:
            shape = soft_box_coverage(box, directions)[..., None]
            # A box covers the backdrop behind it instead of adding to it.
            radiance = radiance + shape * (intensity * np.array(box.color) - radiance)
        return radiance

    return shade_in_bands(latlong_directions(2 * size, size), shade)


def soft_box_coverage(box: SoftBox, directions: Array) -> Array:
    """How much of a box's radiance each unit direction, shape (..., 3), sees: 0 to 1."""
    forward = from_azimuth_elevation(box.azimuth, box.elevation)
    side = from_azimuth_elevation(box.azimuth + 90, 0)
    up = from_azimuth_elevation(box.azimuth, box.elevation + 90)
    depth = directions @ forward
    coverage = (depth > 0).astype(float)
    # Behind the plane the coverage is 0 whatever the divisor, which only must not vanish.
    depth = np.where(depth > 0, depth, 1.0)
    for axis, extent in ((side, box.width), (up, box.height)):
        half = np.tan(np.radians(extent) / 2)
        distance = np.abs(directions @ axis) / (depth * half)
        coverage *= smoothstep((1 + box.edge / 2 - distance) / box.edge)
    return coverage


def smoothstep(t: Array) -> Array:
    """Cubic from 0 to 1 for `t` in [0, 1], constant outside, with no slope at either end."""
    t = np.clip(t, 0.0, 1.0)
    return t * t * (3 - 2 * t)


def shade_in_bands(directions: Array, shade: Callable[[Array], Array]) -> Image:
    """Radiance, as float32, that `shade` gives for directions of shape (rows, columns, 3)."""
    image = np.empty(directions.shape, dtype=np.float32)
    for band in slices(len(directions), BAND_ROWS):
        image[band] = shade(directions[band])
        report(band.stop, len(directions))
    return image


def latlong_texels(
    directions: ArrayLike, size: int
) -> tuple[NDArray[np.integer], NDArray[np.integer]]:
    """Row and column of the texels that contain directions.

    `directions`, of shape (..., 3), are world directions of any length but 0. `size` is the height
    of the lat-long; it is twice as wide.

    Returns `rows` and `columns`, each of shape (...).
    """
    across, down = latlong_coordinates(directions)
    columns = np.floor((across + 1) * size).astype(int)
    rows = np.floor((down + 1) * (size / 2)).astype(int)
    # Both ends of a row are the same meridian, but the last row has none below it.
    return np.minimum(rows, size - 1), columns % (2 * size)


def latlong_solid_angles(size: int) -> Array:
    """Exact solid angle (sr) of one texel of each row of a lat-long of this height.

    Returns an array of shape (size,): twice their sum times the height is 4 pi.
    """
    middles = (np.arange(size) + 0.5) * (np.pi / size)
    # cos(top) - cos(bottom) as a product: the difference loses digits at the poles.
    return 2 * np.sin(middles) * np.sin(np.pi / (2 * size)) * (np.pi / size)


def _rgb(radiance: ArrayLike) -> Array:
    """A radiance as three numbers, each within the range of float32."""
    values = np.asarray(radiance, dtype=float)
    largest = np.finfo(np.float32).max
    if values.shape not in ((), (1,), (3,)) or not ((values >= 0) & (values <= largest)).all():
        raise ProbeError(f"the radiance must be one or three numbers from 0 to {largest:.3g}")
    return np.broadcast_to(values, (3,))


def check_size(size: int) -> None:
    """Refuse a lat-long of less than two rows, or of more than files have."""
    if not hasattr(size, "__index__") or not 2 <= size <= MAX_LATLONG_HEIGHT:
        raise ProbeError(
            f"a probe of height {size!r}; give at least 2 pixels, {MAX_LATLONG_HEIGHT} at most"
        )
