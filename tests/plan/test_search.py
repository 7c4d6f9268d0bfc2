"""The search for the fewest bytes, against trying everything."""

from dataclasses import dataclass
from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shrm_cli.plan import policy
from shrm_cli.plan.search import (
    Candidate,
    Goal,
    Row,
    error_beside,
    fewest_bytes,
    first_kept,
    is_worth_lamps,
    kept_in_fewest,
    least_errors,
    least_wrong,
    rising,
)
from shrm_cli.vocabulary import DEFAULT_ERROR, DEFAULT_SEEN


@dataclass(frozen=True)
class Sized:
    bytes: int
    total_error: float

    @property
    def least_error(self):
        return self.total_error / 2


def row(sizes, errors, asked=None):
    """A row of candidates; what is asked for is noted."""

    def candidate(index):
        if asked is not None:
            asked.append(sizes[index])
        return Sized(sizes[index], errors[index])

    return Row(len(sizes), lambda index: sizes[index], candidate)


@st.composite
def tables(draw):
    """Rows with rising bytes and falling errors."""
    counts = draw(st.lists(st.integers(0, 6), min_size=1, max_size=4))
    found = []
    for count in counts:
        sizes = sorted(draw(st.sets(st.integers(1, 60), min_size=count, max_size=count)))
        errors = draw(st.sets(st.integers(1, 40), min_size=count, max_size=count))
        found.append((sizes, [each / 40 for each in sorted(errors, reverse=True)]))
    return found


@given(tables(), st.integers(0, 40))
def test_it_finds_what_trying_everything_finds(table, error):
    every = [pair for sizes, errors in table for pair in zip(sizes, errors, strict=True)]
    kept = [pair for pair in every if pair[1] <= error / 40]
    found = fewest_bytes((row(*each) for each in table), error / 40)
    assert found == fewest_bytes((row(*each) for each in table), error / 40, look_near=False)
    if not every:
        assert found is None
    elif kept:
        assert found[1]
        assert found[0].total_error <= error / 40
        assert found[0].bytes == min(size for size, _ in kept)
    else:
        assert not found[1]
        assert found[0].total_error == min(each for _, each in every)
    lasts = [errors[-1] for _, errors in table if errors]
    assert [each.total_error for each in least_errors(row(*each) for each in table)] == lasts
    listed = [each.total_error for pair in table for each in row(*pair).every()]
    assert listed == [each for _, errors in table for each in errors]


def test_candidates_of_more_bytes_are_not_looked_at():
    asked = []
    rows = [row([1, 2, 3], [0.3, 0.2, 0.1]), row([2, 4, 8], [0.25, 0.1, 0.05], asked)]
    assert fewest_bytes(rows, 0.25)[0].bytes == 2
    assert asked == []


@st.composite
def uneven_tables(draw):
    """Rows with rising bytes, and errors that may rise, too."""
    found = []
    for count in draw(st.lists(st.integers(1, 12), min_size=1, max_size=4)):
        sizes = sorted(draw(st.sets(st.integers(1, 90), min_size=count, max_size=count)))
        found.append((sizes, draw(st.lists(st.integers(1, 40), min_size=count, max_size=count))))
    return found


@given(uneven_tables(), st.integers(1, 40))
def test_errors_may_rise_with_a_cube(table, error):
    """Nothing near takes fewer bytes, in any row whose largest such candidate is nearly good."""
    found, is_met = fewest_bytes([row(*each) for each in table], error)
    if not is_met:
        assert found.total_error == min(errors[-1] for _, errors in table) > error
        return
    assert found.total_error <= error
    for sizes, errors in table:
        fewer = [pair for pair in zip(sizes, errors, strict=True) if pair[0] < found.bytes]
        if fewer and fewer[-1][1] <= policy.NEARLY_KEPT * error:
            near = [pair for pair in fewer if pair[0] >= policy.NEAR * found.bytes]
            assert all(pair[1] > error for pair in [*near, fewer[-1]])


@pytest.mark.parametrize(
    ("sizes", "errors", "expected"),
    [
        ([60, 80, 100], [10, 11, 9], 60),
        ([59, 80, 100], [10, 11, 9], 100),  # of far fewer bytes
        ([80, 90, 100], [10, 15, 9], 80),
        ([80, 90, 100], [10, 15.1, 9], 100),  # the others are far from good
        ([20, 25, 41, 42, 68, 69, 100], [10, 12, 10, 12, 10, 12, 9], 41),  # again and again
    ],
)
def test_what_is_looked_at_one_by_one(sizes, errors, expected):
    """Halving finds 100 in all of them."""
    assert fewest_bytes([row(sizes, errors)], 10)[0].bytes == expected
    assert fewest_bytes([row(sizes, errors)], 10, look_near=False)[0].bytes == 100


def test_only_those_up_to_the_first_good_one_are_looked_at():
    asked = []
    found, _ = fewest_bytes([row([62, 64, 66, 80, 100], [10, 9, 12, 11, 9], asked)], 10)
    assert found.bytes == 62
    assert set(asked) == {62, 66, 80, 100}


def test_of_one_size_fewer_cubes_are_found_where_the_last_ones_are_looked_up_badly():
    """Errors rise from the fourth on, and the last one misses what is asked by look-ups alone."""
    errors = [0.9, 0.5, 0.2, 0.1, 0.15, 0.2, 0.25, 0.3]
    alone = [row(list(range(1, 9)), errors)]
    found = fewest_bytes(alone, 0.2)
    assert found is not None
    assert (found[0].bytes, found[1]) == (3, True)
    assert not fewest_bytes(alone, 0.09)[1]
    assert not fewest_bytes(alone, 0.14)[1]  # functions alone miss more than that in the last one


def test_what_a_row_is_mapped_to_is_found_once():
    asked = []
    found = row([10, 20], [0.2, 0.1], asked).mapped(lambda each: Sized(each.bytes, 0.5))
    assert found.candidate(1) is found.candidate(1)
    assert (found.count, found.bytes_of(1), found.candidate(1).total_error) == (2, 20, 0.5)
    assert asked == [20]


class Made:
    """Maps of a form that are proposed by a function, and rows of others."""

    def __init__(self, propose, rows=()):
        self.candidate, self._rows, self.looked_in = propose, rows, []

    def rows(self, max_size):
        self.looked_in.append(max_size)
        for each in self._rows:
            yield Row(sum(rough.bytes <= max_size for rough in each), *_row(each))


def _row(roughs):
    return lambda index: roughs[index].bytes, roughs.__getitem__


def rough(bytes_, error, wrong, exact=None):
    """A map whose error is found to be another one at a closer look."""
    total = error if exact is None else exact
    closely = Candidate("rough", bytes_, 1, total, lambda: wrong, int)
    return Candidate("rough", bytes_, 1, error, lambda: wrong, int, find_exact=lambda: closely)


GOAL = Goal(0.05, 0.05)


def ways_to(propose, goal=GOAL, rows=()):
    """The candidates up to the first that keeps the goal, and whether one does."""
    return first_kept(rising(Made(propose, rows), goal, 10**9), goal)


def shares(wrong):
    """Propose maps with errors of 1, .5, .25 .. percent, each of twice the bytes of the last."""
    asked = []

    def propose(error):
        asked.append(error)
        index = next((k for k in range(len(wrong)) if 0.08 / 2**k <= error), len(wrong) - 1)
        return Candidate(
            "made", 100 * 2**index, 1, 0.08 / 2**index, lambda: wrong[index], lambda: index
        )

    return propose, asked


def test_errors_fall_until_what_is_seen_is_good():
    propose, asked = shares([0.5, 0.3, 0.06, 0.05, 0.01])
    tried, is_kept = ways_to(propose)
    assert is_kept
    assert (tried[-1].wrong_share, tried[-1].bytes) == (0.05, 800)
    # The next error is asked for in terms of what was found, not of what was asked.
    np.testing.assert_allclose(asked[:3], [0.05, 0.04 * policy.FINER, 0.02 * policy.FINER])


@pytest.mark.parametrize(
    ("wrong", "step"),
    [(0.4, policy.FINER), (0.0625, 0.8**0.5), (0.0505, 2**-0.125), (0.01, policy.FINER)],
)
def test_the_first_miss_tells_how_much_less_error_is_needed(wrong, step):
    """Shares of wrong pixels fall with the square of the error; later steps are whole ones."""
    asked = []

    def propose(error):
        asked.append(error)
        return Candidate("made", round(1 / error), 1, error, lambda: wrong, int)

    list(rising(Made(propose), Goal(0.05, 0.05), 10**9))
    np.testing.assert_allclose(asked[1:3], 0.05 * step * policy.FINER ** np.arange(2))


def large(wrong):
    """Propose maps of some bytes for errors of 5, 3.5, 2.5 .. %."""

    def propose(error):
        index = round(np.log(error / 0.05) / np.log(policy.FINER))
        bytes_, share = wrong[index]
        return Candidate("made", bytes_, 1, error, lambda: share, int)

    return propose


KEPT_LATER = [(100_000, 0.9), (300_000, 0.02), (900_000, 0.01)]
"""Bytes and shares of wrong pixels of maps of ever less error, of which the second one is good."""


def test_of_all_maps_the_one_of_the_fewest_bytes_that_is_good_is_taken():
    """Its error may be larger than that of one which has too many wrong pixels."""
    rows = [
        [rough(40_000, 0.07, 0.01), rough(90_000, 0.05, 0.06), rough(120_000, 0.048, 0.05)],
        [rough(110_000, 0.04, 0.3), rough(200_000, 0.03, 0.03)],
    ]
    tried, is_kept = ways_to(large(KEPT_LATER), rows=rows)
    assert is_kept
    assert (tried[-1].form, tried[-1].bytes, tried[-1].wrong_share) == ("rough", 120_000, 0.05)


@pytest.mark.parametrize(
    "roughs",
    [
        [],
        [rough(120_000, 0.051, 0.01)],  # too large an error
        [rough(120_000, 0.01, 0.051)],  # too many wrong pixels
        [rough(120_000, 0.01, 0.01, exact=0.051)],  # too large an error at a closer look
        [rough(300_000, 0.01, 0.01)],  # no fewer bytes
    ],
)
def test_what_keeps_no_more_of_what_is_asked_is_not_taken(roughs):
    tried, is_kept = ways_to(large(KEPT_LATER), rows=[roughs])
    assert is_kept
    assert (tried[-1].form, tried[-1].bytes) == ("made", 300_000)


@pytest.mark.parametrize(("more", "is_looked_for"), [(0, False), (1, True)])
def test_what_would_save_few_bytes_is_not_looked_for(more, is_looked_for):
    maps = Made(large([(1000, 0.9), (2**17 + more, 0.02)]))
    next(each for each in rising(maps, Goal(), 10**9) if each.keeps(Goal()))
    assert maps.looked_in == ([2**17 + more - 1] if is_looked_for else [])


def test_the_first_map_is_of_the_fewest_bytes_of_its_error_where_it_is_good():
    maps = Made(large([(300_000, 0.01), (900_000, 0.01)]))
    assert next(rising(maps, Goal(), 10**9)).bytes == 300_000
    assert maps.looked_in == []


def test_what_is_seen_of_a_map_is_not_found_before_others_are_asked_for():
    """It takes seconds, and whoever looks at bytes alone may know enough by them."""
    seen = []

    def propose(error):
        return Candidate("made", 10**7, 1, error, lambda: seen.append(error) or 0.9, int)

    maps = rising(Made(propose), Goal(), 10**9)
    assert (next(maps).bytes, seen) == (10**7, [])
    next(maps)
    assert seen[0] == 0.05


def test_where_no_map_of_the_fewest_bytes_of_an_error_is_good_others_may_be():
    """A map of half a percent had 15 % of wrong pixels in 22 MB, where one of 1 % has 5 % in 8."""

    def propose(error):
        return Candidate("made", 10**8, 1, max(error, 0.04), lambda: 0.3, int)

    maps = Made(propose, [[rough(10**6, 0.05, 0.05), rough(10**7, 0.01, 0.0)]])
    first = next(each for each in rising(maps, Goal(), 10**9) if each.form == "rough")
    assert first.bytes == 10**6
    assert maps.looked_in == [10**9]
    tried, is_kept = ways_to(propose)
    assert (is_kept, tried[-1].form) == (False, "made")


def test_after_a_good_map_of_few_bytes_come_others_of_few_bytes():
    """Whoever looks on, because it is negative somewhere, gets half the errors in few bytes, too.

    Between soft boxes a map of .85 MB was dark, and the next one that was tried had 7.5 MB.
    """
    row = [(100_000, 0.06), (120_000, 0.05), (130_000, 0.04), (150_000, 0.025), (160_000, 0.01)]
    rows = [[rough(size, 0.01, share) for size, share in row]]
    for propose in (large([*KEPT_LATER, *[(10**6, 0.0)] * 20]), large([(10**6, 0.9)] * 20)):
        kept = [each for each in rising(Made(propose, rows), Goal(), 10**9) if each.keeps(Goal())]
        assert [each.bytes for each in kept[:3]] == [120_000, 150_000, 160_000]


def test_exact_errors_are_found_of_good_maps_alone():
    """They take ten times as long as shares of wrong pixels."""
    found, shared = [], []

    def seen(bytes_, error, wrong):
        exact = Candidate("rough", bytes_, 1, error, float, int)
        closely, share = partial(found.append, bytes_), partial(shared.append, bytes_)
        return Candidate(
            "rough", bytes_, 1, error, lambda: share() or wrong, int,
            find_exact=lambda: closely() or exact,
        )  # fmt: skip

    row = [seen(size, 0.01, 0.5 / size) for size in range(1, 33)]
    kept = kept_in_fewest([Row(32, *_row(row))], Goal())
    assert kept.bytes == 10
    assert set(found) <= set(range(10, 33))
    assert len(shared) <= 6  # by halving alone


@pytest.mark.parametrize(("added", "size"), [(0.02, 17), (0.0, 10), (0.05, None), (0.06, None)])
def test_room_is_left_for_wrong_pixels_that_a_closer_look_shows(added, size):
    def seen(bytes_):
        share = 0.5 / bytes_
        exact = Candidate("rough", bytes_, 1, 0.01, lambda: share + added, int)
        return Candidate("rough", bytes_, 1, 0.01, lambda: share, int, find_exact=lambda: exact)

    kept = kept_in_fewest([Row(100, *_row([seen(each) for each in range(1, 101)]))], Goal())
    assert (kept and kept.bytes) == size


def of_every_error(times):
    """Propose maps whose errors are a little less or more than is asked; good ones below 3 %."""

    def propose(error):
        total = times * error
        return Candidate(
            "made", round(1 / total**2), 1, total, lambda: 0.0 if total < 0.03 else 0.9, int
        )

    return propose


def test_a_good_map_is_no_end():
    """Whoever looks on, because something is negative, gets maps of less error than any before."""
    maps = Made(of_every_error(0.95))
    errors = [each.total_error for each in rising(maps, Goal(), 10**9)]
    step = 0.95 * policy.FINER
    np.testing.assert_allclose(errors[:6], 0.05 * 0.95 * step ** np.arange(6))


def test_errors_alone_may_be_the_goal():
    propose, _ = shares([0.5, 0.3, 0.3])
    tried, is_kept = ways_to(propose, Goal(0.05, None))
    assert (is_kept, len(tried), tried[0].bytes) == (True, 1, 200)


def test_it_ends_where_no_less_error_is_to_be_had():
    propose, asked = shares([0.9, 0.8, 0.7])
    tried, is_kept = ways_to(propose, Goal())
    assert not is_kept
    assert tried[-1].total_error == 0.02
    assert len(asked) == 3
    propose, asked = shares([0.9] * 40)
    assert len(ways_to(propose)[0]) < 12
    assert asked[-1] == policy.LEAST_ERROR


def test_an_error_that_is_nearly_kept_is_not_the_end():
    """Tables of functions may add a little to what the search knew, at any of the errors."""

    def propose(error):
        return Candidate("made", 1, 1, 1.02 * error, lambda: 0.04 if error < 0.02 else 0.9, int)

    tried, is_kept = ways_to(propose)
    assert is_kept
    assert tried[-1].total_error < 0.0204
    tried, _ = ways_to(lambda error: Candidate("made", 1, 1, 1.2 * error, float, int))
    assert len(tried) == 1


@pytest.mark.parametrize(
    ("wrong", "errors", "expected"),
    [
        ([0.9, 0.21, 0.2], [0.03, 0.02, 0.01], 20),  # a little better is not worth the bytes
        ([0.9, 0.25, 0.2], [0.03, 0.02, 0.01], 30),
        ([0.0, 0.0, 0.0], [0.3, 0.2, 0.1], 30),
        ([0.0, 0.1, 0.2], [0.3, 0.105, 0.1], 20),  # what is worst counts: .3 of error, .2 of pixels
        ([np.nan, np.nan, np.nan], [np.nan, np.nan, np.nan], 10),
    ],
)
def test_where_none_is_good_the_least_wrong_is_taken(wrong, errors, expected):
    tried = [
        Candidate("made", size, 1, error, lambda share=share: share, int)
        for size, error, share in zip([10, 20, 30], errors, wrong, strict=True)
    ]
    assert least_wrong(tried, Goal(0.05, 0.05)).bytes == expected


def test_goals():
    assert Goal.of(None, None) == Goal(DEFAULT_ERROR, DEFAULT_SEEN)
    assert Goal.of(0.2, None) == Goal(0.2, None)  # whoever asks for an error alone means it
    assert Goal.of(None, 0.1) == Goal(DEFAULT_ERROR, 0.1)
    assert Goal.of(0.2, 0.1) == Goal(0.2, 0.1)


def test_half_of_a_goal_is_half_of_all_that_it_asks_for():
    assert Goal(0.04, 0.06).halved() == Goal(0.02, 0.03)
    assert Goal(0.04, None).halved() == Goal(0.02, None)


def test_both_errors_are_judged():
    """Each in units of what is allowed; what takes long is not found out in vain."""

    def unknown():
        raise AssertionError

    assert not Candidate("made", 1, 1, 0.051, unknown, int).keeps(Goal(0.05, 0.1))
    assert Candidate("made", 1, 1, 0.05, unknown, int).keeps(Goal(0.05, None))
    seen = Candidate("made", 1, 1, 0.02, lambda: 0.04, int)
    assert seen.badness(Goal(0.05, 0.1)) == pytest.approx(0.4)
    assert seen.badness(Goal(0.04, 0.1)) == pytest.approx(0.5)
    assert seen.badness(Goal(0.04, None)) == pytest.approx(0.5)
    assert seen.badness(Goal(0.05, 0.02)) == pytest.approx(2)
    assert not seen.keeps(Goal(0.05, 0.02))
    assert seen.wrong_share is seen.wrong_share
    at_least = Candidate("made", 1, 1, 0.02, unknown, int, find_least_share=lambda: 0.3)
    assert at_least.badness(Goal(0.05, 0.1)) == pytest.approx(3)


@pytest.mark.parametrize(
    ("error", "text"),
    [(0.0, "0"), (9.1e-8, "<0.01"), (1e-4, "0.01"), (0.0523, "5.2"), (0.996, "100"), (3.1, "310")],
)
def test_errors_are_said_without_powers_of_ten(error, text):
    assert rough(1, error, 0.3).errors_text == (
        f"{text}% RMS error and 30% of pixels wrong by more than 5%"
    )


@pytest.mark.parametrize(
    ("share", "missed", "kept_too", "is_worth"),
    [
        # Of a map that keeps what is asked a tenth of the bytes is worth it, where all is kept.
        (0.09, 0.9, True, True),
        (0.11, 0.9, True, False),
        (0.09, 1.01, True, False),
        # Where it does not, whatever keeps it; else what misses half as much, or less in half of
        # the bytes, or as much in a tenth of them.
        (0.99, 0.9, False, True),
        (0.49, 1.9, False, True),
        (0.51, 1.9, False, False),
        (9.0, 1.01, False, False),
        (9.0, 0.99, False, True),
        (0.49, 2.1, False, False),
        (0.09, 2.1, False, True),
        (0.11, 2.1, False, False),
        (0.09, 2.3, False, False),
    ],
)
def test_lamps_beside_a_map_have_to_be_worth_it(share, missed, kept_too, is_worth):
    """A program that knows nothing of them shows none. `missed` is in units of what is asked."""
    goal = Goal(0.04, 0.1)
    for of_error, of_share in ((missed, 0), (0, missed)):  # either may be the larger one
        found, whole = (
            Candidate("principal", size, 1, 0.04 * error, lambda wrong=wrong: 0.1 * wrong, None)
            for size, error, wrong in (
                (int(1e6 * share), of_error, of_share),
                (10**6, 0.5, 0.9 if kept_too else 2.0),
            )
        )
        assert is_worth_lamps(found, whole, goal, kept_too) == is_worth


@pytest.mark.parametrize(("times", "is_worth"), [(0.49, True), (0.51, False)])
def test_lamps_are_worth_any_bytes_where_a_map_misses_half_as_much(times, is_worth):
    """Neither keeps what is asked. The map of all light misses it four times."""
    found, whole = (
        Candidate("principal", size, 1, 0.04 * missed, lambda: 0.0, None)
        for size, missed in ((9 * 10**6, 4 * times), (10**6, 4.0))
    )
    assert is_worth_lamps(found, whole, Goal(0.04, 0.1), is_kept=False) == is_worth
    assert not is_worth_lamps(found, whole, Goal(0.04, 0.1), is_kept=True)


def test_a_map_and_lamps_beside_it_keep_an_error_together():
    for lamps in (0.0, 0.01, 0.03, policy.BESIDE * 0.05):
        assert np.hypot(lamps, error_beside(lamps, 0.05)) == pytest.approx(0.05)
    assert error_beside(0.0499, 0.05) == error_beside(policy.BESIDE * 0.05, 0.05) > 0.02
    assert error_beside(0.05, 0.05) == error_beside(0.2, 0.05) == 0.05
