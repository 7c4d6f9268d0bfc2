"""Errors of what is seen, beside the root mean square.

A root mean square over HDR radiance is nearly the error of the few brightest pixels. These numbers
count the pixels instead: the median and the 95th percentile of the relative error of the
luminance, the share of pixels where it exceeds 5 %, and the share of pixels whose luminance is
negative, which a screen shows as black.
"""

import importlib.util
from dataclasses import field

import numpy as np
from numpy.typing import ArrayLike, NDArray

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

    Examples
    --------
    >>> truth = np.ones((8, 8, 3))
    >>> found = shrm.seen_errors(1.1 * truth, truth)
    >>> round(float(found.median_relative_error), 3), float(found.negative_share)
    (0.1, 0.0)
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


# ---- HDR-FLIP: how large the difference is that flipping between pictures shows ------------------
# The pictures are compared as a screen shows them at several exposures, from one at which the
# brightest pixel of the truth is not burnt out to one at which its median is bright (Andersson et
# al. 2021, "Visualizing Errors in Rendered High Dynamic Range Images"). The measure is NVIDIA's
# own, the package `flip_evaluator`, an optional dependency.
#
# That package prints to stdout and ends the process, without an exception, where it finds no
# exposures: in a black truth, and in one darker than 1e-7. This module never lets it get there.


_WHITE = 2.0**16
"""Largest value that FLIP is given, where the truth's greatest luminance is from 0.5 to 1.

Its tone mapper (ACES) is white from 13 on at any of its exposures, which are then above 0, so that
larger values look the same. Their squares could overflow.
"""


@record
class FlipExposures:
    """The exposures at which FLIP compared two pictures.

    FLIP chooses them from the truth alone, so that other maps are seen at the same ones.
    """

    start: float
    stop: float
    """`start` and `stop`: the least and the greatest, in stops: pixels are multiplied by 2 to their
    power."""
    number: int
    """How many there are, evenly spaced."""


@record
class FlipError:
    """The result of HDR-FLIP."""

    mean: float
    """Mean of the error over the pixels, from 0 to 1."""
    exposures: FlipExposures
    errors: Array = field(compare=False, repr=False)
    """The error of each pixel, from 0 to 1, shape (H, W)."""


def can_flip() -> bool:
    """Return whether `flip_evaluator` is installed."""
    return importlib.util.find_spec("flip_evaluator") is not None


def hdr_flip(picture: ArrayLike, truth: ArrayLike, weights: ArrayLike = 1.0) -> FlipError | None:
    """Measure HDR-FLIP, with the viewing distance and the tone mapper that are its defaults.

    FLIP filters what it sees, so it needs whole pictures, with what is around an object in them,
    the same in both. It assumes Rec.709 and 67 pixels to a degree of the visual field.

    Parameters
    ----------
    picture, truth : array_like, shape (H, W, 3)
        Linear radiance as shown. What is negative is shown as black.
    weights : array_like, broadcastable to shape (H, W)
        How much the error of each pixel counts in the mean, such as the fraction of it that an
        object covers. They change neither what FLIP sees nor its exposures.

    Returns
    -------
    FlipError or None
        None where FLIP is not defined: if the truth is black or a pixel is not finite.

    Raises
    ------
    ArgumentError
        If the shapes do not fit, a picture has no pixels, or no pixel counts.
    ModuleNotFoundError
        If `flip_evaluator` is not installed; see `can_flip`.
    """
    shown, true = np.asarray(picture, dtype=float), np.asarray(truth, dtype=float)
    if shown.shape != true.shape or shown.ndim != 3 or shown.shape[-1] != 3 or shown.size == 0:
        raise ArgumentError(
            "picture", f"of shape {shown.shape} must be (H, W, 3) and that of `truth`, {true.shape}"
        )
    shares = spread_weights(weights, true.shape[:-1])
    if not (np.isfinite(shown).all() and np.isfinite(true).all()):
        return None
    shown, true = np.maximum(shown, 0), np.maximum(true, 0)
    # FLIP takes single precision and treats 1e-7 as black. It is otherwise the same for both
    # pictures times any number, with exposures that make up for it.
    brightest = float((true @ LUMINANCE).max())
    if brightest == 0:
        return None
    stops = -int(np.frexp(brightest)[1])
    errors, start, stop, number = _evaluate(_prepared(shown, stops), _prepared(true, stops))
    return FlipError(
        float(np.average(errors, weights=shares)),
        FlipExposures(start + stops, stop + stops, number),
        errors,
    )


def _prepared(picture: Array, stops: int) -> NDArray[np.float32]:
    """Return a picture multiplied by 2^stops, for FLIP; what is white anyway is cut off."""
    with np.errstate(over="ignore", under="ignore"):
        return np.minimum(np.ldexp(picture, stops), _WHITE).astype(np.float32)


def _evaluate(
    picture: NDArray[np.float32], truth: NDArray[np.float32]
) -> tuple[Array, float, float, int]:
    """Return FLIP's error of each pixel (H, W), and the exposures: start, stop and number."""
    import flip_evaluator

    # Its default for the parameters is one dictionary for all calls.
    errors, _, chosen = flip_evaluator.evaluate(
        truth, picture, "HDR", applyMagma=False, computeMeanError=False, parameters={}
    )
    number = int(chosen["numExposures"])
    return errors[..., 0], chosen["startExposure"], chosen["stopExposure"], number
