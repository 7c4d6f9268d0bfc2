"""Circular lights: closed forms against integrals over discs, and discs on pixels."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import eval_legendre

from shrm_cli.probe.disc import Disc, disc_coefficients, disc_rows, facing_factor, radius_of
from shrm_cli.probe.lighting import project
from shrm_cli.probe.make import latlong_solid_angles
from shrm_cli.probe.probe import Probe
from tests import oracles

RADII = (1e-6, 0.265, 3.0, 40.0, 90.0, 137.0, 180.0)
"""Degrees."""
RED = np.array([3.0, 1.0, 0.25])


def disc(direction, degrees, radiance=RED):
    direction = np.asarray(direction, dtype=float)
    return Disc(direction / np.linalg.norm(direction), np.radians(degrees), np.array(radiance))


@pytest.mark.parametrize("radius", RADII)
def test_the_closed_form_is_the_integral(rng, radius):
    order = 12
    for direction in (*oracles.random_directions(rng, 2), [0, 0, -1], [0, 1, 0]):
        light = disc(direction, radius)
        directions, areas = oracles.disc_rule(light.direction, light.radius)
        assert areas.sum() == pytest.approx(light.solid_angle, rel=1e-12)
        expected = oracles.real_harmonics(order, directions).T @ areas
        found = disc_coefficients([light], order)
        np.testing.assert_allclose(found, expected[:, None] * RED, rtol=0, atol=1e-11 * areas.sum())


def test_a_hemisphere():
    """A disc of 2 pi sr: integrals of P_l over the half of its range, and none of even degree."""
    assert radius_of(2 * np.pi) == pytest.approx(np.pi / 2, rel=1e-15)
    light = Disc(np.array([0.0, 0.0, 1.0]), radius_of(2 * np.pi), np.ones(3))
    found = disc_coefficients([light], 12)[:, 0]
    for degree in range(13):
        half = quad(lambda z, degree=degree: eval_legendre(degree, z), 0, 1)[0]
        expected = np.sqrt((2 * degree + 1) / (4 * np.pi)) * 2 * np.pi * half
        rows = found[degree**2 : (degree + 1) ** 2]
        assert rows[degree] == pytest.approx(expected, abs=1e-14)
        assert abs(np.delete(rows, degree)).max(initial=0) < 1e-15
        assert degree in (0, *range(1, 13, 2)) or abs(expected) < 1e-15


@pytest.mark.parametrize("radius", [4.0, 35.0, 100.0])
def test_the_closed_form_is_the_projection_of_a_drawn_disc(rng, radius):
    """A lat-long of 64 rows drawn here, each pixel by 16 x 16 points of which some are inside."""
    light, order, rows, parts = disc(oracles.random_directions(rng), radius), 6, 64, 16
    fine = oracles.latlong_pixels(2 * rows * parts, rows * parts)
    inside = (fine @ light.direction > np.cos(light.radius)).astype(float)
    pixels = inside.reshape(rows, parts, 2 * rows, parts).mean(axis=(1, 3))
    image = (pixels[..., None] * light.radiance).astype(np.float32)
    drawn = project(Probe.from_array(image), order).coefficients
    exact = disc_coefficients([light], order)
    assert np.linalg.norm(drawn - exact) < 5e-3 * np.linalg.norm(exact)


def test_many_discs_are_their_sum(rng, monkeypatch):
    monkeypatch.setattr("shrm_cli.probe.disc._VALUES_AT_ONCE", 100)  # seven of them
    lights = [
        disc(direction, radius, rng.uniform(0, 5, 3))
        for direction, radius in zip(
            oracles.random_directions(rng, 30), rng.uniform(0.1, 120, 30), strict=True
        )
    ]
    # Those in a ring about the axis have all but their azimuth in common.
    lights += [disc((np.cos(a), np.sin(a), -0.3), 2, rng.uniform(0, 5, 3)) for a in range(9)]
    together = disc_coefficients(lights, 12)
    each = sum(disc_coefficients([light], 12) for light in lights)
    np.testing.assert_allclose(together, each, rtol=0, atol=1e-12)
    assert np.array_equal(disc_coefficients([], 3), np.zeros((16, 3)))


@pytest.mark.parametrize("radius", RADII)
def test_pixels_hold_all_of_a_disc(rng, radius):
    """As much as its solid angle, on those pixels alone that it touches, as far as these say."""
    height = 48
    areas = latlong_solid_angles(height)[:, None]
    directions = oracles.latlong_pixels(2 * height, height)
    for direction in (*oracles.random_directions(rng, 3), [0, 1, 0], [0, -1, 0], [0, 0, -1]):
        light = disc(direction, radius)
        coverage = np.zeros((height, 2 * height))
        for start, rows in disc_rows(light, height):
            coverage[start : start + len(rows)] += rows
        assert np.sum(coverage * areas) == pytest.approx(light.solid_angle, rel=1e-12)
        assert coverage.min() >= 0
        assert coverage.max() < 1.002
        apart = np.arccos(np.clip(directions @ light.direction, -1, 1)) - light.radius
        assert abs(coverage[apart < -2 * np.pi / height] - 1).max(initial=0) < 2e-3
        assert not coverage[apart > 2 * np.pi / height].any()
        middle = np.einsum("ijk,ij,ij->k", directions, coverage, np.broadcast_to(areas, (48, 96)))
        if radius < 150:  # of the whole sphere there is no middle
            middle /= np.linalg.norm(middle)
            assert np.linalg.norm(middle - light.direction) < 1.5 / height


@pytest.mark.parametrize("rows", [2.0, 3.0, 6.0])
def test_pixels_at_the_edge_of_a_disc_are_covered_as_far_as_it_reaches(rows):
    """As 128 x 128 points of each pixel count it, of discs about +Z, in the middle of the image."""
    height, around, points = 32, 8, 128
    step = np.pi / height
    light = disc([0, 0, 1], np.degrees(rows * step))
    angles = (np.arange(2 * around * points) + 0.5) * step / points - around * step
    cosine = np.cos(angles)
    inside = np.outer(cosine, cosine) > np.cos(light.radius)
    pixels = 2 * around, points, 2 * around, points
    expected = (inside * cosine[:, None]).reshape(pixels).sum(axis=(1, 3))
    expected /= points * cosine.reshape(-1, points).sum(axis=1)[:, None]
    coverage = np.zeros((height, 2 * height))
    for start, found in disc_rows(light, height):
        coverage[start : start + len(found)] += found
    middle = coverage[height // 2 - around :][: 2 * around, height - around :][:, : 2 * around]
    assert middle.sum() == pytest.approx(coverage.sum())
    assert np.abs(middle - expected).max() < 1.8e-3


def test_what_a_surface_that_faces_a_disc_receives(rng):
    for radius in (0.5, 30.0, 90.0, 120.0, 180.0):
        light = disc(oracles.random_directions(rng), radius)
        if radius <= 90:
            directions, areas = oracles.disc_rule(light.direction, light.radius)
            expected = np.sum(areas * (directions @ light.direction))
        else:
            expected = np.pi  # a hemisphere's
        np.testing.assert_allclose(light.irradiance, expected * RED, rtol=1e-12)
        assert facing_factor(light.radius) == pytest.approx(expected, rel=1e-12)
    assert light.energy == pytest.approx(RED**2 * 4 * np.pi)
