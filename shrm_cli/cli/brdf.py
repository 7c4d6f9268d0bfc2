"""`shrm brdf`: the list of BRDFs, and one explained."""

from typing import Any

import click

from shrm_cli.cli.options import print_json, report_options
from shrm_cli.cli.types import Fraction

_TOLERANCES = (0.1, 0.03, 0.01)


@click.command()
@click.argument("spec", required=False)
@click.option(
    "--eps", "tolerances", type=Fraction(), metavar="X", multiple=True,
    help="Tolerance to print the orders for; may be given several times.  [default: 0.1 0.03 0.01]",
)  # fmt: skip
@report_options
def brdf(spec: str | None, tolerances: tuple[float, ...], as_json: bool, quiet: bool) -> None:
    """List the BRDFs, or explain SPEC: a name, or a name with parameters."""
    from shrm_cli.brdf.spec import MODELS, parse_spec

    if spec is None:
        if as_json:
            print_json([_describe(model) for model in MODELS.values()])
        for model in [] if as_json or quiet else MODELS.values():
            click.echo(f"{model.name:<12} {model.summary}")
            for line in _parameter_lines(model):
                click.echo(f"{'':<12}   {line}")
        return
    chosen = parse_spec(spec)
    rows = [_orders(chosen, tolerance) for tolerance in tolerances or _TOLERANCES]
    if as_json:
        print_json({**_describe(type(chosen)), "values": chosen.values, "orders": rows})
    if as_json or quiet:
        return
    click.echo(f"{chosen!r}: {chosen.summary}")
    click.echo(f"  source      {chosen.source}")
    click.echo(f"  centre      {chosen.center}")
    for line in _parameter_lines(type(chosen)):
        click.echo(f"  parameter   {line}")
    for row in rows:
        click.echo(f"  {_row_text(row)}")


def _describe(model: Any) -> dict[str, Any]:
    from dataclasses import asdict

    return {
        "name": model.name,
        "summary": model.summary,
        "source": model.source,
        "center": model.center,
        "parameters": [asdict(parameter) for parameter in model.parameters],
    }


def _parameter_lines(model: Any) -> list[str]:
    return [
        f"{p.name}  {p.minimum:g} .. {p.maximum:g}, default {p.default:g}: {p.meaning}"
        for p in model.parameters
    ]


def _orders(chosen: Any, tolerance: float) -> dict[str, Any]:
    from shrm_cli.errors import OrderError
    from shrm_cli.orders import choose_orders

    try:
        orders, _ = choose_orders(chosen, tolerance)
    except OrderError as error:
        return {"epsilon": tolerance, "error": str(error)}
    return {
        "epsilon": tolerance,
        "order_f": orders.order_f,
        "order_p": orders.order_p,
        "brdf_energy_captured": orders.captured,
    }


def _row_text(row: dict[str, Any]) -> str:
    if "error" in row:
        return f"eps {row['epsilon']:<7g} {row['error']}"
    return (
        f"eps {row['epsilon']:<7g} F = {row['order_f']}, P = {row['order_p']} "
        f"({row['brdf_energy_captured']:.2%} of the energy)"
    )
