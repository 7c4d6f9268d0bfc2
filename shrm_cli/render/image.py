"""The exposure of linear pictures, which makes them brighter or darker."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.files.picture import Picture

_BRIGHT, _SHOWN_AS = 0.75, 0.4
"""The quantile of the luminance that an exposure is chosen by, and what it becomes."""
_MOST_STOPS = 30.0


def expose(pixels: ArrayLike, exposure: float) -> Picture:
    """Multiply radiance by ``2**exposure``; the exposure value (EV) is in stops."""
    with np.errstate(over="ignore"):  # writers refuse or clip infinite values
        return np.asarray(pixels, dtype=np.float32) * np.float32(2.0**exposure)


def suitable_exposure(luminance: ArrayLike, weights: ArrayLike = 1.0) -> float:
    """Return the stops that bring the upper quartile of the luminance to 0.4, in quarters.

    The page of `shrm view` chooses by the same rule.

    `luminance` is that of the pixels that count. What is not finite is left out. `weights`, which
    broadcast to the same shape, are how much each counts, such as its solid angle.

    Returns stops between -30 and 30; 0 if the quartile is not above 0.
    """
    values = np.asarray(luminance, dtype=float)
    shares = np.broadcast_to(weights, values.shape)
    counts = np.isfinite(values)
    values, shares = values[counts], shares[counts]
    if not shares.sum() > 0:
        return 0.0
    (bright,) = weighted_quantiles(values, shares, [_BRIGHT])
    if bright <= 0:
        return 0.0
    return float(np.clip(np.round(4 * np.log2(_SHOWN_AS / bright)) / 4, -_MOST_STOPS, _MOST_STOPS))


def weighted_quantiles(
    values: ArrayLike, weights: ArrayLike, fractions: Sequence[float]
) -> list[float]:
    """Return the least values up to which at least these fractions of the weight lie."""
    found = np.ravel(values)
    order = np.argsort(found, kind="stable")
    weight = np.cumsum(np.ravel(weights)[order])
    # The last one is the whole weight, which rounding must not leave out of reach.
    places = np.searchsorted(weight, np.array(fractions) * weight[-1])
    return [float(found[order[place]]) for place in places]
