"""`shrm choose` says which form of a map to ship for a probe and a material."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from typing import Any

import click

import shrm_cli as shrm
from shrm_cli.cli import options, usage
from shrm_cli.cli.terminal import columns, conclude, progress_bar
from shrm_cli.cli.types import BYTES, FRACTION, PATH, option
from shrm_cli.extras import install
from shrm_cli.files.whole import note
from shrm_cli.maps.options import bytes_text
from shrm_cli.vocabulary import AUTO

_MOST_ROWS = 24
"""The most pairs of a probe and a material that one picture shows."""
_SAID = (
    "form", "what", "bytes", "error", "wrong_share", "measured", "look_ups", "multiply_adds",
    "on_front", "on_cost_front", "has_spots", "arguments",
)  # fmt: skip
"""What JSON has of an offer."""
_HEADS = ("", "form", "bytes", "RMS", "wrong", "look-ups", "multiply-adds", "")


@click.command()
@click.argument("probes", metavar="PROBES...", nargs=-1, required=True, type=PATH)
@options.materials_option
@option("--budget BYTES", BYTES, "The most bytes of a map, such as 200kB.  [default: 32 MB]")
@option("--error X", FRACTION, "The RMS error of the light that is good enough.  [default: 0.05]")
@option("--seen X", FRACTION, "The share of pixels that may be wrong by over 5 %.  [default: 0.05]")
@options.written_to("Draw error against bytes and against the shader's cost.", metavar="PNG")
@option("--map target EXR", PATH, "Write the recommended map, of one probe and one material.")
@options.probe_options
@options.report_options
def choose(
    probes: tuple[str, ...],
    specs: tuple[str, ...],
    budget: int | None,
    output: str | None,
    target: str | None,
    **values: Any,
) -> None:
    """Say which form of a map to ship: what each takes, and what it looks like.

    For each of PROBES and each BRDF, a table of SHRMs, maps of principal functions, split sums, SH
    exponentials, irradiance and Cabral's maps, as far as they hold the BRDF: their bytes, the RMS
    error, the share of pixels wrong by more than 5 %, and the fetches and multiply-adds of their
    shader. The one of the fewest bytes whose picture is right is recommended; where none fits, the
    least wrong.

    \b
      shrm choose probe.exr --brdf ggx:roughness=0.4 --budget 200kB
      shrm choose city.exr studio.exr --brdf lambertian --brdf ggx -o choose.png
      shrm choose probe.exr --brdf 0.94*lambertian+ggx:f0=0.04 --map paint.exr
    """
    from shrm_cli.probe.shared import shared
    from shrm_cli.progress import Stages

    pairs = len(probes) * len(specs)
    _check_usage(pairs, output, target)
    reading = options.make_read_options(values)
    note(*(path for path in probes if "%" not in path))
    usage.check_outputs([each for each in (output,) if each], specs=specs, suffixes=(".png",))
    usage.check_outputs([each for each in (target,) if each], suffixes=(".exr",))
    for spec in specs:
        shrm.parse_spec(spec)  # what is wrong with a material is said before the work begins
    goal = {name: value for name, value in values.items() if value is not None}
    found: list[tuple[str, shrm.Choice]] = []
    failures, warnings = [], []
    with progress_bar("choosing") as progress:
        stages = Stages(progress, pairs)
        for path in probes:
            try:
                light = shared(shrm.open_probe(path, reading))
            except shrm.ShrmError as reason:
                failures.append(usage.flags(str(reason)))
                continue
            for spec in specs:
                try:
                    found += [
                        (path, each)
                        for each in shrm.choose(light, spec, budget, progress=stages.within, **goal)
                    ]
                except shrm.ShrmError as reason:
                    failures.append(f"{path}, {spec}: {usage.flags(str(reason))}")
                stages.done(len(found) + len(failures), pairs)
            if any(name == path for name, _ in found):
                warnings += light.warnings()
    if not found:
        raise click.ClickException(failures[0])
    failures += [_misfit(path, each) for path, each in found if each.recommended is None]
    lines = [line for path, each in found for line in _report(path, each)]
    files = _write(found, output, target)
    result = {"choices": [_values(path, each) for path, each in found], "files": files}
    warnings += [line for _, each in found for line in each.warnings]
    lines += [f"wrote {path}" for path in files]
    conclude({**result, "failures": failures}, lines, warnings, failures)


def _write(
    found: Sequence[tuple[str, shrm.Choice]], output: str | None, target: str | None
) -> list[str]:
    """Write the picture and the map that are asked for, and return their names."""
    from shrm_cli.analysis.plots import plot_offers

    files = []
    if output is not None:
        plot_offers(output, found)
        files.append(output)
    if target is not None and found[0][1].recommended is not None:
        found[0][1].recommended.make().save(target)
        files.append(target)
    return files


def _check_usage(pairs: int, output: str | None, target: str | None) -> None:
    """Refuse files that cannot show so many pairs of a probe and a material."""
    from shrm_cli.analysis.plots import can_plot

    if target is not None and pairs > 1:
        raise click.UsageError("--map writes the map of one probe and one --brdf")
    if output is not None and pairs > _MOST_ROWS:
        raise click.UsageError(f"-o shows {_MOST_ROWS} pairs of a probe and a --brdf at most")
    if output is not None and not can_plot():
        raise click.ClickException(f"-o needs matplotlib; {install('plots')}")


def _values(path: str, choice: shrm.Choice) -> dict[str, Any]:
    """Return a choice as JSON has it; docs/choose.md says what each key means."""
    return {
        "probe": path,
        "brdf": choice.brdf,
        "budget": choice.budget,
        "goal": {"error": choice.goal.error, "wrong_share": choice.goal.wrong_share},
        "recommended": None
        if choice.recommended is None
        else choice.offers.index(choice.recommended),
        "is_kept": choice.is_kept,
        "lamps": choice.lamps,
        "offers": [{name: getattr(each, name) for name in _SAID} for each in choice.offers],
    }


def _report(path: str, choice: shrm.Choice) -> list[str]:
    """Return the table of a probe and a material, and what is recommended."""
    rows = [_HEADS, *(_row(each, each is choice.recommended) for each in choice.offers)]
    return [
        f"{path}, {choice.brdf}",
        *columns(rows, left=(0, 1, -1)),
        "  b: on the front of bytes and error; c: of the shader's cost; ~: measured"
        + ("; s: has black spots" if any(each.has_spots for each in choice.offers) else ""),
        *_advice(path, choice),
    ]


def _row(offer: shrm.Offer, is_best: bool) -> tuple[str, ...]:
    from shrm_cli.choose.offer import work_text

    marks = "".join(
        sign if holds else " "
        for sign, holds in (
            (">", is_best), ("b", offer.on_front), ("c", offer.on_cost_front),
            ("s", offer.has_spots),
        )
    ).rstrip()  # fmt: skip
    return (
        f"  {marks}",
        offer.form,
        bytes_text(offer.bytes),
        _share(offer.error, "error" in offer.measured),
        _share(offer.wrong_share, "wrong_share" in offer.measured),
        f"{offer.look_ups}",
        work_text(offer),
        offer.what,
    )


def _share(value: float, is_measured: bool) -> str:
    return f"{'~' if is_measured else ''}{value:.1%}"


def _misfit(path: str, choice: shrm.Choice) -> str:
    """Return why nothing is recommended: no form holds it, or the budget is below the least."""
    if not choice.offers:
        return f"{path}, {choice.brdf}: no form holds it; take shrm prefilter"
    least = bytes_text(min(each.bytes for each in choice.offers))
    most = bytes_text(choice.budget or 0)
    return f"{path}, {choice.brdf}: no form fits in {most}, the least takes {least}; raise --budget"


def _advice(path: str, choice: shrm.Choice) -> list[str]:
    """Return what to take, why, and the command that makes it."""
    best = choice.recommended
    room = "" if choice.budget is None else f" within {bytes_text(choice.budget)}"
    if best is None:
        return []
    asked = f"{choice.goal.error:.2g} RMS error and {choice.goal.wrong_share:.0%} of wrong pixels"
    if choice.is_kept:
        is_beside = best.multiply_adds is None
        of = ", of maps with the lamps in them," if choice.lamps and not is_beside else ""
        why = f"the fewest bytes{of} that keep {asked}"
    else:
        why = f"nothing{room} keeps {asked}; this is the least wrong"
    lines = [f"  take {best.form}, {best.what}, {bytes_text(best.bytes)}: {why}"]
    if best.arguments is not None:
        given = _flags(best.arguments, choice.brdf)
        words = ["shrm", "prefilter", path, *options.words_of_reading(), *given]
        lines.append(f"  {shlex.join(words)}")
    return lines


def _flags(arguments: Mapping[str, Any], brdf: str) -> list[str]:
    """Return the options of `shrm prefilter` that make a map, as words."""
    from shrm_cli.maps.registry import description

    form = description(arguments["to"])
    words = ["--brdf", brdf] if form.needs_brdf else []
    ranges = {each.name for each in form.options if each.kind == "interval"}
    for name, value in arguments.items():
        if value == AUTO:  # what is made where nothing is named
            continue
        word = "..".join(map(str, value)) if name in ranges else options.value_word(value)
        words += [f"--{name.replace('_', '-')}", word]
    return words
