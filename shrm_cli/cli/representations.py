"""The part of `shrm compare` that compares representations of one probe."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import shrm_cli as shrm
from shrm_cli import settings
from shrm_cli.cli import usage
from shrm_cli.cli.options import told_of_exposure
from shrm_cli.cli.terminal import announce, columns, conclude, progress_bar
from shrm_cli.files.recipe import picture_attributes
from shrm_cli.maps.options import bytes_text, counted, listing
from shrm_cli.maps.registry import installed_names
from shrm_cli.vocabulary import COMPARED, DEFAULT_MAX_SIZE

if TYPE_CHECKING:
    from shrm_cli.analysis.representations import Plan, RepresentationResult, RepresentationTable

ROUGHNESS = (0.5, 1.0)
"""Default range of the perceptual roughness."""
STEPS = 4
"""Default number of roughnesses in a range."""
SIZE, SIZE_OF_PICTURE = 96, 128
"""Default width and height of a sphere in pixels: without a picture to write, and with one."""


def print_representations(
    path: str,
    options: shrm.ReadOptions,
    roughness: tuple[float, float] | None,
    exposure: float | None,
    output: str | None,
    *,
    f0: str | None,
    views: Sequence[tuple[float, float]],
    size: int | None,
    source_height: int | None,
    exact: bool,
    steps: int | None,
    eps: float,
    max_memory: int | None,
) -> None:
    """Print a table of the storage, the time and the errors of each representation of a probe."""
    import numpy as np

    from shrm_cli.analysis.representations import (
        compare_representations,
        plan_comparison,
        table_layout,
    )
    from shrm_cli.files.image import file_type, write_picture
    from shrm_cli.render.image import expose, exposure_advice, shown_at
    from shrm_cli.render.lit import ggx_surface, reflectance

    if shrm.is_map(path):
        raise usage.wrong_usage(f"{path} is a map; --representations takes a light probe")
    source = shrm.open_probe(path, options)
    low, high = roughness or ROUGHNESS
    size = size or (SIZE if output is None else SIZE_OF_PICTURE)
    steps = 1 if low == high else steps or STEPS
    if output is not None:
        table_layout(steps, size)  # raises if the sheet is too large
        file_type(output)
        usage.check_outputs([output])
    color = None if f0 is None else reflectance(f0, source.chromaticities)
    surfaces = [ggx_surface(float(each), color) for each in np.linspace(low, high, steps)]
    # The cache is off, because with it a second run would take less time than the first.
    click.get_current_context().with_resource(settings.using(cache=False))
    plan = plan_comparison(
        source, surfaces, eps, [shrm.Viewer(*view) for view in views], size, source_height,
        max_memory, exact,
    )  # fmt: skip
    announce(_statement(plan, path))
    with progress_bar("comparing") as progress:
        table = compare_representations(plan, progress)
    result = {"probe": path, **_facts(plan, table), "picture": output}
    warnings = source.warnings() + _doubts(plan, table)
    report = [*_report(table, path), *_left_out()]
    if output is not None:
        shows = table.truth[:, 0]
        stops = shown_at(output, *shows, asked=exposure)
        pixels = table.sheet(stops)
        attributes = _attributes({**result, "exposure": stops}, source.chromaticities)
        pixel_type = write_picture(output, pixels, attributes=attributes)
        report.append(f"{output}: {pixels.shape[1]} x {pixels.shape[0]}, {pixel_type}")
        report += told_of_exposure(exposure, stops)
        warnings += exposure_advice(output, expose(shows, stops), stops)
    conclude(result, report, warnings)


def _left_out() -> list[str]:
    """Return a line about the forms that are not compared, if there are any."""
    if not (others := installed_names()):
        return []
    names = f"{listing(others, 'and')} of installed packages"
    return [f"Without {names}; shrm choose measures those that are offered."]


def _doubts(plan: Plan, table: RepresentationTable) -> list[str]:
    """Return what could not be made, or not as large as elsewhere, a line each."""
    warnings = []
    if plan.memory.is_reduced:
        warnings.append(
            f"maps have at most {bytes_text(plan.memory.max_size)} each, less than "
            f"{bytes_text(DEFAULT_MAX_SIZE)}, to keep `max_memory` {bytes_text(plan.memory.limit)}"
        )
    warnings += [
        f"{each.representation.title}: {why}" for each in table.results for why in each.failures
    ]
    return warnings


def _facts(plan: Plan, table: RepresentationTable) -> dict[str, Any]:
    """Return what JSON has of the comparison."""
    return {
        "probe_sha256": plan.probe.digest(),
        "roughness": [each.number("roughness") for each in table.surfaces],
        "f0": list(table.surfaces[0].color("f0")),
        "epsilon": plan.eps,
        "views": [[each.azimuth, each.elevation] for each in plan.viewers],
        "size": plan.size,
        "source_height": plan.source_height,
        "truth_errors": list(table.truth_errors),
        "estimated_memory": plan.memory.needed,
        "max_memory": plan.memory.limit,
        "max_size": plan.memory.max_size,
        "representations": [_values(each) for each in table.results],
    }


def _statement(plan: Plan, path: str) -> list[str]:
    """Return lines that say what will be made, and what that takes."""
    memory, size = plan.memory, plan.size
    pictures = counted(plan.truths, "picture")
    return [
        f"{path}: {pictures} of {size} x {size} pixels of the truth, and as many of each of "
        f"{len(COMPARED)} representations",
        f"  {counted(plan.maps, 'map')} of at most {bytes_text(memory.max_size)} each, and "
        f"{bytes_text(memory.needed)} of memory at most, of {bytes_text(memory.limit)} allowed",
    ]


def _values(result: RepresentationResult) -> dict[str, Any]:
    return {
        "representation": result.representation.name,
        "files": result.files,
        "bytes": result.stored,
        "seconds": result.seconds,
        "relative_rmse": result.errors,
        "relative_rmse_of_all": result.error,
        **_pixel_facts(result),
        "failures": [usage.flags(each) for each in result.failures],
    }


def _pixel_facts(result: RepresentationResult) -> dict[str, Any]:
    """Return what `shrm compare` says of pixels, of each roughness and of all together."""
    values: dict[str, Any] = {}
    for key in ("median_relative_error", "p95_relative_error", "wrong_share", "negative_share"):
        *each, whole = [
            None if found is None else getattr(found, key)
            for found in (*result.differences, result.difference)
        ]
        values |= {key: each, f"{key}_of_all": whole}
    return values


def _report(table: RepresentationTable, path: str) -> list[str]:
    from shrm_cli.brdf.base import value_text

    roughness = [f"{each.number('roughness'):.3g}" for each in table.surfaces]
    f0 = value_text(table.surfaces[0].color("f0"))
    rows = [
        ["", "files", "storage", "build", *roughness, *(["all"] if roughness[1:] else []), "p95"]
    ]
    for each in table.results:
        errors = [*each.errors, *([each.error] if roughness[1:] else [])]
        costs = [bytes_text(each.stored), f"{each.seconds:.2f} s"] if each.files else ["-", "-"]
        errors.append(None if each.difference is None else each.difference.p95_relative_error)
        rows.append([each.representation.title, str(each.files), *costs, *map(_share, errors)])
    stated = [error for error in table.truth_errors if error is not None]
    how = f"summed adaptively, 95 % within {max(stated):.2%}" if stated else "summed in full"
    every = [each.representation for each in table.results]
    named = listing([each.title for each in every if each.needs_brdf], "and")
    return [
        f"{path} on GGX of f0 {f0}: relative RMS error by roughness; the truth is {how}",
        *columns(rows),
        "p95: the 95th percentile of the relative error over all the pixels of the spheres.",
        f"{named} need a file for each roughness, all counted; the others serve all.",
    ]


def _share(error: float | None) -> str:
    if error is None:
        return "-"
    return f"{error:.2%}" if math.isfinite(error) else "inf"


def _attributes(
    settings: dict[str, Any], chromaticities: tuple[float, ...] | None
) -> dict[str, Any]:
    """Return the attributes of an EXR, whose bytes must not depend on the probe's folder."""
    keys = ("roughness", "f0", "epsilon", "views", "size", "source_height", "exposure")
    recipe = {
        "compare": [Path(settings["probe"]).name],
        "representations": [each["representation"] for each in settings["representations"]],
        **{key: settings[key] for key in keys},
    }
    return picture_attributes(recipe, [chromaticities])
