"""What the models share: cosines, the half vector, Fresnel's term, colours, the horizon."""

from typing import NamedTuple

import numpy as np

from shrm_cli.brdf.base import Array, Color, grey

# Cosines in denominators are at least this: what diverges where light or view graze is cut there,
# 0.0006 degrees from the horizon, so that single precision does not overflow.
GRAZING = 1e-5


class Half(NamedTuple):
    """The half vector H = (L+V) / |L+V| in the frame of the normal.

    Attributes
    ----------
    x, y, z : ndarray, shape (...)
        Its components; z is the cosine N.H.
    cosine : ndarray, shape (...)
        ``L.H = V.H``, in 0 .. 1.
    """

    x: Array
    y: Array
    z: Array
    cosine: Array

    @property
    def square_sine(self) -> Array:
        """``1 - (N.H)^2``, exact for small angles too."""
        return self.x**2 + self.y**2


def half_vector(light: Array, view: Array) -> Half:
    """The half vector; the normal where light and view are opposite, and it has no direction."""
    x, y, z = (light[..., k] + view[..., k] for k in range(3))
    length = np.sqrt(x * x + y * y + z * z)
    opposite = length < GRAZING
    x, y, z = np.where(opposite, 0.0, x), np.where(opposite, 0.0, y), np.where(opposite, 1.0, z)
    divisor = np.where(opposite, 1.0, length)
    return Half(x / divisor, y / divisor, z / divisor, np.minimum(length / 2, 1.0))


def cosines(light: Array, view: Array) -> tuple[Array, Array]:
    """N.L and N.V for denominators: at least `GRAZING`, the shapes of light and view."""
    return np.maximum(light[..., 2], GRAZING), np.maximum(view[..., 2], GRAZING)


def tangential(light: Array, view: Array) -> Array:
    """``L_x V_x + L_y V_y = sin(theta_i) sin(theta_o) cos(phi)``, shape (...)."""
    return light[..., 0] * view[..., 0] + light[..., 1] * view[..., 1]


def above_horizon(value: Array, light: Array, view: Array) -> Array:
    """A value (...) where light and view are above the surface, and 0 elsewhere."""
    above = (light[..., 2] > 0) & (view[..., 2] > 0)
    return np.where(above, value, np.zeros((), value.dtype))


def colored(value: Array, color: Color) -> Array:
    """A value (...) times a colour, (..., 3); grey is a broadcast view."""
    if is_grey(color):
        return grey(value * color[0])
    return value[..., None] * np.array(color, dtype=value.dtype)


def schlick(f0: Color, cosine: Array) -> Array:
    """Schlick's approximation ``f0 + (1 - f0) (1 - L.H)^5`` of Fresnel's reflectance, (..., 3).

    References
    ----------
    Schlick 1994, An inexpensive BRDF model for physically-based rendering.
    """
    rest = fifth_power(1 - cosine)
    if is_grey(f0):
        return grey(f0[0] + (1 - f0[0]) * rest)
    base = np.array(f0, dtype=cosine.dtype)
    return base + (1 - base) * rest[..., None]


def fifth_power(value: Array) -> Array:
    """Its fifth power, without the cost of a general one."""
    square = value * value
    return square * square * value


def power(base: Array, exponent: float) -> Array:
    """``base^exponent`` where the base is positive, 0 elsewhere.

    exp and log are several times faster than a power where it vanishes.
    """
    logarithm = np.log(np.maximum(base, np.finfo(base.dtype).tiny))
    return np.where(base > 0, np.exp(exponent * logarithm), np.zeros((), base.dtype))


def is_grey(color: Color) -> bool:
    """Whether the channels of a colour are equal."""
    return color[0] == color[1] == color[2]
