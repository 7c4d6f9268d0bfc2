"""Handing out tasks: what comes first, how many wait, and what becomes of those whose worker died.

The processes of a real pool are killed here, and crash by themselves.
"""

import os
import signal
import subprocess
import sys
import time
import types
from concurrent.futures.process import BrokenProcessPool
from importlib import import_module
from multiprocessing import spawn

import pytest

from shrm_cli.batch import run as batch_run
from shrm_cli.batch.batch import ProcessWorkers
from shrm_cli.batch.entry import Entry, checked
from shrm_cli.batch.job import Chunk, by_probe
from shrm_cli.batch.run import run
from shrm_cli.batch.work import Result, Terms
from tests.batch.helpers import Here, log_lines, records_of, statuses, write_probes
from tests.cli.helpers import environment

CRASHING = """
import os, signal
from shrm_cli.brdf.models.lambertian import Lambertian

class Crashing(Lambertian):
    name = "crashing"
    def transfer(self, light, view):
        os.kill(os.getpid(), signal.SIGSEGV)
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Current folder with eight probes."""
    monkeypatch.chdir(tmp_path)
    write_probes(tmp_path, 8)
    return tmp_path


def irradiance(**changes):
    return Entry(("p?.exr",), (), ("irradiance",), "{probe}.out.exr", **changes)


def test_the_first_probe_comes_before_all_others(folder):
    """Its jobs compute the BRDF's coefficients, which the others then find in the cache."""
    workers = Here()
    records_of(irradiance(), workers=workers)
    probes = [[chunk.probe for chunk in task] for task in workers.tasks]
    assert probes == [[f"p{k}.exr"] for k in range(8)]


def test_tasks_are_longer_where_handing_them_out_is_slow(folder, monkeypatch):
    monkeypatch.setattr(import_module("shrm_cli.batch.run"), "_TASK_SECONDS", 1e3)
    workers, told = Here(), []
    run(by_probe(irradiance().jobs()), workers, Terms(), told.append, is_remote=True)
    assert len(workers.tasks) < 8
    assert sorted(result.probe for result in told) == [f"p{k}.exr" for k in range(8)]


@pytest.mark.parametrize(
    ("count", "probes", "most"), [(16, 4000, 50), (100, 20_000, 100), (100, 600, 3)]
)
def test_tasks_are_longer_on_larger_clusters_as_far_as_probes_suffice(
    monkeypatch, count, probes, most
):
    """Probes take 10 ms: 50 of them half a second, and 100 a hundred times 20 ms, halved."""
    monkeypatch.setattr(batch_run, "bake", told_to_take_10_ms)
    workers = Here()
    workers.workers = count
    chunks = [Chunk(f"p{k}.exr", {}, ()) for k in range(probes)]
    told = []
    run(chunks, workers, Terms(), told.append, is_remote=True)
    assert sorted(result.probe for result in told) == sorted(chunk.probe for chunk in chunks)
    assert max(len(task) for task in workers.tasks) == most


def told_to_take_10_ms(task, terms):
    return [Result(chunk.probe, [{"seconds": 0.01}]) for chunk in task]


class Dying(Here):
    """Workers of which one dies of a certain probe, every time, or the first time only."""

    def __init__(self, probe, always=True):
        super().__init__()
        self.deadly, self.always, self.deaths = probe, always, 0

    def submit(self, function, *arguments):
        def work(task, terms):
            if self.deadly in [c.probe for c in task] and (self.always or not self.deaths):
                self.deaths += 1
                raise BrokenProcessPool
            return function(task, terms)

        return super().submit(work, *arguments)


def test_a_job_that_kills_its_worker_costs_that_job(folder):
    workers = Dying("p3.exr")
    found = statuses(records_of(irradiance(), workers=workers))
    assert [name for name, status in found.items() if status == "failed"] == ["p3.out.exr"]
    assert len(found) == 8
    assert workers.deaths == 2  # the second time alone, which proves that it is the one


def test_the_jobs_of_a_worker_that_was_killed_are_done_again(folder):
    workers = Dying("p3.exr", always=False)
    found = statuses(records_of(irradiance(), workers=workers))
    assert set(found.values()) == {"made"}
    assert len(found) == 8


@pytest.mark.proof
def test_a_crash_in_a_library_costs_one_job(folder):
    """The process of a real pool crashes, again and again; all other outputs are made."""
    (folder / "mine.py").write_text(CRASHING)
    entry = Entry(
        ("p?.exr",), ("lambertian", "./mine.py:Crashing"), ("shrm",),
        "{probe}.{brdf}.out.exr", own={"shrm": {"size": 4}}, runs_code=True,
    )  # fmt: skip
    pool, told = ProcessWorkers(2), []
    try:
        run(by_probe(checked(entry.jobs()))[:3], pool, Terms(), told.append)
    finally:
        pool.stop(at_once=True)
    found = statuses(record for result in told for record in result.records)
    others = {name: status for name, status in found.items() if "lambertian" in name}
    assert sorted(others) == [f"p{k}.lambertian.out.exr" for k in range(3)]
    assert set(others.values()) <= {"made", "skipped"}  # some were there when a process crashed
    assert all((folder / name).is_file() for name in others)
    assert {name: status for name, status in found.items() if "Crashing" in name} == {
        f"p{k}.Crashing.out.exr": "failed" for k in range(3)
    }


COUNT = 60
COMMAND = [
    sys.executable, "-c", "from shrm_cli.__main__ import main; main()", "batch", "p*.exr",
    "--brdf", "phong:exponent=64", "-o", "out/{probe}.exr", "--jobs", "2",
]  # fmt: skip


def begun(folder, **options):
    """Start a batch of many probes as a process, and wait until its first outputs are there."""
    write_probes(folder, COUNT, 32)
    child = subprocess.Popen(
        COMMAND, cwd=folder, env=environment(), stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        text=True, **options,
    )  # fmt: skip
    end = time.monotonic() + 60
    while len(list((folder / "out").glob("p*.exr"))) < 3:
        assert child.poll() is None, child.communicate()
        assert time.monotonic() < end
        time.sleep(0.02)
    return child


def workers_of(pid):
    """Return the processes that a process has started which are pools' workers."""
    command = ["ps", "-ww", "-o", "pid=,args=", "--ppid", str(pid)]
    listed = subprocess.run(command, capture_output=True, text=True, check=True)
    rows = [line.split(None, 1) for line in listed.stdout.splitlines()]
    return [int(row[0]) for row in rows if "spawn_main" in row[1]]


def rest(folder):
    """Return what is in the folder of outputs but for whole ones."""
    return [path.name for path in (folder / "out").iterdir() if path.name.startswith(".")]


def finish(folder):
    """Run the batch again to its end, and return the records of that run."""
    log = folder / "batch.jsonl"
    before = len(log_lines(log))
    done = subprocess.run(
        COMMAND, cwd=folder, env=environment(), capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
    return log_lines(log)[before:]


@pytest.mark.proof
@pytest.mark.slow
@pytest.mark.skipif(not os.path.isdir("/proc"), reason="ps of Linux")
def test_a_worker_that_is_killed_loses_nothing(folder):
    child = begun(folder)
    os.kill(workers_of(child.pid)[0], signal.SIGKILL)
    out, err = child.communicate(timeout=120)
    assert child.returncode == 0, err
    assert f"{COUNT} outputs: " in out
    assert "failed" not in out
    assert len(list((folder / "out").glob("p*.exr"))) == COUNT
    assert rest(folder) == []


@pytest.mark.proof
@pytest.mark.slow
@pytest.mark.skipif(not os.path.isdir("/proc"), reason="ps of Linux")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_a_run_that_is_stopped_goes_on_where_it_was(folder, number):
    child = begun(folder)
    workers = workers_of(child.pid)
    os.kill(child.pid, number)
    out, err = child.communicate(timeout=60)
    assert "Traceback" not in err
    expected = {signal.SIGINT: 130, signal.SIGTERM: 143, signal.SIGKILL: -9}
    assert child.returncode == expected[number]
    if number == signal.SIGINT:
        assert "not done" in out
    end = time.monotonic() + 10
    while any(os.path.exists(f"/proc/{pid}") for pid in workers):  # they end with their parent
        assert time.monotonic() < end
        time.sleep(0.05)
    there = {f"out/{path.name}" for path in (folder / "out").glob("p*.exr")}
    assert 3 <= len(there) < COUNT
    found = statuses(finish(folder))
    assert {name for name, status in found.items() if status == "skipped"} == there
    assert len(found) == COUNT
    assert rest(folder) == []


def test_workers_do_not_run_the_script_of_who_calls(monkeypatch):
    """Python hands a fresh process the name of the script, or of the module, that it runs first."""
    script = types.ModuleType("__main__")
    script.__file__, script.__spec__ = "bake.py", types.SimpleNamespace(name="bake")
    monkeypatch.setitem(sys.modules, "__main__", script)
    assert spawn.get_preparation_data("one")["init_main_from_name"] == "bake"
    given = []
    workers = ProcessWorkers(1)
    monkeypatch.setattr(workers.executor, "submit", lambda *call: given.append(
        spawn.get_preparation_data("two")
    ))  # fmt: skip
    workers.submit(print)
    assert not [key for key in given[0] if key.startswith("init_main")]
    assert (script.__file__, script.__spec__.name) == ("bake.py", "bake")
    workers.stop()


@pytest.mark.proof
@pytest.mark.parametrize("scheduler", [None, "local"])
def test_a_script_needs_no_guard(tmp_path, scheduler):
    write_probes(tmp_path, 1)
    script = tmp_path / "bake.py"
    script.write_text(
        "import shrm_cli as shrm\n"
        "print('begun')\n"
        "entry = shrm.Entry(('p0.exr',), to=('irradiance',))\n"
        f"print(shrm.batch([entry], jobs=2, scheduler={scheduler!r}).made)\n"
    )
    done = subprocess.run(
        [sys.executable, str(script)], cwd=tmp_path, env=environment(), capture_output=True,
        text=True,
    )  # fmt: skip
    assert (done.stdout, done.stderr) == ("begun\n1\n", "")
