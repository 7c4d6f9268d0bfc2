import numpy as np
import pytest
from hypothesis import given

from shrm_cli.sphere import grids
from tests import oracles
from tests.oracles import EPS
from tests.sphere.strategies import directions

SAMPLINGS = ["center", "border"]


def test_nodes():
    np.testing.assert_allclose(grids.nodes(4), [-0.75, -0.25, 0.25, 0.75])
    np.testing.assert_allclose(grids.nodes(5, "border"), [-1, -0.5, 0, 0.5, 1])
    assert grids.nodes(1).tolist() == grids.nodes(1, "border").tolist() == [0]


def test_latlong_landmarks():
    """Border-sampled 5 x 3: the seam -Z, then +X, the centre +Z, -X, the seam again."""
    found = grids.latlong_directions(5, 3, "border")
    horizon = [(0, 0, -1), (1, 0, 0), (0, 0, 1), (-1, 0, 0), (0, 0, -1)]
    np.testing.assert_allclose(found[1], horizon, atol=2 * EPS)
    np.testing.assert_allclose(found[0], [(0, 1, 0)] * 5, atol=2 * EPS)
    np.testing.assert_allclose(found[2], [(0, -1, 0)] * 5, atol=2 * EPS)


@pytest.mark.parametrize("sampling", SAMPLINGS)
@pytest.mark.parametrize(("width", "height"), [(8, 4), (10, 5), (64, 32), (7, 2)])
def test_latlong_directions_against_openexr(width, height, sampling):
    np.testing.assert_allclose(
        grids.latlong_directions(width, height, sampling),
        oracles.latlong_pixels(width, height, sampling),
        atol=8 * EPS,
    )


@pytest.mark.parametrize("sampling", SAMPLINGS)
def test_latlong_angles_are_those_of_the_directions(sampling):
    """In the image's own axes, whose x, y, z are world +Z, +X, +Y."""
    theta, longitude = grids.latlong_angles(12, 7, sampling)
    own = oracles.latlong_pixels(12, 7, sampling)[..., [2, 0, 1]]
    sine = np.sin(theta)[:, None]
    np.testing.assert_allclose(own[..., 0], sine * np.cos(longitude), atol=8 * EPS)
    np.testing.assert_allclose(own[..., 1], sine * np.sin(longitude), atol=8 * EPS)
    np.testing.assert_allclose(own[..., 2].T, np.tile(np.cos(theta), (12, 1)), atol=8 * EPS)
    np.testing.assert_allclose(own, oracles.latlong_pixels(12, 7, sampling) @ grids.LATLONG_AXES.T)


@pytest.mark.parametrize("sampling", SAMPLINGS)
@pytest.mark.parametrize(("width", "height"), [(8, 4), (31, 15), (2, 1)])
def test_latlong_pixel_to_direction_and_back(width, height, sampling):
    s, t = grids.latlong_coordinates(7 * grids.latlong_directions(width, height, sampling))
    rows = oracles.positions(height, sampling)
    np.testing.assert_allclose(t, np.transpose([rows] * width), atol=8 * EPS)
    inside = np.abs(rows) < 1 - 1e-9  # at the poles every column is the same
    # The two ends are the same meridian.
    wrapped = np.abs(s - oracles.positions(width, sampling))[inside]
    np.testing.assert_allclose(np.minimum(wrapped, 2 - wrapped), 0, atol=8 * EPS)


@given(directions())
def test_latlong_direction_to_position_and_back(direction):
    s, t = grids.latlong_coordinates(direction)
    assert -1 <= s <= 1
    assert -1 <= t <= 1
    latitude, longitude = -t * np.pi / 2, -s * np.pi
    back = [
        np.sin(longitude) * np.cos(latitude),
        np.sin(latitude),
        np.cos(longitude) * np.cos(latitude),
    ]
    np.testing.assert_allclose(back, direction, atol=8 * EPS)


def integrals_of_cosines(count):
    """Of cos(k theta) sin(theta) over 0..pi, by Gauss-Legendre."""
    x, weights = np.polynomial.legendre.leggauss(count + 40)
    theta = (x + 1) * (np.pi / 2)
    return np.cos(np.outer(np.arange(count), theta)) @ (weights * np.sin(theta)) * (np.pi / 2)


@pytest.mark.parametrize(
    ("height", "sampling"),
    [(n, "center") for n in (1, 2, 3, 4, 7, 8, 64, 101, 512)]
    + [(n, "border") for n in (2, 3, 4, 5, 8, 9, 64, 101, 513)],
)
def test_colatitude_weights_are_exact_below_the_height(height, sampling):
    weights = grids.colatitude_weights(height, sampling)
    theta = (np.array(oracles.positions(height, sampling)) + 1) * (np.pi / 2)
    assert weights.shape == (height,)
    assert weights.min() > 0
    assert weights.sum() == pytest.approx(2, rel=8 * EPS)
    found = np.cos(np.outer(np.arange(height), theta)) @ weights
    np.testing.assert_allclose(found, integrals_of_cosines(height), atol=2 * height * EPS)


@pytest.mark.parametrize("width", [1, 2, 7, 8, 64])
def test_longitude_weights_of_centers(width):
    weights = grids.longitude_weights(width)
    angle = np.pi * np.array(oracles.positions(width, "center"))
    waves = np.exp(1j * np.outer(np.arange(width), angle)) @ weights
    np.testing.assert_allclose(waves, [2 * np.pi] + [0] * (width - 1), atol=8 * width * EPS)


@pytest.mark.parametrize("width", [2, 3, 8, 65])
def test_longitude_weights_of_borders(width):
    """One wave fewer: the two ends are one meridian."""
    weights = grids.longitude_weights(width, "border")
    angle = np.pi * np.array(oracles.positions(width, "border"))
    waves = np.exp(1j * np.outer(np.arange(width - 1), angle)) @ weights
    np.testing.assert_allclose(waves, [2 * np.pi] + [0] * (width - 2), atol=8 * width * EPS)
    assert weights[0] == weights[-1]


@pytest.mark.parametrize("count", [1, 2, 5, 80])
def test_gauss_legendre_against_numpy(count):
    for found, expected in zip(
        grids.gauss_legendre(count), np.polynomial.legendre.leggauss(count), strict=True
    ):
        np.testing.assert_allclose(found, expected, rtol=0, atol=4e-15)


def test_angular_landmarks():
    """Border-sampled 5 x 5: +Z amid, a ring of 90 degrees half way, -Z at the rim."""
    found, inside = grids.angular_directions(5, "border")
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
    found, inside = grids.angular_directions(size, sampling)
    np.testing.assert_allclose(np.linalg.norm(found, axis=-1), 1, atol=4 * EPS)
    position = np.array(oracles.positions(size, sampling))
    column, row = np.meshgrid(position, position)
    np.testing.assert_array_equal(inside, column**2 + row**2 <= 1)
    s, t = grids.angular_coordinates(0.3 * found)
    below = column**2 + row**2 < 1 - 1e-9  # the whole rim is -Z
    np.testing.assert_allclose(s[below], column[below], atol=1e-13)
    np.testing.assert_allclose(t[below], row[below], atol=1e-13)


@given(directions())
def test_angular_direction_to_position_and_back(direction):
    """The radius is the angle from +Z, over pi; right is -X, down is -Y. -Z is on the rim."""
    s, t = grids.angular_coordinates(direction)
    radius = np.hypot(s, t)
    assert radius * np.pi == pytest.approx(
        np.arctan2(np.hypot(direction[0], direction[1]), direction[2]), abs=8 * EPS
    )
    around = [-s * np.sin(np.pi * radius), -t * np.sin(np.pi * radius)]
    np.testing.assert_allclose(around, direction[:2] * radius, atol=8 * EPS)


def test_angular_positions_on_the_axis():
    """Where x and y vanish: +Z is the centre, and -Z is any point of the rim, not the centre."""
    for length in (0.5, 1.0, 3.0):
        np.testing.assert_array_equal(grids.angular_coordinates([0, 0, length]), (0, 0))
        s, t = grids.angular_coordinates([0, 0, -length])
        assert np.hypot(s, t) == pytest.approx(1, abs=2 * EPS)


@pytest.mark.parametrize("sampling", SAMPLINGS)
def test_angular_solid_angles_of_pixels_that_the_rim_cuts(sampling):
    """Only the part inside the rim counts, measured here with 200 x 200 samples."""
    size = 40
    found = grids.angular_solid_angles(size, sampling)
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
    found = grids.angular_solid_angles(size, sampling)
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
    found = grids.angular_solid_angles(129, sampling)
    along, inside = grids.angular_directions(129, sampling)
    assert not found[~inside].any()
    assert found[inside].min() > 0
    assert found.sum() == pytest.approx(4 * np.pi)
    np.testing.assert_allclose(np.einsum("ij,ijk->k", found, along), 0, atol=4e-3)
    second = np.einsum("ij,ijk,ijl->kl", found, along, along)
    np.testing.assert_allclose(second, np.eye(3) * 4 * np.pi / 3, atol=4e-3)
