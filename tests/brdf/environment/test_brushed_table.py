"""The environment BRDF of brushed GGX, against sums over a million lights."""

import numpy as np
import pytest

from shrm_cli.brdf.environment.environment_brdf import (
    AZIMUTHS,
    brushed_table,
    brushed_totals,
    lobe_moments,
)
from shrm_cli.brdf.models.ggx import Ggx
from shrm_cli.errors import BrdfError
from tests import brushed_ggx


def summed(alphas, cosine, azimuth):
    """The lobe's integrals, without and with ``(1 - V.H)^5``."""
    light, part = brushed_ggx.directions(700)
    sine = np.sqrt(1 - cosine**2)
    view = np.array([sine * np.cos(azimuth), sine * np.sin(azimuth), cosine])
    value, tail = brushed_ggx.lobe(alphas, np.eye(3), view, light)
    return value.sum() * part, value @ tail * part


@pytest.mark.proof
@pytest.mark.parametrize("azimuth", [0.0, 0.7, 1.9, 4.4])
@pytest.mark.parametrize("alphas", [(0.52, 0.25), (0.9, 0.12), (0.2, 0.7)])
def test_totals_are_those_of_the_lobe(alphas, azimuth):
    for cosine in (0.95, 0.6, 0.25):
        found = brushed_totals(alphas, [cosine], azimuth)[:, 0]
        np.testing.assert_allclose(found, summed(alphas, cosine, azimuth), atol=4e-4)


@pytest.mark.parametrize("roughness", [0.05, 0.3, 1.0])
def test_even_surfaces_are_those_of_their_own_table(roughness):
    cosines = np.array([0.004, 0.05, 0.4, 1.0])
    found = brushed_totals((roughness**2, roughness**2), cosines, 0.3)
    np.testing.assert_allclose(found, lobe_moments(roughness, cosines)[:, 0], atol=2e-5)


@pytest.mark.parametrize("azimuth", [AZIMUTHS[0], AZIMUTHS[-1]])
def test_half_of_the_slopes_tell_all_where_both_halves_are_alike(azimuth):
    """Beside these azimuths all slopes are summed."""
    cosines = np.array([0.05, 0.4, 0.9])
    halved = brushed_totals((0.5, 0.2), cosines, azimuth)
    np.testing.assert_allclose(halved, brushed_totals((0.5, 0.2), cosines, azimuth + 1e-9), 1e-7)


PROOFS = [pytest.param(each, marks=pytest.mark.proof) for each in (0.3, 1.3)]


@pytest.mark.parametrize("azimuth", [0.9, *PROOFS])
def test_the_table_is_right_between_its_azimuths(azimuth):
    table = brushed_table(Ggx(anisotropy=0.6), 8)
    w = np.cos(2 * azimuth)
    shares = [w * (w + 1) / 2, 1 - w * w, w * (w - 1) / 2]
    assert len(shares) == len(AZIMUTHS)
    for row, column in ((3, 5), (5, 2), (7, 7)):
        roughness, cosine = (row + 0.5) / 8, (column + 0.5) / 8
        alphas = roughness**2 + (1 - roughness**2) * 0.36, roughness**2
        total, bias = summed(alphas, cosine, azimuth)
        found = shares @ table[row, column].reshape(3, 2)
        np.testing.assert_allclose(found, [total - bias, bias], atol=2e-3)


@pytest.mark.parametrize("given", [{"roughness": 0.3}, {"ax": 0.3, "ay": 0.1}, {"f0": 0.5}])
def test_what_varies_is_not_given(given):
    with pytest.raises(BrdfError, match="give only anisotropy and mapping"):
        brushed_table(Ggx(**given), 8)
