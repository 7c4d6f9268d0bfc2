"""Spectra to linear sRGB, against colour-science's own pipeline and known colours."""

import numpy as np
import pytest

from shrm_cli.brdf.measured.reading import spectrum
from shrm_cli.brdf.measured.reading.spectrum import to_linear_srgb
from shrm_cli.errors import BrdfError

VISIBLE = np.arange(400.0, 701.0, 10.0)


def by_colour_science(colour, wavelengths, values):
    """sd_to_XYZ's integration, then its sRGB without the transfer curve, white at D65."""
    shape = colour.SpectralShape(360, 780, 1)
    cmfs = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"].copy().align(shape)
    daylight = colour.SDS_ILLUMINANTS["D65"].copy().align(shape)
    sd = colour.SpectralDistribution(
        np.interp(shape.wavelengths, wavelengths, values), shape.wavelengths
    )
    xyz = colour.sd_to_XYZ(sd, cmfs, daylight, method="Integration", shape=shape)
    return colour.XYZ_to_sRGB(xyz / 100, apply_cctf_encoding=False)


@pytest.mark.parametrize(
    "reflectance",
    [
        lambda w: np.full_like(w, 0.3),
        lambda w: 1 / (1 + np.exp(-(w - 590) / 12)),  # red
        lambda w: np.exp(-(((w - 450) / 40) ** 2)),  # blue, out of gamut
        lambda w: 0.5 + 0.4 * np.sin(w / 37),
    ],
)
def test_agrees_with_colour_science(colour, reflectance):
    values = reflectance(VISIBLE)
    expected = by_colour_science(colour, VISIBLE, values)
    # Illuminant and primaries are rounded to four digits in the standards, so the two whites
    # differ by as much.
    np.testing.assert_allclose(to_linear_srgb(VISIBLE, values), expected, atol=4e-4)


def test_the_table_is_that_of_colour_science(colour):
    at, *observer, daylight = np.loadtxt(spectrum._TABLE, delimiter=",", unpack=True)
    known = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
    np.testing.assert_array_equal(at, known.wavelengths)
    np.testing.assert_allclose(np.stack(observer, axis=-1), known.values, rtol=1e-9)
    illuminant = colour.SDS_ILLUMINANTS["D65"]
    there = np.isin(at, illuminant.wavelengths)
    assert there.sum() == 85  # every fifth from 360 to 780 nm
    np.testing.assert_allclose(daylight[there], illuminant[at[there]], rtol=1e-9)
    np.testing.assert_array_equal(
        spectrum._XYZ_TO_SRGB, colour.RGB_COLOURSPACES["sRGB"].matrix_XYZ_to_RGB
    )


def test_white_is_white_and_the_map_is_linear(rng):
    np.testing.assert_allclose(to_linear_srgb(VISIBLE, np.ones(31)), 1, rtol=1e-13)
    a, b = rng.random((2, 4, 31))
    mixed = to_linear_srgb(VISIBLE, 2 * a - b)
    np.testing.assert_allclose(mixed, 2 * to_linear_srgb(VISIBLE, a) - to_linear_srgb(VISIBLE, b))


def test_colorchecker_patches_keep_their_colour(colour):
    """Spectra of the chart (BabelColor average) against its published sRGB, 8 bit."""
    published = {
        "dark skin": (115, 82, 68),
        "light skin": (194, 150, 130),
        "blue sky": (98, 122, 157),
        "orange": (214, 126, 44),
        "green": (70, 148, 73),
        "red": (175, 54, 60),
        "yellow": (231, 199, 31),
        "neutral 5 (.70 D)": (122, 122, 121),
    }
    chart = colour.SDS_COLOURCHECKERS["BabelColor Average"]
    for patch, expected in published.items():
        linear = to_linear_srgb(chart[patch].wavelengths, chart[patch].values)
        srgb = 255 * colour.cctf_encoding(np.clip(linear, 0, 1), function="sRGB")
        # Published for D50, adapted, and for other specimens of the chart.
        np.testing.assert_allclose(srgb, expected, atol=8, err_msg=patch)


def test_beyond_the_wavelengths_spectra_are_constant():
    wide = np.concatenate([[300.0], VISIBLE, [900.0]])
    values = np.linspace(0.1, 0.8, 31)
    np.testing.assert_allclose(
        to_linear_srgb(VISIBLE, values),
        to_linear_srgb(wide, np.concatenate([values[:1], values, values[-1:]])),
        rtol=1e-12,
    )
    np.testing.assert_allclose(to_linear_srgb([532.0], [[0.7], [0.2]]), [[0.7] * 3, [0.2] * 3])
    np.testing.assert_allclose(to_linear_srgb([900.0, 1000.0], [0.4, 0.9]), 0.4)


def test_order_of_wavelengths_does_not_matter(rng):
    values, order = rng.random((5, 31)), rng.permutation(31)
    np.testing.assert_allclose(
        to_linear_srgb(VISIBLE[order], values[:, order]), to_linear_srgb(VISIBLE, values)
    )


def test_precision_is_kept():
    assert to_linear_srgb(VISIBLE, np.ones((2, 31), np.float32)).dtype == np.float32
    assert to_linear_srgb(VISIBLE, np.ones((2, 31), int)).dtype == np.float64


@pytest.mark.parametrize("wavelengths", [[500, np.nan], [500, 500], [0, 500], [-1, 2], []])
def test_refuses_wavelengths_that_are_none(wavelengths):
    with pytest.raises(BrdfError, match="wavelength"):
        to_linear_srgb(wavelengths, np.ones(len(wavelengths)))


def test_refuses_values_of_another_length():
    with pytest.raises(ValueError, match="shape"):
        to_linear_srgb([400, 500], [1, 2, 3])
