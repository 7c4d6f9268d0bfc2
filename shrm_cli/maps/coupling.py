"""From light and view functions to the coefficients over R of bundles in world axes.

It is eq. 5.9 and 5.14 of Ramamoorthi's thesis once more, for one degree p of the view. The product
of both small-d matrices is a sum over the degrees J = l - p .. l + p of one matrix each,

    d^l_mq d^p_sq = sum_J <l m p -s | J m-s> <l q p -q | J 0> (-1)^(s-q) d^J_(m-s),0.

Both signs of q together keep every other J, so that each coefficient is a sum of ``p + 1`` terms.
For a small p that takes far less time than the rings of `shrm_cli.maps.shrm.coupling`.
"""

import numpy as np
from numpy.typing import NDArray

from shrm_cli.memo import Memo
from shrm_cli.sphere.clebsch_gordan import clebsch_gordan, zonal_coupling
from shrm_cli.sphere.harmonics import complex_from_real

Array = NDArray[np.floating]
ComplexArray = NDArray[np.complexfloating]
Indices = NDArray[np.intp]


_known_couplings = Memo(2**24)
"""Couplings of light and view. Those of F = 40 and P = 2 take half a megabyte together."""


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
    _store(result[:, p], np.sqrt(2) * _modes(light, weights, 0), band)
    for s in range(1, p + 1):
        raised, lowered = _modes(light, weights, s), (-1.0) ** s * _modes(light, weights, -s)
        _store(result[:, p + s], raised + lowered, band)
        _store(result[:, p - s], 1j * (raised - lowered), band)
    return result


def _modes(light: ComplexArray, weights: Array, s: int) -> ComplexArray:
    """Return complex coefficients over R of ``B~_ps``, shape (J and M, bundles, channels).

    They are those of ``M = 0 .. J``, as `_places` orders them, because those of ``-M`` follow from
    those of ``-s``: the light is real.

    Parameters
    ----------
    light : ndarray, shape (F+1, 2F+1, channels)
    weights : ndarray, shape (p+1, F+1, bundles, channels)
        ``sum_q (-1)^q rho_hat_lpq <l q p -q | J 0>``, indexed [j, l, ...] with ``J = l - p + 2 j``.
    s : int
        The order of the view in world axes, of any sign.
    """
    order, p = weights.shape[1] - 1, weights.shape[0] - 1
    band = order + p
    result = np.zeros((band + 1, band + 1, *weights.shape[2:]), dtype=complex)
    first = max(0, -order - s)  # the least M = m - s
    columns = slice(first, max(order - s + 1, first))
    for shift, each in zip(range(-p, p + 1, 2), weights, strict=True):
        low = max(0, -shift)  # the least l with a degree J >= 0
        if low > order:
            continue
        coupling = _coupling(order, p, s, shift)[..., None]
        coupled = coupling * light[low:, first + s + order :]
        result[low + shift : order + shift + 1, columns] += coupled[:, :, None] * each[low:, None]
    return result.reshape(-1, *weights.shape[2:])[_places(band)[0]]


def _coupling(order: int, p: int, s: int, shift: int) -> Array:
    """Return ``(-1)^M Lambda_J <l m p -s | J M>`` with ``J = l + shift`` and ``M = m - s``.

    It is indexed [l, M], from the least l with a degree J >= 0, and for M >= 0. Those of M = 0 are
    divided by sqrt(2), because real harmonics of M > 0 have that factor.
    """

    def make() -> Array:
        degree = np.arange(max(0, -shift), order + 1)[:, None]
        m = np.arange(max(s, -order), order + 1)
        sign = np.where(m == s, np.sqrt(0.5), (-1.0) ** (m - s))
        scale = np.sqrt(4 * np.pi / (2 * (degree + shift) + 1))
        return clebsch_gordan(degree, m, p, -s, shift) * scale * sign

    return _known_couplings.get((order, p, s, shift), make)


def _store(result: Array, modes: ComplexArray, band: int) -> None:
    """Store the coefficients over real harmonics, shape ((band+1)^2, ...), of complex ones."""
    _, cosine, sine = _places(band)
    result[sine] = -modes.imag
    result[cosine] = modes.real  # last, because both are the same where M = 0


def _places(band: int) -> tuple[Indices, Indices, Indices]:
    """Return where J and M >= 0 stand: in a table [J, M], and as linear indices of M and of -M."""

    def make() -> tuple[Indices, Indices, Indices]:
        total, order = np.tril_indices(band + 1)
        middle = total * (total + 1)
        return total * (band + 1) + order, middle + order, middle - order

    return _known_couplings.get(band, make)
