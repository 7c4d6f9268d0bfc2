"""The options of `shrm batch` that hand it to the queue of a farm."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import click

from shrm_cli.cli import usage
from shrm_cli.cli.options import several
from shrm_cli.cli.terminal import echo, echo_lines, echo_message
from shrm_cli.cli.types import FILE, Parsed, option, whole
from shrm_cli.messages import has_secret, shown

if TYPE_CHECKING:
    from shrm_cli.batch.job import Chunk

_OWN = ("--commands", "--openjd", "--chunk")
"""The options that ask for files of a farm, which its command lines leave out."""
_FOR_ALL = {
    "share": "which a farm's command lines say themselves",
    "dry_run": "with which a farm's command lines would make nothing",
    "collect": "which each command line of a farm would write anew; gather in a run of its own",
    "contact_page": "which each command line of a farm would write anew; use `shrm contact`",
}
"""Options that the command lines cannot have, and why."""


def _part(text: str) -> tuple[int, int, int]:
    from shrm_cli.batch.farm import parse_part

    return parse_part(text)


farm_options = several(
    option(
        "--commands FILE", FILE,
        help="Write command lines for a farm, one for each chunk, and make nothing; - prints them.",
    ),
    option("--openjd FILE", FILE, "Write an Open Job Description template instead; - prints it."),
    option("--chunk N", whole(1, 10**9), "Probes of a chunk, about.", default=100),
    option(
        "--share K/N|A-B/N", Parsed("K/N", _part),
        help="Make one part of N, or several, as the command lines of farms do.",
    ),
)  # fmt: skip


def refuse_for_farms() -> None:
    """Refuse options that hold for a whole run, beside those that divide it."""
    given = usage.given_options()
    for name in _FOR_ALL.keys() & given.keys():
        raise usage.wrong_usage(f"leave out {given[name]}, {_FOR_ALL[name]}")


def write_farm_files(
    words: Sequence[str], commands: str | None, openjd: str | None, probes: int, chunk: int
) -> None:
    """Write the files that a farm takes.

    `words` is what follows ``shrm batch``. `commands` and `openjd` are the files. `probes` is the
    number of probes. `chunk` is how many of them a command takes, on average.
    """
    from shrm_cli.batch.farm import command_lines, openjd_template
    from shrm_cli.files.whole import check_target, write_bytes
    from shrm_cli.maps.options import counted

    parts = -(-probes // chunk)
    rest = _without_own(words)
    if any(has_secret(word) for word in rest):
        echo_message(
            "Warning: a URL holds a password or a signature, which whoever can read the file of "
            "the farm will have; put credentials into the environment (docs/batch.md)"
        )
    texts = {}
    if commands is not None:
        texts[commands] = "\n".join(command_lines(rest, parts)) + "\n"
    if openjd is not None:
        texts[openjd] = openjd_template(rest, parts)
    printed = texts.pop("-", None)
    if printed is not None:
        echo(printed.removesuffix("\n"))
    for path in texts:
        check_target(path)
    for path, text in texts.items():
        write_bytes(path, text.encode())
        told = f"{path}: {counted(parts, 'part')} of {counted(probes, 'probe')}"
        echo_lines([told], err=printed is not None)


def named_parts(
    chunks: list[Chunk], share: tuple[int, int, int] | None, gathered: Sequence[str | None] = ()
) -> list[Chunk]:
    """Return the chunks that belong to the parts that --share names; all of them without it.

    Of files that hold all probes together, `gathered`, it says that they will hold these parts.
    """
    if share is None:
        return chunks
    from shrm_cli.batch.farm import part_of

    first, last, count = share
    for name in (each for each in gathered if each is not None and last - first + 1 < count):
        echo_message(
            f"Warning: {shown(name)}: it will hold this part alone, and each part writes it anew; "
            "gather without --share, or name one for each part"
        )
    own = [chunk for chunk in chunks if first <= part_of(chunk.probe, count) <= last]
    if not own and not usage.is_quiet():
        part = first if first == last else f"{first}-{last}"
        echo_lines([f"part {part} of {count} has none of {len(chunks)} probes"], err=True)
    return own


def _without_own(words: Sequence[str]) -> list[str]:
    """Return the words of a command line without the options that ask for files of a farm.

    A word behind an option that takes a value is that value, whatever it looks like.
    """
    options = {
        name: not (option.is_flag or option.count)
        for option in click.get_current_context().command.params
        if isinstance(option, click.Option)
        for name in option.opts
    }
    found: list[str] = []
    rest = list(words)
    while rest and rest[0] != "--":
        name, has_value, _ = rest[0].partition("=")
        count = 1 + (options.get(name, False) and not has_value)
        if name not in _OWN:
            found += rest[:count]
        del rest[:count]
    return [*found, *rest]
