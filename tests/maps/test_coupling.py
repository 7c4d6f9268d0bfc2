"""Bundles of one degree, against sums over rings, and against sums of products."""

import numpy as np
import pytest

from shrm_cli.maps.coupling import bundle_coefficients
from tests import oracles
from tests.maps.rings import over_rings


def parts_of(rng, order_f, degree, bundles):
    parts = rng.standard_normal((order_f + 1, degree + 1, bundles, 3))
    for q in range(degree + 1):
        parts[:q, q] = 0
    return parts


@pytest.mark.parametrize("degree", range(7))
def test_each_bundle_is_a_degree_of_an_shrm(degree):
    rng = np.random.default_rng(degree)
    light = rng.standard_normal((21**2, 3))
    parts = parts_of(rng, 20, degree, 2)
    found = bundle_coefficients(light, parts)
    for bundle in range(2):
        values = np.zeros((21, degree + 1, degree + 1, 3))
        values[:, degree] = parts[:, :, bundle]
        expected = over_rings(light, values)[:, degree**2 :]
        np.testing.assert_allclose(found[:, :, bundle], expected, atol=1e-11)


def test_a_vector_is_the_gradient_that_it_should_be():
    """p = q = 1 of one harmonic of light: a tangent field along the harmonic's gradient."""
    degree = 3
    light = np.zeros((16, 1))
    light[degree * (degree + 1) + 1] = 1.0
    parts = np.zeros((4, 2, 1, 1))
    parts[degree, 1] = 1.0
    series = bundle_coefficients(light, parts)[:, :, 0, 0]
    points = oracles.random_directions(np.random.default_rng(0), 40)
    y, z, x = (oracles.real_harmonics(4, points) @ series).T
    field = np.stack([x, y, z], axis=1)
    assert np.abs(np.sum(field * points, axis=1)).max() < 1e-12
    step = 1e-5
    gradient = np.empty((40, 3))
    for axis in range(3):
        offset = step * np.eye(3)[axis]
        ends = [points + offset, points - offset]
        high, low = (
            oracles.real_harmonics(degree, end / np.linalg.norm(end, axis=1)[:, None])[:, 13]
            for end in ends
        )
        gradient[:, axis] = (high - low) / (2 * step)
    ratio = np.sum(field * gradient, axis=1) / np.sum(gradient**2, axis=1)
    np.testing.assert_allclose(ratio, ratio[0], rtol=1e-6)
    np.testing.assert_allclose(field, ratio[0] * gradient, atol=1e-7)
