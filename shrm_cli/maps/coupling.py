"""From light and BRDF to the spherical harmonic coefficients over R of the global reflection map.

In the local frame ``B_pq(R) = sum_lm L_lm rho_hat_lpq d^l_mq(theta) exp(i m phi)`` (eq. 5.9), and
in the global frame ``B~_ps(R) = sum_q B_pq(R) exp(-i s phi) d^p_sq(theta)`` (eq. 5.14). The product
``D^l_mq conj(D^p_sq)`` summed over q keeps only the zero column of each D^J, so that the B~_ps are
*scalar* functions of R, band-limited at exactly F + P.

For a small P, coefficients are found degree by degree of the view. The product of both small-d
matrices is a sum over the degrees J = l - p .. l + p of one matrix each,

    d^l_mq d^p_sq = sum_J <l m p -s | J m-s> <l q p -q | J 0> (-1)^(s-q) d^J_(m-s),0.

Both signs of q together keep every other J, so that each coefficient is a sum of ``p + 1`` terms.
For a large P, both sums are done on the rings of a Gauss-Legendre rule, Fourier mode by Fourier
mode, and the rule turns them into coefficients; no sample in phi is ever taken. Rings come in
pairs, theta and pi - theta, which share a table of the small-d functions; and because the light is
real, B_p,-q follows from B_pq.

Equations 5.x are those of chapter 5 of Ramamoorthi's thesis.
"""

import numpy as np
from numpy.typing import NDArray

from shrm_cli import progress
from shrm_cli.arrays import Array, Indices, Memo, kept_order, slices
from shrm_cli.progress import at_once, in_order
from shrm_cli.records import record
from shrm_cli.sphere.harmonics import complex_from_real, degrees, legendre_table
from shrm_cli.sphere.quadrature import gauss_legendre
from shrm_cli.sphere.wigner import clebsch_gordan, small_d_degrees, zonal_coupling

_known_tables = Memo(2**25)
"""What couples light and view. All p to P = 2 take 0.3 MB together for F = 40, and all to P = 8
20 MB for F = 96."""

_LARGE = 2**17
"""The coefficients above which several threads are worth their start."""


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


ComplexArray = NDArray[np.complexfloating]

_BY_DEGREE = 8
"""The largest order P for which coefficients are found degree by degree. That takes F^2 P^3 steps,
and F^3 P^2 steps over rings, but those are matrix products."""
_TABLE_BYTES = 2**27
"""The bytes that the tables and waves of a block of several rings may take."""
_MODES_AT_ONCE, _FUNCTIONS_AT_ONCE = 16, 128
"""The Fourier modes, and the coefficients of the view, for which products are made together."""
_LARGE_RINGS = 2**18
"""The numbers in an array above which several threads are worth their start."""
_LEAST_BLOCKS = 8
"""The least number of blocks, so that progress is seen."""


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
    if order_p > _BY_DEGREE:
        return over_rings(lighting, brdf)
    result = np.zeros(((order_f + order_p + 1) ** 2, (order_p + 1) ** 2, channels))
    separate = separated(lighting, order_f)
    for p in range(order_p + 1):
        found = coupled(separate, brdf[:, p, : p + 1, None])
        result[: len(found), p**2 : (p + 1) ** 2] = found[:, :, 0]
        progress.report((p + 1) ** 3, (order_p + 1) ** 3)
    return result


def over_rings(lighting: Array, brdf: Array) -> Array:
    """Compute what `reflected_coefficients` describes by integrals over rings."""
    order_f, order_p, channels = brdf.shape[0] - 1, brdf.shape[1] - 1, brdf.shape[3]
    band = order_f + order_p
    light = complex_from_real(lighting, order_f)
    pairs = band // 2 + 1
    cosines, weights = gauss_legendre(2 * pairs)
    result = np.zeros(((band + 1) ** 2, (order_p + 1) ** 2, channels))
    # For so many pairs of rings small-d values and waves stay within the bytes, or for one.
    table = (2 * order_f + 1) * (order_p + 1) * (order_f + 1)
    numbers = 2 * (band + 1) * (order_p + 1) ** 2 * 3
    at_once = max(1, _TABLE_BYTES // (8 * (table + 4 * numbers)))
    step = min(at_once, -(-pairs // _LEAST_BLOCKS))
    for start in range(0, pairs, step):
        one = np.arange(start, min(start + step, pairs))
        rings = np.concatenate([one, 2 * pairs - 1 - one])
        theta = np.arccos(cosines[rings])
        local = _local_modes(light, brdf, theta[: len(one)])
        waves = _global_waves(local, theta, order_p)
        _integrate(waves, legendre_table(band, cosines[rings]), weights[rings], result)
        progress.report(int(one[-1]) + 1, pairs)
    return result


def _local_modes(light: ComplexArray, brdf: Array, theta: Array) -> ComplexArray:
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

    def add(q: int) -> None:
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

    at_once(add, range(min(order_p, order_f) + 1), result.size > _LARGE_RINGS)
    # The light is real, so that B_p,-q is the conjugate of B_pq, times (-1)^q.
    odd = (-1.0) ** np.arange(order_p, 0, -1)
    result[:order_p] = odd.reshape(-1, 1, 1, 1, 1) * result[:order_p:-1, ::-1].conj()
    return result


def _global_waves(local: ComplexArray, theta: Array, order_p: int) -> Array:
    """Compute the waves in phi of the real global coefficients on rings.

    Returns an array of shape (2, F+P+1, rings, (P+1)^2, channels): the amplitudes of ``cos(M phi)``
    and ``sin(M phi)``, halved for M > 0, indexed ``[cos or sin, M, ring, p (p+1) + q, channel]``.
    """
    order_f, channels = local.shape[1] // 2, local.shape[-1]
    band = order_f + order_p
    waves = np.empty((2, band + 1, len(theta), (order_p + 1) ** 2, channels))

    def add(of_degree: tuple[int, Array]) -> None:
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

    at_once(add, [*small_d_degrees(order_p, theta)], waves.size > _LARGE_RINGS)
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
    weighted = legendre * weights

    def add(start: int) -> None:
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

    at_once(add, range(0, result.shape[1], _FUNCTIONS_AT_ONCE), result.size > _LARGE_RINGS)
