"""Settings that hold for a stretch of a program: how many threads, and where the cache is.

Nothing that they change is visible in a result, so functions do not take them as arguments: they
ask `current()`. A caller sets them for as long as a ``with`` block lasts:

    with settings.using(threads=2, cache=False):
        ...

Threads that are started inside of such a block do not inherit its settings (a context variable
has a value of its own in each thread): read what a worker needs before it is started.
"""

from contextvars import ContextVar, Token
from dataclasses import dataclass, replace
from pathlib import Path
from types import EllipsisType
from typing import Self


@dataclass(frozen=True)
class Settings:
    """What `current` returns.

    Attributes
    ----------
    threads : int, optional
        The most threads of every pool that integrates or writes images; None for as many as
        there are processors.
    cache : bool or Path
        Whether coefficients of BRDFs are kept on disk, and in which folder: False for not at
        all, True for the folder that the environment or the user's system names.
    """

    threads: int | None = None
    cache: bool | Path = True

    def __post_init__(self) -> None:
        if self.threads is not None and self.threads < 1:
            raise ValueError(f"{self.threads} threads; one is the least")


_DEFAULTS = Settings()
_current: ContextVar[Settings] = ContextVar("shrm_cli.settings", default=_DEFAULTS)


def current() -> Settings:
    """The settings that hold here and now."""
    return _current.get()


class using:
    """Context manager within which other settings hold; those of before come back on exit.

    Parameters
    ----------
    threads, cache
        As of `Settings`; what is left out stays as it is.

    Raises
    ------
    ValueError
        If `threads` is less than 1.
    """

    # This is a class rather than a generator, because a generator that is never resumed restores
    # the settings when it is collected, which may be in the middle of something else.

    def __init__(
        self,
        *,
        threads: int | EllipsisType | None = ...,
        cache: bool | Path | EllipsisType = ...,
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
