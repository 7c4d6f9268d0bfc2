"""Small lamps near the poles of a lat-long: pixels count by their solid angles."""

import json
from itertools import product

import numpy as np
import pytest

from shrm_cli.probe.lighting import project
from shrm_cli.probe.probe import Probe
from shrm_cli.probe.source import Source
from tests import oracles
from tests.cli.helpers import done
from tests.probe import scenes


def areas(height, sampling):
    """Solid angles of the pixels, from where their rows and columns meet."""
    s = np.array(oracles.positions(height, sampling))
    edges = np.concatenate([[-1], (s[1:] + s[:-1]) / 2, [1]]) * np.pi / 2
    t = np.array(oracles.positions(2 * height, sampling))
    sides = np.concatenate([[-1], (t[1:] + t[:-1]) / 2, [1]]) * np.pi
    return np.diff(np.sin(edges))[:, None] * np.diff(sides)


def dim(height):
    return np.full((height, 2 * height, 3), 0.1, np.float32)


def one_pixel(height):
    image = dim(height)
    image[0, 7] = (3e4, 2e4, 1e4)
    return image


def the_last_rows(height):
    image = dim(height)
    image[-2:] = (900, 500, 100)
    return image


def across_rows(height):
    image = dim(height)
    image[1:3, 5:9] = 5e3
    return image


@pytest.mark.parametrize("sampling", ["center", "border"])
@pytest.mark.parametrize(
    ("lamp", "height"),
    [(across_rows, 16), *product([one_pixel, the_last_rows, across_rows], [64, 256])],
)
def test_no_light_is_lost(lamp, height, sampling):
    """By the rule alone the first row would weigh .873 of its area, or .811 of it."""
    image = lamp(height)
    probe = Probe.from_array(image, "latlong", sampling=sampling)
    light = np.einsum("ijc,ij->c", image.astype(float), areas(height, sampling))
    found = project(probe, 8)
    tolerance = 5e-5 if height < 100 else 1e-5
    np.testing.assert_allclose(found.coefficients[0] * np.sqrt(4 * np.pi), light, rtol=tolerance)
    squares = np.einsum("ijc,ij->c", image.astype(float) ** 2, areas(height, sampling))
    np.testing.assert_allclose(found.energy, squares, rtol=2 * tolerance)
    sums = Source.of(probe, dtype=float).light.sum(axis=(0, 1))
    np.testing.assert_allclose(sums, found.coefficients[0] * np.sqrt(4 * np.pi), rtol=1e-5)


@pytest.mark.parametrize("sampling", ["center", "border"])
@pytest.mark.parametrize("height", [16, 64, 256])
def test_smooth_light_is_as_exact_as_before(height, sampling):
    """Light of degrees up to 4, though brightest at a pole: it does not stand out there."""

    def f(d):
        y = d[..., 1:2]
        return 1 + 0.9 * y + 0.7 * y**4 + 0.3 * d[..., :1] * y

    image = scenes.latlong(height, sampling, lambda d: np.repeat(f(d), 3, axis=-1))
    probe = Probe.from_array(image, "latlong", sampling=sampling)
    expected = scenes.project(lambda d: np.repeat(f(d), 3, axis=-1), 6)
    assert scenes.error(project(probe, 6).coefficients, expected) < 3e-7


def test_all_orders_of_a_lamp_are_of_one_size():
    """A pixel in the zenith is its light times a harmonic, whatever the order."""
    height = 128
    image = np.zeros((height, 2 * height, 3), np.float32)
    image[0, 100] = 1e4
    found = project(Probe.from_array(image, "latlong"), 30).coefficients
    light = 1e4 * areas(height, "center")[0, 0]
    direction = oracles.latlong_pixels(2 * height, height)[0, 100]
    expected = oracles.real_harmonics(30, direction) * light
    np.testing.assert_allclose(found[:, 0], expected, atol=1e-3 * np.abs(expected).max())


def test_the_mean_that_info_prints(tmp_path):
    image = the_last_rows(64)
    path = scenes.write(tmp_path / "a.exr", image)
    light = np.einsum("ijc,ij->c", image.astype(float), areas(64, "center"))
    mean = json.loads(done("info", str(path), "--json"))["mean"]
    np.testing.assert_allclose(mean, light / (4 * np.pi), rtol=4e-3)
