"""One output of a batch, and the outputs of one probe that are made together."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from shrm_cli.records import record
from shrm_cli.vocabulary import Precision


@record
class Recipe:
    """How a map is made of any probe."""

    to: str
    """The representation, or ``export``."""
    brdf: str | None
    """The specification of the BRDF; None for representations that need none."""
    arguments: Mapping[str, Any]
    """The other arguments of `shrm_cli.prefilter.prefilter` that are given, by name; of exports
    those that `batch.exports` names."""
    precision: Precision = "auto"
    """The pixel type of the file."""
    runs_code: bool = False
    """Whether the specification may name a Python file, which is run."""


@record
class Job:
    """One output: a probe, what is made of it, and the file."""

    probe: str
    """The path of the probe, or its URL."""
    reading: Mapping[str, Any]
    """Keywords of `shrm_cli.probe.open.open_probe`."""
    recipe: Recipe
    """Jobs share the recipes that they have in common."""
    output: str
    """The path of the map, or its URL; of an export its folder."""


@record
class Chunk:
    """Jobs of the same probe, read in the same way, which a worker does one after the other."""

    probe: str
    reading: Mapping[str, Any]
    jobs: tuple[Job, ...]
    collects: bool = False
    """Whether the coefficients of the probe are gathered too."""

    def parts(self, size: int) -> "list[Chunk]":
        """Cut the chunk into parts of `size` jobs; the first one collects."""
        starts = range(0, len(self.jobs), size)
        return [
            Chunk(self.probe, self.reading, self.jobs[k : k + size], self.collects and k == 0)
            for k in starts
        ] or [self]


Task = tuple[Chunk, ...]
"""What a worker is given at a time."""


def by_probe(jobs: Iterable[Job]) -> list[Chunk]:
    """Gather the jobs of each probe, in the order of their first ones."""
    found: dict[tuple[str, str], list[Job]] = {}
    for job in jobs:
        found.setdefault((job.probe, repr(job.reading)), []).append(job)
    return [Chunk(each[0].probe, each[0].reading, tuple(each)) for each in found.values()]


def cut_for_workers(chunks: Sequence[Chunk], workers: int) -> list[Chunk]:
    """Cut chunks into parts of equal length where they are fewer than the workers."""
    if not chunks or len(chunks) >= workers:
        return list(chunks)
    parts = -(-workers // len(chunks))
    return [part for each in chunks for part in each.parts(max(1, -(-len(each.jobs) // parts)))]
