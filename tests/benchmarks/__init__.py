"""Comparisons of speed with other libraries. `python -m tests.benchmarks` prints the table."""
