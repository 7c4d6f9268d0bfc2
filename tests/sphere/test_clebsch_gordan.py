"""Clebsch-Gordan coefficients against integrals of three harmonics and their own orthogonality."""

import numpy as np
import pytest
from scipy.special import sph_harm_y

from shrm_cli.sphere.wigner import clebsch_gordan, zonal_coupling


def integral(degree, m, small, s, total):
    """int Y_lm Y_ps conj(Y_J,m+s), by a rule that is exact for these degrees."""
    cosines, weights = np.polynomial.legendre.leggauss(degree + small + 2)
    theta = np.arccos(cosines)
    values = (
        sph_harm_y(degree, m, theta, 0)
        * sph_harm_y(small, s, theta, 0)
        * sph_harm_y(total, m + s, theta, 0)
    )
    return 2 * np.pi * weights @ values.real


@pytest.mark.slow
@pytest.mark.parametrize("small", [0, 1, 2, 6])
@pytest.mark.parametrize("degree", [0, 1, 5, pytest.param(17, marks=pytest.mark.proof)])
def test_products_of_harmonics(degree, small):
    """Their integrals are products of two coefficients (Varshalovich et al. 5.9.1 (4))."""
    for total in range(abs(degree - small), degree + small + 1):
        zonal = clebsch_gordan(degree, 0, small, total)[small]
        scale = np.sqrt((2 * degree + 1) * (2 * small + 1) / (4 * np.pi * (2 * total + 1)))
        for m in range(-degree, degree + 1, max(1, degree // 3)):
            for s in range(-small, small + 1):
                found = scale * zonal * clebsch_gordan(degree, m + s, small, total)[small - s]
                wanted = 0 if abs(m + s) > total else integral(degree, m, small, s, total)
                assert found == pytest.approx(wanted, abs=1e-12)


@pytest.mark.parametrize("small", [1, 4, 8, 12, 32])
@pytest.mark.parametrize(("degree", "order"), [(3, 2), (20, -7), (100, 99), (512, 0), (512, -512)])
def test_orthogonality(degree, order, small):
    totals = degree + np.arange(-small, small + 1)
    rows = clebsch_gordan(degree, order, small, totals)
    rows = rows[abs(order + np.arange(-small, small + 1)) <= degree]
    np.testing.assert_allclose(rows @ rows.T, np.eye(len(rows)), atol=1e-12)


@pytest.mark.parametrize("small", [2, 9, 32])
def test_signs(small):
    """Where the large degree has its largest order, or the small one its least, none is below 0."""
    degree = 40
    for total in range(degree - small, degree + small + 1):
        order = np.arange(-total, total + 1)
        found = clebsch_gordan(degree, order, small, total)
        last = np.minimum(degree - order, small) + small
        assert (found[last, np.arange(len(order))][abs(degree - last + small) <= total] > 0).all()


def test_there_is_none_without_a_triangle():
    assert not clebsch_gordan(3, 0, 2, [0, 6, -1]).any()
    assert not clebsch_gordan(3, 5, 2, 4).any()


def test_the_zonal_coupling_of_large_degrees():
    """The products with q = 0, whose squares are integrals of three Legendre polynomials."""
    order, p = 60, 37
    found = zonal_coupling(order, p)
    z, weights = np.polynomial.legendre.leggauss(order + p + 1)
    legendre = np.polynomial.legendre.legvander(z, order + p)
    for degree in (0, 3, 36, 37, 38, 60):
        for j in range(p + 1):
            total = degree - p + 2 * j
            wanted = 0.0
            if total >= abs(degree - p):
                triple = weights @ (legendre[:, degree] * legendre[:, p] * legendre[:, total])
                wanted = (2 * total + 1) / 2 * triple
            assert found[degree, 0, j] ** 2 == pytest.approx(wanted, abs=1e-12)


def test_the_signs_of_the_zonal_coupling():
    """A product of two functions of q has the energy of its degrees: relative signs count."""
    order, p = 50, 23
    found = zonal_coupling(order, p)
    degree = 31
    both = found[degree] / np.sqrt(np.where(np.arange(p + 1) > 0, 2, 1))[:, None]
    np.testing.assert_allclose(both.T @ both, np.eye(p + 1), atol=1e-12)
    # sum over q of <l q p -q | J 0> Y_lq Y_p,-q at one point is Y_J0 times its own coefficient.
    theta, phi = 0.7, 0.0
    q = np.arange(p + 1)
    product = sph_harm_y(degree, q, theta, phi).real * sph_harm_y(p, q, theta, phi).real
    for j in range(p + 1):
        total = degree - p + 2 * j
        scale = np.sqrt((2 * degree + 1) * (2 * p + 1) / (4 * np.pi * (2 * total + 1)))
        wanted = scale * found[degree, 0, j] * sph_harm_y(total, 0, theta, phi).real
        assert found[degree, :, j] @ product == pytest.approx(wanted, abs=1e-11)
