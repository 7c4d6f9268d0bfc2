"""`shrm render` draws spheres and meshes from their maps."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from shrm_cli.cli.bar import progress_bar
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
    shaded_maps,
    surface_options,
    to_unlit,
    window_option,
)
from shrm_cli.cli.stage import (
    OF_SURFACES,
    mesh_options,
    mesh_values,
    open_baked,
    open_stage,
    refuse_mesh_options,
)
from shrm_cli.cli.types import picture_size
from shrm_cli.cli.usage import refuse_inapplicable

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from shrm_cli.maps.info import MapInfo
    from shrm_cli.vocabulary import Precision

_FILES = ("mesh", "vary", "irradiance", "transfer")
"""What the recipe of a picture says of files, whose folders it leaves out."""


@click.command()
@click.argument("maps", metavar="MAP...", nargs=-1, type=click.Path(dir_okay=False))
@click.option(
    "-o", "--output", type=click.Path(),
    help="PNG or EXR to write.  [default: MAP.png, of several sheet.png, in the current folder]",
)  # fmt: skip
@view_option
@click.option(
    "--size", type=picture_size(16, 8192), default="512", show_default=True,
    help="Width and height of a picture, pixels; those of spheres are square.",
)  # fmt: skip
@mesh_options
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
@click.option(
    "--frames", type=click.IntRange(1, 9999), metavar="N",
    help="Walk around it in N steps, a file for each: the output's name holds %04d.",
)  # fmt: skip
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
      shrm render probe.microfacet.shrm.exr --mesh bunny.obj --size 800x600
      shrm render brushed.product.exr --probe probe.exr
      shrm render --probe probe.exr --mesh a.obj --transfer a.transfer.npz
    """
    from shrm_cli.files.picture import file_type, write_picture
    from shrm_cli.maps.file import open_map
    from shrm_cli.probe.probe import open_probe
    from shrm_cli.probe.resample import coarse_probe
    from shrm_cli.progress import Stages
    from shrm_cli.render.camera import Viewer, background_rows
    from shrm_cli.render.frames import frame_paths, turntable
    from shrm_cli.render.primaries import in_same_primaries, one_of
    from shrm_cli.render.scene import Scene, SphereSubject

    if not maps and mesh is None:
        raise click.UsageError("Missing argument 'MAP...'")
    lights = maps if maps or transfer is None or probe is None else (probe,)
    pattern = output or _default_name(lights, mesh, frames)
    targets = [pattern] if frames is None else frame_paths(pattern, frames)
    file_type(pattern)
    refuse_mesh_options(mesh, transfer)
    is_read = background is not None or probe is not None
    refuse_inapplicable(reading_rules(is_read, "with --background or --probe"))
    options = make_read_options(values)
    probes = {path: open_probe(path, options) for path in (background, probe) if path is not None}
    sky = None if background is None else probes[background]
    named = [path for path in (mesh, values["vary"]) if path not in (None, "vertex")]
    check_outputs(targets, files=(*maps, *named))
    opened = [open_map(path) for path in maps]
    light, baked = probes.get(probe or ""), None
    if transfer is None or maps:
        refuse_inapplicable({"probe": to_unlit(opened)})
    if transfer is None:
        opened, negative = lit_maps(opened, maps, light, window)
    else:
        baked = open_baked(transfer, opened, maps, light, window)
        opened, maps, negative = baked.maps, tuple(baked.names), baked.warnings
    viewers = turntable(Viewer(*view), len(targets))
    said: dict[str, Any]
    scene: Scene[Any]
    labels = [map_stem(path) for path in maps]
    if mesh is None:
        width, height = size
        if width != height:
            raise click.UsageError("--size of a sphere's picture is one number")
        asked = (values[name] for name in ("roughness", "f0", "anisotropy", "taps"))
        loaded, surface, warnings = shaded_maps(opened, maps, *asked)
        primaries = opened[0].info.chromaticities
        loaded = in_same_primaries(loaded, primaries)
        sky = None if sky is None else sky.in_primaries(primaries)
        behind = None if sky is None else coarse_probe(sky, background_rows(width))
        scene = Scene(SphereSubject(width), loaded, labels, exposure, behind, columns)
        seen = [each.info for each in loaded]
        said = {"size": width, **surface}
    else:
        from shrm_cli.render.mesh import MeshSubject
        from shrm_cli.render.perspective import DEFAULT_FOV, Lens, aimed

        plain = values["plain"] or transfer is not None  # its albedo is baked
        stage, warnings = open_stage(mesh, opened, maps, {**values, "plain": plain})
        lens = Lens(*size, DEFAULT_FOV if values["fov"] is None else values["fov"])
        where = values["target"], values["distance"]
        aim = aimed(stage.mesh.vertices, viewers, lens, *where)
        subject = MeshSubject(stage, lens, aim)
        seen = [each.info for each in (*opened, *stage.maps())]
        primaries = one_of({each.chromaticities for each in seen})
        sky = None if sky is None else sky.in_primaries(primaries)
        behind = None if sky is None else coarse_probe(sky, subject.lens.background_rows())
        drawn: list[Any] = [stage.reflectors(each) for each in opened] or [stage.reflectors(None)]
        if baked is not None:
            drawn = baked.drawn(stage)
        scene = Scene(subject, drawn, labels, exposure, behind, columns)
        given = {**{name: values[name] for name in OF_SURFACES}, "transfer": transfer}
        said = {
            "size": list(size),
            **mesh_values(subject, mesh),
            **{key: value for key, value in given.items() if value is not None},
        }
    height, width = scene.shape
    settings = {
        "maps": list(maps),
        "view": list(view),
        **said,
        "exposure": exposure,
        "background": background,
        "probe": probe,
        "window": window,
        "frames": frames,
        "width": width,
        "height": height,
    }
    written = []
    with progress_bar("rendering") as progress:
        stages = Stages(progress, len(targets))
        for path, viewer in zip(targets, viewers, strict=True):
            pixels = scene.picture(viewer, stages.within)
            attributes = _attributes(seen, settings, said, viewer.azimuth)
            pixel_type = write_picture(path, pixels, precision, attributes)
            written.append({"file": path, "azimuth": viewer.azimuth, "pixels": pixel_type})
            stages.done(len(written), len(targets))
    warnings += negative
    warnings += [f"{path}: {w}" for path, each in probes.items() for w in each.report.warnings()]
    lines = [f"{each['file']}: {width} x {height}, {each['pixels']}" for each in written]
    if "materials" in said:
        lines.append(
            f"{mesh}: with its own materials, {said['materials']}; --plain leaves them out"
        )
    conclude({"files": written, **settings}, lines, warnings)


def _default_name(maps: Sequence[str], mesh: str | None, frames: int | None) -> str:
    stem = "sheet" if len(maps) > 1 else "".join(map_stem(path) for path in maps)
    if mesh is not None:
        stem = f"{stem}.{Path(mesh).stem}".lstrip(".")
    return f"{stem}.png" if frames is None else f"{stem}.%04d.png"


def _attributes(
    maps: Iterable[MapInfo], settings: dict[str, Any], said: dict[str, Any], azimuth: float
) -> dict[str, Any]:
    """Return the attributes of an EXR, whose bytes must not depend on the folders of files."""
    behind, light = settings["background"], settings["probe"]
    recipe: dict[str, Any] = {
        "render": [Path(path).name for path in settings["maps"]],
        "view": [azimuth, settings["view"][1]],
        **{key: Path(value).name if key in _FILES else value for key, value in said.items()},
        "exposure": settings["exposure"],
        "background": None if behind is None else Path(behind).name,
        **({} if light is None else {"probe": Path(light).name, "window": settings["window"]}),
    }
    return picture_attributes(recipe, (each.chromaticities for each in maps))
