"""Long work: how it tells how far it has come, and threads that share it.

Who wants to know is a setting of the context, as the number of threads is: what computes calls
`report`, and whoever starts it says by `using` who is told. Jobs in threads tell nobody.

Whoever splits work into jobs must do so by the work alone, and add up results in the order of the
jobs: then the same bytes come out whatever the number of threads is. numpy computes without
Python's lock, so that threads suffice.
"""

import contextvars
import os
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextvars import ContextVar, Token
from typing import TYPE_CHECKING, Protocol, TypeVar, runtime_checkable

from shrm_cli import settings

if TYPE_CHECKING:
    from concurrent.futures import Future

Progress = Callable[[int, int], object]
"""A callable that takes the amount done and the amount in all, in whatever unit suits the work."""


@runtime_checkable
class Timed(Protocol):
    """A progress callable that can also be told how long the work will take from now on."""

    def __call__(self, done: int, total: int) -> object: ...

    def tell_time_left(self, seconds: float) -> None:
        """Tell about how many seconds the rest of the work will take."""


_current: ContextVar[Progress | None] = ContextVar("shrm_cli.progress", default=None)


class using:
    """Context manager within which a progress callable is told, or nobody where it is None."""

    def __init__(self, progress: Progress | None) -> None:
        self._progress = progress
        self._tokens: list[Token[Progress | None]] = []

    def __enter__(self) -> None:
        self._tokens.append(_current.set(self._progress))

    def __exit__(self, *_: object) -> None:
        _current.reset(self._tokens.pop())


def current() -> Progress | None:
    """Return who is told here and now."""
    return _current.get()


def tell(progress: Progress | None, done: int, total: int) -> None:
    """Tell somebody how far the work has come, or nobody."""
    if progress is not None:
        progress(done, total)


def report(done: int, total: int) -> None:
    """Tell who is told here how far the work has come."""
    tell(current(), done, total)


def tell_time_left(seconds: float) -> None:
    """Tell about how long the work will take from now on, if the progress is `Timed`."""
    _tell_time_left(current(), seconds)


def _tell_time_left(progress: Progress | None, seconds: float) -> None:
    if isinstance(progress, Timed):
        progress.tell_time_left(seconds)


_STEPS = 1000
"""The number of steps in which the progress within one stage is reported."""
_SHARE = 0.25
"""The part of what is left that a stage takes, where the number of stages is not known."""
_CREEP = 0.02
"""The part of what is left that a report takes which says no more than the one before it."""


class Stages:
    """The progress of work in stages of equal length, each of which reports its own progress.

    Both methods are progress callables: `done` is called for whole stages, and `within` for the
    stage that is being worked on. What is told never falls, even where a stage begins anew within.

    Work beyond the last stage takes hardly any time and is not shown.
    """

    def __init__(self, progress: Progress | None, total: int) -> None:
        self._progress, self._total, self._finished, self._told = progress, total, 0, 0

    def done(self, done: int, total: int) -> None:
        """Report that `done` stages are finished; `total` is not used."""
        self._finished = min(done, self._total)
        self._show(0)

    def within(self, done: int, total: int) -> None:
        """Report that `done` of `total` units of the present stage are finished."""
        self._show(_STEPS * done // total if self._finished < self._total else 0)

    def tell_time_left(self, seconds: float) -> None:
        _tell_time_left(self._progress, seconds)

    def _show(self, steps: int) -> None:
        if self._progress is not None:
            self._told = max(self._told, _STEPS * self._finished + steps)
            self._progress(self._told, _STEPS * self._total)


class Rising:
    """The progress of work whose number of stages is not known before it ends.

    Every stage reports its own progress to the object, from little to all of it. What is told never
    falls: each stage takes a quarter of what its predecessors left. A stage that underrates its
    work reports the same for a while; such reports move on by little.
    """

    def __init__(self, progress: Progress | None) -> None:
        self._progress = progress
        self._before = self._within = self._told = 0.0

    def __call__(self, done: int, total: int) -> None:
        """Report that `done` of `total` units of a stage are finished; fewer begin another one."""
        within = done / total if total else 1.0
        if within == self._within:
            # Not into what is left to the stages after it, however often it reports the same.
            end = self._before + 2 * _SHARE * (1 - self._before)
            self._tell(self._told + _CREEP * max(end - self._told, 0))
            return
        if within < self._within:
            self._before = self._told
        self._within = within
        self._tell(max(self._told, self._before + _SHARE * (1 - self._before) * within))

    def tell_time_left(self, seconds: float) -> None:
        _tell_time_left(self._progress, seconds)

    def end(self) -> None:
        """Report that all work is done."""
        self._tell(1.0)

    def _tell(self, part: float) -> None:
        self._told = part
        if self._progress is not None:
            self._progress(int(_STEPS * part), _STEPS)


Job = TypeVar("Job")
Result = TypeVar("Result")


def in_order(
    work: Callable[[Job], Result], jobs: Sequence[Job], do_threads_pay: bool = True
) -> Iterator[Result]:
    """Call a function with each job, several at a time, and yield the results in their order.

    No more results than twice the number of threads wait to be taken, so that they never fill the
    memory. Within a job there is one thread, lest pools within pools multiply.

    Calls at the same time must not disturb each other. `do_threads_pay` tells whether threads are
    worth their start, of some milliseconds, and do not wait for one another, as those of many short
    calls of numpy do; else none are started.

    Raises whatever `work` raises; jobs that have not begun are then left out.
    """
    threads = min(settings.current().threads or os.cpu_count() or 1, len(jobs))
    if threads <= 1 or not do_threads_pay:
        yield from map(work, jobs)
        return
    # Small runs start no threads, and are spared the loading of this module.
    from concurrent.futures import ThreadPoolExecutor

    def alone(job: Job) -> Result:
        with settings.using(threads=1), using(None):
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


def at_once(
    work: Callable[[Job], object], jobs: Sequence[Job], do_threads_pay: bool = True
) -> None:
    """Call a function with each job, several at a time, for what it writes.

    No two jobs may write to the same place.
    """
    for _ in in_order(work, jobs, do_threads_pay):
        pass
