"""Light fields: bilinear between T x T views, around the azimuth and over the poles."""

import numpy as np
import pytest

from shrm_cli.maps.explicit.views import LightField
from tests import oracles
from tests.brute_force import unit
from tests.maps.scenes import harmonics_image, make_shrm, normals_of, relative_rms, rms

SIDES = [1, 2, 3, 4, 7]
CENTER = np.array([0.0, 0.0, 1.0])


def dense(views, side):
    """Weights of all images, shape (..., T^2)."""
    indices, weights = LightField.blend(CENTER, views, side**2)
    assert indices.shape == weights.shape == (*views.shape[:-1], 4)
    return np.sum(np.eye(side**2)[indices] * weights[..., None], axis=-2)


def bilinear(theta, phi, side):
    """The same by numpy's periodic interpolation along rows, then between two of them."""
    columns = [2 * np.pi * (k + 0.5) / side - np.pi for k in range(side)]

    def row(j, azimuth):
        if j in (-1, side):  # beyond a pole: the last row, from the other side
            return row(min(max(j, 0), side - 1), azimuth + np.pi)
        result = np.zeros((side, side))
        for k in range(side):
            result[j, k] = np.interp(azimuth, columns, np.eye(side)[k], period=2 * np.pi)
        return result

    position = theta * side / np.pi - 0.5
    j = int(np.floor(position))
    return ((1 - position + j) * row(j, phi) + (position - j) * row(j + 1, phi)).ravel()


@pytest.mark.parametrize("side", SIDES)
def test_views_of_the_images(side):
    expected = [
        [np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)]
        for t in np.pi * (np.arange(side) + 0.5) / side
        for p in 2 * np.pi * (np.arange(side) + 0.5) / side - np.pi
    ]
    np.testing.assert_allclose(LightField.sample_views(side**2), expected, atol=1e-15)


@pytest.mark.parametrize("side", SIDES)
def test_weights_are_bilinear(side):
    rng = np.random.default_rng(31)
    theta = np.concatenate([np.arccos(rng.uniform(-1, 1, 200)), [1e-3, np.pi - 1e-3]])
    phi = np.concatenate([rng.uniform(-np.pi, np.pi, 200), [1.0, -2.0]])
    views = np.stack(
        [np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1
    )
    expected = np.stack([bilinear(t, p, side) for t, p in zip(theta, phi, strict=True)])
    np.testing.assert_allclose(dense(views, side), expected, atol=1e-12)


@pytest.mark.parametrize("side", SIDES)
def test_weights_are_those_of_a_mean(side):
    axes = np.concatenate([np.eye(3), -np.eye(3)])
    for views in (unit(np.random.default_rng(32), 2000), axes, axes - 1e-17):
        indices, weights = LightField.blend(CENTER, views, side**2)
        assert indices.min() >= 0
        assert indices.max() < side**2
        assert weights.min() >= 0
        np.testing.assert_allclose(weights.sum(axis=-1), 1, atol=1e-14)


@pytest.mark.parametrize("side", SIDES)
def test_a_sample_has_its_own_image(side):
    found = dense(LightField.sample_views(side**2), side)
    np.testing.assert_allclose(found, np.eye(side**2), atol=1e-14)


@pytest.mark.parametrize("side", SIDES)
def test_no_seam_at_azimuth_180(side):
    x = np.linspace(-1, 1, 41)[:-1]
    front = np.stack([-np.sqrt(1 - x**2), 1e-12 + 0 * x, x], axis=-1)[1:]
    np.testing.assert_allclose(dense(front, side), dense(front * [1, -1, 1], side), atol=1e-9)


@pytest.mark.parametrize("pole", [1.0, -1.0])
@pytest.mark.parametrize("side", SIDES)
def test_the_way_leads_over_the_poles(side, pole):
    """From azimuth phi to phi + pi, without a jump."""
    for phi in np.linspace(-3, 3, 11):
        tiny = 1e-10 * np.array([np.cos(phi), np.sin(phi), 0])
        here, there = (dense(np.array([0, 0, pole]) + sign * tiny, side) for sign in (1, -1))
        np.testing.assert_allclose(here, there, atol=1e-8)


def test_a_pole_seen_from_all_sides():
    """At a pole itself, azimuths that differ by less than 180 degrees meet.

    They agree as far as the light does not depend on the azimuth a row away from the pole: the
    light's own second derivative, which falls with the square of T as does every other error of
    interpolating.
    """
    shrm = make_shrm(order_p=2, size=4)
    phi = np.linspace(-np.pi, np.pi, 64)
    for pole in (1.0, -1.0):
        spreads = {}
        for side in (8, 16, 32):
            made = LightField.from_shrm(shrm, side)
            views = np.stack([1e-12 * np.cos(phi), 1e-12 * np.sin(phi), pole + 0 * phi], axis=-1)
            pixels = dense(views, side) @ made.images.reshape(side**2, -1)
            truth = harmonics_image(shrm, np.array([0, 0, pole])).ravel()
            spreads[side] = np.abs(pixels - truth).max() / rms(truth)
        assert spreads[16] < spreads[8] / 3
        assert spreads[32] < spreads[16] / 3
        assert spreads[32] < 0.03


@pytest.mark.parametrize("side", [2, 5])
def test_views_of_their_own_are_the_same_as_distant_ones(side):
    rng = np.random.default_rng(33)
    made = LightField.from_shrm(make_shrm(size=6), side)
    normals, views = unit(rng, 30), unit(rng, 30)
    one_by_one = [made.radiance(n, v) for n, v in zip(normals, views, strict=True)]
    np.testing.assert_allclose(made.radiance(normals, views), one_by_one, atol=1e-12)


def test_radiance_is_the_bilinear_mean_of_the_images():
    rng = np.random.default_rng(34)
    side, size = 5, 4
    made = LightField.from_shrm(make_shrm(size=size), side)
    texels = oracles.cube_texels(size).reshape(-1, 3)
    views = unit(rng, len(texels))
    theta, phi = np.arccos(views[:, 2]), np.arctan2(views[:, 1], views[:, 0])
    images = made.images.reshape(side**2, -1, 3)
    expected = [
        bilinear(t, p, side) @ images[:, n] for n, (t, p) in enumerate(zip(theta, phi, strict=True))
    ]
    found = made.radiance(normals_of(texels, views), views)
    np.testing.assert_allclose(found, expected, atol=1e-12)


@pytest.mark.slow
def test_errors_fall_with_the_square_of_the_views():
    shrm = make_shrm(order_p=2, size=8, dtype=np.float32)
    rng = np.random.default_rng(35)
    centers, views = unit(rng, 1000), unit(rng, 1000)
    normals = normals_of(centers, views)
    truth = shrm.radiance(normals, views)
    errors = [
        relative_rms(LightField.from_shrm(shrm, side).radiance(normals, views), truth)
        for side in (6, 12)
    ]
    assert 3.5 < errors[0] / errors[1] < 4.5
