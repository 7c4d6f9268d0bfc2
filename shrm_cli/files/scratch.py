"""Folders for files that a run writes, reads again, and removes."""

import contextlib
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

from shrm_cli.errors import OutputError
from shrm_cli.files.whole import abandoned, claim, discard, own_prefix

_NAME = "shrm"


@contextlib.contextmanager
def scratch_folder(inside: str | os.PathLike[str] | None = None) -> Iterator[Path]:
    """Context manager that yields a new folder, which is removed at the end with all in it.

    A process that is killed leaves its folder behind; the next one that makes one there removes it.

    Parameters
    ----------
    inside : path-like, optional
        Where the folder is made; by default where the system has its temporary files.

    Raises
    ------
    OutputError
        If no folder can be made there.
    """
    try:
        where = Path(tempfile.gettempdir() if inside is None else inside)
        prefix = own_prefix(_NAME)
        for folder in abandoned(where, prefix):
            discard(folder)
        own = Path(tempfile.mkdtemp(prefix=f"{prefix}{os.getpid()}-", dir=where))
    except OSError as error:
        raise OutputError(
            f"no temporary folder can be made ({error.strerror}); set TMPDIR to a folder with room"
        ) from error
    claim(own)
    try:
        yield own
    finally:
        discard(own)
