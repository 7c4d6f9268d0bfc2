"""`batch`: maps of many probes, made by processes here or by a cluster.

Those here are a pool, which is made anew when one of them dies: an image library that crashes takes
its whole process with it, and the pool of the standard library then gives up. Each worker is a
fresh process rather than a fork, so that libraries find no threads of the parent's in an odd state.
"""

import contextlib
import os
import signal
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import active_children, connection, get_context, parent_process
from types import FrameType
from typing import Any, TypeVar

from shrm_cli.batch.entry import Entry, checked
from shrm_cli.batch.job import by_probe
from shrm_cli.batch.log import Totals
from shrm_cli.batch.run import Workers, run
from shrm_cli.batch.work import Result, Terms
from shrm_cli.messages import several, whole_number
from shrm_cli.vocabulary import MAX_JOBS

_Returned = TypeVar("_Returned")

_GRACE = 2.0
"""Seconds that a process has to remove its temporary files after it was told to stop."""


class ProcessWorkers:
    """A pool of processes with one thread each. `executor` is another one after each `renew`."""

    def __init__(self, count: int) -> None:
        self.workers = count
        self.executor: Executor = self._pool()

    def _pool(self) -> ProcessPoolExecutor:
        return ProcessPoolExecutor(self.workers, get_context("spawn"), initializer=_begin)

    def submit(self, function: Callable[..., _Returned], *arguments: Any) -> Future[_Returned]:
        """Hand a call to a process.

        Raises BrokenExecutor if a process has died, and the pool is to be renewed.
        """
        with without_script(), _without_interrupts():
            return self.executor.submit(ending, function, *arguments)

    def is_lost(self, error: BaseException) -> bool:
        return isinstance(error, BrokenExecutor)

    def renew(self) -> None:
        """Make the pool anew, after a process died and took it along."""
        self.executor.shutdown(wait=True, cancel_futures=True)
        self.executor = self._pool()

    def stop(self, at_once: bool = False) -> None:
        """End all processes: when they have done what they are doing, or at once.

        What they have begun to write is removed.
        """
        children = active_children()
        if at_once:
            for child in children:
                child.terminate()
        self.executor.shutdown(wait=not at_once, cancel_futures=True)
        if at_once:
            connection.wait([child.sentinel for child in children], _GRACE)


@contextmanager
def without_script() -> Iterator[None]:
    """Context manager in which new processes do not run the script of this process first.

    Python has each fresh process do so, in case its tasks name something in it, which ours never
    do. A script that calls `batch` outside of ``if __name__ == "__main__":`` would begin again in
    each of them.
    """
    main = vars(sys.modules["__main__"])
    hidden = {name: main[name] for name in ("__file__", "__spec__") if main.get(name) is not None}
    main.update(dict.fromkeys(hidden))
    try:
        yield
    finally:
        main.update(hidden)


@contextmanager
def _without_interrupts() -> Iterator[None]:
    """Context manager in which new processes begin deaf to Ctrl-C, until `_begin` ignores it.

    A terminal sends it to all of them, and those that were still loading printed tracebacks.
    """
    if not hasattr(signal, "pthread_sigmask"):  # as on Windows
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _begin() -> None:
    """Prepare a worker: the terminal's Ctrl-C is for its parent, and it ends with its parent."""
    warnings.simplefilter("ignore")  # as in the process that began it: nobody knows its lines
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, _unwind)
    threading.Thread(target=_follow_parent, daemon=True).start()


class _Stopped(SystemExit):
    """A worker was told to stop in the middle of a task."""


_working = threading.Event()
"""Whether the process is in the middle of a task, whose temporary files are to be removed."""


def _unwind(number: int, frame: FrameType | None) -> None:
    if _working.is_set():
        raise _Stopped(128 + number)
    os._exit(128 + number)


def ending(function: Callable[..., _Returned], *arguments: Any) -> _Returned:
    """Call a function in a worker, and end the worker where it is told to stop meanwhile.

    The pool's own loop would take the exception for the result of the task, and go on.
    """
    _working.set()
    try:
        return function(*arguments)
    except _Stopped as stop:
        os._exit(int(stop.code or 1))
    finally:
        _working.clear()


def _follow_parent() -> None:
    """Stop this process when its parent has died, as it does when it is killed."""
    parent = parent_process()
    if parent is None:
        return
    connection.wait([parent.sentinel])
    with contextlib.suppress(OSError):
        os.kill(os.getpid(), signal.SIGTERM)  # the thread that works is to take it
    time.sleep(_GRACE)
    os._exit(1)


def batch(
    entries: Sequence[Entry] | Entry,
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
    entries : sequence of Entry, or one
        What is made.
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
    jobs = None if jobs is None else whole_number("jobs", jobs, 1, MAX_JOBS)
    chunks = by_probe(checked([job for entry in several(entries) for job in entry.jobs()]))
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

        with without_script(), cluster_executor(scheduler, jobs) as found:
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
