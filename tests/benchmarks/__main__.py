"""Run every benchmark and print one table. Slow results do not make the program fail."""

from importlib import import_module

from shrm_cli.cli.threads import limit_small_products
from tests.benchmarks.table import print_table

MODULES = [
    "tests.benchmarks.bench_sphere",
    "tests.benchmarks.bench_process",
    "tests.benchmarks.bench_transfer",
    "tests.benchmarks.bench_batch",
]
"""The modules of benchmarks, each with a function `rows() -> Iterable[Row]`."""


def main() -> None:
    """Collect the rows of all modules and print them."""
    # The tool runs with one BLAS thread too. The references take as many threads as suit them.
    limit_small_products()
    loaded = [import_module(module) for module in MODULES]  # what is missing is told before work
    print_table(row for module in loaded for row in module.rows())


if __name__ == "__main__":
    main()
