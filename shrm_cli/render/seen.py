"""Errors of what is seen, beside the root mean square.

A root mean square over HDR radiance is nearly the error of the few brightest pixels. These numbers
count the pixels instead: the median and the 95th percentile of the relative error of the
luminance, the share of pixels where it exceeds 5 %, and the share of pixels whose luminance is
negative, which a screen shows as black.
"""

import numpy as np
from numpy.typing import ArrayLike

from shrm_cli.arrays import Array
from shrm_cli.errors import ArgumentError
from shrm_cli.records import record
from shrm_cli.render.image import weighted_quantiles
from shrm_cli.vocabulary import LUMINANCE, SEEN_FLOOR, WRONG


@record
class SeenErrors:
    """How far the luminance of a picture's pixels is from the truth.

    Attributes
    ----------
    median_relative_error, p95_relative_error : float
        Median and 95th percentile, over the pixels, of `|picture - truth| / max(truth, floor)`,
        where the floor is `vocabulary.SEEN_FLOOR` of the mean truth; 1 is 100 %. Infinite where
        the truth is not above 0 and the picture differs.
    wrong_share : float
        Share of the pixels whose relative error exceeds `vocabulary.WRONG`, 5 %; from 0 to 1.
    negative_share : float
        Share of the pixels whose luminance is below 0 in the picture, from 0 to 1.
    """

    median_relative_error: float
    p95_relative_error: float
    wrong_share: float
    negative_share: float


def seen_errors(picture: ArrayLike, truth: ArrayLike, weights: ArrayLike = 1.0) -> SeenErrors:
    """Measure the relative errors of the luminance, pixel by pixel.

    Parameters
    ----------
    picture, truth : array_like, shape (..., 3)
        Linear radiance, not premultiplied, in any unit that they share. All pixels count together.
    weights : array_like, broadcastable to shape (...)
        How much each pixel counts, at least 0, such as the fraction of it that an object covers.
        Pixels of weight 0 are not looked at. By default all count alike.

    Returns
    -------
    SeenErrors
        All are nan if a pixel that counts is not finite.

    Raises
    ------
    ArgumentError
        If the shapes do not fit, or no pixel counts.

    Examples
    --------
    >>> truth = np.ones((8, 8, 3))
    >>> round(float(shrm.seen_errors(1.1 * truth, truth).wrong_share), 3)
    1.0
    """
    found, expected = np.asarray(picture, dtype=float), np.asarray(truth, dtype=float)
    if found.shape != expected.shape or found.ndim < 1 or found.shape[-1] != 3:
        raise ArgumentError(
            "picture",
            f"of shape {found.shape} must be (..., 3) and that of `truth`, {expected.shape}",
        )
    shares = spread_weights(weights, found.shape[:-1])
    counts = shares > 0
    found, expected, shares = found[counts], expected[counts], shares[counts]
    if not (np.isfinite(found).all() and np.isfinite(expected).all()):
        return SeenErrors(np.nan, np.nan, np.nan, np.nan)
    shown, true = found @ LUMINANCE, expected @ LUMINANCE
    floor = SEEN_FLOOR * max(float(np.average(true, weights=shares)), 0.0)
    errors, scale = np.abs(shown - true), np.maximum(true, floor)
    # Where nothing is expected, no error is none, and any error is infinitely large.
    relative = np.where(errors > 0, np.inf, 0.0)
    np.divide(errors, scale, out=relative, where=scale > 0)
    median, p95 = weighted_quantiles(relative, shares, (0.5, 0.95))
    wrong, negative = (np.average(each, weights=shares) for each in (relative > WRONG, shown < 0))
    return SeenErrors(median, p95, float(wrong), float(negative))


def spread_weights(weights: ArrayLike, shape: tuple[int, ...]) -> Array:
    """Return the weight of each pixel of a picture."""
    given = np.asarray(weights, dtype=float)
    try:
        spread = np.broadcast_to(given, shape)
    except ValueError:
        raise ArgumentError("weights", f"of shape {given.shape} do not fit {shape}") from None
    if not (spread > 0).any():
        raise ArgumentError("weights", "are all 0: no pixel counts")
    return spread
