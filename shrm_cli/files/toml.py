"""TOML of users, which may come from anywhere: manifests, light files and scenes are read here.

Python's reader takes texts of any length, raises errors of several lines, and gives up on what is
nested too deeply with a `RecursionError`. Here all of that becomes an error of one line.
"""

import os
import re
import tomllib
from typing import Any

from shrm_cli.errors import ShrmError

_KEY = rb"(?:[A-Za-z0-9_-]++|\"(?:[^\"\\\n]|\\.)*+\"|'[^'\n]*+')"
_MOST_PARTS = 16
"""The most parts of a dotted key, four times what any file here has. Python's reader takes time as
the square of them, and about a kilobyte for each: .8 GB for 4 MB of keys of 16."""
_LONG_KEY = re.compile(  # no key begins behind a backslash, so that each byte is seen a few times
    rb"(?<![A-Za-z0-9_\\-])" + _KEY + rb"(?:[ \t]*+\.[ \t]*+" + _KEY + rb"){%d}" % _MOST_PARTS
)
_MOST_OF_A_REASON = 100
"""The most characters that are told of what Python's reader says."""


def read_toml(
    name: str | os.PathLike[str],
    what: str,
    most_bytes: int,
    too_large: str,
    error: type[ShrmError],
) -> tuple[dict[str, Any], bytes]:
    """Read a file in TOML that is no larger than its kind can be.

    Parameters
    ----------
    name : str or path
        The file.
    what : str
        What the file should be, for the error messages: ``a manifest``.
    most_bytes : int
        The size of the largest file that is read.
    too_large : str
        What is said of a larger file: that it is too large, and what to do.
    error : type
        The class of the errors.

    Returns
    -------
    values : dict
        The keys of the file.
    text : bytes
        The file as it is.

    Raises
    ------
    ShrmError
        Of the class `error`, if the file cannot be read, is larger, or is no TOML.
    """
    try:
        with open(name, "rb") as stream:
            text = stream.read(most_bytes + 1)
    except OSError as problem:
        raise error(f"{name}: cannot be opened ({problem.strerror}); check its name") from None
    if len(text) > most_bytes:
        raise error(f"{name}: {too_large}")
    if _LONG_KEY.search(text):
        raise error(f"{name}: a key of more than {_MOST_PARTS} parts; write {what} anew")
    try:
        return tomllib.loads(text.decode()), text
    except RecursionError:
        raise error(f"{name}: nested too deeply to be {what}; write it anew") from None
    except ValueError as problem:
        reason = " ".join(str(problem).split())[:_MOST_OF_A_REASON]
        raise error(f"{name}: no TOML ({reason}); correct it") from None
