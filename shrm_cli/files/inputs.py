"""The files that a command has read, none of which it may overwrite.

Every function that opens a file for its user notes it here, whether the name came from the command
line, from the specification of a BRDF or out of a map, and every function that writes one asks. A
command does its work within `protecting`. Programs that use the library decide for themselves.
"""

import contextlib
import os
from collections.abc import Iterator
from contextvars import ContextVar

Files = set[tuple[int, int]]
"""Devices and numbers of files; links share those of their file."""

_read: ContextVar[Files | None] = ContextVar("shrm_cli.inputs", default=None)
_made: ContextVar[Files | None] = ContextVar("shrm_cli.made", default=None)


@contextlib.contextmanager
def protecting() -> Iterator[None]:
    """Within this context what was read is not overwritten."""
    read, made = _read.set(set()), _made.set(set())
    try:
        yield
    finally:
        _read.reset(read)
        _made.reset(made)


def note(*paths: str | os.PathLike[str]) -> None:
    """Note files as read, but for those that were made here.

    Files that do not exist, or have names that no file can have, are left to the function that
    opens them.
    """
    known = _read.get()
    if known is None:
        return
    for path in paths:
        with contextlib.suppress(OSError, ValueError):
            known |= {_identity(path)} - (_made.get() or set())


def note_made(path: str | os.PathLike[str]) -> None:
    """Note a file as made here: who reads it back may overwrite it."""
    made = _made.get()
    if made is not None:
        with contextlib.suppress(OSError, ValueError):
            made.add(_identity(path))


def is_input(path: str | os.PathLike[str]) -> bool:
    """Whether a name leads to a file that was read, through links too."""
    try:
        return _identity(path) in (_read.get() or ())
    except (OSError, ValueError):
        return False


def _identity(path: str | os.PathLike[str]) -> tuple[int, int]:
    status = os.stat(path)
    return status.st_dev, status.st_ino
