"""The part of `shrm analyze` that compares several BRDFs."""

from __future__ import annotations

from typing import Any

from shrm_cli.cli.bar import progress_bar
from shrm_cli.cli.options import conclude
from shrm_cli.cli.outputs import check_outputs
from shrm_cli.extras import install

_NO_CHARTS = f"matplotlib is not installed, so no chart is drawn; {install('plots')}"


def analyze_materials(
    specs: list[str],
    order_f: int | None,
    order_p: int | None,
    output: str | None,
    no_plots: bool,
    as_json: bool,
    quiet: bool,
) -> None:
    """Print and draw the energy of each BRDF that F and P capture, by default as in figure 5.7.

    The figure is that of Ramamoorthi's thesis, with F = 30 and P = 0 .. 5.
    """
    from shrm_cli.analysis.materials import ORDER_F, ORDER_P, material_energies
    from shrm_cli.analysis.plots import can_plot, plot_materials
    from shrm_cli.brdf.spec import parse_spec

    target = None
    if can_plot() and not no_plots:
        target = f"{output or 'materials'}.energy.png"
        check_outputs([target], specs=specs)
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
    width = max(len(name) for name in found.names)
    lines = [f"energy captured at F = {f}"]
    lines.append(f"  {'':<{width}}" + "".join(f"  P = {q:<3}" for q in range(p + 1)))
    for name, row in zip(found.names, found.captured, strict=True):
        lines.append(f"  {name:<{width}}" + "".join(f"{part:>9.2%}" for part in row))
    lines += [f"wrote {file}" for file in result["files"]]
    conclude(result, lines, warnings, as_json, quiet)
