"""Pages of the reference: one a command, from click, and one of the library, from docstrings."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator, Mapping

import click

from shrm_cli.cli.main import cli

_NAME = """::: shrm_cli.{home}.{name}
    options:
      heading: "{name}"
      toc_label: "{name}"
"""
_PYTHON = """# Python

All that `import shrm_cli as shrm` offers; [the library](../library.md) tells how it goes together.

"""


def command_pages() -> Iterator[tuple[str, str]]:
    """Yield the name of each page of commands and its text; `index` lists them all."""
    context = click.Context(cli, info_name="shrm", **cli.context_settings)
    commands = {name: cli.get_command(context, name) for name in cli.list_commands(context)}
    rows = [
        f"| [`shrm {name}`]({name}.md) | {_escaped(each.get_short_help_str(200))} |"
        for name, each in commands.items()
    ]
    whole = "\n".join(_parts(cli, context, 1))
    yield "index", "\n".join((whole, "", "| Command | |", "|---|---|", *rows, ""))
    for name, each in commands.items():
        inner = click.Context(each, parent=context, info_name=name)
        yield name, "\n".join(_parts(each, inner, 1))


def python_page(homes: Mapping[str, str]) -> str:
    """Return the page of the public names, from the module that defines each."""
    return _PYTHON + "\n".join(_NAME.format(home=home, name=name) for name, home in homes.items())


def _parts(command: click.Command, context: click.Context, level: int) -> Iterator[str]:
    """Yield the Markdown of a command, and that of its own commands below it."""
    yield f"{'#' * level} {context.command_path}\n"
    usage = " ".join(command.collect_usage_pieces(context))
    yield f"```text\n{context.command_path} {usage}\n```\n"
    for paragraph in re.split(r"\n\s*\n", inspect.cleandoc(command.help or "")):
        yield _paragraph(paragraph) + "\n"
    records = [each.get_help_record(context) for each in command.get_params(context)]
    yield "| Option | |\n|---|---|"
    for names, text in filter(None, records):
        if text:  # arguments have none: the usage names them
            yield f"| `{names}` | {_escaped(text)} |"
    yield ""
    if isinstance(command, click.Group) and command is not cli:
        for name in command.list_commands(context):
            inner = command.get_command(context, name)
            yield from _parts(inner, click.Context(inner, context, name), level + 1)


def _paragraph(text: str) -> str:
    r"""Return a paragraph of help; one behind \b keeps its lines, as commands and tables do."""
    if text.startswith("\b"):
        return f"```text\n{inspect.cleandoc(text[1:].lstrip(chr(10)))}\n```"
    return _escaped(text)


def _escaped(text: str) -> str:
    """Return text for Markdown, in whose tables, too, it means itself; options become code."""
    spans = re.split(r"(`[^`]*`|(?<![\w-])--[a-z][\w-]*)", " ".join(text.split()))
    for i in range(0, len(spans), 2):
        spans[i] = re.sub(r"([*_|\[\]$~])", r"\\\1", spans[i])
        spans[i] = spans[i].replace("<", "&lt;").replace(">", "&gt;")
    return "".join(f"`{each}`" if each.startswith("--") else each for each in spans)
