"""The part of `shrm prefilter` that makes what engines use, which needs no BRDF."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

import click

from shrm_cli.cli.options import (
    ALL_REPRESENTATIONS,
    print_json,
    probe_stem,
    progress_bar,
    refuse_options,
    warn,
)
from shrm_cli.cli.types import Interval, Levels

if TYPE_CHECKING:
    from shrm_cli.cli.options import Command
    from shrm_cli.maps.irradiance.irradiance import Irradiance
    from shrm_cli.maps.representations import Map
    from shrm_cli.probe.options import ReadOptions
    from shrm_cli.probe.probe import Probe

ENGINE_OPTIONS = {
    **dict.fromkeys(("window", "shader"), ("irradiance",)),
    **dict.fromkeys(("levels", "mapping"), ("splitsum",)),
    **dict.fromkeys(("p_order", "q_order", "roughness", "law"), ("she",)),
}
"""The representation that each option of `engine_options` is for."""

OWN_BRDF = {
    "irradiance": "irradiance is that of a white Lambertian surface",
    "splitsum": "a split sum is of GGX",
    "she": "an SH exponential is of GGX",
}
"""What takes the place of --brdf."""

_ORDERS = click.IntRange(0, 16)


def engine_options(command: Command) -> Command:
    """Options of irradiance, split sums and SH exponentials."""
    for option in reversed([
        click.option(
            "--window", metavar="NAME[:WIDTH]",
            help="irradiance: none, hann, lanczos, or auto, the factors that change it least "
            "and leave nothing negative.  [default: none]",
        ),
        click.option(
            "--shader", type=click.Choice(["glsl", "hlsl", "c"]),
            help="irradiance: print code that holds the numbers.",
        ),
        click.option(
            "--levels", type=Levels(), help="splitsum: how many, or the roughness of each.",
        ),
        click.option(
            "--mapping", type=click.Choice(["linear", "filament", "unreal"]),
            help="splitsum: how roughness rises with the level.  [default: linear]",
        ),
        click.option(
            "--p-order", type=_ORDERS, help="she: order of P, over R.  [default: 4]"
        ),
        click.option(
            "--q-order", type=_ORDERS, help="she: order of Q, over (R + N) / |R + N|.  [default: 2]"
        ),
        click.option(
            "--roughness", type=Interval(0.05, 1),
            help="she: perceptual roughness to fit it to.  [default: 0.45..1]",
        ),
        click.option(
            "--law", type=click.Choice(["lobe", "paper"]),
            help="she: attenuation after GGX's lobe, or as published.  [default: lobe]",
        ),
    ]):  # fmt: skip
        command = option(command)
    return command


def prefilter_for_engines(
    probe: str,
    reading: ReadOptions,
    representation: str,
    output: str | None,
    values: dict[str, Any],
    precision: str,
    as_json: bool,
    quiet: bool,
) -> None:
    """Prefilter a probe to one of `ENGINE_REPRESENTATIONS`, write the map, and report.

    Parameters
    ----------
    values : dict
        Of the options by name; None where an option was not given.
    """
    from shrm_cli.files.whole import check_target
    from shrm_cli.maps.write import write_map
    from shrm_cli.probe.probe import open_probe

    source = open_probe(probe, reading)
    target = f"{probe_stem(probe)}.{representation}.exr" if output is None else output
    check_target(target, source.paths, (".exr",))
    given = {name: value for name, value in values.items() if value is not None}
    language = given.pop("shader", None)
    with progress_bar("reading", quiet) as progress:
        made = _bake(source, representation, given, progress)
    snippet = None if language is None else _snippet(made.map, language)
    pixel_type = write_map(target, made.map, precision)
    result = {
        "file": os.fspath(target), **made.summary(), "bytes": os.path.getsize(target),
        "precision": pixel_type,
    }  # fmt: skip
    warnings = [f"{probe}: {line}" for line in source.report.warnings()]
    warnings += _warnings(result, precision)
    if as_json:
        shader = {} if snippet is None else {"shader": snippet}
        print_json({**result, **shader, "warnings": warnings})
    else:
        if snippet is not None:
            click.echo(snippet.rstrip("\n"))
        if not quiet:
            click.echo("\n".join(_report(result)), err=snippet is not None)
    warn(warnings, quiet)


def _snippet(irradiance: Irradiance, language: str) -> str:
    from shrm_cli.maps.irradiance.shader import irradiance_snippet

    return irradiance_snippet(irradiance, language)


def _bake(source: Probe, representation: str, given: dict[str, Any], progress: Any) -> Any:
    """The map with what is known of it; the options are the arguments of what bakes it."""
    if representation == "irradiance":
        from shrm_cli.maps.irradiance.prefilter import bake_irradiance

        return bake_irradiance(source, **given, progress=progress)
    if representation == "splitsum":
        from shrm_cli.maps.splitsum.prefilter import bake_split_sum

        return bake_split_sum(source, **given, progress=progress)
    from shrm_cli.maps.she.prefilter import bake_exponential

    # It has no cube, whose sampling another option could tell.
    named = {"p_order": "order_p", "q_order": "order_q", "roughness": "roughness", "law": "law"}
    arguments = {named[name]: value for name, value in given.items() if name in named}
    return bake_exponential(source, **arguments, progress=progress)


def _warnings(result: dict[str, Any], precision: str) -> list[str]:
    lines = []
    if result["precision"] == "float" and precision == "auto" and result["representation"] != "she":
        lines.append("written as 32-bit float, for values beyond half's range")
    least = result.get("minimum_irradiance", 0.0)
    if least < 0:
        lines.append(
            f"the irradiance falls to {least:.3g} on some side; --window auto keeps it non-negative"
        )
    return [f"{result['file']}: {line}" for line in lines]


def _report(result: dict[str, Any]) -> list[str]:
    describe = {
        "irradiance": _report_irradiance,
        "splitsum": _report_split_sum,
        "she": _report_exponential,
    }[result["representation"]]
    what, *lines = describe(result)
    stored = f"{result['precision']}, {result['bytes']:,} bytes"
    return [f"{result['file']}: {what}, {stored}", *(f"  {line}" for line in lines)]


def _counted(count: int, noun: str) -> str:
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def _report_irradiance(result: dict[str, Any]) -> list[str]:
    size, window = result["size"], result["window"]
    lines = [
        f"irradiance, {_counted(result['coefficients'], 'coefficient')} and a cube of "
        f"6 x {size} x {size} texels",
        f"order          F = {result['order_f']}",
        f"RMS error      {result['predicted_error']:.2%} of the irradiance predicted",
    ]
    least = f"minimum        {result['minimum_irradiance']:.4g} over all sides and channels"
    if window["name"] == "none":
        asked = " is needed" if window["asked"] == "auto" else ""
        return [*lines, f"window         none{asked}", least]
    width = "" if window["width"] is None else f" of width {window['width']:.4g}"
    return [
        *lines,
        f"window         {window['name']}{width}: takes "
        f"{window['energy_lost']:.2%} of the energy, changes {window['change']:.2%} (RMS)",
        f"{least}, {result['minimum_without_window']:.4g} without the window",
    ]


def _report_split_sum(result: dict[str, Any]) -> list[str]:
    levels = result["levels"]
    heading = f"{'roughness':<10} {'texels':>15} {'F':>4}  {'made by':<12} RMS error predicted"
    what = f"split sum, {_counted(len(levels), 'level')} by the mapping {result['mapping']}"
    lines = [what, heading]
    for level in levels:
        texels = f"6 x {level['size']} x {level['size']}"
        order, error = str(level["order_f"]), f"{level['predicted_error']:.2%}"
        if level["domain"] != "frequency":  # its order only chose the size
            order = "-"
        if level["domain"] == "probe":
            error = "-"
        made_by = {"frequency": "coefficients", "angular": "integration"}
        lines.append(
            f"{level['roughness']:<10.4g} {texels:>15} {order:>4}  "
            f"{made_by.get(level['domain'], 'resampling'):<12} {error}"
        )
    return lines


def _report_exponential(result: dict[str, Any]) -> list[str]:
    p, q = result["p_order"], result["q_order"]
    (first, last), (low, high) = result["roughness"], result["ggx_alpha"]
    return [
        f"SH exponential, {(p + 1) ** 2} + {(q + 1) ** 2 - 1} coefficients a channel",
        f"orders         P = {p}, Q = {q}, attenuated by the law {result['law']!r}",
        f"roughness      {first:.4g} .. {last:.4g} (GGX's alpha {low:.4g} .. {high:.4g})",
        f"RMS error      {result['fit_residual']:.2%} of the reflected light left by the fit",
    ]


def converted_for_engines(
    source: str, found: Map, target: str, size: int | None, sampling: str | None
) -> Map:
    """The same map: nothing else can be made from it, nor it from other maps."""
    from dataclasses import replace

    from shrm_cli.errors import MapError
    from shrm_cli.maps.irradiance.irradiance import Irradiance
    from shrm_cli.vocabulary import MAX_CUBE_SIZE

    held = found.representation
    if target in ALL_REPRESENTATIONS and target != held:
        raise click.BadParameter(
            f"{source} is a map of representation {held}; {target} is made from the probe, by "
            f"shrm prefilter PROBE --to {target}",
            param_hint="'--to'",
        )
    if isinstance(found, Irradiance):  # the coefficients hold it all
        if size is not None and size > MAX_CUBE_SIZE:
            raise MapError(f"a map of size {size} is larger than {MAX_CUBE_SIZE}; lower --size")
        sampling = sampling or found.sampling
        return replace(found, size=size or found.size, sampling=sampling)  # type: ignore[arg-type]
    if held == "she" and target != held:
        raise click.BadParameter(
            f"{source} holds coefficients, no images that could be laid out", param_hint="'--to'"
        )
    refuse_options(f"a map of representation {held}", size=size, to_sampling=sampling)
    return found
