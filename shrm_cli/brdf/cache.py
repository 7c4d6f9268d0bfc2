"""What is known of BRDFs already: kept in memory, and on disk where it took long to compute.

A process keeps what it needed last of all BRDFs of this package, so that the next probe finds it.
On disk are coefficients, transfer functions and lobes, for other processes. There an entry is a
file. Its name is a digest of all that its content depends on: the BRDF with its parameters (a
measured BRDF with the digest of its file), what is computed of it, the orders, the accuracy, and
the program. The entry holds the digest of its own bytes; if it is damaged, its content is computed
and written again.
"""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import hashlib
import json
import math
import os
import stat
import time
from collections.abc import Callable, Hashable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeVar

import numpy as np

from shrm_cli import settings
from shrm_cli.arrays import Array, Memo
from shrm_cli.brdf.base import Brdf
from shrm_cli.brdf.coefficients import BrdfCoefficients, ExpandedLobes, FirstOrder
from shrm_cli.brdf.library import foreign_modules
from shrm_cli.errors import ArgumentError, OutputError
from shrm_cli.files.whole import replacing
from shrm_cli.records import record
from shrm_cli.sources import COEFFICIENTS, fingerprint
from shrm_cli.vocabulary import MAX_ORDER_F

if TYPE_CHECKING:
    from shrm_cli.brdf.transfer import TransferFunctions

Known = TypeVar("Known")
Content = TypeVar("Content", BrdfCoefficients, "TransferFunctions", ExpandedLobes, FirstOrder)

MOST_BYTES = 512 * 2**20
"""The size of all entries together; those that were used longest ago make room for new ones."""
_LEAST_ENTRIES = 3
"""The number of entries that there is room for in any case. Brushed lobes take up to 145 MB, to 256
degrees, and 20 s to sample."""

_SUFFIX = ".coefficients"
_MAGIC = b"shrm coefficients 1\n"
_SLOW = 0.004  # seconds; what takes less to compute is not worth a file
_MOST_HEADER = 2**16
_KINDS = "<f8", "<f4"
_BYTES = np.dtype(_KINDS[0]).itemsize
_DIGEST = hashlib.sha256().digest_size
_UNSOUND = (
    ValueError, TypeError, AttributeError, LookupError, ArithmeticError, RecursionError,
    ArgumentError,
)  # fmt: skip
_in_memory = Memo(2**28, MOST_BYTES // _LEAST_ENTRIES)
"""Coefficients, lobes and their widths. Coefficients to F = 128 and P = 8 take 0.25 MB, those to
the limits of the orders 13 MB; brushed lobes take 50 MB, to 256 degrees 145 MB, and are asked for
twice where lamps go beside a map."""


def cached_coefficients(
    brdf: Brdf,
    order_f: int,
    order_p: int,
    accuracy: float,
    compute: Callable[..., BrdfCoefficients],
) -> BrdfCoefficients:
    """Take coefficients from the cache, or compute them, and keep them if that took long.

    `compute` is `compute_coefficients`, or a function with its parameters and result.

    Returns what `compute` returns, to the last bit, with read-only arrays. Only BRDFs of this
    package are kept, because the code of others could change without the key's noticing.
    """
    return _cached(_COEFFICIENTS, brdf, (order_f, order_p, accuracy), compute)


def cached_transfer(
    brdf: Brdf, order_f: int, max_q: int, accuracy: float, compute: Callable[..., TransferFunctions]
) -> TransferFunctions:
    """Take transfer functions from the cache, or compute them, as `cached_coefficients` does."""
    return _cached(_transfer_kind(), brdf, (order_f, max_q, accuracy), compute)


def cached_lobes(
    brdf: Brdf,
    orders: tuple[int, int],
    counts: tuple[int, int],
    angles: tuple[float, ...],
    compute: Callable[..., ExpandedLobes],
) -> ExpandedLobes:
    """Take lobes for some views from the cache, or expand them, as `cached_coefficients` does.

    `orders`, `counts` and `angles` are those of `expand_lobes`, which `compute` is, or a function
    with its parameters and result.
    """
    return _cached(_LOBES, brdf, (*orders, counts, angles), compute)


def cached_first_order(brdf: Brdf, compute: Callable[[Brdf], FirstOrder]) -> int:
    """Take the order F to which a BRDF is expanded first from the cache, or find it.

    It takes few samples; but samples of layers need tables, which nothing else may ask for.
    """
    return _cached(_FIRST_ORDER, brdf, (), compute).order_f


def remembered(brdf: Brdf, what: tuple[Hashable, ...], make: Callable[[], Known]) -> Known:
    """Take something that follows from a BRDF from this process's memory, or make it.

    A `brdf` whose code is not part of this package is not kept, because its values do not tell all
    of it. `what` is what is made, and all else that it depends on. `make` returns arrays, or
    numbers, tuples or dataclasses of them; arrays become read-only.
    """
    record = _record(brdf)
    return make() if record is None else _in_memory.get((record, *what), make)


@record
class _Kind(Generic[Content]):
    """A kind of entries: a dataclass of arrays of floats, and of what JSON holds exactly."""

    content: type[Content]
    """The dataclass."""
    most_values: Callable[..., int]
    """Takes the parameters, of which the first two are orders if there are any; no entry of theirs
    has more numbers in its arrays than what it returns, so that no more is read."""
    fits: Callable[..., bool]
    """Takes an entry that was read and the parameters: whether it is of their orders. An entry of a
    first order is asked for without any, and fits where it is an order."""
    is_always_kept: bool = False
    """Whether an entry has a file however quickly it was computed."""


_COEFFICIENTS = _Kind(
    BrdfCoefficients,
    lambda order_f, order_p, _: 3 * ((order_f + 1) * ((order_p + 1) ** 2 + 1) + 1),
    lambda found, order_f, order_p: found.order_f == order_f and found.order_p in (0, order_p),
)


_LOBES = _Kind(
    ExpandedLobes,
    lambda order_f, max_q, _, views: 8 * (max_q + 1) * (order_f + 1) * len(views),
    lambda found, order_f, max_q: (
        found.values.shape[1] == order_f + 1 and len(found.values) % (max_q + 1) == 0
    ),
)
_FIRST_ORDER = _Kind(
    FirstOrder,
    lambda: 0,
    lambda found: 0 < found.order_f <= MAX_ORDER_F,
    is_always_kept=True,  # few samples, of modules that a run with coefficients does not load else
)


@functools.cache
def _transfer_kind() -> _Kind[TransferFunctions]:
    """Return the kind of transfer functions, whose module most runs do not need."""
    from shrm_cli.brdf.transfer import TransferFunctions

    return _Kind(
        TransferFunctions,
        # Nobody knows how many views it took.
        lambda *_: MOST_BYTES // _LEAST_ENTRIES // _BYTES,
        lambda found, order_f, max_q: (found.order_f, found.max_q) == (order_f, max_q),
    )


def _cached(
    kind: _Kind[Content],
    brdf: Brdf,
    parameters: tuple[Any, ...],
    compute: Callable[..., Content],
) -> Content:
    """What a function computes of a BRDF, from memory, or from the cache on disk if it is there."""

    def from_disk() -> Content:
        is_used = settings.current().cache is not False
        key = _key(compute.__name__, brdf, parameters) if is_used else None
        if key is None:
            return compute(brdf, *parameters)
        try:
            path = settings.cache_folder() / (hashlib.sha256(key.encode()).hexdigest() + _SUFFIX)
        except OutputError:
            return compute(brdf, *parameters)
        found = _read(path, key, kind, parameters)
        if found is None:
            start = time.perf_counter()
            found = compute(brdf, *parameters)
            if kind.is_always_kept or time.perf_counter() - start > _SLOW:
                _write(path, key, found)
        return found

    return remembered(brdf, (kind.content.__name__, parameters, compute), from_disk)


def cache_usage() -> tuple[int, int]:
    """Count the entries.

    Returns
    -------
    count, size : int
        How many there are, and how many bytes they have together.

    Examples
    --------
    >>> count, size = shrm.cache_usage()
    >>> count <= size
    True
    """
    sizes = [size for _, size, _ in _entries(settings.cache_folder())]
    return len(sizes), sum(sizes)


def clear_cache() -> tuple[int, int]:
    """Remove every entry, and the folder if nothing else is in it.

    Returns
    -------
    count, size : int
        How many entries there were, and how many bytes they had together.

    Raises
    ------
    OutputError
        If an entry cannot be removed.

    Examples
    --------
    >>> import pathlib
    >>> with shrm.using(cache=pathlib.Path("empty")):
    ...     shrm.clear_cache()
    (0, 0)
    """
    where = settings.cache_folder()
    count = size = 0
    for path, length, _ in _entries(where):
        try:
            path.unlink(missing_ok=True)
        except OSError as error:
            raise OutputError(f"{path}: cannot be removed ({error.strerror})") from error
        count, size = count + 1, size + length
    with contextlib.suppress(OSError):  # such as that something else is in it
        where.rmdir()
    return count, size


def _key(compute: str, brdf: Brdf, parameters: tuple[Any, ...]) -> str | None:
    """All that an entry depends on, as JSON; None for a BRDF that this does not identify.

    `compute` is the name of the function that computes it.
    """
    program = [np.__version__, fingerprint(COEFFICIENTS)]
    return _record(brdf, compute=compute, parameters=parameters, program=program)


def _record(brdf: Brdf, **more: Any) -> str | None:
    """All that makes a BRDF, and what else is given, as JSON.

    It is None for a BRDF that this does not identify. A measured one has the digest of its file
    among its values.
    """
    if foreign_modules(brdf):
        return None
    parts = {
        "name": brdf.name,
        "model": f"{type(brdf).__module__}.{type(brdf).__qualname__}",
        "values": brdf.values,
        "frame": [brdf.center, brdf.includes_cosine, brdf.has_horizon, brdf.zonal],
        **more,
    }
    try:
        return json.dumps(parts, sort_keys=True)
    except (TypeError, ValueError):
        return None


def _write(path: Path, key: str, content: Any) -> None:
    """Write an entry and remove old ones beyond the limit; if that fails, go on without it."""
    values = {field.name: getattr(content, field.name) for field in dataclasses.fields(content)}
    arrays = {name: value for name, value in values.items() if isinstance(value, np.ndarray)}
    # The three channels of what is grey share the memory of one, and its place in the file.
    grey = [name for name, each in arrays.items() if each.shape[-1] == 3 and not each.strides[-1]]
    arrays |= {name: arrays[name][..., :1] for name in grey}
    kinds = {name: array.dtype.newbyteorder("<").str for name, array in arrays.items()}
    header = {
        "key": key,
        "shapes": {name: array.shape for name, array in arrays.items()},
        "kinds": kinds,
        "grey": grey,
        "others": {name: value for name, value in values.items() if name not in arrays},
    }
    text = json.dumps(header).encode()
    size = sum(np.dtype(kinds[name]).itemsize * array.size for name, array in arrays.items())
    if len(text) > _MOST_HEADER or len(text) + size > MOST_BYTES // _LEAST_ENTRIES:
        return
    digest = hashlib.sha256()
    with contextlib.suppress(OSError, OutputError, ValueError):
        path.parent.mkdir(parents=True, exist_ok=True)
        with replacing(path) as temporary, open(temporary, "wb") as stream:

            def put(part: bytes | memoryview) -> None:
                digest.update(part)
                stream.write(part)

            stream.write(_MAGIC + bytes(_DIGEST))
            put(len(text).to_bytes(4, "little") + text)
            for name, array in arrays.items():
                put(array.ravel().astype(kinds[name]).data)
            stream.seek(len(_MAGIC))
            stream.write(digest.digest())
        _make_room(path)


def _read(
    path: Path, key: str, kind: _Kind[Content], parameters: tuple[Any, ...]
) -> Content | None:
    """The content of an entry; None if there is no whole entry that fits the key."""
    try:
        if not path.is_file():  # opening a pipe would wait for its writer
            return None
        # An entry cannot be larger than its arrays can be, so no more than that is read.
        most = len(_MAGIC) + _DIGEST + 4 + _MOST_HEADER + _BYTES * kind.most_values(*parameters)
        with open(path, "rb") as stream:
            data = stream.read(most + 1)
        start = len(_MAGIC) + _DIGEST
        if len(data) > most or not data.startswith(_MAGIC):
            return None
        body = memoryview(data)[start:]
        if hashlib.sha256(body).digest() != data[len(_MAGIC) : start]:
            return None
        found = _unpacked(body, key, kind.content)
        fits = kind.fits(found, *parameters[:2])
    except (OSError, *_UNSOUND):
        return None
    if not fits:
        return None
    with contextlib.suppress(OSError):
        os.utime(path)  # the entries that were used last are the last to make room
    return found


def _unpacked(body: memoryview, key: str, content: type[Content]) -> Content:
    """The content in the body of an entry; raises one of `_UNSOUND` if it holds none."""
    start = 4 + int.from_bytes(body[:4], "little")
    header = json.loads(bytes(body[4:start]))
    if header["key"] != key:
        raise ValueError("an entry of something else")
    fields: dict[str, Any] = {
        name: tuple(value) if isinstance(value, list) else value
        for name, value in header["others"].items()
    }
    for name, shape in header["shapes"].items():
        count = math.prod(shape)
        if header["kinds"][name] not in _KINDS:
            raise ValueError("no floats")
        packed = np.frombuffer(body, header["kinds"][name], count, start)
        array: Array = packed.reshape(shape).astype(packed.dtype.newbyteorder("="))
        if not np.isfinite(array).all():
            raise ValueError("not finite")
        start += packed.nbytes
        is_grey = name in header["grey"]
        fields[name] = np.broadcast_to(array, (*array.shape[:-1], 3)) if is_grey else array
    if start != len(body):
        raise ValueError("of another length")
    return content(**fields)


def _make_room(newest: Path) -> None:
    """Remove the entries that were used longest ago until the rest is small enough."""
    entries = sorted(_entries(newest.parent), key=lambda entry: entry[2])
    size = sum(length for _, length, _ in entries)
    for path, length, _ in entries:
        if size <= MOST_BYTES:
            return
        if path != newest:
            with contextlib.suppress(OSError):  # another process was faster
                path.unlink(missing_ok=True)
            size -= length


def _entries(where: Path) -> Iterator[tuple[Path, int, int]]:
    """Path, size and time of last use of every entry, also of those that are being written."""
    try:
        with os.scandir(where) as found:
            paths = [Path(entry.path) for entry in found if entry.name.endswith(_SUFFIX)]
    except (OSError, ValueError):  # there is no such folder, or cannot be one
        return
    for path in paths:
        with contextlib.suppress(OSError):  # another process has removed it
            status = path.lstat()
            if stat.S_ISREG(status.st_mode):
                yield path, status.st_size, status.st_mtime_ns
