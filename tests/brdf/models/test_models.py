"""The models against their formulas written out in world space, at generic angles."""

import json
from itertools import product

import numpy as np
import pytest

from shrm_cli.brdf.base import value_text
from shrm_cli.brdf.library import built_in_names, find_model
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.errors import BrdfError
from tests import brute_force

MODELS = {name: find_model(name) for name in built_in_names()}


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


# Poles, the horizon from all sides, opposite and equal directions, below the surface, slanting.
CORNERS = np.array(
    [
        [0, 0, 1], [0, 0, -1], [1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0],
        [0.6, 0, 0.8], [-0.6, 0, 0.8], [0.6, 0, -0.8], [-0.6, 0, -0.8],
        [1, 0, 1e-9], [-1, 0, 1e-9], [1, 0, -1e-9], [0, 1, 1e-4], [0, -1, 1e-4], [1, 0, 1e-38],
    ]
)  # fmt: skip


OPTIONAL = {
    "ggx": [
        {"anisotropy": 1.0},
        {"anisotropy": 1.0, "mapping": "openpbr"},
        {"ax": 0.0025, "ay": 1.0},
        {"ax": 1.0, "ay": 0.0025},
        {"f0": 0.0, "film": 0.0, "film_ior": 1.0},
        {"f0": [0.99, 0.2, 0.0], "film": 5000.0, "film_ior": 3.0},
    ],
    "coated": [{"film": 0.0, "film_ior": 1.0}, {"film": 5000.0, "film_ior": 3.0}],
}
"""Optional parameters of the models that have some, at the ends of their ranges."""


def extremes(model):
    """The model with its defaults, and with all parameters at one end of their ranges.

    Optional ones may exclude each other, and are taken one set at a time.
    """
    yield model()
    ordinary = [p for p in model.parameters if not p.is_optional]
    for end in ("minimum", "maximum"):
        values = {p.name: getattr(p, end) for p in ordinary if not isinstance(p.default, str)}
        yield model(**values)
        for more in OPTIONAL.get(model.name, ()):
            kept = {} if "ax" in more else values
            yield model(**{**kept, **more})
    for parameter in ordinary:
        for choice in parameter.choices:
            yield model(**{parameter.name: choice})


@pytest.mark.parametrize("name", MODELS)
def test_finite_everywhere_and_of_the_same_precision(name):
    for brdf, dtype in product(extremes(MODELS[name]), (np.float32, np.float64)):
        corners = CORNERS.astype(dtype)
        with np.errstate(all="raise", under="ignore"):
            value = brdf.evaluate(corners[:, None], corners)
            transfer = brdf.transfer(corners[:, None], corners)
        for found in (value, transfer):
            assert found.dtype == dtype
            assert found.shape == (len(corners), len(corners), 3)
            assert np.isfinite(found).all(), brdf
            assert (found >= 0).all()
        if not brdf.includes_cosine or brdf.has_horizon:
            np.testing.assert_array_equal(transfer[corners[:, 2] <= 0], 0)


@pytest.mark.parametrize("name", MODELS)
def test_single_precision_is_as_exact_as_it_can_be(name):
    rng = np.random.default_rng(4)
    light, view = brute_force.unit(rng, 300), brute_force.unit(rng, 300)
    brdf = MODELS[name]()
    exact = brdf.transfer(light, view)
    found = brdf.transfer(light.astype(np.float32), view.astype(np.float32))
    np.testing.assert_allclose(found, exact, rtol=1e-4, atol=1e-5 * exact.max())


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=pytest.mark.proof) if name == "openpbr" else name for name in MODELS],
)
def test_grey_models_do_not_copy_their_channels(name):
    light, view = CORNERS[6:8], CORNERS[[7, 7]]  # the mirror direction, and the way back
    assert MODELS[name]().evaluate(light, view).strides[-1] == 0
    colours = [p for p in MODELS[name].parameters if isinstance(p.default, tuple)]
    # Colors of a coat and of fuzz are seen where there is some.
    parts = {p.name: 0.5 for p in MODELS[name].parameters if p.name.endswith("_weight")}
    for parameter in colours:
        values = {**parts, **{other.name: 0.9 for other in colours}}
        values[parameter.name] = [part * parameter.maximum for part in (0.9, 0.5, 0.2)]
        red, _, blue = np.moveaxis(MODELS[name](**values).evaluate(light, view), -1, 0)
        assert (red != blue).any()


@pytest.mark.parametrize("name", [name for name in MODELS if MODELS[name].isotropic])
def test_isotropic_models_do_not_see_a_turn_about_the_normal(name, rng):
    light, view = brute_force.unit(rng, 100), brute_force.unit(rng, 100)
    turn = np.array([[0.6, -0.8, 0], [0.8, 0.6, 0], [0, 0, 1]])
    brdf = MODELS[name]()
    found, turned = brdf.evaluate(light, view), brdf.evaluate(light @ turn, view @ turn)
    np.testing.assert_allclose(turned, found, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize(
    "spec",
    [
        "ward:ax=0.1,ay=0.3",
        "ashikhmin-shirley:nu=10,nv=90",
        "poulin-fournier",
        "ggx:roughness=0.4,anisotropy=0.6",
    ],
)
def test_brushed_models_do(spec, rng):
    light, view = abs(brute_force.unit(rng, 100)), abs(brute_force.unit(rng, 100))
    turn = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    brdf = parse_spec(spec)
    assert not brdf.isotropic
    found, turned = brdf.evaluate(light, view), brdf.evaluate(light @ turn, view @ turn)
    assert np.abs(found - turned).max() > 0.1 * found.max()


@pytest.mark.parametrize("name", MODELS)
def test_every_model_states_itself(name):
    model = MODELS[name]
    assert model.name == name
    assert model.summary
    assert model.source
    brdf = model()
    for parameter in model.parameters:
        assert parameter.meaning
        assert parameter.domain
        assert parameter.default_text
        default = parameter.checked(parameter.default)
        assert (parameter.name in brdf.values) is not parameter.is_optional
        if parameter.is_optional:
            continue
        assert brdf.values[parameter.name] == default
        assert parse_spec(f"{name}:{parameter.name}={value_text(default)}").values == brdf.values


@pytest.mark.parametrize("name", MODELS)
def test_values_and_specifications_name_the_same_brdf(name):
    for brdf in extremes(MODELS[name]):
        stored = json.loads(json.dumps(brdf.values))
        assert type(brdf)(**stored).values == brdf.values
        assert parse_spec(repr(brdf)).values == brdf.values


def test_another_centre():
    brdf = parse_spec("phong:exponent=9")
    assert brdf.recentered("reflection") is brdf
    other = brdf.recentered("normal")
    assert (other.center, other.zonal, other.values) == ("normal", False, brdf.values)
    assert (brdf.center, brdf.zonal) == ("reflection", True)
    light, view = CORNERS[[6]], CORNERS[[7]]
    np.testing.assert_array_equal(other.transfer(light, view), brdf.transfer(light, view))
    assert parse_spec("lambertian").recentered("reflection").center == "reflection"
    assert parse_spec("kajiya-kay").recentered("tangent").center == "tangent"


@pytest.mark.parametrize(("spec", "center"), [("phong", "tangent"), ("kajiya-kay", "normal")])
def test_no_way_from_or_to_the_tangent(spec, center):
    with pytest.raises(BrdfError, match=f"{spec}: it is defined about the .* about the {center}"):
        parse_spec(spec).recentered(center)
