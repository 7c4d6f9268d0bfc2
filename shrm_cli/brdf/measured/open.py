"""Measured BRDFs: files of several formats, told apart by their content."""

import hashlib
import importlib
import os
from collections.abc import Iterator
from contextlib import contextmanager
from io import BufferedReader
from pathlib import Path

from shrm_cli.brdf.base import Brdf
from shrm_cli.errors import BrdfError

FORMATS = {
    "merl": ("Merl", "MERL's .binary tables"),
    "rgl": ("Rgl", "RGL's .bsdf tensor files"),
    "goniometer": ("Goniometer", "Cornell's goniometer samples"),
    "zernike": (
        "Zernike",
        "Koenderink-van Doorn coefficients, CSV of theta_i,phi_i,theta_r,phi_r,r,g,b",
    ),
    "table": ("Table", "tables that shrm brdf --save wrote, .exr or .npz"),
}
"""Formats in the order in which they are tried: the module's name, its class, and what it reads."""

_HEAD = 4096


def open_measured(path: str | os.PathLike[str]) -> Brdf:
    """The measured BRDF in a file, whatever its format and its name.

    Raises
    ------
    BrdfError
        If it is missing, no regular file, of no known format, or damaged.
    """
    path = check_file(path)
    with _readable(path) as stream:
        head = stream.read(_HEAD)
    if not head:
        raise BrdfError(f"{path}: an empty file; copy it again")
    for name, (kind, _) in FORMATS.items():
        # Imported one by one: most formats need more than their recognition does.
        module = importlib.import_module(f"shrm_cli.brdf.measured.{name}")
        if module.recognizes(head, path):
            found: Brdf = getattr(module, kind).open(path)
            return found
    known = "; ".join(what for _, what in FORMATS.values())
    raise BrdfError(f"{path}: not a measured BRDF; known: {known}")


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
    return {"file": path.name, "sha256": digest.hexdigest()}


@contextmanager
def _readable(path: Path) -> Iterator[BufferedReader]:
    """A file opened for reading; what the system refuses is an error of one line."""
    try:
        with open(path, "rb") as stream:
            yield stream
    except OSError as error:
        raise _unreadable(path, error) from error


def _unreadable(path: Path, error: OSError | ValueError) -> BrdfError:
    reason = getattr(error, "strerror", None) or error
    return BrdfError(f"{path}: cannot be read ({reason}); name another file")
