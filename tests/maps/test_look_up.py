"""The stated errors of small maps under a bare sun, looked up as GPUs do, beside the truth."""

import numpy as np
import pytest

from research.glossy_truth import light_of
from research.looked_up import looked_up
from research.pairs import bright_pairs
from research.seen import lit
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.brdf.transfer import compute_coefficients
from shrm_cli.maps.size import shrm_look_up_error, total_error
from shrm_cli.prefilter import prefilter
from shrm_cli.probe.lighting import Lighting
from shrm_cli.probe.probe import Probe
from shrm_cli.sphere.grid.latlong import latlong_directions

PAIRS = 12_000  # of 4000 the error varies by 3 %
SUNS = (1, 0.05, 0.1), (0.3, -1, 0.2), (-0.9, 0.85, 1)


def park(sun):
    """A dim sky with a sun of a few pixels."""
    directions = latlong_directions(64, 32)
    toward = directions @ (np.array(sun) / np.linalg.norm(sun))
    light = np.where(toward > np.cos(0.12), 900.0, 0.3 + 0.2 * directions[..., 1])
    return Probe.from_array(np.repeat(light[..., None], 3, axis=2), layout="latlong")


def gpu_error(probe, made, brdf):
    """The RMS of what look-ups in half precision miss of the truth, at the measure of maps."""
    single = prefilter(probe, brdf, size=made.size, order_p=0, eps=0.5)
    pairs = bright_pairs(single, [made], PAIRS)
    # Pixels are as bright all over, which the sum over middles of their parts tells.
    parts = Probe.from_array(probe.image().repeat(4, axis=0).repeat(4, axis=1), layout="latlong")
    truth = lit(brdf, pairs.normals, pairs.views, light_of([parts], parts.height))
    return pairs.error(looked_up(made, pairs.normals, pairs.views), truth)


@pytest.mark.proof
@pytest.mark.parametrize("sun", SUNS)
@pytest.mark.parametrize(
    ("to", "spec", "options"),
    [
        ("shrm", "lambertian", {}),
        ("shrm", "phong:exponent=8", {}),
        ("principal", "ggx:roughness=0.7,f0=1", {"size": 10, "maps": 36}),
    ],
)
@pytest.mark.filterwarnings("ignore::shrm_cli.errors.ShrmWarning")
def test_small_maps_state_what_look_ups_miss(sun, to, spec, options):
    probe, brdf = park(sun), parse_spec(spec)
    made = prefilter(probe, brdf, to=to, **options)
    info = made.info
    assert info.filter_error > 0.5 * info.predicted_error
    stated = total_error(info.predicted_error, info.filter_error)
    assert stated == pytest.approx(gpu_error(probe, made, brdf), rel=0.05)


def test_black_light_has_no_error():
    light = Lighting(np.zeros((81, 3)), np.zeros(3))
    coefficients = compute_coefficients(parse_spec("lambertian"), 8, 0)
    assert shrm_look_up_error(light, coefficients, np.ones((9, 1)), 16, "center") == 0
