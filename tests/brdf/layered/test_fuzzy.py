"""Fuzz over a base, against the formula of glTF with albedos that are integrated here."""

import numpy as np
import pytest

from shrm_cli.brdf.spec import parse_spec
from tests.brdf.layered.test_coated import reflected_share, upper


@pytest.mark.proof
@pytest.mark.parametrize("base", ["lambertian:albedo=0.8/0.2/0.1", "ggx:roughness=0.5", "phong"])
def test_the_base_is_dimmed_by_what_the_fuzz_reflects(rng, base):
    brdf = parse_spec(f"fuzzy:roughness=0.4,color=0.9/0.3/0.1,base=({base})")
    sheen, bare = parse_spec("charlie:roughness=0.4,color=0.9/0.3/0.1"), parse_spec(base)
    light, view = upper(rng, 20), upper(rng, 20)
    for one, other in zip(light, view, strict=True):
        angles = np.degrees(np.arccos([one[2], other[2]]))
        passing = min(1 - reflected_share(sheen, angle).max() for angle in angles)
        expected = sheen.transfer(one, other) + passing * bare.transfer(one, other)
        np.testing.assert_allclose(brdf.transfer(one, other), expected, rtol=5e-3)


def test_black_fuzz_is_none(rng):
    light, view = upper(rng, 20), upper(rng, 20)
    found = parse_spec("fuzzy:color=0,base=(oren-nayar)").evaluate(light, view)
    np.testing.assert_allclose(found, parse_spec("oren-nayar").evaluate(light, view))
