"""The energy of the reflected light, degree by degree: errors of orders, and how far they show.

By Parseval, the integral of ``|B|^2`` over all central directions and views is
``sum_lmpq |L_lm|^2 |rho_hat_lpq|^2 4 pi / (2l+1)``. The coefficients of light and BRDF therefore
tell the error of leaving some of them out, without integrating anything. About the mirror direction
this measure is that of the pixels of spheres, seen in parallel projection from all sides.

Equations and sections 5.x are those of chapter 5 of Ramamoorthi's thesis.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from shrm_cli.arrays import Array, relative_rms
from shrm_cli.brdf.coefficients import BrdfCoefficients, energy_above
from shrm_cli.probe.lighting import Lighting
from shrm_cli.sphere.bilinear import bilinear_errors, detail_places
from shrm_cli.sphere.wigner import zonal_coupling
from shrm_cli.vocabulary import Sampling

if TYPE_CHECKING:
    from shrm_cli.brdf.transfer import TransferFunctions

_LAST_DEGREES = 16
"""The number of the light's last known degrees whose mean density the unknown degrees take."""
_PLACES_ORDER = 24
"""The largest order of the light that tells where its details are."""
INVISIBLE = 1e-4
"""The RMS of a part of the reflected light, relative to the light's mean, that is never seen. It is
half a per cent of the darkest places that `shrm compare` judges, those of 2 % of the mean."""


def predicted_error(
    lighting: Lighting,
    coefficients: BrdfCoefficients,
    order_f: int,
    order_p: int,
    factors: Array | None = None,
) -> float:
    """Predict the relative RMS error of the reflected light, over all R and V; 0 if black.

    R is the central direction. Sums over normals instead of mirror directions weigh grazing views
    more, and come out about twice as large for the same map.

    The error is the square root of the ratio of the terms with l > F or p > P to the whole sum.
    Energy of the BRDF beyond its coefficients counts too; see `energy_beyond`.

    `lighting` is the light, to at least the order of the coefficients. `coefficients` are the
    coefficients of the BRDF, to orders above F and P. `order_f` and `order_p` are the largest l and
    p that are kept. `factors`, of shape (order_f + 1, order_p + 1), are what the map multiplies
    each l <= F and p <= P with; 1 by default.
    """
    light = weighted_power(lighting, coefficients.order_f)
    whole = np.sum(light * coefficients.degree_energy) + energy_beyond(lighting, coefficients)
    kept = np.sum(light[: order_f + 1] * _kept(coefficients, order_f, order_p, factors))
    return relative_rms(max(whole - kept, 0.0), whole)


def kept_energy(factors: Array) -> Array:
    """Return the part of an energy that is no error where amplitudes are multiplied by factors."""
    return np.asarray(1 - (1 - factors) ** 2)


def reflected_rms(lighting: Lighting, coefficients: BrdfCoefficients | TransferFunctions) -> float:
    """Return the root of the integral of the squared reflected light, by Parseval.

    The integral is over all orientations, views and channels, and counts the energy beyond the
    coefficients; see `energy_beyond`.
    """
    light = weighted_power(lighting, coefficients.order_f)
    known = np.sum(light * coefficients.degree_energy)
    return float(np.sqrt(known + energy_beyond(lighting, coefficients)))


def energy_beyond(lighting: Lighting, coefficients: BrdfCoefficients | TransferFunctions) -> float:
    """Return the sum of both `energies_beyond`."""
    return sum(energies_beyond(lighting, coefficients))


def energies_beyond(
    lighting: Lighting, coefficients: BrdfCoefficients | TransferFunctions
) -> tuple[float, float]:
    """Estimate the energy of the reflected light beyond the coefficients of the BRDF.

    The BRDF's own energy there is known, because its whole energy is. What lies at higher degrees
    than the known ones follows from how the known ones fall. Known are the degrees of the BRDF that
    are no finer than the light's pixels. The light that it meets is estimated twice, and the
    smaller one counts: the light goes on as a small lamp's does, with ``(2l+1)`` times the mean
    power of its last known degrees, up to the degree where its energy is used up; or all energy of
    the light that is left sits in the first unknown degree, as in eq. 5.19. The rest has higher
    azimuthal orders than the known ones, which glossy lobes have at grazing views, and lies at
    known degrees of the light.

    Returns `above` and `aside`, what lies at higher degrees, and at higher azimuthal orders of
    known degrees. In the units of ``|B|^2``, integrated over orientations and views, all channels
    together.
    """
    order = coefficients.order_f
    above, aside = own_energies_beyond(coefficients)
    light, spread = weighted_power(lighting, order), coefficients.spread
    known = min(order, lighting.resolved_order) + 1
    above = above + coefficients.degree_energy[known:].sum(axis=0)
    density = light[max(known - _LAST_DEGREES, 0) : known].mean(axis=0)
    light_left = np.maximum(lighting.energy - lighting.power()[:known].sum(axis=0), 0.0)
    met = density * _lit_share(coefficients.degree_energy[:known], above, density, light_left)
    met = np.minimum(met, _convolution_measure(known)[-1] * light_left)
    beside = np.sum(light * spread, axis=0) / np.maximum(spread.sum(axis=0), 1e-300)
    return float(np.sum(met * above)), float(np.sum(beside * aside))


def _lit_share(known: Array, above: Array, density: Array, light_left: Array) -> Array:
    """Return the part of a BRDF's energy at unknown degrees that light of a density lights.

    Light of the power ``density (2l+1) / 4 pi`` in each degree l ends where its energy does. The
    energy of the BRDF falls by the same ratio from octave to octave, as its last known octave and
    the whole of the unknown ones tell.

    `known`, of shape (F+1, 3), is the energy of the BRDF at each known degree. `above`, of shape
    (3,), is that of all unknown degrees. `density`, of shape (3,), is ``4 pi / (2l+1)`` times the
    power of the light in an unknown degree l. `light_left`, of shape (3,), is the energy of the
    light at unknown degrees.
    """
    first = len(known)
    # The least density is relative to the light, which may be of any brightness.
    least = np.maximum(1e-200 * light_left, 1e-300)
    squares = 4 * np.pi * light_left / np.maximum(density, least) / first**2
    octaves = np.log2(1 + squares) / 2
    last = known[first // 2 :].sum(axis=0)
    ratio = above / np.maximum(above + last, 1e-300)
    return np.asarray(1 - ratio**octaves)


def own_energies_beyond(coefficients: BrdfCoefficients | TransferFunctions) -> tuple[Array, Array]:
    """Estimate the BRDF's own energy beyond its coefficients.

    Returns `above` and `aside`, each of shape (3,), what lies at higher degrees, and at higher
    azimuthal orders of known degrees.
    """
    known = coefficients.degree_energy
    rest = np.maximum(coefficients.total_energy - known.sum(axis=0), 0.0)
    if isinstance(coefficients, BrdfCoefficients):
        above = coefficients.energy_above
    else:
        above = energy_above(known)
    above = np.minimum(rest, above)
    above = np.where(coefficients.spread.any(axis=0), above, rest)
    return above, rest - above


def last_visible(beyond: Array) -> int:
    """Return the first order after which nothing is visible, of what `visible_beyond` returns."""
    return int(np.argmin(beyond > INVISIBLE))


def visible_beyond(
    lighting: Lighting, coefficients: BrdfCoefficients, order_p: int | None = None
) -> Array:
    """Return what truncation after each order l leaves out, relative to the mean reflected light.

    It is the RMS over all orientations and views of the known terms with p <= P beyond l, in the
    channel where it is largest relative to the channel's mean. The last entry is 0.

    `order_p` is the order P of the map; every p by default.

    Returns an array of shape (coefficients.order_f + 1,).
    """
    order = coefficients.order_f
    of_brdf = coefficients.degree_energy if order_p is None else _kept(coefficients, order, order_p)
    energy = weighted_power(lighting, order) * of_brdf
    beyond = np.append(np.cumsum(energy[::-1], axis=0)[-2::-1], np.zeros((1, 3)), axis=0)
    return _relative_to_mean(beyond, lighting, coefficients)


def visible_beyond_p(lighting: Lighting, coefficients: BrdfCoefficients, order_p: int) -> float:
    """Return what truncation after the order P leaves out, relative to the mean reflected light.

    It is measured as `visible_beyond` does; the light of all known degrees counts.
    """
    order = coefficients.order_f
    left = coefficients.degree_energy - _kept(coefficients, order, order_p)
    energy = np.sum(weighted_power(lighting, order) * np.maximum(left, 0.0), axis=0)
    return float(_relative_to_mean(energy, lighting, coefficients))


def _relative_to_mean(energies: Array, lighting: Lighting, coefficients: BrdfCoefficients) -> Array:
    """Return the RMS of energies, shape (..., 3), relative to the mean reflected light, (...).

    It is that of the channel where it is largest.
    """
    mean = np.abs(lighting.coefficients[0] * coefficients.values[0, 0, 0]) / np.sqrt(4 * np.pi)
    rms = np.sqrt(energies) / (4 * np.pi)
    return np.asarray(np.max(rms / np.maximum(mean, 1e-300), axis=-1))


def cube_energies(light: Array, parts: Array) -> Array:
    """Return the energy of cubes over R in each of their own degrees.

    Light of degree l, reflected with the harmonics of degree p of the view in world axes, has the
    degrees ``J = l - p, l - p + 2 .. l + p`` over R. The light of different degrees is taken as
    independent.

    `light`, of shape (F+1, 3), is ``4 pi / (2l+1) sum_m |L_lm|^2``. `parts`, of shape (F+1, p+1, n,
    3), are the coefficients rho_hat_lpq for q = 0 .. p, of n different functions or BRDFs.

    Returns an array of shape (F+p+1,): their sum is the sum over l and q, of both signs, of light
    and squared parts.
    """
    order, p = parts.shape[0] - 1, parts.shape[1] - 1
    by_order = np.ascontiguousarray(np.moveaxis(parts, 1, -1)).reshape(order + 1, -1, p + 1)
    # In their own degrees J.
    coupled = (by_order @ zonal_coupling(order, p)).reshape(order + 1, -1, 3, p + 1)
    energies = np.einsum("lc,lncj->jl", light, coupled**2)
    result = np.zeros(order + p + 1)
    for j, shift in enumerate(range(-p, p + 1, 2)):
        low = max(0, -shift)
        if low > order:
            continue
        result[low + shift : order + shift + 1] += energies[j, low:]
    return result


def filter_matrices(factors: Array, order: int, p: int) -> Array:
    """Return what a filter of cubes does to the parts of bundles of a degree p.

    A look-up blurs the numbers of a cube, which are those of world axes. About the mirror direction
    that takes from the functions of one azimuthal order, and adds to those of others.

    `factors`, of shape (>= order+p+1,), are what the filter multiplies each degree of cubes with.

    Returns an array of shape (order+1, p+1, p+1), [l, q, r]: what part q takes of part r.
    """
    coupling = zonal_coupling(order, p)
    own = np.abs(np.arange(order + 1)[:, None] + np.arange(-p, p + 1, 2))
    # The coupling is orthogonal, but that each q > 0 stands for both of its signs.
    both = np.where(np.arange(p + 1), 2, 1)[:, None]
    return np.asarray((coupling * factors[own][:, None]) @ coupling.swapaxes(1, 2) / both)


def filtered_parts(parts: Array, matrices: Array) -> Array:
    """Return the parts of cubes that are filtered, (F+1, p+1, n, 3).

    `parts`, of shape (F+1, p+1, n, 3), are as `cube_energies` takes them. `matrices` are those of
    `filter_matrices`, to at least the order F.
    """
    flat = parts.reshape(*parts.shape[:2], -1)
    return (matrices[: len(parts)] @ flat).reshape(parts.shape)


def filtering_error(
    lighting: Lighting, coefficients: BrdfCoefficients, factors: Array, size: int,
    sampling: Sampling,
) -> float:  # fmt: skip
    """Predict the relative RMS error of looking a map up by bilinear filtering.

    `lighting`, `coefficients` and `factors`, whose shape tells the orders of the map, are the same
    as for `predicted_error`.

    Returns the error of the map as it is made, without that of its orders; 0 for black light.
    """
    order_f, order_p = (count - 1 for count in factors.shape)
    light = weighted_power(lighting, order_f)
    places = fine_places(lighting, coefficients.values[: order_f + 1, 0, 0])
    errors = bilinear_errors(order_f + order_p, size, sampling, places)
    lost = whole = 0.0
    for p in range(order_p + 1):
        weighted = light * factors[:, p, None] ** 2
        energy = cube_energies(weighted, coefficients.values[: order_f + 1, p, : p + 1, None])
        lost, whole = lost + float(errors[: len(energy)] @ energy), whole + float(energy.sum())
    return relative_rms(lost, whole)


def fine_places(lighting: Lighting, lobe: Array) -> Array | None:
    """Return where on the faces of a cube the finest details of the reflected light are.

    `lobe`, of shape (F+1, 3), is what the light of each degree is multiplied with: the coefficients
    rho_hat_l00.

    Returns the argument of `bilinear_errors`; None where there is no detail.
    """
    order = min(len(lobe) - 1, lighting.order, _PLACES_ORDER)
    degree = np.arange(order + 1)
    by_degree = lobe[: order + 1] / np.sqrt(2 * degree + 1)[:, None]
    each = np.repeat(by_degree, 2 * degree + 1, axis=0)
    return detail_places(lighting.coefficients[: (order + 1) ** 2] * each)


def error_bound(
    lighting: Lighting,
    coefficients: BrdfCoefficients,
    order_f: int,
    order_p: int,
    factors: Array | None = None,
) -> float:
    """Return a conservative relative RMS error, the square root of eps_B of eq. 5.19.

    All that is missing beyond F is taken to sit in mode F + 1, with all the residual energy of
    the light and of the BRDF: ``Lambda_{F+1}^2 (eps_L L_tot) (eps_rho rho_tot)``. (Eq. 5.19 is
    printed with Lambda_{F+1}, but energies go with its square, ``|B_lmpq|^2 = Lambda_l^2 |L_lm|^2
    |rho_hat_lpq|^2``.) The part with l <= F and p > P does not occur in the radially symmetric
    case of eq. 5.19. It is known for each degree, and is added as it is, but for azimuthal orders
    that are not known, which are added as `energies_beyond` estimates them.

    `lighting`, `coefficients`, `order_f`, `order_p` and `factors` are the same as for
    `predicted_error`.
    """
    light = weighted_power(lighting, order_f)
    kept = _kept(coefficients, order_f, order_p, factors)
    low = coefficients.degree_energy[: order_f + 1]
    light_left = np.maximum(lighting.energy - lighting.power()[: order_f + 1].sum(axis=0), 0)
    rho_left = np.maximum(coefficients.total_energy - low.sum(axis=0), 0)
    residual = _convolution_measure(order_f + 1)[-1] * np.sum(light_left * rho_left)
    residual += np.sum(light * (low - kept)) + energies_beyond(lighting, coefficients)[1]
    return relative_rms(residual, np.sum(light * kept) + residual)


def _kept(
    coefficients: BrdfCoefficients, order_f: int, order_p: int, factors: Array | None = None
) -> Array:
    """Return the energy of the BRDF at each degree l <= F with p <= P, shape (F+1, 3).

    It is the part that is no error where amplitudes are multiplied by factors.
    """
    energies = coefficients.energies[: order_f + 1, : order_p + 1]
    if factors is not None:
        energies = energies * kept_energy(factors)[..., None]
    return np.asarray(energies.sum(axis=1))


def weighted_power(lighting: Lighting, order: int) -> Array:
    """Return ``Lambda_l^2 sum_m |L_lm|^2`` for each l and channel, shape (order+1, 3)."""
    return _convolution_measure(order)[:, None] * lighting.power()[: order + 1]


def blur_amplitudes(coefficients: BrdfCoefficients | TransferFunctions) -> Array:
    """Return what a zonal filter multiplies degrees with that leaves light as much energy.

    The energy is that of the reflected light, as `reflected_rms` has it, with the mean BRDF of the
    channels. From half of the known degrees to all of them it falls by a power of the degree, and
    so it does to twice as many, shape (2F+1,).
    """
    own = coefficients.degree_energy.mean(axis=-1)
    known = np.sqrt(np.maximum(_convolution_measure(len(own) - 1) * own, 0.0))
    last = len(known) - 1
    middle, end = np.maximum(known[[last // 2, last]], 1e-300)
    power = max(np.log2(middle / end), 0.0)
    further = np.arange(last + 1, 2 * last + 1) / last
    return np.append(known, known[last] * further**-power)


def _convolution_measure(order: int) -> Array:
    """Return ``Lambda_l^2 = 4 pi / (2l+1)`` of eq. 5.7 for each l, shape (order+1,)."""
    return 4 * np.pi / (2 * np.arange(order + 1) + 1)
