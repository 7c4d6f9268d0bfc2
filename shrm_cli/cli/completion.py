"""What the shell completes: names of BRDFs, their parameters, and what these may be.

click completes commands, options, choices and files by itself.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem

    from shrm_cli.brdf.base import Brdf

_START = re.compile(r"(?:^|\+|=\()(?:[0-9.eE+-]*\*)?")
"""Where terms begin: with a weight, after a plus or in the parentheses of a value."""


class Spec(click.ParamType):  # type: ignore[type-arg]  # click's type is generic since 8.5 only
    """The specification of a BRDF, as text; `shrm_cli.brdf.spec.parse_spec` judges it."""

    name = "SPEC"

    def convert(self, value: str, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """Return the text."""
        return value

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Return how the last term may go on, and files where no model is called so."""
        from click.shell_completion import CompletionItem  # slow to load, and rarely needed

        start, last = _last_term(incomplete)
        endings = _endings(last)
        if endings:
            return [CompletionItem(start + ending) for ending in endings]
        return [CompletionItem(incomplete, type="file")]


def _last_term(text: str) -> tuple[str, str]:
    """Split a specification into what comes before the name of its last term, and that term."""
    from shrm_cli.brdf.nested import masked

    start = max(match.end() for match in _START.finditer(masked(text)))
    return text[:start], text[start:]


def _endings(term: str) -> list[str]:
    """Return what a term may become: with a name, with a parameter's name, or with its value."""
    from shrm_cli.brdf.library import find_model, model_names
    from shrm_cli.brdf.nested import COMMA, cut
    from shrm_cli.errors import BrdfError

    name, colon, values = term.partition(":")
    if not colon:
        return [each for each in model_names() if each.startswith(name)]
    try:
        model = find_model(name)
    except BrdfError:
        return []
    *given, current = cut(COMMA, values)
    before = f"{name}:{','.join([*given, ''])}"
    return [before + each for each in _settings(model, given, current)]


def _settings(model: type[Brdf], given: list[str], current: str) -> list[str]:
    """Return what may stand for the last ``key=value``, after those that are given."""
    key, equals, value = current.partition("=")
    if not equals:
        taken = {each.partition("=")[0] for each in given}
        names = [each.name for each in model.parameters if each.name not in taken]
        return [f"{each}=" for each in names if each.startswith(key)]
    known = next((each for each in model.parameters if each.name == key), None)
    choices = () if known is None else (*known.choices, *known.names)
    return [f"{key}={each}" for each in choices if each.startswith(value)]
