"""Colours of light against colour-science."""

import numpy as np
import pytest

from shrm_cli.analysis.probe_statistics import blackbody_distance, chromaticity, color_temperature
from shrm_cli.color import REC709, title_of, xyz_matrix

SPACES = {
    "Rec.709": "ITU-R BT.709", "Rec.2020": "ITU-R BT.2020", "P3": "Display P3",
    "DCI-P3": "DCI-P3", "Adobe RGB": "Adobe RGB (1998)", "ACEScg": "ACEScg",
    "ACES2065-1": "ACES2065-1",
}  # fmt: skip


def primaries(colour, name):
    space = colour.RGB_COLOURSPACES[SPACES[name]]
    return (*np.ravel(space.primaries), *space.whitepoint)


@pytest.mark.parametrize("name", list(SPACES))
def test_names_and_matrices(colour, name):
    assert title_of(primaries(colour, name)) == name
    space = colour.RGB_COLOURSPACES[SPACES[name]]
    expected = colour.normalised_primary_matrix(space.primaries, space.whitepoint)
    np.testing.assert_allclose(xyz_matrix(primaries(colour, name)), expected, atol=1e-12)
    xyz = expected @ [0.3, 0.2, 0.4]
    np.testing.assert_allclose(
        chromaticity([0.3, 0.2, 0.4], primaries(colour, name)), colour.XYZ_to_xy(xyz), atol=1e-12
    )


def test_primaries_without_a_name():
    own = (0.648447, 0.330877, 0.321187, 0.597894, 0.155901, 0.0660563, 0.345708, 0.358541)
    assert title_of(own) == "primaries of its own"
    np.testing.assert_array_equal(xyz_matrix((0.3,) * 8), xyz_matrix(REC709))
    assert chromaticity([0, 0, 0], None) is None


@pytest.mark.parametrize("kelvin", [2200, 2856, 4000, 5000, 6504, 9000, 12000])
@pytest.mark.parametrize("duv", [-0.01, 0.0, 0.01])
def test_temperatures(colour, kelvin, duv):
    """Against McCamy's in colour-science, Ohno's (which searches the curve), and its distance."""
    xy = colour.UCS_uv_to_xy(colour.temperature.CCT_to_uv_Ohno2013([kelvin, duv]))
    found = color_temperature(*xy)
    expected = colour.temperature.xy_to_CCT_McCamy1992(xy)
    assert found == pytest.approx(float(expected), rel=1e-9)
    assert found == pytest.approx(kelvin, rel=0.06)
    assert blackbody_distance(*xy) == pytest.approx(duv, abs=6e-4)


@pytest.mark.parametrize("rgb", [(0, 1, 0), (1, 0, 0), (0, 0, 1), (1, 0, 1)])
def test_colours_have_no_temperature(rgb):
    assert color_temperature(*chromaticity(rgb, None)) is None
