"""Thousands of jobs, some of them of damaged probes, with the whole run killed in its middle.

``BATCH_JOBS=10000`` in the environment takes as many; by default there are fewer.
"""

import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from shrm_cli.maps.file import open_map
from tests.batch.helpers import log_lines
from tests.cli.helpers import environment, write_exr

JOBS = int(os.environ.get("BATCH_JOBS", "300"))
COMMAND = [
    sys.executable, "-c", "from shrm_cli.__main__ import main; main()", "batch", "p/**/*.exr",
    "--to", "irradiance", "-o", "out/{folder}/{probe}.exr", "--quiet",
]  # fmt: skip


def write_tiny_probes(folder):
    """Write tiny probes in folders of a thousand, of which each hundredth is damaged."""
    rng = np.random.default_rng(1)
    for k in range(JOBS):
        where = folder / f"p/{k // 1000:03d}"
        where.mkdir(parents=True, exist_ok=True)
        path = where / f"{k:05d}.exr"
        write_exr(path, rng.uniform(0, 2, (8, 16, 3)).astype(np.float16))
        if k % 100 == 7:
            path.write_bytes(path.read_bytes()[: 40 + k % 90])


@pytest.mark.proof
@pytest.mark.skipif(sys.platform == "win32", reason="has no such signals")
def test_a_second_run_makes_exactly_what_is_missing(tmp_path):
    write_tiny_probes(tmp_path)
    good = {f"out/{k // 1000:03d}/{k:05d}.exr" for k in range(JOBS) if k % 100 != 7}
    with subprocess.Popen(
        COMMAND, cwd=tmp_path, env=environment(), stderr=subprocess.DEVNULL
    ) as run:
        while sum(1 for _ in (tmp_path / "out").glob("*/[0-9]*.exr")) < JOBS // 3:
            assert run.poll() is None
            time.sleep(0.05)
        os.kill(run.pid, signal.SIGKILL)
    time.sleep(3)  # the workers end with their parent
    there = {path.relative_to(tmp_path).as_posix() for path in tmp_path.glob("out/*/[0-9]*.exr")}
    assert JOBS // 3 <= len(there) < len(good)
    before = len(log_lines(tmp_path / "batch.jsonl"))
    second = subprocess.run(
        COMMAND, cwd=tmp_path, env=environment(), capture_output=True, text=True
    )
    assert second.returncode == 1
    assert second.stderr.count("\n") == JOBS // 100
    lines = log_lines(tmp_path / "batch.jsonl")[before:]
    found = {status: {each["output"] for each in lines if each["status"] == status}
             for status in ("made", "skipped", "failed")}  # fmt: skip
    assert found["skipped"] == there
    assert found["made"] == good - there
    assert len(found["failed"]) == JOBS // 100
    remaining = {
        p.relative_to(tmp_path).as_posix() for p in tmp_path.glob("out/**/*") if p.is_file()
    }
    assert remaining == good  # glob finds hidden files too
    for name in good:
        made = open_map(tmp_path / name)
        assert made.info.probe == name.rsplit("/", 1)[-1]
