"""Batches on a cluster: the same bytes as from the pool, and nothing lost with a worker."""

import json
import os
import signal
import subprocess
import sys
import time
from importlib.util import find_spec

import pytest

from tests.batch.helpers import log_lines, statuses, write_probes
from tests.cli.helpers import environment, process, snapshot

pytestmark = [
    pytest.mark.skipif(find_spec("distributed") is None, reason="distributed is not installed"),
    pytest.mark.proof,
]

COUNT = 60
WORDS = ("--brdf", "phong:exponent=64", "--to", "shrm", "--to", "irradiance", "--jobs", "2")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Current folder with probes."""
    monkeypatch.chdir(tmp_path)
    write_probes(tmp_path / "p", COUNT, 32)
    return tmp_path


def test_a_cluster_gives_the_same_bytes_as_the_pool(folder):
    for name, more in (("pool", ()), ("cluster", ("--scheduler", "local"))):
        words = ("batch", "p/*.exr", *WORDS, *more, "-o", f"{name}/{{probe}}.{{to}}.exr", "--json")
        done = process(*words, "--quiet")
        assert (done.code, done.err) == (0, "")
        assert json.loads(done.out)["made"] == 2 * COUNT
    one = snapshot(folder / "pool")
    assert len(one) == 2 * COUNT
    assert snapshot(folder / "cluster") == one


def descendants(pid):
    """Return all processes below a process, with their command lines."""
    listed = subprocess.run(
        ["ps", "-eww", "-o", "pid=,ppid=,args="], capture_output=True, text=True
    )
    rows = [line.split(None, 2) for line in listed.stdout.splitlines()]
    found, pending = [], [str(pid)]
    while pending:
        parent = pending.pop()
        for child, above, words in rows:
            if above == parent:
                found.append((int(child), words))
                pending.append(child)
    return found


@pytest.mark.skipif(not os.path.isdir("/proc"), reason="ps of Linux")
def test_a_worker_of_a_cluster_that_is_killed_loses_nothing(folder):
    command = [sys.executable, "-c", "from shrm_cli.__main__ import main; main()", "batch",
               "p/*.exr", *WORDS, "--scheduler", "local", "-o", "out/{probe}.{to}.exr"]  # fmt: skip
    with subprocess.Popen(
        command, env=environment(), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as run:
        end = time.monotonic() + 90
        while len(list((folder / "out").glob("p*.exr"))) < 3:
            assert run.poll() is None, run.communicate()
            assert time.monotonic() < end
            time.sleep(0.02)
        # Where setproctitle is installed, workers have names of their own.
        named = ("spawn_main", "dask worker")
        workers = [pid for pid, words in descendants(run.pid) if any(n in words for n in named)]
        os.kill(workers[-1], signal.SIGKILL)
        out, err = run.communicate(timeout=120)
    assert run.returncode == 0, err
    assert "failed" not in out
    made = statuses(log_lines(folder / "batch.jsonl"))
    assert len(made) == 2 * COUNT
    assert set(made.values()) <= {"made", "skipped"}  # the killed worker's were done once more
    assert len(list((folder / "out").iterdir())) == 2 * COUNT
