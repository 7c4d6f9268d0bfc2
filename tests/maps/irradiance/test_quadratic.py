"""Quadratic programs against scipy's solvers."""

import numpy as np
import pytest
from scipy.optimize import minimize, nnls

from shrm_cli.maps.irradiance.window import non_negative_least_squares, shortest_within


@pytest.mark.parametrize("case", range(30))
def test_the_shortest_vector_is_that_of_slsqp(case):
    rng = np.random.default_rng(case)
    n, m = int(rng.integers(1, 9)), int(rng.integers(1, 60))
    rows = rng.normal(size=(m, n))
    rows /= np.linalg.norm(rows, axis=1, keepdims=True)
    inside = rng.normal(size=n) * rng.uniform(0, 1)
    bounds = rows @ inside + rng.exponential(0.1, m) * (rng.uniform(size=m) < 0.8)
    found = shortest_within(rows, bounds)
    assert (rows @ found - bounds).max() < 1e-12
    expected = minimize(
        lambda x: x @ x, inside, jac=lambda x: 2 * x, method="SLSQP",
        constraints={"type": "ineq", "fun": lambda x: bounds - rows @ x, "jac": lambda _: -rows},
        options={"ftol": 1e-14, "maxiter": 500},
    ).x  # fmt: skip
    assert np.linalg.norm(found) == pytest.approx(np.linalg.norm(expected), abs=1e-8)


def test_nothing_is_moved_where_0_is_within():
    assert not shortest_within(np.eye(3), np.array([0.0, 1.0, 2.0])).any()


def test_bounds_that_contradict_each_other():
    assert shortest_within(np.array([[1.0], [-1.0]]), np.array([-1.0, -1.0])) is None
    assert shortest_within(np.array([[1.0], [-1.0]]), np.array([-1.0, 1.0])) == pytest.approx([-1])


@pytest.mark.parametrize("case", range(20))
def test_non_negative_least_squares_are_scipys(case):
    """Of more rows than columns and fewer, some columns twice."""
    rng = np.random.default_rng(case)
    m, n = int(rng.integers(1, 12)), int(rng.integers(1, 40))
    matrix, target = rng.normal(size=(m, n)), rng.normal(size=m)
    matrix = np.concatenate([matrix, matrix[:, : n // 2], np.zeros((m, 1))], axis=1)
    found = non_negative_least_squares(matrix, target)
    assert found.min() >= 0
    expected = nnls(matrix, target)[1]
    assert np.linalg.norm(matrix @ found - target) == pytest.approx(expected, abs=1e-10)
