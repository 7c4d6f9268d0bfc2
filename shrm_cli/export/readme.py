"""The README of an export, which says what was done, and how it is loaded."""

import re

from shrm_cli import __release__
from shrm_cli.export.engine import Engine, Light, Package
from shrm_cli.export.quoting import code_span, markdown

_PLAIN = re.compile(r"[^\W_][\w.-]*")
"""Names of files that Markdown shows as they are, also outside of spans of code."""


def title_line(engine: Engine, source: str) -> str:
    """Return the first line, which is known before there is any light."""
    return f"Light of {markdown(source)} for {engine.title}, by shrm {__release__}. Linear RGB."


def readme(engine: Engine, light: Light, package: Package) -> str:
    """Return the README: a line each of title, files, what was done, and loading, with the code.

    File names stand in it without folders, so that the same light makes the same text anywhere.
    """
    spans = [code_span(file.name) for file in package.files]
    told = []
    for line in package.told:
        name, colon, rest = line.partition(": ")
        is_hard = code_span(name) in spans and not _PLAIN.fullmatch(name)
        told.append(f"{code_span(name)}{colon}{rest}" if is_hard else line)
    lines = [
        title_line(engine, light.source),
        f"Files: {', '.join(spans)}.",
        f"What was done: {'; '.join(told) or 'nothing was turned or scaled'}.",
    ]
    if package.loading:
        code = (f"    {line}" for line in package.loading)
        lines += [f"Load it in {engine.title}:", "", *code]
    return "\n".join(lines) + "\n"
