"""Run every benchmark and print one table. Never fails because of the clock."""

from importlib import import_module

from shrm_cli.cli.threads import limit_small_products
from tests.benchmarks.table import print_table

MODULES = ["tests.benchmarks.bench_sphere", "tests.benchmarks.bench_process"]
"""Each has `rows() -> Iterable[Row]`."""


def main() -> None:
    """Collect the rows of all modules."""
    # As the tool runs: one BLAS thread. The references take as many threads as suits them.
    limit_small_products()
    print_table(row for module in MODULES for row in import_module(module).rows())


if __name__ == "__main__":
    main()
