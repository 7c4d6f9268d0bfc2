"""`shrm compare` measures how far maps are from the truth, or from each other."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import shrm_cli as shrm
from shrm_cli.cli import options, shading, usage
from shrm_cli.cli.terminal import columns, conclude, progress_bar
from shrm_cli.cli.types import BYTES, FILE, FRACTION, PATH, Spec, flag, interval, option, within
from shrm_cli.extras import install
from shrm_cli.files.recipe import picture_attributes
from shrm_cli.vocabulary import DEFAULT_EPS, MIN_ROUGHNESS

if TYPE_CHECKING:
    from shrm_cli.analysis.compare import Compared
    from shrm_cli.render.comparison import Comparison
    from shrm_cli.render.seen import FlipError

_TRUTH = "truth"
_SIZE = 256
"""Default width and height of a sphere's picture where maps are compared, pixels."""
_NO_FLIP = f"flip-evaluator is not installed, so HDR-FLIP is left out; {install('flip')}"
_OF_MAPS = ("spec", "anisotropy", "taps", "window", "amplify", "no_picture", "no_flip")
"""Arguments that do not apply with --representations."""
_SHOWN_OF_ALL = ("f0", "views", "size", "source_height", "exact")
_SHOWN = (*_SHOWN_OF_ALL, "anisotropy", "taps", "window")
"""Arguments that `shrm_cli.analysis.compare.compare` takes as they are."""
_OF_REPRESENTATIONS = ("eps", "steps", "max_memory")
"""Arguments that apply only with --representations."""


@click.command()
@click.argument("maps", metavar="MAP...", nargs=-1, required=True, type=FILE)
@options.lit_by("Compare with the truth: the integral under this light probe.")
@option(
    "--brdf spec SPEC", Spec(),
    help="BRDF of the truth.  [default: the one of all maps; measured files are looked for beside "
    "the maps]",
)  # fmt: skip
@flag(
    "--representations",
    help="Compare what --to can make of one light probe, given as MAP: storage, time, error.",
)  # fmt: skip
@option(
    "--roughness R", interval(MIN_ROUGHNESS, 1),
    help="Perceptual roughness of the GGX surface that split sums and SH exponentials are shown "
    "as; of --representations A..B.  [default: 0.5; 0.5..1]",
)  # fmt: skip
@shading.f0_option
@shading.brushed_options
@shading.window_option
@option(
    "--steps N", click.IntRange(2, 32),
    help="Roughnesses of --representations, evenly spaced.  [default: 4]",
)  # fmt: skip
@option(
    "--eps X", FRACTION, default=DEFAULT_EPS,
    help="Of --representations: the fraction of the BRDF's energy that orders may miss.",
)  # fmt: skip
@options.truth_options
@option(
    "--max-memory BYTES", BYTES,
    help="Of --representations: the most memory that may be taken, such as 2GB. Maps are made "
    "smaller to keep it; pictures that exceed it are refused.  [default: half of the machine's]",
)  # fmt: skip
@options.views_option("views")
@option(
    "--size", click.IntRange(16, 2048),
    help="Width and height of a sphere's picture, pixels.  [default: 256; with "
    "--representations 96, and 128 with -o]",
)  # fmt: skip
@options.exposure_option
@option("--amplify X", within(1e-6, 1e6), "Factor of the difference images.", default=1.0)
@option(
    "-o --output", PATH,
    help="PNG or EXR to write.  [default: compare.png in the current folder; with "
    "--representations none]",
)  # fmt: skip
@flag("--no-picture", "Write no picture.")
@flag("--no-flip", "Leave out HDR-FLIP, which takes long for large spheres.")
@options.probe_options
@options.report_options
def compare(
    maps: tuple[str, ...],
    probe: str | None,
    spec: str | None,
    representations: bool,
    roughness: tuple[float, float] | None,
    exposure: float | None,
    amplify: float,
    output: str | None,
    no_picture: bool,
    no_flip: bool,
    **values: Any,
) -> None:
    """Compare each MAP with the truth of a --probe; without one, with the first MAP.

    Prints the differences over the sphere, and draws it: a view in each row, with the absolute
    differences. The options from --sampling to --working are about the file of the probe.

    RMSE, relative RMSE, maximum and PSNR are those of radiance. Median and p95 (95th percentile)
    are those of the relative error of the luminance over the sphere's pixels, where the truth
    counts as 2 % of its mean at least; >5% is the share of pixels where it exceeds 5 %, and
    <0 the share of negative pixels. FLIP is the mean HDR-FLIP error, 0 to 1, if
    flip-evaluator is installed.

    \b
      shrm compare a.shrm.exr b.shrm.exr
      shrm compare a.shrm.exr a.cabral.exr --probe a.exr --amplify 4
      shrm compare a.splitsum.exr a.she.exr --probe a.exr --roughness 0.6
      shrm compare a.exr --representations --roughness 0.5..1
    """
    shown = {name: values.pop(name) for name in _SHOWN}
    if representations:
        from shrm_cli.cli.representations import print_representations

        _check_representations(maps, output, roughness)
        print_representations(
            maps[0], options.make_read_options(values), roughness, exposure, output,
            **{name: shown[name] for name in _SHOWN_OF_ALL}, **values,
        )  # fmt: skip
        return
    from shrm_cli.files.image import file_type
    from shrm_cli.render.comparison import comparison_layout
    from shrm_cli.render.image import expose, exposure_advice, shown_at

    _check_usage(maps, probe, roughness, ["spec", "source_height", "exact", *options.READING_NAMES])
    shown["size"] = shown["size"] or _SIZE
    source = None if probe is None else shrm.open_probe(probe, options.make_read_options(values))
    target = None if no_picture else output or "compare.png"
    if target is not None:
        file_type(target)
        usage.check_outputs([target], files=maps, specs=[spec], draws=True)
        count = len(maps) - (source is None)
        # It raises if the sheet is too large.
        comparison_layout(count, len(shown["views"]), shown["size"])
    opened = [shrm.open_map(path) for path in maps]
    shading.refuse_window(opened)
    shading.refuse_surface(opened)
    with progress_bar("comparing") as bar:
        compared = shrm.compare(
            opened, source, spec, names=maps, roughness=roughness and roughness[0], **shown,
            progress=bar,
            # The maps may have named measured files, which are known only then.
            begin=lambda: usage.check_outputs([] if target is None else [target]),
        )  # fmt: skip
    flips, warnings = _flips(compared, no_flip)
    truth = compared.truth
    result = _result(compared, maps[0], probe, flips) | {"picture": target}
    # The first label is that of the baseline, which is the truth or the first map.
    labels = [_TRUTH, *_labels(maps)][-len(compared.names) - 1 :]
    how = "" if truth is None else f", {truth.statement}"
    report = _table(result, how, labels[1:], flips is not None)
    if target is not None:
        shows = compared.comparison.baseline
        stops = shown_at(target, *shows, asked=exposure)
        settings = {"maps": maps, "exposure": stops, "amplify": amplify, **result}
        report.append(_picture(target, compared.comparison, labels, settings))
        report += options.told_of_exposure(exposure, stops)
        warnings += exposure_advice(target, expose(shows, stops), stops)
    report += shading.told_of_taps(opened, shown["taps"], shown["anisotropy"])
    conclude(result, report, warnings + _too_large(result))


def _too_large(result: dict[str, Any]) -> list[str]:
    """Return a warning for each map that floats cannot compare."""
    return [
        f"{row['file']}: its values, or those that it is compared with, are too large for "
        "32-bit floats; the differences mean nothing"
        for row in result["summary"]
        if row["rmse"] is None
    ]


def _result(
    compared: Compared, first: str, probe: str | None, flips: list[list[FlipError | None]] | None
) -> dict[str, Any]:
    """Return what JSON has of the differences."""
    truth = compared.truth
    return {
        "baseline": first if truth is None else _TRUTH,
        "probe": probe,
        "brdf": compared.brdf,
        "truth_error": None if truth is None else truth.error,
        "size": compared.comparison.baseline.shape[-2],
        **compared.surface,
        **compared.numbers(flips),
    }


def _picture(
    target: str, comparison: Comparison, labels: Sequence[str], settings: dict[str, Any]
) -> str:
    """Write the picture, and say what it is."""
    from shrm_cli.files.image import write_picture

    pixels = comparison.picture(labels[0], labels[1:], settings["exposure"], settings["amplify"])
    attributes = _attributes(settings, {comparison.primaries})
    pixel_type = write_picture(target, pixels, attributes=attributes)
    return f"{target}: {pixels.shape[1]} x {pixels.shape[0]}, {pixel_type}"


def _check_usage(
    maps: Sequence[str],
    probe: str | None,
    roughness: tuple[float, float] | None,
    of_truth: Iterable[str],
) -> None:
    """Refuse a single map without a truth, and options that would have no effect."""
    is_range = roughness is not None and roughness[0] < roughness[1]
    usage.refuse_inapplicable({
        **dict.fromkeys(_OF_REPRESENTATIONS, (False, "with --representations")),
        "roughness": (
            not is_range, "as a range with --representations; give one number"
        ),
        **dict.fromkeys(of_truth, (probe is not None, "with --probe")),
    })  # fmt: skip
    if probe is None and len(maps) == 1:
        raise usage.wrong_usage(
            "one map has nothing to be compared with; name another, or give --probe"
        )
    usage.exclude("output", "no_picture")


def _check_representations(
    paths: Sequence[str], output: str | None, roughness: tuple[float, float] | None
) -> None:
    """Refuse several files, and options that would have no effect with --representations."""
    if len(paths) > 1:
        raise usage.wrong_usage(
            f"--representations takes a single light probe, not {len(paths)} files"
        )
    is_range = roughness is None or roughness[0] < roughness[1]
    place = "without --representations, where the probe stands in the place of MAP"
    usage.refuse_inapplicable({
        "probe": (False, place),
        **dict.fromkeys(_OF_MAPS, (False, "to maps, without --representations")),
        "exposure": (output is not None, "to the picture, with -o"),
        "steps": (is_range, "to a range of --roughness such as 0.5..1"),
    })  # fmt: skip


def _labels(maps: Sequence[str]) -> list[str]:
    """Return the names of files as labels, with folders if two names would be the same."""
    names = {path: Path(path).name for path in maps}
    if len(set(names.values())) < len(names):
        names = {path: path for path in maps}
    return [re.sub(r"\.exr$", "", names[path], flags=re.IGNORECASE) for path in maps]


def _attributes(
    settings: dict[str, Any], primaries: set[tuple[float, ...] | None]
) -> dict[str, Any]:
    """Return the attributes of an EXR, whose bytes must not depend on the folders of files."""
    probe = settings["probe"]
    recipe: dict[str, Any] = {
        "compare": [Path(path).name for path in settings["maps"]],
        "probe": None if probe is None else Path(probe).name,
        "views": [each["view"] for each in settings["views"]],
        **{key: settings[key] for key in ("roughness", "f0") if key in settings},
        **{key: settings[key] for key in ("brdf", "size", "exposure", "amplify")},
    }
    return picture_attributes(recipe, primaries)


def _flips(
    compared: Compared, no_flip: bool
) -> tuple[list[list[FlipError | None]] | None, list[str]]:
    """Return HDR-FLIP, if it will be printed and can be measured, and all warnings."""
    from shrm_cli.render.seen import can_flip

    if no_flip or (usage.is_quiet() and not usage.wants_json()):
        return None, compared.warnings
    if not can_flip():
        return None, [*compared.warnings, _NO_FLIP]
    with progress_bar("flipping") as bar:
        return compared.flips(bar), compared.warnings


def _table(result: dict[str, Any], how: str, names: Sequence[str], flipped: bool) -> list[str]:
    """Return a table with rows for each view, and then for all views together.

    The name of a map comes last, because it may be long. FLIP has a column if it was measured.
    """
    titles = ["RMSE", "relative", "median", "p95", ">5%", "<0", "FLIP", "max", "PSNR"]
    rows = [["view", *titles, "map"]]
    of_views = [("{:g},{:g}".format(*each["view"]), each["maps"]) for each in result["views"]]
    for view, maps in [*of_views, ("all", result["summary"])]:
        rows += [[view, *_cells(row), name] for row, name in zip(maps, names, strict=True)]
    if not flipped:
        column = rows[0].index("FLIP")
        rows = [row[:column] + row[column + 1 :] for row in rows]
    of_probe = "" if result["probe"] is None else f" of {result['probe']}"
    title = f"compared with {result['baseline']}{of_probe}{how}"
    return [title, *columns(rows, left=(0, -1))]


def _cells(row: dict[str, Any]) -> list[str]:
    rmse, psnr, flip = row["rmse"], row["psnr"], row["hdr_flip"]
    none = "inf dB" if rmse == 0 else "-inf dB"
    return [
        _number(rmse),
        _percent(row["relative_rmse"], 2),
        _percent(row["median_relative_error"], 1),
        _percent(row["p95_relative_error"], 1),
        _percent(row["wrong_share"], 0),
        _percent(row["negative_share"], 1),
        "-" if flip is None else f"{flip:.3f}",
        _number(row["maximum"]),
        none if psnr is None else f"{psnr:.1f} dB",
    ]


def _number(value: float | None) -> str:
    """Return a number with four digits; those that JSON cannot hold are infinite."""
    return "inf" if value is None else f"{value:.4g}"


def _percent(value: float | None, digits: int) -> str:
    """Return a share in percent; those that JSON cannot hold are infinite."""
    if value is None:
        return "inf"
    return f"{value:.{digits}%}" if value < 100 else f"{100 * value:.3g}%"
