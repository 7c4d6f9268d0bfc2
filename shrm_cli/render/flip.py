"""HDR-FLIP: how large the difference is that an observer sees when flipping between pictures.

The pictures are compared as a screen shows them at several exposures, from one at which the
brightest pixel of the truth is not burnt out to one at which its median is bright (Andersson et
al. 2021, "Visualizing Errors in Rendered High Dynamic Range Images"). The measure is NVIDIA's own,
the package `flip_evaluator`, an optional dependency that only this module uses.

That package prints to stdout and ends the process, without an exception, where it finds no
exposures: in a black truth, and in one darker than 1e-7. This module never lets it get there.
"""

import importlib.util
from dataclasses import field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shrm_cli.arrays import Array
from shrm_cli.errors import ArgumentError
from shrm_cli.records import record
from shrm_cli.render.seen import spread_weights
from shrm_cli.vocabulary import LUMINANCE

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
