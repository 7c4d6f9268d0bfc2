import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shrm_cli.sphere import cube
from tests import oracles
from tests.oracles import EPS
from tests.sphere.strategies import directions

SAMPLINGS = ["center", "border"]

# The table of the conventions once more, in words: right / down of each face.
TABLE = """
+X   +Z -Y   -Z -Y
-X   -Z -Y   +Z -Y
+Y   +X -Z   +X +Z
-Y   +X +Z   +X -Z
+Z   -X -Y   +X -Y
-Z   +X -Y   -X -Y
"""
VECTORS = {
    "+X": (1, 0, 0),
    "-X": (-1, 0, 0),
    "+Y": (0, 1, 0),
    "-Y": (0, -1, 0),
    "+Z": (0, 0, 1),
    "-Z": (0, 0, -1),
}


@pytest.mark.parametrize(("orientation", "column"), [("openexr", 1), ("gl", 3)])
def test_face_axes_are_those_of_the_table(orientation, column):
    lines = [line.split() for line in TABLE.strip().splitlines()]
    expected = [
        [VECTORS[line[column]], VECTORS[line[column + 1]], VECTORS[line[0]]] for line in lines
    ]
    np.testing.assert_array_equal(cube.face_axes(orientation), expected)
    np.testing.assert_array_equal(oracles.CUBE_FACES[orientation], expected)
    assert list(cube.FACES) == [line[0] for line in lines]


def test_faces_are_seen_from_inside():
    """Looking out through a face, right x down points away from the viewer in every one of them
    (OpenEXR: the image is not mirrored); GL's faces are those seen from outside."""
    for orientation, handedness in (("openexr", 1), ("gl", -1)):
        for right, down, forward in cube.face_axes(orientation):
            np.testing.assert_array_equal(np.cross(right, down), handedness * forward)


@pytest.mark.parametrize("sampling", SAMPLINGS)
@pytest.mark.parametrize("size", [1, 2, 3, 8])
def test_directions_of_the_texels(size, sampling):
    found = cube.cube_directions(size, sampling)
    assert found.shape == (6 * size, size, 3)
    expected = oracles.cube_texels(size, sampling).reshape(6 * size, size, 3)
    np.testing.assert_allclose(found, expected, atol=4 * EPS)


@pytest.mark.parametrize("sampling", SAMPLINGS)
def test_directions_of_some_texels(sampling):
    rows, columns = np.random.default_rng(1).integers([30, 5], size=(40, 2)).T
    found = cube.texel_directions(rows, columns, 5, sampling)
    np.testing.assert_array_equal(found, cube.cube_directions(5, sampling)[rows, columns])


@pytest.mark.parametrize("size", [2, 5])
def test_border_texels_are_shared_by_the_faces_that_meet_there(size):
    found = cube.cube_directions(size, "border").reshape(-1, 3)
    _, counts = np.unique(np.round(found, 9) + 0.0, axis=0, return_counts=True)
    assert np.sum(counts == 3) == 8
    assert np.sum(counts == 2) == 12 * (size - 2)
    assert np.sum(counts == 1) == 6 * (size - 2) ** 2
    assert len(counts) == 8 + 12 * (size - 2) + 6 * (size - 2) ** 2


@pytest.mark.parametrize("size", [1, 2, 7])
def test_texel_to_direction_and_back(size):
    faces, s, t = cube.cube_coordinates(5 * cube.cube_directions(size))
    at = oracles.positions(size, "center")
    np.testing.assert_array_equal(faces, np.repeat(np.arange(6), size)[:, None] + [[0] * size])
    np.testing.assert_allclose(s, np.tile(at, (6 * size, 1)), atol=4 * EPS)
    np.testing.assert_allclose(t, np.tile(np.transpose([at]), (6, size)), atol=4 * EPS)


@given(directions(), st.floats(1e-3, 1e3))
def test_direction_to_texel_and_back(direction, length):
    """Also on edges and corners, where any of the faces that meet will do."""
    face, s, t = cube.cube_coordinates(length * direction)
    assert abs(s) <= 1 + 4 * EPS
    assert abs(t) <= 1 + 4 * EPS
    right, down, forward = np.array(oracles.CUBE_FACES["openexr"][face], dtype=float)
    point = forward + s * right + t * down
    np.testing.assert_allclose(point / np.linalg.norm(point), direction, atol=8 * EPS)


@pytest.mark.parametrize("sampling", SAMPLINGS)
@pytest.mark.parametrize("size", [1, 2, 5, 6])
def test_solid_angle_of_each_texel(size, sampling):
    """Against the integral of (1 + x^2 + y^2)^(-3/2) over the texel's cell."""
    if sampling == "center" or size == 1:
        edges = np.linspace(-1, 1, size + 1)
    else:
        edges = np.array([-1, *(-1 + (np.arange(size - 1) + 0.5) * 2 / (size - 1)), 1])
    nodes, weights = np.polynomial.legendre.leggauss(40)
    expected = np.empty((size, size))
    for row in range(size):
        for column in range(size):
            half_x = (edges[column + 1] - edges[column]) / 2
            half_y = (edges[row + 1] - edges[row]) / 2
            x, y = np.meshgrid(
                edges[column] + half_x * (nodes + 1), edges[row] + half_y * (nodes + 1)
            )
            density = (1 + x * x + y * y) ** -1.5
            expected[row, column] = weights @ density @ weights * half_x * half_y
    np.testing.assert_allclose(cube.cube_solid_angles(size, sampling), expected, rtol=1e-12)


@pytest.mark.parametrize("sampling", SAMPLINGS)
@pytest.mark.parametrize("size", [1, 2, 33, 256])
def test_solid_angles_of_the_whole_cube(size, sampling):
    found = cube.cube_solid_angles(size, sampling)
    assert found.shape == (size, size)
    assert found.min() > 0
    assert 6 * found.sum() == pytest.approx(4 * np.pi, rel=1e-12)


def reoriented(faces, orientation):
    return np.stack([cube.reoriented(each, k, orientation) for k, each in enumerate(faces)])


@pytest.mark.parametrize("size", [1, 2, 5])
def test_reorient_against_directions(size):
    """An image of the directions themselves: reoriented, each texel holds its own direction."""
    image = oracles.cube_texels(size, "center", "gl")
    np.testing.assert_allclose(
        reoriented(image, "gl"), oracles.cube_texels(size, "center", "openexr"), atol=4 * EPS
    )


def test_reorient_there_and_back(rng):
    """The two orientations differ by mirrorings, so one way is also the way back."""
    image = rng.random((6, 4, 4, 3))
    turned = reoriented(image, "gl")
    assert not np.array_equal(turned, image)
    np.testing.assert_array_equal(reoriented(turned, "gl"), image)


def test_reorient_leaves_openexr_faces(rng):
    for image in (rng.random((6, 3, 3)), rng.random((6, 3, 3, 4)).astype(np.float16)):
        found = reoriented(image, "openexr")
        np.testing.assert_array_equal(found, image)
        assert found.dtype == image.dtype
