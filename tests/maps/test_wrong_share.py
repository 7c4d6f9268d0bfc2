"""The predicted share of wrong pixels: against brute force, and when there is none."""

import numpy as np
import pytest

from shrm_cli.maps.wrong_share import Lobes, wrong_share
from shrm_cli.prefilter import prefilter_with_facts
from shrm_cli.probe.lighting import Lighting
from shrm_cli.probe.probe import Probe
from tests import brute_force, oracles
from tests.cli.helpers import polynomial_light

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
MICROFACET = brute_force.microfacet(0.3)
POINTS = 1500


@pytest.fixture(scope="module")
def light():
    """A coloured gradient with a bright lamp of a few pixels, 64 x 32."""
    pixels = polynomial_light(oracles.latlong_pixels(64, 32))
    pixels[8:10, 20:22] = [1200, 800, 400]
    return pixels.astype(np.float32)


def share(pixels, rho_hat, made):
    """Count the wrong pixels of spheres that are seen from all sides, drawn at random."""
    rng = np.random.default_rng(11)
    mirrored, views = brute_force.unit(rng, POINTS), brute_force.unit(rng, POINTS)
    normals = mirrored + views
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    directions, weights = brute_force.latlong_samples(len(pixels))
    radiance = pixels.reshape(-1, 3) @ LUMINANCE
    pairs = zip(mirrored, views, strict=True)
    lit = (brute_force.reflected(rho_hat, *each, directions, weights, radiance) for each in pairs)
    truth = np.array(list(lit))
    shown = made.radiance(normals, views) @ LUMINANCE
    return np.mean(np.abs(shown - truth) > 0.05 * np.maximum(truth, 0.02 * truth.mean()))


@pytest.mark.parametrize(("to", "spec", "rho_hat", "given", "range_"), [
    ("shrm", "microfacet:sigma=0.3", MICROFACET, {}, (0.1, 0.5)),
    ("shrm", "microfacet:sigma=0.3", MICROFACET, {"order_f": 5, "order_p": 2}, (0.4, 0.9)),
    ("shrm", "microfacet:sigma=0.3", MICROFACET, {"order_p": 4}, (0.02, 0.3)),
    ("shrm", "phong:exponent=20", brute_force.phong(20), {"order_f": 10}, (0.2, 0.9)),
    ("principal", "microfacet:sigma=0.3", MICROFACET, {"maps": 3}, (0.1, 0.9)),
])  # fmt: skip
def test_it_is_what_brute_force_counts(light, to, spec, rho_hat, given, range_):
    made = prefilter_with_facts(Probe.from_array(light), to, {"brdf": spec, **given})
    expected = share(light, rho_hat, made.map)
    assert range_[0] < expected < range_[1]
    # A share of 1500 points is uncertain by up to 0.013, and the prediction's own points add to it.
    assert made.summary()["predicted_wrong_share"] == pytest.approx(expected, rel=0.1, abs=0.03)


def test_lobes_that_are_complete_leave_nothing_wrong(light):
    made = prefilter_with_facts(Probe.from_array(light), "shrm", {"brdf": "phong:exponent=20"})
    assert made.summary()["predicted_wrong_share"] == 0


@pytest.mark.parametrize(("to", "given"), [
    ("shrm", {"brdf": "kajiya-kay"}),
    ("shrm", {"brdf": "0.5*lambertian+0.5*microfacet", "split": True}),
    ("shrm", {"brdf": "microfacet", "compress": 3}),
    ("cabral", {"brdf": "microfacet"}),
])  # fmt: skip
def test_nothing_is_said_where_it_is_not_known(light, to, given):
    made = prefilter_with_facts(Probe.from_array(light), to, given)
    assert made.summary()["predicted_wrong_share"] is None


def test_unknown_light_matters_only_where_it_might_show():
    """A lobe of the degrees 0 and 1, of which a map misses a little of degree 1."""
    lighting = Lighting(np.array([[1.0] * 3, [0.0] * 3, [0.5] * 3, [0.0] * 3]), np.full(3, 1.25))
    whole = np.ones((1, 2, 1, 1))
    error = np.zeros_like(whole)
    error[:, 1] = 0.01
    lobes = Lobes(whole, error, np.ones(1))
    assert wrong_share(lighting, lobes) == 0
    assert wrong_share(lighting, lobes, 1e-6) == 0
    assert wrong_share(lighting, lobes, 0.01) is None


def test_principal_maps_do_not_bend_beside_the_horizon(light):
    """Lambert's law has few views, of which those below the horizon once took part in tables."""
    probe = Probe.from_array(light)
    made, exact = (prefilter_with_facts(probe, to, {"brdf": "lambertian"}).map
                   for to in ("principal", "shrm"))  # fmt: skip
    normal = np.array([0.6, 0.0, 0.8])
    angle = np.radians([0, 60, 75, 85, 89])[:, None]
    views = np.cos(angle) * normal + np.sin(angle) * np.array([0.0, 1.0, 0.0])
    found = made.radiance(np.broadcast_to(normal, views.shape), views)
    np.testing.assert_allclose(found, np.broadcast_to(exact.radiance(normal, normal), found.shape),
                               rtol=0.02)  # fmt: skip
