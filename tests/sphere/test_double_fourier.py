import tracemalloc

import numpy as np
import pytest

from shrm_cli.sphere import double_fourier
from shrm_cli.sphere.double_fourier import fourier_from_harmonics, harmonics_from_moments
from tests import oracles
from tests.oracles import random_directions, tolerance

ORDERS = [0, 1, 2, 5, 6, 30, 100]


def waves(order, directions):
    """Every ``[cos or sin of m phi, m, k, direction]``, by its definition."""
    theta, phi = oracles.angles(directions)
    result = np.empty((2, order + 1, order + 1, len(theta)))
    for m in range(order + 1):
        for k in range(order + 1):
            along = np.sin(k * theta) if m % 2 else np.cos(k * theta)
            result[:, m, k] = np.cos(m * phi) * along, np.sin(m * phi) * along
    return result


@pytest.mark.parametrize("order", ORDERS)
def test_the_fourier_series_is_the_harmonic_series(rng, order):
    coefficients = rng.standard_normal(((order + 1) ** 2, 2))
    directions = np.vstack([random_directions(rng, 6), [[0, 0, 1], [0, 0, -1], [0, -1, 0]]])
    fourier = fourier_from_harmonics(coefficients)
    assert fourier.shape == (2, order + 1, order + 1, 2)
    found = np.einsum("amkd,amkc->dc", waves(order, directions), fourier)
    expected = oracles.real_harmonics(order, directions) @ coefficients
    scale = np.abs(coefficients).max() * (order + 1)
    np.testing.assert_allclose(found, expected, rtol=0, atol=tolerance(order) * scale)


@pytest.mark.parametrize("order", [0, 1, 4, 9])
def test_moments_of_a_function_give_its_coefficients(rng, order):
    """The moments of a polynomial of higher degree, by brute-force integration."""
    planes = rng.standard_normal((order + 2, 3))

    def function(directions):
        return np.prod(directions @ planes.T - 0.3, axis=-1)

    # Wave by wave, the part of the function with the same m makes a polynomial of the product.
    directions, weights = oracles.sphere_rule(2 * order + 2)
    moments = waves(order, directions) @ (weights * function(directions))
    expected = oracles.project(function, order, order + 2)
    np.testing.assert_allclose(
        harmonics_from_moments(moments[..., None])[:, 0],
        expected,
        atol=tolerance(order) * 10 * np.abs(expected).max(),
    )


@pytest.mark.parametrize("order", ORDERS)
def test_the_two_are_adjoint(rng, order):
    series = rng.standard_normal(((order + 1) ** 2, 3))
    moments = rng.standard_normal((2, order + 1, order + 1, 3))
    forward = fourier_from_harmonics(series) * moments
    backward = harmonics_from_moments(moments) * series
    np.testing.assert_allclose(
        forward.sum(axis=(0, 1, 2)),
        backward.sum(axis=0),
        atol=tolerance(order) * np.linalg.norm(series) * np.linalg.norm(moments) / (order + 1),
    )


def test_kept_and_fresh_tables_agree(rng):
    """A series of order 96, whose tables are kept, is one of order 97 with a zero degree."""
    series = rng.standard_normal((97**2, 1))
    longer = np.vstack([series, np.zeros((98**2 - 97**2, 1))])
    directions = random_directions(rng, 4)
    short, long = (
        np.einsum("amkd,amk->d", waves(order, directions), fourier_from_harmonics(c)[..., 0])
        for order, c in ((96, series), (97, longer))
    )
    np.testing.assert_allclose(short, long, atol=tolerance(97))


@pytest.fixture(params=[1, 5000])
def small_blocks(request, monkeypatch):
    """Tables of few m at a time, made anew for each call."""
    monkeypatch.setattr(double_fourier, "_TABLE_BYTES", request.param)
    monkeypatch.setattr(double_fourier, "KEPT_ORDER", -1)


@pytest.mark.parametrize("order", [0, 1, 6, 21])
def test_functions_of_few_m_at_a_time(rng, order, small_blocks):
    test_the_fourier_series_is_the_harmonic_series(rng, order)
    test_the_two_are_adjoint(rng, order)


def test_high_orders_take_little_memory():
    """All functions together would take 110 MB."""
    moments = np.ones((2, 301, 301, 1))
    tracemalloc.start()
    try:
        harmonics_from_moments(moments)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < 60e6
