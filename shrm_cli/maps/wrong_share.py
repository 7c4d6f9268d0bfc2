"""How much of what is visible of a map is wrong: predicted before anything is drawn.

A relative RMS error under lamps is that of the lamps' reflections. What people see is how many
pixels are wrong. So the reflected light is computed with and without what the map leaves out, at
some central directions and for some views of each, and it is counted where the two differ.

About a central direction R the light is a sum over few numbers (eq. 5.9 of Ramamoorthi's thesis),

    B(R, V) = sum over l, q of A_lq(R) rho_hat_lq(theta_o) exp(i q phi_o),
    A_lq(R) = sum over m of L_lm d^l_mq(theta) exp(i m phi),

in which rho_hat_lq is the lobe for the view, with all its degrees p. The error of a map is the same
sum over the lobes' errors, and all views of a direction share its A_lq.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache, partial

import numpy as np
from numpy.typing import NDArray

from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.cache import remembered
from shrm_cli.brdf.lobe_expansion import Expansion as Lobe
from shrm_cli.brdf.lobe_expansion import LobeExpander, light_rule
from shrm_cli.maps.expansion import Expansion
from shrm_cli.memo import Memo
from shrm_cli.probe.lighting import Lighting
from shrm_cli.reflected import visible_order
from shrm_cli.sphere.harmonics import complex_from_real, legendre_table
from shrm_cli.sphere.wigner import small_d_degrees
from shrm_cli.vocabulary import LUMINANCE, SEEN_FLOOR, WRONG, Center

Array = NDArray[np.floating]
ComplexArray = NDArray[np.complexfloating]

_KEPT_ORDER = 96
_known_rings = Memo(2**25)
"""The functions on the rings, up to some orders of the light; those of order 96 take 6 MB."""
_RINGS, _AROUND = 6, 20
"""The rings of central directions, and the directions on each of them."""
_VIEWS, _AZIMUTHS = 12, 10
"""The angles of views from a central direction, and the azimuths of each of them."""
_MAX_Q = 6
"""The largest azimuthal order q of lobes. Hardly any energy lies beyond, whatever P is."""
_NODES = 60, 18
"""The least numbers of nodes in theta_i and phi at which lobes are sampled."""
_NODES_A_DEGREE, _ENOUGH = 1.5, 480
"""The least number of nodes in theta_i for each degree of the lobes, below which high degrees are
noise; and a number that is enough for any lobe, because nodes crowd where sharp lobes are."""
_MOST_SAMPLES = 2**19
"""The most samples of a BRDF at a time."""
_ACCURACY = 5e-4, 0.3
"""The part of the lobes' energy that their sampling may miss: at most this, and in units of the
squared error of the map. What it does miss is far less than what it is estimated to."""
_UNKNOWN = 0.1
"""The part of the squared error that may be unknown."""
_UNSURE = 0.005, 0.1
"""How much the share may grow where what is unknown adds to the error everywhere: at least this,
and in units of the share."""


@dataclass(frozen=True, eq=False)
class Lobes:
    """Lobes of a BRDF for some views, and what a map leaves out of them.

    Attributes
    ----------
    whole, error : ndarray, shape (Q+1, F+1, views, channels)
        rho_hat_lq(theta_o), indexed [q, l, view, channel], with one channel for a grey BRDF.
    shares : ndarray, shape (views,)
        The share of what is visible that each view stands for; they sum to 1.
    """

    whole: Array
    error: Array
    shares: Array


def sample_views(center: Center, count: int) -> tuple[Array, Array]:
    """Return angles of views from the central direction that stand for all pixels of spheres.

    About the mirror direction these pixels are uniform over all views. About the normal they are
    so over the squared sine of the angle, above the horizon. Views are dense where they graze the
    surface, because errors are large there.

    Parameters
    ----------
    center : {"reflection", "normal"}
    count : int

    Returns
    -------
    theta_o, shares : ndarray, shape (count,)
        Radians, ascending, and the share of the pixels that each of them stands for.
    """
    left = 1 - (np.arange(count) + 0.5) / count
    part = 1 - left**2
    theta_o = np.arccos(1 - 2 * part) if center == "reflection" else np.arcsin(np.sqrt(part))
    return theta_o, left / left.sum()


def predicted_wrong_share(expansion: Expansion) -> float | None:
    """Predict the share of what is visible of an SHRM whose luminance is wrong by more than 5 %.

    Parameters
    ----------
    expansion : Expansion
        Light and BRDF, and the orders that the map keeps.

    Returns
    -------
    float or None
        In 0 .. 1, without the errors of filtering and of rounding. It is None where it is not
        known: about the tangent, or where too much lies beyond the known coefficients.
    """
    if expansion.brdf.center == "tangent":
        return None
    squared = expansion.error**2
    if squared == 0:
        return 0.0
    lobes = _lobes_of(expansion, min(_ACCURACY[0], _ACCURACY[1] * squared))
    if lobes is None:
        return None
    return known_share(expansion.lighting, lobes, expansion.estimated, squared)


def known_share(
    lighting: Lighting, lobes: Lobes, unknown: float, squared_error: float
) -> float | None:
    """Return the `wrong_share`; what is unknown counts where it is not small beside the error.

    Parameters
    ----------
    lighting, lobes, unknown
        The same as for `wrong_share`.
    squared_error : float
        The energy of the map's error, relative to all of the reflected light.
    """
    is_small = unknown <= _UNKNOWN * squared_error
    return wrong_share(lighting, lobes, 0.0 if is_small else unknown)


def wrong_share(lighting: Lighting, lobes: Lobes, unknown: float = 0.0) -> float | None:
    """Return the share of sample points whose luminance is wrong by more than `WRONG`.

    Parameters
    ----------
    lighting : Lighting
        The light, to at least the order of the lobes.
    lobes : Lobes
    unknown : float
        The energy of the reflected light that is missing in both lobes and errors, relative to all
        of it.

    Returns
    -------
    float or None
        In 0 .. 1; None where what is unknown might change it much.
    """
    if not (lobes.error.any() or unknown):
        return 0.0
    max_q, order = lobes.whole.shape[0] - 1, lobes.whole.shape[1] - 1
    light = lighting.coefficients[: (order + 1) ** 2] * LUMINANCE
    if lobes.whole.shape[-1] == 1:
        light = light.sum(axis=1, keepdims=True)
    local = _local_light(light, order, max_q)
    both = np.concatenate([lobes.whole, lobes.error], axis=2)
    flat = both.swapaxes(2, 3).reshape(max_q + 1, -1, both.shape[2])
    by_q = (local @ flat).reshape(2 * (max_q + 1), -1)
    # The sum over both signs of q is twice the real part of that over q > 0.
    q, azimuths = np.arange(max_q + 1), 2 * np.pi * (np.arange(_AZIMUTHS) + 0.5) / _AZIMUTHS
    waves = np.where(q == 0, 1, 2)[:, None] * np.exp(1j * np.outer(q, azimuths))
    values = by_q.T @ np.concatenate([waves.real, -waves.imag])
    whole, error = np.split(values.reshape(local.shape[2], -1, _AZIMUTHS), 2, axis=1)
    # Only degree 0 has a mean over all central directions.
    means = lobes.whole[0, 0] @ local[0, 0, 0, : both.shape[-1]]
    limit = WRONG * np.maximum(whole, SEEN_FLOOR * float(lobes.shares @ means))

    def share_of(happens: Array) -> float:
        return float(happens.mean(axis=(0, 2)) @ lobes.shares)

    share = share_of(np.abs(error) > limit)
    rest = np.sqrt(unknown * share_of(whole**2))
    most = share_of(np.abs(error) + rest > limit)
    return share if most - share <= max(_UNSURE[0], _UNSURE[1] * share) else None


def _lobes_of(expansion: Expansion, accuracy: float) -> Lobes | None:
    """Return lobes and what an SHRM leaves out of them; None where they cannot be sampled well.

    Parameters
    ----------
    expansion : Expansion
    accuracy : float
        The part of the lobes' energy that their sampling may miss.
    """
    brdf, known = expansion.brdf, expansion.coefficients
    order = visible_order(expansion.lighting, known)
    order_p = expansion.orders.order_p
    angles, shares = sample_views(brdf.center, 1 if brdf.zonal else _VIEWS)
    if brdf.zonal:  # the same lobe for all views
        whole = known.values[None, : order + 1, :1, 0] * np.sqrt(np.pi)
    else:
        found = _sampled(brdf, order, _MAX_Q, angles, accuracy)
        if found is None:
            return None
        whole = found
    error = whole.copy()
    functions = 2 * np.pi * legendre_table(order_p, np.cos(angles))
    for q in range(min(order_p, len(whole) - 1) + 1):
        kept = expansion.kept[: order + 1, q:, q, : whole.shape[-1]]
        error[q, : len(kept)] -= np.einsum("lpc,po->loc", kept, functions[q, : order_p + 1 - q])
    return Lobes(whole, error, shares)


def _sampled(brdf: Brdf, order: int, max_q: int, angles: Array, accuracy: float) -> Array | None:
    """Sample lobes until they miss no more of the energy than allowed; None where they do."""
    count, azimuth_count = _NODES
    count = 12 * int(np.ceil(max(count, min(_NODES_A_DEGREE * order, _ENOUGH)) / 12))

    @cache
    def expander() -> LobeExpander:
        return LobeExpander(brdf, light_rule(brdf), order, max_q)

    def sample(nodes: int, azimuths: int) -> Lobe:
        return expander().expand(angles, nodes, azimuths)

    while len(angles) * count * azimuth_count <= _MOST_SAMPLES:
        what = "lobes", order, max_q, angles.tobytes(), count, azimuth_count
        found = remembered(brdf, what, partial(sample, count, azimuth_count))
        by_theta, by_phi = (
            each.sum() / max(found.energy.sum(), 1e-300)
            for each in (found.error_theta, found.error_phi)
        )
        if by_theta + by_phi <= accuracy:
            return found.values
        count *= 2 if by_theta > accuracy / 2 else 1
        azimuth_count *= 2 if by_phi > accuracy / 2 else 1
    return None


def _local_light(light: Array, order: int, max_q: int) -> Array:
    """Expand the light about central directions that are spread evenly.

    Parameters
    ----------
    light : ndarray, shape ((order+1)^2, channels)
        The coefficients over the real harmonics of world axes.
    order, max_q : int
        The largest l and q.

    Returns
    -------
    ndarray, shape (2, max_q+1, directions, (order+1) channels)
        The real and the imaginary part of ``A_lq(R)``, zero where q > l.
    """
    channels, m = light.shape[1], np.arange(-order, order + 1)[:, None]
    by_degree = complex_from_real(light, order)
    waves = np.exp(1j * m * (2 * np.pi / _AROUND * np.arange(_AROUND)))
    result = np.zeros((2, max_q + 1, _RINGS, _AROUND, order + 1, channels))
    for degree, by_ring in enumerate(_rings(order, max_q)):
        spin, rows = min(degree, max_q), slice(order - degree, order + degree + 1)
        lit = (waves[rows, :, None] * by_degree[degree, rows, None]).reshape(2 * degree + 1, -1)
        found = (by_ring.T @ lit).reshape(spin + 1, _RINGS, _AROUND, channels)
        result[0, : spin + 1, :, :, degree] = found.real
        result[1, : spin + 1, :, :, degree] = found.imag
    return result.reshape(2, max_q + 1, _RINGS * _AROUND, -1)


def _rings(order: int, max_q: int) -> Iterable[ComplexArray]:
    """Return what `_make_rings` yields, kept from one call to the next unless it is large."""
    if order > _KEPT_ORDER:
        return _make_rings(order, max_q)
    return _known_rings.get((order, max_q), lambda: list(_make_rings(order, max_q)))


def _make_rings(order: int, max_q: int) -> Iterator[ComplexArray]:
    """Yield ``d^l_mq(theta) exp(i m phi)`` on the first direction of each ring, l = 0 .. order.

    Yields
    ------
    ndarray, shape (2l+1, (q+1) rings)
        For q = 0 .. min(l, max_q).
    """
    m = np.arange(-order, order + 1)[:, None]
    theta = np.arccos(1 - (2 * np.arange(_RINGS) + 1) / _RINGS)
    # Rings are turned against each other by the golden angle, so that no meridian is special.
    turned = np.exp(1j * m * (np.pi * (3 - np.sqrt(5)) * np.arange(_RINGS)))
    for degree, d in small_d_degrees(order, theta[: _RINGS // 2], max_spin=max_q):
        spin, rows = d.shape[1] // 2, slice(order - degree, order + degree + 1)
        north = d[:, spin:]
        # d^l_mq(pi - theta) = (-1)^(l+q) d^l_-mq(theta)
        south = north[::-1, :, ::-1] * (-1.0) ** (degree + np.arange(spin + 1))[:, None]
        both = np.concatenate([north, south], axis=2)
        yield (both * turned[rows, None]).reshape(2 * degree + 1, -1)
