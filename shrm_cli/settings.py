"""Settings that hold for a stretch of a program: how many threads, and where the cache is.

Nothing that they change is visible in a result, so functions do not take them as arguments: they
ask `current()`. A caller sets them for as long as a ``with`` block lasts:

    with settings.using(threads=2, cache=False):
        ...

Threads that are started inside of such a block do not inherit its settings (a context variable
has a value of its own in each thread): read what a worker needs before it is started.

Libraries have threads that only environment variables can limit, before numpy is imported, and for
the whole process: the command line does that here, and the library does not.
"""

import os
import sys
from contextlib import suppress
from contextvars import ContextVar, Token
from dataclasses import replace
from pathlib import Path
from types import EllipsisType
from typing import Self

from shrm_cli.errors import ArgumentError, OutputError
from shrm_cli.records import record

FOLDER_VARIABLE = "SHRM_CACHE_DIR"
"""Environment variable that names the cache's folder."""


@record
class Settings:
    """What `current` returns."""

    threads: int | None = None
    """The most threads of every pool that integrates or writes images; None for as many as there
    are processors."""
    cache: bool | Path = True
    """Whether coefficients of BRDFs are kept on disk, and in which folder: False for not at all,
    True for the folder that the environment or the user's system names."""

    def __post_init__(self) -> None:
        if not (self.threads is None or (isinstance(self.threads, int) and self.threads >= 1)):
            raise ArgumentError(
                "threads", f"is {self.threads!r:.40}; give a number; one is the least"
            )
        if not isinstance(self.cache, bool | Path):
            raise ArgumentError("cache", f"is {self.cache!r:.40}; give True, False or a Path")


_DEFAULTS = Settings()
_current: ContextVar[Settings] = ContextVar("shrm_cli.settings", default=_DEFAULTS)


def current() -> Settings:
    """The settings that hold here and now."""
    return _current.get()


def cache_folder() -> Path:
    """Return the folder of the cache: what the settings, the environment or the system says."""
    set_here = current().cache
    if isinstance(set_here, Path):
        return set_here
    chosen = os.environ.get(FOLDER_VARIABLE)
    if chosen:
        return Path(chosen)
    with suppress(RuntimeError):  # older versions return a path that begins with ~
        found = Path(_users_folder())
        if found.is_absolute():
            return found
    raise OutputError(f"there is no home folder for the cache; set HOME or {FOLDER_VARIABLE}")


def _users_folder() -> str:
    """Return the folder of this user's cache, as `platformdirs` says it."""
    # On Linux it takes two lines, and platformdirs with all that it loads as long as a map's file.
    if sys.platform == "linux" and "ANDROID_DATA" not in os.environ:
        base = os.environ.get("XDG_CACHE_HOME", "")
        return os.path.join(base if os.path.isabs(base) else os.path.expanduser("~/.cache"), "shrm")
    import platformdirs

    return platformdirs.user_cache_dir("shrm")


class using:
    """Context manager within which other settings hold; those of before come back on exit.

    Parameters
    ----------
    threads, cache
        As of `Settings`; what is left out stays as it is.

    Raises
    ------
    ArgumentError
        If `threads` is less than 1.

    Examples
    --------
    >>> with shrm.using(threads=1, cache=False):
    ...     shrm.prefilter("probes/studio.exr", "lambertian").representation
    'shrm'
    """

    # This is a class rather than a generator, because a generator that is never resumed restores
    # the settings when it is collected, which may be in the middle of something else.

    def __init__(
        self, *, threads: int | EllipsisType | None = ..., cache: bool | Path | EllipsisType = ...
    ) -> None:
        changes = {"threads": threads, "cache": cache}
        self._changes = {name: value for name, value in changes.items() if value is not ...}
        Settings(**self._changes)  # type: ignore[arg-type]
        self._tokens: list[Token[Settings]] = []

    def __enter__(self) -> Self:
        changed = replace(current(), **self._changes)  # type: ignore[arg-type]
        self._tokens.append(_current.set(changed))
        return self

    def __exit__(self, *_: object) -> None:
        _current.reset(self._tokens.pop())


_BLAS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
"""Variables that limit the threads of the BLAS library that numpy uses."""
_IMAGES = ("OPENIMAGEIO_THREADS",)
"""Variables that limit the threads of OpenImageIO."""


def limit_libraries(count: int) -> None:
    """Give OpenImageIO at most `count` threads, and BLAS one.

    BLAS gets one thread whatever the count is, because a product that several threads share
    rounds differently, and the same inputs must give the same bytes.
    """
    for name in _BLAS:
        os.environ[name] = "1"
    for name in _IMAGES:
        os.environ[name] = str(count)


def limit_small_products() -> None:
    """Give BLAS one thread, unless the user's environment says otherwise.

    The matrix products of one map take milliseconds. In that time a second thread gains less
    than its waiting costs: on a busy machine a whole run took 0.42 s with two threads and 0.25 s
    with one. Batches run one process for each processor anyway.
    """
    for name in _BLAS:
        os.environ.setdefault(name, "1")
