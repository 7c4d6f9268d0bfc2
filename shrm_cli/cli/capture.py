"""`shrm probe capture` makes the light probe of a place in a room."""

from __future__ import annotations

from pathlib import Path

import click

from shrm_cli.cli.options import (
    NamedColors,
    announce,
    conclude,
    report_options,
    room_options,
    textures_left_out,
)
from shrm_cli.cli.terminal import progress_bar
from shrm_cli.cli.types import BOX, VECTOR
from shrm_cli.cli.usage import check_outputs
from shrm_cli.vocabulary import Precision


@click.command()
@click.argument("mesh", metavar="ROOM", type=click.Path())
@click.option("--at", type=VECTOR, required=True, help="Where the probe is, in the mesh's axes.")
@room_options
@click.option(
    "--box", type=BOX,
    help="Two corners of the box that stands for the room where light is looked up.  "
    "[default: all of the room]",
)  # fmt: skip
@click.option(
    "--samples", type=click.IntRange(2, 65536), default=64, show_default=True,
    help="Paths of light through each pixel.",
)  # fmt: skip
@report_options
def capture(
    mesh: str,
    at: tuple[float, float, float],
    probe: str | None,
    albedo: NamedColors,
    emit: NamedColors,
    box: tuple[float, ...] | None,
    samples: int,
    output: str,
    size: int,
    precision: Precision,
) -> None:
    """Make the probe of a place in a room, from its mesh.

    ROOM is a mesh whose materials reflect diffusely, by their base colours, and some of which send
    light, as shrm grid takes it. All bounces are traced. The file holds where it was captured, and
    a box around the room: maps of it are looked up with parallax.

    \b
      shrm probe capture house.glb --at 2,1.6,2 -o hall.exr
      shrm probe capture house.glb --at 2,1.6,2 --probe sky.exr --emit lamp=30 -o hall.exr
    """
    import numpy as np

    from shrm_cli.files.image import write_image
    from shrm_cli.files.recipe import picture_attributes
    from shrm_cli.probe.proxy import ProxyBox, box_attributes
    from shrm_cli.rooms.bake import IN_WALLS
    from shrm_cli.rooms.capture import captured
    from shrm_cli.rooms.make import open_room

    check_outputs([output], files=[mesh, *([probe] if probe else [])])
    opened = open_room(mesh, probe, dict(albedo), dict(emit))
    room = opened.room
    low, high = room.mesh.bounds if box is None else np.reshape(box, (2, 3))
    proxy = ProxyBox.of(low, high, at)
    announce([f"{mesh}: {len(room.mesh.faces):,} triangles, {size} x {2 * size} pixels"])
    with progress_bar("tracing") as progress:
        place = np.array(at)
        found = captured(room, place, size, samples, opened.surroundings, progress)
    light = opened.surroundings
    colors = None if light is None else light.chromaticities
    recipe = {
        "probe": "capture", "size": size, "mesh": Path(mesh).name, "at": at, "samples": samples,
        "albedo": dict(albedo), "emit": dict(emit), "noise": round(found.noise, 5),
        **({} if probe is None else {"surroundings": Path(probe).name}),
    }  # fmt: skip
    attributes = picture_attributes(recipe, [colors]) | box_attributes(proxy)
    pixel_type = write_image(output, found.pixels, precision, attributes)
    warnings = textures_left_out(mesh, opened.textured)
    if found.behind > IN_WALLS:
        warnings.append(
            f"{output}: {found.behind:.0%} of what is seen is the back of surfaces, which is "
            "black; give `at` within the room, or turn the triangles that face outwards"
        )
    result = {
        "file": output, "width": 2 * size, "height": size, "precision": pixel_type,
        "noise": found.noise, "behind": found.behind, "proxy": proxy.record(),
    }  # fmt: skip
    lines = [
        f"{output}: {2 * size} x {size}, {pixel_type}",
        f"  noise of {found.noise:.1%} (RMS) is left; four times the samples halve it",
    ]
    conclude(result, lines, warnings)
