"""The part of `shrm analyze` that sets several BRDFs beside each other."""

from __future__ import annotations

from typing import Any

import click

from shrm_cli.cli.options import print_json, progress_bar, warn

_NO_CHARTS = "matplotlib is not installed, so no chart is drawn; pip install 'shrm[plots]'"


def analyze_materials(
    specs: list[str],
    order_f: int | None,
    order_p: int | None,
    output: str | None,
    no_plots: bool,
    as_json: bool,
    quiet: bool,
) -> None:
    """Energy of each BRDF that F = 30 and P = 0 .. 5 capture, as table and chart (figure 5.7)."""
    from shrm_cli.analysis.materials import ORDER_F, ORDER_P, material_energies
    from shrm_cli.analysis.plots import can_plot, plot_materials
    from shrm_cli.brdf.spec import parse_spec
    from shrm_cli.files.whole import check_target

    target = None
    if can_plot() and not no_plots:
        target = f"{output or 'materials'}.energy.png"
        check_target(target)
    brdfs = [parse_spec(spec) for spec in specs]
    f, p = ORDER_F if order_f is None else order_f, ORDER_P if order_p is None else order_p
    with progress_bar("integrating", quiet) as progress:
        found = material_energies(brdfs, specs, f, p, progress)
    if target is not None:
        plot_materials(target, found.names, found.captured, f)
    result: dict[str, Any] = {
        "order_f": f,
        "order_p": p,
        "materials": [
            {"brdf": name, "brdf_energy_captured": row.tolist()}
            for name, row in zip(found.names, found.captured, strict=True)
        ],
        "files": [] if target is None else [target],
    }
    warnings = [_NO_CHARTS] if target is None and not no_plots else []
    if as_json:
        print_json({**result, "warnings": warnings})
    elif not quiet:
        width = max(len(name) for name in found.names)
        click.echo(f"energy captured at F = {f}")
        click.echo(f"  {'':<{width}}" + "".join(f"  P = {q:<3}" for q in range(p + 1)))
        for name, row in zip(found.names, found.captured, strict=True):
            click.echo(f"  {name:<{width}}" + "".join(f"{part:>9.2%}" for part in row))
        for file in result["files"]:
            click.echo(f"wrote {file}")
    warn(warnings, quiet)
