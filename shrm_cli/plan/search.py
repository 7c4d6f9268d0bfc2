"""The one search: of candidates that are known by bytes and errors, the fewest bytes that suffice.

A form of maps offers its candidates in rows. In a row the cubes have one size, and each candidate
has more of them than the one before it, and nearly always less error. So the first of a row that
keeps an error is about where halving finds one. Those of somewhat fewer bytes are then looked at
one by one, because what look-ups between texels blur may rise with a cube.
"""

from bisect import bisect_left
from collections.abc import Callable, Iterable, Iterator
from dataclasses import field, replace
from functools import cache, cached_property, partial
from math import inf, sqrt
from operator import itemgetter
from typing import Any, Generic, Protocol, TypeVar

from shrm_cli.messages import percent
from shrm_cli.plan import policy
from shrm_cli.records import record
from shrm_cli.vocabulary import DEFAULT_ERROR, DEFAULT_SEEN


class Sized(Protocol):
    """What the search knows of a candidate."""

    @property
    def bytes(self) -> int:
        """The bytes of its cubes in half precision, before they are packed."""

    @property
    def least_error(self) -> float:
        """A part of its total error that is known in no time."""

    @property
    def total_error(self) -> float:
        """Its relative RMS error, with those of bilinear look-ups and of half precision."""


ROUNDING = 1 + 1e-9
"""How much more than what was asked for counts as the same."""

C = TypeVar("C", bound=Sized)
D = TypeVar("D", bound=Sized)
M = TypeVar("M")


@record
class Row(Generic[C]):
    """Candidates of one size, from the fewest bytes to the most that are allowed."""

    count: int
    """The number of candidates."""
    bytes_of: Callable[[int], int]
    """Returns the most bytes that a candidate takes, by its index; it rises."""
    candidate: Callable[[int], C]
    """Returns a candidate by its index. Its error mostly falls with the index."""

    def mapped(self, of: "Callable[[C], D]") -> "Row[D]":
        """Return the row of what a function makes of the candidates, of each of them once."""
        return Row(self.count, self.bytes_of, cache(lambda index: of(self.candidate(index))))

    def every(self) -> list[C]:
        return [self.candidate(index) for index in range(self.count)]

    def below(self, most: float) -> int:
        """Return the number of candidates that take fewer bytes than so many."""
        return bisect_left(range(self.count), most, key=self.bytes_of)

    def first(self, error: float, last: int) -> C:
        """Find one that keeps an error, as the last one does, by halving."""
        index = bisect_left(
            range(last), True, key=lambda index: _has_at_most(self.candidate(index), error)
        )
        return self.candidate(index)


def _has_at_most(candidate: Sized, error: float) -> bool:
    """Tell whether a candidate has at most an error, by the part that is known in no time first."""
    return candidate.least_error <= error and candidate.total_error <= error


def fewest_bytes(
    rows: Iterable[Row[C]], error: float, look_near: bool = True
) -> tuple[C, bool] | None:
    """Find the candidate of the fewest bytes that keeps an error; else that of the least error.

    `error` is the total error that may be made. `look_near` tells whether to look past errors that
    rise with a cube.

    Returns `candidate`; and `is_met`, whether it keeps the error. None stands for both where the
    rows are empty.
    """
    rows = list(rows)
    found: C | None = None
    for row in rows:
        last = row.below(inf if found is None else found.bytes) - 1
        if len(rows) == 1 and look_near:  # no larger cubes could do instead
            last = _last_looked_up_well(row, error, last)
        if last >= 0 and _has_at_most(row.candidate(last), error):
            found = row.first(error, last)
    while (
        look_near
        and found is not None
        and (fewer := _first_near(rows, error, found.bytes)) is not None
    ):
        found = fewer
    if found is not None:
        return found, True
    best = min(least_errors(rows), key=lambda each: each.total_error, default=None)
    return None if best is None else (best, False)


def _last_looked_up_well(row: Row[C], error: float, last: int) -> int:
    """Return the index of a candidate with fewer cubes, where only look-ups miss what is asked.

    Few texels hold the first functions well, and those that hardly matter badly.
    """
    while last > 0:
        candidate = row.candidate(last)
        if candidate.least_error > error or candidate.total_error <= error:
            break
        last //= 2
    return last


def _first_near(rows: Iterable[Row[C]], error: float, most: int) -> C | None:
    """Return the first that keeps an error of those that take somewhat fewer bytes than known."""
    near: list[tuple[int, Row[C], int]] = []
    for row in rows:
        last = row.below(most) - 1
        if last < 0 or not _has_at_most(row.candidate(last), policy.NEARLY_KEPT * error):
            continue
        first = min(row.below(policy.NEAR * most), last)
        near += [(row.bytes_of(index), row, index) for index in range(first, last + 1)]
    near.sort(key=itemgetter(0))
    by_bytes = (row.candidate(index) for _, row, index in near)
    return next((each for each in by_bytes if _has_at_most(each, error)), None)


def least_errors(rows: Iterable[Row[C]]) -> list[C]:
    """Return the candidate of the least error of each row that has any."""
    return [row.candidate(row.count - 1) for row in rows if row.count]


# ---- what is seen --------------------------------------------------------------------------------


@record
class Goal:
    """What the picture made with a map has to keep."""

    error: float = DEFAULT_ERROR
    """The relative RMS error of the reflected light."""
    wrong_share: float | None = DEFAULT_SEEN
    """The share of what is visible whose luminance may be wrong by more than 5 %; None where only
    the error counts."""

    @classmethod
    def of(cls, error: float | None, seen: float | None) -> "Goal":
        """Return what a map has to keep, where one of the two or none is asked for.

        Whoever asks for an error of the light alone gets the bytes that it takes, and no more.
        """
        if error is not None and seen is None:
            return cls(error, None)
        return cls(
            DEFAULT_ERROR if error is None else error, DEFAULT_SEEN if seen is None else seen
        )

    def halved(self) -> "Goal":
        """Return the goal that allows half as much."""
        return Goal(self.error / 2, None if self.wrong_share is None else self.wrong_share / 2)


@record(eq=False)
class Candidate(Generic[M]):
    """A map that could be made."""

    form: str
    """Its representation."""
    bytes: int
    """The bytes of its cubes in half precision, before they are packed."""
    look_ups: int
    """The number of RGB cubes, each of which a shader looks up."""
    total_error: float
    """The relative RMS error, with those of bilinear look-ups and of half precision."""
    find_wrong_share: Callable[[], float | None] = field(repr=False)
    """Predicts the share of what is visible whose luminance is wrong, or returns None."""
    make: Callable[[], M] = field(repr=False)
    """Makes the map."""
    can_grow: bool = True
    """Whether maps of more bytes could hold more."""
    limit: str = ""
    """Why more bytes gain little, where that is known."""
    find_least_share: Callable[[], float | None] | None = field(default=None, repr=False)
    """Predicts nearly that share, or less, where the share itself takes long."""
    find_exact: "Callable[[], Candidate[M]] | None" = field(default=None, repr=False)
    """Looks closely at its errors, where those here leave out what takes long to be known."""

    @property
    def least_error(self) -> float:
        return self.total_error

    @cached_property
    def exact(self) -> "Candidate[M]":
        """The map with exact errors."""
        if self.find_exact is None:
            return self
        return replace(self.find_exact(), find_least_share=lambda: self.wrong_share)

    def let_go(self) -> None:
        """Forget the map with exact errors, which may hold its cubes."""
        vars(self).pop("exact", None)

    @cached_property
    def wrong_share(self) -> float | None:
        """The predicted share of what is visible whose luminance is wrong, where it is known."""
        return self.find_wrong_share()

    @cached_property
    def _least_share(self) -> float | None:
        return self.wrong_share if self.find_least_share is None else self.find_least_share()

    def badness(self, goal: Goal) -> float:
        """Return the larger of both errors, each in units of what the goal allows."""
        of_error, most = self.total_error / goal.error, goal.wrong_share
        if most is None or self._least_share is None:
            return of_error
        share = self._least_share
        if share <= most and self.wrong_share is not None:  # more than is missed tells nothing new
            share = self.wrong_share
        return max(of_error, share / most)

    @property
    def errors_text(self) -> str:
        """What is predicted of the picture, in words."""
        error = f"{percent(self.total_error)}% RMS error"
        if self.wrong_share is None:
            return error
        return f"{error} and {percent(self.wrong_share)}% of pixels wrong by more than 5%"

    def keeps(self, goal: Goal) -> bool:
        """Tell whether the map keeps what is asked."""
        # What takes long is found out last.
        return self.total_error <= goal.error * ROUNDING and self.badness(goal) <= ROUNDING


class Maps(Protocol):
    """The maps of a form that could be made, of which searches ask for some."""

    def candidate(self, error: float) -> Candidate[Any]:
        """Return the one of the fewest bytes that keeps an error, or the best one."""

    def rows(self, max_size: int) -> Iterable[Row[Candidate[Any]]]:
        """Yield all of at most so many bytes, as far as the light is known by what was asked."""


@record
class _Judged:
    """A map by how far it is from a goal: its `total_error` is 1 where it just keeps it."""

    rough: Candidate[Any]
    goal: Goal

    @property
    def bytes(self) -> int:
        return self.rough.bytes

    @property
    def least_error(self) -> float:
        return self.rough.total_error / self.goal.error

    @property
    def total_error(self) -> float:
        """The larger of the error and the share of wrong pixels, each over what is asked."""
        if self.least_error > 1:
            return self.least_error
        share, most = self.rough.wrong_share, self.goal.wrong_share
        if share is not None and most is not None and share > most:
            return share / most  # exact errors would change nothing, and take long
        of_error = self.rough.exact.total_error / self.goal.error
        return of_error if share is None or most is None else max(of_error, share / most)


def kept_in_fewest(rows: Iterable[Row[Candidate[M]]], goal: Goal) -> Candidate[M] | None:
    """Find the map of the fewest bytes that keeps a goal, if there is one, as the rows have it.

    Maps of one error differ in what is seen: those of few cubes of many texels miss more in dark
    places than those of many cubes of few texels, in the same bytes. Where look-ups show more wrong
    pixels than rows tell, a map is sought that leaves room for them.
    """
    rows, allowed = list(rows), goal
    for _ in range(policy.TRIES):
        judged = (row.mapped(partial(_Judged, goal=allowed)) for row in rows)
        # Shares of wrong pixels hardly rise with a cube, and take long.
        found, is_kept = fewest_bytes(judged, 1.0, look_near=False) or (None, False)
        if found is None or not is_kept:
            break
        rough, exact = found.rough, found.rough.exact
        if exact.keeps(goal):
            return rough
        shares = allowed.wrong_share, exact.wrong_share, rough.wrong_share
        most, with_look_ups, without = (0.0 if share is None else share for share in shares)
        room = most - (with_look_ups - without)
        if room <= 0:  # look-ups alone show more wrong pixels than there may be
            break
        allowed = replace(allowed, wrong_share=room)
    return None


def rising(maps: Maps, goal: Goal, max_size: int) -> Iterator[Candidate[Any]]:
    """Yield a form's candidates of ever less error, from the fewest bytes that keep the goal's on.

    They end where bytes, or the degrees that are known, allow no less error. Where the fewest bytes
    of an error show too many wrong pixels, those that keep what is asked are looked for among all
    maps of at most `max_size` bytes.
    """
    error, is_missed = goal.error, False
    while True:
        last = maps.candidate(error)
        if is_missed and last.bytes > policy.SPARED and last.keeps(goal):
            yield from _kept_ever_better(maps, goal, last.bytes - 1)
        yield last
        # What takes long is found out where more are asked for: bytes may tell enough.
        is_kept = last.keeps(goal)
        is_missed = not is_kept
        # Exact errors may miss what is asked by a little, which is not the end of the bytes.
        if last.total_error > policy.NEARLY_BEST * error or error <= policy.LEAST_ERROR:
            break
        step = policy.FINER
        if error == goal.error and not is_kept:
            # The first one tells how far it is: shares of wrong pixels fall with about the square
            # of the error. Less error than is needed may need more degrees, which take long.
            step = min(max(step, last.badness(goal) ** -0.5), 1 / policy.CLOSE)
        error = max(min(error, last.total_error) * step, policy.LEAST_ERROR)
    if is_missed:
        yield from _kept_ever_better(maps, goal, max_size)


def _kept_ever_better(maps: Maps, goal: Goal, max_size: int) -> Iterator[Candidate[Any]]:
    """Yield the map of the fewest bytes that keeps a goal, one that keeps half of it, and so on."""
    last = 0
    while goal.error >= policy.LEAST_ERROR:
        found = kept_in_fewest(maps.rows(max_size), goal)
        if found is None:
            return
        if found.bytes > last:
            last = found.bytes
            yield found.exact
        goal = goal.halved()


def first_kept(
    candidates: Iterable[Candidate[Any]], goal: Goal
) -> tuple[list[Candidate[Any]], bool]:
    """Return the candidates of a form up to the first that keeps a goal, and whether one does."""
    tried: list[Candidate[Any]] = []
    for candidate in candidates:
        tried.append(candidate)
        if candidate.keeps(goal):
            return tried, True
    return tried, False


def least_wrong(tried: Iterable[Candidate[Any]], goal: Goal) -> Candidate[Any]:
    """Return the candidate of the fewest bytes that is nearly as good as any, where none is good.

    How bad one is tells the largest of what it misses, in units of what may be missed.
    """
    tried = list(tried)
    bad = [each.badness(goal) for each in tried]
    good = [
        each for each, how in zip(tried, bad, strict=True) if not how > policy.MISSED * min(bad)
    ]
    return min(good, key=lambda each: each.bytes)


def error_beside(lamps: float, most: float) -> float:
    """Return the error that a map may have with lamps beside it.

    `lamps` is what is wrong with these, and `most` what both may miss together, in parts of the
    same light. Where lamps alone miss more, no map makes up for it, and it may miss as much as one
    without them.
    """
    if lamps >= most:
        return most
    return sqrt(most**2 - min(lamps, policy.BESIDE * most) ** 2)


def is_worth_lamps(found: Candidate[Any], whole: Candidate[Any], goal: Goal, is_kept: bool) -> bool:
    """Tell whether a map with lamps beside it is better than that of all light.

    Discs need no bytes, and are as sharp as the lobe. But a program that knows nothing of them
    shows no lamps at all, so that they have to be worth it. `is_kept` tells whether the map of all
    light keeps the goal, as the other one has to then.
    """
    is_far_smaller = found.bytes <= policy.FAR_SMALLER * whole.bytes
    if found.keeps(goal):
        return is_far_smaller or not is_kept
    times = found.badness(goal) / whole.badness(goal)
    is_better = times < 1 and found.bytes <= policy.WORTH_LAMPS * whole.bytes
    is_far_better = times <= policy.FAR_LESS_WRONG
    is_as_good = times <= policy.MISSED and is_far_smaller
    return not is_kept and (is_better or is_far_better or is_as_good)
