"""Workers on this machine: a pool of processes, which is made anew when one of them dies.

An image library that crashes takes its whole process with it, and the pool of the standard library
then gives up. Each worker is a fresh process rather than a fork, so that libraries find no threads
of the parent's in an odd state.
"""

import contextlib
import os
import signal
import threading
import time
import warnings
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor
from multiprocessing import active_children, connection, get_context, parent_process
from types import FrameType
from typing import Any, TypeVar

Result = TypeVar("Result")

_GRACE = 2.0
"""Seconds that a process has to remove its temporary files after it was told to stop."""


class ProcessWorkers:
    """A pool of processes with one thread each.

    `count` is the number of processes.

    Attributes
    ----------
    executor : concurrent.futures.Executor
        Another one after each `renew`.
    workers : int
    """

    def __init__(self, count: int) -> None:
        self.workers = count
        self.executor: Executor = self._pool()

    def _pool(self) -> ProcessPoolExecutor:
        return ProcessPoolExecutor(self.workers, get_context("spawn"), initializer=_begin)

    def submit(self, function: Callable[..., Result], *arguments: Any) -> Future[Result]:
        """Hand a call to a process.

        Raises BrokenExecutor if a process has died, and the pool is to be renewed.
        """
        return self.executor.submit(ending, function, *arguments)

    def is_lost(self, error: BaseException) -> bool:
        """Whether an error means that the process died in the middle of a task."""
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


def ending(function: Callable[..., Result], *arguments: Any) -> Result:
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
