"""Coarse probes, whose pixels are large beside lobes and horizons, cut into smaller ones.

A lat-long of H rows has the degrees below H, whose waves its pixels can hold. Those of a narrow
lobe go on, and light that ends where they do not is rings around a lamp, with black between them:
of 32 x 16 pixels a map of GGX of roughness .3 had 95 % of wrong pixels. Under wide lobes a lamp
rises above the horizon all at once, where its pixel is a point. What a pixel says is that
all of it is as bright; so it is cut into parts which are, and its edges have all degrees. Light
that has hardly more degrees, as a sky above a plain, goes on between its pixels' middles; one that
has no more of them is what these say, and is left alone.
Degrees above half of the rows are aliases of each other in sums over few pixels. Light that has
them, as that of a horizon, has another energy there than its coefficients, less or more.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array
from shrm_cli.probe.image import ArrayImage, ProbeImage
from shrm_cli.probe.pixels import PixelPolicy, PixelReport
from shrm_cli.probe.probe import Probe
from shrm_cli.records import record
from shrm_cli.sphere.cube import cube_directions
from shrm_cli.sphere.grid.cube import Cube
from shrm_cli.sphere.grid.latlong import LatLong, sample_latlong_cubic
from shrm_cli.vocabulary import COARSE_ROWS

if TYPE_CHECKING:
    from shrm_cli.probe.light_sum import LightSum

_BEYOND = 1e-4
"""The part of the light's energy that its degrees may miss or have too much: 1 % as RMS."""
_RINGS = 1e-5
"""The part from which the series of the degrees rings beside a horizon, so that light goes on
between the middles of pixels as a cubic filter has it: of skies of 32 and 64 rows 7 and 2 e-5,
whose maps had rings of 4 % and 1 %. Light without a horizon has 1e-6."""


@record(eq=False)
class _Parts(ArrayImage):
    """The parts of an image's pixels; what tells it from others is that image itself."""

    images: tuple[ProbeImage, ...]

    def contents(self) -> Iterator[bytes]:
        for image in self.images:
            yield from image.contents()


def fine_probe(probe: Probe) -> Probe:
    """Return the same light in pixels as small as those of a lat-long of `COARSE_ROWS`.

    Returns the probe itself where it is as fine, or has no degrees beyond those of its pixels.
    Otherwise a probe in memory, with the digest of the first one, whose report tells what the
    pixels needed. Of a sum of lights each probe is as fine as `SumImage.fine_rows` tells.
    """
    if not probe.may_be_coarse:
        return probe
    from shrm_cli.probe.light_sum import LightSum  # most runs have none, and load no more modules

    return _fine_sum(probe) if isinstance(probe, LightSum) else _refined(probe, COARSE_ROWS)


def _refined(probe: Probe, rows: int) -> Probe:
    """Return a probe in pixels as small as those of some rows, unless its degrees say all of it."""
    if not _may_be_cut(probe, rows):
        return probe
    beyond = _energy_beyond(probe)
    if beyond > _BEYOND:
        return _cut(probe, rows)
    return _continued(probe) if probe.may_be_coarse and beyond > _RINGS else probe


def _may_be_cut(probe: Probe, rows: int) -> bool:
    """Whether a probe is coarser than a lat-long of some rows, and no pixels of it are halves."""
    return probe.grid.resolution < rows and probe.sampling == "center"


def _cut(probe: Probe, rows: int) -> Probe:
    """Return a probe in parts of its pixels, as small as those of a lat-long of some rows."""
    count = int(np.ceil(rows / probe.grid.resolution))
    image, used = probe.image(), probe.grid.used()
    if used is not None:
        image = _over_rim(image, used)
    pixels = image.repeat(count, axis=0).repeat(count, axis=1)
    is_cube = probe.grid.faces > 1
    return Probe(
        probe.name, replace(probe.grid, size=count * probe.grid.size),
        "openexr" if is_cube else probe.layout, "openexr" if is_cube else None, probe.matrix,
        PixelPolicy(), probe.chromaticities, (_Parts(pixels, probe.name, probe.images),),
        proxy=probe.proxy,
    )  # fmt: skip


def _fine_sum(light: "LightSum") -> "LightSum":
    """Return a sum of the same lights, whose probes are fine."""
    image = light.image_of_sum
    probes = [_refined(term.probe, image.fine_rows) for term in light.terms]
    if all(fine is term.probe for fine, term in zip(probes, light.terms, strict=True)):
        return shown_sum(light)
    terms = []
    for fine, term in zip(probes, light.terms, strict=True):
        if fine is not term.probe:  # it says what the pixels needed that it was made of
            said = PixelReport(notes=tuple(term.probe.report.warnings()))
            term = replace(term, probe=replace(fine, report=said))
        terms.append(term)
    image = replace(image, terms=tuple(terms))
    return shown_sum(replace(light, image_of_sum=image, images=(image,)))


def shown_sum(light: "LightSum") -> "LightSum":
    """Return a sum of lights as pixels show it, which no series is negative in."""
    from shrm_cli.probe.light_sum import Term

    image, part = light.image_of_sum, light.image_of_sum.positive_part
    if part is None:
        return light
    pixels = image.shown_series().astype(np.float32)
    probe = Probe(
        image.name, LatLong(image.height), "latlong", None, np.eye(3), PixelPolicy(),
        light.chromaticities, (_Parts(pixels, image.name, ()),),
    )  # fmt: skip
    image = replace(
        image, terms=(*image.terms, Term(probe, np.ones(3))), series=None,
        notes=(*image.notes, part.told),
    )  # fmt: skip
    return replace(light, image_of_sum=image, images=(image,))


def _over_rim(image: Array, used: NDArray[np.bool_]) -> Array:
    """Give pixels beside those that hold radiance the mean of these: parts of them do, too."""
    height, width = used.shape
    held = np.pad(np.dstack([np.where(used[..., None], image, 0), used]), ((1, 1), (1, 1), (0, 0)))
    nine = [held[i : i + height, j : j + width] for i in range(3) for j in range(3)]
    sums = np.sum(nine, axis=0)
    means = sums[..., :-1] / np.maximum(sums[..., -1:], 1)
    return np.where(used[..., None], image, means).astype(image.dtype)


def _energy_beyond(probe: Probe) -> float:
    """The part of the light's energy in degrees that its pixels do not hold, or that they alias."""
    analysis, energy = probe.grid.analysis(probe.grid.resolved_order), 0.0
    with np.errstate(over="ignore", invalid="ignore"):  # whoever projects it refuses what overflows
        for start, pixels, weights in probe.blocks():
            analysis.add(start, pixels, weights)
            squares = np.sum(pixels.astype(float) ** 2, axis=-1)
            energy += float(np.sum(weights * squares))
        known = np.sum(analysis.coefficients() ** 2)
    return abs(energy - float(known)) / energy if energy > 0 else 0.0


def summed_probe(probe: Probe, rows: int) -> Probe:
    """Return the same light for sums over pixels under lobes that are narrower than these.

    `probe` is as `fine_probe` returns it, which leaves smooth light alone: of large pixels it is
    brought to small ones, between whose middles it goes on. Then pixels are cut to those of a
    lat-long of some rows, because at its poles large ones are no rectangles.

    Returned is the probe itself where it is a sum of lights.
    """
    from shrm_cli.probe.light_sum import LightSum

    if isinstance(probe, LightSum):
        return probe
    if probe.may_be_coarse:
        probe = _continued(probe)
    return _cut(probe, rows) if _may_be_cut(probe, rows) else probe


def _continued(probe: Probe) -> Probe:
    """Return smooth light as it is at the texels of a fine cube, between the middles of pixels.

    The series of its degrees would ring beside a horizon by the little that they miss.
    """
    image, directions = probe.image(), cube_directions(COARSE_ROWS)
    is_latlong = isinstance(probe.grid, LatLong) and probe.sampling == "center"
    pixels = (
        sample_latlong_cubic(image, directions) if is_latlong
        else probe.grid.sampler(image)(directions)
    )  # fmt: skip
    made = _Parts(np.maximum(pixels, 0, dtype=np.float32), probe.name, probe.images)
    return Probe(
        probe.name, Cube(COARSE_ROWS), "openexr", "openexr", probe.matrix,
        PixelPolicy(), probe.chromaticities, (made,), proxy=probe.proxy,
    )  # fmt: skip
