"""All that commands print passes through here: nothing that a file holds can command a terminal.

Names of channels, attributes, messages of libraries and arguments may hold any characters. Those
that a terminal obeys or hides are printed as escapes such as ``\\x1b``, and endless words are cut.
URLs lose their passwords and signatures.

Progress is a bar on a terminal, which moves on while nothing is reported, or lines elsewhere.
"""

from __future__ import annotations

import errno
import json
import math
import os
import re
import sys
import threading
import time
import unicodedata
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any, TextIO, TypeVar

import click

from shrm_cli.cli import usage
from shrm_cli.messages import shown

if TYPE_CHECKING:
    from tqdm import tqdm

    from shrm_cli.batch.log import Totals
    from shrm_cli.progress import Progress

_MOST_WORD = 400
"""The most characters of a word in an error or a warning; paths and arguments are such words."""
_MOST_MESSAGE = 1200
"""The most characters of an error or a warning."""
_MOST_RESULT = 2000
"""The most characters of a word in a result."""
_UNSAFE = ("Cc", "Cf", "Cn", "Co", "Cs", "Zl", "Zp")
"""Categories of Unicode: control characters of both sets, what turns the direction of the text or
cannot be seen, what no font has, halves of surrogates, and what breaks lines."""
_SUSPECT = re.compile(r"[^\n -~]")
_BYTES = range(0xDC80, 0xDD00)
"""What Python puts in the place of bytes that are no text."""


def has_terminal() -> bool:
    """Whether a person may see what is printed to stderr while a command works."""
    return sys.stderr is not None and sys.stderr.isatty()


def echo(text: str, err: bool = False) -> None:
    """Print lines of text to stdout or stderr, with what a terminal would obey as escapes.

    Characters that the encoding of the stream lacks are printed as escapes, too. If there is no
    stderr, nothing is printed there.

    Raises OSError if there is no stdout.
    """
    _write(_shortened(escaped(shown(text)), _MOST_RESULT), err)


def echo_lines(lines: Sequence[str], err: bool = False) -> None:
    """Print lines, in which names that hold line feeds break none."""
    echo("\n".join(line.replace("\n", _escape("\n")) for line in lines), err)


def echo_message(text: str) -> None:
    """Print an error or a warning to stderr, as one line of limited length."""
    line = _shortened(escaped(shown(" ".join(text.split()))), _MOST_WORD)
    _write(_cut(line, _MOST_MESSAGE), err=True)


def echo_json(value: Any) -> None:
    """Print a value to stdout as JSON, with its keys in their given order.

    JSON has no infinity and no NaN, which become null.
    """
    text = json.dumps(_finite(value), indent=2, ensure_ascii=False, allow_nan=False)
    _write(_SUSPECT.sub(lambda found: _json_escape(found[0]), text), err=False)


def conclude(
    result: dict[str, Any],
    lines: Sequence[str],
    warnings: Sequence[str] = (),
    failures: Sequence[str] = (),
    err: bool = False,
) -> None:
    """Print what a command has done, as JSON or as lines of text; warnings go to stderr.

    `result` is what is printed as JSON with --json; the warnings are added to it. `lines` are what
    is printed as text, but with --quiet. `warnings` may name arguments of the library in backticks;
    they are left out with --quiet. `failures` are what could not be made; if there is any, the
    command exits with 1. `err` tells whether the lines go to stderr, because stdout holds something
    else.
    """
    tell({**result, "warnings": [usage.flags(line) for line in warnings]}, lines, err)
    warn(warnings)
    for line in failures:
        echo_message(f"Failed: {line}")
    if failures:
        sys.exit(1)


def tell(result: Any, lines: Sequence[str], err: bool = False) -> None:
    """Print a result, as JSON with --json, or else as lines of text, if any, but with --quiet."""
    if usage.wants_json():
        echo_json(result)
    elif lines and not usage.is_quiet():
        echo_lines(lines, err)


def warn(lines: Sequence[str]) -> None:
    """Print warnings to stderr; they may name arguments of the library in backticks."""
    for line in [] if usage.is_quiet() else lines:
        echo_message(f"Warning: {usage.flags(line)}")


def announce(lines: Sequence[str]) -> None:
    """Say on a terminal, before long work begins, what it will be."""
    if not usage.is_quiet() and has_terminal():
        echo_lines(lines, err=True)


def columns(rows: Sequence[Sequence[str]], left: Collection[int] = (0,)) -> list[str]:
    """Return a table as lines, whose cells stand to the right, but in some columns to the left."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    to_left = {index % len(widths) for index in left}
    return [
        "  ".join(
            cell.ljust(width) if index in to_left else cell.rjust(width)
            for index, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in rows
    ]


def escaped(text: str) -> str:
    """Return a text with escapes in the place of what terminals obey or hide, but line feeds."""
    return _SUSPECT.sub(lambda found: _escape(found[0]), text)


def _escape(char: str) -> str:
    if unicodedata.category(char) not in _UNSAFE:
        return char
    code = ord(char)
    if code in _BYTES:
        code -= 0xDC00
    if code < 2**8:
        return f"\\x{code:02x}"
    return f"\\u{code:04x}" if code < 2**16 else f"\\U{code:08x}"


def _json_escape(char: str) -> str:
    is_safe = unicodedata.category(char) not in _UNSAFE and _fits(char, sys.stdout)
    return char if is_safe else json.dumps(char)[1:-1]


def _fits(char: str, stream: Any) -> bool:
    try:
        char.encode(getattr(stream, "encoding", None) or "utf-8")
    except UnicodeEncodeError:
        return False
    return True


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(each) for each in value]
    if isinstance(value, str):
        return shown(value)
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _shortened(text: str, most: int) -> str:
    """Cut each word that is too long in its middle."""
    return re.sub(rf"\S{{{most},}}", lambda found: _cut(found[0], most), text)


def _cut(text: str, most: int) -> str:
    if len(text) <= most:
        return text
    kept = (most - 3) // 2
    return f"{text[:kept]}...{text[-kept:]}"


def _write(text: str, err: bool) -> None:
    stream = sys.stderr if err else sys.stdout
    if stream is None:  # it was closed before the process began
        raise OSError(errno.EBADF, os.strerror(errno.EBADF))
    encoding = getattr(stream, "encoding", None) or "utf-8"
    try:
        click.echo(text.encode(encoding, "backslashreplace").decode(encoding), file=stream)
    except OSError:
        if not err:
            raise
        tell_nobody()  # what is done does not fail because nobody can be told of it


def tell_nobody() -> None:
    """Drop all that goes to stderr from now on."""
    sys.stderr = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115, it stays open


Shown = TypeVar("Shown", "_LongWork", "_Bar")
_BEGAN = time.monotonic()
_SILENCE = 1.0
"""Seconds after the beginning of the process in which no bar is shown."""
_LEAST_SILENCE = 0.3
"""Seconds of work for which no bar is shown, however long it took to begin."""
_BEAT = 0.25
"""Seconds between two drawings of a bar that nothing is reported to."""
_LONG = 3.0
"""The least seconds of work left that a line tells of; what takes less is hardly waited for."""
_LONG_SILENCE = 30.0
"""Seconds between two lines about long work where there is no terminal."""
_EVERY = 10.0
"""Seconds between two lines about many jobs."""


@contextmanager
def progress_bar(label: str) -> Iterator[Progress | None]:
    """Yield a callable (done, all) that shows progress on a terminal, after the first second.

    It is None with --quiet. The bar shows the time that passes while nothing is reported, too, so
    that nobody takes long steps for a process that hangs. Where there is no terminal, long work
    prints a line now and then, also within such steps.
    """
    if usage.is_quiet() or sys.stderr is None:
        yield None
        return
    if not has_terminal():
        with _own_stderr() as stream, _beating(_LongWork(label, stream)) as work:
            yield work
        return
    from tqdm import tqdm

    from shrm_cli.cli.bar import bar_options  # what prints to no terminal is spared it

    delay = max(_LEAST_SILENCE, _SILENCE - (time.monotonic() - _BEGAN))
    options = {**bar_options(label), "delay": delay, "mininterval": 0.1}
    with (
        _own_stderr() as stream,
        tqdm(file=stream, **options) as bar,
        _beating(_Bar(bar, stream)) as shown,
    ):
        yield shown


@contextmanager
def _beating(shown: Shown) -> Iterator[Shown]:
    """Yield what shows progress, whose `beat` runs in a thread of its own meanwhile."""
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


class _Lines:
    """Lines about long work now and then, for logs."""

    def __init__(self, label: str) -> None:
        self.label = label
        self._begun = self._told = time.monotonic()

    def spent(self, seconds: float) -> float | None:
        """Return the seconds since the work began, if the last line was told so long ago."""
        now = time.monotonic()
        if now - self._told < seconds:
            return None
        self._told = now
        return now - self._begun


class _LongWork(_Lines):
    """Lines about how far work is, and how long the rest of it will take."""

    def __init__(self, label: str, stream: TextIO) -> None:
        super().__init__(label)
        self._stream, self._lock = stream, threading.Lock()
        self._now = self._share = 0.0

    def __call__(self, done: int, total: int) -> None:
        if 0 < done < total:
            self._now = done / total
            self._tell()

    def beat(self, over: threading.Event) -> None:
        """Tell of the time that passes while nothing is reported, until something is over."""
        while not over.wait(_LONG_SILENCE):
            self._tell()

    def _tell(self) -> None:
        with self._lock:
            if (spent := self.spent(_LONG_SILENCE)) is None:
                return
            # A step that takes long tells nothing of the rest, nor do searches that go on at the
            # end.
            share, before = self._now, self._share
            left = spent / share - spent if share > before else 0.0
            text = f", about {_duration(left)} left" if left >= 1 else ""
            self._share = share
            line = f"{self.label}: {int(100 * share)}% after {_duration(spent)}{text}\n"
            with suppress(OSError, ValueError):  # what is done goes on though nobody is told
                self._stream.write(line)
                self._stream.flush()


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
def ticking(total: int) -> Iterator[Callable[[Totals], None]]:
    """Yield a callable that shows how far a run of many jobs has come, and how fast."""
    if usage.is_quiet():
        yield lambda totals: None
    elif has_terminal():
        from tqdm import tqdm

        with tqdm(desc="baking", total=total, delay=1.0, file=sys.stderr, unit="job") as bar:

            def show(totals: Totals) -> None:
                bar.update(totals.done - bar.n)
                if totals.failed:
                    bar.set_postfix(failed=totals.failed, refresh=False)

            yield show
    else:
        yield _Jobs("baking")


class _Jobs(_Lines):
    """Lines about many jobs, for logs of farms."""

    def __call__(self, totals: Totals) -> None:
        spent = self.spent(_EVERY)
        if spent is None:
            return
        rate = totals.done / spent
        left = (totals.jobs - totals.done) / max(rate, 1e-9)
        failed = f", {totals.failed:,} failed" if totals.failed else ""
        echo_message(
            f"{self.label}: {totals.done:,} of {totals.jobs:,}{failed}, {rate:.3g} a second, "
            f"{_duration(left)} left"
        )


def _duration(seconds: float) -> str:
    """Return a time in the unit that suits it."""
    if seconds < 100:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 6000 else f"{seconds / 3600:.1f} h"
