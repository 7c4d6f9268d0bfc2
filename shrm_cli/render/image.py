"""The exposure of linear pictures, which makes them brighter or darker."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array
from shrm_cli.files.image import Picture
from shrm_cli.vocabulary import LUMINANCE, MAX_STOPS

_BRIGHT, _SHOWN_AS = 0.75, 0.4
"""The quantile of the luminance that an exposure is chosen by, and what it becomes."""
_MOST_STOPS = 30.0
_WHITE, _BLACK = 0.1, 0.95
"""A picture of which no more than this share of what is lit is below 1 is all but white; one of
which this share is below `_SEEN` is all but black. The dim rim of a small ball has 7 % of it."""
_SEEN = 0.003
"""Ten of the 255 steps of sRGB."""
_GLINTS, _BRIGHT_ENOUGH = 0.997, 0.2
"""A picture is not all but black where more than the rest of this share is so bright: two lamps in
a black mirror, drawn 13 stops brighter, were a white fog."""
_HALF = 0.5
"""A picture whose exposure nobody named is made darker where this share of what is lit is white: a
white ball in a studio at exposure 0 showed a tenth of itself."""


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


def shown_at(path: str, *pictures: ArrayLike, asked: float | None = None) -> float:
    """Return the stops at which pictures of one file are drawn: those that are asked for, if any.

    Else it is 0, at which files can be compared, unless most of one of the pictures is white there,
    or they are all but black. EXR is linear: it is 0. `pictures`, of shape (..., 3), are linear.
    """
    if asked is not None:
        return asked
    if path.lower().endswith(".exr"):
        return 0.0
    each_lit = [_lit(each) for each in pictures]
    lit = np.concatenate(each_lit)
    suitable = suitable_exposure(lit)
    if not _hides(lit, _HALF):
        # One view may be white beside others of which enough is seen.
        is_one_white = any(_is_white(each, _HALF) for each in each_lit)
        return min(suitable, 0.0) if is_one_white else 0.0
    return 0.0 if _hides(lit * 2.0**suitable) else suitable


def exposure_advice(path: str, pixels: ArrayLike, exposure: float, label: str = "") -> list[str]:
    """Say which exposure shows a picture that is all but black or white; nothing of an EXR.

    `pixels`, of shape (..., 3), are linear and exposed by `exposure` stops. What is black in truth,
    as beside a sphere, does not count. `label` is what the sheet says of a part of it.
    """
    lit = _lit(pixels)
    if path.lower().endswith(".exr") or not _hides(lit):
        return []
    looks = "white" if np.median(lit) > _SEEN else "black"
    suitable = suitable_exposure(lit)
    better = exposure + suitable
    shows = f"`exposure` {better:g} shows it"
    if _hides(lit * 2.0**suitable) or abs(better) > MAX_STOPS:
        shows = "it is beyond what exposures show"
    name = f"{path}, {label}" if label else path
    return [f"{name}: all but {looks} at an exposure of {exposure:g}; {shows}"]


def _lit(pixels: ArrayLike) -> Array:
    """Return the luminance of what is lit in a linear picture, shape (n,)."""
    luminance = np.asarray(pixels, dtype=float) @ LUMINANCE
    return np.asarray(luminance[np.isfinite(luminance) & (luminance > 0)])


def _hides(lit: Array, white: float = _WHITE) -> bool:
    """Whether a picture is all but black or white, by the luminance of what is lit in it.

    It is white where no larger share than `white` is below 1.
    """
    if not lit.size:
        return False
    high, top = np.quantile(lit, [_BLACK, _GLINTS])
    return bool(high <= _SEEN and top < _BRIGHT_ENOUGH) or _is_white(lit, white)


def _is_white(lit: Array, share: float) -> bool:
    """Whether no larger share of what is lit is below 1."""
    return bool(lit.size and np.quantile(lit, share) >= 1)


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
