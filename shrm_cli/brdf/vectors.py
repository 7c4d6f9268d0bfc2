"""Functions that the models share: cosines, the half vector, Fresnel's term, colors, the horizon.

Light L and view V are unit vectors in the frame of the normal N, whose z axis is N.
"""

from collections.abc import Callable, Hashable, Sequence
from contextvars import ContextVar
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Color, Parameter, grey
from shrm_cli.sphere.directions import from_angles

Shared = TypeVar("Shared")

GRAZING = 1e-5
"""The least value of cosines in denominators.

What diverges where light or view graze is cut off there, 0.0006 degrees from the horizon, so that
single precision does not overflow.
"""
METALS: dict[str, Color] = {
    "aluminum": (0.913, 0.922, 0.924),
    "chromium": (0.549, 0.556, 0.554),
    "copper": (0.955, 0.638, 0.538),
    "gold": (1.000, 0.782, 0.344),
    "iron": (0.562, 0.565, 0.578),
    "nickel": (0.660, 0.609, 0.526),
    "platinum": (0.673, 0.637, 0.585),
    "silver": (0.972, 0.960, 0.915),
    "titanium": (0.542, 0.497, 0.449),
}
"""Reflectance at normal incidence by the name of the metal, linear RGB with sRGB's primaries.

References
----------
Akenine-Moeller et al. 2018, Real-Time Rendering, 4th edition, table 9.2.
"""
# The default is 1 because a surface that reflects little along its normal has most of its energy at
# grazing angles, in orders that a tolerance below some per cent does not reach.
NORMAL_REFLECTANCE = Parameter(
    "f0", (1.0, 1.0, 1.0), 0.0, 1.0, "reflectance at normal incidence, 0.04 for plastics",
    names=METALS,
)  # fmt: skip


class Half(NamedTuple):
    """The half vector H = (L + V) / |L + V| of many pairs of light and view."""

    x: Array
    y: Array
    z: Array
    """`x`, `y` and `z`: its components in the frame of the normal; z is the cosine N.H, shape
    (...)."""
    cosine: Array
    """``L.H = V.H``, in 0 .. 1, shape (...)."""

    @property
    def square_sine(self) -> Array:
        """``1 - (N.H)^2``, the squared sine of theta_h, which is exact for small angles too."""
        return self.x**2 + self.y**2


_found: ContextVar[dict[Hashable, tuple[Any, Any]] | None] = ContextVar(
    "shrm_cli.brdf.vectors", default=None
)


class sharing:
    """Context manager within which `shared` finds again what it has found.

    It is for the terms of a sum, which are evaluated for the same arrays of light and view. No
    array may be written to within it.
    """

    def __enter__(self) -> None:
        self._token = _found.set({}) if _found.get() is None else None

    def __exit__(self, *_: object) -> None:
        if self._token is not None:
            _found.reset(self._token)


def shared(what: Hashable, given: tuple[Any, ...], make: Callable[[], Shared]) -> Shared:
    """Return what follows from some objects, which `sharing` keeps with them.

    `what` is what is made, and the numbers that it depends on. `given` is the objects themselves,
    such as arrays of directions: equal ones are not the same.
    """
    found = _found.get()
    if found is None:
        return make()
    key = (what, *map(id, given))
    if key not in found:
        found[key] = given, make()
    return found[key][1]


def refracted_cosine(cosine: Array, ior: float) -> Array:
    """The cosine in a medium of light that has a cosine in air, by Snell's law."""
    return np.asarray(np.sqrt(1 - (1 - cosine**2) / ior**2))


def half_vector(light: Array, view: Array) -> Half:
    """Compute the half vector of light and view, shape (..., 3) each.

    Where they are opposite it has no direction, and the normal takes its place.
    """
    return shared("half", (light, view), lambda: _half_vector(light, view))


def _half_vector(light: Array, view: Array) -> Half:
    x, y, z = (light[..., k] + view[..., k] for k in range(3))
    length = np.sqrt(x * x + y * y + z * z)
    cosine, opposite = np.minimum(length / 2, 1.0), length < GRAZING
    if opposite.any():
        x, y, z = (np.where(opposite, a, b) for a, b in ((0.0, x), (0.0, y), (1.0, z)))
        length = np.where(opposite, 1.0, length)
    return Half(x / length, y / length, z / length, cosine)


def cosines(light: Array, view: Array) -> tuple[Array, Array]:
    """Compute N.L and N.V for denominators, which are `GRAZING` at least.

    Returns `light_cosine` and `view_cosine`, of the shapes of light and view without their last
    axis.
    """
    return np.maximum(light[..., 2], GRAZING), np.maximum(view[..., 2], GRAZING)


def tangential(light: Array, view: Array) -> Array:
    """Compute ``L_x V_x + L_y V_y = sin(theta_i) sin(theta_o) cos(phi)``, shape (...)."""
    return light[..., 0] * view[..., 0] + light[..., 1] * view[..., 1]


def above_horizon(value: Array, light: Array, view: Array) -> Array:
    """Set a value (...) to 0 where light or view is below the surface."""
    above = (light[..., 2] > 0) & (view[..., 2] > 0)
    return np.where(above, value, np.zeros((), value.dtype))


def colored(value: Array, color: Color) -> Array:
    """Multiply a value (...) by a color: shape (..., 3), a broadcast view if the color is grey."""
    if is_grey(color):
        return grey(value * color[0])
    return _by_channel(value, np.array(color, dtype=value.dtype))


def _by_channel(value: Array, factors: Array) -> Array:
    """Multiply a value (...) by the factor of each channel: shape (..., 3).

    Channels lie apart in memory, which takes an eighth of the time that triples do.
    """
    channels = np.empty((3, *value.shape), value.dtype)
    for k, factor in enumerate(factors):
        np.multiply(value, factor, out=channels[k, ...])
    return np.moveaxis(channels, 0, -1)


def interpolated(table: Array, row: Array, part: Array) -> Array:
    """Interpolate a table, shape (n, 3), linearly between rows: (..., 3), grey if the table is.

    `np.interp` takes several times as long, as it searches the row for each channel.

    `row`, of shape (...), are the rows to begin with, whole numbers in 0 .. n - 2. `part`, of shape
    (...), are how far from each to the next, cut to 0 .. 1; the result has their precision.
    """
    index, part = row.astype(np.intp), np.clip(part, 0, 1)
    table = table.astype(part.dtype)
    steps = np.diff(table, axis=0)
    count = 1 if (table == table[:, :1]).all() else table.shape[1]
    channels = np.empty((count, *part.shape), part.dtype)
    for k in range(count):
        np.multiply(part, steps[:, k].take(index), out=channels[k, ...])
        channels[k] += table[:, k].take(index)
    return grey(channels[0]) if count == 1 else np.moveaxis(channels, 0, -1)


def interpolated_along(
    records: Array, axes: Sequence[tuple[NDArray[np.integer], NDArray[np.integer] | int, Array]]
) -> Array:
    """Interpolate linearly along several axes between records, shape (n, channels).

    Each of `axes` has the numbers of the lower records along it, shape (...), how much higher the
    upper ones' are, and the share of these. The numbers of all axes add up to those of records.

    Returns an array of shape (..., channels).
    """
    pairs = [((low, 1 - share), (low + step, share)) for low, step, share in axes]
    corners = [*pairs[0]]
    for pair in pairs[1:]:
        corners = [(at + low, weight * part) for at, weight in corners for low, part in pair]
    share = axes[0][2]
    total = np.zeros((*share.shape, records.shape[1]), np.result_type(records, share))
    for at, weight in corners:
        total += records.take(at, axis=0) * weight[..., None]
    return total


def schlick(f0: Color, cosine: Array) -> Array:
    """Compute Schlick's approximation of Fresnel's reflectance, ``f0 + (1 - f0) (1 - L.H)^5``.

    `f0` is the reflectance at normal incidence, linear RGB. `cosine`, of shape (...), is L.H.

    Returns an array of shape (..., 3): a broadcast view if `f0` is grey.

    References: Schlick 1994, An inexpensive BRDF model for physically-based rendering.
    """
    rest = fifth_power(1 - cosine)
    if is_grey(f0):
        return grey(f0[0] + (1 - f0[0]) * rest)
    base = np.array(f0, dtype=cosine.dtype)
    result = _by_channel(rest, 1 - base)
    result += base
    return result


def fifth_power(value: Array) -> Array:
    """Raise a value to the fifth power by products, which is faster than a general power."""
    square = value * value
    return square * square * value


def power(base: Array, exponent: float) -> Array:
    """Compute ``base^exponent`` where the base is positive; elsewhere the result is 0.

    Where the result underflows, exp and log are several times faster than a power.
    """
    logarithm = np.log(np.maximum(base, np.finfo(base.dtype).tiny))
    return np.where(base > 0, np.exp(exponent * logarithm), np.zeros((), base.dtype))


def is_grey(color: Color) -> bool:
    """Whether the channels of a colour are equal."""
    return color[0] == color[1] == color[2]


def half_angles(light: Array, view: Array) -> tuple[Array, Array, Array]:
    """Compute Rusinkiewicz's half and difference angles, along which reflection lobes lie.

    `light` and `view`, each of shape (..., 3), are unit vectors in the frame of the normal, z = N.

    Returns `theta_h` of shape (...), the angle of the half vector from the normal, radians;
    `theta_d` of shape (...), the angle of the light from the half vector, radians; and `phi_d` of
    shape (...), the azimuth of the light about the half vector, radians in -pi .. pi; it is 0 on
    the side away from the normal.

    References: Rusinkiewicz 1998, "A New Change of Variables for Efficient BRDF Representation".
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
    return (np.arctan2(across, z), np.arctan2(spread, length), np.arctan2(along_phi, along_theta))


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
