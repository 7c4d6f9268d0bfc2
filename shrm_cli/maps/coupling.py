"""From light and BRDF to the spherical harmonic coefficients over R of the global reflection map.

In the local frame ``B_pq(R) = sum_lm L_lm rho_hat_lpq d^l_mq(theta) exp(i m phi)`` (eq. 5.9), and
in the global frame ``B~_ps(R) = sum_q B_pq(R) exp(-i s phi) d^p_sq(theta)`` (eq. 5.14). The product
``D^l_mq conj(D^p_sq)`` summed over q keeps only the zero column of each D^J, so that the B~_ps are
*scalar* functions of R, band-limited at exactly F + P.

Coefficients are found degree by degree of the view. The product of both small-d matrices is a sum
over the degrees J = l - p .. l + p of one matrix each,

    d^l_mq d^p_sq = sum_J <l m p -s | J m-s> <l q p -q | J 0> (-1)^(s-q) d^J_(m-s),0.

Both signs of q together keep every other J, so that each coefficient is a sum of ``p + 1`` terms.

Equations 5.x are those of chapter 5 of Ramamoorthi's thesis.
"""

import numpy as np

from shrm_cli import progress
from shrm_cli.arrays import Array, Indices, Memo, kept_order, slices
from shrm_cli.progress import in_order
from shrm_cli.records import record
from shrm_cli.sphere.harmonics import complex_from_real, degrees
from shrm_cli.sphere.wigner import clebsch_gordan, zonal_coupling

_known_tables = Memo(2**25)
"""What couples light and view. All p to P = 2 take 0.3 MB together for F = 40, and all to P = 8
20 MB for F = 96."""

_LARGE = 2**17
"""The coefficients above which several threads are worth their start."""
_COUPLINGS_AT_ONCE = 2**16
"""Numbers of a table that are made together, so that they stay in the processor's cache."""


def bundle_coefficients(lighting: Array, parts: Array) -> Array:
    """Compute the coefficients over R of the cubes of bundles of one degree.

    `lighting`, of shape (>= (F+1)^2, channels), holds the coefficients of the light over the real
    harmonics of world axes. `parts`, of shape (F+1, p+1, bundles, channels), are what each degree
    of the light is multiplied with, for q = 0 .. p: rho_hat_lpq.

    Returns an array of shape ((F+p+1)^2, 2p+1, bundles, channels): the coefficients over real
    harmonics of R, and of the view in world axes.
    """
    return coupled(separated(lighting, parts.shape[0] - 1), parts)


def separated(lighting: Array, order: int) -> Array:
    """Return the light as `coupled` takes it for all degrees of the view.

    Returns an array of shape (channels, 2, n): the real and imaginary parts of the coefficients
    over complex harmonics [l, m + order], to the `kept_order`; 0 beyond the order. They are only
    multiplied with real numbers.
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
    """

    light: Indices
    """Where ``l, m = M`` stands in a table [l, m + F]; ``m = M + s`` is s places behind it, shape
    (p+1, n)."""
    couplings: Array
    """For s = -p .. p: ``(-1)^M Lambda_J <l m p -s | J M>``, shape (2p+1, p+1, n). Those of M = 0
    are divided by sqrt(2), because real harmonics of M > 0 have that factor. They are 0 where there
    is no such l or m."""
    degrees: Indices
    """The degrees l, shape (p+1, n)."""
    cosine: Indices
    sine: Indices
    """`cosine` and `sine`: the linear indices of M and of -M, shape (n,)."""


def _make_table(order: int, p: int) -> _Table:
    total, over = np.tril_indices(order + p + 1)
    scale = np.where(over == 0, np.sqrt(0.5), (-1.0) ** over)
    scale *= np.sqrt(4 * np.pi / (2 * total + 1))
    shifts = np.arange(-p, p + 1, 2)
    degrees = np.clip(total - shifts[:, None], 0, order)
    light = degrees * (2 * order + 1) + over + order
    couplings = np.empty((2 * p + 1, *degrees.shape))
    for some in slices(len(total), _COUPLINGS_AT_ONCE // couplings[..., 0].size):
        low = total[some] - shifts[:, None]
        found = clebsch_gordan(low, over[some], p, total[some]) * scale[some]
        couplings[..., some] = np.where(low == degrees[:, some], found, 0.0)
    middle = total * (total + 1)
    return _Table(light, couplings, degrees, middle + over, middle - over)


def reflected_coefficients(lighting: Array, brdf: Array) -> Array:
    """Compute the coefficients over R of every coefficient map of the global SHRM.

    `brdf`, of shape (F+1, P+1, P+1, channels), is the coefficients rho_hat_lpq of the BRDF for q >=
    0, indexed [l, p, q, channel].

    Returns an array of shape ((F+P+1)^2, (P+1)^2, channels): the coefficients over real harmonics
    of R (first index ``J (J+1) + M``) and of V (second index ``p (p+1) + q``), both in world axes.
    For P = 0 the first axis has (F+1)^2 entries.
    """
    order_f, order_p, channels = brdf.shape[0] - 1, brdf.shape[1] - 1, brdf.shape[3]
    if order_p == 0:
        # d^l_m0 is a harmonic: B~_00 = sum_lm L_lm rho_hat_l00 Lambda_l Y_lm (eq. 5.7).
        degree = degrees(order_f)
        scale = np.sqrt(4 * np.pi / (2 * degree + 1))[:, None]
        return (lighting[: len(degree)] * brdf[degree, 0, 0] * scale)[:, None]
    result = np.zeros(((order_f + order_p + 1) ** 2, (order_p + 1) ** 2, channels))
    separate = separated(lighting, order_f)
    for p in range(order_p + 1):
        found = coupled(separate, brdf[:, p, : p + 1, None])
        result[: len(found), p**2 : (p + 1) ** 2] = found[:, :, 0]
        progress.report((p + 1) ** 3, (order_p + 1) ** 3)
    return result
