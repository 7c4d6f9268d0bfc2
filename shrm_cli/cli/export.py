"""`shrm export` makes the files that an engine loads."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import shrm_cli as shrm
from shrm_cli.cli import options, usage
from shrm_cli.cli.terminal import conclude, progress_bar
from shrm_cli.cli.types import FRACTION, PATH, Named, flag, option, whole
from shrm_cli.errors import ShrmError
from shrm_cli.maps.options import listing
from shrm_cli.vocabulary import ENGINES, REPRESENTATIONS, TEXEL_FORMATS

if TYPE_CHECKING:
    from shrm_cli.export.engine import Engine
    from shrm_cli.export.make import Source


def installed_engines() -> list[str]:
    """Return the engines of installed packages."""
    from shrm_cli.plugins import ENGINES as GROUP
    from shrm_cli.plugins import installed

    return sorted(installed(GROUP))


texel_options = (
    option(
        "--format", click.Choice(TEXEL_FORMATS),
        help="Texels of cubes, where the engine reads several; auto is the smallest that keeps "
        "--max-error, ASTC aside, which few desktops read.  [default: the engine's]",
    ),
    option(
        "--max-error X", FRACTION,
        help="Refuse texels that change a level by more: its RMS, 95 % of its texels, or the "
        "energy of a lamp.  [default: .03 of auto]",
    ),
    option(
        "--skybox", whole(0, 4096),
        help="Texels along an edge of a sharp cube for the background, 0 for none.",
    ),
    flag("--dfg", "The environment-BRDF table, where the engine takes it."),
    flag(
        "--firefly-safe",
        help="Spread lamps over discs that the engine's own filter resolves (godot, unity).",
    ),
)  # fmt: skip
"""How the files of engines are packed, and what comes with them."""
_OPTIONS = {"texels": "format", "table": "dfg", "safe": "firefly_safe"}
"""Attributes of `Asked` that options have other names for."""


@click.command()
@click.argument("sources", metavar="PROBE|MAP...", type=PATH, nargs=-1, required=True)
@option(
    "--for engines", Named([*ENGINES, "all"], installed_engines), multiple=True, required=True,
    help="Who loads it; several may be named; all are those of shrm itself.",
)  # fmt: skip
@option(
    "-o --output DIR", PATH,
    help="Folder to write into; of several engines each gets a folder of its name in it.  "
    "[default: NAME.ENGINE in the current folder]",
)  # fmt: skip
@usage.force_option
@option(
    "--size", whole(1, 4096),
    help="Texels along an edge of level 0, or rows of a lat-long.  [default: the engine's]",
)  # fmt: skip
@option(
    "--window NAME[:WIDTH]", str,
    help="Window of the nine coefficients, as of irradiance: none, hann, lanczos, or auto, the "
    "least that leaves nothing negative.  [default: auto]",
)  # fmt: skip
@option(
    "--into MODEL", PATH,
    help="Put the light into a copy of a glTF file, .glb or .gltf, where the engine reads glTF.",
)  # fmt: skip
@options.several(*texel_options)
@option(
    "--sun", click.Choice(["split"]),
    help="split: take the lamps out, and make lights of the engine of them (three, filament, "
    "bevy, godot, babylon, usd).",
)  # fmt: skip
@options.probe_options
@options.report_options
def export(
    sources: tuple[str, ...],
    engines: tuple[str, ...],
    output: str | None,
    force: bool,
    **values: Any,
) -> None:
    """Make the files that an engine loads, and a README with the code that loads them.

    PROBE is filtered for the engine: the levels of its split sum, at its sizes and roughnesses,
    nine coefficients or a cube for diffuse surfaces, a sharp cube. Of MAP, a split sum or an
    irradiance map or both, it takes what fits, and refuses what does not. Colours become linear
    Rec.709, unless --working names other primaries. What was turned, scaled, converted or clipped
    is said.

    \b
      shrm export probe.exr --for bevy
      shrm export probe.exr --for filament --format rgba16f -o light
      shrm export probe.exr --for three --for filament -o assets
      shrm export probe.exr --for gltf --into chair.glb
      shrm export probe.splitsum.exr probe.irradiance.exr --for filament
    """
    from shrm_cli.export.make import check

    names = list(ENGINES) if "all" in engines else list(dict.fromkeys(engines))
    reading = options.make_read_options(values)
    name = usage.source_stem(sources[0], REPRESENTATIONS)
    is_kept = reading.working is not None
    attributes = {name: attribute for attribute, name in _OPTIONS.items()}
    given = {attributes.get(name, name): value for name, value in values.items()}
    asked = shrm.Asked(**given, keeps_primaries=is_kept)
    chosen, unusable = _found(names)
    with usage.renamed(**_OPTIONS):
        own = asked.of_several(chosen)
        if len(names) == 1:
            check(chosen[0], asked)
    if len(names) == 1:
        folder = Path(output) if output else Path(f"{name}.{names[0]}")
        conclude(*_exported(_opened(sources, reading), chosen[0], folder, asked, force))
        return
    start = f"{output}/" if output else f"{name}."
    wanted = [
        (engine, Path(start + engine.name), its) for engine, its in zip(chosen, own, strict=True)
    ]
    source = _opened(sources, reading).for_several()
    results, lines, warnings = _all_exported(source, wanted, output, force, unusable)
    # What is wrong with the light is said once.
    failures = [f"{listing(these, 'and')}: {reason}" for reason, these in unusable.items()]
    some = _of_some(asked, chosen, own)
    lines += [
        f"--{flag} is for {listing(having, 'and')}; the others have none"
        for flag, having in some.items()
    ]
    result = {"exports": results, "failures": failures, "options_of_some": some}
    conclude(result, lines, warnings, failures)


def _all_exported(
    source: Source,
    wanted: list[tuple[Engine, Path, shrm.Asked]],
    output: str | None,
    force: bool,
    failures: dict[str, list[str]],
) -> tuple[list[dict[str, Any]], list[str], list[str]]:
    """Make the files of several engines; return what `_exported` does.

    `failures` get the engines by the reasons for which they have none.
    """
    from shrm_cli.export.make import made_folder

    results: list[dict[str, Any]] = []
    lines: list[str] = []
    warnings: list[str] = []
    with made_folder(Path(output)) if output else nullcontext():
        for engine, folder, its in wanted:
            try:
                result, told, warned = _exported(source, engine, folder, its, force)
            except ShrmError as error:
                failures.setdefault(usage.flags(str(error)), []).append(engine.name)
                continue
            results.append(result)
            lines += told
            warnings += [line for line in warned if line not in warnings]
    return results, lines, warnings


def _found(names: list[str]) -> tuple[list[Engine], dict[str, list[str]]]:
    """Return engines by their names, and those of packages that cannot be used by reasons."""
    from shrm_cli.export.engine import engine

    found: list[Engine] = []
    failures: dict[str, list[str]] = {}
    for name in names:
        try:
            found.append(engine(name))
        except ShrmError as error:
            if len(names) == 1:
                raise
            failures.setdefault(str(error), []).append(name)
    return found, failures


def _of_some(
    asked: shrm.Asked, engines: list[Engine], own: list[shrm.Asked]
) -> dict[str, list[str]]:
    """Return the engines that have each option which not all of them have."""
    found = {}
    for name, value in vars(asked).items():
        pairs = zip(engines, own, strict=True)
        having = [engine.name for engine, its in pairs if getattr(its, name) == value]
        if len(having) < len(engines):
            found[_OPTIONS.get(name, name).replace("_", "-")] = having
    return found


def _opened(sources: tuple[str, ...], reading: shrm.ReadOptions) -> Source:
    """Open a probe, or maps, once for all engines."""
    from shrm_cli.export.make import Source

    if shrm.is_map(sources[0]):
        usage.refuse_inapplicable(options.reading_rules(False, "to probes; this is a map"))
    elif len(sources) > 1:
        shrm.open_probe(sources[0], reading)  # or a file that is not there would be called a probe
        raise usage.wrong_usage(f"{sources[0]} is a probe; export it alone")
    return Source.open(sources, usage.source_stem(sources[0], REPRESENTATIONS), reading)


def _exported(
    source: Source, engine: Engine, folder: Path, asked: shrm.Asked, force: bool
) -> tuple[dict[str, Any], list[str], list[str]]:
    """Make the files of one engine; return what is told as JSON, its lines, and warnings."""
    from shrm_cli.export.make import keep_other_export, packaged, write

    usage.check_outputs([str(folder / source.name) if folder.is_dir() else str(folder)])
    if not force:
        keep_other_export(source, engine, folder)
    with usage.renamed(**_OPTIONS), progress_bar(f"exporting for {engine.name}") as progress:
        made = packaged(source, engine, asked, progress)
    if folder.is_dir():
        usage.check_outputs([str(folder / file.name) for file in made.files])
    paths = write(made, folder, kept=not force)
    result = {
        "engine": engine.name,
        "folder": str(folder),
        "files": [{"name": path.name, "bytes": path.stat().st_size} for path in paths],
        "told": made.told,
        "loading": made.loading,
        **made.facts,
    }
    lines = [
        f"{folder}: {engine.title}",
        *[f"  {path.name:<32} {path.stat().st_size:>12,} bytes" for path in paths],
        *[f"  {line}" for line in made.told],
    ]
    remarks = [] if source.probe is None else source.probe.warnings()
    return result, lines, [*remarks, *made.warnings]
