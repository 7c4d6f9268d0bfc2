"""The code of lamps in layers: run in C beside sums over discs, and beside the BRDFs themselves."""

import re

import numpy as np
import pytest

from shrm_cli.brdf.models.ggx import Ggx
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.errors import MapError
from shrm_cli.maps.lamps.models import has_code
from shrm_cli.maps.shader.code import written_code
from tests.maps.scenes import make_shrm
from tests.maps.shader import cases
from tests.maps.shader.test_brushed import frames
from tests.maps.shader.test_brushed import in_c as brushed_in_c
from tests.maps.shader.test_code import in_c
from tests.oracles import disc_rule

METAL = "coated:roughness=0.3,ior=1.4,color=0.9/0.6/0.3,base=(ggx:roughness=0.4,f0=gold)"
PAINT = (
    "coated:roughness=0.3,base=(0.7*lambertian:albedo=0.6/0.05/0.03+0.3*ggx:roughness=0.5,f0=0.9)"
)
BRUSHED = (
    "openpbr:specular_roughness=0.5,specular_roughness_anisotropy=0.6,base_metalness=0.5,"
    "base_color=0.9/0.5/0.2,specular_color=0.9/0.95/1,coat_weight=0.5,coat_roughness=0.3"
)
LAYERS = [
    pytest.param(METAL, marks=pytest.mark.proof),
    "coated:weight=0.4,roughness=0.4,film=350,base=(blinn-phong:exponent=40,color=0.9/0.8/0.7)",
    pytest.param(
        "coated:ior=1,base=(0.4*phong:exponent=40+0.2*microfacet:sigma=0.2)",
        marks=pytest.mark.proof,
    ),
    pytest.param("openpbr:base_color=0.7/0.3/0.1", marks=pytest.mark.proof),
    "openpbr:base_metalness=1,base_color=0.9/0.5/0.2,specular_color=0.7/0.9/1,specular_weight=0.8",
    pytest.param(
        "openpbr:base_color=0.6/0.1/0.05,base_diffuse_roughness=0.7,specular_ior=1.3,"
        "coat_weight=0.6,coat_roughness=0.4,coat_color=0.9/0.7/0.4,fuzz_weight=0.5,"
        "fuzz_color=0.3/0.6/0.9",
        marks=pytest.mark.proof,  # "lamps of layers" of cases.py is as deep
    ),
    pytest.param(
        "fuzzy:roughness=0.3,color=0.5,base=(coated:roughness=0.5,base=(coated:roughness=0.4))",
        marks=pytest.mark.proof,
    ),
    "openpbr:base_color=0.7/0.3/0.1,base_metalness=0.5,thin_film_weight=1,thin_film_ior=2",
    "0.6*ward:ax=0.2,color=gold+0.4*ashikhmin-shirley:nu=90,specular=0.3/0.2/0.1,diffuse=0.4/0.5/0.1",
    "cook-torrance:roughness=0.2,f0=0.04/0.1/0.3",
    "coated:roughness=0.3,base=(0.6*oren-nayar:sigma=0.5,albedo=0.6/0.3/0.1+0.4*disney-diffuse)",
    "0.3*charlie:roughness=0.4,visibility=neubelt+0.5*eon:roughness=1,albedo=0.9/0.6/0.2",
    pytest.param(
        f"0.4*{PAINT}+0.5*ggx:roughness=0.4,f0=0.04/0.1/0.3,film=500", marks=pytest.mark.proof
    ),
]
"""Metal and paint under coats; what OpenPBR has; layers over layers; a sum of some."""


def some(points):
    """Every second point, those that mirror the discs among them: layers take long to evaluate."""
    return tuple(each[::2] for each in points)


def summed(made, points):
    """What the BRDF itself reflects of the discs, as a sum over directions in them."""
    expected, brdf = np.zeros((len(points[0]), 3)), made.lamps.brdf
    for disc in made.discs:
        light, areas = disc_rule(disc.direction, disc.radius)
        for k, (n, t, v) in enumerate(zip(*points, strict=True)):
            axes = np.stack([t, np.cross(n, t), n], axis=1)
            values = brdf.transfer(light @ axes, (v @ axes)[None])
            expected[k] += areas @ values * disc.radiance
    return expected


@pytest.mark.parametrize("spec", LAYERS)
def test_c_reflects_discs_as_the_brdf_does(tmp_path, monkeypatch, spec):
    """As `radiance` does, but for rounding, and as a sum over the discs."""
    cases.filter_bilinearly(monkeypatch)
    made = cases.lamps(spec, make_shrm(1, 0, 2))
    normals, tangents, views = some(frames(60))
    found = in_c(tmp_path, made, normals, views, 0.5, (1.0, 1.0, 1.0))
    whole = made.radiance(normals, views)
    np.testing.assert_allclose(found, whole, rtol=0, atol=2e-7 * np.abs(whole).max())
    lamps, expected = (
        found - made.map.radiance(normals, views),
        summed(made, (normals, tangents, views)),
    )
    np.testing.assert_allclose(lamps, expected, rtol=0, atol=2e-3 * expected.max())


@pytest.mark.parametrize(
    "spec",
    [
        pytest.param(BRUSHED, marks=pytest.mark.proof),
        "ward:ax=0.1,ay=0.3,color=0.9/0.6/0.3",
        "ashikhmin-shirley:nu=400,nv=20,specular=gold",
    ],
)
def test_c_reflects_discs_in_brushed_surfaces(tmp_path, monkeypatch, spec):
    cases.filter_bilinearly(monkeypatch)
    made, points = cases.lamps(spec, cases.FORMS["principal brushed"]()), some(frames(60))
    found = brushed_in_c(tmp_path, made, points, "shrm_brushed_radiance({})")
    lamps, expected = found - made.map.brushed_radiance(*points), summed(made, points)
    np.testing.assert_allclose(lamps, expected, rtol=0, atol=2e-3 * expected.max())


@pytest.mark.parametrize(
    "spec",
    [
        "0.5*lambertian+0.5*lafortune",
        "fuzzy:base=(coated:base=(lambertian+0.1*lafortune))",
    ],
)
def test_what_there_is_no_code_of(spec):
    assert not has_code(parse_spec(spec))
    made = cases.lamps(spec, make_shrm(1, 0, 2))
    with pytest.raises(MapError, match=r"none of [\w-]+, only of lambertian, ggx, .* and layers"):
        written_code(made, "glsl")


@pytest.mark.parametrize("language", ["glsl", "hlsl", "wgsl"])
def test_no_sines_of_the_language_are_called(language):
    """They are inexact, and software took 77 s to compile a branch that called them."""
    made = cases.FORMS["lamps of a table"]()
    code = written_code(made, language, "layers").text
    assert "shrm_sin(" in code
    assert not re.search(r"\b(sin|cos)\(", code)


def test_a_class_that_is_derived_from_one_may_be_another_brdf():
    class Darker(Ggx):
        """It reflects nothing of what the code would say."""

    assert has_code(Ggx())
    assert not has_code(Darker())


def test_what_is_under_two_layers_is_written_once():
    """And what lies under a coat lies beside it, too, where that has a weight."""
    made = cases.lamps("coated:weight=0.4,base=(fuzzy:base=(eon))", make_shrm(1, 0, 2))
    code = written_code(made, "c").text
    assert code.count("double lit = ") == 1
