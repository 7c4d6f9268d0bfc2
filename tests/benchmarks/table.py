"""The rows of the benchmark table: how they are timed, and how they are printed."""

import statistics
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass


@dataclass(frozen=True)
class Row:
    """One comparison with a reference.

    Attributes
    ----------
    name : str
        What is timed.
    ours, reference : float
        Median times of both; milliseconds unless the note says otherwise.
    ratio : float
        The median of the ratios of our time and the reference's, pair by pair.
    bar : float or None
        The largest ratio that is good enough; None for a row that only informs.
    note : str
        Why both do equal work.
    """

    name: str
    ours: float
    reference: float
    ratio: float
    bar: float | None = None
    note: str = ""

    @property
    def missed(self) -> bool:
        """Whether the bar is set and the ratio lies above it."""
        return self.bar is not None and not self.ratio <= self.bar


def measure(
    name: str,
    ours: Callable[[], object],
    reference: Callable[[], object],
    *,
    bar: float | None = None,
    note: str = "",
    prepare: Callable[[], object] | None = None,
    pairs: int = 9,
) -> Row:
    """Time two functions in turn (A B A B ...), after one unmeasured pair.

    Parameters
    ----------
    name, bar, note
        The attributes of the row.
    ours, reference : callable
        The two functions.
    prepare : callable, optional
        Called, unmeasured, before each call of `ours`; for instance to empty its caches.
    pairs : int
        How often both are timed.

    Returns
    -------
    Row
    """
    first, second = [], []
    for attempt in range(pairs + 1):
        if prepare is not None:
            prepare()
        elapsed = _milliseconds(ours), _milliseconds(reference)
        if attempt:
            first.append(elapsed[0])
            second.append(elapsed[1])
    ratio = statistics.median(a / b for a, b in zip(first, second, strict=True))
    return Row(name, statistics.median(first), statistics.median(second), ratio, bar, note)


def fastest(candidates: Iterable[Callable[[], object]]) -> Callable[[], object]:
    """Return the candidate with the least time in three rounds: the reference at its best."""
    candidates = list(candidates)
    best = [float("inf")] * len(candidates)
    for _ in range(3):
        for at, candidate in enumerate(candidates):
            best[at] = min(best[at], _milliseconds(candidate))
    return candidates[best.index(min(best))]


def print_table(rows: Iterable[Row]) -> None:
    """Print the rows as one aligned table, and how many bars were missed."""
    rows = list(rows)
    header = ("name", "ours (ms)", "reference (ms)", "ratio", "bar", "", "note")
    cells = [
        (
            row.name,
            f"{row.ours:.2f}",
            f"{row.reference:.2f}",
            f"{row.ratio:.2f}",
            "" if row.bar is None else f"<= {row.bar:.4g}",
            "" if row.bar is None else "MISSED" if row.missed else "ok",
            row.note,
        )
        for row in rows
    ]
    widths = [max(len(line[k]) for line in [header, *cells]) for k in range(len(header))]
    for line in [header, *cells]:
        name, *numbers, bar, verdict, note = line
        padded = [name.ljust(widths[0])]
        padded += [text.rjust(width) for text, width in zip(numbers, widths[1:4], strict=True)]
        padded += [bar.rjust(widths[4]), verdict.ljust(widths[5]), note]
        print("  ".join(padded).rstrip())
    barred = [row for row in rows if row.bar is not None]
    print(f"{sum(row.missed for row in barred)} of {len(barred)} bars missed")


def _milliseconds(function: Callable[[], object]) -> float:
    # Idle BLAS threads keep spinning for some 100 ms and would slow down the next function.
    time.sleep(0.15)
    start = time.perf_counter()
    function()
    return (time.perf_counter() - start) * 1e3
