"""The columns of a sheet: a probe with its exposure, and a map of it for each material.

A probe is read once, and projected once to each order, for all its maps. What goes wrong with one
pair, or with one probe, leaves the others alone, as in `shrm batch`.

A probe's exposure comes from its light alone, so that all materials share it. It is metered as
photographers do with an incident-light meter: by a white, diffuse ball, which is lit by the whole
probe. The luminance that a tenth of the ball's surface exceeds is shown as 80 % of white. It
depends neither on the materials nor on the view, so that a turntable does not flicker.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from shrm_cli.batch.work import error_line
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.color import to_rec709
from shrm_cli.files.picture import Picture
from shrm_cli.maps.base import Map
from shrm_cli.maps.lamps.map import LampMap
from shrm_cli.maps.prefiltered import Prefiltered
from shrm_cli.maps.seen import as_candidate
from shrm_cli.plan.search import Goal
from shrm_cli.prefilter import prefilter_with_facts
from shrm_cli.probe.open import open_probe
from shrm_cli.probe.options import ReadOptions
from shrm_cli.probe.probe import Probe
from shrm_cli.probe.resample import coarse_probe
from shrm_cli.probe.shared import shared
from shrm_cli.progress import Progress, Stages
from shrm_cli.records import record
from shrm_cli.render.camera import Viewer, background_rows
from shrm_cli.render.image import expose, weighted_quantiles
from shrm_cli.render.sphere import render_background, render_sphere
from shrm_cli.sphere.cube import cube_directions, cube_solid_angles
from shrm_cli.vocabulary import AUTO, LUMINANCE

SHOWN = 0.8
"""Linear grey, 1 being white, of the luminance that is metered: 231 of 255 in sRGB."""
BRIGHTEST = 0.1
"""The part of the ball's surface that is brighter than what is metered."""
_TEXELS = 16
"""Texels along an edge of the cube on which the ball is sampled; irradiance is smooth."""
_STEP = 0.1
"""Stops to which exposures are rounded, so that a label states them exactly."""
_MOST = 32.0
"""The most stops either way, as `shrm render --exposure` takes them."""


@record
class Wanted:
    """What is made of every probe."""

    specs: Sequence[str]
    """The materials."""
    to: str
    arguments: Mapping[str, Any]
    """The other arguments of `shrm_cli.prefilter.prefilter`."""
    size: int
    exposure: float | None = None
    """Stops; by default each probe has its own, see `metered`."""


@record
class Column:
    """A probe and its maps."""

    path: str
    cells: tuple[Map | str, ...]
    """For each material the map, or why there is none."""
    surroundings: Probe | None = None
    """What is seen behind the spheres; None if the probe cannot be used."""
    exposure: float = 0.0
    """Stops."""
    warnings: tuple[str, ...] = ()
    """About the probe, and about maps."""

    def tiles(self, viewer: Viewer, size: int) -> Iterator[Picture | str]:
        """Draw the spheres before their surroundings.

        Yields an array of float32 of shape (size, size, 3), or str: linear Rec.709, exposed; where
        there is no map, why.
        """
        behind = None
        if self.surroundings is not None:
            behind = render_background(self.surroundings, viewer, size)
        for cell in self.cells:
            if isinstance(cell, str):
                yield cell
                continue
            drawn = expose(render_sphere(cell, viewer, size, behind), self.exposure)
            matrix = to_rec709(cell.info.chromaticities)
            yield drawn if matrix is None else drawn @ matrix.T.astype(np.float32)


def metered(probe: Probe) -> float:
    """Return the exposure of a probe in stops, a multiple of a tenth; 0 if it is black.

    Raises ProbeError if the probe cannot be read.
    """
    ball = prefilter_with_facts(probe, "irradiance", {"window": "auto"}).map
    normals = cube_directions(_TEXELS)
    radiance = ball.radiance(normals, normals)  # of a white surface: its irradiance over pi
    matrix = to_rec709(probe.chromaticities)
    shown = radiance if matrix is None else radiance @ matrix.T
    areas = np.tile(cube_solid_angles(_TEXELS, "center"), (6, 1))
    (level,) = weighted_quantiles(shown @ LUMINANCE, areas, [1 - BRIGHTEST])
    if not level > 0:
        return 0.0
    stops = round(float(np.log2(SHOWN / level)) / _STEP) * _STEP
    return round(min(max(stops, -_MOST), _MOST), 6)


def make_column(
    path: str, reading: ReadOptions, wanted: Wanted, progress: Progress | None = None
) -> Column:
    """Make the maps of a probe. Where it cannot be used, all cells say why.

    `reading` is how the probe is read.
    """
    count = len(wanted.specs)
    try:
        probe = shared(open_probe(path, reading))
        exposure = metered(probe) if wanted.exposure is None else wanted.exposure
        behind = coarse_probe(probe, background_rows(wanted.size))
    except Exception as error:  # whatever is wrong with one probe must not stop the others
        return Column(path, (error_line(error),) * count)
    cells: list[Map | str] = []
    told: list[str] = []
    stages = Stages(progress, count)
    for spec in wanted.specs:
        try:
            made = _made(probe, wanted, spec, stages.within)
        except Exception as error:
            cells.append(error_line(error))
        else:
            cells.append(made.map)
            told += [f"{spec}: {line}" for line in made.warnings]
        stages.done(len(cells), count)
    # What the pixels needed is known when they have been read.
    warnings = (*probe.report.warnings(), *told)
    return Column(path, tuple(cells), behind, exposure, warnings)


def _made(probe: Probe, wanted: Wanted, spec: str, progress: Progress) -> Prefiltered:
    """Make a map; with the lamps beside it where that is the better picture.

    Here it matters nothing that shaders have no code for the lamps of some BRDFs.
    """
    given = {**wanted.arguments, "brdf": spec}
    made = prefilter_with_facts(probe, wanted.to, given, progress)
    is_done = wanted.to != AUTO or isinstance(made.map, LampMap)
    if is_done or parse_spec(spec).center == "tangent":  # discs are not of fibres
        return made
    goal = Goal.of(wanted.arguments.get("error"), wanted.arguments.get("seen"))
    found = as_candidate(made)
    if found.keeps(goal):
        return made
    apart = prefilter_with_facts(probe, AUTO, given | {"sun": "split"})
    split = as_candidate(apart)
    return min(found, split, key=lambda each: each.badness(goal)).make()
