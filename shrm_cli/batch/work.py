"""What a worker does: it makes the maps of a probe, one after the other, and tells of each.

Nothing that goes wrong with one job stops the others: what a job tells is a record, a dictionary
as JSON has them, with what was made, or with the error.
"""

import os
import time
from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from shrm_cli import messages, settings
from shrm_cli.arrays import Array
from shrm_cli.batch.collect import What, lighting_of
from shrm_cli.batch.job import Chunk, Job, Recipe, Task
from shrm_cli.batch.made import MISSING, Difference, difference
from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.errors import ArgumentError, BrdfError, ShrmError
from shrm_cli.files import remote
from shrm_cli.files.whole import check_target, exists_error, protecting
from shrm_cli.maps import registry
from shrm_cli.maps.request import Request
from shrm_cli.maps.stored import store
from shrm_cli.prefilter import make
from shrm_cli.probe.open import open_probe
from shrm_cli.probe.probe import Probe
from shrm_cli.probe.shared import shared_if_held
from shrm_cli.progress import Progress, tell
from shrm_cli.records import record
from shrm_cli.vocabulary import EXPORT

Record = dict[str, Any]
"""What is told of a job; `docs/batch.md` lists the keys."""

_ERRORS = "predicted_error", "filter_error", "lamp_error"
_SAID = ("size", "order_f", "order_p", "order_carried", *_ERRORS)
"""What a record takes over from the summary of a map."""
_FORCED = Difference("asked for by `force`")


@record
class Gathering:
    """The coefficients that are gathered of all probes."""

    order: int
    """The largest degree."""
    what: What
    window: str
    """The window, as irradiance takes it."""


@record
class Terms:
    """What holds for all jobs of a run.

    Attributes
    ----------
    force : bool
        Whether outputs are made anew that are there already.
    only_looks : bool
        Whether to tell what would be made, and to make nothing.
    cache : bool or Path
        As `Settings` has it.
    gathering : Gathering, optional
        What is gathered of the probes whose chunks collect.

    Examples
    --------
    >>> entry = shrm.Entry(("probes/studio.exr",), to=("irradiance",))
    >>> shrm.batch([entry], jobs=1, terms=shrm.Terms(only_looks=True)).made
    0
    """

    force: bool = False
    only_looks: bool = False
    cache: bool | Path = True
    gathering: Gathering | None = None

    def __post_init__(self) -> None:
        messages.check_fields(self)


@record(eq=False)
class Result:
    """What a worker hands back of one probe."""

    probe: str
    records: list[Record]
    """One for each job, in order."""
    coefficients: Array | None = None
    """Where they are gathered, shape ((order+1)^2, 3)."""
    digest: str = ""
    """SHA-256 of the probe's bytes, where its coefficients are gathered."""
    error: str = ""
    """Why there are no coefficients, where they should be gathered."""


def bake(task: Task, terms: Terms) -> list[Result]:
    """Do the jobs of some probes, and return the result of each chunk, in order."""
    with settings.using(threads=1, cache=terms.cache):
        return [_of_probe(chunk, terms) for chunk in task]


def _of_probe(chunk: Chunk, terms: Terms) -> Result:
    """Do the jobs of one probe, which is fetched once."""
    start = time.perf_counter()
    try:
        with local_file(chunk.probe) as path, protecting():
            return _naming_source(chunk.probe, str(path), _of_file(chunk, path, terms, start))
    except Exception as error:  # whatever is wrong with one probe must not stop the others
        return _all_failed(chunk, error, start)


def _of_file(chunk: Chunk, path: Path, terms: Terms, start: float) -> Result:
    """Do the jobs of one probe, which is opened once, and gather its coefficients if wanted."""
    try:
        probe = shared_if_held(open_probe(path, **chunk.reading))
    except Exception as error:
        return _all_failed(chunk, error, start)
    records = []
    for job in chunk.jobs:
        records.append(_record(job, probe, terms, start))
        start = time.perf_counter()
    wanted = terms.gathering
    if wanted is None or not chunk.collects:
        return Result(chunk.probe, records)
    try:
        found = lighting_of(probe, wanted.order, wanted.what, wanted.window)
    except ShrmError as error:
        return Result(chunk.probe, records, error=error_line(error))
    return Result(chunk.probe, records, found, probe.digest())


def _all_failed(chunk: Chunk, error: Exception, start: float) -> Result:
    """Return the result of a chunk whose probe cannot be used."""
    line = error_line(error)
    failed = [failure(job, line, time.perf_counter() - start) for job in chunk.jobs]
    return Result(chunk.probe, failed, error=line)


def _record(job: Job, probe: Probe, terms: Terms, start: float) -> Record:
    """Do a job, and return its record, or that of its failure."""
    try:
        found = _do(job, probe, terms)
    except Exception as error:  # a job that goes wrong must not take the others with it
        return failure(job, error_line(error), time.perf_counter() - start)
    return {**_named(job, time.perf_counter() - start), **found}


def _do(job: Job, probe: Probe, terms: Terms) -> Record:
    """Make a map, unless it is there already."""
    is_export = job.recipe.to == EXPORT
    request = None if is_export else request_of(job.recipe, probe)
    found = _FORCED if terms.force else _difference(job, probe, request)
    if found is None:
        return {"status": "skipped"}
    if request is not None and os.path.isdir(job.output):
        check_target(job.output)  # which says that it is a directory, which no `force` replaces
    if not found.is_ours:
        raise exists_error(messages.shown(job.output), found.why)
    if terms.only_looks:
        return {"status": "waiting", "why": found.why}
    if request is None:
        from shrm_cli.batch.exports import make_folder as exported  # plain batches export nothing

        told = exported(job, probe, terms.force)
        warnings = [*probe.report.warnings(), *told["warnings"]]
        return {"status": "made", "why": found.why, **told, "warnings": warnings}
    is_local = not messages.is_remote(job.output)
    if is_local:
        check_target(job.output, makes_folder=True)  # a map may take minutes, and there may be many
    made = make(probe, request)
    if is_local:
        Path(job.output).parent.mkdir(parents=True, exist_ok=True)
    with remote.written(job.output) as target:
        stored = store(target, made.map, job.recipe.precision)
        size = os.path.getsize(target)
    summary = made.quick_summary()
    return {
        "status": "made",
        "why": found.why,
        "bytes": size,
        **{name: summary[name] for name in _SAID if name in summary},
        "storage_error": stored.error,
        "precision": stored.pixel_type,
        "warnings": [*probe.report.warnings(), *made.warnings],
    }


def _difference(job: Job, probe: Probe, request: Request | None) -> Difference | None:
    """Say in what a job's output differs from what this program would write; None in nothing."""
    if request is None:
        from shrm_cli.batch.exports import difference as difference_of_export

        return difference_of_export(job, probe)
    output, recipe = job.output, job.recipe
    is_there = remote.exists(output) if messages.is_remote(output) else os.path.lexists(output)
    if not is_there:
        return MISSING
    with local_file(output) as path:
        sources = registry.sources(request.to)
        return difference(path, probe, request, recipe.precision, sources)


def local_file(name: str) -> AbstractContextManager[Path]:
    """Return a context manager of the path of a file: that of a copy, where it lies elsewhere."""
    return remote.fetched(name) if messages.is_remote(name) else nullcontext(Path(name))


def request_of(recipe: Recipe, probe: Probe) -> Request:
    """Return what a recipe asks of a probe, the BRDF with the probe's primaries."""
    if recipe.brdf is None:
        return Request.of(recipe.to, recipe.arguments, probe)
    material = _material(recipe.brdf, recipe.runs_code, probe.chromaticities)
    return Request.of(recipe.to, {**recipe.arguments, "brdf": material}, probe)


@lru_cache(64)
def _material(spec: str, runs_code: bool, primaries: tuple[float, ...] | None) -> Brdf:
    """Return the BRDF of a specification, so that a process reads measured files once."""
    return parse_spec(spec, run_code=runs_code, primaries=primaries)


def failure(job: Job, line: str, seconds: float = 0.0) -> Record:
    """Return the record of a job that failed, with one line about why."""
    return {**_named(job, seconds), "status": "failed", "error": line}


def _named(job: Job, seconds: float) -> Record:
    """Return what every record begins with."""
    return {
        "output": messages.shown(job.output),
        "probe": messages.shown(job.probe),
        "brdf": job.recipe.brdf,
        "to": job.recipe.to,
        **({"engine": job.recipe.arguments["engine"]} if job.recipe.to == EXPORT else {}),
        "seconds": round(seconds, 4),
    }


def error_line(error: BaseException) -> str:
    """Return an error as one line, in which no URL lets anybody in."""
    line = f"internal error, please report it ({type(error).__name__}: {error})"
    if isinstance(error, ShrmError):
        line = str(error)
    elif isinstance(error, MemoryError):
        line = "out of memory; run fewer `jobs`, or lower `size` or the orders"
    elif isinstance(error, OSError) and error.strerror:
        line = f"{error.filename or 'a file'}: {error.strerror}"
    return messages.shown(line)


def _naming_source(name: str, path: str, result: Result) -> Result:
    """Return a result in which the path of a copy is the name of what was copied."""
    if path == name:
        return result
    said = messages.shown(name)
    records = [
        {
            key: value.replace(path, said) if key in ("error", "why") else value
            for key, value in record.items()
        }
        for record in result.records
    ]
    return replace(result, records=records, error=result.error.replace(path, said))


# ---- predictions from the maps of single probes --------------------------------------------------

_HALF = 2  # bytes
_TRIED = 5
"""The most probes of which a map is tried: the first ones may be damaged."""
_PREDICTED = ("size", "maps", "order_f", "order_p", "order_carried", *_ERRORS)


Predictions = tuple[list[dict[str, Any]], dict[str, str]]


def predictions(chunks: Sequence[Chunk], progress: Progress | None = None) -> Predictions:
    """Tell what the outputs of each recipe will be like, by the map of the first sound probe.

    Orders that a tolerance of the BRDF's energy chooses are the same for all probes. Where an
    error of the reflected light chooses them, those of other probes may differ.

    Returns for each recipe the form, the BRDF, the number of outputs, the probe; what the summary
    of its map has of its size, its orders and its error; and under ``bytes`` what the map's values
    take in half precision, about the most that its file takes. Where no map could be made, there is
    ``error`` in place of these. Beside them returns why recipes are refused whatever the probe is,
    by their texts.
    """
    jobs: dict[str, list[Job]] = {}
    for chunk in chunks:
        for job in chunk.jobs:
            jobs.setdefault(repr(job.recipe), []).append(job)
    found, refused = [], {}
    for text, alike in jobs.items():
        try:
            predicted = _first_sound(alike)
        except (ArgumentError, BrdfError) as error:
            refused[text] = str(error)
            predicted = {**_of(alike[0]), "probe": alike[0].probe, "error": str(error)}
        found.append({**predicted, "outputs": len(alike)})
        tell(progress, len(found), len(jobs))
    return found, refused


def _of(job: Job) -> dict[str, Any]:
    return {"to": job.recipe.to, "brdf": job.recipe.brdf}


def _first_sound(jobs: Sequence[Job]) -> dict[str, Any]:
    """Predict the outputs of jobs of one recipe.

    Raises ArgumentError or BrdfError if it is refused whatever the probe is.
    """
    named = _of(jobs[0])
    if jobs[0].recipe.to == EXPORT:
        return {**named, "engine": jobs[0].recipe.arguments["engine"]}
    error = ""
    for job in jobs[:_TRIED]:
        try:
            return {**named, "probe": job.probe, **_predicted(job)}
        except (ArgumentError, BrdfError):
            raise
        except ShrmError as failure:
            error = error or str(failure)
    return {**named, "probe": jobs[0].probe, "error": error}


def _predicted(job: Job) -> dict[str, Any]:
    """Make the map of a job in memory, and tell its orders and its size."""
    with local_file(job.probe) as path:
        probe = shared_if_held(open_probe(path, **job.reading))
        made = make(probe, request_of(job.recipe, probe))
    values = sum(plane.size for part in made.map.encode() for plane in part.channels.values())
    summary = made.quick_summary()
    return {name: summary[name] for name in _PREDICTED if name in summary} | {
        "bytes": _HALF * values
    }
