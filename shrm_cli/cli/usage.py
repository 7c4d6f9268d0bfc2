"""What commands refuse, by one rule and in the same words: options that do not apply, lost files.

A file of a name which a command chooses itself is replaced if the same inputs and options made it,
or if the user says --force. What others made is kept, and the user is told before the work begins.
Pictures to look at are drawn anew where shrm drew them, whatever they show. Names that the user
gives by -o are written without asking.
"""

from __future__ import annotations

import json
import os
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

import shrm_cli as shrm
from shrm_cli.errors import ArgumentError, MapError, OutputError
from shrm_cli.files.whole import check_target, exists_error, note
from shrm_cli.messages import ARGUMENT
from shrm_cli.naming import probe_stem
from shrm_cli.vocabulary import RECIPE_ATTRIBUTE, Precision

if TYPE_CHECKING:
    from shrm_cli.maps.request import Request


Applies = tuple[bool, str]
"""Whether an option applies in this run; and where it does, for messages: ``with --probe``."""


def flags(message: str, typed: Iterable[str] | None = None) -> str:
    """Replace the arguments in a message of the library by flags of the command line.

    The library writes arguments in backticks: `size` becomes --size, and `split=False` becomes
    --no-split. What the user has typed, such as names of files, keeps its backticks.

    `typed` holds the words of the command line; by default the values of the running command's
    parameters.
    """
    typed = list(_typed() if typed is None else typed)
    names = [name for name in typed if "`" in name and name in message]
    if names:
        name = max(names, key=len)
        before, _, behind = message.partition(name)
        return flags(before, typed) + name + flags(behind, typed)
    return ARGUMENT.sub(
        lambda found: ("--no-" if found[2] else "--") + found[1].replace("_", "-"), message
    )


def _typed() -> Iterator[str]:
    """Yield the texts among the values of the running command's parameters."""
    context = click.get_current_context(silent=True)
    pending = [] if context is None else list(context.params.values())
    while pending:
        value = pending.pop()
        if isinstance(value, str):
            yield value
        elif isinstance(value, tuple | list):
            pending += value


def wrong_usage(message: str) -> click.UsageError:
    """Return the error of wrong usage of the running command, whose help it will name."""
    return click.UsageError(message, click.get_current_context())


def given_options() -> dict[str, str]:
    """Return the options given on the command line: flags by the names of their values."""
    context = click.get_current_context()
    return {
        param.name: param.opts[0]
        for param in context.command.get_params(context)
        if param.name
        and isinstance(param, click.Option)
        and context.get_parameter_source(param.name) is ParameterSource.COMMANDLINE
    }


def remember(ctx: click.Context, param: click.Parameter, value: bool) -> None:
    """Keep the value of a flag for all that a command calls, as the callback of its option."""
    ctx.meta[f"shrm.{param.name}"] = value


def is_quiet() -> bool:
    """Whether the running command prints errors only."""
    return _remembered("quiet")


def wants_json() -> bool:
    """Whether the running command prints its results as JSON."""
    return _remembered("as_json")


def _remembered(name: str) -> bool:
    context = click.get_current_context(silent=True)
    return context is not None and bool(context.meta.get(f"shrm.{name}"))


def refuse_inapplicable(rules: Mapping[str, Applies]) -> None:
    """Refuse options that are given on the command line and would have no effect.

    `rules` are rules by the names of the options' values. Options without a rule always apply.
    """
    for name, flag in given_options().items():
        holds, words = rules.get(name, (True, ""))
        if not holds:
            raise wrong_usage(f"{flag} applies {words}; leave it out")


@contextmanager
def renamed(**options: str) -> Iterator[None]:
    """Within this context refusals of an argument speak of the option that it came from.

    `**options` are by the library's name of an argument: the command's name for it.
    """
    try:
        yield
    except ArgumentError as error:
        name = options.get(error.argument, error.argument)
        raise ArgumentError(name, error.message) from None


def exclude(one: str, other: str) -> None:
    """Refuse two options, given by the names of their values, that contradict each other."""
    given = given_options()
    if one in given and other in given:
        raise wrong_usage(f"{given[one]} and {given[other]} exclude each other; leave one out")


PAGES = (".html", ".htm")
"""The suffixes of pages."""

force_option = click.option(
    "--force", is_flag=True,
    help="Replace a file of the default name that other inputs or options made.",
)  # fmt: skip


def source_stem(path: str, forms: Collection[str]) -> str:
    """Return what outputs are named after: a file's name without its suffix, and without a form."""
    stem = Path(path).stem
    base, dot, last = stem.rpartition(".")
    return probe_stem(f"{base if dot and last in forms else stem}.exr")


def check_outputs(
    targets: Iterable[str],
    *,
    files: Iterable[str] = (),
    specs: Iterable[str | None] = (),
    suffixes: Iterable[str] = (),
    draws: bool = False,
) -> None:
    """Check, before work begins, that outputs can be written and overwrite no input.

    `files` are paths of inputs that have not been opened yet; all others are known, see
    `files.whole`. `specs` are specifications of BRDFs, which may name files that have not been
    opened yet. `suffixes` are the suffixes that the targets' names may have, in lower case; by
    default any. `draws` tells whether the targets are pictures: under names that the user has not
    given, others are kept.
    """
    from shrm_cli.brdf.spec import named_files

    note(*files, *(path for spec in specs if spec is not None for path in named_files(spec)))
    for target in targets:
        check_target(target, tuple(suffixes))
        if draws and "output" not in given_options():
            _keep_foreign(target)


def _keep_foreign(target: str) -> None:
    """Refuse to draw over a picture that `shrm` did not draw."""
    from shrm_cli.files.png import is_ours

    if os.path.isfile(target) and os.path.getsize(target) and not is_ours(target):
        raise OutputError(f"{target}: exists, and shrm did not draw it; name it, or another, by -o")


def keep_other_map(target: str, probe: shrm.Probe, request: Request, precision: Precision) -> None:
    """Refuse to replace a map that was not made like the one that is asked for."""
    from shrm_cli.batch.made import difference

    if os.path.lexists(target):
        found = difference(target, probe, request, precision)
        if found is not None and not found.is_damage:
            raise exists_error(target, found.why)


def keep_edited(target: str) -> bool:
    """Refuse to replace what `shrm` wrote and somebody has edited since.

    Returns whether the file is damaged, so that nothing of it is worth keeping.
    """
    from shrm_cli.batch.made import change_of
    from shrm_cli.files.exr_header import holds_nothing

    if not os.path.isfile(target):
        return False
    found = change_of(target)
    if found is not None and not found.is_damage:
        raise exists_error(target, found.why)
    return found is not None or holds_nothing(target)


def readable_map(path: str) -> shrm.Map | None:
    """Return the map in a file that is only looked at, and is no input; None if it is no map."""
    from shrm_cli.files.whole import protecting

    with suppress(MapError), protecting():
        return shrm.open_map(path)
    return None


def keep_other_picture(target: str, recipe: Mapping[str, Any]) -> None:
    """Refuse to replace an EXR picture that was not made by the same recipe."""
    from shrm_cli.files.parts import peek

    if not os.path.lexists(target):
        return
    if keep_edited(target):
        return
    stored = peek(target)
    text = "" if stored is None else stored.first.text(RECIPE_ATTRIBUTE)
    if text != json.dumps(recipe):
        raise exists_error(target, "other inputs or options made it")
