"""The points that stand for all pixels of spheres, isotropic and brushed."""

import numpy as np
import pytest

from shrm_cli.maps.lobes_lit import Lobes, lit
from shrm_cli.maps.sphere_pixels import pixels, sample_tangents, sample_views, view_count
from tests import oracles

CENTERS = "reflection", "normal"


def horizontal(points):
    """The share of the pixels of the horizontal tangents that each of their points stands for."""
    _, around = points.surfaces
    shares = (
        points.parts[..., around] * sample_views(points.center, points.views.shape[1])[1][:, None]
    )
    return around, shares / shares.sum()


@pytest.mark.parametrize("center", CENTERS)
def test_brushed_pixels_are_those_of_spheres_around_y(center):
    points = pixels(center, True)
    around, shares = horizontal(points)
    normals, views = points.normals[..., around, :], points.views[..., around, :]
    places = np.indices(points.views.shape[:-1])[..., around]
    across = np.cross([0, 1, 0], normals)
    along = np.abs(np.sum(points.tangents(tuple(places)) * across, axis=-1))
    is_horizontal = along > 0.999 * np.linalg.norm(across, axis=-1)
    assert shares[is_horizontal].sum() > 0.995
    # All heights of normals and of views are as frequent, by Archimedes.
    for each in (normals, views):
        found, _ = np.histogram(each[..., 1], bins=8, range=(-1, 1), weights=shares)
        np.testing.assert_allclose(found, 1 / 8, rtol=0.15)
        np.testing.assert_allclose(np.sum(each * shares[..., None], axis=(0, 1, 2)), 0, atol=0.02)


@pytest.mark.parametrize("center", CENTERS)
@pytest.mark.parametrize("is_brushed", [False, True])
def test_centers_are_where_they_are_asked_for(center, is_brushed):
    points, plain = pixels(center, is_brushed), pixels(center)
    angles = sample_views(center, view_count(is_brushed))[0][:, None]
    normals, views = points.normals, points.views
    heights = np.sum(normals * views, axis=-1, keepdims=True)
    found = 2 * heights * normals - views if center == "reflection" else normals
    expected = 2 * plain.normals * np.sum(plain.normals * plain.views, axis=-1, keepdims=True)
    expected = expected - plain.views if center == "reflection" else plain.normals
    np.testing.assert_allclose(found, np.broadcast_to(expected[:, :1, :1], found.shape), atol=1e-9)
    cosines = np.sum(found * views, axis=-1)
    np.testing.assert_allclose(cosines, np.broadcast_to(np.cos(angles), cosines.shape), atol=1e-9)


@pytest.mark.proof
@pytest.mark.parametrize("center", CENTERS)
def test_lobes_that_show_the_light_along_the_tangent(center, rng):
    """Of anisotropic lobes the azimuth counts: all degrees and orders, at all points."""
    order, count = 12, view_count(True)
    theta_o, _ = sample_views(center, count)
    azimuth = sample_tangents(count)
    # The central direction is +Z, and the view has azimuth 0 about it.
    half = theta_o / 2 if center == "reflection" else 0 * theta_o
    normals, view_side = (
        np.stack([np.sin(half), 0 * half, np.cos(half)], axis=-1),
        np.stack([np.cos(half), 0 * half, -np.sin(half)], axis=-1),
    )
    tangents = np.cos(azimuth)[:, None] * view_side
    tangents -= np.sin(azimuth)[:, None] * np.cross(normals, view_side)
    phi = np.arctan2(tangents[:, 1], tangents[:, 0])
    upright = np.stack([np.hypot(*tangents[:, :2].T), 0 * phi, tangents[:, 2]], axis=-1)
    values = oracles.real_harmonics(order, upright)
    whole = np.zeros((order + 1, order + 1, count, 1), complex)
    for degree, q in zip(*np.tril_indices(order + 1), strict=True):
        value = values[:, degree * (degree + 1) + q] / np.sqrt(2 if q else 1)
        whole[q, degree, :, 0] = value * np.exp(1j * q * phi)
    light = rng.normal(size=((order + 1) ** 2, 3))
    found, _ = lit(light, [Lobes(whole, 0 * whole, center)])
    points = pixels(center, True)
    places = tuple(np.indices(points.views.shape[:-1]))
    seen = oracles.real_harmonics(order, points.tangents(places).reshape(-1, 3))
    exact = seen @ light.sum(axis=1)
    np.testing.assert_allclose(found.ravel(), exact, rtol=0, atol=3e-6 * np.ptp(exact))
