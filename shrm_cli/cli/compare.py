"""`shrm compare`: how far maps are from the truth, or from each other."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from shrm_cli.cli.differences import TruthProgress, numbers_of, table_of
from shrm_cli.cli.options import (
    exposure_option,
    make_read_options,
    print_json,
    progress_bar,
    read_options,
    report_options,
    warn,
)
from shrm_cli.cli.shading import f0_option, shaded_maps, surface_values
from shrm_cli.cli.types import AzimuthElevation, Fraction, Interval, Within

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

_VIEWS = ("0,0", "120,20", "240,-20")
_TRUTH = "truth"
_SIZE = 128
_OF_MAPS = {"probe", "spec", "amplify", "no_picture"}
_OF_REPRESENTATIONS = {"tolerance", "steps"}


@click.command()
@click.argument("maps", metavar="MAP...", nargs=-1, required=True, type=click.Path(dir_okay=False))
@click.option(
    "--probe", type=click.Path(), metavar="PROBE",
    help="Compare with the truth: the brute-force integral under this light probe.",
)  # fmt: skip
@click.option(
    "--brdf", "spec", metavar="SPEC", help="BRDF of the truth.  [default: the one of all maps]"
)
@click.option(
    "--representations", is_flag=True,
    help="Compare what --to can make of one light probe, given as MAP: storage, time, error.",
)  # fmt: skip
@click.option(
    "--roughness", type=Interval(0.05, 1), metavar="R",
    help="Perceptual roughness of the GGX surface that split sums and SH exponentials are shown "
    "as; of --representations A..B.  [default: 0.5; 0.5..1]",
)  # fmt: skip
@f0_option
@click.option(
    "--steps", type=click.IntRange(2, 32), metavar="N",
    help="Roughnesses of --representations, evenly spaced.  [default: 4]",
)  # fmt: skip
@click.option(
    "--eps", "tolerance", type=Fraction(), metavar="X", default=0.03, show_default=True,
    help="Of --representations: the fraction of the BRDF's energy that orders may miss.",
)  # fmt: skip
@click.option(
    "--source-height", type=click.IntRange(2, 8192), metavar="ROWS",
    help="Rows that the probe is averaged down to for the truth: faster.  [default: all; with "
    "--representations 24 / roughness^2 within 64 .. 256, right to 1 %]",
)  # fmt: skip
@click.option(
    "--view", "views", type=AzimuthElevation(), multiple=True, default=_VIEWS,
    help="Direction to the viewer, degrees: azimuth from +Z towards +X, elevation. May be given "
    f"several times.  [default: {' '.join(_VIEWS)}]",
)  # fmt: skip
@click.option(
    "--size", type=click.IntRange(16, 2048),
    help="Width and height of a sphere's picture, pixels.  [default: 128; with "
    "--representations 48, and 96 with -o]",
)  # fmt: skip
@exposure_option
@click.option(
    "--amplify", type=Within(1e-6, 1e6), metavar="X", default=1.0, show_default=True,
    help="Factor of the difference images.",
)  # fmt: skip
@click.option(
    "-o", "--output", type=click.Path(),
    help="PNG or EXR to write.  [default: compare.png in the current folder; with "
    "--representations none]",
)  # fmt: skip
@click.option("--no-picture", is_flag=True, help="Write no picture.")
@click.option(
    "--sampling", type=click.Choice(["center", "border"]), help="Where the probe's edge pixels lie."
)
@read_options
@report_options
@click.pass_context
def compare(
    ctx: click.Context,
    /,
    maps: tuple[str, ...],
    probe: str | None,
    spec: str | None,
    representations: bool,
    roughness: tuple[float, float] | None,
    f0: tuple[float, float, float] | None,
    steps: int | None,
    tolerance: float,
    source_height: int | None,
    views: tuple[tuple[float, float], ...],
    size: int | None,
    exposure: float,
    amplify: float,
    output: str | None,
    no_picture: bool,
    sampling: str | None,
    as_json: bool,
    quiet: bool,
    **reading: Any,
) -> None:
    """Compare each MAP with the truth of a --probe; without one, with the first MAP.

    Prints the differences over the sphere, and draws it: a view in each row, with the absolute
    differences. The options from --sampling to --clamp are about the file of the probe.

    \b
      shrm compare a.shrm.exr b.shrm.exr
      shrm compare a.shrm.exr a.cabral.exr --probe a.exr --amplify 4
      shrm compare a.splitsum.exr a.she.exr --probe a.exr --roughness 0.6
      shrm compare a.exr --representations --roughness 0.5..1
    """
    if representations:
        from shrm_cli.cli.representations import compare_representations

        _check_representations(ctx, maps, output, roughness)
        compare_representations(
            maps[0], make_read_options(sampling, reading), roughness, steps, f0, tolerance, views,
            size, source_height, exposure, output, as_json, quiet,
        )  # fmt: skip
        return
    from shrm_cli.brdf.spec import parse_spec
    from shrm_cli.files.picture import file_type, write_picture
    from shrm_cli.files.whole import check_target
    from shrm_cli.maps.provenance import common_brdf, differing_origins, record_of
    from shrm_cli.maps.read import read_map
    from shrm_cli.probe.probe import open_probe
    from shrm_cli.render.camera import Viewer
    from shrm_cli.render.comparison import compare_spheres, sheet_layout

    _check_usage(ctx, maps, probe, roughness, ["spec", "source_height", "sampling", *reading])
    size = size or _SIZE
    source = None if probe is None else open_probe(probe, make_read_options(sampling, reading))
    names = maps[1:] if source is None else maps
    target = None if no_picture else output or "compare.png"
    if target is not None:
        file_type(target)
        check_target(target, [*maps, *(map(str, source.paths) if source else ())])
        sheet_layout(len(names), len(views), size)  # refuses what is too large
    loaded, surface, warnings = shaded_maps(
        [read_map(path) for path in maps], maps, roughness and roughness[0], f0
    )
    infos = {path: each.info for path, each in zip(maps, loaded, strict=True)}
    baseline: Any = loaded[0]
    label, digest, record = f"that of {maps[0]}", baseline.info.probe_sha256, baseline.info.brdf
    viewers = [Viewer(*view) for view in views]
    with progress_bar("comparing", quiet) as bar:
        progress = TruthProgress(len(viewers), size, bar)
        if source is not None:
            from shrm_cli.reference import Reference

            advice = "give --brdf" + (", or another --roughness and --f0" if surface else "")
            brdf = common_brdf(infos, advice) if spec is None else parse_spec(spec)
            label, digest, record = source.name, source.digest(), record_of(brdf)
            baseline = Reference(source, brdf, source_height, progress=progress.points)
        comparison = compare_spheres(baseline, loaded[-len(names) :], viewers, size, progress.rows)
    warnings += [] if source is None else [f"{probe}: {w}" for w in source.report.warnings()]
    warnings += differing_origins(infos, label, digest, record)
    result = {
        "baseline": maps[0] if source is None else _TRUTH,
        "probe": probe,
        "brdf": record,
        "size": size,
        **surface_values(surface),
        **numbers_of(comparison, names, views),
        "picture": target,
    }
    report = [table_of(result)]
    if target is not None:
        # The baseline's first: the truth, or the first map.
        labels = [_TRUTH, *_labels(maps)][-len(names) - 1 :]
        pixels = comparison.picture(labels[0], labels[1:], exposure, amplify)
        settings = {"maps": maps, "exposure": exposure, "amplify": amplify, **result}
        primaries = {each.info.chromaticities for each in loaded}
        primaries |= {source.chromaticities} if source is not None else set()
        pixel_type = write_picture(target, pixels, attributes=_attributes(settings, primaries))
        report.append(f"{target}: {pixels.shape[1]} x {pixels.shape[0]}, {pixel_type}")
    if as_json:
        print_json({**result, "warnings": warnings})
    elif not quiet:
        click.echo("\n".join(report))
    warn(warnings, quiet)


def _given(ctx: click.Context) -> dict[str, str]:
    """The options on the command line: their flags by their names."""
    return {
        param.name: param.opts[-1]
        for param in ctx.command.params
        if param.name and ctx.get_parameter_source(param.name) is ParameterSource.COMMANDLINE
    }


def _check_usage(
    ctx: click.Context,
    maps: Sequence[str],
    probe: str | None,
    roughness: tuple[float, float] | None,
    of_truth: Iterable[str],
) -> None:
    """Refuse what has no meaning: a map alone, options that nothing obeys."""
    given = _given(ctx)
    alien = [given[name] for name in given if name in _OF_REPRESENTATIONS]
    if alien:
        raise click.UsageError(f"{alien[0]} is for --representations; leave it out", ctx)
    if roughness is not None and roughness[0] < roughness[1]:
        raise click.UsageError("a range of --roughness is for --representations; give one", ctx)
    unused = [given[name] for name in of_truth if name in given]
    if probe is None and unused:
        raise click.UsageError(f"{unused[0]} is about the truth; give --probe too", ctx)
    if probe is None and len(maps) == 1:
        raise click.UsageError(
            "one map has nothing to be compared with; name another, or give --probe", ctx
        )
    if "output" in given and "no_picture" in given:
        raise click.UsageError("-o and --no-picture exclude each other; leave one out", ctx)


def _check_representations(
    ctx: click.Context,
    paths: Sequence[str],
    output: str | None,
    roughness: tuple[float, float] | None,
) -> None:
    """Refuse what has no meaning for a table of representations."""
    given = _given(ctx)
    if len(paths) > 1:
        raise click.UsageError(
            f"--representations takes a single light probe, not {len(paths)} files", ctx
        )
    if "probe" in given:
        raise click.UsageError(
            "with --representations the probe stands in place of MAP; leave --probe out", ctx
        )
    alien = [given[name] for name in given if name in _OF_MAPS]
    if alien:
        raise click.UsageError(f"{alien[0]} is for maps; leave it or --representations out", ctx)
    if output is None and "exposure" in given:
        raise click.UsageError("--exposure is about the picture; give -o too", ctx)
    if "steps" in given and roughness is not None and roughness[0] == roughness[1]:
        raise click.UsageError("--steps is for a range of --roughness such as 0.5..1", ctx)


def _labels(maps: Sequence[str]) -> list[str]:
    """Names of files; with their folders where they would be the same."""
    names = {path: Path(path).name for path in maps}
    if len(set(names.values())) < len(names):
        names = {path: path for path in maps}
    return [re.sub(r"\.exr$", "", names[path], flags=re.IGNORECASE) for path in maps]


def _attributes(
    settings: dict[str, Any], primaries: set[tuple[float, ...] | None]
) -> dict[str, Any]:
    """What an EXR remembers: names without folders, so that its bytes do not depend on them."""
    probe = settings["probe"]
    recipe: dict[str, Any] = {
        "compare": [Path(path).name for path in settings["maps"]],
        "probe": None if probe is None else Path(probe).name,
        "views": [each["view"] for each in settings["views"]],
        **{key: settings[key] for key in ("roughness", "f0") if key in settings},
        **{key: settings[key] for key in ("brdf", "size", "exposure", "amplify")},
    }
    attributes: dict[str, Any] = {"shrm:recipe": json.dumps(recipe)}
    if len(primaries) == 1 and None not in primaries:
        attributes["chromaticities"] = primaries.pop()
    return attributes
