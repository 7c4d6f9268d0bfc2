"""How the degrees that maps carry end."""

import numpy as np
import pytest

from shrm_cli.brdf.coefficients import compute_coefficients
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.maps.band import Band
from shrm_cli.maps.expansion import carried_band
from shrm_cli.reflected import visible_order
from tests.test_reflected import lamp, lit


@pytest.mark.parametrize(("limit", "known"), [(40, 100), (100, 40), (40, 40)])
def test_visible_light_fades_out_where_a_map_has_to_end(limit, known):
    band = Band.of(min(60, known), limit, known)
    assert band.last == 40
    factors = band.factors
    assert (factors[: band.whole + 1] == 1).all()
    assert (np.diff(factors[band.whole :]) < 0).all()
    # The fall is even about its middle, where it is a half, and would be 0 one degree on.
    fall = np.append(factors[band.whole :], 0)
    assert fall + fall[::-1] == pytest.approx(1)


@pytest.mark.parametrize(("visible", "limit", "known"), [(30, 40, 31), (30, 30, 40), (0, 40, 40)])
def test_light_that_ends_by_itself_is_kept_whole(visible, limit, known):
    assert Band.of(visible, limit, known) == Band.exact(visible)
    assert (Band.exact(visible).factors == 1).all()


def test_degrees_that_the_tolerance_asks_for_are_kept_where_nothing_is_weakened():
    assert Band.of(30, 100, 100, least=70) == Band.exact(70)
    assert Band.of(90, 50, 100, least=48).last == 50


def test_maps_of_one_light_end_in_every_way():
    coefficients = compute_coefficients(parse_spec("phong:exponent=64"), 80, 0)
    light = lamp(80)
    enough = carried_band(light, coefficients, 10, 0, 80)
    assert enough == Band.exact(visible_order(light, coefficients, 0))
    assert carried_band(light, coefficients, 70, 0, 80) == Band.exact(70)
    few_texels = carried_band(light, coefficients, 10, 0, 30)
    assert 20 < few_texels.whole < few_texels.last == 30
    # The pixels of a small probe resolve fewer degrees than the cube and the BRDF have.
    power = np.repeat(2.0 * np.arange(81)[:, None] + 1, 3, axis=1) * (np.arange(81) <= 25)[:, None]
    coarse = carried_band(lit(power), coefficients, 10, 0, 80)
    assert 15 < coarse.whole < coarse.last == 25
