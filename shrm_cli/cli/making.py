"""The options about what a map is like, which `shrm prefilter` and `shrm batch` share."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import click

from shrm_cli.cli.options import (
    precision_option,
    representation_options,
    shared_options,
    with_options,
)
from shrm_cli.maps.options import Option
from shrm_cli.vocabulary import SAMPLINGS

Command = TypeVar("Command", bound=Callable[..., Any])


def making_options(
    probes: str, cubes: str, wanted: Callable[[Option], bool] = lambda option: True
) -> Callable[[Command], Command]:
    """Return a decorator that adds the options of making maps, each of them once.

    Parameters
    ----------
    probes, cubes : str
        What the command calls what it reads and writes: ``probe`` or ``probes``.
    wanted : callable
        Whether one of the representations' own options is added.
    """
    samplings = click.Choice(SAMPLINGS)
    both = click.option(
        "--sampling", type=samplings,
        help=f"Where edge pixels lie, in the {probes} and in the written {cubes}.",
    )  # fmt: skip
    of_probes = click.option(
        "--probe-sampling", type=samplings, help=f"The same, of the {probes} alone."
    )
    of_maps = click.option(
        "--map-sampling", type=samplings, help=f"The same, of the written {cubes} alone."
    )
    options = [
        shared_options("eps", "error", "seen", "order_f", "order_p", "center"),
        representation_options(wanted),
        shared_options("domain", "source_height", "frame", "size", "max_size", "sun"),
        precision_option, both, of_probes, of_maps,
    ]  # fmt: skip
    return lambda command: with_options(command, options)
