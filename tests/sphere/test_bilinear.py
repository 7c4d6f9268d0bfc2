"""The error of bilinear filtering, against filtering random functions with code of its own."""

import numpy as np
import pytest

from research.bilinear import bilinear, centers
from shrm_cli.sphere.bilinear import bilinear_errors, energy_places
from shrm_cli.sphere.quadrature import spiral_directions
from tests.oracles import real_harmonics

DIRECTIONS = 20000


@pytest.mark.proof
@pytest.mark.parametrize(
    ("degree", "size", "sampling"),
    [(2, 8, "center"), (6, 8, "center"), (12, 8, "center"), (10, 32, "center"), (6, 9, "border")],
)
@pytest.mark.slow
def test_error_is_that_of_filtering_random_harmonics(degree, size, sampling):
    rng = np.random.default_rng(degree)
    weights = rng.standard_normal((2 * degree + 1, 16))

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


@pytest.mark.parametrize("towards", [(1, 0.05, 0.1), (0.3, -1, 0.2), (-0.9, 0.85, 1)])
def test_error_of_a_lamp_depends_on_its_place(towards):
    """A lamp in the middle of a face is filtered with several times the error of one at a corner.

    The last lamp is at a corner, where the strips beside two edges overlap and are counted twice.
    """
    size, degree = 16, np.arange(17)
    axis = np.array(towards) / np.linalg.norm(towards)
    # A lobe about the axis: zonal harmonics that fall as those of a blurred lamp.
    energy = (2 * degree + 1) * np.exp(-((degree / 6) ** 2))

    def function(directions):
        legendre = np.polynomial.legendre.legvander(directions @ axis, degree[-1])
        return (legendre * (2 * degree + 1) * np.exp(-((degree / 6) ** 2) / 2)).sum(-1)[..., None]

    points = spiral_directions(4 * DIRECTIONS)
    exact = function(points)
    found = bilinear(function, size, points)
    measured = np.sum((found - exact) ** 2) / np.sum(exact**2)

    fine = function(centers(16)).reshape(1, 6 * 16, 16)
    details = fine - fine.mean()
    places = energy_places(details)
    assert places.sum() == pytest.approx(1)
    predicted = bilinear_errors(degree[-1], size, places=places) @ energy / energy.sum()
    evenly = bilinear_errors(degree[-1], size) @ energy / energy.sum()
    assert predicted == pytest.approx(measured, rel=0.3)
    assert abs(predicted - measured) < 0.5 * abs(evenly - measured)
