"""How much of what is visible of a map is wrong: predicted before anything is drawn.

A relative RMS error under lamps is that of the lamps' reflections. What people see is how many
pixels are wrong. So the reflected light is computed with and without what the map leaves out, at
some central directions and for some views of each, and it is counted where the two differ.

The light of a map's error is that of the lobes' errors, so that one sum over both tells; see
`shrm_cli.maps.lobes_lit`.
"""

from collections.abc import Sequence
from functools import cache, partial

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.cache import remembered
from shrm_cli.brdf.lobe_expansion import Expansion as Lobe
from shrm_cli.brdf.lobe_expansion import LobeExpander, light_rule
from shrm_cli.maps.base import Map
from shrm_cli.maps.expansion import Expansion
from shrm_cli.maps.lobes_lit import Lobes, lit, points, sample_views, together
from shrm_cli.probe.lighting import Lighting
from shrm_cli.reflected import last_visible, visible_beyond
from shrm_cli.sphere.harmonics import legendre_table
from shrm_cli.vocabulary import LUMINANCE, SEEN_FLOOR, WRONG

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
_APART = 3
"""Of so many central directions one is looked up in a map, as light fields take seconds for all."""


def predicted_wrong_share(expansions: Sequence[Expansion]) -> float:
    """Predict the share of what is visible of an SHRM whose luminance is wrong by more than 5 %.

    Parameters
    ----------
    expansions : sequence of Expansion
        Light and BRDF, and the orders that the map keeps; for each term of a sum.

    Returns
    -------
    float
        In 0 .. 1, without the errors of filtering and of rounding.
    """
    if all(each.error == 0 for each in expansions):
        return 0.0
    return wrong_share(_light_of(expansions), [_lobes_of(each) for each in expansions])


def wrong_share(lighting: Lighting, lobes: Sequence[Lobes]) -> float:
    """Return the share of sample points whose luminance is wrong by more than `WRONG`.

    Parameters
    ----------
    lighting : Lighting
        The light, to at least the order of the lobes.
    lobes : sequence of Lobes
        Those of each term; they reflect their light at the same points.

    Returns
    -------
    float
        In 0 .. 1.
    """
    if not any(each.error.any() for each in lobes):
        return 0.0
    groups = together(lobes)
    return _share(lighting, groups, *lit(lighting.coefficients * LUMINANCE, groups))


def shown_wrong_share(expansions: Sequence[Expansion], map_: Map) -> float | None:
    """Return the share of a map that was made from SHRMs, with the errors of its own form.

    Parameters
    ----------
    expansions : sequence of Expansion
        Light and BRDF, for each term of a sum.
    map_ : Map
        Its radiance is looked up at the sample points, exactly and not as on a GPU.

    Returns
    -------
    float or None
        In 0 .. 1. It is None about the tangent, which normals and views do not tell.
    """
    groups = together(_lobes_of(each) for each in expansions)
    center = groups[0].center
    if center == "tangent":
        return None
    lighting = _light_of(expansions)
    whole, _ = lit(lighting.coefficients * LUMINANCE, groups)
    # Lobes are those of 2 pi times the BRDF.
    normals, views = (each[::_APART] for each in points(center))
    shown = 2 * np.pi * map_.radiance(normals, views) @ LUMINANCE
    return _share(lighting, groups, whole[::_APART], shown - whole[::_APART])


def _light_of(expansions: Sequence[Expansion]) -> Lighting:
    """Return the light that suffices for all terms."""
    return max((each.lighting for each in expansions), key=lambda each: each.order)


def _share(lighting: Lighting, groups: Sequence[Lobes], whole: Array, error: Array) -> float:
    """Return the share of points at which the error is too large."""
    light = lighting.coefficients[:1] * LUMINANCE
    shares = sample_views(groups[0].center, error.shape[1])[1]
    # Only degree 0 has a mean over all central directions.
    means = sum(each.whole[0, 0].real * light[0] for each in groups).sum(axis=-1)
    limit = WRONG * np.maximum(whole, SEEN_FLOOR * float(np.sum(means * shares)))
    return float((np.abs(error) > limit).mean(axis=(0, 2)) @ shares)


def _lobes_of(expansion: Expansion) -> Lobes:
    """Return lobes and what an SHRM leaves out of them.

    Parameters
    ----------
    expansion : Expansion
    """
    brdf, known = expansion.brdf, expansion.coefficients
    beyond = visible_beyond(expansion.lighting, known)
    order = last_visible(beyond)
    order_p = expansion.orders.order_p
    if brdf.zonal:  # the same lobe for all views
        angles: Array = np.zeros(1)
        whole = known.values[None, : order + 1, :1, 0] * np.sqrt(np.pi)
    else:
        angles, _ = sample_views(brdf.center)
        accuracy = min(_ACCURACY[0], _ACCURACY[1] * expansion.error**2)
        whole = _sampled(brdf, order, _MAX_Q, angles, accuracy)
    error = whole.copy()
    functions = 2 * np.pi * legendre_table(order_p, np.cos(angles))
    for q in range(min(order_p, len(whole) - 1) + 1):
        kept = expansion.kept[: order + 1, q:, q, : whole.shape[-1]]
        error[q, : len(kept)] -= np.einsum("lpc,po->loc", kept, functions[q, : order_p + 1 - q])
    return Lobes(whole, error, brdf.center).ended(beyond)


def _sampled(brdf: Brdf, order: int, max_q: int, angles: Array, accuracy: float) -> Array:
    """Sample lobes until they miss no more of the energy than allowed, or as finely as allowed."""
    count, azimuth_count = _NODES
    count = 12 * int(np.ceil(max(count, min(_NODES_A_DEGREE * order, _ENOUGH)) / 12))

    @cache
    def expander() -> LobeExpander:
        return LobeExpander(brdf, light_rule(brdf), order, max_q)

    def sample(nodes: int, azimuths: int) -> Lobe:
        return expander().expand(angles, nodes, azimuths)

    while True:
        what = "lobes", order, max_q, angles.tobytes(), count, azimuth_count
        found = remembered(brdf, what, partial(sample, count, azimuth_count))
        by_theta, by_phi = (
            each.sum() / max(found.energy.sum(), 1e-300)
            for each in (found.error_theta, found.error_phi)
        )
        finer = (
            count * (2 if by_theta > accuracy / 2 else 1),
            azimuth_count * (2 if by_phi > accuracy / 2 else 1),
        )
        if by_theta + by_phi <= accuracy or len(angles) * finer[0] * finer[1] > _MOST_SAMPLES:
            return found.values
        count, azimuth_count = finer
