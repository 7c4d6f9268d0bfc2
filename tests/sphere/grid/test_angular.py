import numpy as np
import pytest
from hypothesis import given

from shrm_cli.sphere.grid import angular
from tests import oracles
from tests.oracles import EPS
from tests.sphere.strategies import directions

SAMPLINGS = ["center", "border"]


def directions_and_inside(size, sampling):
    grid = angular.Angular(size, sampling)
    return grid.directions(), grid.used()


def test_angular_landmarks():
    """Border-sampled 5 x 5: +Z amid, a ring of 90 degrees half way, -Z at the rim."""
    found, inside = directions_and_inside(5, "border")
    expected = {
        (2, 2): (0, 0, 1),
        (2, 3): (-1, 0, 0),
        (2, 1): (1, 0, 0),
        (1, 2): (0, 1, 0),
        (3, 2): (0, -1, 0),
        (0, 2): (0, 0, -1),
        (2, 4): (0, 0, -1),
    }
    for pixel, direction in expected.items():
        assert inside[pixel]
        np.testing.assert_allclose(found[pixel], direction, atol=4 * EPS)
    assert not inside[0, 0]
    assert not inside[4, 4]
    assert not inside[0, 1]


@pytest.mark.parametrize("sampling", SAMPLINGS)
@pytest.mark.parametrize("size", [1, 2, 9, 16])
def test_angular_pixel_to_direction_and_back(size, sampling):
    found, inside = directions_and_inside(size, sampling)
    np.testing.assert_allclose(np.linalg.norm(found, axis=-1), 1, atol=4 * EPS)
    position = np.array(oracles.positions(size, sampling))
    column, row = np.meshgrid(position, position)
    np.testing.assert_array_equal(inside, column**2 + row**2 <= 1)
    s, t = angular.angular_coordinates(0.3 * found)
    below = column**2 + row**2 < 1 - 1e-9  # the whole rim is -Z
    np.testing.assert_allclose(s[below], column[below], atol=1e-13)
    np.testing.assert_allclose(t[below], row[below], atol=1e-13)


@given(directions())
def test_angular_direction_to_position_and_back(direction):
    """The radius is the angle from +Z, over pi; right is -X, down is -Y. -Z is on the rim."""
    s, t = angular.angular_coordinates(direction)
    radius = np.hypot(s, t)
    assert radius * np.pi == pytest.approx(
        np.arctan2(np.hypot(direction[0], direction[1]), direction[2]), abs=8 * EPS
    )
    around = [-s * np.sin(np.pi * radius), -t * np.sin(np.pi * radius)]
    np.testing.assert_allclose(around, direction[:2] * radius, atol=8 * EPS)


def test_angular_positions_on_the_axis():
    """Where x and y vanish: +Z is the centre, and -Z is any point of the rim, not the centre."""
    for length in (0.5, 1.0, 3.0):
        np.testing.assert_array_equal(angular.angular_coordinates([0, 0, length]), (0, 0))
        s, t = angular.angular_coordinates([0, 0, -length])
        assert np.hypot(s, t) == pytest.approx(1, abs=2 * EPS)


@pytest.mark.parametrize("sampling", SAMPLINGS)
def test_angular_solid_angles_of_pixels_that_the_rim_cuts(sampling):
    """Only the part inside the rim counts, measured here with 200 x 200 samples."""
    size = 40
    found = angular.Angular(size, sampling).weights()
    at = np.array(oracles.positions(size, sampling))
    step = at[1] - at[0]
    offsets = ((np.arange(200) + 0.5) / 200 - 0.5) * step
    radii = np.hypot(at, at[:, None])
    cut = np.argwhere((radii > 1 - step / 2) & (radii <= 1))
    assert len(cut) > 40
    for row, column in cut:
        radius = np.hypot(at[column] + offsets, at[row] + offsets[:, None])
        density = np.where(radius < 1, np.pi * np.sin(np.pi * radius) / radius, 0)
        assert found[row, column] == pytest.approx(density.mean() * step**2, rel=0.05)


@pytest.mark.parametrize("sampling", SAMPLINGS)
def test_angular_solid_angles_of_whole_pixels(sampling):
    """Against an integral over the pixel, away from the rim."""
    size = 40
    found = angular.Angular(size, sampling).weights()
    at = np.array(oracles.positions(size, sampling))
    step = at[1] - at[0]
    x, x_weights = np.polynomial.legendre.leggauss(6)
    checked = 0
    for row in range(0, size, 3):
        for column in range(0, size, 3):
            fine_x, fine_y = np.meshgrid(at[column] + x * step / 2, at[row] + x * step / 2)
            radius = np.hypot(fine_x, fine_y)
            if radius.max() >= 1 - step:
                continue
            jacobian = np.pi * np.sin(np.pi * radius) / radius
            exact = x_weights @ jacobian @ x_weights * step**2 / 4
            assert found[row, column] == pytest.approx(exact, rel=2 * step**2, abs=2 * step**4)
            checked += 1
    assert checked > 60


@pytest.mark.parametrize("sampling", SAMPLINGS)
def test_angular_solid_angles_integrate_polynomials(sampling):
    found = angular.Angular(129, sampling).weights()
    along, inside = directions_and_inside(129, sampling)
    assert not found[~inside].any()
    assert found[inside].min() > 0
    assert found.sum() == pytest.approx(4 * np.pi)
    np.testing.assert_allclose(np.einsum("ij,ijk->k", found, along), 0, atol=4e-3)
    second = np.einsum("ij,ijk,ijl->kl", found, along, along)
    np.testing.assert_allclose(second, np.eye(3) * 4 * np.pi / 3, atol=4e-3)
