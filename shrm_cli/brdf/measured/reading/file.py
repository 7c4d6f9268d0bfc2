"""Files of measured BRDFs, whatever their format: whether they can be read, and their identity.

The messages name the file and say what to do, as a user sees them. Files are not trusted: sizes
are bounded before anything is parsed. The lines of text are separated and counted before any is
turned into numbers, so that no number in a file makes the reader allocate memory.
"""

import hashlib
import math
import os
from collections.abc import Iterator
from contextlib import contextmanager
from io import BufferedReader
from pathlib import Path

from shrm_cli.errors import BrdfError
from shrm_cli.files.whole import check_regular

MAX_BYTES = 2**25
"""The largest file that is read, a hundred times as large as any that is known."""
LARGEST = 1e30
"""A larger number in a file is an error."""
MAX_LINE = 2**16
MAX_LINES = 2**17


def check_file(path: str | os.PathLike[str]) -> Path:
    """The path of a file that can be opened without waiting for it."""
    missing = "`shrm brdf` lists the models without one"
    check_regular(path, BrdfError, "a file of a measured BRDF", missing)
    return Path(path)


def first_bytes(path: Path, count: int) -> bytes:
    """The first `count` bytes of a file, or all of a shorter one."""
    with readable(path) as stream:
        return stream.read(count)


def file_values(path: str | os.PathLike[str]) -> dict[str, str]:
    """What identifies a measured BRDF: the name of its ``file`` alone, and its ``sha256``."""
    path = check_file(path)
    with readable(path) as stream:
        digest = hashlib.file_digest(stream, "sha256")
    # Maps record the name, and files hold text only.
    name = path.name.encode("utf-8", "replace").decode()
    return {"file": name, "sha256": digest.hexdigest()}


@contextmanager
def readable(path: Path, advice: str = "name another file") -> Iterator[BufferedReader]:
    """A file opened for reading; an OSError within the block becomes a BrdfError of one line."""
    try:
        with open(path, "rb") as stream:
            yield stream
    except OSError as error:
        raise BrdfError(f"{path}: cannot be read ({error.strerror or error}); {advice}") from error


def first_lines(head: bytes) -> list[str]:
    """The stripped lines of the first bytes of a file; none if the bytes are no text.

    Bytes that are not UTF-8 are replaced, such as those of a last character that is cut off.
    """
    if b"\0" in head:
        return []
    text = head.decode("utf-8-sig", errors="replace")
    return [line.strip() for line in text.splitlines()]


def read_lines(path: str | os.PathLike[str], what: str) -> list[tuple[int, str]]:
    """Read the lines of a text that are not blank or comments (``#``), with numbers from 1.

    `what` is what the file should be, for the messages, such as ``a goniometer file``.
    """
    path = check_file(path)
    content = first_bytes(path, MAX_BYTES + 1)
    if len(content) > MAX_BYTES:
        raise BrdfError(
            f"{path}: larger than {MAX_BYTES // 2**20} MiB, too large for {what}; thin it out"
        )
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise BrdfError(f"{path}: not text, so not {what}; name another file") from None
    if "\0" in text:
        raise BrdfError(f"{path}: not text, so not {what}; name another file")
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    if text.count("\n") > MAX_LINES:
        raise BrdfError(f"{path}: more than {MAX_LINES:,} lines, too many for {what}; thin it out")
    lines = text.split("\n")
    longest = max(map(len, lines), default=0)
    if longest > MAX_LINE:
        raise BrdfError(
            f"{path}: a line of {longest:,} characters, so not {what}; name another file"
        )
    stripped = ((number, line.strip()) for number, line in enumerate(lines, 1))
    return [(number, line) for number, line in stripped if line and not line.startswith("#")]


def parse_numbers(
    path: str | os.PathLike[str], number: int, line: str, count: int | None = None
) -> list[float]:
    """Parse the numbers of one line, which are separated by spaces; `count` is how many it has."""
    found = []
    for word in line.split():
        try:
            value = float(word)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise BrdfError(
                f"{path}: line {number}: {word[:20]!r} is not a finite number; "
                "correct it or copy the file again"
            )
        found.append(value)
    if count is not None and len(found) != count:
        raise BrdfError(
            f"{path}: line {number}: {len(found)} numbers instead of {count}; "
            "correct it or copy the file again"
        )
    return found
