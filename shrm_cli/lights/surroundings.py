"""What a lamp hides: the pixels of lamps, and some around them, filled from farther around."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array
from shrm_cli.lights.pixels import Indices, SpherePixels, near
from shrm_cli.records import record
from shrm_cli.sphere.directions import normalize

_GROWN = 2.3
"""Mean distances of pixels that a lamp is grown by: filters blur it, and leave dark rims."""
_RING = 1.6
"""Mean distances beyond, from which the place of the lamp is filled."""
_POWER = 3
"""Pixels of the ring count by the distance to minus this; of 2 and less far ones would win."""
_VALUES_AT_ONCE = 2**22


@record(eq=False)
class Filled:
    """The place of a lamp without the lamp."""

    numbers: Indices
    """Pixels, in row-major order, shape (n,)."""
    values: Array
    """Their radiance without the lamp, shape (n, 3)."""
    excess: Array
    """What is taken out of each pixel, shape (n, 3). Single values may be negative, at dark rims;
    no sum is."""


def fill_regions(image: Array, pixels: SpherePixels, regions: Sequence[Indices]) -> list[Filled]:
    """Take lamps out of an image, one for each region. They share no pixel.

    `image`, of shape (rows, columns, 3), is left as it is. `regions` are numbers of the pixels of
    each lamp; no pixel is in two of them.
    """
    flat = image.reshape(-1, 3)
    owner = np.full(len(flat), -1, dtype=np.int16)
    for index, numbers in enumerate(regions):
        owner[numbers] = index
    around = []
    for index, numbers in enumerate(regions):
        cap, distance = _bands(pixels, numbers)
        grown = cap[distance <= 1]
        owner[grown[owner[grown] < 0]] = index
        around.append(cap)
    return [
        _filled(flat, pixels, cap[owner[cap] == index], cap[owner[cap] < 0])
        for index, cap in enumerate(around)
    ]


def _bands(pixels: SpherePixels, numbers: Indices) -> tuple[Indices, NDArray[np.intp]]:
    """Pixels near a lamp, and the band of each: 0 in the lamp, 1 in its rim, 2 in the ring."""
    points = pixels.directions(numbers)
    total = points.sum(axis=0)
    axis = normalize(total) if np.linalg.norm(total) > 0 else points[0]
    widest = 2 * np.arcsin(min(np.linalg.norm(points - axis, axis=1).max() / 2, 1.0))
    outer = (_GROWN + _RING) * pixels.pitch
    cap = np.union1d(pixels.within(axis, float(widest) + outer), numbers)
    band = np.where(np.isin(cap, numbers, assume_unique=True), 0, 3)
    outside = np.flatnonzero(band)
    around = pixels.directions(cap[outside])
    for number, reach in ((2, outer), (1, _GROWN * pixels.pitch)):
        band[outside[near(around, points, reach)]] = number
    return cap[band < 3], band[band < 3]


def _filled(flat: Array, pixels: SpherePixels, place: Indices, ring: Indices) -> Filled:
    """Fill a lamp's place from a ring, each pixel of which counts by its distance and its area."""
    before = flat[place].astype(float)
    areas = pixels.areas(place)
    if len(ring):
        values = _interpolated(pixels, place, ring, flat[ring].astype(float))
    else:  # all around are other lamps
        values = np.zeros_like(before)
    # A red sun may be darker in blue than what is around it: it takes nothing, and adds nothing.
    there, filled = areas @ before, areas @ values
    values *= np.minimum(there / np.where(filled > 0, filled, 1), 1)
    stored = values.astype(np.float32)
    return Filled(place, stored, before - stored)


def _interpolated(pixels: SpherePixels, place: Indices, ring: Indices, values: Array) -> Array:
    """Shepard's interpolation at the pixels of a place, shape (n, 3)."""
    sources, weights = pixels.directions(ring), pixels.areas(ring)
    targets = pixels.directions(place)
    result = np.empty((len(place), 3))
    step = max(_VALUES_AT_ONCE // len(ring), 1)
    for start in range(0, len(place), step):
        some = targets[start : start + step]
        squares = np.maximum(2 - 2 * (some @ sources.T), (pixels.pitch / 4) ** 2)
        shares = weights * squares ** (-_POWER / 2)
        result[start : start + step] = shares @ values / shares.sum(axis=1, keepdims=True)
    return result
