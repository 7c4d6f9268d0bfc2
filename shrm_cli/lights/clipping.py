"""Whether the brightest light of an image was cut off, which its pixels only let suspect.

Cameras, formats and programs cut light off at a number, so that more pixels have exactly the
largest value than are just below it: they make a plateau. The light about a clipped lamp goes on
falling from the plateau's rim, and the less steeply the darker it is. Soft boxes of computer
graphics are plateaus, too, but their light ends at once, or leaves the plateau without a slope.
"""

from collections.abc import Sequence

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.probe.pixels import CLIPPED, CONVERTED
from shrm_cli.vocabulary import LARGEST_HALF

HALF_LIMITS = (LARGEST_HALF, 65535.0, 65536.0)
"""The largest number of half precision, and what programs round it to."""
REACHES = " reaches "
"""What suspicions have that are about the end of what a file holds."""
_FAR_BELOW = 0.5
"""A channel whose maximum is below this part of the largest one is not clipped."""
_OVER_MEAN = 4.0
"""A plateau that is darker than the mean times this is no lamp. So is one of more than a quarter of
the sphere, whose light alone makes the mean brighter."""
_WHITE = 1.0
"""Floats that were made of a picture of integers end here, much of a sky or of windows with them:
of a whole probe this plateau may be nearly as dark as the mean, but no more than a quarter of the
sphere."""
_LARGE = 2 * np.pi * (1 - np.cos(np.radians(2.5)))
"""Suns and bulbs, with what cameras spread about them, are smaller than a disc of this radius:
larger plateaus may be soft boxes. They have that many pixels, too, so that their rims tell."""
_MANY = 64.0
_JUST_BELOW = 63 / 64
"""A plateau has more pixels than are from this part of its value up to it."""
_LOW, _MIDDLE = 3 / 4, 7 / 8
"""The rim is what is brighter than the first part of the maximum, and is cut in two at the second.
For light that falls by the square of the distance the outer part is a fifth of the plateau's area,
for that of a smooth step half as large as the inner part."""
_HARD = 1 / 16
"""The outer rim of a hard edge is smaller than this part of the plateau."""
_SMOOTH = 1.25
"""The inner rim of a smooth edge is larger than the outer one times this: light that goes on rising
behind the edge becomes steeper, so that its inner rim is the smaller one."""
_ROUNDED = 1e-3
"""How far a file may round a radiance: half precision does by half of this."""
_BINS_A_STOP, _LEAST_STOP, _STOPS = 512, -160, 300


class Plateau:
    """The largest value of a channel of pixels, how much of the sphere has it, and its rim."""

    def __init__(self) -> None:
        self.high = -np.inf
        """The largest value."""
        self.area = 0.0
        """The solid angle of the pixels that have it."""
        self.pixels = 0
        """How many pixels have it. Near the poles of a lat-long these are many of little area."""
        self._areas = np.zeros(_BINS_A_STOP * _STOPS)
        """The solid angles of pixels by the logarithm of their values, complete above `_LOW`."""

    def add(self, values: Array, areas: Array) -> None:
        """Take in some pixels and their solid angles, of the same shape."""
        high = float(values.max())
        if high > self.high:
            self.high, self.area, self.pixels = high, 0.0, 0
        if high <= 0 or high < _LOW * self.high:
            return
        bright = values >= _LOW * self.high
        values, areas = values[bright], areas[bright]
        highest = values == self.high
        self.area += float(areas[highest].sum())
        self.pixels += int(np.count_nonzero(highest))
        self._areas += np.bincount(_bins(values), areas, len(self._areas))

    def suspicion(
        self,
        name: str,
        pixel: float,
        mean: float = 0.0,
        end: float | None = None,
        given: float | None = None,
    ) -> str:
        """Why the channel of this name is suspected to be clipped; else "".

        `pixel` is the solid angle of a pixel, `mean` the mean of all light. `end` is the radiance
        of the largest integer: what has it was clipped however large it is. `given` is what a
        reading gave a lamp that had been clipped: it is a plateau still, but a right one.
        """
        if self.high in HALF_LIMITS:
            return f"{name}{REACHES}{self.high:g}, the end of half precision"
        count = self.area / pixel
        if self.high <= 0 or count < CLIPPED:
            return ""
        if end is not None and abs(self.high - end) <= CONVERTED * end:
            where = f"in {self.area / (4 * np.pi):.2%} of the sphere"
            return f"{name}{REACHES}{self.high:g}, the end of its integers, {where}"
        if given is not None and abs(self.high - given) <= _ROUNDED * given:
            return ""
        is_plateau = self.area > self.between(_JUST_BELOW, 1).sum()
        if not is_plateau or self._is_box(count):
            return ""
        if self.high == _WHITE and mean > 0 and self.area < np.pi:
            where = f"in {self.area / (4 * np.pi):.2%} of the sphere"
            return f"{name}{REACHES}1, where pictures of integers end, {where}"
        if self.high < _OVER_MEAN * mean:
            return ""
        return f"{self.pixels} pixels share the maximum {self.high:.6g} of {name}"

    def _is_box(self, count: float) -> bool:
        """Whether it is large and even, with an edge that clipped light does not have."""
        outer, inner = self.between(_LOW, _MIDDLE), self.between(_MIDDLE, 1)
        # Another box, which is a little darker, is in one bin.
        width = outer.sum() - outer.max()
        is_hard, is_smooth = width < _HARD * self.area, inner.sum() > _SMOOTH * width
        return self.area > _LARGE and count >= _MANY and (is_hard or is_smooth)

    def between(self, low: float, high: float) -> Array:
        """The solid angles of pixels between two parts of the maximum, without the plateau."""
        first, last = _bins(np.array([low, high]) * self.high)
        found = self._areas[first : last + (high == 1)].copy()
        if high == 1:
            found[-1] = max(found[-1] - self.area, 0)
        return found


def _bins(values: Array) -> Array:
    return ((np.log2(values) - _LEAST_STOP) * _BINS_A_STOP).astype(np.intp)


def suspicion(
    channels: Sequence[Plateau],
    pixel: float,
    means: Sequence[float] | Array = (0, 0, 0),
    ends: Array | None = None,
    given: Array | None = None,
) -> str:
    """Why light is suspected to be clipped, by the plateaus of its channels; else "".

    All channels are cut off at about the same number, so that those far below are not looked at.
    The other arguments are those of `Plateau.suspicion`.
    """
    highest = max(each.high for each in channels)
    for channel, (each, mean) in enumerate(zip(channels, means, strict=True)):
        if each.high >= _FAR_BELOW * highest:
            known = [None if of_it is None else float(of_it[channel]) for of_it in (ends, given)]
            found = each.suspicion("RGB"[channel], pixel, mean, *known)
            if found:
                return found
    return ""


def clipping(
    radiance: Array, areas: Array, ends: Array | None = None, given: Array | None = None
) -> str:
    """Why the maximum of some pixels is suspected to be clipped; else "".

    `radiance` is of shape (n, 3). `areas` are their solid angles, shape (n,). `ends` and `given`
    are those of `Plateau.suspicion` for each channel, shape (3,).
    """
    channels = [Plateau() for _ in range(3)]
    for each, values in zip(channels, radiance.T, strict=True):
        each.add(values, areas)
    return suspicion(channels, float(areas.mean()), ends=ends, given=given)
