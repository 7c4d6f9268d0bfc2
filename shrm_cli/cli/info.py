"""`shrm info`: what a file is."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from shrm_cli.cli.options import (
    make_read_options,
    print_json,
    read_options,
    refuse_read_options,
    report_options,
    warn,
)

if TYPE_CHECKING:
    from shrm_cli.maps.light_map import EngineMap

_MOST_ROWS, _MOST_NUMBERS = 9, 16
"""Of a table, and of a list, that people are shown; programs get them all."""


@click.command()
@click.argument("file", type=click.Path())
@click.option(
    "--sampling", type=click.Choice(["center", "border"]), help="Where a probe's edge pixels lie."
)
@read_options
@report_options
def info(file: str, sampling: str | None, as_json: bool, quiet: bool, **reading: Any) -> None:
    """Print what FILE is: a map or a table that shrm wrote, or a light probe."""
    from shrm_cli.brdf.measured.reading.table_writer import is_table
    from shrm_cli.maps.read import environment_table, is_map

    warnings: list[str] = []
    if is_map(file):
        refuse_read_options("FILE is a map")
        values = _describe_map(file)
    elif is_table(file):
        values = _describe_table(file)
    elif (table := environment_table(file)) is not None:
        refuse_read_options("FILE is an environment-BRDF table")
        values = {"kind": "environment-BRDF table", **table}
    else:
        values, found = _describe_probe(file, make_read_options(sampling, reading))
        warnings = [f"{file}: {line}" for line in found]
    if as_json:
        print_json({"file": file, **values, "warnings": warnings})
    elif not quiet:
        width = max(len(key) for key in values)
        click.echo(file)
        for key, value in values.items():
            text = _text(value).replace("\n", "\n" + " " * (width + 4))
            click.echo(f"  {key.replace('_', ' '):<{width}}  {text}")
    warn(warnings, quiet)


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


def _describe_map(file: str) -> dict[str, Any]:
    from shrm_cli.maps.light_map import EngineMap
    from shrm_cli.maps.read import read_map
    from shrm_cli.maps.representations import map_count

    reflection_map = read_map(file)
    known = reflection_map.info
    if isinstance(reflection_map, EngineMap):
        return _describe_for_engines(reflection_map)
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


def _describe_for_engines(found: EngineMap) -> dict[str, Any]:
    known = found.info
    return {
        "kind": "map",
        "representation": found.representation,
        "frame": found.frame,
        "center": found.center,
        **_contents(found),
        "brdf": known.brdf,
        "probe": known.probe,
        "probe_sha256": known.probe_sha256,
        "chromaticities": known.chromaticities,
    }


def _contents(found: EngineMap) -> dict[str, Any]:
    """What a map holds that others do not."""
    from shrm_cli.maps.irradiance.irradiance import POLYNOMIAL_ORDER, Irradiance
    from shrm_cli.maps.she.exponential import SphericalHarmonicExponential
    from shrm_cli.maps.splitsum.split_sum import SplitSum

    if isinstance(found, Irradiance):
        window = found.window
        has_matrices = found.order_f <= POLYNOMIAL_ORDER
        return {
            "size": found.size,
            "sampling": found.sampling,
            "order_f": found.order_f,
            "coefficients": len(found.coefficients),
            "window": {
                "name": window.name,
                "width": window.width,
                "factors": list(window.factors) or [1.0] * (found.order_f + 1),
                "energy_lost": window.energy_lost,
                "change": window.change,
            },
            "minimum_irradiance": found.minimum(),
            "lighting_coefficients": found.coefficients.tolist(),
            "irradiance_matrices": found.matrices().tolist() if has_matrices else None,
            "predicted_error": found.info.predicted_error,
            "added_error": found.info.added_error,
        }
    if isinstance(found, SplitSum):
        return {
            "size": found.size,
            "sampling": found.sampling,
            "mapping": found.mapping,
            "levels": [
                {
                    "roughness": roughness,
                    "size": level.shape[1],
                    "order_f": known.order_f,
                    "domain": known.domain if roughness > 0 else "probe",
                    "predicted_error": known.predicted_error,
                }
                for roughness, level, known in zip(
                    found.roughness, found.levels, found.level_info, strict=True
                )
            ],
            "predicted_error": found.info.predicted_error,
        }
    if not isinstance(found, SphericalHarmonicExponential):
        return {}
    return {
        "p_order": found.order_p,
        "q_order": found.order_q,
        "coefficients": len(found.p_coefficients) + len(found.q_coefficients),
        "roughness": [alpha**0.5 for alpha in found.ggx_alpha],
        "ggx_alpha": list(found.ggx_alpha),
        "law": found.law,
        "p_coefficients": found.p_coefficients.tolist(),
        "q_coefficients": found.q_coefficients.tolist(),
        "fit_residual": found.info.fit_residual,
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
    first = probe.images[0]
    values = {
        "kind": "probe",
        "layout": probe.layout,
        "width": first.width,
        "height": first.height,
        "sampling": probe.sampling,
        "orientation": probe.orientation,
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
        return ", ".join(f"{key} {_text(item)}" for key, item in value.items())
    return str(value)
