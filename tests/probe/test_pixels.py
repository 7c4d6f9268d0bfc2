"""NaN, negative and too bright pixels: what is done, and what is said."""

import numpy as np
import pytest

from shrm_cli.errors import ProbeError
from shrm_cli.probe.pixels import (
    PixelPolicy,
    PixelReport,
    fill_nonfinite,
    find_nonfinite,
    refuse_nonfinite,
)

NAN, INF = np.nan, np.inf


@pytest.fixture
def image(rng):
    return rng.uniform(0.1, 5, (12, 24, 3)).astype(np.float32)


def neighbours(row, column, height, width, wraps):
    """The eight places around a pixel, one at a time."""
    for y in range(row - 1, row + 2):
        for x in range(column - 1, column + 2):
            place = y, x % width if wraps else x
            if 0 <= y < height and (wraps or 0 <= x < width) and place != (row, column):
                yield place


def filled_by_hand(pixels, wraps):
    pixels = pixels.astype(float)
    height, width, _ = pixels.shape
    while not np.isfinite(pixels).all():
        before = pixels.copy()
        for row in range(height):
            for column in range(width):
                if np.isfinite(before[row, column]).all():
                    continue
                around = [before[k] for k in neighbours(row, column, height, width, wraps)]
                around = [value for value in around if np.isfinite(value).all()]
                if around:
                    pixels[row, column] = np.mean(around, axis=0)
    return pixels


def holes(image):
    """One pixel, a seam, a corner, a block three deep, a single channel."""
    image = image.copy()
    image[3, 7] = NAN
    image[6:8, 0] = INF
    image[7, -1] = (NAN, 1, 2)
    image[0, 0] = -INF
    image[4:11, 12:18] = NAN
    image[11, 20] = (1, 2, INF)
    return image


@pytest.mark.parametrize("wraps", [False, True])
def test_holes_are_filled_from_their_rims(image, wraps):
    damaged = holes(image)
    found = fill_nonfinite(damaged, wraps)
    np.testing.assert_allclose(found, filled_by_hand(damaged, wraps), rtol=1e-5)
    good = np.isfinite(damaged).all(axis=-1)
    np.testing.assert_array_equal(found[good], damaged[good])
    assert not np.isfinite(damaged).all()  # the argument is left alone


def test_wrapping_counts(image):
    image[5, 0] = NAN
    across = fill_nonfinite(image, wraps=True)[5, 0]
    np.testing.assert_allclose(
        across,
        (image[4:7:2, 0].sum(0) + image[4:7, 1].sum(0) + image[4:7, -1].sum(0)) / 8,
        rtol=1e-6,
    )
    assert np.abs(fill_nonfinite(image, wraps=False)[5, 0] - across).max() > 1e-3


def test_filling_to_a_depth(image):
    """A hole three deep needs three rounds."""
    image[3:8, 5:10] = NAN
    for rounds, left in ((0, 25), (1, 9), (2, 1), (3, 0), (9, 0)):
        found = fill_nonfinite(image, rounds=rounds)
        assert np.count_nonzero(np.isnan(found[..., 0])) == left
    whole = fill_nonfinite(image)
    np.testing.assert_array_equal(fill_nonfinite(image, rounds=3), whole)


def test_filling_only_from_what_is_used(image):
    used = np.ones(image.shape[:2], bool)
    used[:, :10] = False
    image[:, :10] = 1000
    image[2, 3] = image[5, 10] = NAN
    found = fill_nonfinite(image, used=used)
    assert np.isnan(found[2, 3]).all()
    np.testing.assert_allclose(
        found[5, 10], (image[4:7, 11].sum(0) + image[4, 10] + image[6, 10]) / 5, rtol=1e-6
    )


def test_islands_out_of_reach_stay_as_they_are(image):
    used = np.ones(image.shape[:2], bool)
    used[:, 10] = False
    image[:, :10] = NAN
    found = fill_nonfinite(image, used=used)
    np.testing.assert_array_equal(found, image)


def test_nothing_to_fill_from(image):
    assert np.isnan(fill_nonfinite(np.full_like(image, NAN))).all()


def test_filling_very_bright_neighbours(image):
    """Their sum does not overflow."""
    image[:] = 3e38
    image[5, 5] = INF
    np.testing.assert_allclose(fill_nonfinite(image), 3e38, rtol=1e-6)


def test_nonfinite_pixels_are_counted_once_each(image):
    report = PixelReport()
    assert find_nonfinite(image, 0, report) is None
    assert report == PixelReport()
    image[4, 9] = (NAN, INF, -INF)
    image[4, 20, 1] = INF
    image[11, 2, 2] = NAN
    bad = find_nonfinite(image, 100, report)
    assert list(zip(*np.nonzero(bad), strict=True)) == [(4, 9), (4, 20), (11, 2)]
    assert (report.nonfinite, report.first_nonfinite) == (3, (9, 104))
    find_nonfinite(image, 200, report)
    assert (report.nonfinite, report.first_nonfinite) == (6, (9, 104))


def test_bright_but_finite_pixels_are_no_error():
    """A float32 sum of them is infinite."""
    report = PixelReport()
    assert find_nonfinite(np.full((4, 4, 3), 3e38, np.float32), 0, report) is None
    assert report.nonfinite == 0


def test_refusal_names_count_and_first():
    refuse_nonfinite("a.exr", PixelReport())
    with pytest.raises(
        ProbeError,
        match=r"^a\.exr: 3 pixels are NaN or infinite, the first at column 9, row 4; give `fix_",
    ):
        refuse_nonfinite("a.exr", PixelReport(nonfinite=3, first_nonfinite=(9, 4)))


@pytest.mark.parametrize("columns", [1, 24])
def test_negative_radiance_is_clamped_to_zero(image, columns):
    weights = np.full((12, columns), 0.25)
    image[2, 3] = (-1, 2, 3)
    image[5, 6] = (-0.5, -7.5, 1)
    image[7, 7] = (0, -0.0, 0)
    report = PixelReport()
    found = PixelPolicy().apply(image, weights, report)
    np.testing.assert_array_equal(found, np.where(image < 0, 0, image))
    assert image.min() == -7.5  # the argument is left alone
    assert (report.negative, report.minimum) == (2, -7.5)
    assert report.energy == pytest.approx(0.25 * found.sum(dtype=float), rel=1e-12)
    (line,) = report.warnings()
    assert "2 pixels" in line
    assert "-7.5" in line
    PixelPolicy().apply(np.full_like(image, -1), weights, report)
    assert (report.negative, report.minimum) == (2 + 12 * 24, -7.5)


@pytest.mark.parametrize("columns", [1, 24])
def test_clamping_keeps_the_hue_and_counts_the_energy(image, rng, columns):
    weights = rng.uniform(0.5, 1, (12, columns))
    report = PixelReport()
    found = PixelPolicy(clamp=2.0).apply(image, weights, report)
    removed = total = count = 0.0
    for row in range(12):
        for column in range(24):
            pixel = image[row, column].astype(float)
            expected = pixel * min(1, 2 / pixel.max())
            np.testing.assert_allclose(found[row, column], expected, rtol=3e-7)
            weight = weights[row, column % columns]
            total += weight * pixel.sum()
            removed += weight * (pixel - expected).sum()
            count += pixel.max() > 2
    assert 0 < count < 12 * 24
    assert report.clamped == count
    assert report.energy == pytest.approx(total, rel=1e-9)
    assert report.energy_removed == pytest.approx(removed, rel=1e-6)
    (line,) = report.warnings()
    assert f"{int(count)} pixels" in line
    assert f"{removed / total:.3%}" in line


def test_clamping_what_is_not_too_bright(image):
    report = PixelReport()
    found = PixelPolicy(clamp=5.0).apply(image, np.ones((12, 1)), report)
    np.testing.assert_array_equal(found, image)
    assert (report.clamped, report.energy_removed, report.warnings()) == (0, 0, [])


def test_clamping_a_sun_reports_most_of_the_energy():
    image = np.full((64, 128, 3), 0.01, np.float32)
    image[10, 10] = (50000, 40000, 30000)
    report = PixelReport()
    found = PixelPolicy(clamp=10).apply(image, np.ones((64, 1)), report)
    np.testing.assert_allclose(found[10, 10], (10, 8, 6), rtol=1e-6)
    background = 0.01 * 3 * (64 * 128 - 1)
    share = (120000 - 24) / (120000 + background)
    assert report.energy_removed / report.energy == pytest.approx(share, rel=1e-6)


def test_a_black_probe_is_allowed_with_a_warning():
    report = PixelReport()
    PixelPolicy().apply(np.zeros((2, 4, 3), np.float32), np.ones((2, 1)), report)
    assert report.warnings() == ["the probe is black"]


def test_a_report_starts_again(image):
    report = PixelReport()
    image[0] = NAN
    find_nonfinite(image, 0, report)
    PixelPolicy(clamp=1).apply(np.abs(image[1:]) - 1, np.ones((11, 1)), report)
    assert report != PixelReport()
    report.clear()
    assert report == PixelReport()
