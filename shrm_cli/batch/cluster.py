"""Workers of a cluster: `dask.distributed` hands tasks to other machines, and repeats lost ones.

The packages of the extra `cluster` are imported when a cluster is asked for. A scheduler's address,
such as ``tcp://host:8786``, leads to a cluster that runs already, and ``local`` starts one on this
machine. What either does is handed back as futures of the standard library.

Dask runs whatever anybody sends to its ports, and every user of a machine reaches those of its
loopback address. So what is started here talks in TLS, by a certificate that is made for it, kept
in memory and asked of everybody who connects, and nothing but that listens.
"""

import asyncio
import contextlib
import gc
import logging
import os
import pkgutil
import signal
import sysconfig
import warnings
import weakref
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, Future
from typing import Any, TypeVar

from shrm_cli import __version__
from shrm_cli.errors import ClusterError
from shrm_cli.extras import install
from shrm_cli.messages import shown_reason

Result = TypeVar("Result")

LOCAL = "local"
"""The address that asks for a cluster on this machine."""

_PATIENCE = 15.0
"""Seconds within which a scheduler must answer, and within which one worker at least must join."""
_AWAY = (
    "the cluster went away before all was done; start it again, and give the same command: what is "
    "made already is skipped"
)
_ONE_THREAD = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENIMAGEIO_THREADS")
"""Variables that keep libraries to one thread, if they are set before the libraries load."""


class ClusterWorkers:
    """The workers of a cluster, as `cluster_executor` yields them.

    `workers` is the number of tasks that are worked on at a time: the threads of all workers.
    """

    def __init__(self, client: Any) -> None:
        self.client = client
        self.workers: int = sum(client.nthreads().values())
        self._remote: weakref.WeakSet[Any] = weakref.WeakSet()

    def submit(self, function: Callable[..., Result], *arguments: Any) -> Future[Result]:
        """Hand a call to the cluster."""
        try:
            remote = self.client.submit(function, *arguments, pure=False)
        except Exception as error:
            raise ClusterError(f"{_AWAY} ({_line(error)})") from error
        self._remote.add(remote)
        future: Future[Result] = Future()
        future.add_done_callback(lambda done: remote.cancel() if done.cancelled() else None)
        self.client.loop.add_callback(_hand_on, remote, future)
        return future

    def cancel(self) -> None:
        """Cancel what has not begun; a scheduler that went away cannot be told any more."""
        with contextlib.suppress(Exception):
            self.client.cancel(list(self._remote))

    def is_lost(self, error: BaseException) -> bool:
        """Whether an error means that workers died in the middle of a task, again and again.

        Dask repeats what a dead worker had to do, and gives a task up when the fourth worker that
        had it dies. A task that waited beside one that kills its workers may be given up as well,
        so a task that is lost should be done once more, alone.
        """
        from distributed import KilledWorker

        return isinstance(error, KilledWorker)

    def renew(self) -> None:
        """Go on after a worker's death: the cluster has started another one by itself."""


async def _hand_on(remote: Any, future: Future[Any]) -> None:
    """Give a future of the standard library what becomes of a task of the cluster.

    The executor of dask does the same, but looks once more at how a task fares when it has the
    result already. A worker that has died in between makes an error of a number that is at hand.
    """
    try:
        result = await remote
    except (CancelledError, asyncio.CancelledError):
        future.cancel()
        future.set_running_or_notify_cancel()
    except BaseException as error:
        if future.set_running_or_notify_cancel():
            future.set_exception(error)
    else:
        if future.set_running_or_notify_cancel():
            future.set_result(result)


@contextlib.contextmanager
def cluster_executor(scheduler: str, jobs: int | None = None) -> Iterator[ClusterWorkers]:
    """Context manager that connects to a cluster, or starts one on this machine.

    `scheduler` is the address of a scheduler, or ``local``. `jobs` is the number of workers of a
    local cluster, each a process with one thread; by default as many as there are processors. An
    existing cluster has as many as it has.

    Tasks that have not begun when the block ends are cancelled.

    Raises ClusterError if dask is not installed, nobody answers at the address, no worker joins, or
    the workers have other versions of `shrm` or of Python. Also if the scheduler goes away: dask
    cancels all tasks then, and the CancelledError that their results raise in the block becomes
    one.
    """
    try:
        import distributed
    except ImportError as error:
        raise ClusterError(
            f"scheduler {scheduler}: clusters need the package distributed; {install('cluster')}"
        ) from error
    with contextlib.ExitStack() as stack:
        stack.enter_context(_quiet())
        try:
            cluster = stack.enter_context(_started(jobs)) if scheduler == LOCAL else scheduler
            with _no_garbage_collected():
                client = distributed.Client(cluster, timeout=_PATIENCE, set_as_default=False)
        except (OSError, ValueError, TypeError, RuntimeError) as error:
            raise ClusterError(
                f"scheduler {scheduler}: nobody answers there ({_line(error)}); "
                "start one with `dask scheduler`, and name it as in tcp://host:8786"
            ) from error
        stack.enter_context(client)
        _prepare(client, scheduler)
        workers = ClusterWorkers(client)
        stack.callback(workers.cancel)
        try:
            yield workers
        except CancelledError as error:
            raise ClusterError(f"scheduler {scheduler}: {_AWAY}") from error


@contextlib.contextmanager
def _no_garbage_collected() -> Iterator[None]:
    """Keep Python from collecting garbage in the block, in which a client starts.

    A client that found no scheduler is garbage, and closes itself when it is collected. It waits
    for a lock that the start of the next one holds, for ever if that is where it is collected.
    """
    gc.collect()
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()


def limit_worker_threads() -> None:
    """Keep the libraries of this process to one thread each, loaded or not.

    The workers share the processors already. BLAS with several threads would also round
    differently, and the same inputs must give the same bytes on every machine.
    """
    from threadpoolctl import threadpool_limits

    for name in _ONE_THREAD:
        os.environ[name] = "1"
    threadpool_limits(1)


@contextlib.contextmanager
def _started(jobs: int | None) -> Iterator[Any]:
    """Start a cluster on this machine, reached by nobody else, and end it after the block."""
    import dask
    from distributed import LocalCluster

    # Schedulers and workers serve pages of their state without a dashboard, too: none are left of
    # these, and the servers are stopped as soon as they are there.
    with dask.config.set(
        {f"distributed.{each}.http.routes": [] for each in ("scheduler", "worker")}
    ):
        cluster = LocalCluster(
            n_workers=jobs or os.cpu_count() or 1,
            threads_per_worker=1,
            processes=True,
            host="127.0.0.1",
            dashboard_address=None,
            security=_certificate(),
            silence_logs=logging.CRITICAL,
            memory_limit=None,  # dask would kill workers by what it guesses of their memory
        )
        with cluster:
            _stop_pages(cluster.scheduler)
            yield cluster


def _certificate() -> Any:
    """Return a key and a certificate that were made now, which both sides of a talk must have."""
    from distributed.security import Security

    try:
        return Security.temporary()
    except ImportError as error:
        raise ClusterError(
            f"scheduler {LOCAL}: its certificates need the package cryptography; "
            f"{install('cluster')}"
        ) from error


def _stop_pages(server: Any) -> None:
    """Stop the web server of a scheduler or a worker."""
    pages = getattr(server, "http_server", None)
    if pages is not None:
        pages.stop()


def _prepare(client: Any, scheduler: str) -> None:
    """Wait for a worker, compare its versions with ours, and limit the threads of all workers."""
    try:
        client.wait_for_workers(1, timeout=_PATIENCE)
    except TimeoutError as error:
        raise ClusterError(
            f"scheduler {scheduler}: it has no workers; start some with `dask worker {scheduler}`"
        ) from error
    _check_versions(client, scheduler)
    try:
        client.register_plugin(_plugin(is_ours=scheduler == LOCAL), name="shrm-threads")
    except Exception as error:  # whatever a worker raises comes back as it is
        raise ClusterError(
            f"scheduler {scheduler}: a worker cannot limit its threads ({_line(error)}); "
            f"{install('cluster')} there"
        ) from error


def _plugin(is_ours: bool) -> Any:
    """Return what every worker does when it joins.

    Ctrl-C on a terminal reaches the workers of a local cluster too. They ignore it, because it is
    for the process that started them, which ends them. Their web servers are stopped.
    """
    from distributed import WorkerPlugin

    class OneThread(WorkerPlugin):  # type: ignore[misc]
        def setup(self, worker: Any) -> None:
            limit_worker_threads()
            if is_ours:
                signal.signal(signal.SIGINT, signal.SIG_IGN)
                _stop_pages(worker)

    return OneThread()


def _check_versions(client: Any, scheduler: str) -> None:
    """Refuse workers with other versions, whose maps could differ or which could not read tasks.

    The functions that are run belong to the standard library: a worker that lacks `shrm` knows
    them too.
    """
    ours = {"Python": sysconfig.get_python_version(), "shrm": __version__}
    found = {
        "Python": client.run(sysconfig.get_python_version, on_error="return"),
        "shrm": client.run(pkgutil.resolve_name, "shrm_cli:__version__", on_error="return"),
    }
    for package, versions in found.items():
        for worker, version in sorted(versions.items()):
            if version == ours[package]:
                continue
            has = f"has {package} {version}, and we have {ours[package]}"
            if isinstance(version, Exception):
                has = f"has no {package} ({_line(version)})"
            raise ClusterError(
                f"scheduler {scheduler}: its worker {worker} {has}; install the same there"
            )


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """Keep the logs of dask off the terminal: what matters to the user is told by exceptions."""
    import distributed  # noqa: F401  (it sets up its loggers while it loads)

    logs = [logging.getLogger(name) for name in ("distributed", "tornado", "asyncio")]
    logs += [
        logger
        for name, logger in logging.root.manager.loggerDict.items()
        if isinstance(logger, logging.Logger) and name.startswith(("distributed.", "tornado."))
    ]
    levels = [logger.level for logger in logs]
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", module=r"(dask|distributed|tornado)\b")
        for logger in logs:
            logger.setLevel(logging.CRITICAL + 1)
        try:
            yield
        finally:
            for logger, level in zip(logs, levels, strict=True):
                logger.setLevel(level)


def _line(error: BaseException) -> str:
    return shown_reason(" ".join(str(error).split())) or type(error).__name__
