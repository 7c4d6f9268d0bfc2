"""`batch`: maps of many probes, made by processes here or by a cluster."""

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

from shrm_cli.batch.entry import Entry, checked
from shrm_cli.batch.job import by_probe
from shrm_cli.batch.log import Totals
from shrm_cli.batch.pool import ProcessWorkers
from shrm_cli.batch.run import Workers, run
from shrm_cli.batch.work import Result, Terms


def batch(
    entries: Sequence[Entry],
    *,
    jobs: int | None = None,
    scheduler: str | None = None,
    terms: Terms | None = None,
    tell: Callable[[Result], object] | None = None,
) -> Totals:
    """Make maps of many probes; what is there already, whole and made alike, is skipped.

    Each process may take as many threads for products of matrices as its environment says; set
    ``OPENBLAS_NUM_THREADS`` to 1 before, as the command does.

    Parameters
    ----------
    entries : sequence of Entry
        What is made. A program that starts processes must do so below ``if __name__ ==
        "__main__":``.
    jobs : int, optional
        Processes that work at a time; by default as many as there are processors.
    scheduler : str, optional
        The address of a dask.distributed cluster that works instead.
    terms : Terms, optional
        Whether outputs are made again, or only looked at.
    tell : callable, optional
        Called with the `Result` of each probe, in no certain order.

    Returns
    -------
    Totals

    Raises
    ------
    ArgumentError, OutputError, ProbeError
        If something is wrong with all of it; what is wrong with one probe is told in the totals.

    Examples
    --------
    >>> entry = shrm.Entry(("probes/studio.exr",), to=("irradiance",))
    >>> shrm.batch([entry], jobs=1, terms=shrm.Terms(only_looks=True)).waiting
    1
    """
    chunks = by_probe(checked([job for entry in entries for job in entry.jobs()]))
    totals = Totals(sum(len(chunk.jobs) for chunk in chunks))

    def take(result: Result) -> None:
        totals.add_result(result)
        if tell is not None:
            tell(result)

    with workers(jobs, scheduler) as (found, is_remote):
        run(chunks, found, terms or Terms(), take, is_remote)
    return totals


@contextmanager
def workers(
    jobs: int | None = None, scheduler: str | None = None
) -> Iterator[tuple[Workers, bool]]:
    """Yield the workers: processes here, or a cluster, and whether they are the latter."""
    if scheduler is not None:
        from shrm_cli.batch.cluster import cluster_executor

        with cluster_executor(scheduler, jobs) as found:
            yield found, True
        return
    pool = ProcessWorkers(jobs or _processors())
    try:
        yield pool, False
    except BaseException:
        pool.stop(at_once=True)
        raise
    pool.stop()


def _processors() -> int:
    """Return how many processors this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
