"""Principal maps with gradients, beside the map that the numpy code makes."""

import numpy as np
import pytest

import shrm_cli as shrm
from shrm_cli.errors import BrdfError
from shrm_cli.probe.lighting import project
from tests.oracles import random_directions
from tests.torch.setup import has_right_gradients, torch, variable

from shrm_cli.torch import principal_lobes  # isort: skip

pytestmark = pytest.mark.filterwarnings("ignore:.*negative radiance")

SUM = "0.5*lambertian:albedo=0.8/0.1/0.05+0.5*ggx:roughness=0.6"


@pytest.mark.parametrize(("name", "brdf"), [("city", "ggx:roughness=0.5"), ("forest", SUM)])
def test_cubes_and_radiance_are_those_of_the_map(real_probes, rng, name, brdf):
    probe = shrm.open_probe(real_probes / f"{name}.exr")
    made = shrm.prefilter(probe, brdf, to="principal", eps=0.05, size=64)
    modules = principal_lobes(probe, brdf, eps=0.05, size=64)
    light = torch.from_numpy(project(probe, max(each.order for each in modules)).coefficients)
    normals, views = random_directions(rng, 60), random_directions(rng, 60)
    normals *= np.sign(np.sum(normals * views, axis=-1))[:, None]
    total = 0
    for module, lobe in zip(modules, made.lobes, strict=True):
        cubes = module(light, module.synthesis())
        np.testing.assert_allclose(cubes, lobe.cubes, atol=1e-6 * np.abs(lobe.cubes).max())
        total = total + module.radiance(normals, views)(light)
    expected = made.radiance(normals, views)  # cubic between texels
    np.testing.assert_allclose(total, expected, atol=1e-3 * np.abs(expected).max())


def test_gradients(rng):
    pixels = rng.uniform(0.2, 1, (8, 16, 3)).astype(np.float32)
    probe = shrm.Probe.from_array(pixels, layout="latlong", name="noise")
    (lobe,) = principal_lobes(probe, "phong:exponent=4", maps=3, size=4)
    light = variable((lobe.order + 1) ** 2, 3)
    normals, views = random_directions(rng, 4), random_directions(rng, 4)
    assert has_right_gradients(lobe.radiance(normals, views), light)
    synthesis = lobe.synthesis()
    assert has_right_gradients(lambda light: lobe(light, synthesis)[::7, 1], light)


def test_brushed_surfaces_are_refused():
    probe = shrm.Probe.from_array(np.ones((4, 8, 3)), layout="latlong", name="white")
    with pytest.raises(BrdfError, match="isotropic"):
        principal_lobes(probe, "ggx:roughness=0.4,anisotropy=0.7")
