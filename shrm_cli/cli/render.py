"""`shrm render` draws spheres and meshes from their maps."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import shrm_cli as shrm
from shrm_cli.cli import moving, options, shading, stage, usage
from shrm_cli.cli.terminal import conclude, progress_bar
from shrm_cli.cli.types import FILE, PATH, PICTURE_SIZE, VECTOR, option, whole, within
from shrm_cli.files.recipe import picture_attributes
from shrm_cli.naming import map_stem, probe_stem
from shrm_cli.vocabulary import DEFAULT_FPS, Precision

if TYPE_CHECKING:
    from shrm_cli.cli.stage import Baked
    from shrm_cli.files.image import Picture
    from shrm_cli.progress import Progress
    from shrm_cli.render.drawing import Drawing, Film, Lit
    from shrm_cli.render.moving import Moment
    from shrm_cli.rooms.grid import ProbeGrid

_FILES = ("mesh", "vary", "irradiance", "transfer")
"""What the recipe of a picture says of files, whose folders it leaves out."""


@click.command()
@click.argument("maps", metavar="MAP...", nargs=-1, type=FILE)
@option(
    "-o --output", PATH,
    help="PNG, EXR or moving .apng, .gif or .mp4.  [default: MAP.png, of several sheet.png, in the "
    "current folder]",
)  # fmt: skip
@options.view_option
@option(
    "--size", PICTURE_SIZE, default="512",
    help="Width and height of a picture, pixels; those of spheres are square.",
)  # fmt: skip
@stage.mesh_options
@option(
    "--place", VECTOR,
    help="Where the sphere stands in the box that the maps' probe knows of.  [default: where the "
    "probe was]",
)  # fmt: skip
@option(
    "--radius R", within(0, 1e30),
    help="Of that sphere, in the box's unit.  [default: a tenth of the box's shortest edge]",
)  # fmt: skip
@shading.surface_options
@shading.brushed_options
@options.exposure_option
@option(
    "--background PROBE", PATH,
    help="Light probe to show behind it, of a sphere 50 degrees across.  [default: black]",
)  # fmt: skip
@options.lit_by("Light of product textures that hold none: a probe, or a grid of probes.")
@shading.window_option
@moving.frames_option
@moving.fps_option
@moving.max_memory_option
@moving.light_options
@option(
    "--columns N", whole(1),
    help="Columns of the contact sheet of several maps.  [default: as square as possible]",
)  # fmt: skip
@options.precision_option
@options.probe_options
@options.report_options
def render(
    maps: tuple[str, ...],
    output: str | None,
    view: tuple[float, float],
    size: tuple[int, int],
    mesh: str | None,
    transfer: str | None,
    exposure: float | None,
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
    picture's width. Several maps make one contact sheet. Split sums and SH exponentials are shown
    as GGX of --roughness and --f0, or of a mesh's materials; irradiance as white and diffuse, and
    so is a grid of probes, which lights each point of a mesh that stands in its room. The options
    from --sampling to --working are about the files of --background and --probe.

    \b
      shrm render probe.microfacet.shrm.exr --view 30,10 --background probe.exr
      shrm render probe.splitsum.exr --roughness 0.3 --f0 gold
      shrm render probe.*.shrm.exr -o sheet.%04d.png --frames 36
      shrm render probe.splitsum.exr --turn-light y:360 --frames 48 -o turn.gif
      shrm render probe.microfacet.shrm.exr --mesh bunny.obj --size 800x600
      shrm render brushed.product.exr --probe probe.exr
      shrm render house.grid.npz --mesh chair.glb
      shrm render --probe probe.exr --mesh a.obj --transfer a.transfer.npz
    """
    from shrm_cli.files.animation import is_animated
    from shrm_cli.files.image import file_type
    from shrm_cli.render.drawing import Film
    from shrm_cli.rooms.grid import as_grid

    if not (maps or transfer):
        _refuse_no_map(mesh, probe)
    values["vary"], ways = moving.split_vary(values["vary"])
    stage.refuse_mesh_options(mesh, transfer, values["vary"])
    grid = None if probe is None else as_grid(probe)
    named = background, None if grid else probe, values["background_to"]
    _refuse_others(mesh, values, any(named[:2]))
    keys = moving.scene_keys(mesh)
    frames = keys[-1].frame if keys else frames
    pattern = output or _default_name(maps, probe if transfer else None, mesh, frames)
    steps, targets = moving.frame_targets(pattern, frames)
    shown = moving.moments(view, steps, values, keys, ways)
    if not is_animated(pattern):
        usage.refuse_inapplicable({"max_memory": (False, "to moving pictures")})
        file_type(pattern)
    reading = options.make_read_options(values)
    probes = {path: shrm.open_probe(path, reading) for path in named if path is not None}
    skies = probes.get(background or ""), probes.get(values["background_to"] or "")
    usage.check_outputs(targets, files=_files(maps, mesh, values), draws=True)
    light = grid or probes.get(probe or "")
    lit, baked, told = _open_lit(maps, light, mesh, transfer, window, ways, values)
    if mesh is None:
        drawing = _on_sphere(lit, size, shown, values)
    else:
        drawing = _on_mesh(lit, mesh, baked, size, shown, {**values, "transfer": transfer})
    film = Film(drawing, shown, [*map(map_stem, lit.names)], exposure or 0.0, skies, columns)
    given = values | {"view": view, "vary": ways, "background": background, "probe": probe}
    with progress_bar("rendering") as progress:
        film, images, doubts = _exposed(film, pattern, targets[0], exposure, progress)
        settings = _settings(lit, film, steps, given | {"window": window})
        if is_animated(pattern):
            written, lines = _write_animation(film, images, pattern, view[0], fps, max_memory)
        else:
            written, lines = _write_pictures(film, images, targets, precision, settings)
    told += [line for each in probes.values() for line in each.warnings()]
    lines += _of_surfaces(mesh, drawing, lit.maps, values)
    lines += options.told_of_exposure(exposure, film.exposure)
    conclude({"files": written, **settings}, lines, drawing.warnings + doubts + told)


def _of_surfaces(
    mesh: str | None, drawing: Drawing, maps: Sequence[shrm.Map], values: dict[str, Any]
) -> list[str]:
    """Say which materials were drawn, and how split sums were looked up for them."""
    lines = []
    if count := drawing.said.get("materials"):
        lines.append(f"{mesh}: with its own materials, {count}; --plain leaves them out")
    return lines + shading.told_of_taps(maps, values["taps"], values["anisotropy"])


def _refuse_no_map(mesh: str | None, probe: str | None) -> None:
    """Say what makes a map, unless what is drawn is a scene, whose objects may have maps."""
    from shrm_cli.render.scene_file import is_scene_name

    if mesh and is_scene_name(mesh):
        return
    made = f"shrm prefilter {probe or 'PROBE'} {'--to splitsum' if mesh else '--brdf SPEC'}"
    of = f" for the materials of {mesh}" if mesh else ""
    raise click.UsageError(f"Missing argument 'MAP...': {made} makes one{of}")


def _refuse_others(mesh: str | None, values: dict[str, Any], has_probe: bool) -> None:
    """Refuse the place of what is no sphere or is under light that moves, and reading no probe."""
    rests = mesh is None and not any(values[name] for name in moving.LIGHT_MOVES)
    placed = (rests and values["place"] is not None, "with --place")
    of_spheres = (rests, "to spheres under light that rests")
    reading = options.reading_rules(has_probe, "with --background or --probe")
    usage.refuse_inapplicable({"place": of_spheres, "radius": placed, **reading})


def _settings(lit: Lit, film: Film, frames: int | None, given: dict[str, Any]) -> dict[str, Any]:
    """Return what JSON and recipes tell of the options that were given, and of the pictures."""
    moved = {name: given[name] for name in moving.LIGHT_MOVES if given[name] not in (None, ())}
    return {
        "maps": list(lit.names), "view": list(given["view"]), "vary": given["vary"] or None,
        **film.drawing.said, "exposure": film.exposure, "background": given["background"],
        "probe": given["probe"], "window": given["window"], "frames": frames, **moved,
        "width": film.shape[1], "height": film.shape[0],
    }  # fmt: skip


def _open_lit(
    maps: Sequence[str],
    light: shrm.Probe | ProbeGrid | None,
    mesh: str | None,
    transfer: str | None,
    window: str | None,
    ways: dict[str, tuple[float, float]],
    values: dict[str, Any],
) -> tuple[Lit, Baked | None, list[str]]:
    """Open the maps and light them; return what is baked of a mesh, and warnings, too."""
    from shrm_cli.render.drawing import Lit
    from shrm_cli.render.lit import lit_maps
    from shrm_cli.rooms.lit import open_lit

    opened, blend_to = [open_lit(path) for path in maps], values["blend_to"]
    shown = moving.shown_ways(mesh, values["vary"], ways)
    if transfer is None or maps:
        usage.refuse_inapplicable({"probe": shading.to_unlit(opened)})
    if transfer is None:
        shading.refuse_window(opened)
        opened, warnings = lit_maps(opened, maps, light, window, shown)
        return Lit(opened, maps, moving.open_others(blend_to, opened), blend_to), None, warnings
    baked = stage.open_baked(transfer, opened, maps, light, window, shown)
    others = moving.open_others(blend_to, baked.maps)
    return Lit(baked.maps, baked.names, others, blend_to), baked, baked.warnings


def _on_sphere(
    lit: Lit, size: tuple[int, int], moments: Sequence[Moment], values: dict[str, Any]
) -> Drawing:
    """Return the sphere that is drawn; refuse options that do not apply."""
    from shrm_cli.render.drawing import on_sphere
    from shrm_cli.render.moving import check_values

    if size[0] != size[1]:
        raise click.UsageError("--size of a sphere's picture is one number")
    shading.refuse_surface(lit.maps)
    check_values(moments, lit.maps)
    return on_sphere(lit, size[0], values)


def _on_mesh(
    lit: Lit,
    mesh: str,
    baked: Baked | None,
    size: tuple[int, int],
    moments: Sequence[Moment],
    values: dict[str, Any],
) -> Drawing:
    """Return the mesh or the scene that is drawn; refuse options that do not apply."""
    from shrm_cli.render.drawing import on_stage
    from shrm_cli.render.moving import check_values

    plain = values["plain"] or baked is not None  # its albedo is baked
    set_up, warnings = stage.open_stage(mesh, lit.maps, lit.names, {**values, "plain": plain})
    check_values(moments, [*lit.maps, *set_up.maps()])
    other = moving.open_other_light(set_up, values)
    drawn: tuple[list[Any], list[Any]] | None = None
    if baked is not None:
        drawn = baked.drawn(set_up), baked.with_maps(lit.others).drawn(set_up)
    elif other is not set_up:
        drawn = [*map(set_up.reflectors, lit.maps)], [*map(other.reflectors, lit.others)]
    drawing = on_stage(lit, set_up, size, moments, values, drawn)
    given = {name: values[name] for name in (*stage.OF_SURFACES, "transfer")}
    said = {
        **drawing.said,
        **stage.mesh_values(drawing.subject, mesh),
        **{key: value for key, value in given.items() if value is not None},
    }
    return replace(drawing, said=said, warnings=[*warnings, *drawing.warnings])


def _exposed(
    film: Film, pattern: str, path: str, asked: float | None, progress: Progress | None
) -> tuple[Film, Iterator[Picture], list[str]]:
    """Return the film and its pictures, which exposure would show those that show nothing, and
    whether nothing moves.

    The subject in the first picture tells which exposure shows something, unless one is asked for.
    """
    from shrm_cli.render.image import exposure_advice, shown_at
    from shrm_cli.render.moving import told_of_rest

    drawn = film.tiles(progress)
    tiles, of_subject = next(drawn), film.of_subject
    film = replace(film, exposure=shown_at(path, *map(of_subject, tiles), asked=asked))
    first = film.put_together(tiles)
    doubts = [
        line
        for label, part in film.parts(first)
        for line in exposure_advice(path, of_subject(part), film.exposure, label)
    ]
    doubts += [f"{pattern}: {line}" for line in told_of_rest(film.moments)]
    return film, chain([first], map(film.put_together, drawn)), doubts


def _write_animation(
    film: Film,
    pictures: Iterable[Picture],
    target: str,
    azimuth: float,
    fps: float | None,
    max_memory: int | None,
) -> tuple[list[dict[str, Any]], list[str]]:
    """Write a moving picture; return what JSON has of it, and a line about it."""
    from shrm_cli.analysis.memory import check_sheet
    from shrm_cli.files.animation import held_bytes, write_animation
    from shrm_cli.files.image import in_srgb

    (height, width), count, fps = film.shape, len(film.moments), fps or DEFAULT_FPS
    held = held_bytes(target, width * height, count)
    check_sheet(width * height, film.drawing.subject.shape[1], held, max_memory)
    images = (in_srgb(target, each, film.drawing.primaries)[0] for each in pictures)
    write_animation(target, images, fps)
    written = [{"file": target, "azimuth": azimuth, "pixels": "8-bit sRGB"}]
    return written, [f"{target}: {width} x {height}, {count} frames, {fps:g} a second"]


def _write_pictures(
    film: Film,
    pictures: Iterable[Picture],
    targets: Sequence[str],
    precision: Precision,
    settings: dict[str, Any],
) -> tuple[list[dict[str, Any]], list[str]]:
    """Write a picture of each moment; return what JSON has of them, and lines about them."""
    from shrm_cli.files.image import write_picture

    (height, width), drawing = film.shape, film.drawing
    written: list[dict[str, Any]] = []
    for path, moment, picture in zip(targets, film.moments, pictures, strict=True):
        attributes = _attributes(drawing.seen, settings, drawing.said, moment)
        pixels = write_picture(path, picture, precision, attributes)
        written.append({"file": path, "azimuth": moment.viewer.azimuth, "pixels": pixels})
    return written, [f"{each['file']}: {width} x {height}, {each['pixels']}" for each in written]


def _files(maps: Sequence[str], mesh: str | None, values: dict[str, Any]) -> list[str]:
    """Return all files that are read, besides those of probes."""
    others = [path for path in (mesh, values["vary"]) if path not in (None, "vertex")]
    if values["irradiance_to"] is not None:
        others.append(values["irradiance_to"])
    return [*maps, *values["blend_to"], *others]


def _default_name(
    maps: Sequence[str], probe: str | None, mesh: str | None, frames: int | None
) -> str:
    """Return the name of a picture of maps, or where there are none, of what a probe lights."""
    if maps:
        stem = map_stem(maps[0]) if len(maps) == 1 else "sheet"
    else:
        stem = probe_stem(probe) if probe else ""
    if mesh is not None:
        stem = f"{stem}.{Path(mesh).stem}".lstrip(".")
    return f"{stem}.png" if frames is None else f"{stem}.%04d.png"


def _attributes(
    maps: Iterable[shrm.MapInfo], settings: dict[str, Any], said: dict[str, Any], moment: Moment
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
        if "irradiance_to" in settings:
            recipe["irradiance_to"] = Path(settings["irradiance_to"]).name
    return picture_attributes(recipe, (each.chromaticities for each in maps))
