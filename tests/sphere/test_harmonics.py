from collections import deque

import numpy as np
import pytest
from scipy.special import sph_harm_y

from shrm_cli.sphere import harmonics
from tests import oracles
from tests.oracles import EPS, random_directions, tolerance

AXES = np.vstack([np.eye(3), -np.eye(3)])


def test_the_oracle_is_orthonormal():
    directions, weights = oracles.sphere_rule(16)
    basis = oracles.real_harmonics(8, directions)
    np.testing.assert_allclose((basis.T * weights) @ basis, np.eye(81), atol=tolerance(8))


def test_index_order():
    pairs = [(degree, m) for degree in range(6) for m in range(-degree, degree + 1)]
    assert [harmonics.index(degree, m) for degree, m in pairs] == list(range(36))
    assert harmonics.degrees(5).tolist() == [degree for degree, _ in pairs]


@pytest.mark.parametrize("axis", [0, 1])
def test_sums_by_degree(rng, axis):
    values = rng.normal(size=(36, 36))
    pairs = [(degree, m) for degree in range(6) for m in range(-degree, degree + 1)]
    expected = np.zeros((6, 36))
    for (degree, _), row in zip(pairs, np.moveaxis(values, axis, 0), strict=True):
        expected[degree] += row
    found = np.moveaxis(harmonics.by_degree(values, axis), axis, 0)
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)


def test_degrees_zero_and_one_in_closed_form(rng):
    """The numbers of graphics shaders: 0.282095, then 0.488603 times (y, z, x)."""
    directions = np.vstack([AXES, random_directions(rng, 50)])
    x, y, z = directions.T
    expected = np.stack([np.full(len(x), 0.2820948), *(0.4886025 * np.array([y, z, x]))], -1)
    np.testing.assert_allclose(harmonics.real_harmonics(1, directions), expected, atol=1e-7)


def test_degree_two_in_closed_form(rng):
    directions = np.vstack([AXES, random_directions(rng, 50)])
    x, y, z = directions.T
    expected = np.stack(
        [
            1.0925484 * x * y,
            1.0925484 * y * z,
            0.3153916 * (3 * z * z - 1),
            1.0925484 * x * z,
            0.5462742 * (x * x - y * y),
        ],
        axis=-1,
    )
    np.testing.assert_allclose(harmonics.real_harmonics(2, directions)[:, 4:], expected, atol=2e-7)


@pytest.mark.parametrize("order", [0, 1, 2, 7, 40])
def test_real_harmonics_against_scipy(rng, order):
    directions = np.vstack([AXES, random_directions(rng, 20)])
    np.testing.assert_allclose(
        harmonics.real_harmonics(order, directions),
        oracles.real_harmonics(order, directions),
        rtol=0,
        atol=tolerance(order),
    )


def test_real_harmonics_against_scipy_at_order_512(rng):
    directions = np.vstack([AXES, random_directions(rng, 6)])
    found = harmonics.real_harmonics(512, directions)[:, 512**2 :]
    assert found.shape == (12, 1025)
    for m in (-512, -511, -300, -41, -2, -1, 0, 1, 2, 3, 77, 256, 510, 512):
        value = oracles.complex_harmonic(512, abs(m), directions)
        part = value.imag if m < 0 else value.real
        scale = (-1) ** m * np.sqrt(2) if m else 1
        np.testing.assert_allclose(found[:, 512 + m], scale * part, rtol=0, atol=tolerance(512))


def test_addition_theorem_at_order_512(rng):
    """The squares of one degree sum to (2l+1) / 4 pi in every direction."""
    directions = np.vstack([AXES, random_directions(rng, 20), [[1e-4, 0, 1], [0, 0.03, -1]]])
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    values = harmonics.real_harmonics(512, directions)
    for degree in (1, 2, 17, 128, 511, 512):
        total = np.sum(values[:, degree**2 : (degree + 1) ** 2] ** 2, axis=-1)
        np.testing.assert_allclose(
            total / ((2 * degree + 1) / (4 * np.pi)), 1, rtol=0, atol=tolerance(degree)
        )


@pytest.mark.parametrize("offset", [1e-6, 1e-9])
def test_real_harmonics_beside_the_pole(offset):
    direction = np.array([offset, 0.5 * offset, np.sqrt(1 - 1.25 * offset**2)])
    np.testing.assert_allclose(
        harmonics.real_harmonics(1, direction)[[1, 3]],
        0.4886025119029199 * direction[[1, 0]],
        rtol=1e-12,
    )


def test_real_harmonics_of_some_degrees(rng):
    directions = random_directions(rng, 20)
    whole = harmonics.real_harmonics(5, directions)
    for first in range(6):
        found = harmonics.real_harmonics(5, directions, first)
        np.testing.assert_array_equal(found, whole[:, first**2 :])


def test_real_harmonics_keep_the_shape():
    assert harmonics.real_harmonics(3, np.tile([0.0, 0.6, 0.8], (2, 5, 1))).shape == (2, 5, 16)
    assert harmonics.real_harmonics(3, [0.0, 0.6, 0.8]).shape == (16,)


@pytest.mark.parametrize("order", [1, 30, 512])
def test_legendre_against_scipy_for_every_m(order):
    z = np.cos([0.0, 1e-3, 0.3, 1.1, np.pi / 2, 2.9, np.pi])
    ((_, values),) = deque(harmonics.legendre_degrees(order, z), maxlen=1)
    theta = np.arctan2(np.sqrt((1 - z) * (1 + z)), z)  # of z as it was rounded
    m = np.arange(order + 1)[:, None]
    expected = (-1.0) ** m * sph_harm_y(order, m, theta, 0.0).real
    np.testing.assert_allclose(values, expected, rtol=0, atol=tolerance(order))


def test_legendre_at_the_poles():
    """Only m = 0 is left, sqrt((2l+1) / 4 pi), alternating in sign at the south pole."""
    for degree, values in harmonics.legendre_degrees(512, [1.0, -1.0]):
        height = np.sqrt((2 * degree + 1) / (4 * np.pi))
        np.testing.assert_allclose(
            values[0], [height, (-1) ** degree * height], atol=tolerance(degree)
        )
        assert not values[1:].any()


def test_legendre_is_normalised():
    z, weights = np.polynomial.legendre.leggauss(60)
    for _degree, values in harmonics.legendre_degrees(59, z):
        np.testing.assert_allclose(2 * np.pi * values**2 @ weights, 1, atol=tolerance(59))


@pytest.mark.parametrize("max_m", [0, 1, 4, 30])
def test_max_m_keeps_the_first_rows(max_m):
    z = np.linspace(-1, 1, 7)
    whole = dict(harmonics.legendre_degrees(9, z))
    for degree, values in harmonics.legendre_degrees(9, z, max_m):
        assert len(values) == min(degree, max_m) + 1
        np.testing.assert_array_equal(values, whole[degree][: max_m + 1])


@pytest.mark.parametrize("max_m", [None, 3])
def test_legendre_table_is_indexed_by_m_and_l_minus_m(max_m):
    order, theta = 8, np.array([[0.4, 2.0]])
    table = harmonics.legendre_table(order, np.cos(theta), max_m)
    assert table.shape == ((order if max_m is None else max_m) + 1, order + 1, 1, 2)
    for m in range(len(table)):
        for degree in range(m, order + 1):
            np.testing.assert_allclose(
                table[m, degree - m],
                (-1) ** m * sph_harm_y(degree, m, theta, 0.0).real,
                atol=tolerance(order),
            )
        assert not table[m, order + 1 - m :].any()


@pytest.mark.parametrize("order", [0, 1, 5])
def test_complex_coefficients_describe_the_same_function(rng, order):
    """Also when the real coefficients go further than is asked."""
    coefficients = rng.standard_normal(((order + 3) ** 2, 2))
    found = harmonics.complex_from_real(coefficients, order)
    assert found.shape == (order + 1, 2 * order + 1, 2)
    directions = random_directions(rng, 15)
    total = np.zeros((15, 2), dtype=complex)
    for degree in range(order + 1):
        for m in range(-order, order + 1):
            if abs(m) > degree:
                assert not found[degree, m + order].any()
            else:
                values = oracles.complex_harmonic(degree, m, directions)
                total += values[:, None] * found[degree, m + order]
    count = (order + 1) ** 2
    expected = oracles.real_harmonics(order, directions) @ coefficients[:count]
    np.testing.assert_allclose(total, expected, atol=100 * EPS * (order + 1))


@pytest.mark.parametrize(("first", "last"), [(0, 31), (0, 1), (7, 12), (30, 31)])
def test_orders_from_one_on_are_those_of_the_table(first, last):
    z = np.cos(np.linspace(0, np.pi, 9))
    found = harmonics.legendre_table(30, z, last - 1, first)
    table = harmonics.legendre_table(30, z)[first:last]
    np.testing.assert_array_equal(found, table[:, : 31 - first])
    assert not table[:, 31 - first :].any()
