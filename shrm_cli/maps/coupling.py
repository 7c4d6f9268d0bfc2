"""From light and view functions to the coefficients over R of bundles in world axes.

It is eq. 5.9 and 5.14 of Ramamoorthi's thesis once more, for one degree p of the view. The product
of both small-d matrices is a sum over the degrees J = l - p .. l + p of one matrix each,

    d^l_mq d^p_sq = sum_J <l m p -s | J m-s> <l q p -q | J 0> (-1)^(s-q) d^J_(m-s),0.

Both signs of q together keep every other J, so that each coefficient is a sum of ``p + 1`` terms.
For a small p that takes far less time than the rings of `shrm_cli.maps.shrm.coupling`.
"""

import numpy as np
from numpy.typing import NDArray

from shrm_cli.parallel import at_once
from shrm_cli.sphere.clebsch_gordan import clebsch_gordan, zonal_coupling
from shrm_cli.sphere.harmonics import complex_from_real

Array = NDArray[np.floating]
ComplexArray = NDArray[np.complexfloating]

_LARGE = 2**17
"""The coefficients above which several threads are worth their start."""


def bundle_coefficients(lighting: Array, parts: Array) -> Array:
    """Compute the coefficients over R of the cubes of bundles of one degree.

    Parameters
    ----------
    lighting : ndarray, shape (>= (F+1)^2, channels)
        The coefficients of the light over the real harmonics of world axes.
    parts : ndarray, shape (F+1, p+1, bundles, channels)
        What each degree of the light is multiplied with, for q = 0 .. p: rho_hat_lpq.

    Returns
    -------
    ndarray, shape ((F+p+1)^2, 2p+1, bundles, channels)
        The coefficients over real harmonics of R, and of the view in world axes.
    """
    order, p = parts.shape[0] - 1, parts.shape[1] - 1
    band = order + p
    light = complex_from_real(lighting[: (order + 1) ** 2], order)
    result = np.zeros(((band + 1) ** 2, 2 * p + 1, *parts.shape[2:]))
    weights = np.einsum("lqj,lqbc->jlbc", zonal_coupling(order, p), parts)

    def add(s: int) -> None:
        modes = _modes(light, weights, s)
        if s == 0:
            _add_real(result[:, p], modes, 1.0)
        else:
            sign = (-1.0) ** s * np.sqrt(2)
            _add_real(result[:, p + s], modes, sign)
            _add_real(result[:, p - s], 1j * modes, sign)

    at_once(add, range(p + 1), result.size > _LARGE)
    return result


def _modes(light: ComplexArray, weights: Array, s: int) -> ComplexArray:
    """Return the complex coefficients of ``B~_ps`` over R, indexed [J, M + F + p, bundle, channel].

    Parameters
    ----------
    light : ndarray, shape (F+1, 2F+1, channels)
    weights : ndarray, shape (p+1, F+1, bundles, channels)
        ``sum_q (-1)^q rho_hat_lpq <l q p -q | J 0>``, indexed [j, l, ...] with ``J = l - p + 2 j``.
    s : int
        The order of the view in world axes.
    """
    order, p = weights.shape[1] - 1, weights.shape[0] - 1
    band = order + p
    result = np.zeros((band + 1, 2 * band + 1, *weights.shape[2:]), dtype=complex)
    degree, m = np.arange(order + 1), np.arange(-order, order + 1)
    for shift, each in zip(range(-p, p + 1, 2), weights, strict=True):
        low = max(0, -shift)  # the least l with a degree J >= 0
        if low > order:
            continue
        total = degree[low:] + shift
        scale = (-1.0) ** s * np.sqrt(4 * np.pi / (2 * total + 1))
        coupling = clebsch_gordan(degree[low:, None], m, p, -s, shift) * scale[:, None]
        coupled = coupling[..., None] * light[low:]
        first = band - order - s  # M = m - s
        columns = slice(max(first, 0), first + 2 * order + 1)
        result[total[0] : total[-1] + 1, columns] += coupled[:, :, None] * each[low:, None]
    return result


def _add_real(result: Array, modes: ComplexArray, scale: float) -> None:
    """Add the real harmonics' coefficients of `scale` times the real part of a function.

    Parameters
    ----------
    result : ndarray, shape ((band+1)^2, ...)
    modes : ndarray, shape (band+1, 2 band + 1, ...)
        The function's complex coefficients, indexed [J, M + band].
    """
    band = len(modes) - 1
    total = np.arange(band + 1)
    result[total * (total + 1)] += scale * modes[:, band].real
    total, order = (1 + each for each in np.tril_indices(band))  # all m = 1 .. J
    signs = ((-1.0) ** order).reshape(-1, *[1] * (modes.ndim - 2))
    positive, negative = modes[total, band + order], signs * np.conj(modes[total, band - order])
    both = scale * signs * (positive + negative) / np.sqrt(2)
    middle = total * (total + 1)
    result[middle + order] += both.real
    result[middle - order] -= both.imag
