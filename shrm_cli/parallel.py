"""Work in threads, whose results do not depend on how many threads there are.

Whoever splits work into jobs must do so by the work alone, and add up results in the order of the
jobs: then the same bytes come out whatever the number of threads is. numpy computes without
Python's lock, so that threads suffice.
"""

import contextvars
import os
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, TypeVar

from shrm_cli import progress, settings

if TYPE_CHECKING:
    from concurrent.futures import Future

Job = TypeVar("Job")
Result = TypeVar("Result")


def in_order(
    work: Callable[[Job], Result], jobs: Sequence[Job], is_large: bool = True
) -> Iterator[Result]:
    """Call a function with each job, several at a time, and yield the results in their order.

    No more results than twice the number of threads wait to be taken, so that they never fill the
    memory. Within a job there is one thread, lest pools within pools multiply.

    Parameters
    ----------
    work : callable
        Called with a job. Calls at the same time must not disturb each other.
    jobs : sequence
    is_large : bool
        Whether all jobs together take longer than some milliseconds; else no threads are started,
        which takes that long.

    Yields
    ------
    Whatever `work` returns.

    Raises
    ------
    Whatever `work` raises; jobs that have not begun are then left out.
    """
    threads = min(settings.current().threads or os.cpu_count() or 1, len(jobs))
    if threads <= 1 or not is_large:
        yield from map(work, jobs)
        return
    # Small runs start no threads, and are spared the loading of this module.
    from concurrent.futures import ThreadPoolExecutor

    def alone(job: Job) -> Result:
        with settings.using(threads=1), progress.using(None):
            return work(job)

    pool = ThreadPoolExecutor(threads)
    waiting: deque[Future[Result]] = deque()
    try:
        for job in jobs:
            # Threads inherit no context variables, of settings as of numpy's warnings.
            waiting.append(pool.submit(contextvars.copy_context().run, alone, job))
            if len(waiting) == 2 * threads:
                yield waiting.popleft().result()
        while waiting:
            yield waiting.popleft().result()
    finally:
        pool.shutdown(cancel_futures=True)


def at_once(work: Callable[[Job], object], jobs: Sequence[Job], is_large: bool = True) -> None:
    """Call a function with each job, several at a time, for what it writes.

    No two jobs may write to the same place.

    Parameters
    ----------
    work, jobs, is_large
        As `in_order` takes them.
    """
    for _ in in_order(work, jobs, is_large):
        pass
