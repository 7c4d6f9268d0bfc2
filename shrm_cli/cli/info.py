"""`shrm info` prints what a file is."""

from __future__ import annotations

from typing import Any

import click

from shrm_cli.cli.options import (
    conclude,
    make_read_options,
    read_options,
    reading_rules,
    report_options,
)
from shrm_cli.cli.usage import refuse_inapplicable
from shrm_cli.vocabulary import SAMPLINGS

_MOST_ROWS, _MOST_NUMBERS = 9, 16
"""The most rows of a table and numbers of a list that are printed as text; JSON has them all."""


@click.command()
@click.argument("file", type=click.Path())
@click.option("--sampling", type=click.Choice(SAMPLINGS), help="Where a probe's edge pixels lie.")
@read_options
@report_options
def info(file: str, sampling: str | None, as_json: bool, quiet: bool, **reading: Any) -> None:
    """Print what FILE is: a map or table of shrm, a light probe, light file or measured BRDF."""
    from shrm_cli.brdf.environment.file import read_table_facts
    from shrm_cli.brdf.measured.reading.table_file import is_table
    from shrm_cli.brdf.spec import is_measured_file
    from shrm_cli.maps.file import is_map
    from shrm_cli.transfer.file import is_transfer, read_transfer

    warnings: list[str] = []
    if is_map(file):
        refuse_inapplicable(reading_rules(False, "to probes; FILE is a map"))
        values = _describe_map(file)
    elif is_transfer(file):
        refuse_inapplicable(reading_rules(False, "to probes; FILE is a precomputed transfer"))
        values = {"kind": "precomputed transfer", **read_transfer(file).summary()}
    elif is_table(file):
        values = _describe_table(file)
    elif (table := read_table_facts(file)) is not None:
        what = "to probes; FILE is an environment-BRDF table"
        refuse_inapplicable(reading_rules(False, what))
        values = {"kind": "environment-BRDF table", **table}
    elif is_measured_file(file):
        refuse_inapplicable(reading_rules(False, "to probes; FILE is a measured BRDF"))
        values = _describe_measured(file)
    else:
        values, found = _describe_probe(file, make_read_options(sampling, reading))
        warnings = [f"{file}: {line}" for line in found]
    width = max(len(key) for key in values)
    lines = [file]
    for key, value in values.items():
        text = _text(value).replace("\n", "\n" + " " * (width + 4))
        lines.append(f"  {key.replace('_', ' '):<{width}}  {text}")
    conclude({"file": file, **values}, lines, warnings, as_json, quiet)


def _describe_table(file: str) -> dict[str, Any]:
    from shrm_cli.brdf.measured.table import Table

    table = Table.open(file)
    return {
        "kind": "BRDF table",
        "nodes": [len(axis) for axis in table.axes],
        "center": table.center,
        "includes_cosine": table.includes_cosine,
        "see": f"shrm brdf {file}",
    }


def _describe_measured(file: str) -> dict[str, Any]:
    from shrm_cli.brdf.measured import open_measured

    found = open_measured(file)
    return {"kind": "measured BRDF", "format": found.name, "see": f"shrm brdf {file}"}


def _describe_map(file: str) -> dict[str, Any]:
    from shrm_cli.maps.file import open_map

    found = open_map(file)
    return {
        "kind": "map",
        **found.summary(),
        **found.details(),
        **found.info.origin(),
        "chromaticities": found.info.chromaticities,
    }


def _describe_probe(file: str, options: Any) -> tuple[dict[str, Any], list[str]]:
    import numpy as np

    from shrm_cli.probe.lamps import PolarRows
    from shrm_cli.probe.probe import open_probe

    probe = open_probe(file, options)
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    total, area = np.zeros(3), 0.0
    polar_rows = PolarRows(probe.grid)
    for start, pixels, weights in probe.blocks():
        polar_rows.add(start, pixels)
        low = np.minimum(low, pixels.min(axis=(0, 1)))
        high = np.maximum(high, pixels.max(axis=(0, 1)))
        full = np.broadcast_to(weights, pixels.shape[:2])
        total += np.einsum("ijc,ij->c", pixels, full, dtype=float)
        area += float(full.sum())
    for lamps in polar_rows.lamps():
        weights = probe.grid.weights(lamps.start, lamps.start + len(lamps.excess))
        total += np.einsum("ijc,ij->c", lamps.light, np.broadcast_to(weights, lamps.shape))
    first = probe.images[0]
    values = {
        "kind": "light file" if first.file_format == "light file" else "probe",
        "layout": probe.layout,
        "width": first.width,
        "height": first.height,
        "sampling": probe.sampling,
        "orientation": probe.orientation,
        "format": first.file_format,
        **first.facts(),
        "minimum": low.tolist(),
        "maximum": high.tolist(),
        "mean": (total / area).tolist(),
        "chromaticities": probe.chromaticities,
        "sha256": probe.digest(),
    }
    return {key: value for key, value in values.items() if value is not None}, (
        probe.report.warnings()
    )


def _text(value: Any) -> str:
    if value in (None, "", {}, [], ()):
        return "none"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, list | tuple) and value and isinstance(value[0], list | dict):
        if isinstance(value[0], list) and (len(value) > _MOST_ROWS or len(value[0]) > 3):
            return "see --json"
        return "\n".join(_text(item) for item in value)
    if isinstance(value, list | tuple) and len(value) > _MOST_NUMBERS:
        return "see --json"
    if isinstance(value, list | tuple):
        return ", ".join(_text(item) for item in value)
    if isinstance(value, dict):
        return ", ".join(f"{key.replace('_', ' ')} {_text(item)}" for key, item in value.items())
    return str(value)
