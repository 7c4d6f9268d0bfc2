"""Man pages, one a command, and the scripts by which shells complete, from click.

python -m tests.site.manual FOLDER
"""

from __future__ import annotations

import inspect
import re
import sys
from collections.abc import Iterator
from pathlib import Path

import click
from click.shell_completion import get_completion_class

from shrm_cli import __release__
from shrm_cli.cli.main import cli


def man_pages(folder: Path) -> None:
    """Write `shrm.1` and a page for each command, and what shells complete by, into a folder."""
    folder.mkdir(parents=True, exist_ok=True)

    def write(command: click.Command, context: click.Context) -> None:
        page = "\n".join((*_page(command, context), ""))
        (folder / f"{_name(context)}.1").write_text(page, encoding="utf-8")
        for name, inner in _inner(command, context):
            write(inner, click.Context(inner, context, name))

    write(cli, click.Context(cli, info_name="shrm", **cli.context_settings))
    for shell in ("bash", "zsh", "fish"):
        completion = get_completion_class(shell)(cli, {}, "shrm", "_SHRM_COMPLETE")
        (folder / f"shrm.{shell}").write_text(completion.source(), encoding="utf-8")


def _page(command: click.Command, context: click.Context) -> Iterator[str]:
    """Yield the lines of a page in the man macros of roff, as man(7) has them."""
    name, usage = _name(context), " ".join(command.collect_usage_pieces(context))
    yield f'.TH {_text(name.upper())} 1 "" "shrm {__release__}" "shrm"\n.ad l\n.nh'
    yield f".SH NAME\n{_text(name)} \\- {_text(command.get_short_help_str(200))}"
    yield f".SH SYNOPSIS\n.B {_text(context.command_path)}\n{_text(usage)}\n.SH DESCRIPTION"
    for paragraph in re.split(r"\n\s*\n", inspect.cleandoc(command.help or "")):
        if paragraph.startswith("\b"):  # its lines stay, as those of commands and tables
            lines = inspect.cleandoc(paragraph[1:].lstrip("\n")).splitlines()
            yield "\n".join((".PP\n.RS\n.nf", *map(_text, lines), ".fi\n.RE"))
        else:
            yield f".PP\n{_text(' '.join(paragraph.split()))}"
    yield ".SH OPTIONS"
    for each in command.get_params(context):
        found = each.get_help_record(context)
        if found and found[1]:  # arguments have no text: the usage names them
            yield f".TP\n.B {_text(found[0])}\n{_text(found[1])}"
    inner = list(_inner(command, context))
    if inner:
        yield ".SH COMMANDS"
    for below, each in inner:
        yield f".TP\n.BR {_text(f'{name}-{below}')} (1)\n{_text(each.get_short_help_str(200))}"
    if context.parent:
        yield f".SH SEE ALSO\n.BR {_text(_name(context.parent))} (1)"


def _name(context: click.Context) -> str:
    return context.command_path.replace(" ", "-")


def _inner(command: click.Command, context: click.Context) -> Iterator[tuple[str, click.Command]]:
    """Yield the commands below a command."""
    if isinstance(command, click.Group):
        for name in command.list_commands(context):
            yield name, command.get_command(context, name)


def _text(text: str) -> str:
    """Return a line that means itself: hyphens that can be copied, and no request of roff's.

    Lists of values may be broken after each bar.
    """
    text = text.replace("\\", r"\e").replace("-", r"\-").replace("|", r"|\:")
    return re.sub(r"^(?=[.'])", r"\\&", text)


if __name__ == "__main__":
    man_pages(Path(sys.argv[1]))
