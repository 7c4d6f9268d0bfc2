"""`shrm reference` draws the correct picture of a sphere, by brute force."""

from pathlib import Path
from typing import Any

import click

import shrm_cli as shrm
from shrm_cli.cli import options, usage
from shrm_cli.cli.terminal import conclude, progress_bar
from shrm_cli.cli.types import PATH, option, whole
from shrm_cli.files.recipe import picture_attributes
from shrm_cli.naming import brdf_label, probe_stem
from shrm_cli.vocabulary import MAX_SOURCE_HEIGHT, Precision


@click.command()
@click.argument("probe", metavar="PROBE", type=PATH)
@options.brdf_option
@option(
    "-o --output", PATH,
    help="PNG or EXR to write.  [default: PROBE.BRDF.reference.exr in the current folder]",
)  # fmt: skip
@usage.force_option
@options.view_option
@option("--size", whole(16, 8192), "Width and height of the picture, pixels.", default=256)
@options.exposure_option
@options.exact_option
@option(
    "--source-height H", whole(2, MAX_SOURCE_HEIGHT),
    help="Average the probe down to a lat-long of this height first.  [default: all pixels "
    "of probes of up to 2048 rows]",
)  # fmt: skip
@options.precision_option
@options.probe_options
@options.report_options
def reference(
    probe: str,
    spec: str,
    output: str | None,
    force: bool,
    view: tuple[float, float],
    size: int,
    exposure: float | None,
    exact: bool,
    source_height: int | None,
    precision: Precision,
    **reading: Any,
) -> None:
    """Render the correct sphere in the light of PROBE, by integrals over it.

    Every pixel sums the probe as finely as the lobe needs there, and what that may be wrong by is
    stated. --exact sums all pixels of the probe instead: minutes where this takes seconds.

    \b
      shrm reference probe.exr --brdf microfacet -o truth.png
    """
    from shrm_cli.files.image import file_type, write_picture
    from shrm_cli.maps.info import record_of
    from shrm_cli.reference import Reference
    from shrm_cli.render.image import expose, exposure_advice, shown_at
    from shrm_cli.render.sphere import render_sphere

    source = shrm.open_probe(probe, options.make_read_options(reading))
    brdf = shrm.parse_spec(spec, primaries=source.chromaticities)
    target = output or f"{probe_stem(probe)}.{brdf_label(spec)}.reference.exr"
    file_type(target)
    usage.check_outputs([target], specs=[spec])
    result = {
        "view": list(view),
        "size": size,
        "exposure": exposure or 0.0,
        "brdf": record_of(brdf),
        "probe": Path(probe).name,
        "probe_sha256": source.digest(),
        "source_height": source_height,
        "exact": exact,
    }
    # The probe is named without its folder, so that the file's bytes do not depend on that.
    recipe = {"reference": {**result, "reading": source.reading(), "precision": precision}}
    if not (output or force):
        usage.keep_other_picture(target, recipe)
    with progress_bar("integrating") as progress:
        truth = Reference(source, brdf, source_height, progress=progress, exact=exact)
        pixels = render_sphere(truth, shrm.Viewer(*view), size)
    stops = shown_at(target, pixels, asked=exposure)
    pixels = expose(pixels, stops)
    result |= {"source_pixels": truth.pixels, "truth_error": truth.error, "exposure": stops}
    recipe["reference"]["exposure"] = stops
    attributes = picture_attributes(recipe, [source.chromaticities])
    pixel_type = write_picture(target, pixels, precision, attributes)
    warnings = source.warnings()
    warnings += exposure_advice(target, pixels, stops)
    lines = [
        f"{target}: {size} x {size}, {pixel_type}",
        f"  BRDF           {brdf!r}",
        f"  view           azimuth {view[0]:g}, elevation {view[1]:g}",
        f"  source         {truth.pixels:,} pixels of {probe}",
        f"  truth          {truth.statement}",
        *options.told_of_exposure(exposure, stops),
    ]
    told = {"file": target, **result, "precision": pixel_type}
    conclude(told, lines, warnings)
