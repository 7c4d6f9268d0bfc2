"""The memory of a comparison: what is estimated is not exceeded, and limits are kept."""

import json
import resource

import numpy as np
import pytest

from shrm_cli.analysis import memory
from shrm_cli.analysis.memory import default_max_memory, machine_memory, within_limit
from shrm_cli.errors import ArgumentError
from shrm_cli.probe.probe import Probe
from tests.cli.helpers import process

MB = 10**6

MEASURE = """
import json
import numpy as np
import shrm_cli.analysis.representations as r
from shrm_cli.analysis import memory
from shrm_cli.probe.probe import Probe
from shrm_cli.render.camera import Viewer
from shrm_cli.render.lit import ggx_surface

r.COMPARED = ("shrm",)
probe = Probe.from_array(np.ones((4, 8, 3), np.float32))
peaks = []
for size in (16, 500):
    plan = r.plan_comparison(probe, [ggx_surface(1.0)], 0.3, [Viewer(0, 0)], size)
    r.compare_representations(plan)
    # Not ru_maxrss, which begins with the memory of the process that started this one.
    peak = int(open("/proc/self/status").read().split("VmHWM:")[1].split()[0])
    # The map takes next to nothing of what the largest may take.
    peaks.append([1024 * peak, plan.memory.needed - memory._MAP * plan.memory.max_size])
print(json.dumps(peaks))
"""


@pytest.fixture
def probe():
    return Probe.from_array(np.ones((8, 16, 3), np.float32))


@pytest.mark.proof
@pytest.mark.slow
def test_a_process_takes_no_more_than_estimated():
    """And not many times less, for maps would be made smaller without need.

    Linux counts the peak in units of 1024 bytes.
    """
    result = process(code=MEASURE)
    assert result.code == 0, result.err
    (small, estimated_small), (large, estimated_large) = json.loads(result.out)
    assert small < estimated_small < 4 * small
    assert large < estimated_large < 5 * large
    # What pictures add is estimated by itself, and not lost in what all comparisons take.
    assert 0 <= large - small < estimated_large - estimated_small < 10 * (large - small)


def test_maps_shrink_to_keep_a_limit(probe):
    most = within_limit(probe, [64], 1, 48, 5, 10**12)
    assert not most.is_reduced
    assert most.max_size == 32 * MB
    less = within_limit(probe, [64], 1, 48, 5, most.needed // 2)
    assert less.is_reduced
    assert MB <= less.max_size < 32 * MB
    assert less.needed <= less.limit == most.needed // 2
    exact = within_limit(probe, [64], 1, 48, 5, most.needed)
    assert not exact.is_reduced


@pytest.mark.parametrize(
    ("views", "size", "height"), [(2000, 1024, 64), (1, 48, 8192)], ids=["pictures", "truth"]
)
def test_what_cannot_be_made_smaller_is_refused(probe, views, size, height):
    with pytest.raises(ArgumentError, match="too little") as refusal:
        within_limit(probe, [height], views, size, 5, 4000 * MB)
    assert refusal.value.argument == "max_memory"
    within_limit(probe, [64], 1, 48, 5, 4000 * MB)


def test_the_machine_and_the_process_have_limits(monkeypatch):
    assert default_max_memory() == machine_memory() // 2
    with open("/proc/meminfo") as lines:
        (total,) = (int(line.split()[1]) * 1024 for line in lines if line.startswith("MemTotal"))
    assert 0 < machine_memory() <= total
    monkeypatch.setattr(resource, "getrlimit", lambda what: (300 * MB, 400 * MB))
    assert machine_memory() == 300 * MB


def test_machines_that_do_not_tell_have_enough_for_what_is_usual(probe, monkeypatch):
    """Four roughnesses of 640 pixels from two sides, which take 3 GB; but not what takes 6 GB."""
    monkeypatch.setattr(memory, "_physical", lambda: [])
    monkeypatch.setattr(memory, "_limits", lambda: [])
    assert not within_limit(probe, [64] * 4, 2, 640, 5).is_reduced
    with pytest.raises(ArgumentError, match="too little"):
        within_limit(probe, [64], 12, 1024, 5)


def test_containers_have_limits(monkeypatch, tmp_path):
    (tmp_path / "memory.max").write_text("200000000\n")
    (tmp_path / "none").write_text("max\n")
    files = [str(tmp_path / name) for name in ("missing", "none", "memory.max")]
    monkeypatch.setattr(memory, "_CONTAINER_LIMITS", files)
    assert machine_memory() == 200 * MB
