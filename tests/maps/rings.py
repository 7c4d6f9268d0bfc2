"""The coefficients of global SHRMs by sums over rings, which share no coupling with the package.

Both sums, eq. 5.9 and 5.14 of Ramamoorthi's thesis, are done on the rings of a Gauss-Legendre rule,
Fourier mode by Fourier mode, and the rule turns them into coefficients. Rings come in pairs, theta
and pi - theta; and because the light is real, B_p,-q follows from B_pq.
"""

import numpy as np

from shrm_cli.arrays import slices
from shrm_cli.progress import at_once
from shrm_cli.sphere.harmonics import complex_from_real, legendre_table
from shrm_cli.sphere.quadrature import gauss_legendre
from shrm_cli.sphere.wigner import small_d_degrees

_TABLE_BYTES = 2**27
_MODES_AT_ONCE, _FUNCTIONS_AT_ONCE = 16, 128


def over_rings(lighting, brdf):
    """Compute what `coupling.reflected_coefficients` does, by integrals over rings."""
    order_f, order_p, channels = brdf.shape[0] - 1, brdf.shape[1] - 1, brdf.shape[3]
    band = order_f + order_p
    light = complex_from_real(lighting, order_f)
    pairs = band // 2 + 1
    cosines, weights = gauss_legendre(2 * pairs)
    result = np.zeros(((band + 1) ** 2, (order_p + 1) ** 2, channels))
    # For so many pairs of rings small-d values and waves stay within the bytes, or for one.
    table = (2 * order_f + 1) * (order_p + 1) * (order_f + 1)
    numbers = 2 * (band + 1) * (order_p + 1) ** 2 * 3
    step = min(max(1, _TABLE_BYTES // (8 * (table + 4 * numbers))), pairs)
    for start in range(0, pairs, step):
        one = np.arange(start, min(start + step, pairs))
        rings = np.concatenate([one, 2 * pairs - 1 - one])
        theta = np.arccos(cosines[rings])
        local = _local_modes(light, brdf, theta[: len(one)])
        waves = _global_waves(local, theta, order_p)
        _integrate(waves, legendre_table(band, cosines[rings]), weights[rings], result)
    return result


def _local_modes(light, brdf, theta):
    """Compute ``B_pq`` for each Fourier mode m (eq. 5.24) on the rings theta, then on pi - theta.

    The result is indexed ``[q + P, m + F, ring, p, channel]``.
    """
    order_f, order_p, channels = brdf.shape[0] - 1, brdf.shape[1] - 1, brdf.shape[3]
    count = len(theta)
    table = np.zeros((order_f + 1, order_p + 1, 2 * order_f + 1, count))
    for degree, d in small_d_degrees(order_f, theta, max_spin=order_p):
        spin = d.shape[1] // 2
        rows = slice(order_f - degree, order_f + degree + 1)
        table[degree, : spin + 1, rows] = d[:, spin:].transpose(1, 0, 2)
    # d^l_mq(pi - theta) = (-1)^(l+q) d^l_-mq(theta)
    mirrored = light[:, ::-1] * ((-1.0) ** np.arange(order_f + 1))[:, None, None]
    result = np.zeros(
        (2 * order_p + 1, 2 * order_f + 1, 2 * count, order_p + 1, channels), dtype=complex
    )
    both = np.stack([light, mirrored]).transpose(2, 1, 0, 3)  # [m + F, l, north or south, channel]

    def add(q):
        shape = -1, count, 2, order_p + 1 - q, channels
        for some in slices(2 * order_f + 1, _MODES_AT_ONCE):
            # Below the least of |m| and q all is zero.
            low = max(min(abs(some.start - order_f), abs(some.stop - 1 - order_f)), q)
            if some.start < order_f < some.stop:
                low = q
            products = both[some, low:, :, None] * brdf[low:, None, q:, q]
            products = products.reshape(*products.shape[:2], -1).view(float)
            modes = (table[low:, q, some].transpose(1, 2, 0) @ products).view(complex)
            north, south = np.moveaxis(modes.reshape(shape), 2, 0)
            result[order_p + q, some, :count, q:] = north
            result[order_p + q, ::-1][some, count:, q:] = (-1) ** q * south

    at_once(add, range(min(order_p, order_f) + 1))
    # The light is real, so that B_p,-q is the conjugate of B_pq, times (-1)^q.
    odd = (-1.0) ** np.arange(order_p, 0, -1)
    result[:order_p] = odd.reshape(-1, 1, 1, 1, 1) * result[:order_p:-1, ::-1].conj()
    return result


def _global_waves(local, theta, order_p):
    """Compute the waves in phi of the real global coefficients on rings.

    Returns an array of shape (2, F+P+1, rings, (P+1)^2, channels): the amplitudes of ``cos(M phi)``
    and ``sin(M phi)``, halved for M > 0, indexed ``[cos or sin, M, ring, p (p+1) + q, channel]``.
    """
    order_f, channels = local.shape[1] // 2, local.shape[-1]
    band = order_f + order_p
    waves = np.empty((2, band + 1, len(theta), (order_p + 1) ** 2, channels))

    def add(of_degree):
        p, d = of_degree
        spins = np.moveaxis(local[order_p - p : order_p + p + 1, :, :, p], 2, 0)
        flat = np.ascontiguousarray(spins).reshape(len(theta), 2 * p + 1, -1).view(float)
        turned = (np.moveaxis(d[p:], 2, 0) @ flat).view(complex)
        turned = turned.reshape(len(theta), p + 1, -1, channels).transpose(1, 2, 0, 3)
        for s in range(p + 1):
            modes = np.zeros((2 * band + 1, len(theta), channels), dtype=complex)
            first = band - order_f - s  # exp(-i s phi) shifts mode m to M = m - s
            modes[first : first + 2 * order_f + 1] = turned[s]
            positive, negative = modes[band:], modes[band::-1]
            middle, sign = p * (p + 1), (-1.0) ** s
            if s == 0:  # the function is real, so that its modes M and -M are conjugates
                _store(waves, middle, positive, negative, 0.5)
                continue
            _store(waves, middle + s, positive, negative, sign * np.sqrt(2) / 2)
            _store(waves, middle - s, positive, negative, -sign * np.sqrt(2) / 2, imaginary=True)

    at_once(add, [*small_d_degrees(order_p, theta)])
    return waves


def _store(waves, at, positive, negative, scale, imaginary=False):
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


def _integrate(waves, legendre, weights, result):
    """Add what the rings contribute to the coefficients, by integrals over the cosine of theta."""
    count = legendre.shape[0]
    weighted = legendre * weights

    def add(start):
        some = slice(start, start + _FUNCTIONS_AT_ONCE)
        flat = np.moveaxis(waves[..., some, :], 0, 2).reshape(count, len(weights), -1)
        sums = (weighted @ flat).reshape(count, count, 2, -1, result.shape[-1])
        for m in range(count):
            degree = np.arange(m, count)
            middle = degree * (degree + 1)
            # The integral over phi of cos^2 or sin^2 is pi for M > 0, where the amplitudes are
            # halved, and real harmonics of M > 0 have a factor sqrt(2).
            scale = 2 * np.pi * (np.sqrt(2) if m else 1.0)
            result[middle + m, some] += scale * sums[m, : len(degree), 0]
            if m:
                result[middle - m, some] += scale * sums[m, : len(degree), 1]

    at_once(add, range(0, result.shape[1], _FUNCTIONS_AT_ONCE))
