"""What the outputs of a batch will be like, from the maps of single probes."""

from collections.abc import Sequence
from typing import Any

from shrm_cli.batch.job import Chunk, Job
from shrm_cli.batch.work import local_file, request_of
from shrm_cli.errors import ShrmError
from shrm_cli.prefilter import make
from shrm_cli.probe.open import open_probe
from shrm_cli.probe.shared import shared
from shrm_cli.progress import Progress
from shrm_cli.vocabulary import EXPORT

_HALF = 2  # bytes
_TRIED = 5
"""The most probes of which a map is tried: the first ones may be damaged."""
_SAID = ("size", "maps", "order_f", "order_p", "order_carried", "predicted_error")


def predictions(chunks: Sequence[Chunk], progress: Progress | None = None) -> list[dict[str, Any]]:
    """Tell what the outputs of each recipe will be like, by the map of the first sound probe.

    Orders that a tolerance of the BRDF's energy chooses are the same for all probes. Where an
    error of the reflected light chooses them, those of other probes may differ.

    Returns for each recipe the form, the BRDF, the number of outputs, the probe; what the summary
    of its map has of its size, its orders and its error; and under ``bytes`` what the map's values
    take in half precision, about the most that its file takes. Where no map could be made, there is
    ``error`` in place of these.
    """
    jobs: dict[str, list[Job]] = {}
    for chunk in chunks:
        for job in chunk.jobs:
            jobs.setdefault(repr(job.recipe), []).append(job)
    found = []
    for alike in jobs.values():
        found.append({**_first_sound(alike), "outputs": len(alike)})
        if progress is not None:
            progress(len(found), len(jobs))
    return found


def _first_sound(jobs: Sequence[Job]) -> dict[str, Any]:
    """Predict the outputs of jobs of one recipe."""
    named = {"to": jobs[0].recipe.to, "brdf": jobs[0].recipe.brdf}
    if jobs[0].recipe.to == EXPORT:
        return {**named, "engine": jobs[0].recipe.arguments["engine"]}
    error = ""
    for job in jobs[:_TRIED]:
        try:
            return {**named, "probe": job.probe, **_predicted(job)}
        except ShrmError as failure:
            error = error or str(failure)
    return {**named, "probe": jobs[0].probe, "error": error}


def _predicted(job: Job) -> dict[str, Any]:
    """Make the map of a job in memory, and tell its orders and its size."""
    with local_file(job.probe) as path:
        probe = shared(open_probe(path, **job.reading))
        made = make(probe, request_of(job.recipe, probe))
    values = sum(plane.size for part in made.map.encode() for plane in part.channels.values())
    summary = made.quick_summary()
    return {name: summary[name] for name in _SAID if name in summary} | {"bytes": _HALF * values}
