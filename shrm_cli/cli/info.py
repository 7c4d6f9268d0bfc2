"""`shrm info`: what a file is."""

from typing import Any

import click

from shrm_cli.cli.options import (
    make_read_options,
    print_json,
    read_options,
    refuse_read_options,
    report_options,
    warn,
)


@click.command()
@click.argument("file", type=click.Path())
@click.option(
    "--sampling", type=click.Choice(["center", "border"]), help="Where a probe's edge pixels lie."
)
@read_options
@report_options
def info(file: str, sampling: str | None, as_json: bool, quiet: bool, **reading: Any) -> None:
    """Print what FILE is: a map or a table that shrm wrote, or a light probe."""
    from shrm_cli.exr import is_map
    from shrm_cli.exr.brdf_table import is_table

    warnings: list[str] = []
    if is_map(file):
        refuse_read_options("FILE is a map")
        values = _describe_map(file)
    elif is_table(file):
        values = _describe_table(file)
    else:
        values, found = _describe_probe(file, make_read_options(sampling, reading))
        warnings = [f"{file}: {line}" for line in found]
    if as_json:
        print_json({"file": file, **values, "warnings": warnings})
    elif not quiet:
        width = max(len(key) for key in values)
        click.echo(file)
        for key, value in values.items():
            click.echo(f"  {key.replace('_', ' '):<{width}}  {_text(value)}")
    warn(warnings, quiet)


def _describe_table(file: str) -> dict[str, Any]:
    from shrm_cli.brdf.table import Table

    table = Table.open(file)
    return {
        "kind": "BRDF table",
        "nodes": [len(axis) for axis in table.axes],
        "center": table.center,
        "includes_cosine": table.includes_cosine,
        "see": f"shrm brdf {file}",
    }


def _describe_map(file: str) -> dict[str, Any]:
    from shrm_cli.exr import read_map
    from shrm_cli.maps.representations import map_count

    reflection_map = read_map(file)
    known = reflection_map.info
    return {
        "kind": "map",
        "representation": reflection_map.representation,
        "frame": reflection_map.frame,
        "center": reflection_map.center,
        "size": reflection_map.size,
        "sampling": reflection_map.sampling,
        "maps": map_count(reflection_map),
        "domain": known.domain,
        "order_f": known.order_f,
        "order_p": known.order_p,
        "epsilon": known.tolerance,
        "brdf_energy_captured": known.captured,
        "predicted_error": known.predicted_error,
        "added_error": known.added_error,
        "fit_residual": known.fit_residual,
        "brdf": known.brdf,
        "probe": known.probe,
        "probe_sha256": known.probe_sha256,
        "chromaticities": known.chromaticities,
    }


def _describe_probe(file: str, options: Any) -> tuple[dict[str, Any], list[str]]:
    import numpy as np

    from shrm_cli.probe.probe import open_probe

    probe = open_probe(file, options)
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    total, area = np.zeros(3), 0.0
    for _, pixels, weights in probe.blocks():
        low = np.minimum(low, pixels.min(axis=(0, 1)))
        high = np.maximum(high, pixels.max(axis=(0, 1)))
        full = np.broadcast_to(weights, pixels.shape[:2])
        total += np.einsum("ijc,ij->c", pixels, full, dtype=float)
        area += float(full.sum())
    first = probe.files[0]
    values = {
        "kind": "probe",
        "layout": probe.layout,
        "width": first.width,
        "height": first.height,
        "sampling": probe.sampling,
        "orientation": probe.orientation if probe.grid == "cube" else None,
        "format": first.file_format,
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
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, list | tuple):
        return ", ".join(_text(item) for item in value)
    if isinstance(value, dict):
        return ", ".join(f"{key} {_text(item)}" for key, item in value.items())
    return "none" if value in (None, "") else str(value)
