"""The search for the fewest bytes, against trying everything."""

from dataclasses import dataclass

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
    least_errors,
    least_wrong,
    rising,
)


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
    tried, is_kept = first_kept(propose, Goal(0.05, 0.05))
    assert is_kept
    assert (tried[-1].wrong_share, tried[-1].bytes) == (0.05, 800)
    # The next error is asked for in terms of what was found, not of what was asked.
    np.testing.assert_allclose(asked[:3], [0.05, 0.04 * policy.FINER, 0.02 * policy.FINER])


@pytest.mark.parametrize(
    ("wrong", "step"),
    [(0.4, policy.FINER), (0.0625, 0.8**0.5), (0.0505, 1 / policy.CLOSE), (0.01, policy.FINER)],
)
def test_the_first_miss_tells_how_much_less_error_is_needed(wrong, step):
    """Shares of wrong pixels fall with the square of the error; later steps are whole ones."""
    asked = []

    def propose(error):
        asked.append(error)
        return Candidate("made", round(1 / error), 1, error, lambda: wrong, int)

    list(rising(propose, Goal(0.05, 0.05)))
    np.testing.assert_allclose(asked[1:3], 0.05 * step * policy.FINER ** np.arange(2))


def test_between_what_misses_and_what_keeps_bytes_are_saved():
    """Of maps of every error, whose bytes double with each step, the first good one is met."""
    for bound in np.geomspace(0.006, 0.049, 40):
        asked = []

        def propose(error, bound=bound, asked=asked):
            asked.append(error)
            bytes_, is_seen = round(1e6 / error**2), error <= bound
            return Candidate("made", bytes_, 1, error, lambda: 0.0 if is_seen else 0.9, int)

        tried, is_kept = first_kept(propose, Goal(0.05, 0.05))
        assert is_kept
        assert bound / policy.CLOSE <= tried[-1].total_error <= bound
        assert len(asked) == len(tried) + 2


def test_where_no_less_error_is_to_be_had_the_bytes_are_no_more_than_needed():
    """The last map is proposed in place of all errors below its own, in all the bytes."""

    def propose(error):
        found, bytes_ = (error, round(1 / error)) if error > 0.026 else (0.0245, 30_000)
        return Candidate("made", bytes_, 1, found, lambda: 0.0 if found <= 0.03 else 0.06, int)

    tried, is_kept = first_kept(propose, Goal(0.05, 0.05))
    assert (is_kept, len(tried)) == (True, 4)  # the first miss asks for a small step
    assert tried[-1].bytes < 40


def of_every_error(times):
    """Propose maps whose errors are a little less or more than is asked; good ones below 3 %."""
    asked = []

    def propose(error):
        asked.append(error)
        total = times * error
        return Candidate(
            "made", round(1 / total**2), 1, total, lambda: 0.0 if total < 0.03 else 0.9, int
        )

    return propose, asked


def test_what_was_found_between_is_no_end():
    """Whoever looks on, because something is negative, gets maps of less error than any before."""
    step = 0.95 * policy.FINER
    errors = [each.total_error for each in rising(of_every_error(0.95)[0], Goal(0.05, 0.05))]
    last = 0.05 * 0.95 * step**2
    assert 1.2 * last < errors[2] < 0.03
    np.testing.assert_allclose(errors[3:6], last * step ** np.arange(1, 4))


def test_errors_that_are_nearly_kept_are_looked_between_too():
    propose, asked = of_every_error(1.02)
    first_kept(propose, Goal(0.05, 0.05))
    most, least = 1.02 * 0.05 * policy.FINER ** np.array([1, 2])
    between = np.sqrt(least * most)
    np.testing.assert_allclose(asked[3:5], [between, np.sqrt(least * between)])


def asked_of(totals, sizes):
    """The errors that are asked for, of maps with these errors, of which the last one is good."""
    asked = []

    def propose(error):
        asked.append(error)
        index = next(k for k in range(len(totals)) if totals[k] <= error)
        is_last = index == len(totals) - 1
        return Candidate(
            "made", sizes[index], 1, totals[index], lambda: 0.0 if is_last else 0.9, int
        )

    tried, is_kept = first_kept(propose, Goal(0.05, 0.05))
    assert is_kept
    assert tried[-1].bytes == sizes[-1]
    return asked


def test_what_is_found_between_narrows_the_search():
    """By its bytes, where the best of what misses has nearly as many, and by its own error."""
    step = 0.05 * policy.FINER
    assert len(asked_of([0.05, 0.0405, 0.0345], [100, 200, 210])) == 3
    first, second, third = asked_of([0.05, 0.0405, 0.0345], [100, 110, 1000])[1:]
    np.testing.assert_allclose([first, second], [step, np.sqrt(step * 0.05)])
    np.testing.assert_allclose(third, np.sqrt(step * 0.0405))


@pytest.mark.parametrize(("more", "count"), [(1.24, 2), (1.26, 4)])
def test_what_would_save_few_bytes_is_not_looked_for(more, count):
    asked = []

    def propose(error):
        asked.append(error)
        is_kept = error < 0.05
        bytes_ = round(1000 * more) if is_kept else 1000
        return Candidate("made", bytes_, 1, error, lambda: 0.0 if is_kept else 0.9, int)

    first_kept(propose, Goal(0.05, 0.05))
    assert len(asked) == count


def test_errors_alone_may_be_the_goal():
    propose, _ = shares([0.5, 0.3, 0.3])
    tried, is_kept = first_kept(propose, Goal(0.05, None))
    assert (is_kept, len(tried), tried[0].bytes) == (True, 1, 200)


def test_it_ends_where_no_less_error_is_to_be_had():
    propose, asked = shares([0.9, 0.8, 0.7])
    tried, is_kept = first_kept(propose, Goal())
    assert not is_kept
    assert tried[-1].total_error == 0.02
    assert len(asked) == 3
    propose, asked = shares([0.9] * 40)
    assert len(list(rising(propose, Goal()))) < 12
    assert asked[-1] == policy.LEAST_ERROR


def test_an_error_that_is_nearly_kept_is_not_the_end():
    """Tables of functions may add a little to what the search knew, at any of the errors."""

    def propose(error):
        return Candidate("made", 1, 1, 1.02 * error, lambda: 0.04 if error < 0.02 else 0.9, int)

    tried, is_kept = first_kept(propose, Goal())
    assert is_kept
    assert tried[-1].total_error < 0.0204
    tried, _ = first_kept(lambda error: Candidate("made", 1, 1, 1.2 * error, float, int), Goal())
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
    assert Goal.of(None, None) == Goal(policy.ERROR, policy.WRONG_SHARE)
    assert Goal.of(0.2, None) == Goal(0.2, None)  # whoever asks for an error alone means it
    assert Goal.of(None, 0.1) == Goal(policy.ERROR, 0.1)
    assert Goal.of(0.2, 0.1) == Goal(0.2, 0.1)


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


@pytest.mark.parametrize(
    ("share", "missed", "kept_too", "is_worth"),
    [
        # Of a map that keeps what is asked a tenth of the bytes is worth it, where all is kept.
        (0.09, 0.9, True, True),
        (0.11, 0.9, True, False),
        (0.09, 1.01, True, False),
        # Where it does not, whatever keeps it; else what misses less in half of the bytes, or as
        # much in a tenth of them.
        (0.99, 0.9, False, True),
        (0.49, 1.9, False, True),
        (0.51, 1.9, False, False),
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


def test_a_map_and_lamps_beside_it_keep_an_error_together():
    for lamps in (0.0, 0.01, 0.03, policy.BESIDE * 0.05):
        assert np.hypot(lamps, error_beside(lamps, 0.05)) == pytest.approx(0.05)
    assert error_beside(0.0499, 0.05) == error_beside(policy.BESIDE * 0.05, 0.05) > 0.02
    assert error_beside(0.05, 0.05) == error_beside(0.2, 0.05) == 0.05
