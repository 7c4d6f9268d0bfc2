"""`shrm cache` describes or clears the cache of BRDF coefficients, which runs share."""

import click

from shrm_cli.cli.options import report_options
from shrm_cli.cli.terminal import echo, echo_json


@click.group()
def cache() -> None:
    """Coefficients of BRDFs, kept between runs where computing them takes long.

    The environment variable SHRM_CACHE_DIR names another folder for them.
    """


@cache.command()
@report_options
def info(as_json: bool, quiet: bool) -> None:
    """Say where the cache is, and how large."""
    from shrm_cli.brdf.cache import MOST_BYTES, folder, usage

    count, size = usage()
    where = str(folder())
    if as_json:
        echo_json({"folder": where, "entries": count, "bytes": size, "limit": MOST_BYTES})
    elif not quiet:
        limit = f"at most {MOST_BYTES / 2**20:.0f} MB"
        echo(f"{where}: {_amount(count, size)}, {limit}")


@cache.command()
@report_options
def clear(as_json: bool, quiet: bool) -> None:
    """Remove everything in the cache."""
    from shrm_cli.brdf.cache import clear, folder

    where = str(folder())
    count, size = clear()
    if as_json:
        echo_json({"folder": where, "removed": count, "bytes": size})
    elif not quiet:
        echo(f"{where}: {_amount(count, size)} removed")


def _amount(count: int, size: int) -> str:
    unit = f"{size / 2**20:.1f} MB" if size >= 2**20 else f"{size / 2**10:.1f} kB"
    return f"{count} {'entry' if count == 1 else 'entries'}, {unit}"
