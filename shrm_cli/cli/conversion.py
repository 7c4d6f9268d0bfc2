"""The ways of `shrm convert`: what each of them makes, writes and says of it.

Maps become other maps or layouts of their cubes (`convert_map`) or textures for shaders
(`convert_to_layers`), and probes other layouts (`convert_probe`); `shrm_cli.cli.plain` has those
for programs that read plain images.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from shrm_cli.cli.terminal import progress_bar
from shrm_cli.cli.usage import check_outputs, renamed, wrong_usage
from shrm_cli.errors import MapError
from shrm_cli.maps.options import counted
from shrm_cli.maps.registry import descriptions
from shrm_cli.progress import using
from shrm_cli.records import record
from shrm_cli.vocabulary import CONTAINERS, CUBES, REPRESENTATIONS, default_orientation

if TYPE_CHECKING:
    from shrm_cli.maps.base import Map
    from shrm_cli.probe.options import ReadOptions
    from shrm_cli.vocabulary import Orientation, Precision, Sampling


@record
class Conversion:
    """What is converted, to what, and how it is read and written: what all ways share.

    Attributes
    ----------
    source, path : str
        The file to read, and the one to write.
    target : str
        The value of --to.
    reading : ReadOptions
        How a probe is read; maps have their light turned and their primaries changed by it.
    size : int or None
        Texels along a cube's edge, or the height of other images; None where it was not given.
    orientation : str or None
        The orientation of the cube faces to write.
    sampling : str or None
        Where the edge pixels to write lie.
    precision : str
        The pixel type.
    """

    source: str
    path: str
    target: str
    reading: ReadOptions
    size: int | None
    orientation: Orientation | None
    sampling: Sampling | None
    precision: Precision

    def precision_of(self, made: Map) -> Precision:
        """Return the pixel type for what is made of a map: a conversion must not lose precision."""
        is_lossy = self.precision == "auto" and not made.is_exact_in_half
        return "float" if is_lossy else self.precision


@record
class Converted:
    """What became of a conversion.

    Attributes
    ----------
    result : dict
        What is printed as JSON.
    report : str
        What is printed as text.
    warnings : list of str
    """

    result: dict[str, Any]
    report: str
    warnings: list[str]


def open_source(job: Conversion) -> tuple[Map, list[str]]:
    """Read the map of a conversion, turn its light and bring it into other primaries.

    Returns
    -------
    found : Map
    notes : list of str
        What is to be said of its colors.

    Raises
    ------
    OutputError
        If the output cannot be written.
    MapError
        If the map cannot be read, or does not hold what could be turned or changed.
    """
    import numpy as np

    from shrm_cli.maps.file import open_map
    from shrm_cli.maps.primaries import declared, in_primaries
    from shrm_cli.probe.options import ColorReading

    check_outputs([job.path], files=[job.source], suffixes=CONTAINERS)
    turn = job.reading.matrix()
    found = open_map(job.source)
    colors = ColorReading.of(found.info.chromaticities, job.reading)
    if job.reading.primaries is not None:
        found = declared(found, colors.own)  # type: ignore[arg-type]
    if not np.array_equal(turn, np.eye(3)):
        found = found.turned(turn)
    if job.reading.working is not None:
        found = in_primaries(found, colors.chromaticities)  # type: ignore[arg-type]
    return found, [f"{job.source}: {line}" for line in colors.notes]


def convert_map(job: Conversion, given: dict[str, Any]) -> Converted:
    """Write a map in another representation, or in another layout of the same one, or turned.

    Parameters
    ----------
    given : dict
        The arguments of the representation that were given on the command line.
    """
    from shrm_cli.maps.stored import store

    found, notes = open_source(job)
    is_layout = job.target not in REPRESENTATIONS
    layout = job.target if is_layout else "openexr"
    if is_layout and not found.cube_count:
        raise wrong_usage(
            f"--to {job.target} applies to maps with images; {job.source} holds coefficients and "
            "no images"
        )
    with renamed(sampling="to_sampling"):
        if is_layout:
            made = found.resampled(job.size, job.sampling)
        else:
            made = found.converted(job.target, job.size, job.sampling, **given)
    orientation = job.orientation or default_orientation(layout)
    stored = store(job.path, made, job.precision_of(made), layout, orientation)
    result = {
        "file": job.path,
        "kind": "map",
        "representation": made.representation,
        "frame": made.frame,
        "size": made.size,
        "sampling": made.sampling,
        "maps": made.cube_count,
        "order_p": made.info.order_p,
        "layout": layout,
        "orientation": orientation,
        "predicted_error": made.info.predicted_error,
        "added_error": made.info.added_error,
        "fit_residual": made.info.fit_residual,
        "storage_error": math.hypot(stored.error, made.info.storage_error),
        "precision": stored.pixel_type,
    }
    return Converted(result, _map_report(result), notes)


def _map_report(result: dict[str, Any]) -> str:
    """Return lines about a map: what it is, and the errors that can be seen in it."""
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


def convert_to_layers(job: Conversion, shader: str | None) -> Converted:
    """Write the textures of a map; the result has the code that reads them where it is asked for.

    Parameters
    ----------
    shader : str or None
        The language of the code.
    """
    from shrm_cli.maps.shader.code import look_up_code
    from shrm_cli.maps.shader.file import write_layers

    made, notes = open_source(job)
    if made.stored is not made and shader is None:
        notes.append(
            f"{job.path}: textures hold no lamps; the code of `shader` has those of the map"
        )
    code = None if shader is None else look_up_code(made, shader, "layers")
    try:
        pixel_type, shapes = write_layers(job.path, made, job.precision)
    except MapError as error:
        raise MapError(f"{job.source}: {error}") from error
    result = {
        "file": job.path,
        "kind": "layers",
        "representation": made.representation,
        "textures": {name: list(shape) for name, shape in shapes.items()},
        "precision": pixel_type,
        **({} if code is None else {"shader": code}),
    }
    texts = [
        f"{name} of {counted(layers, 'layer')} of {width} x {height} texels"
        for name, (layers, height, width) in shapes.items()
    ]
    report = f"{job.path}: textures of {made.representation}, {' and '.join(texts)}, {pixel_type}"
    return Converted(result, report, notes)


def convert_probe(job: Conversion) -> Converted:
    """Write a probe in another layout.

    Raises
    ------
    click.BadParameter
        If there should be six files, and their name has no place for those of the faces.
    """
    import numpy as np

    from shrm_cli.files.image import probe_attributes, write_images
    from shrm_cli.probe.open import face_paths, open_probe
    from shrm_cli.probe.proxy import box_attributes
    from shrm_cli.probe.resample import to_layout

    probe = open_probe(job.source, job.reading)
    path, target, sampled = job.path, job.target, job.sampling or "center"
    if target == "faces" and "%" not in Path(path).name:
        raise click.BadParameter(
            f"{path}: six files need % in place of +X, -X and so on", param_hint="'--output'"
        )
    files = face_paths(path) if target == "faces" else [path]
    check_outputs(files, suffixes=CONTAINERS)
    orientation = job.orientation or default_orientation(target)
    with progress_bar("converting") as progress, using(progress):
        image = to_layout(probe, target, orientation, job.size, sampled)
    marked = (target, orientation) in (("openexr", "openexr"), ("latlong", "openexr"))
    envmap = target if sampled == "border" and marked else None
    attributes = probe_attributes(probe.chromaticities, envmap) | box_attributes(probe.proxy)
    pictures = np.split(image, 6) if target == "faces" else [image]
    pixels = write_images(files, pictures, job.precision, attributes)
    height, width = pictures[0].shape[:2]
    result = {
        "kind": "probe",
        "files": files,
        "layout": target,
        "orientation": orientation,
        "sampling": sampled,
        "width": width,
        "height": height,
        "precision": pixels,
    }
    report = f"{', '.join(files)}: {target} probe, {width} x {height}, {pixels}"
    warnings = [f"{job.source}: {line}" for line in probe.report.warnings()]
    if sampled == "border" and not marked:
        warnings.append(f"{path}: no attribute tells of this; read it with --sampling border")
    if target in CUBES and orientation != default_orientation(target):
        warnings.append(
            f"{path}: no attribute tells of this; read it with --orientation {orientation}"
        )
    return Converted(result, report, warnings)
