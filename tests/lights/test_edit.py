"""Edited light: dimmed, turned and scaled, against sums over points and probes that are read so."""

import numpy as np
import pytest
import scipy.special

from shrm_cli.errors import ArgumentError, ProbeError
from shrm_cli.lights.edit import Dimming, Edit, edit_light, order_of_index, turn_angles
from shrm_cli.lights.light_files import write_coefficients, write_light_file
from shrm_cli.probe.light_file import read_light_tables
from shrm_cli.probe.lighting import project
from shrm_cli.probe.open import open_probe
from shrm_cli.sphere.directions import turn_about, turn_matrix
from shrm_cli.sphere.quadrature import spiral_directions
from tests import oracles
from tests.cli.helpers import noise
from tests.probe import scenes

RNG = np.random.default_rng(6)
LIGHT = RNG.normal(size=(16, 3))
POINTS = spiral_directions(40000)
AXIS = np.array([0.48, 0.6, -0.64])
TURN = turn_about((1, 2, -2), 130)


def edit(numbers=(), scale=1.0, dimmings=(), turn=None):
    return Edit(numbers, np.broadcast_to(scale, 3), dimmings, np.eye(3) if turn is None else turn)


def coefficients(values, order=3):
    """Integrals over points of the sphere."""
    return (
        4
        * np.pi
        * np.einsum("nk,nc->kc", oracles.real_harmonics(order, POINTS), values)
        / len(POINTS)
    )


def test_light_is_dimmed_about_a_direction():
    dimming = Dimming(AXIS, 0.2, 25.0)
    found = edit(dimmings=[dimming]).of_coefficients(LIGHT)
    angles = np.degrees(np.arccos(np.clip(POINTS @ AXIS, -1, 1)))
    share = 0.5 ** ((1 - np.cos(np.radians(angles))) / (1 - np.cos(np.radians(25.0))))
    light = oracles.real_harmonics(3, POINTS) @ LIGHT
    expected = coefficients(light * (1 - 0.8 * share)[:, None])
    np.testing.assert_allclose(found, expected, atol=2e-3)
    assert np.abs(found - LIGHT).max() > 0.2
    assert dimming.at(1.0) == pytest.approx(0.2)
    assert dimming.at(np.cos(np.radians(25.0))) == pytest.approx(0.6)


def test_a_lamp_beside_what_is_dimmed_keeps_its_light_however_few_coefficients_are_left(tmp_path):
    """What 9 coefficients show of a lamp is everywhere, and so would be what they lose."""
    lamp = tmp_path / "lamp.toml"
    lamp.write_text("[[disc]]\nazimuth = 95\nelevation = 33\nradius = 0.7\nradiance = 100.0\n")
    dimming = Dimming(AXIS, 0.2, 20.0)
    found, _ = edit_light(str(lamp), edit(dimmings=[dimming]), order=2)
    middle = np.array([np.cos(np.radians(33)) * np.sin(np.radians(95)), np.sin(np.radians(33))])
    middle = np.append(middle, np.cos(np.radians(33)) * np.cos(np.radians(95)))
    expected = project(open_probe(lamp), 2).coefficients * dimming.at(middle @ AXIS)
    np.testing.assert_allclose(found, expected, atol=2e-3 * expected[0, 0])
    with pytest.raises(ProbeError, match="the light has order 2"):
        edit_light(str(lamp), edit([(9, np.ones(3))], dimmings=[dimming]), order=2)


@pytest.mark.parametrize("width", [1.0, 12.0, 90.0])
@pytest.mark.parametrize("order", [2, 40])
def test_light_of_any_order_is_dimmed_within_any_width(width, order):
    """Of zonal light of the last degree the integral over the heights is known by many nodes."""
    light = np.zeros(((order + 1) ** 2, 3))
    light[order * (order + 1)] = 1.0  # about +Z
    found = Dimming(np.array([0.0, 0.0, 1.0]), 3.0, width).of(light)
    sharpness = np.log(2) / (1 - np.cos(np.radians(width)))
    nodes, weights = np.polynomial.legendre.leggauss(500)
    change = 2 * np.exp(sharpness * (nodes - 1)) * weights
    degrees = np.arange(order + 1)
    zonal = np.sqrt(degrees + 0.5) * scipy.special.eval_legendre(degrees, nodes[:, None])
    expected = change @ (zonal * zonal[:, -1:])
    expected[-1] += 1
    np.testing.assert_allclose(found[degrees * (degrees + 1), 0], expected, atol=1e-10)


def test_the_narrowest_light_that_cosines_tell_is_dimmed_and_none_narrower(rng):
    """Cosines of directions with themselves are 1 but for rounding, which counts below."""
    axes = rng.normal(size=(200, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    dimmed = [float(Dimming(axis, 0.2, 1e-3).at(axis @ axis)) for axis in axes]
    np.testing.assert_allclose(dimmed, 0.2, rtol=1e-5)
    beside = turn_about(np.cross(AXIS, [0, 1, 0]), 1e-3) @ AXIS
    assert Dimming(AXIS, 0.2, 1e-3).at(AXIS @ beside) == pytest.approx(0.6, rel=1e-5)
    for width in (-30.0, 0.0, 1e-7, 3e-4, 181.0, 360.0):
        with pytest.raises(ArgumentError, match=r"0\.001 \.\. 180 degrees"):
            Dimming(AXIS, 0.2, width)


def test_coefficients_are_set_scaled_and_turned_in_this_order():
    values = np.array([3.0, 2.0, 1.0])
    found = edit([(5, values)], [2, 1, 0.5], turn=TURN).of_coefficients(LIGHT)
    changed = LIGHT.copy()
    changed[5] = values
    light = oracles.real_harmonics(3, POINTS @ TURN) @ (changed * [2, 1, 0.5])
    np.testing.assert_allclose(found, coefficients(light), atol=2e-3)
    np.testing.assert_array_equal(edit().of_coefficients(LIGHT), LIGHT)


def test_a_coefficient_beyond_the_order_is_told():
    with pytest.raises(ProbeError, match="order 3, so that there is no coefficient 4,-2; raise"):
        edit([(18, np.ones(3))]).of_coefficients(LIGHT)
    assert [order_of_index(k) for k in (0, 1, 2, 8, 18)] == ["0,0", "1,-1", "1,0", "2,2", "4,-2"]


@pytest.mark.parametrize("pitch", [0.0, 40.0, -89.0, 90.0, -90.0])
def test_angles_of_a_rotation(pitch):
    matrix = turn_matrix(123.0, pitch, -50.0)
    np.testing.assert_allclose(turn_matrix(*turn_angles(matrix)), matrix, atol=1e-7)
    for _ in range(20):
        matrix = oracles.random_rotation(RNG)
        np.testing.assert_allclose(turn_matrix(*turn_angles(matrix)), matrix, atol=1e-12)


def test_angles_are_written_as_they_were_asked_for():
    assert str(turn_angles(turn_matrix(yaw=30.0))) == "(30.0, 0.0, 0.0)"


@pytest.mark.parametrize("suffix", [".txt", ".npy", ".json"])
def test_written_coefficients_are_read_to_the_last_digit(tmp_path, suffix):
    path = tmp_path / f"a{suffix}"
    write_coefficients(str(path), LIGHT)
    np.testing.assert_array_equal(project(open_probe(path), 3).coefficients, LIGHT)


def test_tables_of_a_light_file_are_turned_and_scaled(tmp_path):
    """The light of the file that is written is that of the other one, turned and scaled."""
    scenes.write(tmp_path / "a.exr", noise(16, 32))
    write_coefficients(str(tmp_path / "a.txt"), LIGHT)
    (tmp_path / "a.toml").write_text(
        'working = "rec2020"\n[[probe]]\nfile = "a.exr"\nyaw = 30\nmirror = true\nup = "z"\n'
        "scale = [1, 2, 3]\nprimaries = 'rec709'\n"
        "[[disc]]\nazimuth = 40\nelevation = 30\nradius = 20\nradiance = 3\n"
        "[[disc]]\ndirection = [1, 2, 3]\nsolid_angle = 0.2\nirradiance = [1, 2, 3]\n"
        '[[sh]]\nfile = "a.txt"\npitch = 20\n'
    )
    tables, working = read_light_tables(str(tmp_path / "a.toml"))
    edited = edit(scale=2.0, turn=TURN).of_tables("a.toml", tables)
    write_light_file(str(tmp_path / "b.toml"), edited, working)
    before, after = (open_probe(tmp_path / name) for name in ("a.toml", "b.toml"))
    light = oracles.real_harmonics(3, POINTS @ TURN) @ project(before, 3).coefficients
    np.testing.assert_allclose(project(after, 3).coefficients, 2 * coefficients(light), atol=0.02)
    assert after.chromaticities == before.chromaticities


def test_discs_are_dimmed_by_their_middle():
    disc = {"direction": (3 * AXIS).tolist(), "radius": 2, "radiance": 5.0}
    found = edit(dimmings=[Dimming(AXIS, 0.2, 25.0)]).of_tables("a.toml", {"disc": [disc]})
    np.testing.assert_allclose(found["disc"][0]["radiance"], 1.0)
    for tables in ({"probe": [{"file": "a.exr"}]}, {"sh": [{"coefficients": [1]}]}):
        with pytest.raises(ProbeError, match="is not dimmed in a light file"):
            edit(dimmings=[Dimming(AXIS, 0.2, 25.0)]).of_tables("a.toml", tables)
    with pytest.raises(ProbeError, match="no coefficients of the whole"):
        edit([(0, np.ones(3))]).of_tables("a.toml", {"disc": [disc]})
