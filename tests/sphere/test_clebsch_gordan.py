"""Clebsch-Gordan coefficients against integrals of three harmonics and their own orthogonality."""

import numpy as np
import pytest
from scipy.special import sph_harm_y

from shrm_cli.sphere.clebsch_gordan import clebsch_gordan


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


@pytest.mark.parametrize("small", [0, 1, 2, 3, 6])
@pytest.mark.parametrize("degree", [0, 1, 2, 5, 17])
def test_products_of_harmonics(degree, small):
    """Their integrals are products of two coefficients (Varshalovich et al. 5.9.1 (4))."""
    for total in range(abs(degree - small), degree + small + 1):
        zonal = clebsch_gordan(degree, 0, small, 0, total - degree)
        scale = np.sqrt((2 * degree + 1) * (2 * small + 1) / (4 * np.pi * (2 * total + 1)))
        for m in range(-degree, degree + 1, max(1, degree // 3)):
            for s in range(-small, small + 1):
                if abs(m + s) > total:
                    assert clebsch_gordan(degree, m, small, s, total - degree) == 0
                    continue
                found = scale * zonal * clebsch_gordan(degree, m, small, s, total - degree)
                assert found == pytest.approx(integral(degree, m, small, s, total), abs=1e-12)


@pytest.mark.parametrize("small", [1, 4, 8])
@pytest.mark.parametrize(("degree", "order"), [(3, 2), (20, -7), (100, 99), (512, 0), (512, -512)])
def test_orthogonality(degree, order, small):
    s = np.arange(-small, small + 1)
    rows = np.array([[float(clebsch_gordan(degree, order - k, small, k, j)) for j in s] for k in s])
    rows = rows[abs(order - s) <= degree]
    np.testing.assert_allclose(rows @ rows.T, np.eye(len(rows)), atol=1e-9)
