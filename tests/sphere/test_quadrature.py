import numpy as np
import pytest

from shrm_cli.sphere import quadrature
from tests import oracles
from tests.oracles import EPS

SAMPLINGS = ["center", "border"]


def test_nodes():
    np.testing.assert_allclose(quadrature.nodes(4), [-0.75, -0.25, 0.25, 0.75])
    np.testing.assert_allclose(quadrature.nodes(5, "border"), [-1, -0.5, 0, 0.5, 1])
    assert quadrature.nodes(1).tolist() == quadrature.nodes(1, "border").tolist() == [0]


def integrals_of_cosines(count):
    """Of cos(k theta) sin(theta) over 0..pi, by Gauss-Legendre."""
    x, weights = np.polynomial.legendre.leggauss(count + 40)
    theta = (x + 1) * (np.pi / 2)
    return np.cos(np.outer(np.arange(count), theta)) @ (weights * np.sin(theta)) * (np.pi / 2)


@pytest.mark.parametrize(
    ("height", "sampling"),
    [(n, "center") for n in (1, 2, 3, 4, 7, 8, 64, 101, 512)]
    + [(n, "border") for n in (2, 3, 4, 5, 8, 9, 64, 101, 513)],
)
def test_colatitude_weights_are_exact_below_the_height(height, sampling):
    weights = quadrature.colatitude_weights(height, sampling)
    theta = (np.array(oracles.positions(height, sampling)) + 1) * (np.pi / 2)
    assert weights.shape == (height,)
    assert weights.min() > 0
    assert weights.sum() == pytest.approx(2, rel=8 * EPS)
    found = np.cos(np.outer(np.arange(height), theta)) @ weights
    np.testing.assert_allclose(found, integrals_of_cosines(height), atol=2 * height * EPS)


@pytest.mark.parametrize("width", [1, 2, 7, 8, 64])
def test_longitude_weights_of_centers(width):
    weights = quadrature.longitude_weights(width)
    angle = np.pi * np.array(oracles.positions(width, "center"))
    waves = np.exp(1j * np.outer(np.arange(width), angle)) @ weights
    np.testing.assert_allclose(waves, [2 * np.pi] + [0] * (width - 1), atol=8 * width * EPS)


@pytest.mark.parametrize("width", [2, 3, 8, 65])
def test_longitude_weights_of_borders(width):
    """One wave fewer: the two ends are one meridian."""
    weights = quadrature.longitude_weights(width, "border")
    angle = np.pi * np.array(oracles.positions(width, "border"))
    waves = np.exp(1j * np.outer(np.arange(width - 1), angle)) @ weights
    np.testing.assert_allclose(waves, [2 * np.pi] + [0] * (width - 2), atol=8 * width * EPS)
    assert weights[0] == weights[-1]


@pytest.mark.parametrize("count", [1, 2, 5, 80])
def test_gauss_legendre_against_numpy(count):
    for found, expected in zip(
        quadrature.gauss_legendre(count), np.polynomial.legendre.leggauss(count), strict=True
    ):
        np.testing.assert_allclose(found, expected, rtol=0, atol=4e-15)


@pytest.mark.parametrize("count", [1, 2, 97, 4096])
def test_scrambled_numbers_are_all_there(count):
    assert sorted(quadrature.scrambled(count)) == list(range(count))


def test_scrambled_numbers_have_no_pattern():
    # Independent numbers are correlated by less than 4 / sqrt(n) nearly always.
    number, mixed = np.arange(4096), quadrature.scrambled(4096)
    limit = 4 / np.sqrt(4096)
    assert abs(np.corrcoef(number, mixed)[0, 1]) < limit
    assert abs(np.corrcoef(mixed[1:], mixed[:-1])[0, 1]) < limit
    for wave in (2, 3, 64, 1000):
        turns = np.exp(2j * np.pi * wave / 4096 * (mixed - number))
        assert abs(turns.mean()) < limit
