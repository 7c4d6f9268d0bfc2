"""Run the benchmarks, print one table, and write it into README. Slow results are no failure.

`python -m tests.benchmarks start process` runs two of them, and ``--print`` writes nothing.
"""

import argparse
import os
from importlib import import_module

from shrm_cli.settings import limit_small_products
from tests.benchmarks.results import merged, read_results, write
from tests.benchmarks.table import Row, print_table

MODULES = [
    "tests.benchmarks.bench_sphere",
    "tests.benchmarks.bench_start",
    "tests.benchmarks.bench_process",
    "tests.benchmarks.bench_transfer",
    "tests.benchmarks.bench_batch",
]
"""The modules of benchmarks, each with a function `rows() -> Iterable[Row]`."""


def main(arguments: list[str] | None = None) -> None:
    """Collect the rows of the chosen modules, print them, and write them down."""
    names = [module.rpartition("bench_")[2] for module in MODULES]
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"some of {', '.join(names)}")
    parser.add_argument("--print", action="store_true", help="write nothing")
    given = parser.parse_args(arguments)
    for name in given.names:
        if name not in names:
            parser.error(f"no benchmark is called {name!r}; there are {', '.join(names)}")
    # Commands are timed as users run them, compiled; bench_start has a way of its own for others.
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    # The tool runs with one BLAS thread too. The references take as many threads as suit them.
    limit_small_products()
    chosen = [module for module, name in zip(MODULES, names, strict=True)
              if name in (given.names or names)]  # fmt: skip
    loaded = [import_module(module) for module in chosen]  # what is missing is told before work
    made: dict[str, list[Row]] = {}
    for module in loaded:
        found = made.setdefault(module.__name__.rpartition("bench_")[2], [])
        for row in module.rows():
            print(f"{row.ratio:.2f} of the reference: {row.name}", flush=True)
            found.append(row)
    print_table(row for rows in made.values() for row in rows)
    if not given.print:
        results = merged(read_results(), made)
        write({**results, "rows": {name: results["rows"][name] for name in names
                                   if name in results["rows"]}})  # fmt: skip


if __name__ == "__main__":
    main()
