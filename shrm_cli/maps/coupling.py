"""From light and view functions to the coefficients over R of bundles in world axes.

It is eq. 5.9 and 5.14 of Ramamoorthi's thesis once more, for one degree p of the view. The product
of both small-d matrices is a sum over the degrees J = l - p .. l + p of one matrix each,

    d^l_mq d^p_sq = sum_J <l m p -s | J m-s> <l q p -q | J 0> (-1)^(s-q) d^J_(m-s),0.

Both signs of q together keep every other J, so that each coefficient is a sum of ``p + 1`` terms.
For a small p that takes far less time than the rings of `shrm_cli.maps.shrm.coupling`.
"""

import numpy as np

from shrm_cli.arrays import Array, Indices
from shrm_cli.memo import Memo, kept_order
from shrm_cli.parallel import in_order
from shrm_cli.records import record
from shrm_cli.sphere.harmonics import complex_from_real
from shrm_cli.sphere.wigner import clebsch_gordan, zonal_coupling

_known_tables = Memo(2**25)
"""What couples light and view. All p to P = 2 take 0.3 MB together for F = 40, and all to P = 8
20 MB for F = 96."""

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
    return coupled(separated(lighting, parts.shape[0] - 1), parts)


def separated(lighting: Array, order: int) -> Array:
    """Return the light as `coupled` takes it for all degrees of the view.

    Returns
    -------
    ndarray, shape (channels, 2, n)
        The real and imaginary parts of the coefficients over complex harmonics [l, m + order], to
        the `kept_order`; 0 beyond the order. They are only multiplied with real numbers.
    """
    kept, count = kept_order(order), (order + 1) ** 2
    padded = np.zeros(((kept + 1) ** 2, lighting.shape[1]))
    padded[:count] = lighting[:count]
    light = complex_from_real(padded, kept)
    light = light.reshape(-1, lighting.shape[1])
    return np.stack([light.real.T, light.imag.T], axis=1)


def coupled(separate: Array, parts: Array) -> Array:
    """Compute what `bundle_coefficients` does, of light that is `separated` to exactly F."""
    order, p = parts.shape[0] - 1, parts.shape[1] - 1
    kept, count = kept_order(order), (order + p + 1) * (order + p + 2) // 2
    table = _known_tables.get((kept, p), lambda: _make_table(kept, p))
    factors = np.zeros((*parts.shape[2:], p + 1, kept + 1))
    factors[..., : order + 1] = np.einsum("lqj,lqbc->bcjl", zonal_coupling(order, p), parts)
    weights = [
        factors[:, :, j, degrees[:count]][:, :, None] for j, degrees in enumerate(table.degrees)
    ]

    def mode(s: int) -> Array:
        # Where there is no such m, the coupling is 0, and the index that of anything.
        light = separate.take(table.light[:, :count] + s, axis=-1, mode="clip")
        light *= table.couplings[p + s, :, :count]
        total = weights[0] * light[:, :, 0]
        for j in range(1, p + 1):
            total += weights[j] * light[:, :, j]
        return total

    modes = list(in_order(mode, range(-p, p + 1), factors.size * count * p > _LARGE * (kept + 1)))
    # Real and imaginary parts are [spin, bundle, channel, n], which are sorted once at the end.
    real = np.empty((2 * p + 1, *parts.shape[2:], count))
    imaginary = np.empty_like(real)
    real[p], imaginary[p] = _halves(np.sqrt(2) * modes[p])
    for s in range(1, p + 1):
        raised, lowered = modes[p + s], (-1.0) ** s * modes[p - s]
        real[p + s], imaginary[p + s] = _halves(raised + lowered)
        # That of -s is the difference, times the imaginary unit.
        imaginary[p - s], real[p - s] = _halves(raised - lowered)
        real[p - s] *= -1
    result = np.empty(((order + p + 1) ** 2, *real.shape[:-1]))
    result[table.sine[:count]] = -np.moveaxis(imaginary, -1, 0)
    # They come last, because both are the same where M = 0.
    result[table.cosine[:count]] = np.moveaxis(real, -1, 0)
    return result


def _halves(mode: Array) -> Array:
    """Return the real and the imaginary parts of a mode, shape (2, bundles, channels, n)."""
    return np.moveaxis(mode, 2, 0)


@record(eq=False)
class _Table:
    """What couples light of all degrees l with the degree p of the view to coefficients over R.

    By n are numbered all J and ``M = 0 .. J``. The coefficients of ``-M`` follow from those of
    ``-s``, because the light is real. By j are numbered the degrees ``l = J + p - 2 j`` that J is
    coupled from.

    Attributes
    ----------
    light : ndarray of int, shape (p+1, n)
        Where ``l, m = M`` stands in a table [l, m + F]; ``m = M + s`` is s places behind it.
    couplings : ndarray, shape (2p+1, p+1, n)
        For s = -p .. p: ``(-1)^M Lambda_J <l m p -s | J M>``. Those of M = 0 are divided by
        sqrt(2), because real harmonics of M > 0 have that factor. They are 0 where there is no
        such l or m.
    degrees : ndarray of int, shape (p+1, n)
        The degrees l.
    cosine, sine : ndarray of int, shape (n,)
        The linear indices of M and of -M.
    """

    light: Indices
    couplings: Array
    degrees: Indices
    cosine: Indices
    sine: Indices


def _make_table(order: int, p: int) -> _Table:
    total, over = np.tril_indices(order + p + 1)
    scale = np.where(over == 0, np.sqrt(0.5), (-1.0) ** over)
    scale *= np.sqrt(4 * np.pi / (2 * total + 1))
    shifts, spins = range(-p, p + 1, 2), range(-p, p + 1)
    degrees = np.array([np.clip(total - shift, 0, order) for shift in shifts])
    light = degrees * (2 * order + 1) + over + order
    couplings = np.empty((len(spins), *degrees.shape))
    for row, s in enumerate(spins):
        m = over + s
        for j, shift in enumerate(shifts):
            known = (abs(m) <= order) & (degrees[j] == total - shift)
            coupling = clebsch_gordan(degrees[j], m, p, -s, shift)
            couplings[row, j] = np.where(known, coupling * scale, 0.0)
    middle = total * (total + 1)
    return _Table(light, couplings, degrees, middle + over, middle - over)
