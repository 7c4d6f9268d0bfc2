"""`shrm convert` makes other representations of maps, and other layouts of maps and probes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from shrm_cli.cli.kept import force_option
from shrm_cli.cli.options import (
    COLORS,
    TURNS,
    conclude,
    make_read_options,
    precision_option,
    progress_bar,
    read_options,
    reading_rules,
    report_options,
    representation_options,
)
from shrm_cli.cli.outputs import check_outputs
from shrm_cli.cli.plain import (
    plain_name,
    plain_options,
    plain_report,
    plain_rules,
    write_mips,
    write_view,
)
from shrm_cli.cli.terminal import echo
from shrm_cli.cli.usage import Applies, given_options, refuse_inapplicable, renamed
from shrm_cli.errors import MapError
from shrm_cli.files.whole import keeping
from shrm_cli.layouts import CUBES, IMAGE_LAYOUTS, LAYOUTS, default_orientation
from shrm_cli.maps.options import SHADER, Option, all_options, counted, listing, owners
from shrm_cli.maps.registry import descriptions
from shrm_cli.naming import probe_stem
from shrm_cli.vocabulary import (
    CONTAINERS,
    FRAMES,
    MAX_ORDER_P,
    ORIENTATIONS,
    REPRESENTATIONS,
    SAMPLINGS,
    Precision,
)

if TYPE_CHECKING:
    from shrm_cli.maps.base import Map
    from shrm_cli.vocabulary import Lookup, Sampling

_LAYERS = "layers"
_TARGETS = [*REPRESENTATIONS, *LAYOUTS, _LAYERS]
_SAMPLINGS = click.Choice(SAMPLINGS)


def _converts(option: Option) -> bool:
    """Return whether an option of prefiltering is one of converting, too."""
    return option.converts


@click.command()
@click.argument("source", metavar="IN", type=click.Path())
@click.option(
    "--to", "target", type=click.Choice(_TARGETS), required=True,
    help="Representation (of a map), layout of the images (of a map or a probe), or layers, the "
    "textures that --shader reads.",
)  # fmt: skip
@click.option(
    "--shader", type=click.Choice(SHADER.choices),
    help="Of --to layers: print the code that looks the map up in them, too.",
)  # fmt: skip
@click.option("-o", "--output", type=click.Path(), help="File to write.  [default: IN.TO.exr]")
@force_option
@click.option(
    "--frame", type=click.Choice(FRAMES),
    help="Axes of the view in an SHRM.  [default: those of IN]",
)  # fmt: skip
@click.option(
    "--order-p", type=click.IntRange(0, MAX_ORDER_P),
    help="Order P of the SHRM.  [default: as high as IN has it or determines it]",
)  # fmt: skip
@representation_options(_converts)
@plain_options
@click.option(
    "--size", type=click.IntRange(1, 8192),
    help="Texels along a face's edge; height of a lat-long or angular map.  [default: as fine]",
)  # fmt: skip
@click.option(
    "--to-orientation", type=click.Choice(ORIENTATIONS),
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
    force: bool,
    shader: str | None,
    size: int | None,
    to_orientation: str | None,
    to_sampling: Sampling | None,
    view: tuple[float, float] | None,
    by: Lookup | None,
    roughness: float | None,
    f0: str | None,
    mips: bool,
    precision: Precision,
    sampling: str | None,
    as_json: bool,
    quiet: bool,
    **values: Any,
) -> None:
    """Convert IN, a map or a light probe.

    A map becomes another representation, exactly at its samples; an SHRM is fitted to explicit
    maps, and what the fit leaves is told. What engines use (irradiance, splitsum, she) is made
    from the probe alone, and converted to itself: other precision, other size of irradiance.
    Irradiance and SH exponentials are turned by --yaw, --pitch and --roll, exactly and without
    their probe, and --working brings linear light into other primaries. Maps and probes are laid
    out anew; with --to layers maps become one array of images, for shaders. The options from
    --sampling to --working say how a probe is to be read. For programs that read plain images,
    --view AZ,EL writes what a map's material reflects to one distant viewer, and --mips the levels
    of a split sum as mip levels.

    \b
      shrm convert probe.microfacet.shrm.exr --to cabral
      shrm convert probe.exr --to hcross --size 256
      shrm convert probe.irradiance.exr --to irradiance --yaw 30 -o turned.exr
      shrm convert probe.ggx.principal.exr --to latlong --view 30,10 --by normal
      shrm convert probe.splitsum.exr --to latlong --mips
    """
    from shrm_cli.maps.file import is_map
    from shrm_cli.probe.probe import open_probe

    is_plain = view is not None or mips
    named = plain_name(source, target, view) if is_plain else _default_name(source, target)
    result_path = output or named
    reading = make_read_options(sampling, values)
    found = is_map(source)
    of_probes = reading_rules(not found, "to probes; IN is a map")
    of_probes |= dict.fromkeys((*TURNS, *COLORS), Applies(True, "to probes and maps"))
    of_probes |= plain_rules(target, found, view, mips)
    refuse_inapplicable({**_rules(target), **of_probes})
    if not (output or force):
        from shrm_cli.probe.probe import face_paths

        names = face_paths(result_path) if target == "faces" else [result_path]
        click.get_current_context().with_resource(keeping(*names))
    if target == _LAYERS:
        if not found:
            raise click.BadParameter(
                f"{source} is no map; make one by shrm prefilter", param_hint="'--to'"
            )
        check_outputs([result_path], files=[source], suffixes=CONTAINERS)
        _write_layers(source, result_path, precision, reading, shader, as_json, quiet)
        return
    if found:
        given = {name: values[name] for name in given_options() if name in values}
        check_outputs([result_path], files=[source], suffixes=CONTAINERS)
    if found and is_plain:
        opened, notes = _opened(source, reading)
        if view is not None:
            result, warnings = write_view(
                source, opened, result_path, view, by, roughness, f0, size,
                to_sampling, precision, quiet,
            )  # fmt: skip
        else:
            result, warnings = write_mips(
                source, opened, result_path, target, size, to_sampling, precision
            )
        warnings += notes
    elif found:
        result, warnings = _convert_map(
            source, result_path, target, given, size, to_orientation, to_sampling, precision,
            reading,
        )  # fmt: skip
    else:
        if target in REPRESENTATIONS:
            open_probe(source, reading)  # raises what is wrong with a file that is no image
            raise click.BadParameter(
                f"{source} is no map; a probe becomes {target} by shrm prefilter",
                param_hint="'--to'",
            )
        with progress_bar("converting", quiet) as progress:
            result, warnings = _convert_probe(
                source, result_path, target, size, to_orientation, to_sampling, precision,
                reading, progress,
            )  # fmt: skip
    conclude(result, [_report(result)], warnings, as_json, quiet)


def _rules(target: str) -> dict[str, Applies]:
    """Return, for each option, whether it applies to the representation that is converted to."""
    known = descriptions()
    of_brdf = [name for name, each in known.items() if each.needs_brdf]
    rules = {
        "frame": Applies(target == "shrm", "with --to shrm"),
        "order_p": Applies(target in of_brdf, f"with --to {listing(of_brdf, 'or')}"),
        "shader": Applies(target == _LAYERS, f"with --to {_LAYERS}"),
        **dict.fromkeys(
            ("size", "to_orientation", "to_sampling"),
            Applies(target != _LAYERS, f"to all but --to {_LAYERS}"),
        ),
    }
    for option in filter(_converts, all_options(known).values()):
        of = owners(known, option.name)
        rules.setdefault(option.name, Applies(target in of, f"with --to {listing(of, 'or')}"))
    return rules


def _convert_map(
    source: str,
    path: str,
    target: str,
    given: dict[str, Any],
    size: int | None,
    orientation: str | None,
    sampling: str | None,
    precision: Precision,
    reading: Any,
) -> tuple[dict[str, Any], list[str]]:
    """Write a map in another representation, or in another layout of the same one, or turned."""
    from shrm_cli.maps.file import store

    found, notes = _opened(source, reading)
    is_layout = target not in REPRESENTATIONS
    layout = target if is_layout else "openexr"
    if is_layout and not found.cube_count:
        raise click.UsageError(
            f"--to {target} applies to maps with images; {source} holds coefficients and no images",
            click.get_current_context(),
        )
    with renamed(sampling="to_sampling"):
        if is_layout:
            made = found.resampled(size, sampling)  # type: ignore[arg-type]
        else:
            made = found.converted(target, size, sampling, **given)  # type: ignore[arg-type]
    chosen = orientation or default_orientation(layout)
    if precision == "auto" and not made.is_exact_in_half:
        precision = "float"  # a conversion must not lose precision
    stored = store(path, made, precision, layout, chosen)  # type: ignore[arg-type]
    result = {
        "file": path,
        "kind": "map",
        "representation": made.representation,
        "frame": made.frame,
        "size": made.size,
        "sampling": made.sampling,
        "maps": made.cube_count,
        "order_p": made.info.order_p,
        "layout": layout,
        "orientation": chosen,
        "predicted_error": made.info.predicted_error,
        "added_error": made.info.added_error,
        "fit_residual": made.info.fit_residual,
        "storage_error": max(stored.error, made.info.storage_error),
        "precision": stored.pixel_type,
    }
    return result, notes


def _write_layers(
    source: str,
    path: str,
    precision: Precision,
    reading: Any,
    shader: str | None,
    as_json: bool,
    quiet: bool,
) -> None:
    """Write the textures of a map, and print the code that reads them where it is asked for."""
    from shrm_cli.maps.shader.code import look_up_code
    from shrm_cli.maps.shader.file import write_layers

    made, notes = _opened(source, reading)
    code = None if shader is None else look_up_code(made, shader, "layers")
    try:
        pixel_type, shapes = write_layers(path, made, precision)
    except MapError as error:
        raise MapError(f"{source}: {error}") from error
    result = {
        "file": path,
        "kind": "layers",
        "representation": made.representation,
        "textures": {name: list(shape) for name, shape in shapes.items()},
        "precision": pixel_type,
        **({} if code is None else {"shader": code}),
    }
    if code is not None and not as_json:
        echo(code.rstrip("\n"))
    texts = [
        f"{name} of {counted(layers, 'layer')} of {width} x {height} texels"
        for name, (layers, height, width) in shapes.items()
    ]
    line = f"{path}: textures of {made.representation}, {' and '.join(texts)}, {pixel_type}"
    conclude(result, [line], notes, as_json, quiet, err=code is not None)


def _opened(source: str, reading: Any) -> tuple[Map, list[str]]:
    """Read a map, turn its light and bring it into other primaries; and what to say of those."""
    import numpy as np

    from shrm_cli.maps.file import open_map
    from shrm_cli.maps.primaries import declared, in_primaries
    from shrm_cli.probe.colors import ColorReading

    turn = reading.matrix()
    found = open_map(source)
    colors = ColorReading.of(found.info.chromaticities, reading)
    if reading.primaries is not None:
        found = declared(found, colors.own)  # type: ignore[arg-type]
    if not np.array_equal(turn, np.eye(3)):
        found = found.turned(turn)
    if reading.working is not None:
        found = in_primaries(found, colors.chromaticities)  # type: ignore[arg-type]
    return found, [f"{source}: {line}" for line in colors.notes]


def _convert_probe(
    source: str,
    path: str,
    target: str,
    size: int | None,
    orientation: str | None,
    sampling: str | None,
    precision: Precision,
    options: Any,
    progress: Any,
) -> tuple[dict[str, Any], list[str]]:
    import numpy as np

    from shrm_cli.files.image import probe_attributes, write_images
    from shrm_cli.probe.probe import face_paths, open_probe
    from shrm_cli.probe.resample import to_layout

    probe = open_probe(source, options)
    sampled = sampling or "center"
    if target == "faces" and "%" not in Path(path).name:
        raise click.BadParameter(
            f"{path}: six files need % in place of +X, -X and so on", param_hint="'--output'"
        )
    files = face_paths(path) if target == "faces" else [path]
    check_outputs(files, suffixes=CONTAINERS)
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
    family = list(REPRESENTATIONS) if target in REPRESENTATIONS else list(IMAGE_LAYOUTS)
    if dot and last in family:
        stem = base
    stem = probe_stem(f"{stem}.exr")
    return f"{stem}_%.exr" if target == "faces" else f"{stem}.{target}.exr"


def _report(result: dict[str, Any]) -> str:
    if result["kind"] in ("view", "mips"):
        return plain_report(result)
    if result["kind"] == "probe":
        files = ", ".join(result["files"])
        return (
            f"{files}: {result['layout']} probe, {result['width']} x {result['height']}, "
            f"{result['precision']}"
        )
    size, kind = result["size"], result["representation"]
    if not descriptions()[kind].needs_brdf:
        return f"{result['file']}: {kind}, {result['precision']}"
    lines = [
        f"{result['file']}: {result['frame']} {kind} map, {result['maps']} cubes of 6 x {size} x "
        f"{size} texels as {result['layout']}, {result['precision']}"
    ]
    errors = {
        "added_error": "added by its form",
        "fit_residual": "left by the fit",
        "storage_error": "from half precision",
    }
    for key, text in errors.items():
        if result[key] >= (5e-4 if key == "storage_error" else 5e-6):
            lines.append(f"  RMS error      {result[key]:.3%} {text}")
    return "\n".join(lines)
