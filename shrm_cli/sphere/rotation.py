"""Rotating the coefficients of functions on the sphere."""

from collections.abc import Iterator
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.sphere.wigner import small_d_degrees

Array = NDArray[np.floating]

_CACHED_ORDER = 96


def euler_zyz(rotation: ArrayLike) -> tuple[float, float, float]:
    """Angles (a, b, c), radians, of ``rotation = Rz(a) Ry(b) Rz(c)``, a 3x3 rotation matrix."""
    r = np.asarray(rotation, dtype=float)
    beta = float(np.arctan2(np.hypot(r[0, 2], r[1, 2]), r[2, 2]))
    if np.hypot(r[0, 2], r[1, 2]) < 1e-12:  # only a + c (or a - c) is defined: choose c = 0
        return float(np.arctan2(-r[0, 1], r[1, 1])), beta, 0.0
    return float(np.arctan2(r[1, 2], r[0, 2])), beta, float(np.arctan2(r[2, 1], -r[2, 0]))


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
    seeds eq. 2.29: ``D^l_mn(a, b, c) = exp(-i m a) d^l_mn(b) exp(-i n c)``, here between real
    harmonics.
    """
    source = np.asarray(coefficients, dtype=float)
    result = np.empty_like(source)
    order = int(np.sqrt(len(source))) - 1
    elements = tuple(np.asarray(matrix, dtype=float).ravel())
    blocks = _cached_blocks if order <= _CACHED_ORDER else _blocks
    for degree, block in enumerate(blocks(elements, order)):
        rows = slice(degree**2, (degree + 1) ** 2)
        flat = source[rows].reshape(2 * degree + 1, -1)
        result[rows] = (block @ flat).reshape(result[rows].shape)
    return result


def _blocks(elements: tuple[float, ...], order: int) -> Iterator[Array]:
    """The matrices that act on each degree, shape (2l+1, 2l+1)."""
    matrix = np.reshape(elements, (3, 3))
    mirrored = np.linalg.det(matrix) < 0
    if mirrored:
        matrix = matrix @ np.diag([1.0, -1.0, 1.0])
    alpha, beta, gamma = euler_zyz(matrix)
    for degree, d in small_d_degrees(order, beta):
        block = _turn_about_z(_real_tilt(d, degree), alpha)
        block = _turn_about_z(block.T, -gamma).T
        if mirrored:  # y -> -y comes first: the sine harmonics change sign
            block[:, :degree] *= -1
        yield block


@lru_cache(maxsize=4)
def _cached_blocks(elements: tuple[float, ...], order: int) -> list[Array]:
    return list(_blocks(elements, order))


def rotate_to_frames(
    coefficients: ArrayLike, theta: ArrayLike, phi: ArrayLike, inverse: bool = False
) -> Array:
    """World coefficients to each point's own local frame (eq. 5.13, 5.14 backwards).

    Parameters
    ----------
    coefficients : array_like, shape ((order+1)^2, ..., points)
        A function of direction at each point, in world axes.
    theta, phi : array_like, shape (points,)
        Angles of the frames' z axes, radians; the frames are those of `local_frame`.
    inverse : bool
        From the local frames to world axes instead.

    Returns
    -------
    ndarray, of the same shape
    """
    source = np.asarray(coefficients)
    result = np.empty_like(source)
    order = int(np.sqrt(len(source))) - 1
    theta, phi = np.asarray(theta, dtype=float), np.asarray(phi, dtype=float)
    for degree, d in small_d_degrees(order, theta if inverse else -theta):
        rows = slice(degree**2, (degree + 1) ** 2)
        tilt = _real_tilt(d, degree)
        block = source[rows] if inverse else _turn_about_z(source[rows], -phi)
        block = np.einsum("mnk,n...k->m...k", tilt, block)
        result[rows] = _turn_about_z(block, phi) if inverse else block
    return result


def _real_tilt(d: Array, degree: int) -> Array:
    """Matrix of Ry(b) between real harmonics of one degree, from the small-d matrix.

    Ry keeps the mirror symmetry in y, so cosine and sine harmonics do not mix.

    Parameters
    ----------
    d : ndarray, shape (2l+1, 2l+1, ...)
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


def _turn_about_z(rows: Array, angle: float | Array) -> Array:
    """Rotate the coefficients of one degree, (2l+1, ...), about +Z: f(phi) to f(phi - angle)."""
    if np.ndim(angle) == 0 and angle == 0:
        return rows
    degree = len(rows) // 2
    m = np.arange(-degree, degree + 1).reshape(-1, *[1] * (rows.ndim - 1))
    return np.cos(m * angle) * rows - np.sin(m * angle) * rows[::-1]
