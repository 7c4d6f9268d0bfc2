"""Interpolation over the polar angle, against the functions that are interpolated."""

import numpy as np
import pytest

from shrm_cli.sphere.quadrature import interpolation_matrix, linear_matrix


@pytest.mark.parametrize("odd", [False, True])
def test_cubics_of_the_right_parity_are_exact(odd):
    rng = np.random.default_rng(3)
    nodes = np.sort(rng.uniform(0.05, 3.0, 20))
    targets = np.linspace(0, np.pi, 31)
    power = 3 if odd else 2
    found = interpolation_matrix(nodes, targets, odd) @ (nodes**power - 0.5 * nodes ** (power - 2))
    np.testing.assert_allclose(found, targets**power - 0.5 * targets ** (power - 2), atol=1e-9)


def test_linear_functions_are_exact_and_ends_hold():
    nodes, targets = np.linspace(0, 2, 9), np.array([-1.0, 0.0, 0.3, 1.99, 2.0, 5.0])
    found = linear_matrix(nodes, targets) @ (3 * nodes + 1)
    np.testing.assert_allclose(found, 3 * np.clip(targets, 0, 2) + 1)
