"""Specifications within specifications: ``coated:base=(0.5*lambertian+0.5*ggx),ior=1.4``.

A value that is a BRDF stands in parentheses. Nothing in them takes part in what is outside: a comma
or a plus there ends neither the value nor the term.
"""

import re
from collections.abc import Iterator

from shrm_cli.errors import BrdfError

COMMA = re.compile(",")
MOST = 8
"""The most BRDFs within a term, one in another or beside each other."""
_OPENING = "=("


def masked(text: str) -> str:
    """The text with underscores for all that is in parentheses of values, which keeps its length.

    Parentheses in the names of files follow no equals sign, and are none of these. Where one is not
    closed, the text is left as it is.
    """
    kept, depth = [], 0
    for at, char in enumerate(text):
        if char == "(" and (depth or text[max(at - 1, 0) : at + 1] == _OPENING):
            depth += 1
        kept.append("_" if depth else char)
        if char == ")" and depth:
            depth -= 1
    return text if depth else "".join(kept)


def cut(pattern: re.Pattern[str], text: str) -> Iterator[str]:
    """Cut a text where a pattern is, and not within the parentheses of values."""
    start = 0
    for found in pattern.finditer(masked(text)):
        yield text[start : found.start()]
        start = found.end()
    yield text[start:]


def inside(key: str, value: object) -> str:
    """The specification that a value holds in its parentheses.

    Raises
    ------
    BrdfError
        If the value has none.
    """
    text = str(value)
    if not (isinstance(value, str) and text.startswith("(") and text.endswith(")")):
        raise BrdfError(f"{key}={text:.40} is no BRDF in parentheses, such as {key}=(lambertian)")
    return text[1:-1]


def nested_texts(term: str) -> list[str]:
    """The specifications that the values of a term hold."""
    values = (part.partition("=")[2].strip() for part in cut(COMMA, term.partition(":")[2]))
    return [value[1:-1] for value in values if value.startswith("(") and value.endswith(")")]


def check_number(spec: str) -> None:
    """Refuse a term with more than `MOST` BRDFs in it, which files may claim."""
    if spec.count(_OPENING) > MOST:
        raise BrdfError(f"{spec!r:.60}: more than {MOST} BRDFs within one")
