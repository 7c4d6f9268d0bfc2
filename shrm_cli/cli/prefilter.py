"""`shrm prefilter`: from a probe and a BRDF to a map."""

import os
from typing import Any

import click

from shrm_cli.cli.engines import ENGINE_OPTIONS, OWN_BRDF, engine_options, prefilter_for_engines
from shrm_cli.cli.options import (
    ALL_REPRESENTATIONS,
    ENGINE_REPRESENTATIONS,
    REPRESENTATIONS,
    compression,
    make_read_options,
    optional_brdf_option,
    precision_option,
    print_json,
    probe_stem,
    progress_bar,
    read_options,
    refuse_foreign,
    report_options,
    view_count,
    view_options,
    warn,
)
from shrm_cli.cli.types import Fraction

_SAMPLINGS = click.Choice(["center", "border"])

# The representations that an option is for, where it is not for all.
_OWNERS: dict[str, tuple[str, ...]] = {
    **dict.fromkeys(("spec", "tolerance", "order_p", "center"), REPRESENTATIONS),
    **dict.fromkeys(("domain", "source_height", "frame"), REPRESENTATIONS),
    "order_f": (*REPRESENTATIONS, "irradiance"),
    "wanted": ("shrm",),
    "compress": ("shrm",),
    "slices": ("kautz-mccool",),
    "views": ("lightfield",),
    "size": (*REPRESENTATIONS, "irradiance", "splitsum"),
    "map_sampling": (*REPRESENTATIONS, "irradiance", "splitsum"),
    **ENGINE_OPTIONS,
}


@click.command()
@click.argument("probe", metavar="PROBE", type=click.Path())
@optional_brdf_option
@click.option(
    "--to", "representation", type=click.Choice(ALL_REPRESENTATIONS),
    default="shrm", show_default=True,
    help="Representation to write; irradiance, splitsum and she have their BRDF.",
)  # fmt: skip
@click.option(
    "--eps", "tolerance", type=Fraction(), metavar="X", default=0.03, show_default=True,
    help="Fraction of the BRDF's energy that may be missed; it chooses F and P.",
)  # fmt: skip
@click.option("--order-f", type=click.IntRange(0, 512), help="Order F to use instead.")
@click.option("--order-p", type=click.IntRange(0, 32), help="Order P to use instead.")
@click.option(
    "--center", type=click.Choice(["auto", "reflection", "normal", "tangent"]),
    help="Central direction of the map; auto takes the one with the fewest coefficients.  "
    "[default: the BRDF's own]",
)  # fmt: skip
@click.option(
    "--split/--no-split",
    "wanted",
    default=None,
    help="Prefilter diffuse and glossy terms each about its own centre.  [default: by count]",
)
@view_options
@engine_options
@click.option(
    "--domain", type=click.Choice(["frequency", "angular"]), default="frequency",
    show_default=True, help="Where to prefilter explicit maps; angular takes minutes.",
)  # fmt: skip
@click.option(
    "--source-height", type=click.IntRange(2, 8192), metavar="H",
    help="In the angular domain: average the probe down to 2H x H first.",
)  # fmt: skip
@click.option(
    "--frame", type=click.Choice(["global", "local"]), default="global", show_default=True,
    help="Axes of the view in the map: the world's, or each texel's own.",
)  # fmt: skip
@click.option(
    "--size", type=click.IntRange(4, 4096), help="Texels along a face's edge.  [default: from F]"
)
@precision_option
@click.option(
    "-o", "--output", type=click.Path(),
    help="File to write.  [default: PROBE.BRDF.TO.exr in the current folder]",
)  # fmt: skip
@click.option(
    "--sampling", type=_SAMPLINGS,
    help="Where edge pixels lie, in the probe and in the written cube.",
)  # fmt: skip
@click.option("--probe-sampling", type=_SAMPLINGS, help="The same, of the probe alone.")
@click.option("--map-sampling", type=_SAMPLINGS, help="The same, of the written cube alone.")
@read_options
@report_options
def prefilter(
    probe: str,
    spec: str | None,
    representation: str,
    tolerance: float,
    order_f: int | None,
    order_p: int | None,
    center: str | None,
    wanted: bool | None,
    slices: int | None,
    views: int | None,
    compress: tuple[int | None, float] | None,
    domain: str,
    source_height: int | None,
    frame: str,
    size: int | None,
    precision: str,
    output: str | None,
    sampling: str | None,
    probe_sampling: str | None,
    map_sampling: str | None,
    as_json: bool,
    quiet: bool,
    **reading: Any,
) -> None:
    """Prefilter the light probe PROBE for a BRDF.

    The orders F and P are the least that keep the BRDF's energy within --eps; the error that
    they make in the reflected light is predicted and printed. In the angular domain --eps is
    the part of the BRDF's lobe that may be left out.

    What engines use needs no --brdf: irradiance is of a white Lambertian surface, a split sum
    (splitsum) and an SH exponential (she) are of GGX.
    """
    refuse_foreign(representation, _OWNERS, {"spec": OWN_BRDF.get(representation, "")})
    of_engines = {name: reading.pop(name) for name in ENGINE_OPTIONS}
    read_as = make_read_options(probe_sampling or sampling, reading)
    map_sampling = map_sampling or sampling or "center"
    if representation in ENGINE_REPRESENTATIONS:
        prefilter_for_engines(
            probe, read_as, representation, output,
            {**of_engines, "order_f": order_f, "size": size, "sampling": map_sampling},
            precision, as_json, quiet,
        )  # fmt: skip
        return
    if spec is None:
        raise click.MissingParameter(
            f"--to {representation} needs one", param_hint="'--brdf'", param_type="option"
        )
    import numpy as np

    from shrm_cli.brdf.spec import file_label, named_files, parse_spec
    from shrm_cli.files.whole import check_target
    from shrm_cli.maps.shrm.prefilter import bake
    from shrm_cli.maps.shrm.terms import bake_terms, plan_terms
    from shrm_cli.maps.write import write_map
    from shrm_cli.probe.probe import open_probe

    _check_options(representation, domain, source_height, frame, (order_f, order_p))
    count, components = (
        view_count(representation, slices, views),
        compression(representation, compress),
    )
    brdf, notes = _centered(parse_spec(spec), tolerance, center)
    source = open_probe(probe, read_as)
    default = f"{probe_stem(probe)}.{file_label(spec)}.{representation}.exr"
    target = default if output is None else output
    inputs = [*source.paths, *named_files(spec)]
    check_target(target, inputs, (".exr",))
    common: dict[str, Any] = {
        "representation": representation,
        "view_count": count,
        "size": size,
        "sampling": map_sampling,
    }
    single = (representation, domain) != ("shrm", "frequency") or center is not None
    single = single or (order_f, order_p) != (None, None)
    if single and wanted:
        raise click.UsageError(
            "--split is for SHRMs with neither --center nor orders; leave one of them out"
        )
    plan = None
    if not single and wanted is not False:
        with progress_bar("reading", quiet) as progress:
            plan = plan_terms(brdf, tolerance, source, progress)
    if plan is not None:
        notes.append(
            f"  {'split' if wanted or plan.pays else 'not split':<15}"
            f"{plan.count:,} coefficients as terms, {plan.whole.count:,} as one map"
        )
        plan = plan if wanted or plan.pays else None
    with progress_bar("reading" if domain == "frequency" else "integrating", quiet) as progress:
        if domain == "angular":
            from shrm_cli.maps.explicit.angular import bake_angular

            made = bake_angular(
                source, brdf, tolerance, source_height=source_height, progress=progress, **common
            )
        elif plan is not None:
            made = bake_terms(
                source, plan, size, frame, common["sampling"],  # type: ignore[arg-type]
                np.float32, components,
            )  # fmt: skip
        else:
            made = bake(
                source, brdf, tolerance, order_f, order_p, frame=frame,  # type: ignore[arg-type]
                dtype=np.float32, compression=components, progress=progress, **common,
            )  # fmt: skip
    pixel_type = write_map(target, made.map, precision)
    warnings = [f"{probe}: {line}" for line in source.report.warnings()]
    if pixel_type == "float" and precision == "auto":
        warnings.append(f"{target}: written as 32-bit float, for values beyond half's range")
    if order_p is not None and order_p > made.orders.order_p:
        warnings.append(f"{target}: {brdf.name} does not depend on the view, so P = 0 only")
    if domain == "frequency" and plan is None and made.orders.captured < 1 - tolerance:
        warnings.append(
            f"{target}: the orders asked for capture {made.orders.captured:.2%} of the BRDF's "
            f"energy, less than --eps {tolerance:g} wants"
        )
    result = {"file": os.fspath(target), **made.summary(), "precision": pixel_type}
    if as_json:
        print_json({**result, "warnings": warnings})
    elif not quiet:
        click.echo("\n".join([_report(result), *notes]))
    warn(warnings, quiet)


def _centered(brdf: Any, tolerance: float, center: str | None) -> tuple[Any, list[str]]:
    """A BRDF about the centre that was asked for, and a line that tells how it was chosen."""
    from shrm_cli.orders import choose_center

    if center is None:
        return brdf, []
    if center != "auto":
        return brdf.recentered(center), []
    brdf, counts = choose_center(brdf, tolerance)
    needs = ", ".join(f"{count:,} about the {name}" for name, count in counts.items())
    return brdf, [f"  centre         {brdf.center} (coefficients: {needs})"]


def _check_options(
    representation: str,
    domain: str,
    source_height: int | None,
    frame: str,
    orders: tuple[int | None, int | None],
) -> None:
    if representation != "shrm" and frame == "local":
        raise click.BadParameter("is for --to shrm", param_hint="'--frame'")
    if domain == "angular":
        if representation == "shrm":
            raise click.BadParameter(
                "an SHRM is made in the frequency domain only; take --to cabral, kautz-mccool or "
                "lightfield",
                param_hint="'--domain'",
            )
        if orders != (None, None):
            raise click.UsageError("--order-f and --order-p are for --domain frequency")
    elif source_height is not None:
        raise click.BadParameter("is for --domain angular", param_hint="'--source-height'")


def _report(result: dict[str, Any]) -> str:
    size, maps, bound = result["size"], result["maps"], result["error_bound"]
    unit = "components" if result["added_error"] else "coefficients"
    what = (
        f"SHRM, 6 x {size} x {size} texels of {maps} {unit}"
        if result["representation"] == "shrm"
        else f"{result['representation']} map, {maps} cubes of 6 x {size} x {size} texels"
    )
    lines = [
        f"{result['file']}: {result['frame']} {what}, {result['precision']}",
        f"  orders         F = {result['order_f']}, P = {result['order_p']}",
        f"  BRDF energy    {result['brdf_energy_captured']:.2%} captured, "
        f"{1 - result['epsilon']:.2%} asked",
        f"  RMS error      {result['predicted_error']:.2%} of the reflected light predicted"
        + ("" if bound is None else f", {bound:.2%} at most"),
    ]
    if "+" in result["center"]:
        lines[2] = (
            f"  BRDF energy    {result['brdf_energy_captured']:.2%} captured by the terms, whose "
            "error together is that of one map"
        )
    if result["domain"] == "angular":
        lines[2] = f"  BRDF energy    {result['brdf_energy_captured']:.2%} in the truncated lobe"
    if result["added_error"] >= 5e-5:
        lines.append(f"  and            {result['added_error']:.2%} from {_added_by(result)}")
    return "\n".join(lines)


def _added_by(result: dict[str, Any]) -> str:
    return {
        "shrm": "leaving out principal components",
        "kautz-mccool": "leaving out the azimuth, and interpolation between slices",
    }.get(result["representation"], "interpolation between views")
