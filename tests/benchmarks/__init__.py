"""Speed beside other people's code. `python -m tests.benchmarks` prints the table."""
