"""The choice of functions, against trying all of them."""

from itertools import pairwise, product

import numpy as np
import pytest

from shrm_cli.maps.principal.selection import (
    best_counts,
    bundle_counts,
    bundle_degrees,
    bundle_functions,
    cubes_of,
)


@pytest.mark.parametrize("seed", range(5))
def test_best_counts_are_the_best_of_all(seed):
    rng = np.random.default_rng(seed)
    energies = np.sort(rng.random((4, 6)) ** 3, axis=1)[:, ::-1]
    found = best_counts(energies, 12)
    for cubes in range(1, 13):
        every = (
            sum(energies[q, :n].sum() for q, n in enumerate(counts))
            for counts in product(range(7), repeat=4)
            if all(a >= b for a, b in pairwise(counts)) and 0 < cubes_of(counts) <= cubes
        )
        counts = found[cubes - 1]
        assert cubes_of(counts) <= cubes
        held = sum(energies[q, :n].sum() for q, n in enumerate(counts))
        assert held == pytest.approx(max(every), abs=1e-12)


@pytest.mark.parametrize("counts", [(1,), (3, 2, 1), (5, 1, 1, 1), (2, 2)])
def test_bundles_hold_the_counts(counts):
    degrees = bundle_degrees(counts)
    assert bundle_counts(degrees) == counts
    assert sum(2 * p + 1 for p in degrees) == cubes_of(counts)
    assert list(degrees) == sorted(degrees, reverse=True)


@pytest.mark.parametrize("counts", [(1,), (3, 2, 1), (5, 1, 1, 1), (2, 2)])
def test_bundles_hold_every_function_once_the_strongest_where_degrees_are_low(counts):
    bundles = [each for same in bundle_functions(counts).values() for each in same]
    assert tuple(len(each) - 1 for each in bundles) == bundle_degrees(counts)
    for q, count in enumerate(counts):
        assert [each[q] for each in bundles if len(each) > q] == list(reversed(range(count)))
