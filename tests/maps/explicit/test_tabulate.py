"""Maps made texel by texel: from an integral that is known."""

import numpy as np
import pytest

from shrm_cli.errors import MapError
from shrm_cli.maps.explicit.prefilter import tabulate
from shrm_cli.maps.explicit.views import Cabral, KautzMcCool, LightField
from shrm_cli.progress import using
from tests import oracles
from tests.maps.scenes import around, make_info, make_shrm, rms

KINDS = [(Cabral, 12), (KautzMcCool, 2), (KautzMcCool, 5), (LightField, 1), (LightField, 3)]


class Known:
    """Light of a formula, smooth in the central direction and the view."""

    def __init__(self, center):
        self.center = center

    def value(self, centers, views):
        x, y, z = np.moveaxis(centers, -1, 0)
        cosine = np.sum(centers * views, axis=-1)
        side = np.sum(views * [0.2, -0.5, 0.3], axis=-1)
        return np.stack([2 + x * cosine, 3 - y * side + cosine**2, z + side], axis=-1)

    def central_radiance(self, centers, views):
        return self.value(centers, views)

    def zonal_radiance(self, centers, view_theta):
        flat = centers.reshape(-1, 3)
        mean = self.value(flat, around(flat, view_theta, 8)).mean(axis=0)
        return mean.reshape(centers.shape)


class OfShrm:
    """The radiance of an SHRM, and its mean over views around each central direction."""

    def __init__(self, shrm):
        self.shrm = shrm

    def central_radiance(self, centers, views):
        return self.shrm.central_radiance(centers, np.broadcast_to(views, centers.shape))

    def zonal_radiance(self, centers, view_theta):
        flat = centers.reshape(-1, 3)
        views = around(flat, view_theta, 12)
        if self.shrm.center == "normal":
            return self.shrm.radiance(flat, views).mean(axis=0).reshape(centers.shape)
        total = flat + views
        length = np.linalg.norm(total, axis=-1, keepdims=True)
        # Where R = -V, any direction at a right angle.
        normals = np.where(length > 1e-6, total, around(flat, np.pi / 2, 12))
        normals = normals / np.linalg.norm(normals, axis=-1, keepdims=True)
        return self.shrm.radiance(normals, views).mean(axis=0).reshape(centers.shape)


@pytest.mark.parametrize("sampling", ["center", "border"])
@pytest.mark.parametrize("center", ["reflection", "normal"])
@pytest.mark.parametrize(("kind", "t"), KINDS)
def test_images_are_the_known_light(kind, t, center, sampling):
    integral = Known(center)
    info = make_info(3, 2)
    made = tabulate(kind, integral, center, info, 3, t, sampling)
    assert type(made) is kind
    assert (made.center, made.sampling, made.size) == (center, sampling, 3)
    assert made.info is info
    assert made.images.dtype == np.float32
    texels = oracles.cube_texels(3, sampling).reshape(18, 3, 3)
    for index, view in enumerate(kind.sample_views(made.count)):
        if kind is KautzMcCool:
            theta = np.pi * index / (t - 1)
            expected = integral.zonal_radiance(texels, theta)
        else:
            expected = integral.value(texels, view)
        np.testing.assert_allclose(made.images[index], expected, atol=1e-5)


@pytest.mark.parametrize("center", ["reflection", "normal"])
@pytest.mark.parametrize(("kind", "t"), KINDS)
def test_an_shrm_tabulated_is_the_map_made_from_it(kind, t, center):
    shrm = make_shrm(size=5, center=center)
    made = tabulate(kind, OfShrm(shrm), center, shrm.info, 5, t)
    expected = kind.from_shrm(shrm, t)
    assert np.abs(made.images - expected.images).max() < 1e-6 * rms(expected.images)


@pytest.mark.parametrize(("kind", "t"), KINDS)
def test_progress_counts_the_images(kind, t):
    seen = []
    with using(lambda done, every: seen.append((done, every))):
        made = tabulate(kind, Known("normal"), "normal", make_info(1, 1), 2, t)
    assert seen == [(k + 1, made.count) for k in range(made.count)]


def test_size_is_bounded_before_anything_is_computed():
    with pytest.raises(MapError, match="a lightfield map of 1000000 images of size 64"):
        tabulate(LightField, None, "reflection", make_info(1, 1), 64, 1000)
