"""The cost model on made data, the forecasts against a simulation, and the page's short form."""

import heapq
import itertools
import json
import re
import time

import numpy as np
import pytest

from research import __main__ as tables
from research.scale import scheduler, write
from research.scale.clock import PARTS, REST, Clock, seconds_of_parts
from research.scale.forecast import (
    Farm,
    Load,
    cores_of_disk,
    cores_of_scheduler,
    forecast,
    task_seconds,
)
from research.scale.model import TERMS, Case, fit_powers, fit_sum
from research.scale.page import amount, duration
from research.scale.reach import SHORT, Reach
from shrm_cli.batch.work import Terms, bake
from tests.conftest import ROOT

CASES = [
    Case(rows, f, p, s)
    for rows, f, p, s in itertools.product((128, 512), (8, 32, 128), (0, 2, 4), (16, 64))
]


def test_the_exponents_of_made_times_are_found():
    rng = np.random.default_rng(1)
    quantities = [(case.order_f, case.order_p + 1, case.size) for case in CASES]
    exact = [3e-9 * f * p**2 * s**2 for f, p, s in quantities]
    law = fit_powers(quantities, exact)
    np.testing.assert_allclose(law.exponents, [1, 2, 2], rtol=1e-9)
    assert law.constant == pytest.approx(3e-9)
    assert law.spread < 1e-9
    noise = np.exp(0.1 * rng.standard_normal(len(exact)))
    law = fit_powers(quantities, exact * noise)
    np.testing.assert_allclose(law.exponents, [1, 2, 2], atol=0.1)
    assert law.spread == pytest.approx(0.1, rel=0.4)


@pytest.mark.parametrize("part", TERMS)
def test_a_sum_of_terms_is_found_again(part):
    terms = TERMS[part]
    factors = {name: 1e-9 * (k + 1) for k, name in enumerate(terms)}
    times = [sum(factors[name] * terms[name](case) for name in terms) for case in CASES]
    kept = [k for k, seconds in enumerate(times) if seconds > 0]
    found = fit_sum(terms, [CASES[k] for k in kept], [times[k] for k in kept])
    assert found.spread < 1e-6
    for k in kept:
        assert found.seconds(CASES[k]) == pytest.approx(times[k], rel=1e-4)


def test_no_term_is_negative_and_one_that_is_absent_gets_nothing():
    terms = TERMS["project"]
    times = [1e-3 + 2e-8 * case.pixels for case in CASES]
    found = fit_sum(terms, CASES, times)
    assert all(factor > 0 for factor in found.factors.values())
    assert found.factors["pixels"] == pytest.approx(2e-8, rel=1e-6)
    for name in ("L^2 rows", "L^3"):
        most = found.factors.get(name, 0.0) * max(terms[name](case) for case in CASES)
        assert most < 1e-6


def test_a_part_does_not_count_what_it_calls():
    ticks = iter([0.0, 1.0, 3.0, 6.0, 10.0])
    clock = Clock(lambda: next(ticks))  # begins at 0
    with clock.inside("outer"), clock.inside("inner"):  # at 1, at 3
        pass  # the inner one ends at 6, the outer one at 10
    assert clock.seconds == {"outer": 2.0 + 4.0, "inner": 3.0}


def test_parts_add_up_to_the_whole_and_nothing_stays_wrapped(tmp_path):
    from shrm_cli.maps import stored
    from shrm_cli.prefilter import prefilter
    from shrm_cli.sphere import synthesis

    before = stored.store
    totals = []

    def work():
        start = time.process_time()
        made = prefilter(ROOT / "probes" / "sky.exr", "oren-nayar", to="shrm", size=16)
        stored.store(tmp_path / "sky.exr", made)
        totals.append(time.process_time() - start)

    found = seconds_of_parts(work, 1)
    assert tuple(found) == PARTS
    assert all(found[part] > 0 for part in ("read", "project", "couple", "synthesise", "write"))
    assert sum(found.values()) == pytest.approx(totals[-1], rel=0.02)
    assert stored.store is before
    assert synthesis.synthesize_cube.__module__ == "shrm_cli.sphere.synthesis"
    assert not hasattr(stored.store, "__wrapped__")


def simulated(load, probes, farm):
    """Seconds of a batch whose tasks pass the scheduler and the disk one by one, then a core."""
    cores = [0.0] * farm.cores
    scheduler_free = disk_free = end = 0.0
    for start in range(0, probes, farm.group):
        count = min(farm.group, probes - start)
        scheduler_free += farm.task
        begin = max(heapq.heappop(cores), scheduler_free)
        disk_free = max(disk_free, begin) + count * load.bytes / farm.disk
        done = max(begin + count * load.seconds, disk_free)
        heapq.heappush(cores, done)
        end = max(end, done)
    return end


LOAD = Load("made", 0.010, 0.050, 0.030, 2_000_000, 250_000)


@pytest.mark.parametrize(
    ("farm", "limit"),
    [
        (Farm(1, 1e9, 0.0, 1), "mathematics"),
        (Farm(16, 1e9, 0.002, 5), "mathematics"),
        (Farm(1000, 1e9, 0.002, 50), "disk"),
        (Farm(1000, 1e12, 0.002, 5), "scheduler"),
    ],
)
def test_forecasts_are_those_of_a_simulation(farm, limit):
    found = forecast(LOAD, 100_000, farm)
    assert found.limit == limit
    assert found.seconds == pytest.approx(simulated(LOAD, 100_000, farm), rel=0.06)


def test_the_limit_changes_at_the_number_of_cores_that_is_told():
    most = cores_of_disk(LOAD, 1e9)
    below, above = (Farm(int(most * x), 1e9, 0.0, 1) for x in (0.9, 1.1))
    assert forecast(LOAD, 10**6, below).limit == "mathematics"
    assert forecast(LOAD, 10**6, above).limit == "disk"
    most = cores_of_scheduler(20 * LOAD.seconds, 0.005)
    below, above = (Farm(int(most * x), 1e15, 0.005, 20) for x in (0.9, 1.1))
    assert forecast(LOAD, 10**6, below).limit == "mathematics"
    assert forecast(LOAD, 10**6, above).limit == "scheduler"
    assert cores_of_scheduler(task_seconds(1000, 0.005, 1.0), 0.005) == pytest.approx(1000)


def test_numbers_are_told_in_units_that_suit_them():
    assert [duration(x) for x in (0.25, 12, 200, 7200, 9e5)] == [
        "0.25 s", "12 s", "3.3 min", "2 h", "10 d",
    ]  # fmt: skip
    assert [amount(x) for x in (12, 2.5e3, 3e9, 2e12)] == ["12 bytes", "2.5 kB", "3 GB", "2 TB"]


def test_tasks_that_do_nothing_are_as_long_as_real_ones(tmp_path):
    (chunk,) = scheduler.chunks(1)
    (empty,) = scheduler.nothing((chunk,), Terms())
    probe = str(ROOT / "probes" / "sky.exr")
    job = chunk.jobs[0].__class__(probe, {}, chunk.jobs[0].recipe, str(tmp_path / "map.exr"))
    (real,) = bake((chunk.__class__(probe, {}, (job,)),), Terms(cache=False))
    assert real.records[0]["status"] == "made"
    assert set(real.records[0]) - set(empty.records[0]) <= {"predicted_wrong_share", "why"}
    lengths = [len(json.dumps(each.records)) for each in (empty, real)]
    assert lengths[0] == pytest.approx(lengths[1], rel=0.25)


@pytest.mark.proof
def test_the_scheduler_hands_out_all_tasks():
    pytest.importorskip("distributed")
    found = list(scheduler.handed(Reach(tasks=12, groups=(1, 4), workers=(2,))))
    assert [(row.group, row.tasks) for row in found] == [(4, 3), (1, 12)]
    assert all(row.scheduler > 0 and row.client > 0 for row in found)
    assert found[-1].grown[-1][0] == 12
    assert all(size > 1 for row in found for _, size in row.grown)


@pytest.mark.proof
def test_the_short_form_has_all_its_parts(tmp_path, monkeypatch):
    made = scheduler.Handed(2, 1, 10, 1.0, 0.002, 0.001, ((0, 60.0), (10, 61.0)))
    monkeypatch.setattr(write, "handed", lambda reach: [made])
    tables.main([str(tmp_path), "--scale", "--short", "--probes", str(tmp_path / "none")])
    page = (tmp_path / "scale.md").read_text()
    titles = re.findall(r"^## ([^(:,\n]*)", page, re.MULTILINE)
    assert [title.strip() for title in titles] == [
        "Parts of a prefilter", "Exponents", "Cost model", "A whole process", "The scheduler",
        "Batches",
    ]  # fmt: skip
    assert (tmp_path / "scale.png").stat().st_size > 1000
    assert "This is the short form" in page
    assert all(f"| {part} |" in page for part in (*PARTS, REST))
    assert len(re.findall(r"^\| 16 \|", page, re.MULTILINE)) == 1
    assert SHORT.tasks < 100
