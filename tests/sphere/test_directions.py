import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from shrm_cli.sphere import directions as d
from tests.oracles import EPS, random_directions
from tests.sphere.strategies import directions


@pytest.mark.parametrize(
    ("theta", "phi", "expected"),
    [
        (0, 0, (0, 0, 1)),
        (180, 0, (0, 0, -1)),
        (90, 0, (1, 0, 0)),
        (90, 90, (0, 1, 0)),
        (90, -90, (0, -1, 0)),
        (90, 180, (-1, 0, 0)),
        (60, 30, (0.75, np.sqrt(3) / 4, 0.5)),
    ],
)
def test_angles_of_known_directions(theta, phi, expected):
    np.testing.assert_allclose(
        d.from_angles(np.radians(theta), np.radians(phi)), expected, atol=2 * EPS
    )


@given(directions())
def test_direction_to_angles_and_back(direction):
    theta, phi = d.to_angles(direction)
    assert 0 <= theta <= np.pi
    assert -np.pi <= phi <= np.pi
    np.testing.assert_allclose(d.from_angles(theta, phi), direction, rtol=0, atol=4 * EPS)


@given(st.floats(1e-6, np.pi - 1e-6), st.floats(-3.14, 3.14), st.floats(1e-3, 1e3))
def test_angles_to_direction_and_back_at_any_length(theta, phi, length):
    back = d.to_angles(length * d.from_angles(theta, phi))
    np.testing.assert_allclose(back, (theta, phi), rtol=8 * EPS, atol=8 * EPS)


@pytest.mark.parametrize("offset", [1e-5, 1e-9, 1e-15])
def test_angles_keep_their_digits_beside_the_poles(offset):
    assert d.to_angles([offset, 0, 1])[0] == pytest.approx(offset, rel=1e-9)
    assert np.pi - d.to_angles([0, offset, -1])[0] == pytest.approx(offset, abs=2 * EPS)


def test_angles_broadcast():
    assert d.from_angles(np.zeros((4, 1)), np.zeros(5)).shape == (4, 5, 3)


@pytest.mark.parametrize(
    ("azimuth", "elevation", "expected"),
    [
        (0, 0, (0, 0, 1)),
        (90, 0, (1, 0, 0)),
        (180, 0, (0, 0, -1)),
        (-90, 0, (-1, 0, 0)),
        (123, 90, (0, 1, 0)),
        (0, -90, (0, -1, 0)),
        (90, 30, (np.sqrt(3) / 2, 0.5, 0)),
    ],
)
def test_azimuth_and_elevation(azimuth, elevation, expected):
    np.testing.assert_allclose(d.from_azimuth_elevation(azimuth, elevation), expected, atol=2 * EPS)


@given(directions(), st.floats(1e-6, 1e6))
def test_normalize_undoes_any_length(direction, length):
    np.testing.assert_allclose(d.normalize(length * direction), direction, atol=4 * EPS)


def test_normalize_works_on_each_vector(rng):
    expected = random_directions(rng, 3, 4)
    np.testing.assert_allclose(
        d.normalize(expected * rng.uniform(0.1, 9, (3, 4, 1))), expected, atol=4 * EPS
    )


@given(directions(), directions())
def test_reflection_is_a_mirror(view, normal):
    reflected = d.reflect(view, normal)
    assert np.linalg.norm(reflected) == pytest.approx(1, abs=8 * EPS)
    assert reflected @ normal == pytest.approx(view @ normal, abs=8 * EPS)
    # The tangential parts are opposite, and twice mirrored is the view again.
    np.testing.assert_allclose(np.cross(reflected, normal), -np.cross(view, normal), atol=8 * EPS)
    np.testing.assert_allclose(d.reflect(reflected, normal), view, atol=16 * EPS)


def test_reflection_at_45_degrees():
    np.testing.assert_allclose(
        d.reflect([1.0, 0.0, 0.0], np.array([1.0, 1.0, 0.0]) / np.sqrt(2)), [0, 1, 0], atol=2 * EPS
    )


@given(directions(), directions())
def test_bisector_finds_the_normal_of_a_reflection(view, normal):
    facing = view @ normal
    assume(facing > 1e-3)
    found = d.bisector(d.reflect(view, normal), view)
    np.testing.assert_allclose(found, normal, atol=8 * EPS / facing)


def test_reflect_and_bisector_broadcast(rng):
    views, normal = random_directions(rng, 5, 4), random_directions(rng)
    reflected = d.reflect(views, normal)
    assert reflected.shape == (5, 4, 3)
    np.testing.assert_allclose(reflected[3, 2], d.reflect(views[3, 2], normal), atol=4 * EPS)
    assert d.bisector(reflected, views).shape == (5, 4, 3)


@given(st.floats(0, np.pi), st.floats(-np.pi, np.pi))
def test_local_frame_is_a_turn_by_theta_then_phi(theta, phi):
    expected = Rotation.from_euler("yz", [theta, phi]).as_matrix()  # about the fixed axes
    np.testing.assert_allclose(d.local_frame(theta, phi), expected, atol=8 * EPS)


def test_local_frame_columns_are_the_derivatives(rng):
    theta, phi = rng.uniform(0.3, 2.8, 20), rng.uniform(-3, 3, 20)
    frame, h = d.local_frame(theta, phi), 1e-5
    by_theta = (d.from_angles(theta + h, phi) - d.from_angles(theta - h, phi)) / (2 * h)
    by_phi = (d.from_angles(theta, phi + h) - d.from_angles(theta, phi - h)) / (2 * h)
    np.testing.assert_allclose(frame[..., 0], by_theta, atol=1e-9)
    np.testing.assert_allclose(frame[..., 1], by_phi / np.sin(theta)[:, None], atol=1e-9)
    np.testing.assert_allclose(frame[..., 2], d.from_angles(theta, phi), atol=2 * EPS)
