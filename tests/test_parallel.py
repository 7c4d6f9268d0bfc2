"""Jobs in threads: the order of their results, how many wait, and what ends them."""

import threading
import time

import numpy as np
import pytest

from shrm_cli import settings
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.brdf.transfer import compute_transfer
from shrm_cli.progress import at_once, in_order


@pytest.mark.parametrize("threads", [1, 2, 5, None])
def test_results_come_in_the_order_of_the_jobs(threads):
    def work(job):
        time.sleep(0.001 * (7 - job % 7))  # later jobs end earlier
        return job**2

    with settings.using(threads=threads):
        assert list(in_order(work, range(30))) == [job**2 for job in range(30)]
        assert list(in_order(work, [])) == []


def test_several_jobs_run_at_the_same_time():
    together = threading.Barrier(3, timeout=10)
    with settings.using(threads=3):
        at_once(lambda _: together.wait(), range(3))


def test_there_are_no_pools_within_pools():
    """A job has one thread, and otherwise the settings of whoever started it."""
    with settings.using(threads=3, cache=False):
        inner = list(in_order(lambda _: settings.current(), range(6)))
    assert set(inner) == {settings.Settings(threads=1, cache=False)}


def test_few_results_wait_to_be_taken():
    begun = []
    with settings.using(threads=2):
        results = in_order(begun.append, range(100))
        next(results)
        time.sleep(0.05)
        assert len(begun) <= 4
        results.close()
    assert len(begun) <= 4


def test_an_error_is_handed_on_and_ends_the_rest():
    begun = []

    def work(job):
        begun.append(job)
        if job == 3:
            raise KeyError(job)

    with settings.using(threads=2), pytest.raises(KeyError):
        at_once(work, range(1000))
    assert len(begun) < 20


def test_numpy_warns_in_threads_as_it_does_outside():
    alarmed = settings.using(threads=2), np.errstate(divide="raise")
    with alarmed[0], alarmed[1], pytest.raises(FloatingPointError):
        at_once(lambda job: np.ones(3) / job, np.zeros((4, 3)))


@pytest.mark.parametrize("spec", ["ggx:roughness=0.4", "oren-nayar"])
def test_transfer_functions_are_the_same_bytes(spec):
    found = []
    for threads in (1, 2, 3):
        with settings.using(threads=threads):
            found.append(compute_transfer(parse_spec(spec), 40, 6, 1e-4))
    for each in found[1:]:
        assert each.values.tobytes() == found[0].values.tobytes()
        assert each.accuracy == found[0].accuracy
