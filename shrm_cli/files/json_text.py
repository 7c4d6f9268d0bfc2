"""JSON in the attributes of files, which may come from anywhere.

Python's reader takes more than JSON, such as NaN, and what it takes may not be printable or may be
nested so deeply that nothing can be done with it. All JSON of files is read here.
"""

import json
import math
import re
from typing import Any

_MOST_CHARACTERS = 2**25
_MOST_DEPTH = 16
_MOST_DIGITS = 32
"""The most digits of a whole number: a double holds less than that."""
_STRING = re.compile(r'"[^"\\]*+(?:\\.[^"\\]*+)*+"', re.DOTALL)
_BRACKETS = re.compile(r"[][{}]")


def parse_json(text: object, most_depth: int = _MOST_DEPTH) -> Any:
    """Return the value of a text in JSON.

    Parameters
    ----------
    text : object
        The value of an attribute, which may be no text at all.
    most_depth : int
        The most lists and objects within each other.

    Returns
    -------
    dict, list, str, float, int, bool or None
        Numbers are finite, and texts can be encoded.

    Raises
    ------
    ValueError
        If it is anything else than sound JSON of moderate length and depth.
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
