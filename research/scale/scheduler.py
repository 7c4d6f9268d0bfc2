"""What dask's scheduler takes for each task, with as many workers as a farm has.

The scheduler is dask's own, in its own process, reached through the loop of `shrm batch`.
The workers are dask's own too, but all of them are in one more process and share four threads, and
tasks do nothing. So the seconds and the memory of the scheduler's process are those of a farm.
"""

import asyncio
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import psutil

from research.inputs import ROOT, say
from research.scale.reach import Reach
from shrm_cli.batch import run as batch_run
from shrm_cli.batch.cluster import cluster_executor
from shrm_cli.batch.job import Chunk, Job, Recipe, Task
from shrm_cli.batch.work import Result, Terms

_PATIENCE = 900.0
"""Seconds that all workers have to join."""
_THREADS = 4
_LOOKS = 10
"""How often the memory of the scheduler is looked at."""


@dataclass(frozen=True)
class Handed:
    """What handing out tasks took.

    Attributes
    ----------
    workers : int
    group : int
        Probes of a task.
    tasks : int
    elapsed : float
        Seconds until all were done.
    scheduler, client : float
        Processor seconds of the scheduler's process and of ours, for each task.
    grown : tuple of (int, float)
        Tasks that were done, and MB of the scheduler's process then.
    """

    workers: int
    group: int
    tasks: int
    elapsed: float
    scheduler: float
    client: float
    grown: tuple[tuple[int, float], ...]


def nothing(task: Task, terms: Terms) -> list[Result]:
    """Return what `shrm_cli.batch.work.bake` would, of about the same length, and make nothing."""
    return [Result(chunk.probe, [_record(job) for job in chunk.jobs]) for chunk in task]


def _record(job: Job) -> dict[str, object]:
    return {
        "output": job.output, "probe": job.probe, "brdf": job.recipe.brdf, "to": job.recipe.to,
        "seconds": 0.0, "status": "made", "bytes": 225_682, "size": 32, "order_f": 11,
        "order_p": 2, "order_carried": 40, "predicted_error": 0.0822, "filter_error": 0.0033,
        "storage_error": 0.0, "precision": "half", "warnings": [],
    }  # fmt: skip


def chunks(count: int) -> list[Chunk]:
    """Return the chunks of a batch of many probes, with one output each."""
    recipe = Recipe("shrm", "microfacet:sigma=0.2", {})
    names = [f"/mnt/production/probes/{k:07d}.exr" for k in range(count)]
    return [
        Chunk(name, {}, (Job(name, {}, recipe, name.replace("probes", "bake")),)) for name in names
    ]


def handed(reach: Reach) -> Iterator[Handed]:
    """Hand out tasks to schedulers with few workers, and a tenth as many to those with more."""
    for k, workers in enumerate(reach.workers):
        count = reach.tasks if k == 0 else reach.tasks // 10
        with _fleet(workers) as (address, scheduler), cluster_executor(address) as cluster:
            for group in reversed(reach.groups):
                say(f"the scheduler: {workers} workers, {group} probes a task")
                found = _hand_out(cluster, scheduler, workers, group, count)
                say(f"{1e3 * found.scheduler:.2f} ms of the scheduler for each of {found.tasks}")
                yield found


def _hand_out(
    cluster: batch_run.Workers, scheduler: psutil.Process, workers: int, group: int, count: int
) -> Handed:
    """Give the tasks of a batch to a cluster in the way of `shrm batch`."""
    every = chunks(count)
    tasks = [tuple(every[k : k + group]) for k in range(0, count, group)]
    grown = [(0, _memory(scheduler))]
    told = 0

    def tell(result: Result) -> None:
        nonlocal told
        told += 1
        if told * _LOOKS // count > (told - 1) * _LOOKS // count:
            grown.append((told // group, _memory(scheduler)))

    feeder = batch_run._Feeder(cluster, Terms(), tell, 0.0)
    original, batch_run.bake = batch_run.bake, nothing  # type: ignore[attr-defined]
    before, start = _used(scheduler), time.perf_counter()
    ours = time.process_time()
    try:
        feeder.feed(tasks)
    finally:
        batch_run.bake = original  # type: ignore[attr-defined]
    elapsed, ours = time.perf_counter() - start, time.process_time() - ours
    assert told == count
    used, each = _used(scheduler) - before, len(tasks)
    return Handed(workers, group, each, elapsed, used / each, ours / each, tuple(grown))


def _used(process: psutil.Process) -> float:
    """Return the processor seconds of a process so far."""
    times = process.cpu_times()
    return float(times.user + times.system)


def _memory(process: psutil.Process) -> float:
    return float(process.memory_info().rss) / 2**20


@contextmanager
def _fleet(workers: int) -> Iterator[tuple[str, psutil.Process]]:
    """Start a scheduler, and workers that join it; yield its address and its process."""
    with tempfile.TemporaryDirectory() as name:
        file = Path(name) / "scheduler.json"
        dask = [sys.executable, "-m", "dask", "scheduler", "--host", "127.0.0.1", "--port", "0"]
        dask += ["--no-dashboard", "--scheduler-file", str(file)]
        fleet = [sys.executable, "-m", "research.scale.scheduler", str(file), str(workers)]
        # The scheduler looks into tasks too, and is to find this module.
        found = {**os.environ, "PYTHONPATH": str(ROOT)}
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "env": found}
        with subprocess.Popen(dask, cwd=name, **quiet) as scheduler:
            try:
                address = _address(file)
                with subprocess.Popen(fleet, cwd=ROOT, **quiet) as joined:
                    try:
                        _wait_for(address, workers)
                        yield address, psutil.Process(scheduler.pid)
                    finally:
                        joined.kill()
            finally:
                scheduler.kill()


def _address(file: Path) -> str:
    """Return the address that a scheduler writes into a file when it is ready."""
    end = time.monotonic() + _PATIENCE
    while time.monotonic() < end:
        if file.exists() and (text := file.read_text()):
            return str(json.loads(text)["address"])
        time.sleep(0.1)
    raise TimeoutError("the scheduler did not start")


def _wait_for(address: str, workers: int) -> None:
    from distributed import Client

    with Client(address, set_as_default=False) as client:
        client.wait_for_workers(workers, timeout=_PATIENCE)


async def _join(file: str, count: int) -> None:
    """Be many workers, until somebody ends the process."""
    import dask
    from distributed import Worker

    calm = {
        "distributed.admin.system-monitor.interval": "1h",  # it looks at our process for each
        "distributed.worker.profile.enabled": False,
        "distributed.worker.memory.monitor-interval": "1h",
    }
    with dask.config.set(calm), ThreadPoolExecutor(_THREADS) as threads:
        for k in range(count):
            await Worker(
                scheduler_file=file, nthreads=1, name=k, executor=threads, memory_limit=0,
                dashboard=False, host="127.0.0.1",
            )  # fmt: skip
        await asyncio.Event().wait()


if __name__ == "__main__":
    asyncio.run(_join(sys.argv[1], int(sys.argv[2])))
