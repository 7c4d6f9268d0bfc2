"""From light and BRDF to the spherical harmonic coefficients of the global reflection map.

In the local frame ``B_pq(R) = sum_lm L_lm rho_hat_lpq d^l_mq(theta) exp(i m phi)`` (eq. 5.9), and
in the global frame ``B~_ps(R) = sum_q B_pq(R) exp(-i s phi) d^p_sq(theta)`` (eq. 5.14). The product
``D^l_mq conj(D^p_sq)`` summed over q keeps only the zero column of each D^J, so that the B~_ps are
*scalar* functions of R, band-limited at exactly F + P. Both sums are done on the rings of a
Gauss-Legendre rule, Fourier mode by Fourier mode, and the rule turns them into coefficients; no
sample in phi is ever taken.

Equations 5.x are those of chapter 5 of Ramamoorthi's thesis.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from shrm_cli.sphere.harmonics import complex_from_real, degrees, legendre_table
from shrm_cli.sphere.quadrature import gauss_legendre
from shrm_cli.sphere.wigner import small_d_degrees

Array = NDArray[np.floating]
ComplexArray = NDArray[np.complexfloating]

_TABLE_BYTES = 2**27
"""The bytes that the tables and waves of a block of several rings may take."""


def reflected_coefficients(lighting: Array, brdf: Array) -> Array:
    """Compute the coefficients over R of every coefficient map of the global SHRM.

    Parameters
    ----------
    lighting : ndarray, shape (>= (F+1)^2, channels)
        The coefficients of the light over the real harmonics of world axes.
    brdf : ndarray, shape (F+1, P+1, P+1, channels)
        The coefficients rho_hat_lpq of the BRDF for q >= 0, indexed [l, p, q, channel].

    Returns
    -------
    ndarray, shape ((F+P+1)^2, (P+1)^2, channels)
        The coefficients over real harmonics of R (first index ``J (J+1) + M``) and of V (second
        index ``p (p+1) + q``), both in world axes. For P = 0 the first axis has (F+1)^2 entries.
    """
    order_f, order_p, channels = brdf.shape[0] - 1, brdf.shape[1] - 1, brdf.shape[3]
    if order_p == 0:
        # d^l_m0 is a harmonic: B~_00 = sum_lm L_lm rho_hat_l00 Lambda_l Y_lm (eq. 5.7).
        degree = degrees(order_f)
        scale = np.sqrt(4 * np.pi / (2 * degree + 1))[:, None]
        return (lighting[: len(degree)] * brdf[degree, 0, 0] * scale)[:, None]
    band = order_f + order_p
    light = complex_from_real(lighting, order_f)
    cosines, weights = gauss_legendre(band + 1)
    theta = np.arccos(cosines)
    result = np.zeros(((band + 1) ** 2, (order_p + 1) ** 2, channels))
    for rings in _blocks(len(theta), order_f, order_p):
        local = _local_modes(light, brdf, theta[rings])
        waves = _global_waves(local, theta[rings], order_p)
        _integrate(waves, legendre_table(band, cosines[rings]), weights[rings], result)
    return result


def _blocks(rings: int, order_f: int, order_p: int) -> Iterator[slice]:
    """Yield blocks of rings whose small-d values and waves stay within `_TABLE_BYTES`.

    A block has one ring at least, even if that takes more.
    """
    table = (2 * order_f + 1) * (2 * order_p + 1) * (order_f + 1)
    waves = 2 * (order_f + order_p + 1) * (order_p + 1) ** 2 * 3
    bytes_a_ring = 8 * (table + 2 * waves)
    step = max(1, _TABLE_BYTES // bytes_a_ring)
    for start in range(0, rings, step):
        yield slice(start, start + step)


def _local_modes(light: ComplexArray, brdf: Array, theta: Array) -> ComplexArray:
    """Compute ``B_pq`` on rings for each Fourier mode m (eq. 5.24).

    The result is indexed ``[q + P, m + F, ring, p, channel]``.
    """
    order_f, order_p, channels = brdf.shape[0] - 1, brdf.shape[1] - 1, brdf.shape[3]
    table = np.zeros((2 * order_p + 1, 2 * order_f + 1, len(theta), order_f + 1))
    for degree, d in small_d_degrees(order_f, theta, max_spin=order_p):
        spin = d.shape[1] // 2
        columns = slice(order_p - spin, order_p + spin + 1)
        rows = slice(order_f - degree, order_f + degree + 1)
        table[columns, rows, :, degree] = d.transpose(1, 0, 2)
    result = np.empty(
        (2 * order_p + 1, 2 * order_f + 1, len(theta), order_p + 1, channels), dtype=complex
    )
    for q in range(-order_p, order_p + 1):
        products = light.transpose(1, 0, 2)[:, :, None] * brdf[:, :, abs(q)]
        flat = products.reshape(2 * order_f + 1, order_f + 1, -1).view(float)
        modes = (table[q + order_p] @ flat).view(complex)
        result[q + order_p] = modes.reshape(result.shape[1:])
    return result


def _global_waves(local: ComplexArray, theta: Array, order_p: int) -> Array:
    """Compute the waves in phi of the real global coefficients on rings.

    Returns
    -------
    ndarray, shape (2, F+P+1, rings, (P+1)^2, channels)
        The amplitudes of ``cos(M phi)`` and ``sin(M phi)``, halved for M > 0, indexed ``[cos or
        sin, M, ring, p (p+1) + q, channel]``.
    """
    order_f, channels = local.shape[1] // 2, local.shape[-1]
    band = order_f + order_p
    waves = np.empty((2, band + 1, len(theta), (order_p + 1) ** 2, channels))
    for p, d in small_d_degrees(order_p, theta):
        spins = local[order_p - p : order_p + p + 1, :, :, p]
        for s in range(p + 1):
            turned = np.einsum("qi,qmic->mic", d[p + s], spins)
            modes = np.zeros((2 * band + 1, len(theta), channels), dtype=complex)
            first = band - order_f - s  # exp(-i s phi) shifts mode m to M = m - s
            modes[first : first + 2 * order_f + 1] = turned
            positive, negative = modes[band:], modes[band::-1]
            middle, sign = p * (p + 1), (-1.0) ** s
            if s == 0:  # the function is real, so that its modes M and -M are conjugates
                _store(waves, middle, positive, negative, 0.5)
                continue
            _store(waves, middle + s, positive, negative, sign * np.sqrt(2) / 2)
            _store(waves, middle - s, positive, negative, -sign * np.sqrt(2) / 2, imaginary=True)
    return waves


def _store(
    waves: Array,
    at: int,
    positive: ComplexArray,
    negative: ComplexArray,
    scale: float,
    imaginary: bool = False,
) -> None:
    """Store the waves of 2 `scale` times the real or imaginary part of a function.

    They are made of the function's modes M and -M for M >= 0. The amplitudes of M > 0 are stored
    halved.
    """
    if imaginary:
        waves[0, ..., at, :] = scale * (positive + negative).imag
        waves[1, ..., at, :] = scale * (positive - negative).real
    else:
        waves[0, ..., at, :] = scale * (positive + negative).real
        waves[1, ..., at, :] = -scale * (positive - negative).imag


def _integrate(waves: Array, legendre: Array, weights: Array, result: Array) -> None:
    """Add what the rings contribute to the coefficients, by integrals over the cosine of theta."""
    count = legendre.shape[0]
    flat = np.moveaxis(waves, 0, 2).reshape(count, len(weights), -1)
    sums = (legendre * weights) @ flat
    sums = sums.reshape(count, count, 2, *result.shape[1:])
    for m in range(count):
        degree = np.arange(m, count)
        middle = degree * (degree + 1)
        # The integral over phi of cos^2 or sin^2 is pi for M > 0, where the amplitudes are halved,
        # and real harmonics of M > 0 have a factor sqrt(2).
        scale = 2 * np.pi * (np.sqrt(2) if m else 1.0)
        result[middle + m] += scale * sums[m, : len(degree), 0]
        if m:
            result[middle - m] += scale * sums[m, : len(degree), 1]
