"""`shrm compare`: how far maps are from the truth, or from each other."""

from __future__ import annotations

import json
import math
import re
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from shrm_cli.cli.options import (
    exposure_option,
    make_read_options,
    print_json,
    progress_bar,
    read_options,
    report_options,
    warn,
)
from shrm_cli.cli.types import AzimuthElevation, Within

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from shrm_cli.render.comparison import Comparison, Difference

_VIEWS = ("0,0", "120,20", "240,-20")
_TRUTH = "truth"


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
    "--source-height", type=click.IntRange(2, 8192), metavar="ROWS",
    help="Rows that the probe is averaged down to for the truth: faster.  [default: all]",
)  # fmt: skip
@click.option(
    "--view", "views", type=AzimuthElevation(), multiple=True, default=_VIEWS,
    help="Direction to the viewer, degrees: azimuth from +Z towards +X, elevation. May be given "
    f"several times.  [default: {' '.join(_VIEWS)}]",
)  # fmt: skip
@click.option(
    "--size", type=click.IntRange(16, 2048), default=128, show_default=True,
    help="Width and height of a sphere's picture, pixels.",
)  # fmt: skip
@exposure_option
@click.option(
    "--amplify", type=Within(1e-6, 1e6), metavar="X", default=1.0, show_default=True,
    help="Factor of the difference images.",
)  # fmt: skip
@click.option(
    "-o", "--output", type=click.Path(),
    help="PNG or EXR to write.  [default: compare.png in the current folder]",
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
    source_height: int | None,
    views: tuple[tuple[float, float], ...],
    size: int,
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
    differences. The options from --sampling to --clamp are about the file of --probe.

    \b
      shrm compare a.shrm.exr b.shrm.exr
      shrm compare a.shrm.exr a.cabral.exr --probe a.exr --amplify 4
    """
    from shrm_cli.brdf.spec import parse_spec
    from shrm_cli.exr import read_map
    from shrm_cli.files import check_target
    from shrm_cli.probe.probe import open_probe
    from shrm_cli.render.camera import Viewer
    from shrm_cli.render.comparison import compare_spheres, sheet_layout
    from shrm_cli.render.image import file_type, write_picture
    from shrm_cli.render.provenance import common_brdf, differing_origins, record_of

    _check_usage(ctx, maps, probe, ["spec", "source_height", "sampling", *reading])
    source = None if probe is None else open_probe(probe, make_read_options(sampling, reading))
    names = maps[1:] if source is None else maps
    target = None if no_picture else output or "compare.png"
    if target is not None:
        file_type(target)
        check_target(
            target, [*maps, *(str(file.path) for file in (source.files if source else ()))]
        )
        sheet_layout(len(names), len(views), size)  # refuses what is too large
    loaded = [read_map(path) for path in maps]
    infos = {path: each.info for path, each in zip(maps, loaded, strict=True)}
    baseline: Any = loaded[0]
    label, digest, record = f"that of {maps[0]}", baseline.info.probe_sha256, baseline.info.brdf
    viewers = [Viewer(*view) for view in views]
    with progress_bar("comparing", quiet) as bar:
        progress = _TruthProgress(len(viewers), size, bar)
        if source is not None:
            from shrm_cli.reference import Reference

            brdf = common_brdf(infos) if spec is None else parse_spec(spec)
            label, digest, record = source.name, source.digest(), record_of(brdf)
            baseline = Reference(source, brdf, source_height, progress=progress.points)
        comparison = compare_spheres(baseline, loaded[-len(names) :], viewers, size, progress.rows)
    warnings = [] if source is None else [f"{probe}: {w}" for w in source.report.warnings()]
    warnings += differing_origins(infos, label, digest, record)
    result = {
        "baseline": maps[0] if source is None else _TRUTH,
        "probe": probe,
        "brdf": record,
        "size": size,
        **_numbers(comparison, names, views),
        "picture": target,
    }
    report = [_table(result)]
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


def _check_usage(
    ctx: click.Context, maps: Sequence[str], probe: str | None, of_truth: Sequence[str]
) -> None:
    """Refuse what has no meaning: a map alone, options that nothing obeys."""
    given = {
        param.name: param.opts[-1]
        for param in ctx.command.params
        if param.name and ctx.get_parameter_source(param.name) is ParameterSource.COMMANDLINE
    }
    unused = [given[name] for name in of_truth if name in given]
    if probe is None and unused:
        raise click.UsageError(f"{unused[0]} is about the truth; give --probe too", ctx)
    if probe is None and len(maps) == 1:
        raise click.UsageError(
            "one map has nothing to be compared with; name another, or give --probe", ctx
        )
    if "output" in given and "no_picture" in given:
        raise click.UsageError("-o and --no-picture exclude each other; leave one out", ctx)


class _TruthProgress:
    """Rows of the truth's pictures, and within them the points; maps take no time beside it."""

    def __init__(self, views: int, size: int, bar: Callable[[int, int], None] | None) -> None:
        self.done, self.size, self.total, self.bar = 0, size, views * size, bar

    def rows(self, count: int) -> None:
        """Take note of whole rows."""
        self.done = min(self.done + count, self.total)
        self._show(self.done)

    def points(self, done: int, total: int) -> None:
        """Take note of points in the view that is being drawn."""
        self._show(self.done + (self.size - self.done % self.size) * done // total)

    def _show(self, rows: int) -> None:
        if self.bar is not None:
            self.bar(rows, self.total)


def _numbers(
    comparison: Comparison, names: Sequence[str], views: Sequence[tuple[float, float]]
) -> dict[str, Any]:
    """Differences of each view and of all together, as the JSON has them."""

    def rows(view: int | None) -> list[dict[str, Any]]:
        return [
            {"file": name, **_values(comparison.difference(index, view))}
            for index, name in enumerate(names)
        ]

    each = [{"view": list(view), "maps": rows(index)} for index, view in enumerate(views)]
    return {"views": each, "summary": rows(None)}


def _values(difference: Difference) -> dict[str, float | None]:
    # JSON knows no infinity.
    return {key: v if math.isfinite(v) else None for key, v in asdict(difference).items()}


def _table(result: dict[str, Any]) -> str:
    rows = [["view", "map", "RMSE", "relative", "maximum", "PSNR"]]
    for each in result["views"]:
        rows += [["{:g},{:g}".format(*each["view"]), *_cells(row)] for row in each["maps"]]
    rows += [["all", *_cells(row)] for row in result["summary"]]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    of_probe = "" if result["probe"] is None else f" of {result['probe']}"
    lines = [f"compared with {result['baseline']}{of_probe}"]
    for view, name, *numbers in rows:
        cells = [view.ljust(widths[0]), name.ljust(widths[1])]
        cells += [text.rjust(width) for text, width in zip(numbers, widths[2:], strict=True)]
        lines.append("  ".join(cells))
    return "\n".join(lines)


def _cells(row: dict[str, Any]) -> list[str]:
    rmse, relative, psnr = row["rmse"], row["relative_rmse"], row["psnr"]
    none = "inf dB" if rmse == 0 else "-inf dB"
    return [
        row["file"],
        f"{rmse:.4g}",
        "inf" if relative is None else f"{relative:.2%}",
        f"{row['maximum']:.4g}",
        none if psnr is None else f"{psnr:.1f} dB",
    ]


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
    recipe = {
        "compare": [Path(path).name for path in settings["maps"]],
        "probe": None if probe is None else Path(probe).name,
        "views": [each["view"] for each in settings["views"]],
        **{key: settings[key] for key in ("brdf", "size", "exposure", "amplify")},
    }
    attributes: dict[str, Any] = {"shrm:recipe": json.dumps(recipe)}
    if len(primaries) == 1 and None not in primaries:
        attributes["chromaticities"] = primaries.pop()
    return attributes
