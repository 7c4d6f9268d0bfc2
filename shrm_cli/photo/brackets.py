"""Exposures of a scene that does not move, merged into its radiance.

A camera turns what a pixel receives, ``E t``, into a number Z by a curve that its maker keeps to
himself. Places that several exposures show tell the curve: g, the logarithm of its inverse, has
``g(Z_ij) = ln E_i + ln t_j``, once for each place i and exposure j. Where exposures are steps of
the same size apart, any g that repeats itself with each step would do as well, and noise leaves
more open: of all, the one is taken that bends least beside the curve of sRGB, which cameras vary.
Each exposure is then an estimate of the radiance, and a mean is taken that trusts the middle of
the numbers most.

Reference: Debevec and Malik, Recovering High Dynamic Range Radiance Maps from Photographs,
SIGGRAPH 1997, eq. 3, 4 and 6.
"""

import os
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array
from shrm_cli.color import srgb_to_linear
from shrm_cli.errors import ArgumentError, ProbeError
from shrm_cli.messages import several
from shrm_cli.probe.image_file import ImageFile, open_picture
from shrm_cli.progress import report
from shrm_cli.records import record

LEVELS = 256
"""The numbers at which the curve is looked for; those of 16-bit files lie between them."""
_BENDING = 10.0
"""How much bending counts beside what the places say, all of which together count as 1. Of three
curves, whose numbers have noise of one, white is 5 % to 13 % off the middle then, and 37 % to 39 %
with .1. With 5 and 20 the light is as near as with 10."""
_PATCH = 8
"""Places are squares of so many pixels an edge, whose mean has little noise."""
_UNEVEN = 4 / (LEVELS - 1)
"""A square whose numbers spread by this, root mean square, counts half as much as an even one."""
WHITE = 1 - 0.5 / (LEVELS - 1)
"""Where a number is as large as 8 bits can be, which tells no more than that it was brighter."""
_NEARLY = 0.97
"""Above it noise, and what JPEG leaves beside edges, may be all that keeps a number from white: of
such numbers in long exposures a sun of 35 had holes of 3."""
_STEP = 1.5 / (LEVELS - 1)
"""How far means of squares that are white may be from each other."""
_LEAST_WHITE = 0.6
"""No program holds white down to less. What is as dark in two exposures is black in both."""
_FLOODS = 15.0
"""What is white in the shortest exposure has white around it in one that lets in so many times as
much, four stops: lenses, and making colours of a sensor's, put a fifth of light into the pixels
beside its own."""
_DARK = 0.02
"""Of less light than this part of white a number of 8 bits tells too little to compare it."""
_FEWEST = 16
"""The fewest numbers of squares by which exposures are compared."""


@record(eq=False)
class Merged:
    """A scene's radiance."""

    pixels: NDArray[np.float32]
    """Linear, shape (H, W, 3). Where the exposure in the middle has half of its largest number, it
    is .214, as sRGB has it; with linear exposures it is what that one has."""
    exposures: Array
    """What each exposure let in, relative to that one, shortest first, shape (n,)."""
    paths: tuple[str, ...]
    """The photographs in that order."""
    differences: Array
    """How much each differs from the one before, where both are neither black nor white: the median
    of the relative difference, 0 of the first, NaN where there are no such places, shape (n,)."""
    curve: Array | None
    """``g``, the same of red, green and blue, so that what is grey stays so; None where pixels are
    linear, shape (LEVELS,)."""
    clipped: float
    """The share of pixels that even the shortest exposure shows as white as it can."""
    stuck: int
    """Pixels that are white in all exposures and alone in it, as those of a sensor that are stuck.
    They and the eight around each have the median of what is around these."""
    white: float = 1.0
    """The number that the camera shows white as; 1 is the largest one."""
    chromaticities: tuple[float, ...] | None = None
    """CIE x and y of red, green, blue and white, where the files tell them."""


def merge_brackets(
    paths: Sequence[str | os.PathLike[str]] | str | os.PathLike[str],
    times: Sequence[float] | None = None,
    linear: bool = False,
) -> Merged:
    """Merge exposures of a scene that does not move.

    Parameters
    ----------
    paths : sequence of path-like
        Two photographs or more, in any order: JPEG, PNG or TIFF of 8 or 16 bits; or linear files
        of floats, whose 1 is as white as the camera can show.
    times : sequence of float, optional
        What each let in, such as its shutter's seconds. By default what its Exif says: time,
        aperture and sensitivity.
    linear : bool
        Whether integers are linear, too, as developers of raw files write them. Their curve is not
        looked for.

    Raises
    ------
    ArgumentError
        If the times are of no use.
    ProbeError
        If there are less than two photographs, or a file cannot be read, has another size, or does
        not tell its exposure.

    Examples
    --------
    >>> shrm.merge_brackets(["probes/studio.exr", "probes/studio.exr"], times=[1, 4]).curve is None
    True
    """
    opened, exposures = _in_order(several(paths), times)
    is_linear = linear or all(each.is_float for each in opened)
    steps = len(opened) * (1 if is_linear else 2)
    curve, places, white = None, [], 1.0
    if not is_linear:
        for done, each in enumerate(opened):
            report(done, steps)
            places.append(_places(each.whole()))
        white = _white_of(places, exposures)
        places = [np.minimum(each / white, 1) for each in places]
        curve = response(np.stack(places), np.log(exposures))
    total = weights = last = np.zeros((), np.float32)
    was_white = np.zeros((), bool)
    clipped: NDArray[np.bool_] = np.zeros((), bool)
    stuck = clipped
    flooded = int(np.searchsorted(exposures, _FLOODS * exposures[0]))
    differences = np.zeros(len(opened))
    for k, (each, exposure) in enumerate(zip(opened, exposures, strict=True)):
        report(steps - len(opened) + k, steps)
        values = each.whole() if white == 1 else np.minimum(each.whole() / np.float32(white), 1)
        if is_linear:
            places.append(_places(values))
        if k:
            step = exposure / exposures[k - 1]
            differences[k] = _difference(places[k - 1], places[k], step, curve)
        # What is white in an exposure is so in all that let in more, whatever they say.
        was_white = was_white | (values >= _NEARLY)
        light = (_received(values, curve) / exposure).astype(np.float32)
        trust = np.where(was_white, 0, np.maximum(np.minimum(values, 1 - values), 0))
        total = total + trust * light
        weights = weights + trust
        # What no exposure shows between black and white is what the last that is not white shows.
        last = np.where(was_white & (k > 0), last, light)
        if k == 0:
            clipped = values.max(axis=-1) >= WHITE
        elif k == flooded and min(values.shape[:2]) > 3:  # which has something around such pixels
            stuck = clipped & _is_alone(values.max(axis=-1) >= _NEARLY)
    report(steps, steps)
    pixels = np.where(weights > 0, total / np.where(weights > 0, weights, 1), last)
    if stuck.any():
        _fill(pixels, stuck)
    names = tuple(str(each.path) for each in opened)
    return Merged(
        pixels, exposures, names, differences, curve, float((clipped & ~stuck).mean()),
        int(stuck.sum()), white, opened[0].chromaticities,
    )  # fmt: skip


def _white_of(places: Sequence[Array], exposures: Array) -> float:
    """Return the number that white has, of what `_places` returns of each exposure.

    Programs that develop photographs may hold white down, to 240 of 255 for example. It is what the
    longest exposure, and the longest of half its light or less, show as the same number, and
    nothing above it; 1 where there is no such number.
    """
    last, shorter = places[-1][0], np.flatnonzero(exposures <= exposures[-1] / 2)
    if len(last) < 2 * _FEWEST or not len(shorter):
        return 1.0
    before = places[shorter[-1]][0]
    top = float(np.partition(last, -_FEWEST)[-_FEWEST])
    alike = (before > top - _STEP) & (before < top + _STEP) & (np.abs(last - top) < _STEP)
    return top if _LEAST_WHITE < top < _NEARLY and alike.sum() >= _FEWEST else 1.0


def _is_alone(white: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the pixels that are white, and have no white ones around them."""
    height, width = white.shape
    padded = np.pad(white, 1).astype(np.uint8)
    around = sum(padded[i : i + height, j : j + width] for i in range(3) for j in range(3))
    return white & (around == 1)


def _fill(pixels: NDArray[np.float32], stuck: NDArray[np.bool_]) -> None:
    """Give stuck pixels, and the eight around each, the median of what is around these."""
    for row, column in np.argwhere(stuck):
        near, own = (
            pixels[max(row - k, 0) : row + k + 1, max(column - k, 0) : column + k + 1]
            for k in (2, 1)
        )
        own[:] = np.nan
        own[:] = np.nanmedian(near, axis=(0, 1))


def _in_order(
    paths: Sequence[str | os.PathLike[str]], times: Sequence[float] | None
) -> tuple[list[ImageFile], Array]:
    """Open exposures, and sort them by what they let in, relative to the one in the middle."""
    opened = [open_picture(path, as_stored=True) for path in paths]
    if len(paths) < 2:
        named = f"{paths[0]}: is one exposure" if paths else "there is no exposure"
        raise ProbeError(f"{named}; name two photographs at least, of different times")
    if times is not None and len(times) != len(paths):
        raise ArgumentError("times", f"must be as many as exposures, which are {len(paths)}")
    found = np.array([_exposure(each) for each in opened] if times is None else times, dtype=float)
    if not (np.isfinite(found).all() and found.min() > 0 and found.max() > found.min()):
        raise ArgumentError("times", "must be positive, and not all the same")
    for each in opened[1:]:
        if (each.width, each.height) != (opened[0].width, opened[0].height):
            raise ProbeError(
                f"{each.path}: {each.width} x {each.height} pixels, but {opened[0].path} has "
                f"{opened[0].width} x {opened[0].height}; give exposures of one camera"
            )
    order = np.argsort(found, kind="stable")
    return [opened[k] for k in order], found[order] / found[order[len(order) // 2]]


def response(places: Array, logarithms: Array) -> Array:
    """Find the curve of a camera from places that several exposures show.

    `places`, of shape (exposures, 2, n), are the mean of the numbers of each place, where 1 is
    white, and their spread. `logarithms`, of shape (exposures,), are natural logarithms of what
    each exposure let in.

    Returns an array of shape (LEVELS,): g, which never falls.

    References: Debevec and Malik 1997, eq. 3, with squares of the weights of eq. 4. The least
    squares are solved for each E_i first, so that every place may count.
    """
    means, spreads = places[:, 0], places[:, 1].max(axis=0)
    at = np.rint(means * (LEVELS - 1)).astype(int)
    trust = np.minimum(means, 1 - means) ** 2 / (1 + (spreads / _UNEVEN) ** 2)
    sums = np.maximum(trust.sum(axis=0), 1e-12)
    matrix, target = np.zeros((LEVELS, LEVELS)), np.zeros(LEVELS)
    middle = logarithms @ trust / sums
    for level, weight, logarithm in zip(at, trust, logarithms, strict=True):
        matrix += np.diag(np.bincount(level, weight, LEVELS))
        target += np.bincount(level, weight * (logarithm - middle), LEVELS)
        for other, its in zip(at, trust, strict=True):
            np.subtract.at(matrix, (level, other), weight * its / sums)
    z = (np.arange(LEVELS) + 0.25 * (np.arange(LEVELS) == 0)) / (LEVELS - 1)
    usual = np.log(srgb_to_linear(z))
    bends = np.diff(np.eye(LEVELS), 2, axis=0)
    whole = matrix / sums.sum() + _BENDING * bends.T @ bends
    whole[-1, -1] += 1  # any constant may be added
    curve = np.linalg.solve(whole, (target - matrix @ usual) / sums.sum())
    return np.maximum.accumulate(usual + curve)


def _received(values: Array, curve: Array | None) -> Array:
    """Return what pixels received: linear ones as they are, others as `Merged` says."""
    if curve is None:
        return np.maximum(values, 0)
    places = np.arange(LEVELS) / (LEVELS - 1)
    scale = srgb_to_linear(np.array(0.5)) / np.exp(np.interp(0.5, places, curve))
    return np.interp(values, places, scale * np.exp(curve))


def _difference(shorter: Array, longer: Array, step: float, curve: Array | None) -> float:
    """Return how much an exposure differs from a shorter one that let in 1 / `step` of its light.

    Both are what `_places` returns. Returns the median of the relative difference of the squares
    that are neither black in one nor white in the other, or NaN if there are hardly any.
    """
    before, after = (_received(each[0], curve) for each in (shorter, longer))
    both = (before > _DARK) & (longer[0] + 2 * longer[1] < _NEARLY)
    if both.sum() < _FEWEST:
        return float(np.nan)
    return float(np.median(np.abs(after[both] / (step * before[both]) - 1)))


def _places(values: Array) -> Array:
    """Return the means and spreads of squares of an image's channels, shape (2, n)."""
    edge = max(min(_PATCH, *values.shape[:2]), 1)
    rows, columns = (size // edge for size in values.shape[:2])
    squares = values[: rows * edge, : columns * edge].reshape(rows, edge, columns, edge, 3)
    return np.stack([squares.mean(axis=(1, 3)).ravel(), squares.std(axis=(1, 3)).ravel()])


def _exposure(opened: ImageFile) -> float:
    """Return what an exposure let in, by its Exif: seconds x sensitivity / f-number squared.

    An aperture or a sensitivity that it does not say counts as 1.
    """
    time = opened.number("ExposureTime")
    if time is None:
        raise ProbeError(f"{opened.path}: its Exif does not say its exposure time; give `times`")
    aperture = opened.number("FNumber") or 1.0
    return time * (opened.number("Exif:PhotographicSensitivity") or 1.0) / aperture**2
