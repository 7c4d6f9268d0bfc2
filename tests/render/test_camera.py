"""The viewer's axes, and which normal and which direction each pixel sees."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shrm_cli.render import camera
from shrm_cli.render.camera import Viewer

VIEWERS = st.builds(Viewer, st.floats(-720, 720), st.floats(-90, 90))


@pytest.mark.parametrize(
    ("azimuth", "elevation", "right", "up", "direction"),
    [
        (0, 0, (1, 0, 0), (0, 1, 0), (0, 0, 1)),
        (90, 0, (0, 0, -1), (0, 1, 0), (1, 0, 0)),
        (180, 0, (-1, 0, 0), (0, 1, 0), (0, 0, -1)),
        (-90, 0, (0, 0, 1), (0, 1, 0), (-1, 0, 0)),
        (0, 90, (1, 0, 0), (0, 0, -1), (0, 1, 0)),
        (0, -90, (1, 0, 0), (0, 0, 1), (0, -1, 0)),
        (90, 90, (0, 0, -1), (-1, 0, 0), (0, 1, 0)),
    ],
)
def test_axes_of_known_views(azimuth, elevation, right, up, direction):
    axes = Viewer(azimuth, elevation).axes()
    np.testing.assert_allclose(axes, [right, up, direction], atol=1e-15)


@given(VIEWERS)
def test_axes_are_a_rotation_with_a_level_horizon(viewer):
    right, up, direction = axes = viewer.axes()
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-14)
    np.testing.assert_allclose(np.cross(right, up), direction, atol=1e-14)
    assert right[1] == 0
    assert up[1] > -1e-15
    np.testing.assert_array_equal(direction, viewer.direction)


@pytest.mark.parametrize("pole", [-90.0, 90.0])
@pytest.mark.parametrize("azimuth", [0.0, 37.0, -140.0])
def test_poles_are_the_limit_at_their_azimuth(azimuth, pole):
    near = Viewer(azimuth, pole * (1 - 1e-9)).axes()
    np.testing.assert_allclose(Viewer(azimuth, pole).axes(), near, atol=1e-8)


@pytest.mark.parametrize("size", [16, 17])
def test_pixel_centers_go_right_and_up(size):
    x, y = camera.pixel_centers(size, 0, size)
    assert x.shape == y.shape == (size, size)
    assert (x[0, 0], y[0, 0]) == (-(size - 1) / 2, (size - 1) / 2)
    assert (x[0, -1], y[-1, 0]) == ((size - 1) / 2, -(size - 1) / 2)
    part_x, part_y = camera.pixel_centers(size, 3, 5)
    np.testing.assert_array_equal(part_x, x[3:5])
    np.testing.assert_array_equal(part_y, y[3:5])


@given(VIEWERS)
def test_normals_face_the_viewer(viewer):
    x, y = np.meshgrid(np.linspace(-0.7, 0.7, 5), np.linspace(-0.7, 0.7, 5))
    normals = camera.sphere_normals(viewer, x, y)
    right, up, direction = viewer.axes()
    np.testing.assert_allclose(np.linalg.norm(normals, axis=-1), 1, rtol=1e-14)
    np.testing.assert_allclose(normals @ right, x, atol=1e-14)
    np.testing.assert_allclose(normals @ up, y, atol=1e-14)
    assert (normals @ direction > 0).all()


def test_points_off_the_sphere_get_the_silhouette():
    normals = camera.sphere_normals(Viewer(), np.array([1.2, -3.0, 0.0]), np.array([0, 4.0, -1.0]))
    np.testing.assert_allclose(normals, [[1, 0, 0], [-0.6, 0.8, 0], [0, -1, 0]], atol=1e-15)


def test_background_is_seen_from_inside_under_fifty_degrees():
    size = 500
    directions = camera.background_directions(Viewer(), size, 0, size)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=-1), 1, rtol=1e-14)
    # Facing -Z with +Y up, the right hand points to +X.
    half = np.tan(np.radians(25)) * (1 - 1 / size)
    for row, column, x, y in [(0, 0, -half, half), (0, -1, half, half), (-1, 0, -half, -half)]:
        expected = np.array([x, y, -1]) / np.sqrt(x * x + y * y + 1)
        np.testing.assert_allclose(directions[row, column], expected, atol=1e-14)
    middle = directions[250, [0, -1]]
    angle = np.degrees(np.arccos(middle[0] @ middle[1]))
    assert 49.8 < angle < 50
    np.testing.assert_array_equal(
        camera.background_directions(Viewer(), size, 7, 9), directions[7:9]
    )


@pytest.mark.parametrize(("azimuth", "elevation"), [(90, 0), (20, 70), (-130, -90)])
def test_background_turns_with_the_viewer(azimuth, elevation):
    viewer = Viewer(azimuth, elevation)
    seen = camera.background_directions(viewer, 8, 0, 8)
    straight = camera.background_directions(Viewer(), 8, 0, 8)
    np.testing.assert_allclose(seen, straight @ viewer.axes(), atol=1e-14)


@pytest.mark.parametrize("size", [16, 33, 100])
def test_coverage_is_the_area_under_the_disc(size):
    x, y = camera.pixel_centers(size, 0, size)
    coverage = camera.sphere_coverage(size, x, y)
    radius = 0.45 * size
    steps = (np.arange(100) + 0.5) / 100 - 0.5
    brute = np.zeros((size, size))
    for dx in steps:
        columns = (x + dx) ** 2
        for dy in steps:
            brute += columns + (y + dy) ** 2 < radius**2
    np.testing.assert_allclose(coverage, brute / 1e4, atol=2e-3)
    np.testing.assert_allclose(coverage.sum(), np.pi * radius**2, rtol=1e-4)
    assert coverage[size // 2, size // 2] == 1
    assert coverage[0, 0] == 0


def test_turning_changes_the_azimuth_alone():
    assert Viewer(350, 20).turned(30) == Viewer(380, 20)
    np.testing.assert_allclose(Viewer(380, 20).axes(), Viewer(20, 20).axes(), atol=1e-14)
