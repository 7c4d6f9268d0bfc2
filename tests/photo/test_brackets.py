"""Exposures by a camera with a curve and noise, and the light that is found of them."""

import numpy as np
import pytest

from shrm_cli.errors import ArgumentError, ProbeError
from shrm_cli.photo.brackets import LEVELS, merge_brackets
from tests.cli.helpers import write_exr
from tests.photo.camera import contrasty, srgb, write_exposure

TIMES = 4.0 ** np.arange(-2, 3) / 4
HEIGHT, WIDTH = 96, 128


@pytest.fixture(scope="module")
def scene():
    """Return light over five decades, whose colours differ, shape (HEIGHT, WIDTH, 3)."""
    x, y = np.meshgrid(np.linspace(-1, 1, WIDTH), np.linspace(-1, 1, HEIGHT))
    logarithm = 2.5 * x + 1.5 * np.sin(4 * y) + 0.3 * np.cos(9 * x * y)
    return np.exp(logarithm[..., None] + 0.3 * y[..., None] * np.array([1, 0, -1]))


def taken(folder, scene, curve, suffix="png", **camera):
    paths = [folder / f"{k}.{suffix}" for k in range(len(TIMES))]
    for k, (path, time) in enumerate(zip(paths, TIMES, strict=True)):
        write_exposure(path, scene, time, curve, k, **camera)
    return paths


def error_of(pixels, scene):
    """Relative errors where some exposure is neither black nor white, and the scale."""
    shown = (scene * 100 / 64 * TIMES[0] < 0.9) & (scene * 100 / 64 * TIMES[-1] > 0.02)
    ratio = pixels[shown] / scene[shown]
    scale = np.median(ratio)
    return np.abs(ratio / scale - 1), scale


@pytest.mark.parametrize("curve", [srgb, contrasty, lambda light: light**0.4])
def test_light_is_found_whatever_the_curve_is(tmp_path, scene, curve):
    paths = taken(tmp_path, scene, curve)
    made = merge_brackets(paths[::-1])
    error, scale = error_of(made.pixels, scene)
    assert np.median(error) < 0.015
    assert np.quantile(error, 0.95) < 0.06
    # The middle of the numbers is where it is of sRGB.
    light = np.linspace(0, 1, 4001)
    middle = np.interp(0.5, curve(light), light)
    assert scale == pytest.approx(100 / 64 * TIMES[2] * 0.2140 / middle, rel=0.03)
    np.testing.assert_allclose(made.exposures, TIMES / TIMES[2], rtol=1e-5)
    assert (np.diff(made.curve) >= 0).all()
    assert made.curve.shape == (LEVELS,)
    white = (scene * 100 / 64 * TIMES[0] > 1).any(axis=-1).mean()
    assert made.clipped == pytest.approx(white, abs=0.01)
    # Colours have no cast, though the curve is only known up to a factor.
    for channel in range(3):
        assert error_of(made.pixels[..., channel], scene[..., channel])[1] == pytest.approx(
            scale, rel=0.02
        )


@pytest.mark.parametrize("lamp", [30, 2000])
def test_a_sun_that_is_white_in_all_exposures_has_no_holes(tmp_path, scene, lamp):
    """Noise makes white less than white, in the longest exposure as in the shortest: of 12.6 it
    made .07 to 18."""
    light = scene.copy()
    light[40:60, 50:90] = lamp
    made = merge_brackets(taken(tmp_path, light, srgb))
    white = made.pixels[40:60, 50:90]
    assert white.min() > 0.9 * white.max()


def held_down(light):
    """The curve of sRGB, by a program that writes white as 240 of 255."""
    return srgb(light) * 240 / 255


@pytest.mark.parametrize("suffix", ["png", "jpg"])
def test_white_may_be_held_down(tmp_path, scene, suffix):
    made = merge_brackets(taken(tmp_path, scene, held_down, suffix))
    error, _ = error_of(made.pixels, scene)
    assert np.median(error) < 0.015
    assert np.quantile(error, 0.95) < 0.06
    assert made.white == pytest.approx(240 / 255, abs=0.004)
    assert np.nanmax(made.differences) < 0.03


def test_a_bright_wall_is_not_white(tmp_path, scene):
    """It is the brightest that the longest exposure shows, and darker in the one before."""
    scene = np.minimum(scene, 0.8 * 64 / 100 / TIMES[-1])
    made = merge_brackets(taken(tmp_path, scene, srgb))
    assert made.white == 1
    assert np.median(error_of(made.pixels, scene)[0]) < 0.015


def test_a_bright_wall_is_not_white_where_the_longest_exposure_was_taken_twice(tmp_path, scene):
    """White was taken to be .74 then, the number of the wall, and what is brighter to be lost."""
    scene = np.minimum(scene, 0.5 * 64 / 100 / TIMES[-1])
    paths = taken(tmp_path, scene, srgb)
    again = tmp_path / "again.png"
    write_exposure(again, scene, 1.01 * TIMES[-1], srgb, 7)
    made = merge_brackets([*paths, again])
    assert made.white == 1
    assert np.quantile(error_of(made.pixels, scene)[0], 0.95) < 0.035


@pytest.mark.parametrize(("around", "stuck"), [(1 / 15, 0), (1 / 45, 1)])
def test_white_pixels_are_lamps_where_lenses_spread_their_light(tmp_path, around, stuck):
    """A fifth of a lamp's light is beside it, which is white in sixteen times the light; what is
    darker there is no lamp's, though it is white in sixty-four times the light."""
    paths, times = [], np.array([1.0, 8.0, 16.0, 64.0])
    light = np.full((HEIGHT, WIDTH, 3), 0.001)
    light[39:42, 59:62] = 1.1 * around
    light[40, 60] = 1.1
    for time in times:
        paths.append(tmp_path / f"{time:g}.exr")
        write_exr(paths[-1], np.minimum(light * time, 1).astype(np.float32))
    made = merge_brackets(paths, times)
    assert made.stuck == stuck
    assert (made.pixels[40, 60] > 0.99 * 16).all() == (stuck == 0)  # relative to the third


def blurred(light):
    """Light as a sharp lens and a sensor show it: a quarter in the pixels beside its own."""
    for axis in (0, 1):
        light = 0.8 * light + 0.1 * (np.roll(light, 1, axis) + np.roll(light, -1, axis))
    return light


@pytest.mark.parametrize("halo", [0.0, 0.5])
def test_pixels_that_are_stuck_are_no_lamps(tmp_path, halo):
    """They were as bright as the shortest exposure can show, 30 times what is around them."""
    rng = np.random.default_rng(5)
    light = blurred(0.3 * np.exp(0.2 * rng.normal(size=(HEIGHT, WIDTH, 3))))
    light[30, 60] += 60  # a lamp of one pixel, and one of many
    light[60:70, 100:110] = 60
    light = blurred(light)
    clean = merge_brackets(taken(tmp_path, light, srgb))
    numbers = np.zeros(light.shape)
    for row, column in [(0, 0), (50, 20), (95, 127), (80, 64)]:
        numbers[max(row - 1, 0) : row + 2, max(column - 1, 0) : column + 2] = halo
        numbers[row, column, 0] = 1.1
    made = merge_brackets(taken(tmp_path, light, srgb, stuck=numbers))
    assert (clean.stuck, made.stuck, made.clipped) == (0, 4, clean.clipped)
    np.testing.assert_allclose(made.pixels, clean.pixels, rtol=0.8)
    lit = clean.pixels > 5
    assert lit.sum() > 300
    np.testing.assert_allclose(made.pixels[lit], clean.pixels[lit], rtol=0.05)


def test_the_curve_is_that_of_the_camera(tmp_path, scene):
    made = merge_brackets(taken(tmp_path, scene, contrasty))
    light = np.linspace(0, 1, 4001)
    truth = np.log(np.interp(np.arange(LEVELS) / (LEVELS - 1), contrasty(light), light)[12:245])
    found = made.curve[12:245]
    np.testing.assert_allclose(found - found[110], truth - truth[110], atol=0.12)


def test_linear_integers_need_no_curve(tmp_path, scene):
    paths = taken(tmp_path, scene, lambda light: light, "tif", bits=16)
    made = merge_brackets(paths, linear=True)
    assert made.curve is None
    error, scale = error_of(made.pixels, scene)
    assert np.median(error) < 0.015
    assert scale == pytest.approx(100 / 64 * TIMES[2], rel=0.01)


def test_floats_are_linear(tmp_path, scene):
    """What is white in one exposure is taken from the others, and it is exact."""
    paths = [tmp_path / f"{k}.exr" for k in range(3)]
    times = [0.1, 1.0, 5.0]
    for path, time in zip(paths, times, strict=True):
        write_exr(path, np.minimum(scene * time, 1).astype(np.float32))
    made = merge_brackets(paths, times)
    assert made.curve is None
    held = scene < 10
    np.testing.assert_allclose(made.pixels[held], scene[held], rtol=1e-5)
    # What is white in all is at least as bright as the shortest exposure tells.
    np.testing.assert_allclose(made.pixels[~held], 10, rtol=1e-5)
    assert made.clipped == pytest.approx((~held).any(axis=-1).mean(), abs=1e-3)


def test_aperture_and_sensitivity_are_exposure(tmp_path, scene):
    """A quarter of the light enters in the same time, and counts sixteen times as much."""
    write_exposure(tmp_path / "a.png", scene, 0.25, srgb, 0)
    write_exposure(tmp_path / "b.png", scene, 0.25, srgb, 1, sensitivity=1600, aperture=16.0)
    made = merge_brackets([tmp_path / "b.png", tmp_path / "a.png"])
    np.testing.assert_allclose(made.exposures, [0.25, 1], rtol=1e-5)


def test_exposures_that_show_the_same_agree(tmp_path, scene):
    paths = taken(tmp_path, scene, contrasty)
    made = merge_brackets(paths[::-1])
    assert made.paths == tuple(str(each) for each in paths)
    assert (made.differences < 0.05).all()
    assert made.differences[0] == 0


@pytest.mark.parametrize("linear", [False, True])
def test_times_that_are_mixed_up_and_what_moved_are_told(tmp_path, scene, linear):
    """Both were merged without a word."""
    curve, kind = (np.asarray, {"suffix": "tif", "bits": 16}) if linear else (srgb, {})
    paths = taken(tmp_path, scene, curve, **kind)
    mixed = merge_brackets(paths, TIMES[[0, 2, 1, 3, 4]], linear)
    assert np.nanmax(mixed.differences) > 0.5
    write_exposure(paths[2], scene[:, ::-1], TIMES[2], curve, 9, bits=kind.get("bits", 8))
    moved = merge_brackets(paths, linear=linear)
    assert (moved.differences[[2, 3]] > 0.2).all()
    assert moved.differences[1] < 0.05 or not linear  # of which no curve is made


def test_exposures_too_far_apart_cannot_be_compared(tmp_path, scene):
    paths = taken(tmp_path, scene, srgb)
    assert np.isnan(merge_brackets([paths[0], paths[4]], [0.0001, 1]).differences[1])


@pytest.mark.parametrize(
    ("times", "error", "words"),
    [
        ([1.0], ArgumentError, "`times` must be as many as exposures, which are 2"),
        ([1.0, -1.0], ArgumentError, "`times` must be positive"),
        ([1.0, np.nan], ArgumentError, "`times` must be positive"),
        ([2.0, 2.0], ArgumentError, "and not all the same"),
        (None, ProbeError, r"a\.exr: its Exif does not say its exposure time; give `times`"),
        ([1.0, 2.0], ProbeError, r"b\.exr: 6 x 4 pixels, but .*a\.exr has 4 x 4"),
    ],
)
def test_exposures_of_no_use_are_refused(tmp_path, times, error, words):
    write_exr(tmp_path / "a.exr", np.ones((4, 4, 3), np.float32))
    write_exr(tmp_path / "b.exr", np.ones((4, 6, 3), np.float32))
    with pytest.raises(error, match=words):
        merge_brackets([tmp_path / "a.exr", tmp_path / "b.exr"], times)
