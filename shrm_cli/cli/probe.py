"""`shrm probe` makes probes: for tests and demonstrations, and of places in rooms."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import shrm_cli as shrm
from shrm_cli.cli import options, usage
from shrm_cli.cli.photo import ball, brackets, unclip, write_probe
from shrm_cli.cli.terminal import announce, echo, echo_lines, progress_bar
from shrm_cli.cli.types import (
    BOX,
    DIRECTION,
    PATH,
    RADIANCE,
    SUN,
    VECTOR,
    flag,
    option,
    whole,
    within,
)
from shrm_cli.files.whole import check_target
from shrm_cli.progress import using
from shrm_cli.vocabulary import LARGEST_HALF, MAX_LATLONG_HEIGHT, MAX_SAMPLES, Precision

if TYPE_CHECKING:
    # The command that runs loads numpy; `shrm --help` must not.
    import numpy as np
    from numpy.typing import NDArray


def _checked(ctx: click.Context, param: click.Parameter, value: str) -> str:
    check_target(value, suffixes=(".exr",))
    return value


image_options = options.several(
    option("-o --output", PATH, "OpenEXR file to write.", required=True, callback=_checked),
    option(
        "--size", whole(2, MAX_LATLONG_HEIGHT), default=256,
        help="Height in pixels; the image is twice as wide.",
    ),
    options.precision_option,
)  # fmt: skip
"""The options that every kind of probe has."""
output_options = options.several(
    image_options,
    flag("--quiet", "Print nothing on success.", callback=usage.remember, expose_value=False),
)  # fmt: skip
"""The options of probes that are made at once."""


@click.group()
def probe() -> None:
    """Make a light probe: test patterns, a sky, a studio, a place in a room, of photographs.

    Angles are in degrees: azimuth 0 is +Z, the centre of the image, and turns towards +X, its
    left quarter; elevation is the height above the horizon. Radiance is linear.
    """


@probe.command()
@output_options
@option("--radiance", RADIANCE, "Radiance, grey or RGB.", default="1")
def furnace(size: int, radiance: tuple[float, ...], **written: Any) -> None:
    """Make constant radiance from everywhere."""
    pixels = shrm.furnace(size, radiance)
    _write(pixels, written, radiance=radiance)


@probe.command()
@output_options
@option(
    "--direction", DIRECTION, "Direction that the bright texel contains, degrees.", default="0,0"
)
@option(
    "--radiance", RADIANCE, "Radiance of the texel, grey or RGB.  [default: 1 / its solid angle]"
)
def impulse(
    size: int, direction: tuple[float, float], radiance: tuple[float, ...] | None, **written: Any
) -> None:
    """Make one bright texel on black."""
    from shrm_cli.sphere.directions import from_azimuth_elevation

    pixels = shrm.impulse(size, from_azimuth_elevation(*direction), radiance)
    _write(pixels, written, direction=direction, radiance=radiance)


@probe.command()
@output_options
@option("--sun", SUN, "Direction of the sun, degrees; elevation 0 to 90.", default="45,35")
@option("--turbidity", within(1.7, 10), "Haziness of the air, 1.7 .. 10.", default=3.0)
@option("--ground-albedo", within(0, 1), "Diffuse reflectance of the ground, 0 .. 1.", default=0.2)
@flag("--no-sun", "Leave the sun's disc out, and print it as light files have it.")
def sky(
    size: int,
    sun: tuple[float, float],
    turbidity: float,
    ground_albedo: float,
    no_sun: bool,
    **written: Any,
) -> None:
    """Make a clear sky with its sun, in kcd/m^2.

    Preetham, Shirley & Smits 1999. The sun has its real radiance.
    """
    import numpy as np

    from shrm_cli.probe.sky import SUN_RADIUS, sun_radiance

    with progress_bar("shading") as progress, using(progress):
        pixels = shrm.sky(size, *sun, turbidity, ground_albedo, has_disc=not no_sun)
    made = {"sun": sun, "turbidity": turbidity, "ground_albedo": ground_albedo}
    _write(pixels, written, **made, **({"no_sun": True} if no_sun else {}))
    if no_sun and not usage.is_quiet():
        azimuth, elevation = sun
        radiance = ", ".join(f"{channel:.6g}" for channel in sun_radiance(elevation, turbidity))
        echo(
            f"[[disc]]\nazimuth = {azimuth:g}\nelevation = {elevation:g}\n"
            f"radius = {np.degrees(SUN_RADIUS):.6g}\nradiance = [{radiance}]"
        )


@probe.command()
@output_options
@option(
    "--key", within(0, LARGEST_HALF), default=20.0,
    help="Radiance of the key light; the fill has 2, the rim 10.",
)  # fmt: skip
def studio(size: int, key: float, **written: Any) -> None:
    """Make three soft boxes before a dark backdrop."""
    with progress_bar("shading") as progress, using(progress):
        pixels = shrm.studio(size, key)
    _write(pixels, written, key=key)


def _write(pixels: NDArray[np.float32], written: dict[str, Any], **parameters: object) -> None:
    """Write the image with the parameters that made it, and print what was written.

    `pixels` are of shape (size, 2 size, 3). `written` holds the values of --output and --precision.
    `**parameters` are what made the image.
    """
    from shrm_cli.files.image import write_image
    from shrm_cli.files.recipe import picture_attributes

    height, width, _ = pixels.shape
    command = click.get_current_context().info_name
    attributes = picture_attributes({"probe": command, "size": height, **parameters}, [])
    output = written["output"]
    pixel_type = write_image(output, pixels, written["precision"], attributes)
    if not usage.is_quiet():
        echo_lines([f"{output}: {width} x {height}, {pixel_type}"])


@click.command()
@click.argument("mesh", metavar="ROOM", type=PATH)
@option("--at", VECTOR, "Where the probe is, in the mesh's axes.", required=True)
@options.room_options
@option(
    "--box", BOX,
    help="Two corners of the box that stands for the room where light is looked up.  "
    "[default: that of what is seen from there]",
)  # fmt: skip
@option("--samples", whole(2, MAX_SAMPLES), "Paths of light through each pixel.", default=64)
@options.report_options
def capture(
    mesh: str,
    at: tuple[float, float, float],
    probe: str | None,
    albedo: options.NamedColors,
    emit: options.NamedColors,
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

    from shrm_cli.probe.proxy import ProxyBox
    from shrm_cli.rooms.bake import IN_WALLS
    from shrm_cli.rooms.capture import box_around, trace_probe
    from shrm_cli.rooms.make import open_room

    usage.check_outputs([output], files=[mesh, *([probe] if probe else [])])
    opened = open_room(mesh, probe, dict(albedo), dict(emit))
    room = opened.room
    place = np.array(at)
    low, high = box_around(room, place) if box is None else np.reshape(box, (2, 3))
    proxy = ProxyBox.of(low, high, at)
    announce([f"{mesh}: {len(room.mesh.faces):,} triangles, {size} x {2 * size} pixels"])
    with progress_bar("tracing") as progress:
        found = trace_probe(room, place, size, samples, opened.surroundings, progress)
    light = opened.surroundings
    colors = None if light is None else light.chromaticities
    recipe = {
        "probe": "capture", "size": size, "mesh": Path(mesh).name, "at": at, "samples": samples,
        "albedo": dict(albedo), "emit": dict(emit), "noise": round(found.noise, 5),
        **({} if probe is None else {"surroundings": Path(probe).name}),
    }  # fmt: skip
    warnings = list(opened.warnings)
    if found.behind > IN_WALLS:
        warnings.append(
            f"{output}: {found.behind:.0%} of what is seen is the back of surfaces, which is "
            "black; give `at` within the room, or turn the triangles that face outwards"
        )
    elif not found.pixels.any():
        warnings.append(
            f"{output}: nothing lights this place, so that it is black; give `emit` of a material, "
            "or a mesh with openings"
        )
    facts = {"noise": found.noise, "behind": found.behind, "proxy": proxy.record()}
    lines = [f"  noise of {found.noise:.1%} (RMS) is left; four times the samples halve it"]
    write_probe(output, found.pixels, precision, colors, recipe, facts, lines, warnings, proxy)


probe.add_command(image_options(capture))
for made_of_photographs in (brackets, ball, unclip):
    probe.add_command(made_of_photographs)
