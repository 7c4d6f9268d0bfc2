"""Handing tasks to workers, and taking back what they tell, whatever becomes of them.

All workers are executors of the standard library: a pool of processes, or a cluster. No more tasks
are handed out than keep the workers busy, so that memory does not grow with the number of jobs.
"""

import itertools
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, wait
from statistics import median
from typing import Any, Protocol

from shrm_cli.batch.job import Chunk, Task, cut_for_workers
from shrm_cli.batch.work import Result, Terms, bake, failure

_AHEAD = 2
"""Tasks that are handed out for each worker, so that none waits for the next one."""
_LATE = 5.0
"""Seconds that tasks have to end after Ctrl-C."""
_LOST = (
    "the process that worked on it died, as of a crash in an image library or for lack of memory; "
    "leave it out, or export it again"
)
_TASK_SECONDS = 0.5
"""What a task takes at least on a cluster, if there are probes enough."""
_WORKER_SECONDS = 0.02
"""The same for each worker of the cluster, whose scheduler takes some 5 ms for a task
(docs/scale.md), and is then busy for a quarter of the time."""
_MOST_TOGETHER = 256
"""The most probes of a task, which are lost together with their worker."""
_RECENT = 20
"""The results from which is estimated how long the next ones will take."""


class Workers(Protocol):
    """Who does the tasks; `batch.ProcessWorkers` is one."""

    @property
    def workers(self) -> int:
        """The number of tasks that are worked on at a time."""

    def submit(self, function: Callable[..., Any], *arguments: Any) -> "Future[Any]": ...

    def is_lost(self, error: BaseException) -> bool:
        """Whether an error means that the process died in the middle of a task."""

    def renew(self) -> None:
        """Go on after that."""


Tell = Callable[[Result], object]


def run(
    chunks: list[Chunk], workers: Workers, terms: Terms, tell: Tell, is_remote: bool = False
) -> None:
    """Do the jobs of many probes.

    The jobs of the first probe come first, shared by the workers, and the others when these are
    done: then the coefficients of BRDFs are in the cache, and are not computed by all workers at
    once.

    `tell` is called with each result, as soon as it is known, in no certain order. `is_remote`
    tells whether handing out a task is slow, so that tasks are made longer.

    Raises KeyboardInterrupt: after what was being done, if it ended soon, has been told.
    """
    seconds = max(_TASK_SECONDS, _WORKER_SECONDS * workers.workers) if is_remote else 0.0
    feeder = _Feeder(workers, terms, tell, seconds)
    feeder.feed(feeder.tasks(cut_for_workers(chunks[:1], workers.workers)))
    feeder.feed(feeder.tasks(cut_for_workers(chunks[1:], workers.workers)))
    feeder.retry()


class _Feeder:
    """Hands out tasks and takes back results.

    `tell` is called with each result. `seconds` is how long a task should take, if that needs
    several probes.
    """

    def __init__(self, workers: Workers, terms: Terms, tell: Tell, seconds: float) -> None:
        self._workers, self._terms, self._tell = workers, terms, tell
        self._wanted = seconds
        self._recent: deque[float] = deque([seconds], _RECENT)
        self._pending: dict[Future[list[Result]], Task] = {}
        self._suspects: list[Task] = []

    def tasks(self, chunks: Sequence[Chunk]) -> Iterator[Task]:
        """Gather chunks in tasks that take as long as they should, as far as that is known."""
        waiting = iter(chunks)
        most = min(_MOST_TOGETHER, -(-len(chunks) // (_AHEAD * self._workers.workers)))
        while True:
            each = median(self._recent)
            count = min(int(self._wanted / each), most) if each > 0 else 1
            task = tuple(itertools.islice(waiting, max(1, count)))
            if not task:
                return
            yield task

    def feed(self, tasks: Iterable[Task]) -> None:
        """Do tasks, a few of them at a time.

        Those whose worker died are kept for `retry`.
        """
        waiting = iter(tasks)
        window = _AHEAD * self._workers.workers
        try:
            while True:
                for task in itertools.islice(waiting, window - len(self._pending)):
                    self._hand_out(task)
                if not self._pending:
                    return
                done, _ = wait(self._pending, return_when=FIRST_COMPLETED)
                self._suspects += self._taken_back(done)
        except KeyboardInterrupt:  # take back what has not begun, and wait a little for what has
            for future in list(self._pending):
                if future.cancel():
                    del self._pending[future]
            self._taken_back(wait(self._pending, _LATE).done)
            raise

    def retry(self) -> None:
        """Do the jobs whose worker died, one by one, so that one that kills it is found out."""
        suspects, self._suspects = self._suspects, []
        jobs = (part for task in suspects for each in task for part in each.parts(1))
        for chunk in jobs:
            self.feed([(chunk,)])
            if self._suspects:
                self._suspects.clear()
                records = [failure(job, _LOST) for job in chunk.jobs]
                self._tell(Result(chunk.probe, records, error=_LOST if chunk.collects else ""))

    def _hand_out(self, task: Task) -> None:
        try:
            future = self._workers.submit(bake, task, self._terms)
        except BrokenExecutor:
            self._workers.renew()
            future = self._workers.submit(bake, task, self._terms)
        self._pending[future] = task

    def _taken_back(self, done: Iterable["Future[list[Result]]"]) -> list[Task]:
        """Tell the results of finished tasks, and return the tasks whose worker died."""
        lost = []
        for future in done:
            task = self._pending.pop(future)
            error = future.exception()
            if error is None:
                for result in future.result():
                    self._recent.append(sum(record["seconds"] for record in result.records))
                    self._tell(result)
            elif self._workers.is_lost(error):
                lost.append(task)
            else:
                raise error
        return lost
