"""Attributes of files: the fewest digits that tell 32-bit floats apart."""

import numpy as np

from shrm_cli.maps.stored import shortest, shortest_values


def test_many_numbers_are_as_short_as_one():
    rng = np.random.default_rng(4)
    of_all_sizes = rng.normal(size=3000) * 10.0 ** rng.integers(-30, 30, 3000)
    short = rng.integers(-999, 999, 500) * 10.0 ** rng.integers(-9, 9, 500)
    special = [0.0, 1.0, -1.0, 0.1, 1 / 3, 16777217.0, 3.4e38, 1.2e-38, 1.4e-45, 3e-42]
    values = np.concatenate([of_all_sizes, short, special]).reshape(2, -1)
    assert shortest_values(values) == [shortest(value) for value in values.ravel()]
