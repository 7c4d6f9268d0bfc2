"""`shrm brdf` lists the BRDFs, explains one of them, or converts it to a file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import shrm_cli as shrm
from shrm_cli.cli import options, usage
from shrm_cli.cli.terminal import conclude, progress_bar, tell, warn
from shrm_cli.cli.types import FRACTION, PATH, Spec, option, whole
from shrm_cli.maps.options import bytes_text

if TYPE_CHECKING:
    from shrm_cli.orders import Orders

_REFUSED = "`--to principal` and `shrm product` hold it, other forms refuse it"
_TOLERANCES = (0.1, 0.03, 0.01)
_SUFFIXES = (".exr", ".npz", ".binary")
_MOST_P = 5
"""The largest P whose energy is told."""
_GROUPS = {
    "normal": "Diffuse, about the normal",
    "reflection": "Glossy, about the mirror direction",
    "tangent": "Fibres, about the tangent",
}


@click.command()
@click.argument("spec", metavar="[SPEC|FILE]", type=Spec(), required=False)
@option(
    "--eps tolerances X", FRACTION, multiple=True,
    help="Tolerance to print the orders for; may be given several times.  [default: 0.1 0.03 0.01]",
)  # fmt: skip
@option("--save target FILE", PATH, "Write it as a table instead: .exr, .npz, or MERL's .binary.")
@option(
    "--walk paths N", whole(2, 1024),
    help="Compare coated:base=(...) with random walks between coat and base instead: N paths for "
    "each of 512 lights.",
)  # fmt: skip
@options.report_options
def brdf(
    spec: str | None, tolerances: tuple[float, ...], target: str | None, paths: int | None
) -> None:
    """List the BRDFs, or explain one: a name with parameters, or a measured file.

    \b
      shrm brdf ggx:roughness=0.3
      shrm brdf paint.bsdf --save paint.exr
      shrm brdf "coated:roughness=0.4,base=(lambertian)" --walk 256
    """
    usage.exclude("target", "paths")
    if spec is None:
        if target is not None:
            raise click.UsageError("--save needs a BRDF to write; name one before it")
        if paths is not None:
            raise click.UsageError("--walk needs a coated BRDF; name one before it")
        _list()
        return
    from shrm_cli.progress import Rising, using

    if target is not None:
        _save(spec, target)
        return
    if paths is not None:
        _walk(spec, paths)
        return
    remarks: list[str] = []
    with progress_bar("expanding") as progress:
        chosen = shrm.parse_spec(spec)
        asked = (tolerances or _TOLERANCES) if chosen.isotropic else ()
        with using(Rising(progress)):
            rows, captured = _orders(chosen, asked, remarks) if asked else ([], [])
        report = _explain(chosen, rows, captured)
    conclude(report, _text(chosen, report), remarks)


def _list() -> None:
    from shrm_cli.brdf.library import all_models
    from shrm_cli.brdf.measured import formats

    models, problems = all_models()
    groups = {center: [each for each in models if each.center == center] for center in _GROUPS}
    lines = []
    for center, title in _GROUPS.items():
        lines.append(f"{title}:")
        for model in groups[center]:
            lines.append(f"  {model.name:<18} {model.summary}")
            lines += [f"  {'':<18}   {line}" for line in _parameter_lines(model)]
            lines += [f"  {'':<18}   {line}" for line in _anisotropy(model)]
    lines.append("Measured, by the path of a file:")
    lines += [f"  {kind.name:<18} {kind.reads}" for kind in formats()]
    lines += ["Materials, as openpbr:", "  material.mtlx#name or asset.glb#name"]
    tell([_describe(model) for group in groups.values() for model in group], lines)
    warn(problems)


def _save(spec: str, target: str) -> None:
    """Write a BRDF as a table, read it back, and print how far the table is from the BRDF."""
    from shrm_cli.brdf.examine import difference
    from shrm_cli.brdf.measured import open_measured

    suffix = Path(target).suffix.lower()
    if suffix not in _SUFFIXES:
        raise click.BadParameter(
            f"{target!r} does not end with {', '.join(_SUFFIXES)}", param_hint="'--save'"
        )
    usage.check_outputs([target], specs=[spec])
    chosen = shrm.parse_spec(spec)
    if suffix == ".binary":
        from shrm_cli.brdf.measured.merl import write_merl

        write_merl(target, chosen)
    else:
        from shrm_cli.brdf.measured.table import sample_table, write_table

        write_table(target, sample_table(chosen))
    written = open_measured(target)
    size, error = Path(target).stat().st_size, difference(chosen, written)
    lines = [
        f"{target}: {written.summary}, {bytes_text(size)}",
        f"  RMS error      {error:.2%} of {chosen!r}, up to 80 degrees from the normal",
    ]
    tell({"file": target, "format": written.name, "bytes": size, "rms_difference": error}, lines)


def _walk(spec: str, paths: int) -> None:
    """Print how far a coated BRDF is from a random walk."""
    from shrm_cli.brdf.layered.parts.walk import VIEWS, compared
    from shrm_cli.maps.info import record_of

    chosen = shrm.parse_spec(spec)
    found = compared(chosen, paths)
    rows = [f"  {'degrees':<12} {' '.join(f'{view:>6}' for view in VIEWS)}  from the normal"]
    for name, values in (("albedo", found.albedo), ("walk", found.walked), ("noise", found.noise)):
        rows += [
            _row(f"{name} {each}", column) for each, column in zip("RGB", values.T, strict=True)
        ]
    rows += [_row("differ", found.difference), _row("noise", found.difference_noise)]
    lines = [f"{chosen!r}: what its base adds, by {paths} paths for each of 512 lights", *rows]
    known = {name: getattr(found, name).tolist() for name in found.__dataclass_fields__}
    tell({"brdf": record_of(chosen), "paths": paths, "theta": list(VIEWS), **known}, lines)


def _row(name: str, values: Any) -> str:
    return f"  {name:<12} {' '.join(f'{each:6.4f}' for each in values)}"


def _describe(model: Any) -> dict[str, Any]:
    from dataclasses import asdict

    said = ("name", "summary", "source", "center", "isotropic")
    parameters = [asdict(parameter) for parameter in model.parameters]
    return {**{name: getattr(model, name) for name in said}, "parameters": parameters}


def _parameter_lines(model: Any) -> list[str]:
    return [
        f"{p.name}  {p.domain}, default {p.default_text}: {p.meaning}" for p in model.parameters
    ]


def _anisotropy(model: Any) -> list[str]:
    """Return lines about where a BRDF is anisotropic, which most representations refuse."""
    if not model.isotropic:
        return [f"anisotropic: {_REFUSED}"]
    pairs = [f"{p.follows} and {p.name}" for p in model.parameters if p.follows]
    return [f"anisotropic where {pair} differ: {_REFUSED}" for pair in pairs]


def _orders(
    chosen: shrm.Brdf, tolerances: Sequence[float], remarks: list[str]
) -> tuple[list[dict[str, Any]], list[float]]:
    """Find the orders that tolerances ask for, with one search, for the smallest of them.

    What is to be said of them joins `remarks`.

    Returns the orders for each tolerance, or why there are none, and the energy that P = 0 .. 5
    capture within the order F of the last tolerance that can be met; empty if none can.
    """
    from shrm_cli.orders import known_coefficients, sufficient_orders

    try:
        coefficients = known_coefficients(chosen, min(tolerances))
    except shrm.BrdfError as error:
        return [{"epsilon": eps, "error": str(error)} for eps in tolerances], []
    if coefficients.remark is not None:
        remarks.append(f"{chosen!r} is {coefficients.remark}")
    rows: list[dict[str, Any]] = []
    captured: list[float] = []
    for eps in tolerances:
        try:
            orders = sufficient_orders(chosen, coefficients, eps)
        except shrm.OrderError as error:
            rows.append({"epsilon": eps, "error": str(error)})
            continue
        rows.append(order_values(orders))
        captured = coefficients.captured[orders.order_f, : _MOST_P + 1].tolist()
        captured += captured[-1:] * (_MOST_P + 1 - len(captured))
    return rows, captured


def _explain(
    chosen: shrm.Brdf, rows: list[dict[str, Any]], captured: list[float]
) -> dict[str, Any]:
    from shrm_cli.brdf.examine import ANGLES

    found = shrm.examine(chosen)
    report = {
        **_describe(chosen),
        "values": chosen.values,
        "orders": rows,
        "examination": {
            "smallest": found.smallest.tolist(),
            "largest": found.largest.tolist(),
            "albedo": [
                {"theta": theta, "rgb": rgb.tolist()}
                for theta, rgb in zip(ANGLES, found.albedo, strict=True)
            ],
            "furnace_albedo": found.furnace_albedo,
            "furnace_theta": found.furnace_angle,
            "gains_energy": found.gains_energy,
            "reciprocity_error": found.reciprocity_error,
        },
    }
    met = [row for row in rows if "error" not in row]
    if met:
        f = met[-1]["order_f"]
        report["captured_by_view_order"] = {"order_f": f, "captured": captured}
    return report


def _text(chosen: shrm.Brdf, report: dict[str, Any]) -> list[str]:
    lines = [f"{chosen!r}: {chosen.summary}"]
    lines += [f"  source      {chosen.source}", f"  centre      {chosen.center}"]
    lines += [f"  parameter   {line}" for line in _parameter_lines(chosen)]
    lines += _examination_lines(chosen, report["examination"])
    lines += [f"  {order_text(row)}".replace(f"{chosen!r}: ", "") for row in report["orders"]]
    if not chosen.isotropic:
        lines.append(f"  anisotropic: {_REFUSED}")
    if "captured_by_view_order" in report:
        held = report["captured_by_view_order"]
        numbers = " ".join(f"{captured:.2%}" for captured in held["captured"])
        lines.append(
            f"  P = 0 .. {len(held['captured']) - 1}  {numbers} within F = {held['order_f']}"
        )
    return lines


def _examination_lines(chosen: shrm.Brdf, found: dict[str, Any]) -> list[str]:
    fibre = chosen.center == "tangent"
    axis = "tangent" if fibre else "normal"
    low, high = min(found["smallest"]), max(found["largest"])
    what = "of rho_hat" if fibre else "1/sr, up to 80 degrees from the normal"
    lines = [f"  values      {low:.4g} .. {high:.4g} {what}"]
    angles = " ".join(f"{row['theta']:>6}" for row in found["albedo"])
    lines.append(f"  albedo      {angles}  degrees from the {axis}")
    channels = list(zip(*(row["rgb"] for row in found["albedo"]), strict=True))
    grey = len(set(channels)) == 1
    for name, channel in [("", channels[0])] if grey else zip("RGB", channels, strict=True):
        lines.append(f"  {name:>10}  {' '.join(f'{albedo:>6.4f}' for albedo in channel)}")
    verdict = "it gains energy" if found["gains_energy"] else "it gains no energy"
    lines.append(
        f"  furnace     {found['furnace_albedo']:.4f} at most, at {found['furnace_theta']:g} "
        f"degrees: {verdict}"
    )
    error = found["reciprocity_error"]
    lines.append(f"  reciprocity {error:.2%} RMS error" if error > 1e-6 else "  reciprocity exact")
    return lines


def order_values(orders: Orders) -> dict[str, Any]:
    """Return the orders that a tolerance asks for, as JSON has them."""
    return {
        "epsilon": orders.eps,
        "order_f": orders.order_f,
        "order_p": orders.order_p,
        "brdf_energy_captured": orders.captured,
    }


def order_text(row: dict[str, Any]) -> str:
    """Return `order_values` as text, or why there are no orders."""
    if "error" in row:
        return f"eps {row['epsilon']:<7g} {row['error']}"
    return (
        f"eps {row['epsilon']:<7g} F = {row['order_f']}, P = {row['order_p']} "
        f"({row['brdf_energy_captured']:.2%} of the energy)"
    )
