from collections import deque

import numpy as np
import pytest

from shrm_cli.sphere.wigner import KEPT_ORDER, right_angle_degrees, shared_order, small_d_degrees
from tests import oracles
from tests.oracles import EPS, tolerance

ANGLES = np.array([0.0, 1e-9, 1e-3, 0.4, 1.1, np.pi / 2, 2.6, np.pi - 1e-3, np.pi])
"""Both poles, their neighbours, the equator and what lies between."""


def last(order, theta, max_spin=None):
    ((degree, matrix),) = deque(small_d_degrees(order, theta, max_spin), maxlen=1)
    assert degree == order
    return matrix


@pytest.fixture(scope="module")
def eigenvectors_512():
    return oracles.small_d_by_eigenvectors(512, ANGLES)


def test_the_oracles_agree_with_each_other():
    for degree in range(13):
        np.testing.assert_allclose(
            oracles.small_d_by_eigenvectors(degree, [-0.7, 1.3, np.pi]),
            np.stack([oracles.small_d(degree, theta) for theta in (-0.7, 1.3, np.pi)], axis=-1),
            atol=1e-12,
        )
    degree, theta = 40, 0.8
    by_exponential = oracles.small_d(degree, theta)
    by_eigenvectors = oracles.small_d_by_eigenvectors(degree, theta)
    np.testing.assert_allclose(by_eigenvectors, by_exponential, atol=1e-12)
    for m, n in [(0, 0), (3, -2), (-7, 30), (40, 1), (-40, -40), (12, -39)]:
        assert oracles.small_d_element(degree, m, n, theta) == pytest.approx(
            by_exponential[m + degree, n + degree], abs=tolerance(degree)
        )


@pytest.mark.parametrize("theta", [0.0, 0.7, np.pi / 2, 3.0, np.pi, -0.7])
def test_degree_one_in_closed_form(theta):
    """The sign that fixes the convention: d^1_10 = -sin / sqrt2."""
    c, s = np.cos(theta), np.sin(theta) / np.sqrt(2)
    expected = [
        [(1 + c) / 2, s, (1 - c) / 2],
        [-s, c, s],
        [(1 - c) / 2, -s, (1 + c) / 2],
    ]
    found = last(1, theta)
    np.testing.assert_allclose(found, expected, atol=tolerance(1))
    assert found[2, 1] == pytest.approx(-np.sin(theta) / np.sqrt(2), abs=tolerance(1))


def test_every_degree_up_to_40():
    theta = np.append(ANGLES, -0.7)
    for degree, matrix in small_d_degrees(40, theta):
        np.testing.assert_allclose(
            matrix,
            oracles.small_d_by_eigenvectors(degree, theta),
            rtol=0,
            atol=tolerance(degree) + 8 * EPS,
        )


@pytest.mark.proof
def test_order_512_every_element(eigenvectors_512):
    at = 4
    np.testing.assert_allclose(
        last(512, ANGLES[at]), eigenvectors_512[..., at], rtol=0, atol=tolerance(512)
    )


@pytest.mark.proof
def test_order_512_few_spins_at_every_angle(eigenvectors_512):
    """Angles down to the poles, where sin(theta) and all powers of it vanish."""
    np.testing.assert_allclose(
        last(512, ANGLES, max_spin=5),
        eigenvectors_512[:, 512 - 5 : 512 + 6],
        rtol=0,
        atol=tolerance(512),
    )


@pytest.mark.parametrize("n", [0, 1, -1, 2, -2])
def test_order_512_against_jacobi_polynomials(n):
    theta = np.array([0.05, 0.9, 2.2])
    matrix = last(512, theta, max_spin=2)
    for m in (-512, -400, -37, -2, -1, 0, 1, 2, 100, 511, 512):
        np.testing.assert_allclose(
            matrix[m + 512, n + 2],
            oracles.small_d_element(512, m, n, theta),
            rtol=0,
            atol=tolerance(512),
        )


@pytest.mark.parametrize(("order", "max_spin"), [(1, None), (70, None), (512, 4)])
def test_the_poles(order, max_spin):
    """The identity at 0; at pi only m = -n is left, with the sign (-1)^(l-n)."""
    spins = order if max_spin is None else max_spin
    m = np.arange(-order, order + 1)[:, None]
    n = np.arange(-spins, spins + 1)[None, :]
    matrix = last(order, [0.0, np.pi], max_spin)
    np.testing.assert_allclose(matrix[..., 0], m == n, rtol=0, atol=tolerance(order))
    np.testing.assert_allclose(
        matrix[..., 1], (m == -n) * (-1.0) ** (order - n), rtol=0, atol=tolerance(order)
    )


def test_columns_are_orthonormal_at_order_512():
    matrix = last(512, [0.3, 1.9], max_spin=8)
    gram = np.einsum("mna,mka->ank", matrix, matrix)
    np.testing.assert_allclose(gram, np.broadcast_to(np.eye(17), gram.shape), atol=tolerance(512))


def test_angles_add():
    first, second, both = (last(40, angle) for angle in (0.7, 1.6, 2.3))
    np.testing.assert_allclose(first @ second, both, atol=tolerance(40))


@pytest.mark.parametrize(("m", "n"), [(0, 0), (2, 1), (-3, 2), (4, -4)])
def test_degrees_are_orthogonal_over_theta(m, n):
    """The integral of d^l_mn d^k_mn sin(theta) is 2 / (2l+1) for l = k, else 0."""
    order = 20
    cosine, weights = np.polynomial.legendre.leggauss(order + 1)
    low = max(abs(m), abs(n))
    rows = np.array(
        [d[m + k, n + k] for k, d in small_d_degrees(order, np.arccos(cosine)) if k >= low]
    )
    expected = np.diag(2 / (2 * np.arange(low, order + 1) + 1))
    np.testing.assert_allclose((rows * weights) @ rows.T, expected, atol=tolerance(order))


@pytest.mark.parametrize("max_spin", [0, 1, 3, 9, 30])
def test_max_spin_keeps_the_middle_columns(max_spin):
    theta = np.array([[0.2, 1.3, 2.9]])
    whole = dict(small_d_degrees(9, theta))
    for degree, matrix in small_d_degrees(9, theta, max_spin):
        cut = max(0, degree - max_spin)
        kept = whole[degree][:, cut : 2 * degree + 1 - cut]
        assert matrix.shape == (2 * degree + 1, 2 * min(degree, max_spin) + 1, 1, 3)
        np.testing.assert_allclose(matrix, kept, rtol=0, atol=tolerance(degree))


@pytest.mark.parametrize(("lowest", "highest"), [(0, 3), (2, 5), (4, 9), (-2, 3)])
def test_some_columns_are_kept(lowest, highest):
    theta = np.array([0.2, 1.3, 2.9])
    whole = dict(small_d_degrees(9, theta))
    for degree, matrix in small_d_degrees(9, theta, highest, lowest):
        n = np.arange(max(lowest, -degree), min(highest, degree) + 1)
        kept = whole[degree][:, n + degree]
        assert matrix.shape == kept.shape
        np.testing.assert_allclose(matrix, kept, rtol=0, atol=tolerance(degree))


@pytest.mark.parametrize("order", [0, 1, 40])
def test_right_angles(order):
    """The quadrant m, n >= 0 of d(pi/2); the rest of it by the symmetry that comes with it."""
    quadrants = [each.copy() for each in right_angle_degrees(order)]
    assert len(quadrants) == order + 1
    for degree, quadrant in enumerate(quadrants):
        expected = oracles.small_d_by_eigenvectors(degree, np.pi / 2)
        np.testing.assert_allclose(
            quadrant, expected[degree:, degree:], rtol=0, atol=tolerance(degree) + 8 * EPS
        )
        signs = (-1.0) ** (degree + np.arange(degree + 1))[:, None]
        np.testing.assert_allclose(
            signs * quadrant,
            expected[degree:, degree::-1],
            rtol=0,
            atol=tolerance(degree) + 8 * EPS,
        )


@pytest.mark.parametrize(("first", "order"), [(96, 99), (97, 97), (0, 130)])
def test_right_angles_of_some_degrees(first, order):
    """Degrees that are kept for all orders, and those above, which are made some at a time."""
    quadrants = [each.copy() for each in right_angle_degrees(order, first)]
    assert [len(each) for each in quadrants] == list(range(first + 1, order + 2))
    expected = oracles.small_d_by_eigenvectors(order, np.pi / 2)[order:, order:]
    np.testing.assert_allclose(quadrants[-1], expected, rtol=0, atol=tolerance(order))


@pytest.mark.proof
def test_right_angles_at_order_512(eigenvectors_512):
    (quadrant,) = deque(right_angle_degrees(512), maxlen=1)
    at = 5
    assert ANGLES[at] == np.pi / 2
    np.testing.assert_allclose(
        quadrant, eigenvectors_512[512:, 512:, at], rtol=0, atol=tolerance(512)
    )


def test_maps_share_what_is_kept_of_their_light():
    for light in range(0, KEPT_ORDER, 8):
        assert {shared_order(light + p) for p in range(5)} == {min(light + 8, KEPT_ORDER)}
    assert all(order <= shared_order(order) for order in range(KEPT_ORDER + 1))
