"""Names of files in texts of other languages: each is written so that it stands for itself.

Probes may have any name that a file can have, with quotes, spaces, line breaks, or what would end
a string, a comment or a span of code.
"""

import json
import re
import shlex
from collections.abc import Iterable
from urllib.parse import quote

from shrm_cli.messages import printable

_SPAN = re.compile(r"(?<!`)(`+)(?!`).+?(?<!`)\1(?!`)")
_MARKDOWN = re.compile(r"([\\`*_{}\[\]()<>#+!|&~-])")


def uri(name: str) -> str:
    """Return a file's name as a relative URI, percent-encoded (RFC 3986)."""
    return quote(name, safe="")


def string(text: str) -> str:
    """Return a text as a string, with its quotes, of JavaScript, C++, C#, Rust or GDScript."""
    return json.dumps(text, ensure_ascii=False)


def comment(text: str) -> str:
    """Return a text for a comment of one line, or within ``/*`` and ``*/``."""
    return printable(text).replace("*/", "*_/").replace("/*", "/_*")


def word(name: str) -> str:
    """Return a file's name as one word of a shell's command line, in a comment of one line."""
    return shlex.quote(printable(name))


def markdown(text: str) -> str:
    """Return a text of one line that Markdown shows as it is."""
    return _MARKDOWN.sub(r"\\\1", printable(text))


def code_span(text: str) -> str:
    """Return a text as a span of code in Markdown, whatever backticks it has."""
    text = printable(text)
    longest = max((len(run) for run in re.findall("`+", text)), default=0)
    fence = "`" * (longest + 1)
    space = " " if "`" in text else ""
    return f"{fence}{space}{text}{space}{fence}"


def spans(text: str) -> list[str]:
    """Return the spans of code in a line, each as `code_span` writes it."""
    return [found[0] for found in _SPAN.finditer(text)]


def numbers(values: Iterable[float], unit: str = "") -> str:
    """Return numbers one after the other, each followed by a unit, without negative zeros."""
    return ", ".join(f"{each + 0:g}{unit}" for each in values)
