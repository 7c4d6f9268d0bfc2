"""`shrm info` prints what a file is."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from shrm_cli.cli.options import (
    conclude,
    make_read_options,
    probe_options,
    reading_rules,
    report_options,
)
from shrm_cli.cli.usage import refuse_inapplicable, wants_json

if TYPE_CHECKING:
    from shrm_cli.probe.proxy import ProxyBox

_MOST_ROWS, _MOST_NUMBERS = 9, 16
"""The most rows of a table and numbers of a list that are printed as text; JSON has them all."""

_RADIANCES = "minimum", "maximum", "mean", "mean_luminance"


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
    from shrm_cli.brdf.environment.file import read_table_facts
    from shrm_cli.brdf.measured.reading.table_file import is_table
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
        worded = _in_words(values) if stats and not wants_json() else {}
        warnings = [f"{file}: {line}" for line in found]
    refuse_inapplicable(reading_rules(not what, f"to probes; FILE {what}"))
    width = max(len(key) for key in values)
    lines = [file]
    for key, value in (values | worded).items():
        text = _text(value).replace("\n", "\n" + " " * (width + 4))
        lines.append(f"  {key.replace('_', ' '):<{width}}  {text}")
    conclude({"file": file, **values}, lines, warnings)


_KINDS = {"light file": "light file", "coefficients": "coefficients of light"}
"""What probes that are no images are called."""


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
        **_of_box(found.info.proxy),
    }


def _of_box(proxy: ProxyBox | None) -> dict[str, Any]:
    return {} if proxy is None else {"proxy": proxy.record()}


def _describe_probe(file: str, options: Any, stats: bool) -> tuple[dict[str, Any], list[str]]:
    """Return the facts of a probe, and warnings."""
    from shrm_cli.probe.probe import open_probe

    probe = open_probe(file, options)
    first = probe.images[0]
    values = {
        "kind": _KINDS.get(first.file_format, "probe"),
        "layout": probe.layout,
        "width": first.width,
        "height": first.height,
        "sampling": probe.sampling,
        "orientation": probe.orientation,
        "format": first.file_format,
        **first.facts(),
    }
    if stats:
        from shrm_cli.analysis.probe_statistics import probe_statistics

        values |= probe_statistics(probe).summary()
    values |= {"chromaticities": probe.chromaticities, "sha256": probe.digest()}
    values |= _of_box(probe.proxy)
    kept = {key: value for key, value in values.items() if value is not None}
    return kept, probe.report.warnings() if stats else list(probe.report.notes)


def _in_words(values: dict[str, Any]) -> dict[str, str]:
    """Return what the statistics of a probe say to people, with units."""
    stops, white = values["stops"], values["white_balance"]
    azimuth, elevation = values["light_from"]["azimuth_elevation"]
    names = {"over_green": "R, G, B over green", "xy": "xy", "kelvin": "kelvin", "duv": "duv"}
    balance = [f"{before} {_text(white[name])}" for name, before in names.items()]
    return {
        **{key: f"{_text(values[key])} of radiance" for key in _RADIANCES},
        "stops": f"{stops['1%_to_99.9%']:.3g} between what 1 % and 99.9 % of the sphere are below, "
        f"{stops['least_to_most']:.3g} in all",
        "irradiance": f"{_text(values['irradiance'])}\nradiance x sr, by the axis of the normal",
        "white_balance": "; ".join(balance),
        "light_from": f"azimuth {azimuth:.1f}, elevation {elevation:.1f} degrees, directionality "
        f"{values['light_from']['directionality']:.2f} (0 from everywhere, 1 from one point)",
        "lamps": "\n".join(map(_lamp_line, values["lamps"])) or "none",
        "advice": values["advice"] or "none",
    }


def _lamp_line(lamp: dict[str, Any]) -> str:
    size = f"radius {lamp['radius']:.3g}"
    if lamp["is_elongated"]:
        size = f"{lamp['length']:.3g} x {lamp['width']:.3g}"
    return (
        f"azimuth {lamp['azimuth']:.1f}, elevation {lamp['elevation']:.1f}, {size} degrees, "
        f"{lamp['share']:.1%} of the light, irradiance {_text(lamp['irradiance'])}"
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
    if isinstance(value, dict) and all(isinstance(item, list) for item in value.values()):
        return "\n".join(f"{key}  {_text(item)}" for key, item in value.items())
    if isinstance(value, dict):
        return ", ".join(f"{key.replace('_', ' ')} {_text(item)}" for key, item in value.items())
    return str(value)
