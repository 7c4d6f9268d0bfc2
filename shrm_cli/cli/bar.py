"""Progress: a bar on a terminal, which moves on while nothing is reported, or lines elsewhere."""

from __future__ import annotations

import os
import sys
import threading
import time
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, TextIO

from shrm_cli.cli.terminal import echo_message, has_terminal
from shrm_cli.cli.usage import is_quiet

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from tqdm import tqdm

    from shrm_cli.batch.log import Totals
    from shrm_cli.progress import Progress

_BEGAN = time.monotonic()
_SILENCE = 1.0
"""Seconds after the beginning of the process in which no bar is shown."""
_LEAST_SILENCE = 0.3
"""Seconds of work for which no bar is shown, however long it took to begin."""
_FORMAT = "{l_bar}{bar}| {elapsed}<{remaining}"
_BEAT = 0.25
"""Seconds between two drawings of a bar that nothing is reported to."""
_LONG = 3.0
"""The least seconds of work left that a line tells of; what takes less is hardly waited for."""
_EVERY = 10.0
"""Seconds between two lines about many jobs."""


@contextmanager
def progress_bar(label: str) -> Iterator[Progress | None]:
    """Yield a callable (done, all) that shows progress on a terminal, after the first second.

    It is None if there is no terminal, or with --quiet. The bar shows the time that passes
    while nothing is reported, too, so that nobody takes long steps for a process that hangs.
    """
    if is_quiet() or not has_terminal():
        yield None
        return
    from tqdm import tqdm

    delay = max(_LEAST_SILENCE, _SILENCE - (time.monotonic() - _BEGAN))
    options: dict[str, Any] = {"desc": label, "total": 1, "delay": delay, "bar_format": _FORMAT}
    # Reports come unevenly: the mean rate tells best how much time is left.
    options |= {"leave": False, "smoothing": 0, "miniters": 0, "mininterval": 0.1}
    with _own_stderr() as stream, tqdm(file=stream, **options) as bar:
        shown = _Bar(bar, stream)
        over = threading.Event()
        beating = threading.Thread(target=shown.beat, args=(over,), daemon=True)
        beating.start()
        try:
            yield shown
        finally:
            over.set()
            beating.join()


@contextmanager
def _own_stderr() -> Iterator[TextIO]:
    """Yield stderr by a descriptor of its own.

    What is printed to that of the process while an image library reads counts as the library's
    noise, and is kept off the terminal.
    """
    try:
        number = os.dup(sys.stderr.fileno())
    except (OSError, ValueError):  # a stream in memory, or a closed one
        yield sys.stderr
        return
    with open(number, "w", encoding=sys.stderr.encoding, errors="replace") as stream:
        yield stream


class _Bar:
    """Progress on a terminal, and one line about how long it will take where that is long."""

    def __init__(self, bar: tqdm[Any], stream: TextIO) -> None:
        self._bar, self._stream = bar, stream
        self._lock = threading.Lock()

    def __call__(self, done: int, total: int) -> None:
        with self._lock:
            self._bar.total = total
            self._bar.update(done - self._bar.n)

    def tell_time_left(self, seconds: float) -> None:
        if seconds >= _LONG:
            label = self._bar.desc.rstrip(": ")
            with self._lock:
                self._bar.write(f"{label} takes about {seconds:.0f} s more", self._stream)

    def beat(self, over: threading.Event) -> None:
        """Draw the bar again and again, until something is over or the terminal is gone."""
        while not over.wait(_BEAT):
            try:
                with self._lock:
                    self._bar.update(0)
            except (OSError, ValueError):
                return


@contextmanager
def ticking(label: str, total: int) -> Iterator[Callable[[Totals], None]]:
    """Yield a callable that shows how far a run of many jobs has come, and how fast.

    Parameters
    ----------
    label : str
    total : int
        Jobs in all.
    """
    if is_quiet():
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
