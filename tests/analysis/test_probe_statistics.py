"""Statistics of probes against sums over pixels and known lights."""

import json

import numpy as np
import pytest

from shrm_cli.analysis.probe_statistics import AXES, probe_statistics
from shrm_cli.files.png import encode_srgb, write_png
from shrm_cli.probe.open import open_probe
from shrm_cli.probe.probe import Probe
from tests import oracles
from tests.lights import rooms
from tests.lights.rooms import probe, room, round_lamp, unit

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
NORMALS = {"+X": [1, 0, 0], "-X": [-1, 0, 0], "+Y": [0, 1, 0], "-Y": [0, -1, 0],
           "+Z": [0, 0, 1], "-Z": [0, 0, -1]}  # fmt: skip


def pixels_of(height):
    edges = np.cos(np.pi * np.arange(height + 1) / height)
    areas = np.repeat((edges[:-1] - edges[1:]) * np.pi / height, 2 * height)
    return oracles.latlong_pixels(2 * height, height).reshape(-1, 3), areas


def test_against_sums_over_pixels():
    image = rooms.latlong(96, room((round_lamp(unit(0.3, 0.5, 0.7), 4.0), [300, 200, 100])))
    found = probe_statistics(Probe.from_array(image))
    directions, areas = pixels_of(96)
    light = image.reshape(-1, 3).astype(float)
    np.testing.assert_array_equal(found.minimum, light.min(axis=0))
    np.testing.assert_array_equal(found.maximum, light.max(axis=0))
    mean = areas @ light / (4 * np.pi)
    np.testing.assert_allclose(found.mean, mean, rtol=2e-4)
    assert found.mean_luminance == pytest.approx(mean @ LUMINANCE, rel=1e-3)
    for name, value in zip(AXES, found.irradiance, strict=True):
        cosines = np.maximum(directions @ np.array(NORMALS[name]), 0)
        np.testing.assert_allclose(value, (cosines * areas) @ light, rtol=0, atol=0.01)
    luminance = light @ LUMINANCE
    order = np.argsort(luminance)
    below = np.cumsum(areas[order]) / areas.sum()
    low, high = luminance[order][np.searchsorted(below, [0.01, 0.999])]
    assert found.stops == pytest.approx(np.log2(high / low), abs=0.06)
    assert found.stops_whole == pytest.approx(np.log2(luminance.max() / luminance.min()), abs=1e-3)
    vector = (areas * luminance) @ directions / (areas @ luminance)
    assert found.directionality == pytest.approx(np.linalg.norm(vector), rel=1e-3)
    np.testing.assert_allclose(found.direction, vector / np.linalg.norm(vector), rtol=0, atol=1e-3)
    assert len(found.lamps) == 1
    json.dumps(found.summary(), allow_nan=False)


def test_a_sun_lights_nothing_behind_it():
    """What its expansion leaves on the dark side was a sixth of the irradiance of the sky."""
    image = np.full((128, 256, 3), 0.1, np.float32)
    image[30, 150] = 2.5e5
    directions, areas = pixels_of(128)
    for part in (np.s_[:], np.s_[:64]):  # the sky, and the half of it that is above the ground
        light = np.zeros_like(image)
        light[part] = image[part]
        found = probe_statistics(Probe.from_array(light))
        for name, value in zip(AXES, found.irradiance, strict=True):
            cosines = np.maximum(directions @ np.array(NORMALS[name]), 0)
            truth = (cosines * areas) @ light.reshape(-1, 3).astype(float)
            np.testing.assert_allclose(value, truth, rtol=0.01, atol=1e-3)


@pytest.mark.parametrize("height", [2, 8])
@pytest.mark.parametrize("is_even", [False, True])
def test_large_pixels_are_no_points(rng, height, is_even):
    """Of 4 x 2 pixels the irradiance of the ground was off by a tenth, as that of eight points.

    Even halves have no degrees across, and their sums too much energy of those along: the ground
    had 0.58 in place of 1.57.
    """
    image = rng.uniform(0, 1, (height, 2 * height, 3)).astype(np.float32)
    if is_even:
        image[:] = np.where(np.arange(height) < height // 2, 1, 0.5)[:, None, None]
    found = probe_statistics(Probe.from_array(image), lamps=0)
    directions, areas = pixels_of(256)
    times = 256 // height
    light = image.repeat(times, axis=0).repeat(times, axis=1).reshape(-1, 3).astype(float)
    for name, value in zip(AXES, found.irradiance, strict=True):
        cosines = np.maximum(directions @ np.array(NORMALS[name]), 0)
        np.testing.assert_allclose(value, (cosines * areas) @ light, rtol=0.01)


def test_light_of_one_kind():
    """A white furnace: no range, no direction, the white of its primaries, E = pi."""
    found = probe_statistics(Probe.from_array(np.ones((32, 64, 3), np.float32)))
    assert (found.stops, found.stops_whole, found.clipped, found.lamps) == (0, 0, "", ())
    np.testing.assert_allclose(found.irradiance, np.pi, rtol=1e-6)
    np.testing.assert_array_equal(found.direction, 0)
    assert found.chromaticity == pytest.approx((0.3127, 0.329), abs=1e-6)
    assert found.temperature == pytest.approx(6504, abs=5)
    assert found.primaries == "not stated; taken for Rec.709"


def test_black_is_no_reason_to_fail():
    found = probe_statistics(Probe.from_array(np.zeros((16, 32, 3), np.float32)))
    assert (found.temperature, found.chromaticity, found.stops_whole) == (None, None, 0)
    json.dumps(found.summary(), allow_nan=False)


def test_light_from_one_direction():
    axis = unit(-0.4, 0.3, 0.8)
    bright = 1e6 * (np.linalg.norm(rooms_pixels() - axis, axis=-1) < 0.06)
    found = probe_statistics(Probe.from_array(np.repeat(bright[..., None], 3, 2)))
    assert found.directionality == pytest.approx(1, abs=5e-3)
    np.testing.assert_allclose(found.direction, axis, atol=0.02)
    turned = probe_statistics(Probe.from_array(np.repeat(bright[..., None], 3, 2), mirror=True))
    np.testing.assert_allclose(turned.direction, axis * [-1, 1, 1], atol=0.02)


def rooms_pixels():
    return oracles.latlong_pixels(128, 64)


def test_other_primaries_have_other_luminances():
    acescg = (0.713, 0.293, 0.165, 0.83, 0.128, 0.044, 0.32168, 0.33767)
    image = np.tile(np.array([1, 0, 0], np.float32), (8, 16, 1))
    found = probe_statistics(Probe.from_array(image, chromaticities=acescg))
    assert found.primaries == "ACEScg"
    assert found.mean_luminance == pytest.approx(0.2722287, rel=1e-5)  # S-2014-004
    assert found.chromaticity == pytest.approx((0.713, 0.293))


def test_every_grid_says_the_same():
    found = {name: probe_statistics(probe(name)) for name in rooms.IMAGES}
    for each in found.values():
        np.testing.assert_allclose(each.mean, found["latlong"].mean, rtol=2e-3)
        np.testing.assert_allclose(each.irradiance, found["latlong"].irradiance, rtol=5e-3)
        assert each.stops == pytest.approx(found["latlong"].stops, abs=0.1)


def test_plateaus_are_suspected_and_peaks_are_not():
    near = rooms.latlong(96, lambda d: np.exp(60 * (d @ unit(1, 1, 1) - 1))[..., None] * [9, 8, 7])
    peak = np.asarray(near + rooms.bare("latlong"), dtype=np.float16).astype(np.float32)
    assert probe_statistics(Probe.from_array(peak), lamps=0).clipped == ""
    cut = np.minimum(peak, 5)
    assert "share the maximum 5 of R" in probe_statistics(Probe.from_array(cut), 0).clipped
    peak[40, 7, 1] = 65504
    assert "G reaches 65504" in probe_statistics(Probe.from_array(peak), 0).clipped


def test_integers_that_reach_their_end_are_clipped(tmp_path):
    """However much of the picture has it: a window may be a quarter of a panorama."""
    picture = np.full((32, 64, 3), 0.2, np.float32)
    picture[8:24, :20] = 0.9
    for scale in (1.0, 2.0):  # many pixels share the largest value, but only these are clipped
        write_png(tmp_path / "a.png", encode_srgb(scale * picture))
        found = probe_statistics(open_probe(tmp_path / "a.png", linearize=True), 0).clipped
        assert found.startswith("R reaches 1, the end of its integers, in 22.") == (scale == 2)
        assert bool(found) == (scale == 2)
