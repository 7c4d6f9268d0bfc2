"""Kautz-McCool maps: the mean over azimuth of the light, by averaging over views around C."""

import numpy as np
import pytest

from shrm_cli.maps.explicit.views import KautzMcCool
from tests import oracles
from tests.brute_force import unit
from tests.maps.scenes import around, azimuthal_mean_image, make_shrm, normals_of, rms


@pytest.mark.parametrize(("dtype", "tolerance"), [(np.float64, 1e-12), (np.float32, 1e-6)])
@pytest.mark.parametrize("sampling", ["center", "border"])
@pytest.mark.parametrize("frame", ["global", "local"])
@pytest.mark.parametrize("count", [2, 6])
def test_slices_are_means_over_azimuth(count, frame, sampling, dtype, tolerance):
    shrm = make_shrm(order_p=4, size=5, sampling=sampling, dtype=dtype)
    made = KautzMcCool.from_shrm(shrm.to_frame(frame), count)
    assert made.frame == "local"
    for k, image in enumerate(made.images):
        expected = azimuthal_mean_image(shrm, np.pi * k / (count - 1))
        assert np.abs(image - expected).max() < 10 * tolerance * rms(shrm.coefficients)


@pytest.mark.parametrize("center", ["reflection", "normal"])
def test_radiance_at_a_slice_is_the_mean_of_that_of_the_shrm(center):
    """From any side; exactly at texels, and elsewhere as far as both are filtered."""
    rng = np.random.default_rng(21)
    errors = {}
    for size in (6, 12, 24):
        shrm = make_shrm(order_p=3, size=size, center=center)
        made = KautzMcCool.from_shrm(shrm, 7)
        texels = oracles.cube_texels(size).reshape(-1, 3)[:: size**2 // 6]
        for name, centers in (("texels", texels), (size, unit(rng, 200))):
            errors[name] = 0.0
            for k in range(1, 6):
                views = around(centers, np.pi * k / 6, 8)
                normals = normals_of(centers, views, center)
                mean = shrm.radiance(normals, views).mean(axis=0)
                error = np.abs(made.radiance(normals, views) - mean).max()
                errors[name] = max(errors[name], error / rms(shrm.coefficients))
        assert errors["texels"] < 1e-12
    assert errors[24] < errors[12] / 4 < errors[6] / 16
    assert errors[24] < 5e-3


def test_between_slices_it_is_linear_in_the_angle():
    made = KautzMcCool.from_shrm(make_shrm(size=6), 5)
    texels = oracles.cube_texels(6).reshape(-1, 3)
    rows = made.images.reshape(5, -1, 3)
    slices = np.linspace(0, np.pi, 5)
    for theta in (0.01, 0.5, np.pi / 4, 1.0, 2.2, 3.0, np.pi - 0.01):
        views = around(texels, theta, 1)[0]
        expected = np.stack(
            [
                [np.interp(theta, slices, rows[:, n, c]) for c in range(3)]
                for n in range(len(texels))
            ]
        )
        found = made.radiance(normals_of(texels, views), views)
        np.testing.assert_allclose(found, expected, atol=1e-12)


@pytest.mark.parametrize("count", [1, 2, 3, 20])
def test_weights_at_any_angle(count):
    """Both ends of the range too, where rounding could leave it."""
    rng = np.random.default_rng(22)
    centers = np.concatenate([unit(rng, 500), np.eye(3), -np.eye(3)])
    for views in (centers, -centers, unit(rng, len(centers)), centers * (1 + 1e-15)):
        indices, weights = KautzMcCool.blend(centers, views, count)
        assert indices.min() >= 0
        assert indices.max() < count
        assert weights.min() >= 0
        np.testing.assert_allclose(weights.sum(axis=-1), 1, atol=1e-15)
        if count == 1:
            continue
        angle = 2 * np.arcsin(np.clip(np.linalg.norm(centers - views, axis=-1) / 2, 0, 1))
        found = np.sum(weights * indices, axis=-1) * np.pi / (count - 1)
        np.testing.assert_allclose(found, angle, atol=1e-7)


def test_one_slice_is_the_light_along_the_center():
    made = KautzMcCool.from_shrm(make_shrm(size=4), 1)
    texels = oracles.cube_texels(4).reshape(-1, 3)
    views = unit(np.random.default_rng(23), len(texels))
    found = made.radiance(normals_of(texels, views), views)
    np.testing.assert_allclose(found, made.images.reshape(-1, 3), atol=1e-12)


def test_angles_of_the_slices():
    np.testing.assert_allclose(KautzMcCool.view_angles(5), np.pi * np.arange(5) / 4)
    for count in (1, 4):
        angles = KautzMcCool.view_angles(count)
        views = KautzMcCool.sample_views(count)
        np.testing.assert_allclose(np.arccos(views[:, 2]), angles, atol=1e-15)
