"""What maps of principal functions say where their bytes do not suffice."""

import re

import numpy as np
import pytest

from shrm_cli.errors import ShrmWarning
from shrm_cli.maps.size import stored_bytes, total_error
from shrm_cli.prefilter import prefilter
from shrm_cli.probe.probe import Probe
from shrm_cli.sphere.grid.latlong import latlong_directions

pytestmark = pytest.mark.filterwarnings("ignore:.*is negative:shrm_cli.errors.ShrmWarning")

UNITS = {"bytes": 1, "kB": 10**3, "MB": 10**6}


def lamps():
    directions = latlong_directions(64, 32)
    light = 0.2 + 40.0 * (directions @ np.array([0.6, 0.48, 0.64]) > 0.97)
    return Probe.from_array(np.repeat(light[..., None], 3, axis=2), layout="latlong")


def error_of(made):
    return total_error(made.info.predicted_error, made.info.filter_error)


def test_many_cubes_have_fewer_texels_where_bytes_are_few():
    """Ten cubes of a coat took 201 MB where 32 are allowed."""
    asked = {"brdf": "microfacet:sigma=0.2", "to": "principal", "maps": 6}
    free, few = prefilter(lamps(), **asked), prefilter(lamps(), **asked, max_size=60_000)
    assert free.cube_count == few.cube_count == 6
    assert stored_bytes(few.size, 6) <= 60_000 < stored_bytes(free.size, 6)
    assert prefilter(lamps(), **asked, max_size=60_000, size=40).size == 40


@pytest.mark.proof
@pytest.mark.parametrize(
    "spec",
    [
        "ggx:roughness=0.5,f0=1",
        "0.5*lambertian+0.5*ggx:roughness=0.5,f0=0.04",
        "0.5*microfacet:sigma=0.3+0.5*ggx:roughness=0.5,f0=1",
    ],
)
def test_an_error_that_does_not_fit_names_the_bytes_that_keep_it(spec):
    probe, error, most = lamps(), 0.01, 10**5
    with pytest.warns(ShrmWarning) as told:
        best = prefilter(probe, spec, to="principal", error=error, max_size=most)
    assert error_of(best) > error
    (line,) = (str(each.message) for each in told if "over `error`" in str(each.message))
    amount, unit = re.search(r"packing; raise `max_size` to ([\d.]+) (\w+)$", line).groups()
    needed = float(amount) * UNITS[unit]
    assert most < needed < 10**7
    kept = prefilter(probe, spec, to="principal", error=error, max_size=f"{amount}{unit}")
    assert error_of(kept) <= error
    with pytest.warns(ShrmWarning, match="over `error` 0.01"):
        prefilter(probe, spec, to="principal", error=error, max_size=int(0.4 * needed))


def test_an_error_that_no_map_keeps_names_no_bytes():
    with pytest.warns(ShrmWarning, match="over `error` 0.001, .*, or dim them by `clamp`$"):
        prefilter(lamps(), "ggx:roughness=0.2,f0=0.04", to="principal", error=1e-3, max_size=10**5)
