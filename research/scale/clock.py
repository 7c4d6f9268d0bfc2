"""Processor seconds of the parts of a prefilter, told apart while the real program runs.

The functions in which a part begins are wrapped for the time of a measurement. The seconds of a
part are its own: what other parts take that it calls is theirs. Processor seconds change far less
than elapsed ones when other processes share the machine.
"""

import functools
import importlib
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

BEGINNINGS = {
    "shrm_cli.probe.image_file:ImageFile.open": "read",
    "shrm_cli.probe.image_file:ImageFile.read": "read",
    "shrm_cli.probe.probe:Probe.digest": "hash",
    "shrm_cli.probe.lighting:_project_image": "project",
    "shrm_cli.orders:cached_coefficients": "coefficients",
    "shrm_cli.maps.shrm.shrm:reflected_coefficients": "couple",
    "shrm_cli.maps.shrm.shrm:synthesize_cube": "synthesise",
    "shrm_cli.maps.stored:store": "encode",
    "shrm_cli.files.exr:write": "write",
}
"""Functions by module, and the part that begins with each. What is in no other part predicts."""
REST = "predict"
PARTS = (
    "read", "hash", "project", "coefficients", "couple", "synthesise", REST, "encode", "write",
)  # fmt: skip
"""The parts of a prefilter in the order in which they begin."""

Seconds = dict[str, float]
"""Processor seconds by the names of parts."""


class Clock:
    """Counts the processor seconds of parts, each without those that it calls.

    Attributes
    ----------
    seconds : dict of str to float
        Only the parts that have begun are there.
    """

    def __init__(self, now: Callable[[], float] = time.process_time) -> None:
        self.seconds: Seconds = {}
        self._now = now
        self._inside: list[str] = []
        self._since = now()

    def _count(self) -> None:
        """Give the time since the last change of part to the part that is going on."""
        now = self._now()
        if self._inside:
            part = self._inside[-1]
            self.seconds[part] = self.seconds.get(part, 0.0) + now - self._since
        self._since = now

    @contextmanager
    def inside(self, part: str) -> Iterator[None]:
        """Count what the block takes as time of a part."""
        self._count()
        self._inside.append(part)
        try:
            yield
        finally:
            self._count()
            self._inside.pop()

    @contextmanager
    def watching(self) -> Iterator[None]:
        """Wrap the functions in which parts begin, for the time of the block."""
        kept = []
        for name, part in BEGINNINGS.items():
            holder, attribute = _found(name)
            original = vars(holder)[attribute]
            kept.append((holder, attribute, original))
            setattr(holder, attribute, self._wrapped(original, part))
        try:
            yield
        finally:
            for holder, attribute, original in kept:
                setattr(holder, attribute, original)

    def _wrapped(self, original: Any, part: str) -> Any:
        """Return a function, or a class method, that counts as a part."""
        if isinstance(original, classmethod):
            return classmethod(self._wrapped(original.__func__, part))

        @functools.wraps(original)
        def counted(*arguments: Any, **keywords: Any) -> Any:
            with self.inside(part):
                return original(*arguments, **keywords)

        return counted


def _found(name: str) -> tuple[Any, str]:
    """Return the module or class that a name of `BEGINNINGS` belongs to, and its attribute."""
    module, _, path = name.partition(":")
    *outer, attribute = path.split(".")
    return functools.reduce(getattr, outer, importlib.import_module(module)), attribute


def seconds_of_parts(work: Callable[[], object], repeats: int) -> Seconds:
    """Return the median processor seconds of each part of some work, after one run to warm up.

    Parameters
    ----------
    work : callable
        Done `repeats` + 1 times.
    repeats : int
    """
    work()
    found: list[Seconds] = []
    for _ in range(repeats):
        clock = Clock()
        with clock.watching(), clock.inside(REST):
            work()
        found.append(clock.seconds)
    from statistics import median  # cold.py counts what is imported

    return {part: median(each.get(part, 0.0) for each in found) for part in PARTS}


def seconds_of(work: Callable[[], object], repeats: int) -> float:
    """Return the median processor seconds of some work, after one run to warm up."""
    work()
    found = []
    for _ in range(repeats):
        start = time.process_time()
        work()
        found.append(time.process_time() - start)
    from statistics import median

    return median(found)
