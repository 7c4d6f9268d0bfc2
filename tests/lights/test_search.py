"""What counts as a lamp: pieces of plain images, on both sides of every threshold."""

import numpy as np
import pytest

from shrm_cli.lights.pixels import SpherePixels
from shrm_cli.lights.search import find_regions
from shrm_cli.probe.probe import Probe
from tests import oracles

HEIGHT = 192
MIDDLE = (slice(95, 98), slice(60, 64))
"""Twelve pixels about the equator, each about a square of the mean area."""


def regions(brightness):
    image = np.repeat(brightness[..., None], 3, axis=2).astype(np.float32)
    return find_regions(image, SpherePixels(Probe.from_array(image).grid), 1e-4)


def lit(brightness, where=MIDDLE):
    image = np.ones((HEIGHT, 2 * HEIGHT))
    image[where] = brightness
    return image


def disc(degrees):
    cosines = oracles.latlong_pixels(2 * HEIGHT, HEIGHT) @ np.array([0.0, 0.0, 1.0])
    return cosines > np.cos(np.radians(degrees))


@pytest.mark.parametrize(("brightness", "count"), [(33, 0), (36, 1)])
def test_lamps_are_sixteen_times_above_twice_what_is_around_them(brightness, count):
    """34 or more beside 1."""
    assert len(regions(lit(brightness))) == count


@pytest.mark.parametrize(("brightness", "count"), [(51, 0), (57, 1)])
def test_a_sun_hardly_raises_what_others_stand_out_of(brightness, count):
    """It covers .4 % of the sphere: the mean of 38 counts as 1.6 when it is dimmed to four times
    that, and as 1.3 when to twice."""
    image = lit(brightness)
    image[disc(7)] = 1e4
    assert len(regions(image)) == 1 + count


def test_the_largest_number_of_a_pixel_is_a_lamp():
    """The sum of its three channels has no 32-bit number."""
    assert len(regions(lit(3e38))) == 1


@pytest.mark.parametrize(("degrees", "is_compact"), [(5.7, True), (6.3, False)])
def test_a_glow_of_eight_times_its_area_is_of_the_lamp(degrees, is_compact):
    image = lit(1)
    lamp, glow = disc(2), disc(degrees)
    image[glow], image[lamp] = 4, 1000
    (found,) = regions(image)
    assert len(found.numbers) == (glow if is_compact else lamp).sum()


@pytest.mark.parametrize(("columns", "count"), [(4, 12), (5, 1)])
def test_what_a_filter_spreads_of_a_point_is_of_the_lamp(columns, count):
    """Nearly all the light is in one pixel, and twelve are compact nevertheless."""
    image = lit(5, (slice(95, 98), slice(60, 60 + columns)))
    image[96, 61] = 1e4
    (found,) = regions(image)
    assert len(found.numbers) == count


@pytest.mark.parametrize(("degrees", "count"), [(7.8, 1), (8.3, 0)])
def test_lamps_are_discs_of_eight_degrees_at_most(degrees, count):
    assert len(regions(lit(1000, disc(degrees)))) == count


def test_lamps_beside_each_other_are_two():
    """With two dark pixels between them, along an axis of the little cubes that join pixels."""
    image = lit(1000, (slice(95, 98), slice(188, 192)))
    image[95:98, 194:198] = 1000
    assert len(regions(image)) == 2


@pytest.mark.parametrize(("brightness", "is_lamp"), [(5, True), (4, False)])
def test_a_lamp_is_cut_out_of_a_glow_just_above_it(brightness, is_lamp):
    """The glow of 4 is too large. What is a little brighter, about the lamp, is of the lamp."""
    image = lit(1)
    lamp, halo = disc(2), disc(4)
    image[disc(12)], image[halo], image[lamp] = 4, brightness, 1000
    (found,) = regions(image)
    assert len(found.numbers) == (halo if is_lamp else lamp).sum()
