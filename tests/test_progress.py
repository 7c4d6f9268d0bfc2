"""How far work in stages has come, told as one number that grows."""

import numpy as np
import pytest

import shrm_cli as shrm
from shrm_cli import settings
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.brdf.transfer import compute_coefficients
from shrm_cli.progress import Rising, Stages, in_order, report, tell_time_left, using


def test_stages_are_of_equal_length():
    told = []
    stages = Stages(lambda done, total: told.append(done / total), 4)
    stages.within(1, 2)
    stages.done(1, 4)
    stages.within(3, 12)
    stages.done(2, 4)
    stages.done(4, 4)
    assert told == pytest.approx([1 / 8, 1 / 4, 5 / 16, 1 / 2, 1])


@pytest.mark.parametrize("rows", [1, 7, 3000])
def test_it_grows_to_its_end_whatever_the_units_within(rows):
    told = []
    stages = Stages(lambda *what: told.append(what), 3)
    for stage in range(3):
        for row in range(rows):
            stages.within(row + 1, rows)
        stages.done(stage + 1, 3)
    assert told == sorted(told)
    assert len({total for _, total in told}) == 1
    assert told[-1][0] == told[-1][1]


def test_what_comes_after_the_last_stage_takes_no_time():
    told = []
    stages = Stages(lambda *what: told.append(what), 2)
    stages.done(2, 5)
    stages.within(1, 2)
    stages.done(5, 5)
    assert len(set(told)) == 1
    assert told[0][0] == told[0][1]


def test_nobody_need_listen():
    stages = Stages(None, 2)
    stages.within(1, 2)
    stages.done(1, 2)


def test_what_has_an_unknown_number_of_stages_never_falls_back():
    told = []
    rising = Rising(lambda done, total: told.append(done / total))
    for units in (10, 1000, 3, 7, 7):
        for done in range(units + 1):
            rising(done, units)
    assert told == sorted(told)
    assert 0.7 < told[-1] < 1
    rising.end()
    assert told[-1] == 1


class Listener:
    def __init__(self):
        self.told, self.left = [], []

    def __call__(self, done, total):
        self.told.append((done, total))

    def tell_time_left(self, seconds):
        self.left.append(seconds)


def test_the_time_left_is_told_to_those_who_show_it():
    listener = Listener()
    with using(Rising(listener)):
        tell_time_left(12.5)
    assert (listener.left, listener.told) == ([12.5], [])
    for deaf in (lambda done, total: None, Rising(lambda done, total: None), None):
        with using(deaf):
            tell_time_left(12.5)
    tell_time_left(12.5)
    assert listener.left == [12.5]


def test_who_is_told_is_a_matter_of_the_context():
    outer, inner = Listener(), Listener()
    with using(outer):
        report(1, 4)
        with using(inner):
            report(2, 4)
        with using(None):
            report(3, 4)
        report(4, 4)
    report(5, 4)
    assert (outer.told, inner.told) == ([(1, 4), (4, 4)], [(2, 4)])


def test_jobs_in_threads_tell_nobody():
    """Their reports would come from several threads at once, and from none in order."""
    listener = Listener()
    with using(listener), settings.using(threads=2):
        assert list(in_order(lambda job: report(job, 3) or job, range(3))) == [0, 1, 2]
        report(3, 3)
    assert listener.told == [(3, 3)]


@pytest.mark.parametrize(
    "work",
    [
        lambda: shrm.sky(64, 45, 35),
        lambda: shrm.studio(64),
        lambda: shrm.probe_statistics(
            shrm.Probe.from_array(np.ones((64, 128, 3), np.float32), layout="latlong"), lamps=0
        ),
    ],
)
def test_rows_are_told_one_block_after_the_other(work):
    """Of 8192 x 4096 pixels these took five to nine seconds in silence."""
    told = []
    with using(lambda done, total: told.append(done / total)):
        work()
    assert told == sorted(told)
    assert told[-1] == 1


def test_a_stage_that_says_the_same_leaves_room_for_those_after_it():
    """A stage of a thousand like reports took all, so that the rest of the work stood at 99 %."""
    told = []
    rising = Rising(lambda done, total: told.append(done / total))
    for _ in range(1000):
        rising(1, 2)
    assert 0.25 < told[-1] <= 0.5
    rising(0, 2)
    rising(2, 2)
    assert told == sorted(told)
    assert told[-1] < 0.7


def test_the_terms_of_a_sum_are_told_as_one_work():
    """Each term began anew, which `Rising` took for a further attempt at all of them."""
    told = []
    with using(lambda done, total: told.append(done / total)):
        compute_coefficients(parse_spec("0.5*lambertian+0.3*phong+0.2*microfacet"), 16, 2, 1e-3)
    assert told == sorted(told)
    assert told[-1] == 1
