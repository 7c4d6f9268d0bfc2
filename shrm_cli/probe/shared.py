"""A probe of which several maps are made: it is read, and its lamps are looked for, once.

It is projected once to each order. An image of many pixels is not held, but read again for each
projection. That takes far longer than the projection, of which there are two at most therefore.
"""

from collections.abc import Callable
from dataclasses import field, fields, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

from shrm_cli.arrays import Array
from shrm_cli.probe.image import ImageOfImage
from shrm_cli.probe.light_sum import LightSum
from shrm_cli.probe.probe import Probe
from shrm_cli.records import once_each, record

if TYPE_CHECKING:
    from shrm_cli.probe.lighting import Lighting

MOST_BYTES = 128 * 2**20
"""The most bytes of an image's pixels that are held. Larger images are read again and again."""
_PIXEL = 3 * 4  # bytes


@record(eq=False)
class HeldImage(ImageOfImage):
    """An image whose pixels stay in memory from the first time that they are read."""

    def read(self, start: int, stop: int) -> Array:
        return self._pixels[start:stop].copy()

    @cached_property
    def _pixels(self) -> Array:
        return self.image.read(0, self.height)


@record
class SharedProbe(Probe):
    """A probe that remembers its pixels, its digest, and its coefficients to each order.

    Every map that is made of it has the same bytes as one that is made of the probe alone, but for
    the rounding of coefficients of images that are not held.
    """

    kept: dict[int | str, Any] = field(default_factory=dict)
    """What was computed of the light, by what it is: `shrm_cli.probe.lighting.project` keeps
    coefficients by their order, `shrm_cli.lights.beside` the lamps, and
    `shrm_cli.maps.splitsum.prefilter` the light as a cube."""
    project: "Callable[[int], Lighting] | None" = None
    """Projects the light to an order, where its coefficients are not those of its pixels."""

    @once_each
    def digest(self) -> str:
        """SHA-256 of the bytes of the files, which are read for it once."""
        return super().digest()

    def multiplied(self, matrix: Array, primaries: tuple[float, ...] | None) -> Probe:
        """The probe of pixels multiplied by a matrix, of which nothing is remembered."""
        return Probe.multiplied(replace(self, kept={}, project=None), matrix, primaries)

    @property
    def is_held(self) -> bool:
        """Whether its pixels stay in memory."""
        return all(isinstance(image, HeldImage) for image in self.images)

    @classmethod
    def of(cls, probe: Probe, project: "Callable[[int], Lighting] | None" = None) -> "SharedProbe":
        """Return a probe of the same pixels, which are held unless they are too many."""
        values = {each.name: getattr(probe, each.name) for each in fields(Probe)}
        size = sum(image.width * image.height for image in probe.images) * _PIXEL
        if size <= MOST_BYTES:
            values["images"] = tuple(HeldImage(image) for image in probe.images)
        return cls(**values, project=project)


def shared(probe: Probe) -> Probe:
    """Return a probe to make several maps of; a sum of lights as it is, as one that is shared."""
    return probe if isinstance(probe, LightSum | SharedProbe) else SharedProbe.of(probe)


def shared_if_held(probe: Probe) -> Probe:
    """Return what `shared` does, but a probe of too many pixels to be held as it is.

    So every map has the bytes of one that is made of the probe alone.
    """
    found = shared(probe)
    return probe if isinstance(found, SharedProbe) and not found.is_held else found
