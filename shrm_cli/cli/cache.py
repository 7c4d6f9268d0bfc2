"""`shrm cache` describes or clears what runs share: coefficients of BRDFs, and compiled modules."""

import click

import shrm_cli as shrm
from shrm_cli import bytecode, settings
from shrm_cli.cli import options
from shrm_cli.cli.terminal import tell
from shrm_cli.maps.options import bytes_text


@click.group()
def cache() -> None:
    """What is kept between runs: coefficients of BRDFs that take long to compute, and, where Python
    keeps none, compiled modules.

    The environment variable SHRM_CACHE_DIR names another folder for them.
    """


@cache.command()
@options.report_options
def info() -> None:
    """Say where the cache is, and how large."""
    from shrm_cli.brdf.cache import MOST_BYTES

    where = str(settings.cache_folder())
    count, size = _with_modules(where, *shrm.cache_usage())
    line = f"{where}: {_amount(count, size)}, at most {bytes_text(MOST_BYTES)}"
    tell({"folder": where, "entries": count, "bytes": size, "limit": MOST_BYTES}, [line])


@cache.command()
@options.report_options
def clear() -> None:
    """Remove everything in the cache."""
    where = str(settings.cache_folder())
    modules = _with_modules(where)
    bytecode.clear(where)
    count, size = (a + b for a, b in zip(shrm.clear_cache(), modules, strict=True))
    line = f"{where}: {_amount(count, size)} removed"
    tell({"folder": where, "removed": count, "bytes": size}, [line])


def _with_modules(where: str, count: int = 0, size: int = 0) -> tuple[int, int]:
    """Add the number and the bytes of the compiled modules in a cache."""
    sizes = [length for _, length in bytecode.kept_files(where)]
    return count + len(sizes), size + sum(sizes)


def _amount(count: int, size: int) -> str:
    return f"{count} {'entry' if count == 1 else 'entries'}, {bytes_text(size)}"
