"""The error of bilinear filtering, against filtering random functions with code of its own."""

import numpy as np
import pytest

from shrm_cli.sphere.bilinear import bilinear_errors
from shrm_cli.sphere.quadrature import spiral_directions
from tests.bilinear import bilinear
from tests.oracles import real_harmonics

DIRECTIONS = 4000


@pytest.mark.parametrize(
    ("degree", "size", "sampling"),
    [(2, 8, "center"), (6, 8, "center"), (12, 8, "center"), (10, 32, "center"), (6, 9, "border")],
)
def test_error_is_that_of_filtering_random_harmonics(degree, size, sampling):
    rng = np.random.default_rng(degree)
    weights = rng.standard_normal((2 * degree + 1, 8))

    def function(directions):
        harmonics = real_harmonics(degree, directions.reshape(-1, 3))
        return (harmonics[:, degree**2 :] @ weights).reshape(*directions.shape[:-1], -1)

    points = spiral_directions(DIRECTIONS)
    exact = function(points)
    found = bilinear(function, size, points, sampling)
    measured = np.sum((found - exact) ** 2) / np.sum(exact**2)
    assert bilinear_errors(degree, size, sampling)[degree] == pytest.approx(measured, rel=0.1)


def test_constants_are_filtered_exactly_and_lost_waves_are_not():
    errors = bilinear_errors(2000, 4)
    assert errors[0] == pytest.approx(0, abs=1e-15)
    assert errors[-50:].mean() == pytest.approx(13 / 9, rel=0.05)
