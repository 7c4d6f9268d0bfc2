"""What harmonics of the light do to objects, against integrals over the light."""

import numpy as np

from shrm_cli.render.basis import basis_maps, basis_names
from shrm_cli.sphere.quadrature import spiral_directions
from tests import oracles


def test_each_map_is_the_light_of_its_harmonic():
    """Radiance of a white diffuse surface, green of the light itself and blue of its negative."""
    normals, points = spiral_directions(50), spiral_directions(60000)
    light = oracles.real_harmonics(3, points)
    cosines = np.maximum(normals @ points.T, 0)
    expected = 4 * np.pi * cosines @ light / len(points) / np.pi
    for index, made in enumerate(basis_maps(3)):
        found = made.radiance(normals, normals)
        np.testing.assert_allclose(found[:, 1], expected[:, index], atol=1e-3)
        np.testing.assert_array_equal(found[:, 2], -found[:, 1])
        assert not found[:, 0].any()


def test_names():
    assert basis_names(1) == ["0,0", "1,-1", "1,0", "1,1"]
