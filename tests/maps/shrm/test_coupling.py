"""The band limit and the shortcut of the coupling; its values are tested in test_shrm."""

import numpy as np
import pytest

from shrm_cli.maps import coupling
from tests.maps.rings import over_rings
from tests.maps.shrm.test_shrm import random_coefficients


@pytest.mark.parametrize(("order_f", "order_p"), [(5, 3), (2, 6), (4, 10)])
def test_band_limit_is_exactly_f_plus_p(order_f, order_p):
    rng = np.random.default_rng(1)
    coefficients = random_coefficients(rng, order_f, order_p)
    lighting = rng.normal(size=((order_f + 1) ** 2, 3))
    series = coupling.reflected_coefficients(lighting, coefficients)
    band = order_f + order_p
    assert series.shape == ((band + 1) ** 2, (order_p + 1) ** 2, 3)
    top = series[band**2 :]
    assert np.abs(top).max() > 1e-3 * np.abs(series).max()


@pytest.mark.parametrize(("order_f", "order_p"), [(7, 2), (3, 8), (0, 3), (10, 14), (5, 32)])
def test_sums_over_rings_give_the_same_coefficients(order_f, order_p):
    rng = np.random.default_rng(4)
    coefficients = random_coefficients(rng, order_f, order_p)
    lighting = rng.normal(size=((order_f + 1) ** 2, 3))
    by_degree = coupling.reflected_coefficients(lighting, coefficients)
    np.testing.assert_allclose(by_degree, over_rings(lighting, coefficients), atol=1e-11)


def test_radially_symmetric_brdfs_take_the_same_way():
    """The shortcut for P = 0 gives the p = 0 part of the general sum."""
    rng = np.random.default_rng(3)
    lighting = rng.normal(size=(36, 3))
    zonal = np.zeros((6, 1, 1, 3))
    zonal[:, 0, 0] = rng.normal(size=(6, 3))
    wide = np.zeros((6, 2, 2, 3))
    wide[:, 0, 0] = zonal[:, 0, 0]
    general = coupling.reflected_coefficients(lighting, wide)
    np.testing.assert_allclose(
        general[:36, :1], coupling.reflected_coefficients(lighting, zonal), atol=1e-12
    )
    assert np.abs(general[36:]).max() < 1e-12
    assert np.abs(general[:, 1:]).max() < 1e-12
