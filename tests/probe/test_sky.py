"""The analytic sky: photometry, energy, geometry."""

import numpy as np
import pytest

from shrm_cli.color import xyz_matrix
from shrm_cli.errors import ProbeError
from shrm_cli.probe.make import latlong_solid_angles, latlong_texels
from shrm_cli.probe.sky import (
    GAS_ABSORPTION,
    GAS_WAVELENGTHS,
    LUMINOUS_EFFICACY,
    OZONE_ABSORPTION,
    OZONE_WAVELENGTHS,
    SUN_RADIANCE,
    SUN_RADIUS,
    SUN_SOLID_ANGLE,
    SUN_WAVELENGTHS,
    WATER_ABSORPTION,
    WATER_WAVELENGTHS,
    atmosphere_depth,
    color_matching,
    sky,
    sky_radiance,
    sun_disc_samples,
    sun_radiance,
    zenith_luminance,
)
from shrm_cli.sphere.directions import from_azimuth_elevation
from shrm_cli.sphere.grid.latlong import latlong_directions

LUMINANCE = np.array([0.2126390, 0.7151687, 0.0721923])


def sun_only(size, azimuth, elevation, turbidity=3.0):
    """The image without what `sky_radiance` gives for its upper half."""
    image = sky(size, azimuth, elevation, turbidity, ground_albedo=0).astype(float)
    upper = latlong_directions(2 * size, size)[: size // 2]
    sun = from_azimuth_elevation(azimuth, elevation)
    image[: size // 2] -= sky_radiance(upper, sun, turbidity)
    return image


def test_color_matching_fit_resembles_the_tables():
    # CIE 1931, 2 degrees, at 450, 555 and 600 nm; the fit is good to about 0.03.
    tables = [[0.3362, 0.0380, 1.7721], [0.5121, 1.0000, 0.0057], [1.0622, 0.6310, 0.0008]]
    fit = color_matching(np.array([450.0, 555.0, 600.0]))
    np.testing.assert_allclose(fit, tables, atol=0.04)


def test_extraterrestrial_sun_is_the_solar_illuminance_constant():
    # 127.5 to 133 klx are in use; Table 2 ends at 750 nm, where the eye's sensitivity is 1e-4.
    wavelengths = np.arange(380.0, 750.5)
    spectrum = np.interp(wavelengths, SUN_WAVELENGTHS, SUN_RADIANCE)
    luminance = (
        LUMINOUS_EFFICACY
        / 1000
        * np.trapezoid(spectrum * color_matching(wavelengths)[:, 1], wavelengths)
    )
    assert 124 < luminance * SUN_SOLID_ANGLE < 134


def test_tables_are_whole():
    for wavelengths, values in [
        (SUN_WAVELENGTHS, SUN_RADIANCE),
        (OZONE_WAVELENGTHS, OZONE_ABSORPTION),
        (GAS_WAVELENGTHS, GAS_ABSORPTION),
        (WATER_WAVELENGTHS, WATER_ABSORPTION),
    ]:
        assert len(wavelengths) == len(values)
        assert (np.diff(wavelengths) > 0).all()


@pytest.mark.parametrize(
    ("wavelength", "elevation", "turbidity", "depth"),
    # By hand from A.1: violet, green overhead and low, the ozone band at the horizon, the
    # water band, the oxygen band.
    [
        (400, 90, 2, 0.5198),
        (550, 90, 3, 0.3307),
        (550, 10, 3, 1.8463),
        (600, 0, 2, 7.4452),
        (720, 30, 3, 0.4900),
        (760, 60, 2, 0.4347),
    ],
)
def test_atmosphere_has_the_optical_depth_of_the_paper(wavelength, elevation, turbidity, depth):
    made = atmosphere_depth(np.array([float(wavelength)]), elevation, turbidity)
    np.testing.assert_allclose(made, depth, rtol=1e-3)


def test_direct_sun_illuminance():
    illuminance = sun_radiance(60, 3) @ LUMINANCE * SUN_SOLID_ANGLE
    assert 80 < illuminance < 110
    # More air, and dirtier air, dim and redden the sun.
    high, low, hazy = sun_radiance(60, 3), sun_radiance(10, 3), sun_radiance(60, 6)
    assert (low < high).all()
    assert (hazy < high).all()
    assert low[2] / low[0] < hazy[2] / hazy[0] < high[2] / high[0] < 1


@pytest.mark.parametrize(
    ("elevation", "low", "high"), [(60, 28, 35), (30, 20, 27), (10, 12, 17), (0, 7, 11)]
)
def test_sky_illuminance(elevation, low, high):
    upper = latlong_directions(256, 128)[:64]
    radiance = sky_radiance(upper, from_azimuth_elevation(0, elevation), 3)
    weights = latlong_solid_angles(128)[:64, None] * upper[..., 1]
    assert low < (weights * (radiance @ LUMINANCE)).sum() < high


@pytest.mark.parametrize("turbidity", [1.7, 3.0, 6.0, 10.0])
@pytest.mark.parametrize("elevation", [0, 20, 55])
def test_zenith_has_the_luminance_of_the_formula(turbidity, elevation):
    theta = np.radians(90 - elevation)
    chi = (4 / 9 - turbidity / 120) * (np.pi - 2 * theta)
    formula = (4.0453 * turbidity - 4.9710) * np.tan(chi) - 0.2155 * turbidity + 2.4192
    assert zenith_luminance(turbidity, theta) == pytest.approx(formula, rel=1e-12)
    sun = from_azimuth_elevation(130, elevation)
    radiance = sky_radiance(np.array([0.0, 1.0, 0.0]), sun, turbidity)
    assert radiance @ LUMINANCE == pytest.approx(formula, rel=1e-5)
    # The image's top row is half a texel off the zenith on every side.
    top = sky(256, 130, elevation, turbidity)[0].mean(axis=0, dtype=float)
    assert top @ LUMINANCE == pytest.approx(formula, rel=2e-3)


@pytest.mark.parametrize(
    ("azimuth", "elevation", "luminance", "x", "y"),
    # A calculation apart, with the five-digit coefficients in circulation: turbidity 3, the sun
    # at azimuth 0, elevation 35.
    [
        (0, 90, 5.8035, 0.2440, 0.2507),
        (0, 35, 30.1933, 0.2937, 0.3075),
        (40, 20, 13.3384, 0.2808, 0.2905),
        (180, 10, 7.3421, 0.2823, 0.2992),
        (90, 60, 5.8439, 0.2444, 0.2523),
    ],
)
def test_sky_has_the_luminance_and_chromaticity_of_the_paper(azimuth, elevation, luminance, x, y):
    sun = from_azimuth_elevation(0, 35)
    radiance = sky_radiance(from_azimuth_elevation(azimuth, elevation), sun, 3)
    xyz = xyz_matrix(None) @ radiance
    np.testing.assert_allclose(xyz[1], luminance, rtol=2e-3)
    np.testing.assert_allclose(xyz[:2] / xyz.sum(), [x, y], atol=1e-3)


def test_zenith_is_blue_and_brightest_around_the_sun():
    sun = from_azimuth_elevation(40, 35)
    upper = latlong_directions(256, 128)[:64]
    radiance = sky_radiance(upper, sun, 3)
    assert radiance[0, 0, 2] > 1.5 * radiance[0, 0, 0]
    brightest = np.unravel_index((radiance @ LUMINANCE).argmax(), upper.shape[:2])
    assert upper[brightest] @ sun > np.cos(np.radians(4))


@pytest.mark.parametrize("turbidity", [1.7, 2.0, 5.0, 10.0])
@pytest.mark.parametrize("elevation", [0, 2, 45, 90])
def test_radiance_is_finite_and_not_negative_over_the_range(turbidity, elevation):
    image = sky(32, 10, elevation, turbidity)
    assert np.isfinite(image).all()
    assert image.min() >= 0
    assert (image @ LUMINANCE).min() > 0


@pytest.mark.parametrize("size", [32, 64, 101, 128, 256, 512])
@pytest.mark.parametrize(("azimuth", "elevation"), [(45, 60), (180, 3), (0, 90)])
def test_sun_has_the_same_energy_at_every_size(size, azimuth, elevation):
    image = sky(size, azimuth, elevation, ground_albedo=0).astype(float)
    rows = (size + 1) // 2
    background = sky_radiance(
        latlong_directions(2 * size, size)[:rows], from_azimuth_elevation(azimuth, elevation), 3
    )
    if size % 2:
        background[-1] /= 2  # half of the middle row is black ground
    image[:rows] -= background
    integral = latlong_solid_angles(size) @ image.sum(axis=1)
    expected = sun_radiance(elevation, 3) * SUN_SOLID_ANGLE
    # What the subtraction leaves of float32's rounding: 2e-8 of the sky's light.
    np.testing.assert_allclose(integral, expected, rtol=3e-7, atol=2e-6)


def test_half_of_a_setting_sun_is_left():
    image = sun_only(256, 20, 0)
    integral = latlong_solid_angles(256) @ image.sum(axis=1)
    np.testing.assert_allclose(
        integral, sun_radiance(0, 3) * SUN_SOLID_ANGLE / 2, rtol=1e-3, atol=1e-8
    )
    assert not image[128:].any()


@pytest.mark.parametrize(("azimuth", "elevation"), [(45, 60), (-120, 15), (179.9, 40), (90, 85)])
def test_sun_is_where_it_is_asked(azimuth, elevation):
    size = 512
    image = sun_only(size, azimuth, elevation).sum(axis=-1)
    sun = from_azimuth_elevation(azimuth, elevation)
    directions = latlong_directions(2 * size, size)
    bright = image > 1
    assert bright.any()
    # Disc and texel together: no light farther off than the radius and half a diagonal.
    farthest = np.arccos(np.clip(directions[bright] @ sun, -1, 1)).max()
    assert farthest < SUN_RADIUS + np.pi / size / np.sqrt(2) * 1.01
    weights = image * bright * latlong_solid_angles(size)[:, None]
    centre = (weights[..., None] * directions).sum((0, 1)) / weights.sum()
    assert np.degrees(np.linalg.norm(centre / np.linalg.norm(centre) - sun)) < 0.1


def test_sun_disc_samples_cover_the_disc_evenly():
    sun = from_azimuth_elevation(30, 50)
    cosine = sun_disc_samples(sun) @ sun
    assert cosine.min() > np.cos(SUN_RADIUS) - 1e-12
    # Equal areas: the inner disc of half the area holds half of the samples.
    inner = (1 - cosine) < (1 - np.cos(SUN_RADIUS)) / 2
    assert inner.mean() == pytest.approx(0.5, abs=1e-4)


def test_sun_at_the_pole_is_even_around_it():
    image = sun_only(512, 0, 90)[0, :, 1]
    assert image.std() < 0.05 * image.mean()


@pytest.mark.parametrize("size", [64, 65])
def test_ground_reflects_sky_and_sun(size):
    albedo, elevation = 0.3, 50
    image = sky(size, 0, elevation, 3, albedo)
    ground = image[-1, 0].astype(float)
    assert (image[(size + 1) // 2 :] == image[-1, 0]).all()
    assert not sky(size, 0, elevation, 3, 0)[(size + 1) // 2 :].any()
    # The same integral, by another rule over another grid.
    directions = latlong_directions(720, 360)[:180]
    weight = latlong_solid_angles(360)[:180, None] * directions[..., 1]
    sun = from_azimuth_elevation(0, elevation)
    diffuse = np.einsum("ij,ijc->c", weight, sky_radiance(directions, sun, 3))
    direct = sun_radiance(elevation, 3) * SUN_SOLID_ANGLE * np.sin(np.radians(elevation))
    np.testing.assert_allclose(ground, albedo / np.pi * (diffuse + direct), rtol=2e-3)


def test_azimuth_turns_the_image():
    size = 64
    turned = np.roll(sky(size, 0, 30), -size // 2, axis=1)  # +X is left of +Z
    np.testing.assert_allclose(sky(size, 90, 30), turned, rtol=1e-4)
    row, column = latlong_texels(from_azimuth_elevation(90, 30), size)
    assert sky(size, 90, 30)[row, column, 1] > 1000


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"sun_elevation": -5}, "0 to 90"),
        ({"sun_elevation": 91}, "0 to 90"),
        ({"sun_elevation": np.nan}, "0 to 90"),
        ({"sun_azimuth": np.inf}, "azimuth"),
        ({"turbidity": 1.6}, "1.7 to 10"),
        ({"turbidity": 11}, "1.7 to 10"),
        ({"ground_albedo": 1.1}, "0 to 1"),
        ({"size": 1}, "at least 2"),
    ],
)
def test_bad_parameters_are_refused_in_one_line(parameters, words):
    arguments = {"size": 16, "sun_azimuth": 0, "sun_elevation": 30, **parameters}
    with pytest.raises(ProbeError, match=words) as caught:
        sky(**arguments)
    assert "\n" not in str(caught.value)
