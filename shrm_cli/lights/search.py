"""Where the lamps of an image are: compact places that are much brighter than what is around them.

There is no luminance above which a pixel is a lamp. What is bright is cut out at a low level
first. A piece of it is a lamp if it is compact and stands out; else it is cut again at a higher
level, so that every lamp has a level of its own. Pieces that give less irradiance than the error
that is allowed are not followed.
"""

import numpy as np

from shrm_cli import progress
from shrm_cli.arrays import Array, Indices
from shrm_cli.lights.pixels import SpherePixels, clusters
from shrm_cli.records import record

_FLOOR = 2.0
"""The lowest level, over the mean brightness of an image whose brightest pixels are dimmed."""
_DIMMED = 4.0
"""The brightest pixels are dimmed to the mean times this: no sun is to raise the level."""
_STEP = 2**0.5
_STANDS_OUT = 16.0
"""The brightness of a lamp above its level is at least the level times this."""
_COMPACT = 9.0
"""The most area of a piece, over the area on which its typical brightness gives all its light."""
_SMALL = 12.0
"""Pieces of fewer pixels are always compact: a filter spreads a point over as many."""
LARGEST = 0.061
"""The largest lamp in sr: a disc with a radius of 8 degrees. What is larger is sky or a wall."""
_REACH = 1.3
"""Pixels nearer than this many mean distances are beside each other; in the middle of a cube's
face they are 1.27 times as far apart as on average."""


@record(eq=False)
class Region:
    """The pixels of a lamp."""

    numbers: Indices
    """The pixels, counted in row-major order, shape (n,)."""
    level: float
    """The brightness that they exceed."""
    irradiance: float
    """The irradiance of a surface that faces what exceeds the level, mean of the channels."""


def brightness_of(image: Array) -> Array:
    """The mean of the channels, shape (..., 3) -> (...), of any numbers that pixels can hold."""
    thirds = np.full(3, 1 / 3, image.dtype)  # the sum of three large numbers would overflow
    return np.einsum("...c,c->...", image, thirds)


def typical_brightness(brightness: Array, areas: Array) -> float:
    """The brightness that half of the light comes from pixels of, or of brighter ones.

    It is that of the disc itself where pixels on its rim are covered in part.
    """
    order = np.argsort(brightness)[::-1]
    light = np.cumsum((brightness * areas)[order])
    return float(brightness[order[min(np.searchsorted(light, light[-1] / 2), len(order) - 1)]])


def find_regions(
    image: Array, pixels: SpherePixels, least: float, largest: float = LARGEST
) -> list[Region]:
    """Find the lamps of an image, that of the most light first. They share no pixel.

    `image` is of shape (rows, columns, 3). `pixels` are its cells. `least` is the least irradiance
    of a lamp, mean of the channels. `largest` is the solid angle of the largest lamp, sr.
    """
    flat = brightness_of(image).ravel()
    floor = _FLOOR * _background(flat, pixels)
    numbers = np.flatnonzero(flat > floor)
    if not len(numbers):
        return []
    bright = flat[numbers].astype(float)
    directions, areas = pixels.directions(numbers), pixels.areas(numbers)
    found = []
    waiting = [(np.arange(len(numbers)), floor)]
    while waiting:
        progress.report(len(bright) - sum(len(inside) for inside, _ in waiting), len(bright))
        inside, level = waiting.pop()
        inside = inside[bright[inside] > level]
        if not len(inside):
            continue
        labels = clusters(directions[inside], _REACH * pixels.pitch)
        light = np.bincount(labels, (bright[inside] - level) * areas[inside])
        order = np.argsort(labels, kind="stable")
        ends = np.cumsum(np.bincount(labels))
        for label in np.flatnonzero(light >= least):
            piece = inside[order[ends[label - 1] if label else 0 : ends[label]]]
            of_piece = bright[piece] - level, areas[piece]
            if areas[piece].sum() <= largest and _is_lamp(*of_piece, level, pixels.pitch):
                found.append(Region(numbers[piece], level, float(light[label])))
            else:
                waiting.append((piece, level * _STEP))
    return sorted(found, key=lambda each: -each.irradiance)


def _background(flat: Array, pixels: SpherePixels) -> float:
    """Mean brightness over the sphere of an image whose brightest pixels are dimmed."""
    rows = pixels.grid.shape[0]
    weights = pixels.grid.weights()
    planes = flat.reshape(rows, -1)

    def mean(values: Array) -> float:
        if weights.shape[1] == 1:
            return float(weights[:, 0] @ values.sum(axis=1, dtype=float)) / (4 * np.pi)
        return float((weights * values).sum()) / (4 * np.pi)

    return mean(np.minimum(planes, _DIMMED * mean(planes)))


def _is_lamp(excess: Array, areas: Array, level: float, pitch: float) -> bool:
    """Whether a piece is compact, and stands out of its surroundings."""
    area = areas.sum()
    typical = typical_brightness(excess, areas)
    core = (excess @ areas) / typical
    return bool(typical >= _STANDS_OUT * level and area <= max(_COMPACT * core, _SMALL * pitch**2))
