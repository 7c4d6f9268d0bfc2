"""What is kept in memory: once for all threads, read-only, and within its bytes; relative RMS."""

import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
import pytest

from shrm_cli.arrays import Memo, kept_order, relative_difference, relative_rms


def made(count, calls):
    def make():
        calls.append(count)
        return np.zeros(count)

    return make


def test_what_is_known_is_not_made_again():
    memo, calls = Memo(2**16), []
    first = memo.get("a", made(10, calls))
    assert memo.get("a", made(10, calls)) is first
    assert memo.get(("a", 1), made(20, calls)) is not first
    assert calls == [10, 20]


def test_those_used_longest_ago_make_room():
    memo, calls = Memo(10_000), []
    for key in "abc":
        memo.get(key, made(375, calls))  # 3000 bytes
    memo.get("a", made(375, calls))
    memo.get("d", made(375, calls))
    assert len(calls) == 4
    memo.get("a", made(375, calls))
    assert len(calls) == 4
    memo.get("b", made(375, calls))
    assert len(calls) == 5


def test_its_bytes_are_bounded_however_much_is_asked_for():
    memo = Memo(50_000)
    for number in range(2000):
        memo.get(number, lambda: (np.zeros(200), [np.ones(100)]))
        assert memo.bytes <= 50_000
    assert 10 < len(memo) < 30
    memo.clear()
    assert (memo.bytes, len(memo)) == (0, 0)
    memo.get(1, lambda: np.zeros(100))
    assert memo.bytes >= 800


def test_contents_without_arrays_are_bounded_too():
    memo = Memo(10_000)
    for number in range(1000):
        assert memo.get(number, lambda: 1.5) == 1.5
    assert len(memo) <= 50


def test_what_is_too_large_is_handed_out_and_not_kept():
    memo, calls = Memo(8000), []
    memo.get("small", made(10, calls))
    for _ in range(2):
        assert len(memo.get("large", made(900, calls))) == 900
    memo.get("small", made(10, calls))
    assert calls == [10, 900, 900]


def test_a_view_counts_with_all_that_it_keeps_in_memory():
    memo = Memo(2**20)

    def views():
        whole = np.zeros((100, 100))
        return whole[:1], whole[1:2]

    memo.get("views", views)
    assert 80_000 <= memo.bytes < 85_000


@dataclass(frozen=True)
class Pair:
    one: np.ndarray
    other: tuple


def test_nobody_can_change_what_others_are_given():
    memo = Memo(2**16)
    found = memo.get("a", lambda: Pair(np.zeros(3), (np.zeros(3), {"x": np.zeros(3)})))
    for array in (found.one, found.other[0], found.other[1]["x"]):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1


def test_what_cannot_be_made_is_not_kept():
    memo, calls = Memo(2**16), []

    def fails():
        raise ValueError("no")

    with pytest.raises(ValueError, match="no"):
        memo.get("a", fails)
    memo.get("a", made(3, calls))
    assert calls == [3]


def test_threads_get_the_same_object():
    """All of them ask for one content while it is made, and for others that drive it out."""
    memo, barrier = Memo(100_000), threading.Barrier(8)

    def make():
        barrier.wait(timeout=20)  # all eight are here before any has an answer
        return np.zeros(10)

    def churn(seed):
        order = np.random.default_rng(seed).integers(0, 60, 500)
        return all(
            memo.get(int(k), lambda k=k: np.full(300, k))[-1] == k and memo.bytes <= 100_000
            for k in order
        )

    with ThreadPoolExecutor(8) as pool:
        found = list(pool.map(lambda _: memo.get("one", make), range(8)))
        assert all(each is found[0] for each in found)
        assert all(pool.map(churn, range(8)))


def test_orders_are_kept_in_few_steps():
    kept = [kept_order(order) for order in range(65)]
    assert all(low <= high < low + 8 for low, high in enumerate(kept))
    assert len(set(kept)) == 9
    assert [kept_order(order) for order in (0, 8, 9)] == [0, 8, 16]


def test_errors_are_relative_to_the_second_array():
    found, truth = np.array([[1.0, 2.0], [3.0, 5.0]]), np.array([[1.0, 2.0], [3.0, 1.0]])
    assert relative_rms(9.0, 36.0) == 0.5
    np.testing.assert_allclose(relative_difference(found, truth), 4 / np.linalg.norm(truth))


def test_nothing_is_missed_of_nothing():
    assert relative_rms(0.0, 0.0) == 0
    assert relative_difference(np.ones(3), np.zeros(3)) == 0
