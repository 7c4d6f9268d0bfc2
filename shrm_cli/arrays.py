"""Arrays: what annotations call them, slices, errors, and those kept in memory, within bounds.

Tables of waves, coupling coefficients and the coefficients of BRDFs depend on few small things and
are the same for every probe. A process that prefilters thousands of probes computes each of them
once. What is kept is counted in bytes rather than in entries, because tables grow with the third
power of their order.
"""

import dataclasses
import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterator
from functools import reduce
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating]
"""Floating-point numbers, of 64 bits unless a docstring says otherwise."""
Indices = NDArray[np.intp]
Content = TypeVar("Content")

_STEP = 8
"""Orders are rounded up to multiples of this where what is kept serves lower orders too."""


def slices(count: int, most: int) -> Iterator[slice]:
    """Cut so many things into slices of at most `most`, or of one where that is less than 1.

    What is computed of a slice at a time takes little memory. The last slice ends with the things.
    """
    step = max(most, 1)
    return (slice(start, min(start + step, count)) for start in range(0, count, step))


def kept_order(order: int) -> int:
    """Return the order for which something is made that lower orders take a part of.

    Probes that differ ask for many orders that lie close together. The result depends on the
    order alone, and not on what happens to be kept, so that results do not either.
    """
    return -(-order // _STEP) * _STEP


def node_before(place: Array, count: int) -> tuple[Indices, Array]:
    """Return the index of the node before places in a table, and how far behind it they are.

    The last of its `count` nodes is before none.
    """
    index = np.clip(place.astype(np.intp), 0, max(count - 2, 0))
    return index, place - index


def over_channels(combine: np.ufunc, pixels: NDArray[Any]) -> NDArray[Any]:
    """Reduce pixels, shape (..., channels), over their channels by a function such as `np.maximum`.

    numpy's own reductions take about ten times as long along an axis of three.
    """
    return reduce(combine, np.moveaxis(pixels, -1, 0))


def relative_rms(missed: float | np.floating, whole: float | np.floating) -> float:
    """Return the RMS of what is missed over that of the whole, from the sums of their squares.

    It is 0 where the whole is nothing, such as the light of a black probe.
    """
    return float(np.sqrt(missed / whole)) if whole > 0 else 0.0


def relative_difference(found: Array, truth: Array) -> float:
    """Return the RMS of the difference of two arrays over the RMS of the second one."""
    return relative_rms(float(np.sum((found - truth) ** 2)), float(np.sum(truth**2)))


class Memo:
    """Contents by their keys, within a number of bytes; those used longest ago make room.

    Threads may share one. Two of them that ask for the same new content at the same time may both
    compute it, and get the same object. The arrays of a content become read-only, so that nobody
    changes what others are given.

    `most_bytes` is the most bytes that the arrays of all contents take. A content of more than
    `largest`, by default a half of that, is not kept, so that a single one does not drive out all
    others.
    """

    def __init__(self, most_bytes: int, largest: int | None = None) -> None:
        self._most = most_bytes
        self._largest = most_bytes // 2 if largest is None else largest
        self._lock = threading.Lock()
        self._kept: OrderedDict[Hashable, tuple[Any, int]] = OrderedDict()
        self._bytes = 0

    def get(self, key: Hashable, make: Callable[[], Content]) -> Content:
        """Return the content of a key, which is made when it is not known.

        `key` is all that the content depends on. `make` returns the content: arrays, or tuples,
        lists, dictionaries and dataclasses of them. What it raises is passed on, and nothing is
        kept.
        """
        with self._lock:
            found = self._kept.get(key)
            if found is not None:
                self._kept.move_to_end(key)
                return found[0]
        content = make()
        size = _frozen_bytes(content, set())
        with self._lock:
            if key in self._kept:  # another thread was faster
                return self._kept[key][0]
            if size <= self._largest:
                self._kept[key] = content, size
                self._bytes += size
            while self._bytes > self._most:
                self._bytes -= self._kept.popitem(last=False)[1][1]
        return content

    def clear(self) -> None:
        """Forget all contents."""
        with self._lock:
            self._kept.clear()
            self._bytes = 0

    @property
    def bytes(self) -> int:
        """The bytes that the arrays of all contents take now."""
        return self._bytes

    def __len__(self) -> int:
        return len(self._kept)


_OVERHEAD = 200
"""The bytes that an object takes besides its numbers, roughly."""


def _frozen_bytes(content: Any, counted: set[int]) -> int:
    """Make the arrays of a content read-only, and return the bytes that they take.

    A view counts with all of the array that it keeps in memory, and several views of one array
    count once.
    """
    if isinstance(content, np.ndarray):
        content.setflags(write=False)
        whole = content
        while isinstance(whole.base, np.ndarray):
            whole = whole.base
        size = 0 if id(whole) in counted else whole.nbytes
        counted.add(id(whole))
        return _OVERHEAD + int(size)
    if isinstance(content, tuple | list):
        parts = list(content)
    elif isinstance(content, dict):
        parts = list(content.values())
    elif dataclasses.is_dataclass(content):
        parts = [getattr(content, each.name) for each in dataclasses.fields(content)]
    else:
        parts = []
    return _OVERHEAD + sum(_frozen_bytes(each, counted) for each in parts)
