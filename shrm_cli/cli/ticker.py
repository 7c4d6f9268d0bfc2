"""Progress of many jobs: a bar with rate and time left on a terminal, and lines elsewhere."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from shrm_cli.cli.terminal import echo_message, has_terminal

if TYPE_CHECKING:
    from shrm_cli.batch.log import Totals

_EVERY = 10.0
"""Seconds between two lines."""


@contextmanager
def ticking(label: str, total: int, quiet: bool) -> Iterator[Callable[[Totals], None]]:
    """Yield a callable that shows how far a run has come.

    Parameters
    ----------
    label : str
    total : int
        Jobs in all.
    quiet : bool
    """
    if quiet:
        yield lambda totals: None
    elif has_terminal():
        from tqdm import tqdm

        with tqdm(desc=label, total=total, delay=1.0, file=sys.stderr, unit="job") as bar:

            def show(totals: Totals) -> None:
                bar.update(totals.done - bar.n)
                if totals.failed:
                    bar.set_postfix(failed=totals.failed, refresh=False)

            yield show
    else:
        yield _Lines(label)


class _Lines:
    """A line every few seconds, for logs of farms."""

    def __init__(self, label: str) -> None:
        self._label = label
        self._begun = self._told = time.monotonic()

    def __call__(self, totals: Totals) -> None:
        now = time.monotonic()
        if now - self._told < _EVERY:
            return
        self._told = now
        rate = totals.done / (now - self._begun)
        left = (totals.jobs - totals.done) / max(rate, 1e-9)
        failed = f", {totals.failed:,} failed" if totals.failed else ""
        echo_message(
            f"{self._label}: {totals.done:,} of {totals.jobs:,}{failed}, {rate:.3g} a second, "
            f"{_duration(left)} left"
        )


def _duration(seconds: float) -> str:
    """Return a time in the unit that suits it."""
    if seconds < 100:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 6000 else f"{seconds / 3600:.1f} h"
