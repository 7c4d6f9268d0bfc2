"""The form of each term of a BRDF that together take the fewest bytes for the error of their sum.

A diffuse term needs a single small cube, and a glossy one many. How many bytes one takes for its
part of the error depends on the light, so that the forms of all terms are compared together.
"""

from collections.abc import Iterator, Sequence
from functools import cached_property, partial
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from shrm_cli.arrays import Array
from shrm_cli.maps.joint import joint_error
from shrm_cli.maps.principal.plan import Form, Planner
from shrm_cli.maps.size import TRIED_SIZES, nothing_fits, sizes_of
from shrm_cli.plan import policy
from shrm_cli.plan.search import ROUNDING, Row, fewest_bytes
from shrm_cli.records import record

_FIRST_BYTES = 2**16
"""The bytes that the forms of several terms may have at first; they double until the error is kept,
so that not all forms have to be judged."""
_NEARLY_ALL = 1 / 3
"""What functions may miss, in units of what their tables do, where those alone are too coarse."""


@record
class Joint:
    """A form of each term."""

    forms: tuple[Form, ...]
    shares: tuple[float, ...] = (1.0,)
    """The RMS of the light of each term, relative to that of all."""

    @property
    def least_error(self) -> float:
        """The error of their sum without what bilinear look-ups add."""
        return joint_error(self.shares, [form.least_error for form in self.forms], 1.0)

    @cached_property
    def total_error(self) -> float:
        """The error of their sum, with those of bilinear look-ups and of half precision."""
        return joint_error(self.shares, [form.total_error for form in self.forms], 1.0)

    @property
    def bytes(self) -> int:
        """The bytes of all cubes in half precision, before they are packed."""
        return sum(form.bytes for form in self.forms)


@record(eq=False)
class Sharing:
    """The choices for all lobes of a BRDF."""

    planners: Sequence[Planner]
    """One for each term."""
    coherence: float = 1.0
    """The RMS of the light of all terms, relative to the sum of the RMS of each."""

    @cached_property
    def strengths(self) -> Array:
        """The RMS of the light that each term reflects."""
        return np.sqrt([planner.whole for planner in self.planners])

    @property
    def whole(self) -> float:
        """The RMS of the light that all terms reflect together."""
        return float(self.strengths.sum()) * self.coherence

    @cached_property
    def _shares(self) -> tuple[float, ...]:
        """The RMS of the light of each term, relative to that of all."""
        if len(self.planners) == 1:
            return (1.0,)
        return tuple((self.strengths / max(self.whole, 1e-300)).tolist())

    def errors(self, forms: Sequence[Form]) -> tuple[float, float]:
        """Return the error of a sum, and that of looking it up; terms count as independent."""
        predicted = joint_error(self.strengths, [form.error for form in forms], self.whole)
        filtered = joint_error(self.strengths, [form.filter_error for form in forms], self.whole)
        return predicted, filtered

    def joint(self, forms: tuple[Form, ...], is_exact: bool = False) -> Joint:
        """Return forms with the error of their sum; the exact one takes longer (`Planner.form`)."""
        if is_exact:
            pairs = zip(self.planners, forms, strict=True)
            forms = tuple(planner.form(each.counts, each.size, True) for planner, each in pairs)
        return Joint(forms, self._shares)

    def rows(self, max_size: int, sizes: Sequence[int] = TRIED_SIZES) -> Iterator[Row[Joint]]:
        """Yield all that fits into a number of bytes, and that might be best.

        The forms of a single term come in a row for each size of cubes; those of several terms in
        one, with every combination that has less error than all of fewer bytes.
        """
        if len(self.planners) == 1:
            for row in self.planners[0].rows(max_size, sizes):
                yield Row(row.count, row.bytes_of, partial(self._alone, row))
            return
        front = self._front(max_size, sizes)
        yield Row(len(front), lambda index: front[index].bytes, front.__getitem__)

    def _alone(self, row: Row[Form], index: int) -> Joint:
        return self.joint((row.candidate(index),))

    def _front(self, max_size: int, sizes: Sequence[int]) -> list[Joint]:
        """Return the combinations of forms that no other one beats, by rising bytes."""
        found: list[tuple[Form, ...]] = [()]
        costs, squares = np.zeros(1, dtype=np.int64), np.zeros(1)
        for planner, part in zip(self.planners, self._shares, strict=True):
            forms = [form for row in planner.rows(max_size, sizes) for form in row.every()]
            own_costs = np.array([form.bytes for form in forms], dtype=np.int64)
            own_squares = np.square([part * form.total_error for form in forms])
            best = _undominated(own_costs, own_squares)
            costs = np.add.outer(costs, own_costs[best]).ravel()
            squares = np.add.outer(squares, own_squares[best]).ravel()
            kept = _undominated(costs, squares)
            kept = kept[costs[kept] <= max_size]
            found = [(*found[k // len(best)], forms[best[k % len(best)]]) for k in kept]
            costs, squares = costs[kept], squares[kept]
        return [Joint(forms, self._shares) for forms in found]

    def within_error(self, error: float, max_size: int, size: int | None) -> tuple[Joint, bool]:
        """Find the forms of the fewest bytes with a total error; else the best ones that fit.

        `error` is the relative RMS error of the reflected light that may be made by all causes.

        Returns `joint`; and `is_met`, whether its error is at most the one that was asked for.

        Raises ArgumentError if no map fits.
        """
        sizes = sizes_of(size)
        most = max_size if len(self.planners) == 1 else min(_FIRST_BYTES, max_size)
        found = fewest_bytes(self.rows(most, sizes), error)
        while most < max_size and not (found and found[1]):
            most = min(2 * most, max_size)
            found = fewest_bytes(self.rows(most, sizes), error)
        if found is None:
            raise nothing_fits(size, len(self.planners))
        return found

    def kept(self, error: float, max_size: int, size: int | None) -> tuple[Joint, bool]:
        """Find the least forms that keep an error with their tables, too, which searches leave out.

        The arguments and results are those of `within_error`, of errors that are exact.
        """
        allowed = error
        for _ in range(policy.TRIES):
            found, is_met = self.within_error(allowed, max_size, size)
            exact = self.joint(found.forms, is_exact=True)
            # What tables add to an error stays, however many functions there are.
            added = exact.total_error**2 - found.total_error**2
            if not is_met or exact.total_error <= error:
                break
            # Functions that miss a third of what tables do make nearly the least error there is.
            left = max(error**2 - added, added * _NEARLY_ALL**2)
            if left >= allowed**2:
                break
            allowed = 0.999 * sqrt(left)
        return exact, is_met and exact.total_error <= error * ROUNDING


def _undominated(costs: NDArray[np.int64], squares: Array) -> NDArray[np.intp]:
    """Return what has less error than all that costs less, by rising costs."""
    order = np.lexsort((squares, costs))
    least = np.minimum.accumulate(squares[order])
    # What is no number is not left out: such light is refused elsewhere.
    return order[~(np.diff(least, prepend=np.inf) >= 0)]
