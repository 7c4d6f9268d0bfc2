"""`shrm lookdev` shows materials under probes, as a sheet, a page or a turntable."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import shrm_cli as shrm
from shrm_cli.cli import options, usage
from shrm_cli.cli.moving import fps_option, frame_targets, max_memory_option
from shrm_cli.cli.terminal import conclude, progress_bar
from shrm_cli.cli.types import PATH, Named, option, whole
from shrm_cli.files.recipe import picture_attributes
from shrm_cli.files.whole import note
from shrm_cli.maps.options import counted
from shrm_cli.maps.registry import descriptions, installed_names
from shrm_cli.vocabulary import AUTO, DEFAULT_FPS, DEFAULT_FRAMES, Precision

if TYPE_CHECKING:
    from shrm_cli.lookdev.sheet import Lookdev
    from shrm_cli.render.sheet import Grid

_FORMS = [each.name for each in descriptions().values() if each.needs_brdf]
_MAKING = ("eps", "error", "order_f", "order_p", "center", "max_size")
_PICTURES = (".png", ".exr", ".html")


@click.command()
@click.argument("probes", metavar="PROBES...", nargs=-1, required=True, type=PATH)
@options.materials_option
@options.written_to(
    "PNG, EXR or HTML page; turntable .apng, .gif or .mp4, or frames named with %04d.",
    default="lookdev.png",
)
@option(
    "--to", Named([AUTO, *_FORMS], installed_names), "Representation of the maps.", default=AUTO
)
@options.shared_options(*_MAKING)
@options.view_option
@option("--size", whole(16, 2048), "Width and height of a cell, pixels.", default=256)
@options.stops("Stops, for all probes.  [default: each probe's own, which its label states]")
@option(
    "--frames N", whole(1, 9999),
    help=f"Walk around the spheres in N steps.  [default: {DEFAULT_FRAMES} of a moving picture]",
)  # fmt: skip
@fps_option
@max_memory_option
@options.precision_option
@options.probe_options
@options.report_options
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
    white. Maps are made as `shrm prefilter` makes them, with lamps beside them where nothing else
    gives the right picture; a pair that cannot be made says why in its cell, and the run ends with
    1. Pages have a slider for each column. GIF and APNG need Pillow (`pip install pillow`), MP4
    needs ffmpeg.

    \b
      shrm lookdev city.exr studio.exr --brdf ggx:f0=gold --brdf lambertian -o sheet.png
      shrm lookdev hdr/*.exr --brdf paint.binary --brdf ggx -o sheet.html
      shrm lookdev city.exr --brdf ggx:roughness=0.3 --frames 36 -o turn.gif
    """
    from shrm_cli.maps.request import check_arguments
    from shrm_cli.render.moving import turntable
    from shrm_cli.render.sheet import Grid

    suffix = Path(output).suffix.lower()
    usage.refuse_inapplicable(
        {
            "frames": (suffix != ".html", "to pictures; a page shows one view"),
            "precision": (suffix == ".exr", "to EXR"),
        }
    )
    steps, targets = frame_targets(output, frames, _PICTURES)
    given = {name: values.pop(name) for name in _MAKING}
    given = {name: value for name, value in given.items() if value is not None}
    check_arguments(to, [*given, "brdf"])
    reading = options.make_read_options(values)
    note(*(path for path in probes if "%" not in path))
    usage.check_outputs(targets, specs=specs, draws=True)
    _check_sheet(Grid(len(specs), len(probes), size), output, steps, max_memory)
    with progress_bar("prefiltering") as progress:
        made = shrm.lookdev(
            probes, specs, to, size=size, exposure=exposure, reading=reading, progress=progress,
            **given,
        ).worded(usage.flags)  # fmt: skip
    failures = made.failures
    if all(isinstance(cell, str) for each in made.columns for cell in each.cells):
        raise click.ClickException(failures[0])
    said = {"to": to, **made.arguments, "view": list(view), "size": size}
    recipe = {
        "lookdev": [Path(path).name for path in probes], "brdfs": list(specs), **said,
        "exposure": exposure,
    }  # fmt: skip
    viewers = turntable(shrm.Viewer(*view), steps) if steps else [shrm.Viewer(*view)]
    written = _write(made, viewers, targets, precision, fps or DEFAULT_FPS, recipe)
    pairs = f"{counted(len(specs), 'material')} x {counted(len(probes), 'probe')}"
    warnings = [f"{each.path}: {line}" for each in made.columns for line in each.warnings]
    result = {"files": targets, **said, "frames": steps, **_facts(made), "failures": failures}
    conclude(result, [f"{output}: {pairs}, {written}"], [*warnings, *failures])
    if failures:
        sys.exit(1)


def _check_sheet(grid: Grid, output: str, frames: int | None, max_memory: int | None) -> None:
    """Refuse pictures that take too much memory."""
    from shrm_cli.analysis.memory import check_sheet
    from shrm_cli.files.animation import held_bytes

    grid.check()
    pixels = grid.shape[0] * grid.shape[1]
    check_sheet(pixels, grid.tile, held_bytes(output, pixels, frames) if frames else 0, max_memory)


def _write(
    made: Lookdev,
    viewers: Sequence[shrm.Viewer],
    targets: Sequence[str],
    precision: Precision,
    fps: float,
    recipe: dict[str, Any],
) -> str:
    """Draw and write the sheets or the page, and say what they are."""
    from shrm_cli.files.animation import is_animated, write_animation
    from shrm_cli.files.image import write_picture
    from shrm_cli.files.png import encode_srgb
    from shrm_cli.files.whole import write_bytes

    height, width = made.grid.shape
    with progress_bar("rendering") as progress:
        if targets[0].lower().endswith(".html"):
            page = made.page(viewers[0], progress).encode()
            write_bytes(targets[0], page)
            return f"{len(page):,} bytes"
        sheets = made.sheets(viewers, progress)
        if is_animated(targets[0]):
            write_animation(targets[0], map(encode_srgb, sheets), fps)
            return f"{width} x {height}, {len(viewers)} frames, {fps:g} a second"
        kinds = [
            write_picture(path, picture, precision, picture_attributes(recipe, []))
            for path, picture in zip(targets, sheets, strict=True)
        ]
    what = kinds[0] if len(targets) == 1 else f"{len(targets)} frames, {kinds[-1]}"
    return f"{width} x {height}, {what}"


def _facts(made: Lookdev) -> dict[str, Any]:
    """Return what JSON has of the rows, the columns and the maps."""
    return {
        "brdfs": [{"brdf": s, "name": n} for s, n in zip(made.specs, made.sides, strict=True)],
        "probes": [
            {"probe": each.path, "name": name, "exposure": each.exposure}
            for each, name in zip(made.columns, made.names, strict=True)
        ],
        "predicted_errors": [
            [None if isinstance(cell, str) else cell.info.predicted_error for cell in each.cells]
            for each in made.columns
        ],
    }
