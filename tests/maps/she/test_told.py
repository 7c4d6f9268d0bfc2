"""What is told of a fit is what pictures of the sharpest metals miss."""

import numpy as np
import pytest

import shrm_cli as shrm
from shrm_cli.prefilter import prefilter_with_facts
from tests.brute_force import unit


@pytest.mark.parametrize("key", [pytest.param(5, marks=pytest.mark.proof), 50])
def test_the_error_of_the_sharpest_metals_is_told(key):
    probe = shrm.Probe.from_array(shrm.studio(64, key))
    made = prefilter_with_facts(probe, "she", {})
    sharpest = made.summary()["sharpest"]
    rng = np.random.default_rng(0)
    mirrors, views = unit(rng, 1500), unit(rng, 1500)
    normals = (mirrors + views) / np.linalg.norm(mirrors + views, axis=1, keepdims=True)
    spec = f"ggx:roughness={sharpest['roughness']},f0=1"
    truth = shrm.reference(probe, spec, normals, views)
    missed = made.map.shaded(sharpest["roughness"]).radiance(normals, views) - truth
    error = np.linalg.norm(missed) / np.linalg.norm(truth)
    assert sharpest["error"] == pytest.approx(error, rel=0.2)
    assert sharpest["error"] > made.map.info.fit_residual
