"""`shrm render` draws spheres and meshes from their maps."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from shrm_cli.cli.bar import progress_bar
from shrm_cli.cli.drawing import Lit, on_mesh, on_sphere
from shrm_cli.cli.moving import (
    LIGHT_MOVES,
    fps_option,
    frame_targets,
    frames_option,
    light_options,
    max_memory_option,
    moments,
    open_others,
    scene_keys,
)
from shrm_cli.cli.options import (
    conclude,
    exposure_option,
    make_read_options,
    precision_option,
    probe_options,
    reading_rules,
    report_options,
    view_option,
)
from shrm_cli.cli.outputs import check_outputs, map_stem, picture_attributes
from shrm_cli.cli.shading import (
    brushed_options,
    lit_maps,
    surface_options,
    to_unlit,
    window_option,
)
from shrm_cli.cli.stage import (
    mesh_options,
    open_baked,
    refuse_mesh_options,
)
from shrm_cli.cli.types import VECTOR, picture_size, within
from shrm_cli.cli.usage import Applies, refuse_inapplicable
from shrm_cli.vocabulary import DEFAULT_FPS

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from shrm_cli.files.picture import Picture
    from shrm_cli.maps.info import MapInfo
    from shrm_cli.render.moving import Moment
    from shrm_cli.vocabulary import Precision

_FILES = ("mesh", "vary", "irradiance", "transfer")
"""What the recipe of a picture says of files, whose folders it leaves out."""


@click.command()
@click.argument("maps", metavar="MAP...", nargs=-1, type=click.Path(dir_okay=False))
@click.option(
    "-o", "--output", type=click.Path(),
    help="PNG, EXR or moving .apng, .gif or .mp4.  [default: MAP.png, of several sheet.png, in the "
    "current folder]",
)  # fmt: skip
@view_option
@click.option(
    "--size", type=picture_size(16, 8192), default="512", show_default=True,
    help="Width and height of a picture, pixels; those of spheres are square.",
)  # fmt: skip
@mesh_options
@click.option(
    "--place", type=VECTOR,
    help="Where the sphere stands in the box that the maps' probe knows of.  [default: where the "
    "probe was]",
)  # fmt: skip
@click.option(
    "--radius", type=within(0, 1e30), metavar="R",
    help="Of that sphere, in the box's unit.  [default: a tenth of the box's shortest edge]",
)  # fmt: skip
@surface_options
@brushed_options
@exposure_option
@click.option(
    "--background", type=click.Path(), metavar="PROBE",
    help="Light probe to show behind it, of a sphere 50 degrees across.  [default: black]",
)  # fmt: skip
@click.option(
    "--probe", type=click.Path(), metavar="PROBE",
    help="Light of product textures that hold none.",
)  # fmt: skip
@window_option
@frames_option
@fps_option
@max_memory_option
@light_options
@click.option(
    "--columns", type=click.IntRange(1), metavar="N",
    help="Columns of the contact sheet of several maps.  [default: as square as possible]",
)  # fmt: skip
@precision_option
@probe_options
@report_options
def render(
    maps: tuple[str, ...],
    output: str | None,
    view: tuple[float, float],
    size: tuple[int, int],
    mesh: str | None,
    transfer: str | None,
    exposure: float,
    background: str | None,
    probe: str | None,
    window: str | None,
    frames: int | None,
    fps: float | None,
    max_memory: int | None,
    columns: int | None,
    precision: Precision,
    **values: Any,
) -> None:
    """Render a sphere from each MAP, as a distant viewer sees it, or a mesh.

    PNG is 8-bit sRGB, EXR is linear. The sphere stands in the middle; its diameter is 0.9 of the
    picture's width. Several maps make one contact sheet. Split sums and SH
    exponentials are shown as GGX of --roughness and --f0, or of a mesh's materials; irradiance as
    white and diffuse. The options from --sampling to --working are about the files of --background
    and --probe.

    \b
      shrm render probe.microfacet.shrm.exr --view 30,10 --background probe.exr
      shrm render probe.splitsum.exr --roughness 0.3 --f0 gold
      shrm render probe.*.shrm.exr -o sheet.%04d.png --frames 36
      shrm render probe.splitsum.exr --turn-light y:360 --frames 48 -o turn.gif
      shrm render probe.microfacet.shrm.exr --mesh bunny.obj --size 800x600
      shrm render brushed.product.exr --probe probe.exr
      shrm render --probe probe.exr --mesh a.obj --transfer a.transfer.npz
    """
    from shrm_cli.analysis.memory import check_sheet
    from shrm_cli.files.animation import held_bytes, is_animated, write_animation
    from shrm_cli.files.picture import file_type, in_srgb, write_picture
    from shrm_cli.maps.file import open_map
    from shrm_cli.probe.probe import open_probe
    from shrm_cli.probe.resample import coarse_probe
    from shrm_cli.progress import Stages
    from shrm_cli.render.scene import Scene

    if not maps and mesh is None:
        raise click.UsageError("Missing argument 'MAP...'")
    refuse_mesh_options(mesh, transfer)
    rests = mesh is None and not any(values[name] for name in LIGHT_MOVES)
    placed = Applies(rests and values["place"] is not None, "with --place")
    of_spheres = Applies(rests, "to spheres under light that rests")
    refuse_inapplicable({"place": of_spheres, "radius": placed})
    keys = scene_keys(mesh)
    frames = keys[-1].frame if keys else frames
    lights = maps if maps or transfer is None or probe is None else (probe,)
    pattern = output or _default_name(lights, mesh, frames)
    steps, targets = frame_targets(pattern, frames)
    shown_moments = moments(view, steps, values, keys)
    if not is_animated(pattern):
        refuse_inapplicable({"max_memory": Applies(False, "to moving pictures")})
        file_type(pattern)
    is_read = background is not None or probe is not None
    refuse_inapplicable(reading_rules(is_read, "with --background or --probe"))
    options = make_read_options(values)
    named_probes = (background, probe, values["background_to"])
    probes = {path: open_probe(path, options) for path in named_probes if path is not None}
    skies = [None if path is None else probes[path] for path in named_probes[::2]]
    named = [path for path in (mesh, values["vary"]) if path not in (None, "vertex")]
    check_outputs(targets, files=(*maps, *values["blend_to"], *named))
    opened = [open_map(path) for path in maps]
    light, baked = probes.get(probe or ""), None
    if transfer is None or maps:
        refuse_inapplicable({"probe": to_unlit(opened)})
    if transfer is None:
        opened, negative = lit_maps(opened, maps, light, window)
    else:
        baked = open_baked(transfer, opened, maps, light, window)
        opened, maps, negative = baked.maps, tuple(baked.names), baked.warnings
    others = open_others(values["blend_to"], opened)
    lit = Lit(opened, maps, others, values["blend_to"])
    if mesh is None:
        drawing = on_sphere(lit, size, values)
    else:
        drawing = on_mesh(lit, mesh, baked, size, shown_moments, {**values, "transfer": transfer})
    behind = [
        None if sky is None else coarse_probe(sky.in_primaries(drawing.primaries), drawing.rows)
        for sky in skies
    ]

    def scene_at(moment: Moment) -> Scene[Any]:
        around = None if behind[0] is None else moment.behind(behind[0], behind[1])
        labels = [map_stem(path) for path in maps]
        return Scene(drawing.subject, drawing.at(moment), labels, exposure, around, columns)

    height, width = scene_at(shown_moments[0]).shape
    moved = {name: values[name] for name in LIGHT_MOVES if values[name] not in (None, ())}
    settings = {
        "maps": list(maps),
        "view": list(view),
        **drawing.said,
        "exposure": exposure,
        "background": background,
        "probe": probe,
        "window": window,
        "frames": steps,
        **moved,
        "width": width,
        "height": height,
    }
    frame = [_attributes(drawing.seen, settings, drawing.said, each) for each in shown_moments]

    def pictures() -> Iterator[Picture]:
        with progress_bar("rendering") as progress:
            stages = Stages(progress, len(shown_moments))
            for number, each in enumerate(shown_moments, 1):
                yield scene_at(each).picture(each.viewer, stages.within)
                stages.done(number, len(shown_moments))

    if is_animated(pattern):
        check_sheet(
            width * height, size[0], held_bytes(pattern, width * height, len(frame)), max_memory
        )
        images = (in_srgb(pattern, each, drawing.primaries)[0] for each in pictures())
        write_animation(pattern, images, fps or DEFAULT_FPS)
        pixels = f"{len(frame)} frames, {fps or DEFAULT_FPS:g} a second"
        written = [{"file": pattern, "azimuth": view[0], "pixels": "8-bit sRGB"}]
        lines = [f"{pattern}: {width} x {height}, {pixels}"]
    else:
        written = [
            {
                "file": path,
                "azimuth": moment.viewer.azimuth,
                "pixels": write_picture(path, picture, precision, attributes),
            }
            for path, moment, attributes, picture in zip(
                targets, shown_moments, frame, pictures(), strict=True
            )
        ]
        lines = [f"{each['file']}: {width} x {height}, {each['pixels']}" for each in written]
    warnings = drawing.warnings + negative
    warnings += [f"{path}: {w}" for path, each in probes.items() for w in each.report.warnings()]
    if "materials" in drawing.said:
        lines.append(
            f"{mesh}: with its own materials, {drawing.said['materials']}; --plain leaves them out"
        )
    conclude({"files": written, **settings}, lines, warnings)


def _default_name(maps: Sequence[str], mesh: str | None, frames: int | None) -> str:
    stem = "sheet" if len(maps) > 1 else "".join(map_stem(path) for path in maps)
    if mesh is not None:
        stem = f"{stem}.{Path(mesh).stem}".lstrip(".")
    return f"{stem}.png" if frames is None else f"{stem}.%04d.png"


def _attributes(
    maps: Iterable[MapInfo], settings: dict[str, Any], said: dict[str, Any], moment: Moment
) -> dict[str, Any]:
    """Return the attributes of an EXR, whose bytes must not depend on the folders of files."""
    behind, light = settings["background"], settings["probe"]
    recipe: dict[str, Any] = {
        "render": [Path(path).name for path in settings["maps"]],
        "view": [moment.viewer.azimuth, moment.viewer.elevation],
        **{key: Path(value).name if key in _FILES else value for key, value in said.items()},
        "exposure": settings["exposure"],
        "background": None if behind is None else Path(behind).name,
        **({} if light is None else {"probe": Path(light).name, "window": settings["window"]}),
        **moment.record(),
    }
    if moment.share:
        recipe["blend_to"] = [Path(path).name for path in settings["blend_to"]]
    return picture_attributes(recipe, (each.chromaticities for each in maps))
