"""Light of any brightness: a map of k times the light is k times the map, without a warning."""

from functools import cache

import numpy as np
import pytest

from shrm_cli.errors import ProbeError
from shrm_cli.prefilter import prefilter
from shrm_cli.probe.probe import Probe
from tests import brute_force

pytestmark = pytest.mark.filterwarnings("ignore::shrm_cli.errors.ShrmWarning")

FORMS = {
    "shrm": "microfacet:sigma=0.3",
    "principal": "ggx:roughness=0.6",
    "cabral": "phong:exponent=8",
    "product": "ward",
    "irradiance": None,
}


OWN = {to: {"max_size": "1MB"} for to in FORMS} | {"product": {"texels": 8}, "irradiance": {}}


@pytest.fixture(scope="module")
def light():
    """A dim room with a lamp of one pixel."""
    pixels = np.random.default_rng(5).uniform(0.1, 0.5, (16, 32, 3))
    pixels[4, 9] = 40, 30, 20
    return pixels


def dimmed(light, factor):
    return Probe.from_array((light * factor).astype(np.float32))


@pytest.fixture(scope="module")
def plain(light):
    """What makes the map of the light as it is, once."""
    return cache(lambda to: prefilter(dimmed(light, 1.0), FORMS[to], to=to, **OWN[to]))


@pytest.mark.parametrize("factor", [1e-30, 1e30])
@pytest.mark.parametrize("to", FORMS)
def test_a_map_is_as_bright_as_its_light(light, plain, to, factor):
    rng = np.random.default_rng(6)
    normals = brute_force.unit(rng, 200)
    views = brute_force.unit(rng, 200)
    views *= np.sign(np.sum(normals * views, axis=1))[:, None]
    one, other = plain(to), prefilter(dimmed(light, factor), FORMS[to], to=to, **OWN[to])
    expected = one.radiance(normals, views)
    found = other.radiance(normals, views) / factor
    np.testing.assert_allclose(found, expected, atol=2e-4 * np.abs(expected).max())
    assert other.info.predicted_error == pytest.approx(one.info.predicted_error, rel=1e-3, abs=1e-6)


EIGHTEEN = pytest.param("shrm", 1e18, marks=pytest.mark.proof)


@pytest.mark.parametrize(
    ("to", "lamp"), [(to, 1e18) for to in FORMS if to != "shrm"] + [("shrm", 1e30), EIGHTEEN]
)
def test_one_pixel_of_any_brightness_is_no_warning_of_numpy(light, to, lamp):
    pixels = light.astype(np.float32)
    pixels[4, 9] = lamp
    made = prefilter(Probe.from_array(pixels), FORMS[to], to=to, **OWN[to])
    assert np.isfinite(made.radiance(np.eye(3), np.eye(3))).all()


def test_a_line_tells_of_light_beyond_floats(light):
    pixels = np.full((16, 32, 3), 3e38, np.float32)
    with pytest.raises(ProbeError, match="beyond 32-bit floats; dim it"):
        prefilter(Probe.from_array(pixels), "phong")
