"""Lamps of a panorama, spread over discs that an engine's own filter finds again.

Engines that filter a panorama themselves look it up at some dozens of places for each texel of a
level, and meet a lamp of a few pixels too often or not at all: sparks and dark holes. The light of
a lamp is kept when it is spread, so that rough surfaces get what they got; a mirror shows a disc.
"""

import numpy as np

from shrm_cli.arrays import Array
from shrm_cli.lights.pixels import SpherePixels
from shrm_cli.lights.search import brightness_of, find_regions
from shrm_cli.records import record
from shrm_cli.sphere.directions import normalize
from shrm_cli.sphere.grid.latlong import LatLong

_SHARE = 0.9
"""The part of a lamp's light that lies within a disc where the lamp is smaller than that."""
_LEAST = 0.01
"""The least irradiance of a lamp, as a part of that of a surface under the mean of the light."""


@record
class Sampler:
    """How an engine filters a panorama."""

    edge: int
    """Texels along an edge of the cube that it makes of the panorama."""
    radius: float
    """The radius of the discs, in degrees: what its sharpest level resolves."""
    roughness: tuple[float, ...]
    """The perceptual roughness of its levels."""
    bare: tuple[float, ...]
    spread: tuple[float, ...]
    """`bare` and `spread`: how much of its reflection a level is off by under one lamp alone, of a
    pixel, and spread over a disc: the RMS of the differences to GGX's lobe, relative to that of the
    lobe. `tests/export/test_tamed.py` runs the filter, written out again."""

    @property
    def rows(self) -> int:
        """The most rows of a panorama of which it skips no pixel."""
        return 2 * self.edge

    def told(self) -> str:
        """Return a sentence about what a lamp alone looks like."""
        rough, off, before = (
            ", ".join(f"{scale * each:{form}}" for each in values)
            for scale, form, values in (
                (1, ".2g", self.roughness), (100, ".0f", self.spread), (100, ".0f", self.bare)
            )
        )  # fmt: skip
        return (
            f"a lamp alone, as the engine filters it: {off} % RMS from GGX's lobe at roughness "
            f"{rough}; as a pixel {before} %"
        )


def tamed(image: Array, sampler: Sampler) -> tuple[Array, list[str]]:
    """Spread the lamps of a panorama that are smaller than the discs of a sampler.

    `image` is of shape (N, 2 N, 3).

    Returns `image`, the same light, with the same sum over solid angles; and `told`, how many lamps
    were spread, what part of the light they are, and what the engine makes of one.
    """
    pixels = SpherePixels(LatLong(image.shape[0]))
    flat = np.array(image, dtype=float).reshape(-1, 3)
    areas = pixels.areas(np.arange(len(flat)))
    light = float(areas @ brightness_of(flat))
    radius = max(float(np.radians(sampler.radius)), pixels.pitch)  # some pixel is in the disc
    count, moved = 0, 0.0
    for region in find_regions(image, pixels, _LEAST * light / 4):
        own = areas[region.numbers]
        values = flat[region.numbers]
        bright = brightness_of(values)
        excess = values * np.maximum(1 - region.level / bright, 0)[:, None]
        weights = own * brightness_of(excess)
        axis = normalize(weights @ pixels.directions(region.numbers))
        disc = pixels.within(axis, radius)
        inside = np.isin(region.numbers, disc)  # a glow around it stays where it is
        if weights[inside].sum() < _SHARE * weights.sum():
            continue
        flat[region.numbers[inside]] -= excess[inside]
        flat[disc] += own[inside] @ excess[inside] / areas[disc].sum()
        count += 1
        moved += weights[inside].sum() / light
    size = f"a radius of {np.degrees(radius):.2g} degrees"
    if not count:
        return flat.reshape(image.shape), [f"no lamp is spread, as none is smaller than {size}"]
    lamps = "1 lamp is" if count == 1 else f"{count} lamps are"
    told = f"{lamps} spread over {size}: {moved:.1%} of the light"
    if radius > np.radians(sampler.radius):
        wanted = f"{sampler.radius:g} degrees"
        looks = f"the pixels are too large for discs of {wanted}; a larger size has smaller ones"
    else:
        looks = sampler.told()
    return flat.reshape(image.shape), [told, looks]
