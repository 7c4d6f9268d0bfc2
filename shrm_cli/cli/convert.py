"""`shrm convert`: maps to other representations, maps and probes to other layouts."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from shrm_cli.cli.engines import converted_for_engines
from shrm_cli.cli.options import (
    ALL_REPRESENTATIONS,
    ENGINE_REPRESENTATIONS,
    REPRESENTATIONS,
    compression,
    make_read_options,
    precision_option,
    print_json,
    progress_bar,
    read_options,
    refuse_options,
    refuse_read_options,
    report_options,
    view_count,
    view_options,
    warn,
)
from shrm_cli.layouts import CUBES, IMAGE_LAYOUTS, LAYOUTS, default_orientation

if TYPE_CHECKING:
    from shrm_cli.maps.representations import BrdfMap, Map

_TARGETS = [*ALL_REPRESENTATIONS, *LAYOUTS]
_SAMPLINGS = click.Choice(["center", "border"])


@click.command()
@click.argument("source", metavar="IN", type=click.Path())
@click.option(
    "--to", "target", type=click.Choice(_TARGETS), required=True,
    help="Representation (of a map), or layout of the images (of a map or a probe).",
)  # fmt: skip
@click.option("-o", "--output", type=click.Path(), help="File to write.  [default: IN.TO.exr]")
@click.option(
    "--frame", type=click.Choice(["global", "local"]),
    help="Axes of the view in an SHRM.  [default: those of IN]",
)  # fmt: skip
@click.option(
    "--order-p", type=click.IntRange(0, 32),
    help="Order P of the SHRM.  [default: as high as IN has it or determines it]",
)  # fmt: skip
@view_options
@click.option(
    "--size", type=click.IntRange(1, 8192),
    help="Texels along a face's edge; height of a lat-long or angular map.  [default: as fine]",
)  # fmt: skip
@click.option(
    "--to-orientation", type=click.Choice(["openexr", "gl"]),
    help="Orientation of the cube faces to write.  [default: openexr for --to openexr, else gl]",
)  # fmt: skip
@click.option("--to-sampling", type=_SAMPLINGS, help="Where the edge pixels to write lie.")
@precision_option
@click.option("--sampling", type=_SAMPLINGS, help="Where the edge pixels of a probe lie.")
@read_options
@report_options
def convert(
    source: str,
    target: str,
    output: str | None,
    frame: str | None,
    order_p: int | None,
    slices: int | None,
    views: int | None,
    compress: tuple[int | None, float] | None,
    size: int | None,
    to_orientation: str | None,
    to_sampling: str | None,
    precision: str,
    sampling: str | None,
    as_json: bool,
    quiet: bool,
    **reading: Any,
) -> None:
    """Convert IN, a map or a light probe.

    A map becomes another representation, exactly at its samples; an SHRM is fitted to explicit
    maps, and what the fit leaves is told. What engines use (irradiance, splitsum, she) is made
    from the probe alone, and converted to itself: other precision, other size of irradiance.
    Maps and probes are laid out anew. The options from --sampling to --clamp say how a probe is
    to be read.

    \b
      shrm convert probe.microfacet.shrm.exr --to cabral
      shrm convert probe.exr --to hcross --size 256
    """
    from shrm_cli.files.whole import check_target
    from shrm_cli.maps.read import is_map

    result_path = output or _default_name(source, target)
    count, components = (
        view_count(target, slices, views),
        compression(target, compress),
    )
    if target not in REPRESENTATIONS:
        refuse_options(f"--to {target}", frame=frame, order_p=order_p)
    if is_map(source):
        refuse_read_options("IN is a map")
        check_target(result_path, [source], (".exr",))
        result, warnings = _convert_map(
            source, result_path, target, frame, order_p, (count, components), size,
            to_orientation, to_sampling, precision,
        )  # fmt: skip
    else:
        if target in ALL_REPRESENTATIONS:
            raise click.BadParameter(
                f"{source} is no map; a probe becomes {target} by shrm prefilter",
                param_hint="'--to'",
            )
        options = make_read_options(sampling, reading)
        with progress_bar("converting", quiet) as progress:
            result, warnings = _convert_probe(
                source, result_path, target, size, to_orientation, to_sampling, precision,
                options, progress,
            )  # fmt: skip
    if as_json:
        print_json({**result, "warnings": warnings})
    elif not quiet:
        click.echo(_report(result))
    warn(warnings, quiet)


def _convert_map(
    source: str,
    path: str,
    target: str,
    frame: str | None,
    order_p: int | None,
    views: tuple[int | None, Any],
    size: int | None,
    orientation: str | None,
    sampling: str | None,
    precision: str,
) -> tuple[dict[str, Any], list[str]]:
    from shrm_cli.maps.light_map import EngineMap
    from shrm_cli.maps.read import read_map
    from shrm_cli.maps.representations import is_exact_in_half, map_count
    from shrm_cli.maps.write import write_map

    found = read_map(source)
    layout = "openexr" if target in ALL_REPRESENTATIONS else target
    if isinstance(found, EngineMap) or target in ENGINE_REPRESENTATIONS:
        made = converted_for_engines(source, found, target, size, sampling)
    else:
        made = _converted(found, target, frame, order_p, views, size, sampling)
    chosen = orientation or default_orientation(layout)
    if precision == "auto" and not is_exact_in_half(made):
        precision = "float"  # a conversion is not to lose anything
    pixels = write_map(path, made, precision, layout, chosen)  # type: ignore[arg-type]
    result = {
        "file": path,
        "kind": "map",
        "representation": made.representation,
        "frame": made.frame,
        "size": made.size,
        "sampling": made.sampling,
        "maps": map_count(made),
        "order_p": made.info.order_p,
        "layout": layout,
        "orientation": chosen,
        "predicted_error": made.info.predicted_error,
        "added_error": made.info.added_error,
        "fit_residual": made.info.fit_residual,
        "precision": pixels,
    }
    return result, []


def _converted(
    found: BrdfMap,
    target: str,
    frame: str | None,
    order_p: int | None,
    views: tuple[int | None, Any],
    size: int | None,
    sampling: str | None,
) -> Map:
    from shrm_cli.maps.representations import EXPLICIT, as_shrm, represent, tabulate_sum
    from shrm_cli.maps.resample import resample
    from shrm_cli.maps.shrm.summed import SummedShrm

    made = resample(found, size, sampling)  # type: ignore[arg-type]
    if target not in REPRESENTATIONS:
        return made
    if target in EXPLICIT and isinstance(made, SummedShrm):
        refuse_options(f"a sum of terms and --to {target}", frame=frame, order_p=order_p)
        return tabulate_sum(made, target, views[0])
    if target != "shrm":
        refuse_options(f"--to {target}", frame=frame)
    kept = "local" if found.frame == "local" and found.representation == "shrm" else "global"
    shrm = as_shrm(made, frame or kept, order_p)  # type: ignore[arg-type]
    return represent(shrm, target, *views)


def _convert_probe(
    source: str,
    path: str,
    target: str,
    size: int | None,
    orientation: str | None,
    sampling: str | None,
    precision: str,
    options: Any,
    progress: Any,
) -> tuple[dict[str, Any], list[str]]:
    import numpy as np

    from shrm_cli.files.image import probe_attributes, write_images
    from shrm_cli.files.whole import check_target
    from shrm_cli.probe.probe import face_paths, open_probe
    from shrm_cli.probe.resample import to_layout

    probe = open_probe(source, options)
    sampled = sampling or "center"
    if target == "faces" and "%" not in Path(path).name:
        raise click.BadParameter(
            f"{path}: six files need % in place of +X, -X and so on", param_hint="'--output'"
        )
    files = face_paths(path) if target == "faces" else [path]
    for file in files:
        check_target(file, probe.paths, (".exr",))
    chosen = orientation or default_orientation(target)
    image = to_layout(probe, target, chosen, size, sampled, progress)  # type: ignore[arg-type]
    marked = (target, chosen) in (("openexr", "openexr"), ("latlong", "openexr"))
    envmap = target if sampled == "border" and marked else None
    pictures = np.split(image, 6) if target == "faces" else [image]
    pixels = write_images(
        files, pictures, precision, probe_attributes(probe.chromaticities, envmap)
    )
    result = {
        "kind": "probe",
        "files": files,
        "layout": target,
        "orientation": chosen,
        "sampling": sampled,
        "width": pictures[0].shape[1],
        "height": pictures[0].shape[0],
        "precision": pixels,
    }
    warnings = [f"{source}: {line}" for line in probe.report.warnings()]
    if sampled == "border" and not marked:
        warnings.append(f"{path}: no attribute tells of this; read it with --sampling border")
    if target in CUBES and chosen != default_orientation(target):
        warnings.append(f"{path}: no attribute tells of this; read it with --orientation {chosen}")
    return result, warnings


def _default_name(source: str, target: str) -> str:
    stem = Path(source).stem
    base, dot, last = stem.rpartition(".")
    family = ALL_REPRESENTATIONS if target in ALL_REPRESENTATIONS else IMAGE_LAYOUTS
    if dot and last in family:
        stem = base
    stem = stem.replace("%", "").rstrip("_-.") or "probe"
    return f"{stem}_%.exr" if target == "faces" else f"{stem}.{target}.exr"


def _report(result: dict[str, Any]) -> str:
    if result["kind"] == "probe":
        files = ", ".join(result["files"])
        return (
            f"{files}: {result['layout']} probe, {result['width']} x {result['height']}, "
            f"{result['precision']}"
        )
    size, kind = result["size"], result["representation"]
    if kind in ENGINE_REPRESENTATIONS:
        return f"{result['file']}: {kind}, {result['precision']}"
    lines = [
        f"{result['file']}: {result['frame']} {kind} map, {result['maps']} cubes of 6 x {size} x "
        f"{size} texels as {result['layout']}, {result['precision']}"
    ]
    for key, text in (("added_error", "added by its form"), ("fit_residual", "left by the fit")):
        if result[key] >= 5e-6:
            lines.append(f"  RMS error      {result[key]:.3%} {text}")
    return "\n".join(lines)
