"""`shrm batch` makes maps of many probes."""

from __future__ import annotations

import os
import sys
from contextlib import AbstractContextManager, ExitStack, nullcontext
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import click

import shrm_cli as shrm
from shrm_cli import settings
from shrm_cli.cli import options, usage
from shrm_cli.cli.contact import write_contacts
from shrm_cli.cli.export import installed_engines, texel_options
from shrm_cli.cli.farm import farm_options, named_parts, refuse_for_farms, write_farm_files
from shrm_cli.cli.prefilter import MAKING_HEADINGS
from shrm_cli.cli.terminal import echo_lines, echo_message, progress_bar, tell, ticking
from shrm_cli.cli.types import FILE, PATH, Named, flag, option, whole
from shrm_cli.maps.options import counted
from shrm_cli.maps.registry import installed_names
from shrm_cli.messages import is_remote, predicted_error, without_name
from shrm_cli.settings import limit_libraries
from shrm_cli.vocabulary import (
    AUTO,
    ENGINES,
    EXPORT,
    MAX_COLLECTED_ORDER,
    MAX_JOBS,
    REPRESENTATIONS,
)

if TYPE_CHECKING:
    from shrm_cli.batch.collect import What
    from shrm_cli.batch.job import Chunk
    from shrm_cli.batch.log import Log, Totals
    from shrm_cli.batch.run import Workers
    from shrm_cli.batch.work import Gathering, Result

_DEFAULT_LOG = "batch.jsonl"
_MOST_REASONS = 5
"""The most reasons why outputs are made anew that are printed; the log has all of them."""
_HEADINGS = {
    **MAKING_HEADINGS,
    "What to make": ["brdfs", "to", "engines", "output"],
    "Files of engines": ["format", "max_error", "skybox", "dfg", "firefly_safe"],
    "How the probes are read": [*options.READING_NAMES, "probe_sampling"],
    "Where it runs": ["jobs", "scheduler", "commands", "openjd", "chunk", "share"],
    "Coefficients of all probes in one file": ["collect", "collect_order", "collect_what",
                                              "collect_window"],
    "What is done again, and what is told": ["force", "dry_run", "log", "contact_page", "as_json",
                                             "quiet"],
}  # fmt: skip
_RUNNING = {
    "jobs", "scheduler", "commands", "openjd", "chunk", "share", "collect", "collect_order",
    "collect_what", "collect_window", "contact_page", "force", "dry_run", "log", "as_json", "quiet",
    "no_cache",
}  # fmt: skip
"""The options that say nothing about what is made, and apply to manifests."""


_gather_options = options.several(
    option(
        "--collect FILE", FILE,
        help="Gather the coefficients of all probes in one .npz or .parquet.",
    ),
    option(
        "--collect-order", whole(0, MAX_COLLECTED_ORDER), default=2,
        help="Largest degree of these coefficients.",
    ),
    option(
        "--collect-what", click.Choice(["radiance", "irradiance"]), default="radiance",
        help="Coefficients of the light, or of the irradiance it gives.",
    ),
    option(
        "--collect-window NAME[:WIDTH]", str, default="none",
        help="Factors of the degrees, as `shrm prefilter --to irradiance --window` has them.",
    ),
)  # fmt: skip


@click.command(cls=options.command_with_headings(_HEADINGS))
@click.argument("probes", metavar="MANIFEST.toml | PROBES...", nargs=-1, required=True)
@options.brdfs_option
@option(
    "--to", Named([AUTO, *REPRESENTATIONS, EXPORT], installed_names), multiple=True,
    default=[AUTO], show_default=False,
    help="A representation to write, as `shrm prefilter` takes it, or export. May be repeated.  "
    "[default: export with --for, else auto]",
)  # fmt: skip
@option(
    "--for engines", Named([*ENGINES, "all"], installed_engines), multiple=True,
    help="An engine whose files are exported, a folder each. May be repeated.",
)  # fmt: skip
@option(
    "-o --output NAME", str,
    help="Names of the outputs, with {probe}, {folder}, {brdf}, {to} and {engine} in them; their "
    "folders are made.  [default: {probe}.{brdf}.{to}.exr, {probe}.{engine} of exports]",
)  # fmt: skip
@options.making_options("probes", "cubes", lambda option: not option.prints)
@options.several(*texel_options)
@options.read_options
@option(
    "--jobs N", whole(1, MAX_JOBS),
    help="Processes that work at a time.  [default: as many as there are processors]",
)  # fmt: skip
@option(
    "--scheduler ADDRESS", str,
    help="Work on a dask.distributed cluster, such as tcp://host:8786; local starts one here.",
)  # fmt: skip
@farm_options
@_gather_options
@option(
    "--contact contact_page PAGE.html", PATH,
    help="Put all outputs onto one page, drawn small, with sizes and errors.",
)  # fmt: skip
@flag("--force", "Make all outputs again, and replace others' files.")
@flag("--dry-run", "List what would be made, with sizes and orders; make nothing.")
@option("--log", FILE, "File that gets a line of JSON for each job.", default=_DEFAULT_LOG)
@options.output_options
@options.cache_option
def batch(
    probes: tuple[str, ...],
    jobs: int | None,
    scheduler: str | None,
    commands: str | None,
    openjd: str | None,
    chunk: int,
    share: tuple[int, int, int] | None,
    collect: str | None,
    collect_order: int,
    collect_what: What,
    collect_window: str,
    contact_page: str | None,
    force: bool,
    dry_run: bool,
    log: str,
    **values: Any,
) -> None:
    """Make maps of many probes: the product of PROBES, BRDFs and forms.

    Quote patterns such as 'probes/**/*.exr'; probes may be URLs, too. Each probe is read once for
    all its outputs. What is there already and whole, of the same probe, BRDF, options and
    program, is skipped, so that a run that was stopped goes on. Files that shrm wrote are never
    matched by patterns. A probe that cannot be used does not stop the others.

    \b
      shrm batch 'probes/*.exr' --brdf ggx:roughness=0.4 --brdf paint.bsdf --to principal
      shrm batch bake.toml --dry-run
      shrm batch 'probes/**/*.exr' --to irradiance -o 'sh/{folder}/{probe}.exr'
      shrm batch 'probes/*.exr' --for three --for bevy -o '{engine}/{probe}'
      shrm batch 'probes/*.exr' --collect light.npz --collect-order 3
      shrm batch bake.toml --scheduler tcp://host:8786
    """
    from shrm_cli.batch.batch import workers
    from shrm_cli.batch.entry import check_others, checked
    from shrm_cli.batch.job import by_probe

    if commands or openjd:
        refuse_for_farms()
    gathering = _gathering_of(collect, collect_order, collect_what, collect_window)
    entries = _entries(probes, values, makes_none=collect is not None)
    left_out: list[str] = []
    found = checked([job for entry in entries for job in entry.jobs(left_out)])
    chunks = by_probe(found) if found else _without_jobs(entries, left_out)
    if left_out and not usage.is_quiet():
        others = f"{counted(len(set(left_out)), 'file')} that shrm made, or that hold no light"
        echo_lines([f"{others}, such as {left_out[0]}: left out of the patterns"], err=True)
    written = [commands, openjd] if commands or openjd else [collect, contact_page, log]
    check_others([each for each in written if each is not None and each != "-"], chunks)
    if commands or openjd:
        write_farm_files(options.words_of_call(), commands, openjd, len(chunks), chunk)
        return
    chunks = named_parts(chunks, share, [collect, contact_page])
    terms = shrm.Terms(force, dry_run, settings.current().cache, gathering)
    if gathering is not None:
        chunks = [replace(chunk, collects=True) for chunk in chunks]
    if contact_page is not None:
        usage.check_outputs([contact_page], files=probes, suffixes=usage.PAGES)
        _check_count(chunks)
    if dry_run:
        contact_page = None
    if scheduler is None:
        # Processes and threads must not multiply; workers take over the environment.
        limit_libraries(1)
    _run(chunks, terms, workers(jobs, scheduler), None if dry_run else log, collect, contact_page)


def _stands_for_more(name: str) -> bool:
    """Whether a name is a pattern or a URL."""
    import glob

    return glob.has_magic(name) or is_remote(name)


def _entries(probes: tuple[str, ...], values: dict[str, Any], makes_none: bool) -> list[shrm.Entry]:
    """Return what is to be made, from a manifest or from the options."""
    from shrm_cli.batch.entry import DEFAULT_OUTPUT, every_engine
    from shrm_cli.batch.manifest import is_manifest, read_manifest
    from shrm_cli.probe.reader import check_file

    given = usage.given_options()
    if any(is_manifest(name) for name in probes):
        if len(probes) > 1:
            raise click.UsageError("a manifest names its probes; give nothing beside it")
        for name, flag in given.items():
            if name not in _RUNNING:
                raise click.UsageError(f"{flag} says what is made; write it into the manifest")
        return read_manifest(probes[0])
    if len(probes) == 1 and probes[0].lower().endswith(".toml") and not _stands_for_more(probes[0]):
        check_file(probes[0])  # or options that a manifest says would be missed first
    both, own, of_probe = (values.pop(name) for name in (
        "sampling", "map_sampling", "probe_sampling",
    ))  # fmt: skip
    reading = options.reading_keywords(values, of_probe or both)
    brdfs, to, precision = (values.pop(name) for name in ("brdfs", "to", "precision"))
    engines = every_engine(values.pop("engines"))
    for switch in ("dfg", "firefly_safe"):
        values[switch] = values[switch] or None
    if engines and "to" not in given:
        to = (EXPORT,)
    output = values.pop("output") or DEFAULT_OUTPUT
    arguments = {name: value for name, value in values.items() if value is not None}
    if own or both:
        arguments["sampling"] = own or both
    if makes_none and not {"brdfs", "to", "engines", "output"} & given.keys():
        to = ()
    return [
        shrm.Entry(
            probes, brdfs, to, output, arguments, {}, reading, precision, runs_code=True,
            engines=engines,
        )
    ]  # fmt: skip


def _without_jobs(entries: list[shrm.Entry], left_out: list[str]) -> list[Chunk]:
    """Return chunks of probes of which only coefficients are gathered."""
    from shrm_cli.batch.entry import found_probes
    from shrm_cli.batch.job import Chunk

    return [
        Chunk(name, entry.reading, ())
        for entry in entries
        for name, _ in found_probes(entry.probes, left_out)
    ]


def _gathering_of(collect: str | None, order: int, what: What, window: str) -> Gathering | None:
    """Return what is gathered; None where nothing is."""
    from shrm_cli.batch.collect import check_collection
    from shrm_cli.batch.work import Gathering

    rule = (collect is not None, "with --collect")
    usage.refuse_inapplicable(
        dict.fromkeys(("collect_order", "collect_what", "collect_window"), rule)
    )
    if collect is None:
        return None
    check_collection(collect)
    return Gathering(order, what, window)


def _write_gathered(
    path: str, gathering: Gathering, chunks: list[Chunk], results: list[Result]
) -> None:
    """Write the coefficients of all probes, in the order in which these were named."""
    from shrm_cli.batch.collect import Collection, write_collection

    order = {chunk.probe: index for index, chunk in reversed(list(enumerate(chunks)))}
    found = sorted(results, key=lambda each: order[each.probe])
    write_collection(path, Collection.of(found, gathering.what, gathering.order, gathering.window))


def _run(
    chunks: list[Chunk],
    terms: shrm.Terms,
    place: AbstractContextManager[tuple[Workers, bool]],
    log: str | None,
    collect: str | None,
    contact_page: str | None,
) -> None:
    """Do all jobs, and tell what became of them; exit with 1 if one failed."""
    from shrm_cli import messages
    from shrm_cli.batch.log import Totals, opened_log
    from shrm_cli.batch.run import run

    count = sum(len(chunk.jobs) for chunk in chunks)
    totals = Totals(count)
    results: list[Result] = []
    told: set[tuple[str, str]] = set()
    predictions: list[dict[str, Any]] = []
    refused: list[Result] = []
    if terms.only_looks:
        predictions, chunks, refused = _predictions(chunks)
    with ExitStack() as stack:
        written = stack.enter_context(opened_log(log, count) if log else nullcontext())
        show = stack.enter_context(ticking(count or len(chunks)))

        def take(result: Result) -> None:
            totals.add_result(result)
            _note(result, written, terms.only_looks, told)
            if result.coefficients is not None:
                results.append(result)
            show(totals)

        for result in refused:
            take(result)
        try:
            with place as (workers, is_remote):
                run(chunks, workers, terms, take, is_remote)
        except (KeyboardInterrupt, SystemExit):  # SIGTERM ends the process by an exit
            _conclude(totals, log, [])
            raise
        finally:
            if written is not None:
                written({"status": "ended", **totals.as_json()})
    if collect is not None and terms.gathering is not None and not terms.only_looks:
        _write_gathered(collect, terms.gathering, chunks, results)
        if not (usage.is_quiet() or usage.wants_json()):
            probes = counted(len(results), "probe")
            echo_lines([f"{messages.shown(collect)}: {terms.gathering.what} of {probes}"])
    if contact_page is not None:
        _show(chunks, totals, contact_page)
    _conclude(totals, log, predictions)
    if totals.failed:
        sys.exit(1)


def _check_count(chunks: list[Chunk]) -> None:
    """Refuse a page of more maps than it can have, before long work."""
    from shrm_cli.report.contact import MOST_MAPS

    count = sum(len(chunk.jobs) for chunk in chunks)
    if count > MOST_MAPS:
        raise usage.wrong_usage(
            f"--contact shows {MOST_MAPS:,} maps at most, and these are {count:,}; leave it out, "
            "and give `shrm contact` some of them"
        )


def _show(chunks: list[Chunk], totals: Totals, target: str) -> None:
    """Put all outputs that are there onto one page, and what failed."""
    from shrm_cli.report.contact import Contacts

    outputs = [job.output for chunk in chunks for job in chunk.jobs]
    there = [output for output in outputs if os.path.isfile(output)]
    with progress_bar("drawing") as progress:
        found = shrm.draw_contacts(there, progress) if there else Contacts()
    failed = [(each["output"], each["error"]) for each in totals.failures if each.get("output")]
    found.failures = [*failed, *found.failures]
    write_contacts(found, target, "shrm batch")


def _note(result: Result, log: Log | None, only_looks: bool, told: set[tuple[str, str]]) -> None:
    """Write records into the log, and what failed, or would be made, to the terminal.

    `told` are the probes and the reasons that were told of; others of their outputs that failed for
    these stand in the log alone.
    """
    for record in result.records:
        if log is not None:
            log(record)
        if record["status"] == "failed":
            error = without_name(record["error"], record["output"])
            if (result.probe, error) not in told:
                told.add((result.probe, error))
                echo_message(f"Failed: {record['output']}: {usage.flags(error)}")
        elif only_looks and not usage.is_quiet():
            why = record.get("why", "there already")
            line = f"{record['status']:<8} {record['output']}  ({usage.flags(why)})"
            echo_lines([line], err=True)
    if result.error and not result.records:
        echo_message(f"Failed: {usage.flags(result.error)}")
        if log is not None:
            log({"status": "failed", "probe": result.probe, "error": result.error})


def _predictions(
    chunks: list[Chunk],
) -> tuple[list[dict[str, Any]], list[Chunk], list[Result]]:
    """Return what outputs will be like, what is to be looked at, and what fails for each probe."""
    from shrm_cli.batch.work import Result, failure, predictions

    with progress_bar("predicting") as progress:
        found, refused = predictions(chunks, progress)
    if not refused:
        return found, chunks, []
    left, failed = [], []
    for chunk in chunks:
        texts = [refused.get(repr(job.recipe)) for job in chunk.jobs]
        pairs = list(zip(chunk.jobs, texts, strict=True))
        lines = [failure(job, text) for job, text in pairs if text is not None]
        sound = tuple(job for job, text in pairs if text is None)
        failed += [Result(chunk.probe, lines)] if lines else []
        left += [replace(chunk, jobs=sound)] if sound or chunk.collects else []
    return found, left, failed


def _conclude(totals: Totals, log: str | None, predictions: list[dict[str, Any]]) -> None:
    """Print the totals of a run."""
    more = {"predictions": predictions} if predictions else {}
    words = [
        f"{count:,} {word}"
        for word, count in (
            ("made", totals.made),
            ("to make", totals.waiting),
            ("there already", totals.skipped),
            ("failed", totals.failed),
            ("not done", totals.jobs - totals.done),
        )
        if count
    ]
    told = f"; {log} tells of each" if log else ""
    warned = f"; {totals.warned:,} with warnings" if totals.warned else ""
    size = f", {totals.bytes:,} bytes" if totals.bytes else ""
    outputs = "output" if totals.jobs == 1 else "outputs"
    anew = totals.anew.most_common(_MOST_REASONS)
    counts = [f"{totals.jobs:,} {outputs}: {', '.join(words) or 'none'}{size}{warned}{told}"]
    lines = [
        *map(_prediction_line, predictions),
        *(counts if words or log is None else ()),  # none, where coefficients alone are gathered
        *(f"  {count:,} anew: {usage.flags(why)}" for why, count in anew),
    ]
    result = {**totals.as_json(), "log": log, **more, "failures": totals.failures}
    tell(result, lines)


def _prediction_line(facts: dict[str, Any]) -> str:
    """Return what outputs will be like, in words; not all forms have orders, or texels."""
    brdf = f", {facts['brdf']}" if facts["brdf"] else ""
    what = f"{facts['outputs']:,} of {facts['to']}{brdf}"
    if "engine" in facts:
        return f"{what} for {facts['engine']}"
    if "error" in facts:
        return f"{what}: {usage.flags(facts['error'])}"
    orders = [("F", "order_f"), *([("P", "order_p")] if facts["brdf"] else [])]
    said = [f"{sign} = {facts[name]}" for sign, name in orders if name in facts]
    said += [f"{facts['size']} texels"] if "size" in facts else []
    said.append(f"at most {facts['bytes']:,} bytes each")
    if (error := predicted_error(facts)) is not None:
        said.append(f"RMS error {error:.2%}")
    return f"{what}: {', '.join(said)} (as of {facts['probe']})"
