"""Rotating the coefficients of functions on the sphere."""

import itertools
import math
import threading
from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.sphere.harmonics import degrees, order_of
from shrm_cli.sphere.wigner import right_angle_degrees, small_d_degrees

Array = NDArray[np.floating]

_CACHED_ORDER = 96


def euler_zyz(rotation: ArrayLike) -> tuple[float, float, float]:
    """Angles (a, b, c), radians, of ``rotation = Rz(a) Ry(b) Rz(c)``, a 3x3 rotation matrix."""
    r = np.asarray(rotation, dtype=float)
    alpha = np.arctan2(r[1, 2], r[0, 2])
    # With a taken out, the rows of Ry(b) Rz(c) give b and c. Near b = 0 and b = pi, where a is
    # noise, c makes up for it.
    x = np.cos(alpha) * r[0] + np.sin(alpha) * r[1]
    y = np.cos(alpha) * r[1] - np.sin(alpha) * r[0]
    return float(alpha), float(np.arctan2(x[2], r[2, 2])), float(np.arctan2(y[0], y[1]))


def transform_coefficients(coefficients: ArrayLike, matrix: ArrayLike) -> Array:
    """Coefficients of ``g(d) = f(M^-1 d)``, the function f carried along by M.

    Parameters
    ----------
    coefficients : array_like, shape ((order+1)^2, ...)
        Real coefficients of f, index l(l+1)+m.
    matrix : array_like, shape (3, 3)
        Orthogonal matrix M: a rotation, or a rotation with a mirroring.

    Returns
    -------
    ndarray, shape ((order+1)^2, ...)

    References
    ----------
    Ramamoorthi 2002, eq. 2.29: ``D^l_mn(a, b, c) = exp(-i m a) d^l_mn(b) exp(-i n c)``, here
    between real harmonics.
    """
    matrix = np.asarray(matrix, dtype=float)
    result = np.array(coefficients, dtype=float)
    order = order_of(len(result))
    m, opposite = _azimuthal_orders(order)
    if np.linalg.det(matrix) < 0:  # y -> -y comes first: the sine harmonics change sign
        matrix = matrix @ np.diag([1.0, -1.0, 1.0])
        result[m < 0] *= -1
    alpha, beta, gamma = euler_zyz(matrix)
    result = _turn_about_z(result, m, opposite, gamma)
    for at, tilt in enumerate(_tilts(order, beta)):
        rows = slice(at**2, (at + 1) ** 2)
        flat = result[rows].reshape(2 * at + 1, -1)
        result[rows] = (tilt @ flat).reshape(result[rows].shape)
    return _turn_about_z(result, m, opposite, alpha)


def turn_about_z(coefficients: ArrayLike, angle: ArrayLike) -> Array:
    """Rotate coefficients about +Z, f(phi) to f(phi - angle).

    Parameters
    ----------
    coefficients : array_like, shape ((order+1)^2, ...)
        Real coefficients, index l(l+1)+m.
    angle : array_like, broadcastable with the last axes of `coefficients`
        Radians.

    Returns
    -------
    ndarray, shape ((order+1)^2, ...)
        The last axes are those that both broadcast to.
    """
    values = np.asarray(coefficients)
    return _turn_about_z(values, *_azimuthal_orders(order_of(len(values))), np.asarray(angle))


def _azimuthal_orders(order: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """The m of every linear index, and the index of the same degree with -m."""
    degree = degrees(order)
    m = np.arange(len(degree)) - degree * (degree + 1)
    return m, degree * (degree + 1) - m


def _tilts(order: int, beta: float) -> Iterable[Array]:
    """Yield the matrices of Ry(b) between real harmonics, degree by degree."""
    if beta == np.pi / 2:  # axes are exchanged, as for every lat-long and every cube
        return _known_tilts.up_to(order) if order <= _CACHED_ORDER else _right_angle_tilts(order)
    return (_real_tilt(d, degree) for degree, d in small_d_degrees(order, beta))


def _right_angle_tilts(order: int) -> Iterator[Array]:
    """Yield the matrices of Ry(pi/2) from ``d_mn``, m, n >= 0, by ``d_m,-n = (-1)^(l+m) d_mn``.

    Cosine harmonics meet where l + m + n is even, sine harmonics where it is odd.
    """
    m = np.arange(order + 1)
    factor = np.where(m == 0, 1.0, np.sqrt(2)) * (-1.0) ** m
    weights = factor[:, None] * factor
    odd = (m[:, None] + m) % 2
    by_parity = weights * (1 - odd), weights * odd
    for degree, quadrant in enumerate(right_angle_degrees(order)):
        size = degree + 1
        cosine, sine = by_parity[degree % 2], by_parity[1 - degree % 2]
        result = np.zeros((2 * degree + 1, 2 * degree + 1))
        np.multiply(quadrant, cosine[:size, :size], out=result[degree:, degree:])
        np.multiply(
            quadrant[:0:-1, :0:-1], sine[degree:0:-1, degree:0:-1], out=result[:degree, :degree]
        )
        yield result


class _KnownTilts:
    """The matrices of `_right_angle_tilts`, which are the same for all orders; kept for good.

    Those of higher degrees are added when they are first asked for.
    """

    def __init__(self) -> None:
        self._found: list[Array] = []
        self._more = _right_angle_tilts(_CACHED_ORDER)
        self._lock = threading.Lock()

    def up_to(self, order: int) -> list[Array]:
        with self._lock:
            self._found += itertools.islice(self._more, max(order + 1 - len(self._found), 0))
        return self._found[: order + 1]


_known_tilts = _KnownTilts()


def rotate_to_frames(
    coefficients: ArrayLike, theta: ArrayLike, phi: ArrayLike, inverse: bool = False
) -> Array:
    """Turn functions of direction, in world axes, into each point's own local frame.

    Parameters
    ----------
    coefficients : array_like, shape ((order+1)^2, ..., points)
        A function of direction at each point, in world axes.
    theta, phi : array_like, shape (points,)
        Angles of the frames' z axes, radians; the frames are those of `local_frame`.
    inverse : bool
        Turn functions in the local frames into world axes instead.

    Returns
    -------
    ndarray, of the same shape

    References
    ----------
    Ramamoorthi 2002, eq. 5.13 and 5.14; the inverse is what they do.
    """
    source = np.asarray(coefficients)
    result = np.empty_like(source)
    order = order_of(len(source))
    theta, phi = np.asarray(theta, dtype=float), np.asarray(phi, dtype=float)
    # A matrix product for each point pays where it has more functions than there are points.
    few_points = theta.size < math.prod(source.shape[1:-1])
    for degree, d in small_d_degrees(order, theta if inverse else -theta):
        rows = slice(degree**2, (degree + 1) ** 2)
        tilt = _real_tilt(d, degree)
        m, opposite = np.arange(-degree, degree + 1), np.arange(2 * degree, -1, -1)
        block = source[rows] if inverse else _turn_about_z(source[rows], m, opposite, -phi)
        block = np.einsum("mnk,n...k->m...k", tilt, block, optimize=few_points)
        result[rows] = _turn_about_z(block, m, opposite, phi) if inverse else block
    return result


def _real_tilt(d: Array, degree: int) -> Array:
    """Matrix of Ry(b) between real harmonics of one degree, from the small-d matrix.

    Ry keeps the mirror symmetry in y, so cosine and sine harmonics do not mix.

    Parameters
    ----------
    d : ndarray, shape (2l+1, 2l+1, ...)
        ``d[m + l, n + l] = d^l_mn(b)``.
    degree : int
        l.

    Returns
    -------
    ndarray, of the same shape
    """
    result = np.zeros_like(d)
    c = degree
    tail = [1] * (d.ndim - 2)
    m = np.arange(1, degree + 1)
    # The signs remove the Condon-Shortley phase of the complex harmonics behind d.
    sign = (-1.0) ** (m[:, None] + m[None, :]).reshape(degree, degree, *tail)
    alternate = (-1.0) ** m.reshape(1, degree, *tail)
    plus, minus = d[c + 1 :, c + 1 :], d[c + 1 :, :c][:, ::-1]
    result[c + 1 :, c + 1 :] = sign * (plus + alternate * minus)
    result[:c, :c] = (sign * (plus - alternate * minus))[::-1, ::-1]
    result[c, c] = d[c, c]
    edge = np.sqrt(2) * (-1.0) ** m.reshape(degree, *tail)
    result[c + 1 :, c] = edge * d[c + 1 :, c]
    result[c, c + 1 :] = edge * d[c, c + 1 :]
    return result


def _turn_about_z(
    values: Array, m: NDArray[np.intp], opposite: NDArray[np.intp], angle: float | Array
) -> Array:
    """Rotate coefficients about +Z, f(phi) to f(phi - angle).

    Parameters
    ----------
    values : ndarray, shape (n, ...)
    m, opposite : ndarray of int, shape (n,)
        Azimuthal order of each coefficient, and the index of the one with -m.
    angle : float or ndarray, broadcastable to the last axes of `values`
    """
    if np.ndim(angle) == 0 and angle == 0:
        return values
    phase = m.reshape(-1, *[1] * (values.ndim - 1)) * angle
    return np.cos(phase) * values - np.sin(phase) * values[opposite]
