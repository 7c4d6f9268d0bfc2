import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shrm_cli.probe.lighting import project
from shrm_cli.probe.probe import Probe
from shrm_cli.sphere.grid.latlong import latlong_directions
from shrm_cli.sphere.rotation import (
    euler_zyz,
    rotate_into_frames,
    rotate_to_frames,
    transform_coefficients,
    turn_about_z,
)
from tests import oracles
from tests.oracles import EPS, random_directions, random_rotation, tolerance, turn
from tests.sphere.strategies import rotations

DEGENERATE = {
    "identity": np.eye(3),
    "turn about z": turn("z", 0.9),
    "half turn about x": np.diag([1.0, -1.0, -1.0]),
    "half turn about y": np.diag([-1.0, 1.0, -1.0]),
    "half turn about z": np.diag([-1.0, -1.0, 1.0]),
    "half turn about a slanted axis": turn("z", 0.7) @ np.diag([-1.0, 1.0, -1.0]),
    "computed half turn": turn("z", -1.2) @ turn("y", np.pi) @ turn("z", 0.5),
    "quarter turn": turn("y", np.pi / 2),
    "cyclic axes": np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
    "mirror x": np.diag([-1.0, 1.0, 1.0]),
    "mirror y": np.diag([1.0, -1.0, 1.0]),
    "mirror z": np.diag([1.0, 1.0, -1.0]),
    "swap x and y": np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
    "inversion": -np.eye(3),
}
MATRICES = [
    *(pytest.param(matrix, id=name) for name, matrix in DEGENERATE.items()),
    *(
        pytest.param(
            random_rotation(np.random.default_rng(seed), mirrored), id=f"random {seed} {mirrored}"
        )
        for seed in range(3)
        for mirrored in (False, True)
    ),
]


def rebuilt(angles):
    a, b, c = angles
    return turn("z", a) @ turn("y", b) @ turn("z", c)


@given(rotations())
def test_euler_angles_rebuild_the_rotation(rotation):
    angles = euler_zyz(rotation)
    assert 0 <= angles[1] <= np.pi
    # 1e-7: beside the degenerate turns two noisy angles share one well-defined sum.
    np.testing.assert_allclose(rebuilt(angles), rotation, atol=1e-7)


@pytest.mark.parametrize(
    "rotation", [pytest.param(m, id=k) for k, m in DEGENERATE.items() if np.linalg.det(m) > 0]
)
def test_euler_angles_of_degenerate_rotations(rotation):
    np.testing.assert_allclose(rebuilt(euler_zyz(rotation)), rotation, atol=8 * EPS)


@pytest.mark.parametrize("tilt", [1e-9, 1e-11])
@pytest.mark.parametrize("base", [0.0, np.pi])
def test_euler_angles_of_computed_rotations_beside_the_degenerate(tilt, base):
    """A product of matrices carries rounding in the small elements, of size `tilt`."""
    there_and_back = turn("x", 0.3) @ turn("y", 0.4) @ turn("y", -0.4) @ turn("x", -0.3)
    for a in np.linspace(-3, 3, 13):
        rotation = there_and_back @ turn("z", a) @ turn("y", base + tilt) @ turn("z", 0.3)
        np.testing.assert_allclose(rebuilt(euler_zyz(rotation)), rotation, atol=16 * EPS)


@given(st.floats(-np.pi, np.pi), st.sampled_from([0.0, np.pi]), st.floats(-np.pi, np.pi))
def test_euler_angles_where_only_a_sum_is_defined(a, b, c):
    rotation = rebuilt((a, b, c))
    np.testing.assert_allclose(rebuilt(euler_zyz(rotation)), rotation, atol=16 * EPS)


@pytest.mark.parametrize("matrix", MATRICES)
def test_coefficients_of_the_rotated_function(rng, matrix):
    """A product of planes ``n.d - h``, whose normals are turned; both integrated by brute force."""
    normals, heights = rng.standard_normal((5, 3)), rng.standard_normal(5)

    def product(planes):
        return lambda directions: np.prod(directions @ planes.T - heights, axis=-1)

    original = oracles.project(product(normals), 5, 5)
    expected = oracles.project(product(normals @ matrix.T), 5, 5)
    assert np.linalg.norm(original) > 1
    np.testing.assert_allclose(
        transform_coefficients(original, matrix),
        expected,
        rtol=0,
        atol=tolerance(5) * np.linalg.norm(original),
    )


@pytest.mark.slow
@pytest.mark.parametrize("order", [20, 110])
@pytest.mark.parametrize("mirrored", [False, True])
def test_values_of_the_rotated_function_at_high_order(rng, order, mirrored):
    """110 lies beyond the orders whose matrices are kept."""
    coefficients = rng.standard_normal((order + 1) ** 2)
    matrix = random_rotation(rng, mirrored)
    directions = random_directions(rng, 4)
    found = oracles.real_harmonics(order, directions) @ transform_coefficients(coefficients, matrix)
    expected = oracles.real_harmonics(order, directions @ matrix) @ coefficients
    scale = np.linalg.norm(coefficients) * (order + 1)
    np.testing.assert_allclose(found, expected, rtol=0, atol=tolerance(order) * scale / 10)


@given(rotations())
def test_rotated_values(rotation):
    generator = np.random.default_rng(5)
    coefficients, directions = generator.standard_normal(49), random_directions(generator, 5)
    found = oracles.real_harmonics(6, directions) @ transform_coefficients(coefficients, rotation)
    expected = oracles.real_harmonics(6, directions @ rotation) @ coefficients
    np.testing.assert_allclose(found, expected, atol=1e-5)  # see the Euler angles above


def test_rotations_compose(rng):
    order = 40
    first, second = random_rotation(rng), random_rotation(rng, mirrored=True)
    coefficients = rng.standard_normal(((order + 1) ** 2, 2))
    np.testing.assert_allclose(
        transform_coefficients(transform_coefficients(coefficients, first), second),
        transform_coefficients(coefficients, second @ first),
        atol=tolerance(order) * 10,
    )


def test_the_power_of_each_degree_stays(rng):
    order = 30
    coefficients = rng.standard_normal((order + 1) ** 2)
    turned = transform_coefficients(coefficients, random_rotation(rng))
    assert abs(turned - coefficients).max() > 0.1
    for degree in range(order + 1):
        rows = slice(degree**2, (degree + 1) ** 2)
        assert np.linalg.norm(turned[rows]) == pytest.approx(
            np.linalg.norm(coefficients[rows]), rel=tolerance(order)
        )


def test_channels_keep_their_shape(rng):
    coefficients, matrix = rng.standard_normal((16, 2, 3)), random_rotation(rng)
    turned = transform_coefficients(coefficients, matrix)
    assert turned.shape == (16, 2, 3)
    np.testing.assert_allclose(
        turned[:, 1, 2], transform_coefficients(coefficients[:, 1, 2], matrix), atol=tolerance(3)
    )


def test_the_kept_matrices_do_not_get_mixed_up(rng):
    """More matrices than the cache holds, asked for twice, and the input left alone."""
    matrices = [random_rotation(rng, mirrored) for mirrored in (False, True) * 3]
    coefficients = rng.standard_normal((25, 1))
    before = coefficients.copy()
    first = [transform_coefficients(coefficients, matrix) for matrix in matrices]
    second = [transform_coefficients(coefficients, matrix) for matrix in matrices]
    np.testing.assert_array_equal(first, second)
    np.testing.assert_array_equal(coefficients, before)
    assert len({array.tobytes() for array in first}) == len(matrices)


FRAMES = np.array([[0.0, 0.0], [0.0, 1.2], [0.8, -2.0], [np.pi / 2, 3.0], [2.9, 0.4], [np.pi, 1.0]])
"""Angles theta, phi of frames, both poles among them."""


@pytest.mark.parametrize("order", [0, 1, 6])
@pytest.mark.parametrize("inverse", [False, True])
def test_functions_seen_from_local_frames(rng, order, inverse):
    """A direction's components in the frame are those of the world after its two turns."""
    theta, phi = FRAMES.T
    coefficients = rng.standard_normal(((order + 1) ** 2, 2, len(FRAMES)))
    found = rotate_to_frames(coefficients, theta, phi, inverse)
    assert found.shape == coefficients.shape
    local = random_directions(rng, 10)
    for at in range(len(FRAMES)):
        world = local @ (turn("z", phi[at]) @ turn("y", theta[at])).T
        here, there = (world, local) if inverse else (local, world)
        np.testing.assert_allclose(
            oracles.real_harmonics(order, here) @ found[..., at],
            oracles.real_harmonics(order, there) @ coefficients[..., at],
            rtol=0,
            atol=tolerance(order) * 10,
        )


def test_to_local_frames_and_back(rng):
    """At an order where nothing is small, without a channel axis, and in single precision."""
    theta, phi = FRAMES.T
    coefficients = rng.standard_normal((41**2, len(FRAMES)))
    local = rotate_to_frames(coefficients, theta, phi)
    assert abs(local - coefficients).max() > 0.1
    back = rotate_to_frames(local, theta, phi, inverse=True)
    np.testing.assert_allclose(back, coefficients, rtol=0, atol=tolerance(40))
    single = rotate_to_frames(coefficients.astype(np.float32), theta, phi)
    assert single.dtype == np.float32
    np.testing.assert_allclose(single, local, rtol=0, atol=1e-5)


@pytest.mark.proof
@pytest.mark.parametrize("name", ["quarter turn", "cyclic axes", "swap x and y", "mirror z"])
@pytest.mark.parametrize("order", [96, 110])
def test_exchanged_axes_at_high_order(rng, name, order):
    """Right angles have matrices of their own; those above order 96 are not kept."""
    coefficients, directions = rng.standard_normal((order + 1) ** 2), random_directions(rng, 3)
    found = oracles.real_harmonics(order, directions) @ transform_coefficients(
        coefficients, DEGENERATE[name]
    )
    expected = oracles.real_harmonics(order, directions @ DEGENERATE[name]) @ coefficients
    scale = np.linalg.norm(coefficients) * (order + 1)
    np.testing.assert_allclose(found, expected, rtol=0, atol=tolerance(order) * scale / 10)


@pytest.mark.parametrize("order", [0, 3, 40])
def test_turns_about_z(rng, order):
    """Each of some functions by each of some angles: values at d are those at d turned back."""
    angles = np.array([0.0, 0.7, -2.3, np.pi])
    coefficients = rng.standard_normal(((order + 1) ** 2, 3))
    directions = random_directions(rng, 10)
    found = turn_about_z(coefficients[..., None], angles)
    assert found.shape == ((order + 1) ** 2, 3, 4)
    for at, angle in enumerate(angles):
        expected = oracles.real_harmonics(order, directions @ turn("z", angle)) @ coefficients
        np.testing.assert_allclose(
            oracles.real_harmonics(order, directions) @ found[..., at],
            expected,
            rtol=0,
            atol=tolerance(order) * 10,
        )


def test_no_turn_about_z_leaves_a_list_as_it_is():
    assert np.array_equal(turn_about_z([1.0, 2.0, 3.0, 4.0], 0.0), [1.0, 2.0, 3.0, 4.0])
    quarter = turn_about_z([1.0, 2.0, 3.0, 4.0], np.pi / 2)  # x becomes y, and y becomes -x
    assert quarter == pytest.approx([1.0, 4.0, 3.0, -2.0], abs=1e-15)


def frames_of(rng, count, mirrored=False):
    """Frames of every kind: the degenerate ones first, and then generic ones."""
    known = list(DEGENERATE.values())
    generic = [random_rotation(rng, mirrored and k % 2 == 1) for k in range(count - len(known))]
    return np.array(known + generic)


@pytest.mark.parametrize("order", [0, 1, 2, 3, 4, 9])
@pytest.mark.parametrize("functions", [(), (3,), (2, 3)])
def test_one_function_seen_from_many_frames(rng, order, functions):
    """At d = F world it is what the function is at world; frames may be mirrored."""
    frames = frames_of(rng, 24, mirrored=True)
    coefficients = rng.standard_normal(((order + 1) ** 2, *functions))
    found = rotate_into_frames(coefficients, frames)
    assert found.shape == (*coefficients.shape, len(frames))
    world = random_directions(rng, 7)
    expected = np.einsum("dn,n...->d...", oracles.real_harmonics(order, world), coefficients)
    for at, frame in enumerate(frames):
        values = oracles.real_harmonics(order, world @ frame.T)
        np.testing.assert_allclose(
            np.einsum("dn,n...->d...", values, found[..., at]),
            expected,
            rtol=0,
            atol=tolerance(order) * 10,
        )


@pytest.mark.parametrize("degree", [1, 2, 3, 17, 64])
def test_rotations_are_orthogonal(rng, degree):
    """The columns of a matrix between the harmonics of one degree."""
    unit = np.zeros(((degree + 1) ** 2, 2 * degree + 1))
    unit[degree**2 :] = np.eye(2 * degree + 1)
    frames = np.array([random_rotation(rng), random_rotation(rng, mirrored=True)])
    for matrix in np.moveaxis(rotate_into_frames(unit, frames)[degree**2 :], -1, 0):
        np.testing.assert_allclose(
            matrix.T @ matrix, np.eye(2 * degree + 1), rtol=0, atol=tolerance(degree)
        )


def test_rotated_coefficients_are_those_of_the_rotated_probe(rng):
    """Two images of one smooth light, the second one of the light turned, both projected."""

    def light(directions):
        bumps = np.array([[0.6, 0.0, 0.8], [-0.36, 0.8, 0.48], [0.0, -1.0, 0.0]])
        return np.exp(4 * (directions @ bumps.T - 1)) @ np.array(
            [[1.0, 0.2, 0.1], [0.3, 2.0, 0.5], [0.1, 0.4, 1.5]]
        )

    directions, order = latlong_directions(128, 64), 20
    frames = frames_of(rng, 16, mirrored=True)
    coefficients = project(Probe.from_array(light(directions)), order).coefficients
    found = rotate_into_frames(coefficients, frames)
    for at, frame in enumerate(frames):
        turned = Probe.from_array(light(directions @ frame))
        expected = project(turned, order).coefficients
        np.testing.assert_allclose(found[..., at], expected, rtol=0, atol=1e-6)
