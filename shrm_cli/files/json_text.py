"""JSON and TOML in files, which may come from anywhere: all of it is read here.

Python's reader of JSON takes more than JSON, such as NaN, and what it takes may not be printable or
may be nested so deeply that nothing can be done with it. Its reader of TOML takes texts of any
length, raises errors of several lines, and gives up on what is nested too deeply with a
`RecursionError`. Here all of that becomes an error of one line.
"""

import json
import math
import os
import re
import tomllib
from typing import Any

from shrm_cli.errors import ShrmError

_MOST_CHARACTERS = 2**25
_MOST_DEPTH = 16
_MOST_DIGITS = 32
"""The most digits of a whole number: a double holds less than that."""
_STRING = re.compile(r'"[^"\\]*+(?:\\.[^"\\]*+)*+"', re.DOTALL)
_BRACKETS = re.compile(r"[][{}]")


def parse_json(text: object, most_depth: int = _MOST_DEPTH) -> Any:
    """Return the value of a text in JSON: numbers are finite, and texts can be encoded.

    `text` is the value of an attribute, which may be no text at all. `most_depth` is the most lists
    and objects within each other.

    Raises ValueError if it is anything else than sound JSON of moderate length and depth.
    """
    if not isinstance(text, str) or len(text) > _MOST_CHARACTERS:
        raise ValueError("no text, or too long")
    if _is_deeper(text, most_depth):
        raise ValueError("nested too deeply")
    value = json.loads(text, parse_constant=_refuse, parse_float=_real, parse_int=_whole)
    if "\\u" in text or not text.isascii():
        json.dumps(value, ensure_ascii=False).encode()  # halves of surrogates have no encoding
    return value


def _is_deeper(text: str, most: int) -> bool:
    """Whether the brackets of a text are nested deeper than that, outside of its strings."""
    depth = 0
    for bracket in _BRACKETS.finditer(_STRING.sub("", text)):
        depth += 1 if bracket[0] in "[{" else -1
        if depth > most:
            return True
    return False


def _refuse(name: str) -> None:
    raise ValueError(f"{name} is no JSON")


def _real(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(f"{text} is no double")
    return value


def _whole(text: str) -> int:
    if len(text) > _MOST_DIGITS:
        raise ValueError("a number of too many digits")
    return int(text)


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
    name: str | os.PathLike[str], what: str, most_bytes: int, too_large: str, error: type[ShrmError]
) -> tuple[dict[str, Any], bytes]:
    """Read a file in TOML that is no larger than its kind can be.

    `what` is what the file should be, for the error messages: ``a manifest``. `most_bytes` is the
    size of the largest file that is read. `too_large` is what is said of a larger file: that it is
    too large, and what to do.

    Returns `values`, the keys of the file; and `text`, the file as it is.
    """
    try:
        with open(name, "rb") as stream:
            text = stream.read(most_bytes + 1)
    except FileNotFoundError:
        raise error(f"{name}: no such file; check its name") from None
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
    except UnicodeDecodeError:
        raise error(f"{name}: no text, so that it is not {what}; name another file") from None
    except ValueError as problem:
        reason = " ".join(str(problem).split())[:_MOST_OF_A_REASON]
        raise error(f"{name}: no TOML ({reason}); correct it") from None
