"""`shrm info` prints what a file is."""

from __future__ import annotations

from typing import Any

import click

from shrm_cli.cli.options import (
    conclude,
    make_read_options,
    probe_options,
    reading_rules,
    report_options,
)
from shrm_cli.cli.usage import refuse_inapplicable, wants_json


@click.command()
@click.argument("file", type=click.Path())
@click.option(
    "--stats/--no-stats", default=True, show_default=True,
    help="Read the pixels of a probe: range, irradiance, white balance, lamps.",
)  # fmt: skip
@probe_options
@report_options
def info(file: str, stats: bool, **reading: Any) -> None:
    """Print what FILE is: a map or table of shrm, a light probe, light file or measured BRDF.

    Of a probe it reads the pixels. Stops lie between the luminances that 1 % and 99.9 % of the
    sphere are below; irradiance is that of normals along the axes, +Y that of the ground; the
    temperature is the correlated one of the mean light. Advice names small lamps that hold so much
    of the light that glossy surfaces show them wrong; `shrm sun` takes them out.
    """
    from shrm_cli.analysis.facts import fact_text, in_words
    from shrm_cli.brdf.environment.file import read_table_facts
    from shrm_cli.brdf.measured.table import is_table
    from shrm_cli.brdf.spec import is_measured_file
    from shrm_cli.maps.file import is_map
    from shrm_cli.maps.shader.file import read_layers_facts
    from shrm_cli.rooms.file import is_grid, read_grid
    from shrm_cli.transfer.file import is_transfer, read_transfer

    warnings: list[str] = []
    worded: dict[str, str] = {}
    what = ""
    if is_map(file):
        what, values = "is a map", _describe_map(file)
    elif is_transfer(file):
        what = "is a precomputed transfer"
        values = {"kind": "precomputed transfer", **read_transfer(file).summary()}
    elif is_grid(file):
        what = "is a grid of probes"
        values = {"kind": "grid of probes", **read_grid(file).summary()}
    elif is_table(file):
        values = _describe_table(file)
    elif (table := read_table_facts(file)) is not None:
        what = "is an environment-BRDF table"
        values = {"kind": "environment-BRDF table", **table}
    elif (textures := read_layers_facts(file)) is not None:
        what, values = "holds the textures of a map", {"kind": "textures of --shader", **textures}
    elif is_measured_file(file):
        what, values = "is a measured BRDF", _describe_measured(file)
    else:
        options = make_read_options(reading)
        values, found = _describe_probe(file, options, stats)
        worded = in_words(values) if stats and not wants_json() else {}
        warnings = [f"{file}: {line}" for line in found]
    refuse_inapplicable(reading_rules(not what, f"to probes; FILE {what}"))
    width = max(len(key) for key in values)
    lines = [file]
    for key, value in (values | worded).items():
        text = fact_text(value).replace("\n", "\n" + " " * (width + 4))
        lines.append(f"  {key.replace('_', ' '):<{width}}  {text}")
    conclude({"file": file, **values}, lines, warnings)


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
    from shrm_cli.analysis.facts import map_facts
    from shrm_cli.maps.file import open_map

    return map_facts(open_map(file))


def _describe_probe(file: str, options: Any, stats: bool) -> tuple[dict[str, Any], list[str]]:
    """Return the facts of a probe, and warnings."""
    from shrm_cli.analysis.facts import probe_facts
    from shrm_cli.probe.open import open_probe

    probe = open_probe(file, options)
    facts = probe_facts(probe, stats)
    return facts, probe.report.warnings() if stats else list(probe.report.notes)
