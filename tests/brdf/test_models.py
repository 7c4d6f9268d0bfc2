"""The models against their formulas written out in world space, at generic angles."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shrm_cli.brdf.spec import MODELS, parse_spec
from tests import brute_force


def frame_of(normal, rng):
    """Rotation whose third row is the normal: world to the frame of the normal."""
    x = np.cross(normal, brute_force.unit(rng, 1)[0])
    x = x / np.linalg.norm(x)
    return np.stack([x, np.cross(normal, x), normal])


@pytest.mark.parametrize(
    ("spec", "formula"),
    [
        ("microfacet:sigma=0.13", brute_force.microfacet(0.13)),
        ("microfacet:sigma=0.9", brute_force.microfacet(0.9)),
        ("phong:exponent=7", brute_force.phong(7)),
        ("phong:exponent=120.5", brute_force.phong(120.5)),
    ],
)
def test_transfer_functions(spec, formula):
    rng = np.random.default_rng(5)
    brdf = parse_spec(spec)
    for reflection, view in zip(brute_force.unit(rng, 20), brute_force.unit(rng, 20), strict=True):
        normal = (reflection + view) / np.linalg.norm(reflection + view)
        frame = frame_of(normal, rng)
        light = np.concatenate([brute_force.unit(rng, 50), reflection[None], view[None]])
        found = brdf.transfer(light @ frame.T, view @ frame.T)
        expected = formula(reflection, view, light)
        assert found.shape == (52, 3)
        np.testing.assert_allclose(found[:, 1], expected, rtol=1e-9, atol=1e-12)
        assert expected.max() > 0


def test_lambertian_is_albedo_over_pi_with_the_cosine_in_the_transfer_function():
    brdf = parse_spec("lambertian:albedo=0.4")
    view = np.array([0.0, 0.6, 0.8])
    light = np.array([[0.0, 0.0, 1.0], [0.6, 0.0, 0.8], [0.6, 0.0, -0.8]])
    np.testing.assert_allclose(brdf.evaluate(light, view), 0.4 / np.pi)
    np.testing.assert_allclose(
        brdf.transfer(light, view)[:, 2], 0.4 / np.pi * np.array([1, 0.8, 0])
    )


@given(st.sampled_from(["microfacet", "lambertian"]), st.floats(0.01, 1), st.integers(0, 10**6))
def test_helmholtz_reciprocity(name, value, seed):
    rng = np.random.default_rng(seed)
    key = MODELS[name].parameters[0].name
    brdf = MODELS[name](**{key: value})
    one, other = (v * np.sign(v[2]) for v in brute_force.unit(rng, 2))
    np.testing.assert_allclose(brdf.evaluate(one, other), brdf.evaluate(other, one), rtol=1e-9)


@pytest.mark.parametrize("name", MODELS)
def test_every_model_states_itself(name):
    model = MODELS[name]
    assert model.name == name
    assert model.summary
    assert model.source
    brdf = model()
    for parameter in model.parameters:
        assert parameter.minimum <= parameter.default <= parameter.maximum
        assert brdf.values[parameter.name] == parameter.default
        for value in (parameter.minimum, parameter.maximum):
            rng = np.random.default_rng(0)
            light = brute_force.unit(rng, 200)
            extreme = model(**{parameter.name: value})
            assert np.isfinite(extreme.transfer(light, np.array([0.0, 0.0, 1.0]))).all()
    assert parse_spec(repr(brdf)).values == brdf.values
