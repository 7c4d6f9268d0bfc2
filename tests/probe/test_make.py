"""Furnace, impulse and studio probes."""

import numpy as np
import pytest

from shrm_cli.errors import ProbeError
from shrm_cli.probe import make
from shrm_cli.sphere.directions import from_azimuth_elevation
from shrm_cli.sphere.grid.latlong import latlong_directions


@pytest.mark.parametrize("size", [2, 3, 17, 512, 8192])
def test_solid_angles_are_exact(size):
    angles = make.latlong_solid_angles(size)
    edges = np.linspace(0, np.pi, size + 1)
    # The difference of cosines is the definition, and loses digits only near the poles.
    expected = -np.diff(np.cos(edges)) * np.pi / size
    np.testing.assert_allclose(angles, expected, rtol=1e-8)
    np.testing.assert_allclose(2 * size * angles.sum(), 4 * np.pi, rtol=1e-14)


@pytest.mark.parametrize("size", [2, 5, 32])
def test_texels_contain_their_centres(size):
    rows, columns = make.latlong_texels(latlong_directions(2 * size, size), size)
    np.testing.assert_array_equal(rows, np.arange(size)[:, None] + np.zeros((1, 2 * size), int))
    np.testing.assert_array_equal(columns, np.arange(2 * size) + np.zeros((size, 1), int))


def test_texels_of_poles_and_seam():
    directions = [[0, 1, 0], [0, -1, 0], [0.0, 0, -1], [-0.0, 0, -1], [1e-9, 0, -1], [-1e-9, 0, -1]]
    rows, columns = make.latlong_texels(directions, 8)
    assert rows[0] == 0
    assert rows[1] == 7
    # +X is left of the centre, so the seam is approached from +X at the left end.
    assert set(columns[2:4]) == {0}
    assert columns[4] == 0
    assert columns[5] == 15


def test_furnace_is_constant():
    image = make.furnace(3, (0.25, 1, 4))
    assert image.shape == (3, 6, 3)
    assert image.dtype == np.float32
    assert (image == np.float32([0.25, 1, 4])).all()
    assert (make.furnace(2, 3.5) == 3.5).all()


@pytest.mark.parametrize(
    ("azimuth", "elevation", "row", "column"),
    # Height 4: rows of 45 degrees from the top, columns of 45 degrees from -Z leftwards.
    [(20, 10, 1, 3), (-20, 10, 1, 4), (100, -80, 3, 1), (-170, 60, 0, 7), (170, -10, 2, 0)],
)
def test_impulse_lights_the_texel_of_its_direction(azimuth, elevation, row, column):
    image = make.impulse(4, 3 * from_azimuth_elevation(azimuth, elevation), (1, 2, 3))
    assert np.argwhere(image.any(axis=-1)).tolist() == [[row, column]]
    assert image[row, column].tolist() == [1, 2, 3]


@pytest.mark.parametrize("elevation", [-90, -41, 3, 89.9, 90])
def test_impulse_integrates_to_one_by_default(elevation):
    size = 64
    image = make.impulse(size, from_azimuth_elevation(77, elevation))
    integral = (image.astype(float) * make.latlong_solid_angles(size)[:, None, None]).sum((0, 1))
    np.testing.assert_allclose(integral, 1, rtol=1e-7)


def test_studio_lights_have_their_radiance_and_place():
    size = 256
    image = make.studio(size, key=100)
    for box, intensity in [(make.KEY, 100), (make.FILL, 2), (make.RIM, 10)]:
        texel = make.latlong_texels(from_azimuth_elevation(box.azimuth, box.elevation), size)
        np.testing.assert_allclose(image[texel], intensity * np.array(box.color), rtol=1e-6)
    # Away from the lights: straight up and down is backdrop.
    np.testing.assert_allclose(image[0, 0], make.CEILING_COLOR, rtol=1e-3)
    np.testing.assert_allclose(image[-1, 0], make.FLOOR_COLOR, rtol=1e-3)


def test_studio_box_is_half_lit_at_its_angles():
    box = make.SoftBox(30, 20, 50, 40, (1, 1, 1))
    # At the height of the box's centre only elevation changes along its vertical axis.
    edge = from_azimuth_elevation(30, [20 + 20, 20 - 20, 20, 20 + 40, 200])
    np.testing.assert_allclose(make.soft_box_coverage(box, edge.T), [0.5, 0.5, 1, 0, 0], atol=1e-12)


def test_studio_is_smooth():
    # A jump stays, and a kink's second difference shrinks only as 1/n, where C1 gives 1/n^2.
    def roughness(size):
        row = make.studio(size)[int(size * 50 / 180), :, 0].astype(float)
        return np.abs(np.diff(row, 2)).max()

    assert roughness(1024) < roughness(256) / 10


def test_studio_key_fits_half():
    image = make.studio(64, key=65504)
    assert np.isfinite(image.astype(np.float16)).all()
    assert image.min() > 0


@pytest.mark.parametrize(
    "call",
    [
        lambda: make.furnace(1),
        lambda: make.furnace(4, -1),
        lambda: make.furnace(4, 1e39),
        lambda: make.furnace(4, (1, 2)),
        lambda: make.furnace(4, (1, np.nan, 1)),
        lambda: make.impulse(4, (0, 0, 0)),
        lambda: make.impulse(4, (0, np.inf, 0)),
        lambda: make.impulse(4, (0, 1)),
        lambda: make.studio(4, key=7e4),
        lambda: make.studio(4, key=np.nan),
    ],
)
def test_bad_parameters_are_refused(call):
    with pytest.raises(ProbeError):
        call()
