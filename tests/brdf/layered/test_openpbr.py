"""OpenPBR's surface: energy, Mitsuba, formulas of its specification written again, and refusals."""

import warnings

import numpy as np
import pytest

from shrm_cli.brdf.film import film_reflectance
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.errors import BrdfError, ShrmWarning
from tests.brdf.layered.test_coated import ANGLES, fresnel, reflected_share, seen
from tests.brdf.models.test_analytic import mitsuba, mitsuba_values, upper  # noqa: F401

WHITE = "openpbr:base_color=1"


def separate(light, view, alphas):
    """What Smith's G of both directions has to be multiplied by where Mitsuba's is a product."""
    one, other = (
        (np.sqrt(1 + ((v[:, :2] * alphas) ** 2).sum(axis=1) / v[:, 2] ** 2) - 1) / 2
        for v in (light, view)
    )
    return ((1 + one) * (1 + other) / (1 + one + other))[:, None]


@pytest.mark.proof
@pytest.mark.parametrize(
    "more",
    [
        "",
        "specular_ior=3,specular_roughness=0",
        "specular_weight=0.3,base_diffuse_roughness=1,specular_roughness=1",
        "base_metalness=1,specular_color=1/0.5/0,specular_roughness=0.2",
        "base_metalness=0.5,specular_color=0.2/1/0.6",
        "specular_roughness_anisotropy=0.8,specular_roughness=0.7,specular_ior=2.5",
        "base_metalness=0.3,coat_weight=1,coat_roughness=0.3",
        "coat_weight=0.5,coat_ior=2.4,coat_color=1/0.9/0.5,base_diffuse_roughness=0.6",
        "specular_roughness_anisotropy=0.6,base_metalness=1,coat_weight=1,coat_roughness=0.2",
        "fuzz_weight=1,fuzz_roughness=1",
        "fuzz_weight=0.7,fuzz_color=1/0.2/0.1,fuzz_roughness=0,coat_weight=0.6",
    ],
)
def test_no_more_light_leaves_than_arrives(more):
    brdf = parse_spec(f"{WHITE},{more}" if more else WHITE)
    for degrees in ANGLES:
        assert reflected_share(brdf, degrees, 400).max() < 1 + 1e-3, degrees


@pytest.mark.parametrize(
    "more",
    [
        "thin_film_weight=1",
        "thin_film_weight=1,coat_roughness=0.5,specular_roughness=0.05",
        "thin_film_weight=1,thin_film_ior=1.3,coat_ior=2,coat_roughness=0.3",
        "coat_ior=3,coat_roughness=1",
        "thin_film_weight=0.5,base_metalness=0.5,coat_ior=3,coat_roughness=1,thin_film_ior=1",
    ],
)
def test_a_border_in_a_coat_gains_no_light(more):
    """Light that a film of a smaller index turns back in the coat goes to and fro many times."""
    brdf = parse_spec(f"{WHITE},coat_weight=1,{more}")
    for degrees in (0, 60):
        found = reflected_share(brdf, degrees, 400)
        assert found.max() < 1 + 2e-3
        assert found.min() > 0.85


@pytest.mark.parametrize("more", ["specular_ior=1.2", "specular_ior=2,base_diffuse_roughness=1"])
def test_nothing_is_lost_over_a_white_base(more):
    brdf = parse_spec(f"{WHITE},{more}")
    for degrees in (0, 40, 75):
        assert reflected_share(brdf, degrees, 300) == pytest.approx(1, abs=1e-3)


def test_the_base_is_dimmed_by_what_its_border_reflects():
    """OpenPBR's glossy-diffuse slab: ``E_spec + (1 - E_spec) base_color``, the tint on top."""
    color, tint = np.array([0.6, 0.3, 0.1]), np.array([0.2, 1.0, 0.5])
    brdf = parse_spec("openpbr:base_color=0.6/0.3/0.1,specular_color=0.2/1/0.5,base_weight=0.5")
    border = parse_spec("openpbr:base_color=0")
    for degrees in (0, 30, 60, 80):
        reflected = reflected_share(border, degrees, 400)
        expected = tint * reflected + (1 - reflected) * 0.5 * color
        assert reflected_share(brdf, degrees, 400) == pytest.approx(expected, rel=2e-3)


def test_the_border_is_mitsubas(mitsuba, rng):  # noqa: F811
    light, view = upper(rng, 60), upper(rng, 60)
    alphas = np.array([0.328266, 0.131306])
    plugin = {"type": "roughdielectric", "distribution": "ggx", "int_ior": 1.7, "ext_ior": 1.0,
              "alpha_u": alphas[0], "alpha_v": alphas[1]}  # fmt: skip
    expected = mitsuba_values(mitsuba, plugin, light, view) * separate(light, view, alphas)
    brushed = "specular_roughness=0.5,specular_roughness_anisotropy=0.6"
    found = parse_spec(f"openpbr:base_color=0,specular_ior=1.7,{brushed}").transfer(light, view)
    np.testing.assert_allclose(found, expected, rtol=2e-3, atol=1e-6)


def test_metal_is_mitsubas(mitsuba, rng):  # noqa: F811
    light, view = upper(rng, 60), upper(rng, 60)
    plugin = {"type": "principled", "base_color": {"type": "rgb", "value": [0.9, 0.6, 0.3]},
              "roughness": 0.5, "metallic": 1.0}  # fmt: skip
    expected = mitsuba_values(mitsuba, plugin, light, view) * separate(light, view, 0.25)
    spec = "openpbr:base_color=0.9/0.6/0.3,base_metalness=1,specular_roughness=0.5"
    np.testing.assert_allclose(parse_spec(spec).transfer(light, view), expected, rtol=1e-3)
    half = parse_spec(f"{spec},specular_weight=0.5").transfer(light, view)
    np.testing.assert_allclose(half, expected / 2, rtol=1e-3)


def test_the_rim_of_a_metal_has_its_tint():
    """By the definition of F82: at 82 degrees Schlick's reflectance times specular_color."""
    plain, tinted = (
        parse_spec(f"openpbr:base_metalness=1,base_color=0.7,specular_color={each}")
        for each in ("1", "0.2/0.5/0.8")
    )
    for cosine, expected in ((1 / 7, [0.2, 0.5, 0.8]), (1.0, [1, 1, 1])):
        sine = np.sqrt(1 - cosine**2)
        light, view = np.array([sine, 0, cosine]), np.array([-sine, 0, cosine])
        found = tinted.evaluate(light, view) / plain.evaluate(light, view)
        np.testing.assert_allclose(found, expected, rtol=1e-6)


@pytest.mark.parametrize("weight", [0.2, 0.7])
def test_the_weight_of_a_border_is_that_of_its_reflectance_along_the_normal(weight):
    up, name = seen(0), "openpbr:base_color=0,specular_ior=1.8"
    whole, part = (parse_spec(f"{name},specular_weight={w}").evaluate(up, up) for w in (1, weight))
    assert part == pytest.approx(weight * whole, rel=1e-6)
    assert whole[0] == pytest.approx(fresnel(1.0, 1.8) / (4 * np.pi * 0.3**4), rel=1e-6)


METAL = "base_metalness=1,base_color=0.9/0.6/0.3"


@pytest.mark.proof
@pytest.mark.parametrize(
    ("spec", "same"),
    [
        (METAL, "ggx:roughness=0.3,f0=0.9/0.6/0.3"),
        (
            f"{METAL},coat_weight=0.4,coat_ior=1.5,coat_roughness=0.1,coat_color=1/0.8/0.5",
            "0.4*coated:color=1/0.8/0.5,base=(ggx:roughness=0.3,f0=0.9/0.6/0.3)"
            "+0.6*ggx:roughness=0.3,f0=0.9/0.6/0.3",
        ),
        (
            f"{METAL},fuzz_weight=0.5,fuzz_color=0.2/0.4/0.8,fuzz_roughness=0.6",
            "fuzzy:color=0.1/0.2/0.4,roughness=0.36,base=(ggx:roughness=0.3,f0=0.9/0.6/0.3)",
        ),
        ("specular_weight=0,base_weight=0.5,base_color=0.4/0.6/1", "lambertian:albedo=0.2/0.3/0.5"),
        ("specular_weight=0,base_diffuse_roughness=0.7", "eon:roughness=0.7,albedo=0.8"),
        ("base_color=0,specular_weight=0", "lambertian:albedo=0"),
        (
            f"{METAL},thin_film_weight=0.4,thin_film_thickness=0.33,thin_film_ior=2",
            "0.6*ggx:roughness=0.3,f0=0.9/0.6/0.3"
            "+0.4*ggx:roughness=0.3,f0=0.9/0.6/0.3,film=330,film_ior=2",
        ),
        (
            "base_color=0,specular_ior=2,thin_film_weight=1,thin_film_ior=1.3",
            "ggx:roughness=0.3,f0=0.1111111111111111,film=500,film_ior=1.3",
        ),
    ],
)
def test_layers_are_those_that_have_a_name(rng, spec, same):
    light, view = upper(rng, 100), upper(rng, 100)
    found = parse_spec(f"openpbr:{spec}").evaluate(light, view)
    np.testing.assert_allclose(found, parse_spec(same).evaluate(light, view), rtol=1e-9)


def test_a_film_over_a_white_surface_takes_no_light():
    """What passes film and border in each channel is scattered, and leaves."""
    brdf = parse_spec("openpbr:base_color=1,thin_film_weight=1,thin_film_ior=2")
    border = brdf.terms[0][1]
    assert np.ptp(reflected_share(border, 30, 200)) > 0.02
    for degrees in (10, 50, 70):
        np.testing.assert_allclose(reflected_share(brdf, degrees, 400), 1, atol=0.012)


def test_films_under_coats_have_the_ratio_of_indices():
    """Through a nearly smooth coat, along the normal, where little light goes to and fro."""
    up, rough = seen(0), 0.9
    more = f"coat_weight=1,coat_roughness=0.05,specular_roughness={rough},base_color=0"
    passing = (1 - fresnel(1.0, 1.6)) ** 2 / 1.6**2 / (4 * np.pi * rough**4)
    base = ((1.6 - 1.5) / (1.6 + 1.5)) ** 2
    for ior in (2.2, 1.9):
        film = f"thin_film_weight=1,thin_film_thickness=0.3,thin_film_ior={ior}"
        terms = parse_spec(f"openpbr:{film},{more}").terms
        (below,) = (term for _, term in terms if term.name == "coated-part")
        lobe = film_reflectance(np.ones(1), (base,) * 3, 480, ior / 1.6)[0]
        assert lobe.max() > 1.4 * lobe.min()
        np.testing.assert_allclose(below.evaluate(up, up), passing * lobe, rtol=0.1)


@pytest.mark.proof
def test_a_dielectric_in_a_coat_reflects_by_the_ratio_of_their_indices():
    """Along the normal and through a nearly smooth coat; 1.5 in 1.6 is as 1.6 in 1.5."""
    up, rough = seen(0), 0.9
    more = f"coat_weight=1,coat_roughness=0.05,specular_roughness={rough}"
    for ior in (1.5, 1.8):
        spec = f"openpbr:base_color=0,specular_ior={ior},{more}"
        below = [t for _, t in parse_spec(spec).terms if t.name == "coated-part"]
        passing = (1 - fresnel(1.0, 1.6)) ** 2 / 1.6**2
        lobe = fresnel(1.0, max(ior / 1.6, 1.6 / ior)) / (4 * np.pi * rough**4)
        assert len(below) == 1
        assert below[0].evaluate(up, up) == pytest.approx(passing * lobe, rel=0.02)


@pytest.mark.proof
@pytest.mark.parametrize("spec", ["", "base_metalness=0.4,coat_weight=0.5,fuzz_weight=0.2"])
def test_light_and_view_may_be_exchanged_and_names_give_the_same_again(rng, spec):
    brdf, light, view = (
        parse_spec(f"openpbr:{spec}" if spec else "openpbr"),
        upper(rng, 100),
        upper(rng, 100),
    )
    found = brdf.evaluate(light, view)
    np.testing.assert_allclose(found, brdf.evaluate(view, light), rtol=1e-9)
    again = parse_spec(repr(brdf))
    assert again.values == brdf.values
    np.testing.assert_array_equal(again.evaluate(light, view), found)
    assert brdf.at_roughness(0.7).number("specular_roughness") == 0.7


@pytest.mark.parametrize(
    ("spec", "words"),
    [
        ("transmission_weight=0.5", "light that passes through it is not held"),
        ("subsurface_weight=1", "light that leaves it elsewhere is not held"),
        ("thin_film_thickness=400", "outside 0 .. 5"),
        ("base_colour=1", "unknown parameter 'base_colour'"),
        ("specular_ior=0.5", "outside 1 .. 3"),
    ],
)
def test_what_cannot_be_held_is_refused(spec, words):
    with pytest.raises(BrdfError, match=words):
        parse_spec(f"openpbr:{spec}")


@pytest.mark.parametrize(
    "spec", ["emission_luminance=9", "coat_darkening=0", "geometry_opacity=0.5",
             "coat_roughness_anisotropy=0.5"],
)  # fmt: skip
def test_what_changes_little_is_left_out_and_said(spec):
    with pytest.warns(ShrmWarning, match=f"{spec} is left out"):
        found = parse_spec(f"openpbr:{spec}")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert found.values == parse_spec("openpbr").values
        parse_spec(repr(found))
        parse_spec("openpbr:transmission_weight=0,thin_film_thickness=3,emission_luminance=0")
