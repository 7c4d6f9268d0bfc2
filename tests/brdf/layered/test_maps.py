"""Maps of layers at the defaults, against sums over all pixels."""

import numpy as np
import pytest

import shrm_cli
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.probe.source import source_pixels
from tests.brute_force import unit

PAINT = "coated:roughness=0.5,base=(0.7*lambertian:albedo=0.6/0.05/0.03+0.3*ggx:roughness=0.6)"


@pytest.mark.proof
@pytest.mark.filterwarnings("ignore:.*negative radiance")
@pytest.mark.parametrize(
    "spec",
    [
        PAINT,
        f"0.3*{PAINT}+0.7*lambertian:albedo=0.2",
        "fuzzy:color=0.8,roughness=0.7,base=(lambertian:albedo=0.1/0.2/0.5)",
    ],
)
def test_a_map_reflects_what_it_should(rng, shared, tmp_path, spec):
    probe = shrm_cli.open_probe(shared / "probes" / "courtyard.exr")
    made = shrm_cli.prefilter(probe, spec, to="auto")
    made.save(tmp_path / "map.exr")
    found = shrm_cli.open_map(tmp_path / "map.exr")
    directions, light = (each.reshape(-1, 3).astype(float) for each in source_pixels(probe, 128))
    brdf = parse_spec(spec)
    normals, views = unit(rng, 60), unit(rng, 60)
    views *= np.sign(np.sum(normals * views, axis=1, keepdims=True))
    expected = np.zeros((60, 3))
    for k, (normal, view) in enumerate(zip(normals, views, strict=True)):
        across = np.cross(normal, view)
        across /= np.linalg.norm(across)
        frame = np.stack([across, np.cross(normal, across), normal], axis=1)
        expected[k] = np.sum(brdf.transfer(directions @ frame, view @ frame) * light, axis=0)
    wrong = np.sqrt(np.sum((found.radiance(normals, views) - expected) ** 2) / np.sum(expected**2))
    assert wrong < 2 * found.info.predicted_error + 0.01
    assert found.info.predicted_error < 0.05
