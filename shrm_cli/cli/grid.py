"""`shrm grid` finds the light at many points of a room."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import shrm_cli as shrm
from shrm_cli.cli import options, usage
from shrm_cli.cli.terminal import announce, conclude, progress_bar
from shrm_cli.cli.types import BOX, COUNTS, PATH, option, whole
from shrm_cli.files.whole import exists_error, keeping
from shrm_cli.vocabulary import DEFAULT_ERROR, MAX_GRID_ORDER, MAX_SAMPLES

if TYPE_CHECKING:
    from shrm_cli.rooms.make import RoomPlan

_SUFFIXES = (".npz", ".json", ".ktx2", ".exr")


@click.command()
@click.argument("source", metavar="ROOM|TABLE|GRID.npz", type=PATH)
@option(
    "-o --output", PATH,
    help="File to write: .npz, .json for three.js, .ktx2 for Bevy, or .exr.  "
    "[default: SOURCE.grid.npz in the current folder]",
)  # fmt: skip
@option(
    "--size", COUNTS, "Probes along x, y and z.  [default: 16 along the longest edge of the box]"
)
@option("--box", BOX, "Two corners of the box with the probes.  [default: all of the room]")
@option("--order", whole(1, MAX_GRID_ORDER), "Largest degree of the harmonics.", default=2)
@options.room_options
@option(
    "--samples", whole(16, MAX_SAMPLES), "Directions along which each probe looks.", default=1024
)
@option(
    "--light", click.Choice(["all", "reflected"]), default="all",
    help="reflected leaves out what comes straight from lamps, which engines may add "
    "themselves; .npz holds both.",
)  # fmt: skip
@usage.force_option
@options.report_options
def grid(
    source: str,
    output: str | None,
    probe: str | None,
    albedo: options.NamedColors,
    emit: options.NamedColors,
    light: str,
    force: bool,
    **values: Any,
) -> None:
    """Find the light at the points of a grid in a room, for surfaces that move in it.

    ROOM is a mesh whose materials reflect diffusely, by their base colours, and some of which send
    light. Each probe holds coefficients of the light that reaches it, of all bounces, and how far
    it sees, so that light does not leak through walls. TABLE is of probes that exist already: .csv
    with the columns x, y, z and file, .toml of [[probe]] with file and at, or a stage of USD with a
    dome light where each of them was. GRID.npz is written in another form.

    \b
      shrm grid house.glb --size 16,8,16
      shrm grid house.glb --emit lamp=30,28,25 --probe sky.exr -o house.ktx2
      shrm grid house.grid.npz --light reflected -o house.json
    """
    from shrm_cli.files.npz import is_cut_off
    from shrm_cli.rooms.export import WRITERS
    from shrm_cli.rooms.grid import is_grid, made_by, write_grid
    from shrm_cli.rooms.table import is_table

    target, suffix = _target(source, output)
    usage.check_outputs([target], files=[source, *([probe] if probe else [])])
    is_baked, of_probes = is_grid(source), is_table(source)
    of_rooms = (not (of_probes or is_baked), "to rooms")
    usage.refuse_inapplicable(
        dict.fromkeys(("size", "box", "probe", "albedo", "emit", "samples"), of_rooms)
        | {"order": (not is_baked, "to rooms and tables")}
        | {"light": (suffix != ".npz", "to other files than .npz, which holds both")}
    )
    planned: list[RoomPlan] = []

    def begin(plan: RoomPlan) -> None:
        is_there = not (force or output) and os.path.lexists(target)
        # What is cut off may be of the same inputs, which is known when the grid is written.
        if is_there and made_by(target) != plan.made and not is_cut_off(target):
            raise exists_error(target, "other inputs or options made it")
        planned.append(plan)
        count = " x ".join(map(str, plan.lattice.shape))
        announce([f"{source}: {len(plan.mesh.faces):,} triangles, {count} probes"])

    with progress_bar("projecting" if of_probes else "gathering") as progress:
        found = shrm.grid(
            source, probe=probe, albedo=dict(albedo), emission=dict(emit), begin=begin,
            progress=progress, **values,
        )  # fmt: skip
    with keeping(*([] if force or output else [target])):
        if suffix == ".npz":
            write_grid(target, found)
        else:
            WRITERS[suffix](target, found, light == "all")
    said, bytes_written = found.summary(), Path(target).stat().st_size
    shape = " x ".join(map(str, said["shape"]))
    lines = [f"{target}: {shape} probes, order {found.order}, {bytes_written:,} bytes"]
    lines += _lines(said, suffix, light == "all")
    warnings = [line for plan in planned for line in plan.warnings]
    if said.get("in_walls") == found.lattice.count:
        warnings.append(
            f"{source}: all probes lie behind surfaces, whose triangles seem to face outwards; "
            "turn them round, or give `box` within the room"
        )
    elif not found.coefficients.any():
        warnings.append(f"{source}: no light reaches the probes; give `box` within the room")
    conclude({"file": target, **said, "bytes": bytes_written}, lines, warnings)


def _target(source: str, output: str | None) -> tuple[str, str]:
    """Return the name of the output, and its suffix in lower case."""
    target = output or f"{Path(source).stem}.grid.npz"
    suffix = Path(target).suffix.lower()
    if suffix not in _SUFFIXES:
        raise shrm.OutputError(f"{target}: grids are written as {', '.join(_SUFFIXES)}; name it so")
    return target, suffix


def _lines(said: dict[str, Any], suffix: str, has_all_light: bool) -> list[str]:
    """Return what is known of the errors of a grid that was baked, a line each."""
    if "error" not in said:
        return []
    without, reflected = said.get("error_coefficients", said["error"]), said["error_reflected"]
    lines, has_lamps = [], without != reflected
    if suffix == ".npz" or not has_lamps:
        lines.append(f"  irradiance between the probes is {said['error']:.1%} off (RMS)")
    if has_lamps:
        lines.append(
            f"  in engines, which do not know the lamps, it is {without:.1%} off, and "
            f"{reflected:.1%} without what comes straight from lamps"
        )
    if suffix != ".npz" and has_all_light and without > max(DEFAULT_ERROR, 2 * reflected):
        lines.append(
            "  what comes straight from lamps changes faster than the probes lie; leave it to "
            "lights of the engine (--light reflected)"
        )
    if reflected > DEFAULT_ERROR:
        twice = ",".join(str(2 * each) for each in said["shape"])
        lines.append(
            f"  light of surfaces and of the sky{', too,' * has_lamps} changes faster than the "
            f"probes lie; --size {twice} is nearer"
        )
    if said["in_walls"]:
        one = said["in_walls"] == 1
        lines.append(f"  {said['in_walls']:,} {'probe lies' if one else 'probes lie'} within walls")
    return lines
