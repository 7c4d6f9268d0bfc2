"""Measured materials, prefiltered: the error that was predicted, on real probes."""

import numpy as np
import pytest

from shrm_cli.brdf.spec import parse_spec
from shrm_cli.maps.request import Request
from shrm_cli.maps.shrm.make import prefilter_shrm
from shrm_cli.probe.lighting import Projection
from shrm_cli.probe.open import open_probe
from shrm_cli.reference import Reference
from tests import brute_force
from tests.cli.helpers import write_exr
from tests.maps.shrm.test_predicted_error import reduced

COUNT = 2000
GRAZING = -0.8
"""Cosine of V and R below which half of the pairs lie, and a tenth of all views."""

CASES = [
    ("cornell/krylon_blue.brdf", 0.2, "interior", 64),
    ("rgl/paper_white_rgb.bsdf", 0.03, "city", 32),
    ("nist/PTFE.532.coeff.csv", 0.03, "interior", 32),
]
"""A measured material, its tolerance, the probe that lights it, and its rows: glossy paint has
F = 32, which takes more pixels than the F of 2 and 4 of matt materials.
"""


def pairs():
    """Reflections, normals, views and weights; many pairs where errors are large."""
    rng = np.random.default_rng(4)
    reflections, across = brute_force.unit(rng, COUNT), brute_force.unit(rng, COUNT)
    grazing = np.arange(COUNT) % 2 == 0
    cosine = np.where(grazing, rng.uniform(-1, GRAZING, COUNT), rng.uniform(GRAZING, 1, COUNT))[
        :, None
    ]
    across -= np.sum(across * reflections, axis=1, keepdims=True) * reflections
    across /= np.linalg.norm(across, axis=1)[:, None]
    views = cosine * reflections + np.sqrt(1 - cosine**2) * across
    normals = reflections + views
    share = (GRAZING + 1) / 2
    weights = np.where(grazing, share, 1 - share)
    return normals / np.linalg.norm(normals, axis=1)[:, None], views, weights[:, None]


@pytest.mark.proof
@pytest.mark.parametrize(("material", "tolerance", "name", "height"), CASES)
def test_measured_error_is_the_predicted_one(shared, tmp_path, material, tolerance, name, height):
    """Within 20 %; much of the error lies at grazing views, which few pairs meet."""
    pixels = reduced(shared / "probes" / f"{name}.exr", height)
    probe = open_probe(write_exr(tmp_path / "probe.exr", pixels))
    brdf = parse_spec(str(shared / "brdf" / material))
    prefiltered = prefilter_shrm(Projection(probe), Request("shrm", brdf, tolerance))
    normals, views, weights = pairs()
    truth = Reference(probe, brdf, exact=True).radiance(normals, views)
    found = prefiltered.map.radiance(normals, views)
    measured = np.sqrt(np.sum(weights * (found - truth) ** 2) / np.sum(weights * truth**2))
    predicted = prefiltered.map.info.predicted_error
    orders = prefiltered.map.info.order_f, prefiltered.map.info.order_p
    print(f"{material} {name}: {orders}, predicted {predicted:.4f}, measured {measured:.4f}")
    assert measured == pytest.approx(predicted, rel=0.2)
