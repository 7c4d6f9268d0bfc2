"""`lookdev`: a sheet with a row for each material and a column for each probe.

A probe is read once, and projected once to each order, for all its maps. What goes wrong with one
pair, or with one probe, leaves the others alone, as in `shrm batch`.

A probe's exposure comes from its light alone, so that all materials share it. It is metered as
photographers do with an incident-light meter: by a white, diffuse ball, which is lit by the whole
probe. The luminance that a tenth of the ball's surface exceeds is shown as 80 % of white. It
depends neither on the materials nor on the view, so that a turntable does not flicker.
"""

import base64
import html
import os
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from time import perf_counter
from typing import Any

import numpy as np

from shrm_cli.batch.work import error_line
from shrm_cli.brdf.base import COMMA, cut
from shrm_cli.brdf.spec import file_label, names_file, parse_spec
from shrm_cli.brdf.sums import is_sum, term_texts
from shrm_cli.color import to_rec709
from shrm_cli.files.html_page import asset, html_page
from shrm_cli.files.image import Picture
from shrm_cli.maps.base import Map
from shrm_cli.maps.lamps.map import LampMap
from shrm_cli.maps.options import counted
from shrm_cli.maps.request import Prefiltered, check_arguments
from shrm_cli.maps.seen import as_candidate
from shrm_cli.messages import several, shown, whole_number, without_name
from shrm_cli.naming import probe_stem
from shrm_cli.plan.search import Goal
from shrm_cli.prefilter import prefilter_with_facts
from shrm_cli.probe.open import open_probe
from shrm_cli.probe.options import ReadOptions
from shrm_cli.probe.probe import Probe
from shrm_cli.probe.resample import coarse_probe
from shrm_cli.probe.shared import shared
from shrm_cli.progress import Progress, Stages, tell
from shrm_cli.records import record
from shrm_cli.render.camera import Viewer, background_rows
from shrm_cli.render.image import expose, weighted_quantiles
from shrm_cli.render.sheet import Grid, draw_grid
from shrm_cli.render.sphere import render_background, render_sphere
from shrm_cli.sphere.cube import cube_directions, texel_solid_angles
from shrm_cli.vocabulary import AUTO, LARGEST_HALF, LUMINANCE, MAX_PICTURE_SIZE

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
    """The map of each material, or why there is none."""
    surroundings: Probe | None = None
    """What is seen behind the spheres; None if the probe cannot be used."""
    exposure: float = 0.0
    """Stops."""
    warnings: tuple[str, ...] = ()
    """About the probe, and about maps."""

    def failures(self, specs: Sequence[str]) -> list[str]:
        """A line for each material, of specifications, that has no map; one where none has any
        because the probe cannot be used.
        """
        lines = [
            (spec, without_name(cell, self.path))
            for spec, cell in zip(specs, self.cells, strict=True)
            if isinstance(cell, str)
        ]
        if self.surroundings is None:
            return [f"{self.path}: {lines[0][1]}"]
        return [f"{self.path}, {spec}: {why}" for spec, why in lines]

    def worded(self, words: Callable[[str], str]) -> "Column":
        """Return the same with other words for why cells have no map."""
        cells = (words(cell) if isinstance(cell, str) else cell for cell in self.cells)
        return replace(self, cells=tuple(cells))

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
            drawn = np.maximum(render_sphere(cell, viewer, size, behind), 0)
            drawn = expose(drawn, self.exposure)
            matrix = to_rec709(cell.info.chromaticities)
            yield drawn if matrix is None else drawn @ matrix.T.astype(np.float32)


def metered(probe: Probe) -> float:
    """Return the exposure of a probe in stops, a multiple of a tenth; 0 if it is black."""
    ball = prefilter_with_facts(probe, "irradiance", {"window": "auto"}).map
    normals = cube_directions(_TEXELS)
    radiance = ball.radiance(normals, normals)  # of a white surface: its irradiance over pi
    matrix = to_rec709(probe.chromaticities)
    seen = radiance if matrix is None else radiance @ matrix.T
    areas = texel_solid_angles(_TEXELS)
    (level,) = weighted_quantiles(seen @ LUMINANCE, areas, [1 - BRIGHTEST])
    if not level > 0:
        return 0.0
    stops = round(float(np.log2(SHOWN / level)) / _STEP) * _STEP
    return round(min(max(stops, -_MOST), _MOST), 6)


def make_column(
    path: str, reading: ReadOptions, wanted: Wanted, progress: Progress | None = None
) -> Column:
    """Make the maps of a probe. Where it cannot be used, all cells say why."""
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
            made = _make(probe, wanted, spec, stages.within)
        except Exception as error:
            cells.append(error_line(error))
        else:
            cells.append(made.map)
            told += [f"{spec}: {line}" for line in made.warnings]
        stages.done(len(cells), count)
    # What the pixels needed is known when they have been read.
    warnings = (*probe.report.warnings(), *told)
    return Column(path, tuple(cells), behind, exposure, warnings)


def _make(probe: Probe, wanted: Wanted, spec: str, progress: Progress) -> Prefiltered:
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


# ---- the sheet -----------------------------------------------------------------------------------


@record(eq=False)
class Lookdev:
    """Materials under probes."""

    columns: tuple[Column, ...]
    """The probes with the maps of all materials."""
    specs: tuple[str, ...]
    """The materials."""
    to: str
    arguments: Mapping[str, Any]
    """The other arguments that they were made with."""
    size: int

    @property
    def grid(self) -> Grid:
        """The cells of the sheet."""
        return Grid(len(self.specs), len(self.columns), self.size)

    @property
    def names(self) -> list[str]:
        """Short names of the probes."""
        return probe_names([each.path for each in self.columns])

    @property
    def sides(self) -> list[str]:
        """Short names of the materials."""
        return material_names(self.specs)

    @property
    def failures(self) -> list[str]:
        """A line for each probe that cannot be used, and for each other cell without a map, which
        says why.
        """
        return [line for column in self.columns for line in column.failures(self.specs)]

    def worded(self, words: Callable[[str], str]) -> "Lookdev":
        """Return the same with other words for why cells have no map: the library's messages name
        its arguments in backticks.
        """
        return replace(self, columns=tuple(each.worded(words) for each in self.columns))

    def sheets(
        self, viewers: Sequence[Viewer], progress: Progress | None = None
    ) -> Iterator[Picture]:
        """Yield the sheet for each viewer, linear Rec.709."""
        heads = [
            name if column.surroundings is None else f"{name}  EV {column.exposure:+.1f}"
            for column, name in zip(self.columns, self.names, strict=True)
        ]
        stages, begun = Stages(progress, len(viewers)), perf_counter()
        for done, viewer in enumerate(viewers, 1):
            yield draw_grid(self.grid, heads, self.sides, self._tiles(viewer, stages.within))
            stages.done(done, len(viewers))
            if done == 1:
                stages.tell_time_left((perf_counter() - begun) * (len(viewers) - 1))

    def page(self, viewer: Viewer, progress: Progress | None = None) -> str:
        """Return the sheet as a page of HTML with a slider for each column, to be UTF-8."""
        cells: list[list[Picture | str]] = [[] for _ in self.columns]
        for _, index, tile in self._tiles(viewer, progress):
            cells[index].append(tile)
        return lookdev_page(self.columns, self.names, self.sides, cells, self.size)

    def _tiles(
        self, viewer: Viewer, progress: Progress | None
    ) -> Iterator[tuple[int, int, Picture | str]]:
        """Yield row, column and picture of each cell, or why it has none."""
        for index, column in enumerate(self.columns):
            for row, tile in enumerate(column.tiles(viewer, self.size)):
                yield row, index, tile
            tell(progress, index + 1, len(self.columns))


def lookdev(
    probes: Sequence[str] | str,
    brdfs: Sequence[str] | str,
    to: str = AUTO,
    *,
    size: int = 256,
    exposure: float | None = None,
    reading: ReadOptions | None = None,
    progress: Progress | None = None,
    **arguments: Any,
) -> Lookdev:
    """Make the maps of materials under probes, to be drawn as one sheet.

    What goes wrong with one pair leaves the others alone; its cell says why.

    Parameters
    ----------
    probes : sequence of str, or one
        Paths of light probes.
    brdfs : sequence of str, or one
        The materials, as specifications.
    to : str
        The representation of the maps, one that is made for a BRDF, or ``auto``: what the picture
        needs, with lamps beside the map where nothing else gives the right picture.
    size : int
        Width and height of a cell, pixels.
    exposure : float, optional
        Stops; by default each probe has its own, see `shrm_cli.lookdev.sheet`.
    reading : ReadOptions, optional
        How the probes are read.
    progress : callable, optional
        Called with the amount of work done and the amount in all.
    **arguments
        Other arguments of `prefilter`.

    Returns
    -------
    Lookdev

    Raises
    ------
    ArgumentError, BrdfError
        If an argument or a material is wrong for all probes.
    OutputError
        If the sheet would be too large.

    Examples
    --------
    >>> made = shrm.lookdev(["probes/studio.exr"], ["lambertian"], size=32)
    >>> made.sides, made.failures
    (['lambertian'], [])
    >>> [picture.shape[2] for picture in made.sheets([shrm.Viewer(30, 10)])]
    [3]
    """
    check_arguments(to, [*arguments, "brdf"])
    probes, brdfs = [os.fspath(each) for each in several(probes, "probes")], several(brdfs, "brdfs")
    whole_number("size", size, 1, MAX_PICTURE_SIZE)
    for spec in brdfs:
        parse_spec(spec)  # what is wrong with a material is said before the work begins
    Grid(len(brdfs), len(probes), size).check()
    wanted = Wanted(brdfs, to, arguments, size, exposure)
    columns: list[Column] = []
    stages = Stages(progress, len(probes))
    for path in probes:
        columns.append(make_column(path, reading or ReadOptions(), wanted, stages.within))
        stages.done(len(columns), len(probes))
    return Lookdev(tuple(columns), tuple(brdfs), to, arguments, size)


# ---- its page: one file, without a network, whose columns can be exposed anew --------------------


_MOST_CHARACTERS = 24
"""Characters of a short name; longer ones end in an ellipsis."""
_STOPS = 8
"""Stops that a slider goes either way."""


def lookdev_page(
    columns: "Sequence[Column]",
    heads: Sequence[str],
    sides: Sequence[str],
    tiles: Sequence[Sequence[Picture | str]],
    size: int,
) -> str:
    """Return a page of a sheet: HTML, to be written as UTF-8.

    `heads` and `sides` are the names of the probes and of the materials. `tiles` are for each
    column the picture of each material, shape (size, size, 3), linear Rec.709 and exposed, or why
    there is none.
    """
    style = f":root {{ --cell: {size}px; }}\n" + asset("lookdev", "page.css")
    script = asset("lookdev", "page.js")
    sections = [
        _section(column, head, sides, cells, size)
        for column, head, cells in zip(columns, heads, tiles, strict=True)
    ]
    title = f"{counted(len(sides), 'material')}, {counted(len(heads), 'probe')}"
    body = [
        f"<h1>{title}</h1>",
        "<p>Every sphere stands before its own light. A slider exposes its column anew, in "
        "stops.</p>",
        "<main>",
        *sections,
        "</main>",
    ]
    return html_page(f"{title} \u2013 shrm", "\n".join(body), style, script)


def _section(
    column: "Column", head: str, sides: Sequence[str], cells: Sequence[Picture | str], size: int
) -> str:
    name = html.escape(head)
    lines = ["<section>", "<header>", f'<h2 title="{html.escape(shown(column.path))}">{name}</h2>']
    if any(not isinstance(cell, str) for cell in cells):
        lines.append(
            f'<label><input type="range" min="-{_STOPS}" max="{_STOPS}" step="0.1" value="0" '
            f'data-own="{column.exposure:.6g}" aria-label="Exposure of {name}">'
            "<output></output>"
            f'<button type="button" title="The probe\'s own exposure" aria-label="Reset the '
            f'exposure of {name}">\u21ba</button></label>'
        )
    else:
        lines.append('<div class="none">no picture</div>')
    lines += ["</header>", '<div class="cells">']
    for side, cell in zip(sides, cells, strict=True):
        caption = html.escape(side)
        drawn = (
            f'<div class="failed">{html.escape(cell)}</div>'
            if isinstance(cell, str)
            else f'<canvas width="{size}" height="{size}" role="img" '
            f'aria-label="{caption}, {name}"></canvas>'
            f'<script type="text/plain">{_halves(cell)}</script>'
        )
        title = f"{caption}" if isinstance(cell, str) else f"{caption} \u00b7 {name}"
        lines.append(f'<figure>{drawn}<figcaption title="{title}">{caption}</figcaption></figure>')
    return "\n".join([*lines, "</div>", "</section>"])


def _halves(picture: Picture) -> str:
    """Return a picture as half floats in base64, little-endian, RGB of row after row."""
    limited = np.clip(picture, -LARGEST_HALF, LARGEST_HALF).astype("<f2")
    return base64.b64encode(limited.tobytes()).decode("ascii")


def material_names(specs: Sequence[str]) -> list[str]:
    """Return a short name for each specification of a BRDF, and no two alike.

    ``ggx:roughness=0.4,f0=gold`` is ``ggx 0.4 gold``, a measured file is its name without folder
    and suffix, and ``0.9*lambertian+0.1*ggx`` is ``lambertian + ggx``. Where that is the same for
    two of them, both keep all that they say.
    """
    return _unambiguous([_short(spec) for spec in specs], [file_label(spec) for spec in specs])


def probe_names(paths: Sequence[str]) -> list[str]:
    """Return a short name for each probe: that of its file, with its folder where two are alike."""
    return _unambiguous([probe_stem(path) for path in paths], paths)


def _unambiguous(short: Sequence[str], full: Sequence[str]) -> list[str]:
    counts = Counter(short)
    return [name if counts[name] == 1 else text for name, text in zip(short, full, strict=True)]


def _short(spec: str) -> str:
    if is_sum(spec):
        return _shortened(" + ".join(_short(term).partition(" ")[0] for term in term_texts(spec)))
    if names_file(spec):
        return _shortened(file_label(spec))
    name, _, parameters = spec.partition(":")
    values = [pair.partition("=")[2] or pair for pair in cut(COMMA, parameters) if pair]
    words = (_short(value[1:-1]) if value[0] == "(" else value for value in map(str.strip, values))
    return _shortened(" ".join([name.strip(), *words]))


def _shortened(text: str) -> str:
    return text if len(text) <= _MOST_CHARACTERS else f"{text[: _MOST_CHARACTERS - 3]}..."
