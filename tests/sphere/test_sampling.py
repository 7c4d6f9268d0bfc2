"""Looking up images on the sphere: exact enough, and without seams."""

import numpy as np
import pytest

from shrm_cli.sphere.cube import CubeSampler
from shrm_cli.sphere.grid.angular import AngularSampler
from shrm_cli.sphere.grid.latlong import LatLongSampler, sample_latlong_cubic
from tests import oracles

ORDER = 6
SAMPLINGS = ["center", "border"]
KINDS = ["cube", "latlong", "angular"]
EDGES = [
    ((1, 0, 1), (0, 1, 0)),
    ((1, 1, 0), (0, 0, 1)),
    ((0, -1, 1), (1, 0, 0)),
    ((-1, 0, -1), (0, 1, 0)),
    ((0, 1, -1), (1, 0, 0)),
]


def make_function(rng, order=ORDER):
    """Two band-limited channels of unit size."""
    c = rng.standard_normal(((order + 1) ** 2, 2))
    c /= np.sqrt(np.sum(c**2, axis=0) / (4 * np.pi))
    return lambda directions: oracles.real_harmonics(order, directions) @ c


def angular_pixels(size, sampling):
    s = np.array(oracles.positions(size, sampling))
    r = np.maximum(np.hypot(s[:, None], s), 1e-12)
    flat = np.sin(np.pi * r) / r
    return np.stack([-s * flat, -s[:, None] * flat, np.cos(np.pi * r)], axis=-1), r <= 1


def make_sampler(kind, f, size, sampling):
    """A lookup in an image of f with about `size` pixels for half a turn."""
    if kind == "cube":
        image = f(oracles.cube_texels(size // 2, sampling))
        return CubeSampler(image.reshape(3 * size, size // 2, -1), sampling)
    if kind == "latlong":
        image = f(oracles.latlong_pixels(2 * size, size, sampling))
        return LatLongSampler(image, sampling)
    directions, inside = angular_pixels(2 * size, sampling)
    image = np.where(inside[..., None], f(directions), 1e6)  # which must not be seen
    return AngularSampler(image, sampling)


def around(axis, rng, radius=0.03, count=1000):
    vectors = np.array(axis) + radius * oracles.random_directions(rng, count)
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def places(rng):
    """Everywhere, the axes, edges and corners of a cube, the poles and the seam of a lat-long."""
    result = {"everywhere": oracles.random_directions(rng, 8000)}
    for axis in ((0, 0, 1), (0, 0, -1), (0, 1, 0), (0, -1, 0), (1, 0, 0)):
        result[f"near {axis}"] = around(axis, rng)
    for axis in ((1, 0, 1), (1, 1, 0), (0, 1, -1)):
        result[f"edge {axis}"] = around(np.array(axis) / np.sqrt(2), rng)
    for axis in ((1, 1, 1), (-1, 1, 1), (1, -1, -1)):
        result[f"corner {axis}"] = around(np.array(axis) / np.sqrt(3), rng)
    z = -np.cos(np.linspace(0, 1, 1000))
    result["seam"] = np.stack([0 * z, np.sqrt(1 - z * z), z], axis=-1)
    return result


@pytest.mark.proof
@pytest.mark.parametrize("sampling", SAMPLINGS)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.slow
def test_error_falls_as_the_filter_promises(rng, kind, sampling):
    """Third power of the size for the cubic filter, second for the bilinear ones, everywhere."""
    f = make_function(rng)
    error, power = {"cube": (2e-3, 3), "latlong": (0.026, 2), "angular": (0.125, 2)}[kind]
    for size in (64, 128):
        sampler = make_sampler(kind, f, size, sampling)
        for name, directions in places(rng).items():
            found = np.abs(sampler(directions) - f(directions)).max()
            assert found < error * (64 / size) ** power, (name, size)


@pytest.mark.parametrize("sampling", SAMPLINGS)
@pytest.mark.parametrize("kind", KINDS)
def test_texels_are_found_at_their_directions(rng, kind, sampling):
    """No half pixel lost."""
    size = 10
    f = make_function(rng, 9)
    sampler = make_sampler(kind, f, size, sampling)
    if kind == "cube":
        directions = oracles.cube_texels(size // 2, sampling)
    elif kind == "latlong":
        directions = oracles.latlong_pixels(2 * size, size, sampling)
    else:
        directions, inside = angular_pixels(2 * size, sampling)
        r = np.hypot(*np.meshgrid(*2 * [oracles.positions(2 * size, sampling)]))
        directions = directions[inside & (r < 1 - 1e-9)]  # the rim is one point
    np.testing.assert_allclose(sampler(directions), f(directions), atol=1e-9)


def walk(start, end, count=2001):
    steps = np.linspace(-1, 1, count)[:, None]
    return np.array(start, float) + steps * np.array(end, float)


def largest_step(sampler, path):
    return np.abs(
        np.diff(sampler(path / np.linalg.norm(path, axis=1, keepdims=True)), axis=0)
    ).max()


PATHS = {
    **{
        f"over the edge {edge}": walk(
            np.array(edge) + 0.3 * np.array(along), 0.05 * np.cross(edge, along)
        )
        for edge, along in EDGES
    },
    **{
        f"over the corner {corner}": walk(corner, 0.05 * np.cross(corner, (0.3, 1, 0.2)))
        for corner in ((1, 1, 1), (-1, 1, 1), (1, -1, -1), (-1, -1, 1))
    },
    "over the seam": walk((0, 0.3, -1), (0.05, 0, 0)),
    "over the north pole": walk((0, 1, 0), (0.05, 0, 0.02)),
    "past the south pole": walk((0.001, -1, 0), (0.003, 0, 0.05)),
    "over -Z": walk((0, 0, -1), (0.03, 0.05, 0)),
    "past -Z": walk((0.0003, 0, -1), (0, 0.05, 0)),
    "over +Z": walk((0, 0, 1), (0.03, 0.05, 0)),
}


@pytest.mark.proof
@pytest.mark.parametrize("sampling", SAMPLINGS)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.slow
def test_no_seams_in_smooth_images(rng, kind, sampling):
    """Along a fine path the steps are those of the function: a jump would stand out."""
    f = make_function(rng)
    # A filter's jumps, of 1 for the size of the function, fall with its power.
    jump, power = {"cube": (5e-4, 3), "latlong": (0.01, 2), "angular": (0.1, 1.7)}[kind]
    for size in (64, 128):
        sampler = make_sampler(kind, f, size, sampling)
        for name, path in PATHS.items():
            smooth = largest_step(f, path)
            assert smooth < 1e-3
            step = largest_step(sampler, path)
            assert step < 1.5 * smooth + jump * (64 / size) ** power, (name, size)


def test_border_sampled_cubes_have_no_seams_at_all(rng):
    """Whatever the image: the faces share the texels of their edges."""
    directions = oracles.cube_texels(8, "border").reshape(-1, 3)
    _, where = np.unique(np.round(directions, 9) + 0.0, axis=0, return_inverse=True)
    image = rng.random((where.max() + 1, 1))[where.ravel()].reshape(48, 8, 1)
    sampler = CubeSampler(image, "border")
    for edge, along in EDGES:
        across = np.cross(edge, along) * 1e-9
        at = np.array(edge) + np.linspace(-0.99, 0.99, 500)[:, None] * np.array(along)
        np.testing.assert_allclose(sampler(at + across), sampler(at - across), atol=1e-7)


@pytest.mark.parametrize("sampling", SAMPLINGS)
def test_latlongs_have_no_seam_at_all(rng, sampling):
    """Whatever the image, as long as the columns that border sampling repeats are the same."""
    image = rng.random((16, 32, 2))
    if sampling == "border":
        image[:, -1] = image[:, 0]
    y = np.linspace(-5, 5, 1000)
    right, left = (np.stack([0 * y + x, y, 0 * y - 1], axis=-1) for x in (1e-9, -1e-9))
    np.testing.assert_allclose(
        LatLongSampler(image, sampling)(right), LatLongSampler(image, sampling)(left), atol=1e-6
    )


def test_latlong_beyond_the_pole(rng):
    """Half a row above the top row is the mean of it and of itself half a turn away."""
    image = rng.random((8, 16, 1))
    longitude = 2 * np.pi * (0.5 - (3 + 0.5) / 16)  # the centre of column 3
    tiny = 1e-9
    direction = np.array([tiny * np.sin(longitude), 1, tiny * np.cos(longitude)])
    expected = (image[0, 3] + image[0, 11]) / 2
    np.testing.assert_allclose(LatLongSampler(image, "center")(direction), expected, atol=1e-7)
    np.testing.assert_allclose(
        LatLongSampler(image, "center")(direction * [1, -1, 1]),
        (image[-1, 3] + image[-1, 11]) / 2,
        atol=1e-7,
    )


def test_bilinear_halfway(rng):
    """Between four pixels, their mean; elsewhere never beyond them."""
    image = rng.random((8, 16, 1))
    theta, longitude = np.pi * 3 / 8, 2 * np.pi * (0.5 - 5 / 16)
    direction = np.array(
        [np.sin(theta) * np.sin(longitude), np.cos(theta), np.sin(theta) * np.cos(longitude)]
    )
    found = LatLongSampler(image, "center")(direction)
    np.testing.assert_allclose(found, image[2:4, 4:6].mean(axis=(0, 1)), rtol=1e-12)
    many = oracles.random_directions(rng, 5000)
    for sampling in SAMPLINGS:
        assert np.ptp(LatLongSampler(image, sampling)(many)) <= np.ptp(image)
        assert np.ptp(AngularSampler(image[:, :8], sampling)(many)) <= np.ptp(image)


@pytest.mark.parametrize("sampling", SAMPLINGS)
@pytest.mark.parametrize("size", [1, 2, 3, 4])
def test_tiny_constant_images_are_constant(rng, size, sampling):
    directions = np.concatenate(
        [oracles.random_directions(rng, 500), np.eye(3), -np.eye(3), np.ones((1, 3)) / np.sqrt(3)]
    )
    value = np.array([0.25, 3.0, 1e4], np.float32)
    cube = CubeSampler(np.tile(value, (6 * size, size, 1)), sampling)(directions)
    latlong = LatLongSampler(np.tile(value, (size, 2 * size, 1)), sampling)(directions)
    angular = AngularSampler(np.tile(value, (size, size, 1)), sampling)(directions)
    for found in (cube, latlong, angular):
        assert found.shape == (len(directions), 3)
        np.testing.assert_allclose(found, np.tile(value, (len(directions), 1)), rtol=1e-5)


@pytest.mark.parametrize("kind", KINDS)
def test_shapes(rng, kind):
    sampler = make_sampler(kind, make_function(rng), 8, "center")
    for shape in ((), (5,), (2, 3), (0,)):
        assert sampler(oracles.random_directions(rng, *shape)).shape == (*shape, 2)


def test_directions_of_any_length(rng):
    sampler = make_sampler("cube", make_function(rng), 8, "center")
    directions = oracles.random_directions(rng, 100)
    np.testing.assert_allclose(sampler(directions * 7.5), sampler(directions), atol=1e-9)


def test_images_of_low_precision(rng):
    """Half and 8-bit images are filtered in float32."""
    directions = oracles.random_directions(rng, 200)
    levels = rng.integers(0, 256, (24, 4, 3))
    expected = CubeSampler(levels.astype(float))(directions)
    for dtype in (np.uint8, np.float16, np.float32):
        found = CubeSampler(levels.astype(dtype))(directions)
        np.testing.assert_allclose(found, expected, atol=1e-3)


# ---- the cubic filter of a lat-long --------------------------------------------------------------


def latlong_of(f, height):
    return f(oracles.latlong_pixels(2 * height, height))


@pytest.mark.slow
def test_cubic_latlong_error_falls_with_the_third_power(rng):
    """Everywhere: the poles and the seam too."""
    f = make_function(rng)
    for size in (32, 64, 128):
        image = latlong_of(f, size)
        for name, directions in places(rng).items():
            found = np.abs(sample_latlong_cubic(image, directions) - f(directions)).max()
            assert found < 2e-3 * (64 / size) ** 3, (name, size)


def test_cubic_latlong_finds_its_pixels(rng):
    f = make_function(rng, 9)
    directions = oracles.latlong_pixels(20, 10)
    found = sample_latlong_cubic(f(directions), directions)
    np.testing.assert_allclose(found, f(directions), atol=1e-9)


def test_cubic_latlong_is_catmull_rom(rng):
    """Inside: the matrix of Catmull and Rom along rows, then along the column."""
    image = rng.random((10, 20, 1))
    basis = np.array([[0, 2, 0, 0], [-1, 0, 1, 0], [2, -5, 4, -1], [-1, 3, -3, 1]]) / 2
    for row, column, down, along in ((4, 9, 0.3, 0.8), (2, 4, 0.5, 0.5), (6, 13, 0.01, 0.99)):
        theta = np.pi * (row + down + 0.5) / 10
        turn = 2 * np.pi * (0.5 - (column + along + 0.5) / 20)
        direction = np.array(
            [np.sin(theta) * np.sin(turn), np.cos(theta), np.sin(theta) * np.cos(turn)]
        )
        block = image[row - 1 : row + 3, column - 1 : column + 3, 0]
        x, y = (np.array([1, f, f * f, f**3]) @ basis for f in (along, down))
        found = sample_latlong_cubic(image, direction)
        np.testing.assert_allclose(found, [y @ block @ x], atol=1e-12)


def test_cubic_latlongs_have_no_seams(rng):
    """Whatever the image: at longitude 180 degrees, and over the poles."""
    image = rng.random((16, 32, 2))
    y = np.linspace(-5, 5, 1000)
    right, left = (np.stack([0 * y + x, y, 0 * y - 1], axis=-1) for x in (1e-9, -1e-9))
    np.testing.assert_allclose(
        sample_latlong_cubic(image, right), sample_latlong_cubic(image, left), atol=1e-6
    )
    for pole in (1.0, -1.0):
        turn = np.linspace(-np.pi, np.pi, 101)
        tiny = 1e-10 * np.stack([np.sin(turn), 0 * turn, np.cos(turn)], axis=-1)
        here, there = (sample_latlong_cubic(image, [0, pole, 0] + s * tiny) for s in (1, -1))
        np.testing.assert_allclose(here, there, atol=1e-7)


def test_cubic_latlong_beyond_the_pole(rng):
    """At the pole: rows 0 and 1 and the same ones half a turn away, by (-1, 9, 9, -1) / 16."""
    image = rng.random((8, 16, 1))
    longitude = 2 * np.pi * (0.5 - (3 + 0.5) / 16)  # the centre of column 3
    tiny = 1e-9
    for pole, rows in ((1, (0, 1)), (-1, (7, 6))):
        direction = np.array([tiny * np.sin(longitude), pole, tiny * np.cos(longitude)])
        expected = sum(9 * image[rows[0], k] - image[rows[1], k] for k in (3, 11)) / 16
        np.testing.assert_allclose(sample_latlong_cubic(image, direction), expected, atol=1e-6)


@pytest.mark.parametrize("height", [2, 3, 4])
def test_cubic_filter_of_tiny_constant_latlongs(rng, height):
    """Where the filter is higher than the image, rows are met again."""
    directions = np.concatenate([oracles.random_directions(rng, 500), np.eye(3), -np.eye(3)])
    value = np.array([0.25, 3.0, 1e4], np.float32)
    found = sample_latlong_cubic(np.tile(value, (height, 2 * height, 1)), directions)
    assert found.dtype == np.float32
    np.testing.assert_allclose(found, np.tile(value, (len(directions), 1)), rtol=1e-5)
