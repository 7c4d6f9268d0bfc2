"""The options of `shrm batch` that gather coefficients of all probes in one file."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, TypeVar

import click

from shrm_cli.cli.options import with_options
from shrm_cli.cli.usage import Applies, refuse_inapplicable
from shrm_cli.vocabulary import MAX_COLLECTED_ORDER

if TYPE_CHECKING:
    from shrm_cli.batch.collect import What
    from shrm_cli.batch.job import Chunk
    from shrm_cli.batch.work import Gathering, Result

Command = TypeVar("Command", bound=Callable[..., Any])


def gather_options(command: Command) -> Command:
    """Add the options --collect, --collect-order, --collect-what and --collect-window."""
    options = [
        click.option(
            "--collect", type=click.Path(dir_okay=False), metavar="FILE",
            help="Gather the coefficients of all probes in one .npz or .parquet.",
        ),
        click.option(
            "--collect-order", type=click.IntRange(0, MAX_COLLECTED_ORDER), default=2,
            show_default=True, help="Largest degree of these coefficients.",
        ),
        click.option(
            "--collect-what", type=click.Choice(["radiance", "irradiance"]), default="radiance",
            show_default=True, help="Coefficients of the light, or of the irradiance it gives.",
        ),
        click.option(
            "--collect-window", metavar="NAME[:WIDTH]", default="none", show_default=True,
            help="Factors of the degrees, as `shrm prefilter --to irradiance --window` has them.",
        ),
    ]  # fmt: skip
    return with_options(command, options)


def gathering_of(collect: str | None, order: int, what: What, window: str) -> Gathering | None:
    """Return what is gathered; None where nothing is.

    Raises
    ------
    click.UsageError
        If one of the other options is given without --collect.
    OutputError
        If the file cannot be written.
    """
    from shrm_cli.batch.collect import check_collection
    from shrm_cli.batch.work import Gathering

    rule = Applies(collect is not None, "with --collect")
    refuse_inapplicable(dict.fromkeys(("collect_order", "collect_what", "collect_window"), rule))
    if collect is None:
        return None
    check_collection(collect)
    return Gathering(order, what, window)


def write_gathered(
    path: str, gathering: Gathering, chunks: Sequence[Chunk], results: Sequence[Result]
) -> None:
    """Write the coefficients of all probes, in the order in which these were named."""
    from shrm_cli.batch.collect import Collection, write_collection

    order = {chunk.probe: index for index, chunk in reversed(list(enumerate(chunks)))}
    found = sorted(results, key=lambda each: order[each.probe])
    write_collection(path, Collection.of(found, gathering.what, gathering.order, gathering.window))
