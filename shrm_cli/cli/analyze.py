"""`shrm analyze` shows what orders capture of a BRDF, in numbers, charts and pictures."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import shrm_cli as shrm
from shrm_cli.cli import options, usage
from shrm_cli.cli.brdf import order_text, order_values
from shrm_cli.cli.terminal import conclude, progress_bar
from shrm_cli.cli.types import DIRECTION, FRACTION, PATH, Spec, flag, option, whole
from shrm_cli.extras import install
from shrm_cli.naming import brdf_label, probe_stem
from shrm_cli.vocabulary import DEFAULT_EPS, MAX_ORDER_F, MAX_ORDER_P, MAX_SOURCE_HEIGHT

if TYPE_CHECKING:
    from shrm_cli.analysis.analyze import AccuracyCurve, Analysis, OrderPictures

_TOLERANCES = (0.1, DEFAULT_EPS, 0.01)
_VIEWS = ("0,0", "90,30")
_CURVES = ("accuracy", "estimate_minimum", "estimate_brdf", "estimate_bound")
_NO_CHARTS = f"matplotlib is not installed, so no charts are drawn; {install('plots')}"
_OF_MATERIALS = {
    "spec", "order_f", "order_p", "output", "no_plots", "as_json", "quiet", "threads", "no_cache",
}  # fmt: skip
"""Arguments that also apply where several BRDFs are compared."""


@click.command()
@click.argument("others", metavar="[SPEC...]", nargs=-1, type=Spec())
@options.brdf_option
@options.lit_by("Light probe, for the accuracy of the reflected light and pictures of it.")
@option(
    "--eps tolerances X", FRACTION, multiple=True, default=_TOLERANCES,
    help="Tolerance to find the orders for; may be given several times.",
)  # fmt: skip
@option(
    "--order-f", whole(0, MAX_ORDER_F),
    help="Largest F, also that of the pictures.  [default: 32, or what the tolerances need; of the "
    "pictures at most 128]",
)  # fmt: skip
@option(
    "--order-p", whole(0, MAX_ORDER_P),
    help="Largest P of the energies, and P of the accuracies.  [default: 8, or what the "
    "tolerances need; of the accuracies what the least tolerance needs]",
)  # fmt: skip
@option(
    "--view views", DIRECTION, multiple=True, default=_VIEWS,
    help="Direction to the viewer of the pictures, degrees: azimuth from +Z towards +X, "
    "elevation. May be given several times.",
)  # fmt: skip
@option("--size", whole(16, 2048), "Width and height of a sphere's picture, pixels.", default=96)
@option(
    "--source-height ROWS", whole(2, MAX_SOURCE_HEIGHT),
    help="Rows that the probe is averaged down to for the exact pictures: few are faster, but "
    "move small lights, at 128 rows by about 1 % of error.",
)  # fmt: skip
@options.stops("Stops: the pictures are multiplied by 2^EV.  [default: highlights come out white]")
@option(
    "-o --output PREFIX", PATH,
    help="Write PREFIX.energy.png, PREFIX.accuracy.png and PREFIX.pictures.png, or PROBE.BRDF."
    "*.png into a folder of that name.  [default: PROBE.BRDF in the current folder]",
)  # fmt: skip
@flag("--no-plots", "Numbers only: draw and write nothing.")
@options.probe_options
@options.report_options
def analyze(
    others: tuple[str, ...],
    spec: str,
    probe: str | None,
    views: tuple[tuple[float, float], ...],
    exposure: float | None,
    output: str | None,
    no_plots: bool,
    **values: Any,
) -> None:
    """Analyse what the orders F and P capture of a BRDF.

    Without a probe: the part of the BRDF's energy that all orders capture, and the orders that
    tolerances need. With one: also the accuracy of the reflected light against F, with its
    estimates, and spheres for P = 0 .. 5 beside exact ones. --json prints every number.

    \b
      shrm analyze --brdf microfacet:sigma=0.1 --eps 0.05
      shrm analyze --brdf phong:exponent=32 --probe probe.exr

    With more than one BRDF: the energy that F = 30 and P = 0 .. 5 capture of each.

    \b
      shrm analyze --brdf ggx:roughness=0.5 oren-nayar krylon_blue.brdf
    """
    if others:
        of_one = [name for name in usage.given_options() if name not in _OF_MATERIALS]
        usage.refuse_inapplicable(dict.fromkeys(of_one, (False, "to a single BRDF")))
        _analyze_materials([spec, *others], values["order_f"], values["order_p"], output, no_plots)
        return
    from shrm_cli.analysis.plots import can_plot
    from shrm_cli.maps.info import record_of

    of_probe = [*options.READING_NAMES, "views", "size", "source_height", "exposure"]
    rules = dict.fromkeys(of_probe, (probe is not None, "with --probe"))
    usage.refuse_inapplicable(rules)
    usage.exclude("output", "no_plots")
    reading = options.make_read_options(values)
    source = None if probe is None else shrm.open_probe(probe, reading)
    kinds = {"energy": can_plot(), "accuracy": can_plot() and source, "pictures": source}
    prefix = _prefix(output, probe, brdf_label(spec))
    targets = {k: f"{prefix}.{k}.png" for k, made in kinds.items() if made and not no_plots}
    usage.check_outputs(targets.values(), specs=[spec], draws=True)
    with progress_bar("analysing") as progress:
        found = shrm.analyze(
            spec, source, views=() if no_plots else views, progress=progress, **values
        )
    grid, title = found.grid, repr(found.brdf)
    if found.pictures is not None and exposure is None:
        exposure = found.pictures.exposure()
    _draw(found, targets, exposure or 0.0, f"{title} in {Path(probe or '').name}")
    warnings = [] if source is None else source.warnings()
    warnings += _remarks(found, values["order_p"])
    if not no_plots and not can_plot():
        warnings.append(_NO_CHARTS)
    height = found.source_height
    drawing = {"size": values["size"], "source_height": height, "exposure": exposure}
    result = {
        "brdf": record_of(found.brdf),
        "probe": probe,
        "order_f": grid.order_f,
        "order_p": grid.order_p,
        "orders": [order_values(each) for each in grid.orders],
        "brdf_energy_captured": grid.captured.tolist(),
        "accuracy": None if found.curve is None else _curve(found.curve),
        "pictures": found.pictures and {**drawing, **_pictures(found.pictures, views)},
        "files": list(targets.values()),
    }
    conclude(result, [title, *_report(result)], warnings)


def _remarks(found: Analysis, order_p: int | None) -> list[str]:
    """Return what is to be said of the BRDF, a line each."""
    remarks = []
    if found.grid.coefficients.remark is not None:
        remarks.append(f"{found.brdf!r} is {found.grid.coefficients.remark}")
    if found.grid.unmet is not None:
        remarks.append(found.grid.unmet)
    if order_p is not None and order_p > found.grid.order_p:
        remarks.append(f"{found.brdf!r}: does not depend on the view, so P = 0 only")
    return remarks


def _draw(found: Analysis, targets: dict[str, str], exposure: float, title: str) -> None:
    """Write the charts and the pictures that have a name."""
    from shrm_cli.analysis.plots import plot_accuracy, plot_energy
    from shrm_cli.files.image import write_picture

    if "energy" in targets:
        marks = [(each.order_f, each.order_p, each.eps) for each in found.grid.orders]
        plot_energy(targets["energy"], found.grid.captured, marks, repr(found.brdf))
    if "accuracy" in targets and found.curve is not None:
        curves = {name: getattr(found.curve, name) for name in _CURVES}
        plot_accuracy(targets["accuracy"], curves, found.curve.order_p, title)
    if "pictures" in targets and found.pictures is not None:
        write_picture(targets["pictures"], found.pictures.sheet(exposure))


def _analyze_materials(
    specs: list[str], order_f: int | None, order_p: int | None, output: str | None, no_plots: bool
) -> None:
    """Print and draw the energy of each BRDF that F and P capture, by default as in figure 5.7."""
    from shrm_cli.analysis.analyze import MATERIAL_F, MATERIAL_P, material_energies
    from shrm_cli.analysis.plots import can_plot, plot_materials

    target = None
    if can_plot() and not no_plots:
        target = f"{_stem(output or 'materials')}.energy.png"
        usage.check_outputs([target], specs=specs, draws=True)
    brdfs = [shrm.parse_spec(spec) for spec in specs]
    f, p = MATERIAL_F if order_f is None else order_f, MATERIAL_P if order_p is None else order_p
    with progress_bar("integrating") as progress:
        captured = material_energies(brdfs, f, p, progress)
    if target is not None:
        plot_materials(target, specs, captured, f)
    result: dict[str, Any] = {
        "order_f": f,
        "order_p": p,
        "materials": [
            {"brdf": name, "brdf_energy_captured": row.tolist()}
            for name, row in zip(specs, captured, strict=True)
        ],
        "files": [] if target is None else [target],
    }
    warnings = [_NO_CHARTS] if target is None and not no_plots else []
    width = max(len(name) for name in specs)
    lines = [f"energy captured at F = {f}"]
    lines.append(f"  {'':<{width}}" + "".join(f"  P = {q:<3}" for q in range(p + 1)))
    for name, row in zip(specs, captured, strict=True):
        lines.append(f"  {name:<{width}}" + "".join(f"{part:>9.2%}" for part in row))
    lines += [f"wrote {file}" for file in result["files"]]
    conclude(result, lines, warnings)


def _prefix(output: str | None, probe: str | None, label: str) -> str:
    """Return what the names of all outputs begin with."""
    name = label if probe is None else f"{probe_stem(probe)}.{label}"
    if output is None:
        return name
    return str(Path(output, name)) if Path(output).is_dir() else _stem(output)


def _stem(output: str) -> str:
    """Return what the names of pictures begin with, of whoever names a picture."""
    return output[:-4] if output.lower().endswith(".png") else output


def _curve(curve: AccuracyCurve) -> dict[str, Any]:
    values = {each.name: getattr(curve, each.name) for each in fields(curve)}
    return {
        name: value if isinstance(value, int) else value.tolist() for name, value in values.items()
    }


def _pictures(pictures: OrderPictures, views: Sequence[tuple[float, float]]) -> dict[str, Any]:
    def errors(p: int) -> list[float | None]:
        found = [pictures.error(p, view) for view in range(len(views))]
        return [None if math.isinf(each) else each for each in found]  # JSON has no infinity

    parts = zip(pictures.captured.tolist(), pictures.predicted_errors.tolist(), strict=True)
    return {
        "order_f": pictures.order_f,
        "views": [list(view) for view in views],
        "orders": [
            {
                "order_p": p,
                "brdf_energy_captured": captured,
                "predicted_error": predicted,
                "errors": errors(p),
            }
            for p, (captured, predicted) in enumerate(parts)
        ],
    }


def _report(result: dict[str, Any]) -> list[str]:
    lines = [f"  {order_text(row)}" for row in result["orders"]]
    if (curve := result["accuracy"]) is not None:
        lines += [f"{result['probe']}, P = {curve['order_p']}: accuracy of the reflected light"]
        lines += ["    F  accuracy   minimum      BRDF     bound"]
        chosen = {row["order_f"] for row in result["orders"]} | {result["order_f"]}
        if result["pictures"] is not None:
            chosen.add(result["pictures"]["order_f"])
        for f in sorted(each for each in chosen if each <= result["order_f"]):
            lines.append(f"{f:5d}" + "".join(f"{curve[name][f]:10.2%}" for name in _CURVES))
    if (pictures := result["pictures"]) is not None:
        lines += [f"pictures, F = {pictures['order_f']}: relative RMS error"]
        views = "".join(f"{'{:g},{:g}'.format(*view):>10}" for view in pictures["views"])
        lines += [f"    P    energy predicted{views}"]
        for row in pictures["orders"]:
            errors = ["inf" if each is None else f"{each:.2%}" for each in row["errors"]]
            lines.append(
                f"{row['order_p']:5d}{row['brdf_energy_captured']:10.2%}"
                f"{row['predicted_error']:10.2%}" + "".join(f"{each:>10}" for each in errors)
            )
    return lines + [f"wrote {path}" for path in result["files"]]
