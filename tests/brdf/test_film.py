"""Thin films, against characteristic matrices of layers and colour-science's observer."""

import numpy as np
import pytest

from shrm_cli.brdf.film import film_reflectance
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.choose.choose import others_of
from shrm_cli.errors import BrdfError
from tests.brdf.layered.test_coated import reflected_share, seen
from tests.brdf.models.test_analytic import upper

WAVELENGTHS = np.arange(360.0, 781.0)


def matrix_reflectance(cosine, base, thickness, ior):
    """Reflectances of a film on a base at each wavelength: Abeles' matrices of E and H.

    The tangential fields at both sides of a layer of phase p and admittance y are related by
    ``[[cos p, i sin p / y], [i y sin p, cos p]]``; no reflection is summed.
    """
    sine = np.sqrt(1 - cosine**2 + 0j)
    within, below = (np.sqrt(1 - (sine / n) ** 2) for n in (ior, base))
    phase = 2 * np.pi * ior * thickness * within / WAVELENGTHS
    found = 0
    for air, film, ground in (
        (cosine, ior * within, base * below),
        (1 / cosine, ior / within, base / below),
    ):
        e = np.cos(phase) + 1j * ground * np.sin(phase) / film
        h = ground * np.cos(phase) + 1j * film * np.sin(phase)
        found = found + np.abs((air * e - h) / (air * e + h)) ** 2 / 2
    return found


def seen_color(colour, spectrum):
    """Its linear sRGB under D65, as fractions of white."""
    shape = colour.SpectralShape(360, 780, 1)
    cmfs = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"].copy().align(shape)
    daylight = colour.SDS_ILLUMINANTS["D65"].copy().align(shape)
    xyz, white = (
        colour.sd_to_XYZ(
            colour.SpectralDistribution(each, WAVELENGTHS),
            cmfs, daylight, method="Integration", shape=shape,
        )
        for each in (spectrum, np.ones(len(WAVELENGTHS)))
    )  # fmt: skip
    rgb, one = (colour.XYZ_to_sRGB(each / 100, apply_cctf_encoding=False) for each in (xyz, white))
    return rgb / one


@pytest.mark.parametrize(
    ("f0", "thickness", "ior"),
    [
        ((0.04, 0.04, 0.04), 0, 1.7),
        ((0.04, 0.04, 0.04), 330, 1.3),
        ((0.0, 0.0, 0.0), 470, 1.33),
        ((0.9, 0.6, 0.3), 250, 2.4),
        ((0.55, 0.5, 0.45), 820, 2.1),
        ((0.04, 0.1, 0.3), 3000, 1.5),
        ((0.9, 0.6, 0.3), 400, 0.8),  # in a coat, where light turns back at the film
    ],
)
def test_a_film_is_what_waves_make_it(colour, f0, thickness, ior):
    cosines = np.array([0.07, 0.23, 0.41, 0.66, 0.83, 0.97, 1.0])
    expected = np.empty((len(cosines), 3))
    for k, cosine in enumerate(cosines):
        for channel, each in enumerate(f0):
            base = (1 + np.sqrt(each)) / (1 - np.sqrt(each))
            spectrum = matrix_reflectance(cosine, base, thickness, ior)
            expected[k, channel] = seen_color(colour, spectrum)[channel]
    found = film_reflectance(cosines, f0, thickness, ior)
    np.testing.assert_allclose(found, np.clip(expected, 0, 1), rtol=0, atol=2e-3)


@pytest.mark.parametrize(
    ("retardation", "hues"),
    [
        (332, (30, 75)),
        (664, (190, 250)),
        (910, (30, 75)),
        (1128, (240, 300)),
        (1334, (90, 150)),
        (1534, (310, 360)),
    ],
    ids=["bright yellow", "sky blue", "pure yellow", "violet", "sea green", "carmine"],
)
def test_thicker_films_show_the_known_orders_of_colors(colour, retardation, hues):
    """Those that Michel-Levy's chart names at retardations, nm, of 2 indices times thickness.

    It holds for a soap film too: both are ``sin(pi retardation / wavelength)^2``. The hue is 0 at
    red, 120 at green and 240 at blue.
    """
    rgb = film_reflectance(np.ones(1), (0.0, 0.0, 0.0), retardation / 2 / 1.33, 1.33)[0]
    assert hues[0] < 360 * colour.RGB_to_HSV(rgb)[0] < hues[1]


def test_a_film_turns_the_color_of_ggx_with_the_angle(rng):
    """The lobe is that of GGX; only what its facets reflect changes."""
    light, view = upper(rng, 80), upper(rng, 80)
    half = light + view
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    white = parse_spec("ggx:roughness=0.35").evaluate(light, view)
    found = parse_spec("ggx:roughness=0.35,f0=0.04/0.1/0.3,film=420,film_ior=1.4")
    fresnel = film_reflectance(np.sum(half * view, axis=1), (0.04, 0.1, 0.3), 420, 1.4)
    np.testing.assert_allclose(found.evaluate(light, view), white * fresnel, rtol=1e-9)
    np.testing.assert_allclose(found.evaluate(light, view), found.evaluate(view, light), rtol=1e-9)
    assert np.ptp(fresnel[:, 0] / fresnel.sum(axis=1)) > 0.2


@pytest.mark.proof
@pytest.mark.parametrize(
    "spec",
    [
        "ggx:roughness=0.2,f0=gold,film=330,film_ior=2",
        "ggx:roughness=0.6,f0=0.99,film=250",
        "coated:film=350,base=(lambertian)",
        "coated:film=500,film_ior=1.8,base=(ggx:roughness=0.3,f0=0.98/0.9/0.7,film=200)",
    ],
)
def test_a_film_gains_no_energy(spec):
    brdf = parse_spec(spec)
    for degrees in (0, 25, 50, 70, 85):
        assert reflected_share(brdf, degrees).max() < 1 + 1e-3, degrees


def test_what_a_film_on_a_coat_keeps_out_is_not_lost():
    """Over a white base all light leaves again, whatever the film sends where."""
    brdf = parse_spec("coated:film=300,film_ior=1.9,base=(lambertian)")
    border = brdf.terms[0][1]
    for degrees in (0, 30, 60, 75):
        assert reflected_share(brdf, degrees) == pytest.approx(1, abs=5e-3)
        coat = film_reflectance(np.array([seen(degrees)[2]]), (0.04,) * 3, 300, 1.9)[0]
        assert reflected_share(border, degrees) == pytest.approx(coat, abs=6e-3)


@pytest.mark.parametrize(
    ("spec", "why"),
    [
        ("ggx:f0=0.04,film_ior=1.4", "film_ior applies with film"),
        ("coated:film_ior=1.4", "film_ior applies with film"),
        ("ggx:film=300", "reflects all, with a film or without"),
        ("ggx:f0=0.04,film=-1", "outside 0 .. 5000"),
    ],
)
def test_films_that_show_nothing_are_refused(spec, why):
    with pytest.raises(BrdfError, match=why):
        parse_spec(spec)


def test_maps_of_light_alone_show_no_film():
    """Their surface has a roughness and an f0 only; other forms are offered."""
    bare, film = parse_spec("ggx:f0=0.04"), parse_spec("ggx:f0=0.04,film=300")
    assert bare.surface == (0.4, (0.04, 0.04, 0.04))
    assert film.surface is None
    forms = [[form for form, _ in others_of(brdf, [])] for brdf in (bare, film)]
    assert "splitsum" in forms[0]
    assert forms[1] == ["cabral"]
