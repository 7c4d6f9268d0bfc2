"""Files of measured BRDFs, whatever their format: whether they can be read, and their identity.

The messages name the file and say what to do, as a user sees them.
"""

import hashlib
import os
from collections.abc import Iterator
from contextlib import contextmanager
from io import BufferedReader
from pathlib import Path

from shrm_cli.errors import BrdfError


def check_file(path: str | os.PathLike[str]) -> Path:
    """The path of a file that can be opened without waiting for it.

    Raises
    ------
    BrdfError
        If there is no such file, or it is a directory, a pipe or a device.
    """
    path = Path(path)
    try:
        if not path.exists():
            raise BrdfError(f"{path}: no such file; `shrm brdf` lists the models without one")
        if not path.is_file():  # to open a pipe would block
            kind = "a directory" if path.is_dir() else "not a regular file"
            raise BrdfError(f"{path}: {kind}; name a file of a measured BRDF")
    except (OSError, ValueError) as error:  # such as a name too long, or with a null
        raise _unreadable(path, error) from error
    return path


def first_bytes(path: Path, count: int) -> bytes:
    """The first `count` bytes of a file, or all of a shorter one.

    Raises
    ------
    BrdfError
        If the file cannot be read.
    """
    with _readable(path) as stream:
        return stream.read(count)


def file_values(path: str | os.PathLike[str]) -> dict[str, str]:
    """What identifies a measured BRDF: its file's name without the folder, and its content.

    Returns
    -------
    dict
        ``file`` and ``sha256``, the digest of the file's bytes in hexadecimal.

    Raises
    ------
    BrdfError
        If the file cannot be read.
    """
    path = check_file(path)
    with _readable(path) as stream:
        digest = hashlib.file_digest(stream, "sha256")
    # Maps record the name, and files hold text only.
    name = path.name.encode("utf-8", "replace").decode()
    return {"file": name, "sha256": digest.hexdigest()}


@contextmanager
def _readable(path: Path) -> Iterator[BufferedReader]:
    """A file opened for reading; an OSError within the block becomes a BrdfError of one line."""
    try:
        with open(path, "rb") as stream:
            yield stream
    except OSError as error:
        raise _unreadable(path, error) from error


def _unreadable(path: Path, error: OSError | ValueError) -> BrdfError:
    reason = getattr(error, "strerror", None) or error
    return BrdfError(f"{path}: cannot be read ({reason}); name another file")
