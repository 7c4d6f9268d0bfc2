"""How commands refuse options that do not apply, by one rule and in the same words."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager

import click
from click.core import ParameterSource

from shrm_cli.errors import ArgumentError
from shrm_cli.messages import ARGUMENT
from shrm_cli.records import record


@record
class Applies:
    """Whether an option applies.

    Attributes
    ----------
    holds : bool
        Whether the option applies in this run.
    words : str
        Where the option applies, for the error message: ``with --probe`` or ``to maps``.
    """

    holds: bool
    words: str


def flags(message: str, typed: Iterable[str] | None = None) -> str:
    """Replace the arguments in a message of the library by flags of the command line.

    The library writes arguments in backticks: `size` becomes --size, and `split=False` becomes
    --no-split. What the user has typed, such as names of files, keeps its backticks.

    Parameters
    ----------
    message : str
    typed : iterable of str, optional
        The words of the command line; by default the values of the running command's parameters.
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
        for param in context.command.params
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

    Parameters
    ----------
    rules : mapping of str to Applies
        Rules by the names of the options' values. Options without a rule always apply.

    Raises
    ------
    click.UsageError
        If an option was given that does not apply.
    """
    for name, flag in given_options().items():
        rule = rules.get(name)
        if rule is not None and not rule.holds:
            raise wrong_usage(f"{flag} applies {rule.words}; leave it out")


@contextmanager
def renamed(**options: str) -> Iterator[None]:
    """Within this context refusals of an argument speak of the option that it came from.

    Parameters
    ----------
    **options
        By the library's name of an argument: the command's name for it.

    Raises
    ------
    ArgumentError
        If the block raises one.
    """
    try:
        yield
    except ArgumentError as error:
        name = options.get(error.argument, error.argument)
        raise ArgumentError(name, error.message) from None


def exclude(one: str, other: str) -> None:
    """Refuse two options, given by the names of their values, that contradict each other.

    Raises
    ------
    click.UsageError
        If both are given on the command line.
    """
    given = given_options()
    if one in given and other in given:
        raise wrong_usage(f"{given[one]} and {given[other]} exclude each other; leave one out")
