"""Discs that are fitted to a lamp, beside sums over its pixels that share no code with them."""

import numpy as np
import pytest

from shrm_cli.lights import fit
from shrm_cli.lights.fit import fitted_discs
from shrm_cli.lights.lamp import Light
from shrm_cli.probe.disc import Disc
from tests.brute_force import latlong_samples

AXIS = np.array([0.48, 0.6, 0.64])


def gaussian(order, width):
    """What each degree keeps of light that is blurred by about so many radians."""
    degree = np.arange(order + 1)
    return np.exp(-degree * (degree + 1) * width**2 / 2)


def lamp(radiance, rows=720, within=0.4):
    """The pixels about the axis; `radiance` tells it of x and y, in radians across and along."""
    directions, areas = latlong_samples(rows)
    near = directions @ AXIS > np.cos(within)
    directions, areas = directions[near], areas[near]
    across = np.cross([0, 1, 0], AXIS)
    across /= np.linalg.norm(across)
    x, y = directions @ across, directions @ np.cross(AXIS, across)
    values = np.broadcast_to(np.stack([radiance(x, y)] * 3, axis=1), directions.shape)
    lit = values[:, 0] != 0
    return Light(directions[lit], values[lit] * [1.0, 0.8, 0.6], areas[lit])


def blurred(directions, fluxes, at, width):
    """Sums of Gaussian spots, as heat spreads on the sphere over small angles."""
    angles = np.arccos(np.clip(at @ directions.T, -1, 1))
    return np.exp(-(angles**2) / (2 * width**2)) / (2 * np.pi * width**2) @ fluxes


def spread_over(disc, count):
    """Directions of equal areas of a disc, by a spiral about its axis; small ones have them too."""
    along = (np.arange(count) + 0.5) / count
    polar = 2 * np.arcsin(np.sin(disc.radius / 2) * np.sqrt(along))
    azimuth = np.pi * (3 - np.sqrt(5)) * np.arange(count)
    side = np.cross(disc.direction, np.eye(3)[np.argmin(np.abs(disc.direction))])
    side /= np.linalg.norm(side)
    axes = np.array([side, np.cross(disc.direction, side), disc.direction])
    sine = np.sin(polar)
    return np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), np.cos(polar)], axis=1) @ axes


def missed(light, discs, width=0.03):
    """The RMS by which discs look unlike a lamp when both are blurred, by points of discs."""
    rng = np.random.default_rng(1)
    at = AXIS + 0.3 * rng.normal(size=(500, 3))
    at /= np.linalg.norm(at, axis=1, keepdims=True)
    seen = blurred(light.directions, light.radiance * light.areas[:, None], at, width)
    found = np.zeros_like(seen)
    for disc in discs:
        points = spread_over(disc, 1000)
        flux = disc.solid_angle / len(points) * disc.radiance
        found += blurred(points, np.broadcast_to(flux, points.shape), at, width)
    return np.sqrt(np.mean((found - seen) ** 2) / np.mean(seen**2))


def sequence(light, most=6, width=0.03):
    return list(fitted_discs(light, gaussian(128, width), most))


def test_a_bright_middle_in_a_dim_rim_is_two_discs():
    light = lamp(lambda x, y: 10.0 * (np.hypot(x, y) < 0.2) + 90.0 * (np.hypot(x - 0.03, y) < 0.1))
    one, two, *_ = sequence(light, 2)
    rim, middle = sorted(two, key=lambda disc: -disc.radius)
    assert (rim.radius, middle.radius) == pytest.approx((0.2, 0.1), rel=0.02)
    assert rim.radiance == pytest.approx(np.array([10, 8, 6]), rel=0.05)
    assert middle.radiance == pytest.approx(np.array([90, 72, 54]), rel=0.05)
    assert rim.direction @ middle.direction == pytest.approx(np.cos(0.03), abs=1e-4)
    assert missed(light, two) < 0.02 < 0.1 < missed(light, one)


def test_a_ring_is_a_disc_without_its_middle():
    light = lamp(lambda x, y: 50.0 * ((np.hypot(x, y) < 0.25) & (np.hypot(x, y) > 0.15)))
    (_, two, *_) = sequence(light, 2)
    hole, whole = sorted(two, key=lambda disc: disc.radiance[0])
    assert hole.radiance[0] == pytest.approx(-50, rel=0.1)
    assert (hole.radius, whole.radius) == pytest.approx((0.15, 0.25), rel=0.02)
    assert missed(light, two) < 0.025


@pytest.mark.parametrize(
    ("shape", "bars"),
    [
        (lambda x, y: 40.0 * ((abs(x) < 0.25) & (abs(y) < 0.03)), (0.85, 0.4, 0.1, 0.004)),
        (lambda x, y: 40.0 * ((abs(x) < 0.15) & (abs(y) < 0.15)), (0.16, 0.12, 0.025, 0.0125)),
        (lambda x, y: 40.0 * (abs(x) + abs(y) < 0.2) + 20 * (x > 0.05), (0.45, 0.22, 0.09, 0.035)),
    ],
)
def test_more_discs_are_nearer(shape, bars):
    light = lamp(shape)
    found = sequence(light, 12)
    errors = [missed(light, discs) for discs in found]
    for most, bar in zip((1, 3, 6, 12), bars, strict=True):
        pairs = zip(found, errors, strict=True)
        assert min(error for discs, error in pairs if len(discs) <= most) < bar
    for discs in found[1:]:
        flux = sum(disc.radiance * disc.solid_angle for disc in discs)
        assert flux == pytest.approx(light.flux, rel=5e-3)


def test_discs_of_a_sun_of_few_pixels_are_bright_together():
    """A coat resolves what a coarse blur does not: discs that nearly cancel are black spots in it.

    Some that nothing holds to it have light of six times the sun's, and as much less than none.
    """
    light = lamp(lambda x, y: 5e4 * (np.hypot(x, y) < 0.018), rows=256)
    assert len(light.areas) < 10
    rng = np.random.default_rng(1)
    at = AXIS + 0.03 * rng.normal(size=(40_000, 3))
    at /= np.linalg.norm(at, axis=1, keepdims=True)
    found = list(fitted_discs(light, gaussian(192, 0.005), 12))
    assert len(found) > 4
    for discs in found:
        lit = sum((at @ each.direction >= np.cos(each.radius)) * each.radiance[1] for each in discs)
        assert lit.min() > -0.13 * lit.max()
        assert lit.max() < 3 * 4e4


def test_a_disc_is_one_disc():
    light = lamp(lambda x, y: 1e6 * (np.hypot(x, y) < 0.02), rows=1440)
    (only,), *_ = sequence(light, 1)
    assert only.radius == pytest.approx(0.02, rel=0.02)
    assert only.radiance == pytest.approx(np.array([1e6, 8e5, 6e5]), rel=0.05)


def test_a_single_pixel():
    light = Light(AXIS[None], np.array([[3e4, 2e4, 1e4]]), np.array([1e-5]))
    for discs in sequence(light, 3):
        flux = sum(disc.radiance * disc.solid_angle for disc in discs)
        assert flux == pytest.approx(light.flux[None][0], rel=5e-3)


def test_lamps_of_many_pixels_are_those_of_few(monkeypatch):
    light = lamp(lambda x, y: 10.0 * (np.hypot(x, y) < 0.2) + 90.0 * (np.hypot(x - 0.03, y) < 0.1))
    expected = sequence(light, 2)[1]
    monkeypatch.setattr(fit, "_MOST_CELLS", len(light.areas) // 8)
    found = sequence(light, 2)[1]
    assert [disc.radius for disc in found] == pytest.approx(
        [disc.radius for disc in expected], rel=0.02
    )
    assert missed(light, found) < 0.025


def test_discs_look_as_their_points_do():
    light = lamp(lambda x, y: 10.0 * (np.hypot(x, y) < 0.2))
    picture = fit._Picture(light, gaussian(128, 0.03))
    shape = np.array([[0.05, -0.1, np.log(0.07)], [0.0, 0.0, np.log(0.18)]])
    columns = picture._columns(shape)[:-1] / picture._scale
    directions, areas = latlong_samples(1440)
    for column, middle, radius in zip(
        columns.T, picture._directions(shape), np.exp(shape[:, 2]), strict=True
    ):
        inside = directions @ middle > np.cos(radius)
        own = areas[inside] * Disc(middle, radius, np.ones(3)).solid_angle / areas[inside].sum()
        expected = blurred(directions[inside], own[:, None], picture._samples, 0.03)[:, 0]
        np.testing.assert_allclose(column, expected, rtol=0, atol=0.01 * expected.max())


def test_slopes_are_those_of_what_discs_look_like():
    light = lamp(lambda x, y: 10.0 * (np.hypot(x, y) < 0.2))
    picture, step = fit._Picture(light, gaussian(128, 0.03)), 3e-3
    shape = np.array([[0.05, -0.1, np.log(0.07)], [-0.02, 0.08, np.log(0.15)]])
    found = picture._slopes(shape).reshape(-1, 3, 2)
    for unknown, move in enumerate(step * np.eye(3)):
        expected = (picture._columns(shape + move) - picture._columns(shape - move)) / (2 * step)
        assert np.linalg.norm(found[:, unknown] - expected) < 5e-3 * np.linalg.norm(expected)
        np.testing.assert_allclose(found[-1, unknown], expected[-1], rtol=1e-4, atol=1e-12)
