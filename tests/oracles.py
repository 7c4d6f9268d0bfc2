"""Slow, independent mathematics that the tests measure the package against.

Nothing here shares code, recurrences or tables with `shrm_cli`: matrices come from generators,
harmonics from scipy, integrals from a product rule, and cube faces from the published table. The
oracles are checked against each other in `tests/sphere/test_wigner.py` and
`tests/sphere/test_harmonics.py`.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import eigh_tridiagonal, expm
from scipy.special import eval_jacobi, gammaln, sph_harm_y

Array = NDArray[np.floating]

EPS = float(np.finfo(np.float64).eps)

# These are the right, down and outward axes of each cube face, seen from inside, in the order in
# which the faces are stacked. `openexr` is faceAndPixelPosition of OpenEXR's ImfEnvmap.cpp; `gl` is
# table 8.19 of OpenGL 4.6 (sc, tc).
CUBE_FACES = {
    "openexr": (
        ((0, 0, 1), (0, -1, 0), (1, 0, 0)),
        ((0, 0, -1), (0, -1, 0), (-1, 0, 0)),
        ((1, 0, 0), (0, 0, -1), (0, 1, 0)),
        ((1, 0, 0), (0, 0, 1), (0, -1, 0)),
        ((-1, 0, 0), (0, -1, 0), (0, 0, 1)),
        ((1, 0, 0), (0, -1, 0), (0, 0, -1)),
    ),
    "gl": (
        ((0, 0, -1), (0, -1, 0), (1, 0, 0)),
        ((0, 0, 1), (0, -1, 0), (-1, 0, 0)),
        ((1, 0, 0), (0, 0, 1), (0, 1, 0)),
        ((1, 0, 0), (0, 0, -1), (0, -1, 0)),
        ((1, 0, 0), (0, -1, 0), (0, 0, 1)),
        ((-1, 0, 0), (0, -1, 0), (0, 0, -1)),
    ),
}


def tolerance(order: int) -> float:
    """Return the rounding error that `order` degrees may accumulate: ``(2l+1)^2 eps``."""
    return (2 * order + 1) ** 2 * EPS


def _raising(degree: int) -> Array:
    """Return the elements <m+1| J+ |m> of the raising operator, m = -l .. l-1."""
    m = np.arange(-degree, degree)
    return np.sqrt((degree - m) * (degree + m + 1.0))


def small_d(degree: int, theta: float) -> Array:
    """Return Wigner's d^l, [m+l, n+l], as the exponential ``exp(-i theta J_y)``."""
    plus = np.diag(_raising(degree), -1)
    return expm(-theta * (plus - plus.T) / 2)


def small_d_by_eigenvectors(degree: int, theta: ArrayLike) -> Array:
    """Return Wigner's d^l by diagonalising J_x, whose eigenvalues are the integers -l .. l.

    The result, [m+l, n+l, *theta.shape], is accurate to rounding at any degree, and cheap for
    several angles. It uses ``J_y = S J_x S^-1`` with ``S = diag((-i)^m)``.
    """
    m = np.arange(-degree, degree + 1)
    _, vectors = eigh_tridiagonal(np.zeros(len(m)), _raising(degree) / 2)
    phase = np.exp(-1j * np.multiply.outer(m, np.asarray(theta, dtype=float)))
    waves = phase.reshape(len(m), -1)
    kernel = np.stack([(vectors * wave) @ vectors.T for wave in waves.T], axis=-1)
    quarter_turns = np.array([1, -1j, -1, 1j])[(m[:, None] - m[None, :]) % 4]
    result = (quarter_turns[..., None] * kernel).real
    return result.reshape(len(m), len(m), *np.shape(theta))


def small_d_element(degree: int, m: int, n: int, theta: ArrayLike) -> Array:
    """Return one element of Wigner's d^l from a Jacobi polynomial, for 0 < theta < pi.

    The formula is that of Wikipedia, "Wigner D-matrix".
    """
    theta = np.asarray(theta, dtype=float)
    k = min(degree + n, degree - n, degree + m, degree - m)
    a, flip = {
        degree + n: (m - n, m - n),
        degree - n: (n - m, 0),
        degree + m: (n - m, 0),
        degree - m: (m - n, m - n),
    }[k]
    b = 2 * (degree - k) - a
    log_scale = (
        gammaln(2 * degree - k + 1) - gammaln(k + a + 1) - gammaln(2 * degree - 2 * k - a + 1)
    ) - (gammaln(k + b + 1) - gammaln(b + 1) - gammaln(k + 1))
    envelope = np.exp(log_scale / 2 + a * np.log(np.sin(theta / 2)) + b * np.log(np.cos(theta / 2)))
    return (-1.0) ** flip * envelope * eval_jacobi(k, a, b, np.cos(theta))


def angles(directions: ArrayLike) -> tuple[Array, Array]:
    """Return the polar angle from +Z and the azimuth of directions."""
    x, y, z = np.moveaxis(np.asarray(directions, dtype=float), -1, 0)
    return np.arctan2(np.sqrt(x * x + y * y), z), np.arctan2(y, x)


def complex_harmonic(degree: int, m: int, directions: ArrayLike) -> NDArray[np.complexfloating]:
    """Return Y_lm with the Condon-Shortley phase.

    The function of scipy >= 1.15 takes (l, m, polar angle, azimuth).
    """
    theta, phi = angles(directions)
    return sph_harm_y(degree, m, theta, phi)


def real_harmonics(order: int, directions: ArrayLike) -> Array:
    """Return real harmonics without the Condon-Shortley phase, shape (..., (order+1)^2)."""
    columns = []
    for degree in range(order + 1):
        for m in range(-degree, degree + 1):
            value = complex_harmonic(degree, abs(m), directions)
            if m == 0:
                columns.append(value.real)
            else:
                part = value.real if m > 0 else value.imag
                columns.append(np.sqrt(2) * (-1) ** m * part)
    return np.stack(columns, axis=-1)


def sphere_rule(degree: int) -> tuple[Array, Array]:
    """Return directions (n, 3) and weights (n,) that are exact for polynomials up to `degree`.

    The rule is Gauss-Legendre in z times the trapezoid rule in azimuth.
    """
    z, z_weights = np.polynomial.legendre.leggauss(degree // 2 + 1)
    count = degree + 1
    phi = 2 * np.pi * (np.arange(count) + 0.25) / count
    sine = np.sqrt(1 - z * z)
    directions = np.stack(
        [
            np.multiply.outer(sine, np.cos(phi)),
            np.multiply.outer(sine, np.sin(phi)),
            np.broadcast_to(z[:, None], (len(z), count)),
        ],
        axis=-1,
    )
    weights = np.repeat(z_weights * (2 * np.pi / count), count)
    return directions.reshape(-1, 3), weights


def project(function: Callable[[Array], Array], order: int, degree: int) -> Array:
    """Integrate the real coefficients up to `order` of a polynomial of `degree`."""
    directions, weights = sphere_rule(order + degree)
    return real_harmonics(order, directions).T @ (weights * function(directions))


def disc_rule(direction: Array, radius: float, count: int = 16) -> tuple[Array, Array]:
    """Return directions (n, 3) and weights (n,) for integrals within an angle of a direction.

    Gauss in the cosine times evenly spaced azimuths.
    """
    nodes, weights = np.polynomial.legendre.leggauss(count)
    span = 2 * np.sin(radius / 2) ** 2  # 1 - cos(radius), with all digits
    below = (nodes + 1) / 2 * span
    cosine, sine = 1 - below, np.sqrt(below * (2 - below))
    phi = np.pi * np.arange(2 * count) / count
    side = np.cross(direction, np.eye(3)[np.argmin(np.abs(direction))])
    side /= np.linalg.norm(side)
    frame = np.stack([side, np.cross(direction, side), direction])
    local = np.stack(
        [np.outer(sine, np.cos(phi)), np.outer(sine, np.sin(phi)), np.outer(cosine, 1 + 0 * phi)],
        axis=-1,
    )
    areas = np.outer(weights / 2 * span, np.full(len(phi), np.pi / count))
    return (local @ frame).reshape(-1, 3), areas.ravel()


def random_directions(rng: np.random.Generator, *shape: int) -> Array:
    """Return uniformly distributed unit vectors, shape (*shape, 3)."""
    vectors = rng.standard_normal((*shape, 3))
    return vectors / np.sqrt(np.sum(vectors**2, axis=-1, keepdims=True))


def random_rotation(rng: np.random.Generator, mirrored: bool = False) -> Array:
    """Return a uniformly distributed rotation matrix, or if mirrored one of determinant -1."""
    q, r = np.linalg.qr(rng.standard_normal((3, 3)))
    q = q * np.sign(np.diag(r))
    return q if (np.linalg.det(q) < 0) == mirrored else -q


def turn(axis: str, angle: float) -> Array:
    """Return a rotation about a world axis, counter-clockwise as seen from the axis' tip."""
    cosine, sine = np.cos(angle), np.sin(angle)
    k = "xyz".index(axis)
    i, j = (k + 1) % 3, (k + 2) % 3
    matrix = np.zeros((3, 3))
    matrix[k, k] = 1
    matrix[i, i] = matrix[j, j] = cosine
    matrix[j, i], matrix[i, j] = sine, -sine
    return matrix


def positions(size: int, sampling: str) -> list[float]:
    """Return the positions of samples along one axis in [-1, 1], each computed by itself."""
    if sampling == "center":
        return [-1 + (i + 0.5) * (2 / size) for i in range(size)]
    return [0.0] if size == 1 else [-1 + 2 * i / (size - 1) for i in range(size)]


def cube_texels(size: int, sampling: str = "center", orientation: str = "openexr") -> Array:
    """Return the unit directions of a cube's texels, shape (6, size, size, 3)."""
    result = np.empty((6, size, size, 3))
    at = np.array(positions(size, sampling))
    columns, rows = at[None, :, None], at[:, None, None]
    for face, axes in enumerate(CUBE_FACES[orientation]):
        right, down, forward = map(np.array, axes)
        points = forward + columns * right + rows * down
        result[face] = points / np.linalg.norm(points, axis=-1, keepdims=True)
    return result


def latlong_pixels(width: int, height: int, sampling: str = "center") -> Array:
    """Return the directions of a lat-long's pixels, shape (height, width, 3).

    The formulae are those of OpenEXR's ImfEnvmap.cpp.
    """
    latitude = -np.pi / 2 * np.array(positions(height, sampling))[:, None]
    longitude = -np.pi * np.array(positions(width, sampling))[None, :]
    return np.stack(
        [
            np.sin(longitude) * np.cos(latitude),
            np.sin(latitude) + 0 * longitude,
            np.cos(longitude) * np.cos(latitude),
        ],
        axis=-1,
    )


def real_from_alm(alm: NDArray[np.complexfloating], order: int) -> Array:
    """Convert healpy's a_lm (m-major, m >= 0, Condon-Shortley phase) to real coefficients."""
    result = np.zeros((order + 1) ** 2)
    k = 0
    for m in range(order + 1):
        for degree in range(m, order + 1):
            value = alm[k]
            k += 1
            centre = degree * (degree + 1)
            if m == 0:
                result[centre] = value.real
            else:
                result[centre + m] = np.sqrt(2) * (-1) ** m * value.real
                result[centre - m] = -np.sqrt(2) * (-1) ** m * value.imag
    return result


def alm_from_real(coefficients: Array, order: int) -> NDArray[np.complexfloating]:
    """Convert real coefficients to healpy's a_lm (m-major, m >= 0, Condon-Shortley phase)."""
    result = []
    for m in range(order + 1):
        for degree in range(m, order + 1):
            centre = degree * (degree + 1)
            if m == 0:
                result.append(complex(coefficients[centre]))
            else:
                pair = coefficients[centre + m] - 1j * coefficients[centre - m]
                result.append((-1) ** m * pair / np.sqrt(2))
    return np.array(result, dtype=np.complex128)
