"""`shrm lookdev` shows materials under probes, as a sheet, a page or a turntable."""

from __future__ import annotations

import sys
from time import perf_counter
from typing import TYPE_CHECKING, Any

import click

from shrm_cli.cli.bar import progress_bar
from shrm_cli.cli.moving import fps_option, frame_targets, max_memory_option
from shrm_cli.cli.options import (
    conclude,
    make_read_options,
    materials_option,
    precision_option,
    probe_options,
    report_options,
    shared_options,
    view_option,
)
from shrm_cli.cli.outputs import check_outputs, picture_attributes
from shrm_cli.cli.types import STOPS
from shrm_cli.cli.usage import Applies, flags, refuse_inapplicable
from shrm_cli.files.whole import note
from shrm_cli.maps.options import counted
from shrm_cli.maps.registry import descriptions
from shrm_cli.vocabulary import DEFAULT_FPS, DEFAULT_FRAMES

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from shrm_cli.files.picture import Picture
    from shrm_cli.lookdev.columns import Column
    from shrm_cli.progress import Progress, Stages
    from shrm_cli.render.camera import Viewer
    from shrm_cli.render.sheet import Grid
    from shrm_cli.vocabulary import Precision

_FORMS = [each.name for each in descriptions().values() if each.needs_brdf]
_MAKING = ("eps", "error", "order_f", "order_p", "center", "max_size")
_ERROR = 0.05
"""The error of maps where no option says how exact they are. For gold and plastic under three real
probes such principal maps took .8 to 6 s of a core, SHRMs of the default tolerance 1.7 to 6 s with
errors of 7 to 24 %, and principal maps of that tolerance 5 to 6 s."""
_PICTURES = (".png", ".exr", ".html", ".apng", ".gif", ".mp4")


@click.command()
@click.argument("probes", metavar="PROBES...", nargs=-1, required=True, type=click.Path())
@materials_option
@click.option(
    "-o", "--output", type=click.Path(), default="lookdev.png", show_default=True,
    help="PNG, EXR or HTML page; turntable .apng, .gif or .mp4, or frames named with %04d.",
)  # fmt: skip
@click.option(
    "--to", type=click.Choice(_FORMS), default="principal", show_default=True,
    help="Representation of the maps.",
)  # fmt: skip
@shared_options(*_MAKING)
@view_option
@click.option(
    "--size", type=click.IntRange(16, 2048), default=256, show_default=True,
    help="Width and height of a cell, pixels.",
)  # fmt: skip
@click.option(
    "--exposure", type=STOPS, metavar="EV",
    help="Stops, for all probes.  [default: each probe's own, which its label states]",
)  # fmt: skip
@click.option(
    "--frames", type=click.IntRange(1, 9999), metavar="N",
    help=f"Walk around the spheres in N steps.  [default: {DEFAULT_FRAMES} of a moving picture]",
)  # fmt: skip
@fps_option
@max_memory_option
@precision_option
@probe_options
@report_options
def lookdev(
    probes: tuple[str, ...],
    specs: tuple[str, ...],
    output: str,
    to: str,
    view: tuple[float, float],
    size: int,
    exposure: float | None,
    frames: int | None,
    fps: float | None,
    max_memory: int | None,
    precision: Precision,
    **values: Any,
) -> None:
    """Show materials under light probes: a row for each BRDF, a column for each of PROBES.

    Every sphere stands before its own light. Each probe has an exposure of its own, unless
    --exposure says it: a tenth of a white, diffuse ball in its light is brighter than 0.8 of
    white. Maps are made as `shrm prefilter` makes them, by default with --error 0.05; a pair that
    cannot be made says why in its cell, and the run ends with 1. Pages have a slider for each
    column. GIF and APNG need Pillow (`pip install pillow`), MP4 needs ffmpeg.

    \b
      shrm lookdev city.exr studio.exr --brdf ggx:f0=gold --brdf lambertian -o sheet.png
      shrm lookdev hdr/*.exr --brdf paint.binary --brdf ggx -o sheet.html
      shrm lookdev city.exr --brdf ggx:roughness=0.3 --frames 36 -o turn.gif
    """
    from pathlib import Path

    from shrm_cli.analysis.memory import check_sheet
    from shrm_cli.brdf.spec import parse_spec
    from shrm_cli.files.animation import held_bytes, is_animated, write_animation
    from shrm_cli.files.picture import write_picture
    from shrm_cli.files.png import encode_srgb
    from shrm_cli.files.whole import write_bytes
    from shrm_cli.lookdev.columns import Wanted, make_column
    from shrm_cli.lookdev.page import lookdev_page, material_names, probe_names
    from shrm_cli.maps.request import check_arguments
    from shrm_cli.progress import Stages
    from shrm_cli.render.camera import Viewer
    from shrm_cli.render.frames import turntable
    from shrm_cli.render.sheet import Grid

    suffix = Path(output).suffix.lower()
    moving = is_animated(output)
    refuse_inapplicable(
        {
            "frames": Applies(suffix != ".html", "to pictures; a page shows one view"),
            "precision": Applies(suffix == ".exr", "to EXR"),
        }
    )
    steps, targets = frame_targets(output, frames)
    given = {name: values.pop(name) for name in _MAKING}
    given = {name: value for name, value in given.items() if value is not None}
    if to == "principal" and not given.keys() & {"eps", "error", "order_f", "order_p", "max_size"}:
        given["error"] = _ERROR
    check_arguments(to, [*given, "brdf"])
    reading = make_read_options(values)
    note(*(path for path in probes if "%" not in path))
    check_outputs(targets, specs=specs, suffixes=_PICTURES)
    for spec in specs:
        parse_spec(spec)  # what is wrong with a material is said before the work begins
    grid = Grid(len(specs), len(probes), size)
    grid.check()
    pixels = grid.shape[0] * grid.shape[1]
    check_sheet(pixels, size, held_bytes(output, pixels, steps) if steps else 0, max_memory)
    wanted = Wanted(specs, to, given, size, exposure)
    columns: list[Column] = []
    with progress_bar("prefiltering") as progress:
        stages = Stages(progress, len(probes))
        for path in probes:
            columns.append(make_column(path, reading, wanted, stages.within))
            stages.done(len(columns), len(probes))
    failures = _failures(columns, specs)
    if len(failures) == len(specs) * len(probes):
        raise click.ClickException(failures[0])
    sides = material_names(specs)
    names = probe_names(probes)
    viewers = turntable(Viewer(*view), steps) if steps else [Viewer(*view)]
    with progress_bar("rendering") as progress:
        stages = Stages(progress, len(viewers))
        sheets = _frames(columns, grid, names, sides, viewers, stages)
        if suffix == ".html":
            cells: list[list[Picture | str]] = [[] for _ in columns]
            for _, index, tile in _tiles(columns, viewers[0], size, stages.within):
                cells[index].append(tile)
            page = lookdev_page(columns, names, sides, cells, size).encode()
            write_bytes(output, page)
            written = f"{len(page):,} bytes"
        elif moving:
            write_animation(output, map(encode_srgb, sheets), fps or DEFAULT_FPS)
            written = f"{len(viewers)} frames, {fps or DEFAULT_FPS:g} a second"
        else:
            recipe = {
                "lookdev": [Path(path).name for path in probes], "brdfs": list(specs), "to": to,
                **given, "view": list(view), "size": size, "exposure": exposure,
            }  # fmt: skip
            attributes = picture_attributes(recipe, [])
            kinds = [
                write_picture(path, picture, precision, attributes)
                for path, picture in zip(targets, sheets, strict=True)
            ]
            written = kinds[0] if len(targets) == 1 else f"{len(targets)} frames, {kinds[-1]}"
    result = {
        "files": targets,
        "to": to,
        **given,
        "view": list(view),
        "size": size,
        "frames": steps,
        "brdfs": [{"brdf": s, "name": name} for s, name in zip(specs, sides, strict=True)],
        "probes": [
            {"probe": each.path, "name": name, "exposure": each.exposure}
            for each, name in zip(columns, names, strict=True)
        ],
        "predicted_errors": [
            [None if isinstance(cell, str) else cell.info.predicted_error for cell in each.cells]
            for each in columns
        ],
        "failures": failures,
    }
    height, width = grid.shape
    what = written if suffix == ".html" else f"{width} x {height}, {written}"
    warnings = [f"{each.path}: {line}" for each in columns for line in each.warnings]
    pairs = f"{counted(grid.rows, 'material')} x {counted(grid.columns, 'probe')}"
    line = f"{output}: {pairs}, {what}"
    conclude(result, [line], [*warnings, *failures])
    if failures:
        sys.exit(1)


def _failures(columns: Sequence[Column], specs: Sequence[str]) -> list[str]:
    """Return a line for each cell without a map."""
    return [
        f"{column.path}, {spec}: {flags(cell.removeprefix(f'{column.path}: '))}"
        for column in columns
        for spec, cell in zip(specs, column.cells, strict=True)
        if isinstance(cell, str)
    ]


def _tiles(
    columns: Sequence[Column], viewer: Viewer, size: int, progress: Progress
) -> Iterator[tuple[int, int, Picture | str]]:
    """Yield row, column and picture of each cell, or why it has none."""
    for index, column in enumerate(columns):
        for row, tile in enumerate(column.tiles(viewer, size)):
            yield row, index, tile
        progress(index + 1, len(columns))


def _frames(
    columns: Sequence[Column],
    grid: Grid,
    names: Sequence[str],
    sides: Sequence[str],
    viewers: Sequence[Viewer],
    stages: Stages,
) -> Iterator[Picture]:
    """Yield the sheet for each viewer, linear Rec.709."""
    from shrm_cli.render.sheet import draw_grid

    heads = [
        name if column.surroundings is None else f"{name}  EV {column.exposure:+.1f}"
        for column, name in zip(columns, names, strict=True)
    ]
    begun = perf_counter()
    for done, viewer in enumerate(viewers, 1):
        yield draw_grid(grid, heads, sides, _tiles(columns, viewer, grid.tile, stages.within))
        stages.done(done, len(viewers))
        if done == 1:
            stages.foretell((perf_counter() - begun) * (len(viewers) - 1))
