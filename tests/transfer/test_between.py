"""How far transfer is off between the vertices of a mesh."""

import numpy as np
import pytest

import shrm_cli as shrm
from shrm_cli.geometry.load import load_mesh
from shrm_cli.transfer.between import error_between
from tests import oracles

HALF, HEIGHT = 0.5, 0.3
"""A square above the middle of a floor of two triangles, from -1 to 1."""


def squares(path, half):
    """Write a floor, and a square of a half edge above it unless that is 0."""
    lines, faces = [], []
    for edge, height in ((1.0, 0.0), (half, HEIGHT)):
        if edge:
            first = len(lines) + 1
            lines += [
                f"v {x} {height} {z}"
                for x, z in ((-edge, -edge), (-edge, edge), (edge, edge), (edge, -edge))
            ]
            faces += [f"f {first} {first + 1} {first + 2}", f"f {first} {first + 2} {first + 3}"]
    path.write_text("\n".join(lines + faces) + "\n")
    return path


def light_of(points, order):
    """Transfer of points of the floor, by sums over directions that miss the square above it."""
    directions, weights = oracles.sphere_rule(60)
    up = directions[:, 1] > 1e-6
    directions, weights = directions[up], weights[up] * directions[up, 1]
    met = points[:, None, [0, 2]] + directions[:, [0, 2]] * (HEIGHT / directions[:, 1:2])
    free = (np.abs(met) > HALF).any(axis=-1)
    return (free * weights) @ oracles.real_harmonics(order, directions)


def test_a_shadow_within_a_triangle_is_told(tmp_path, rng):
    """Against sums over other directions at other points; both squares are seen by the light."""
    path = squares(tmp_path / "table.obj", HALF)
    with pytest.warns(shrm.ShrmWarning, match=r"table.obj: between its vertices light is off by"):
        made = shrm.transfer(path, order=4)
    found = error_between(load_mesh(path), made)
    points = np.zeros((4000, 3))
    points[:, [0, 2]] = rng.uniform(-1, 1, (4000, 2))
    corners = light_of(np.array([[x, 0.0, z] for x in (-1, 1) for z in (-1, 1)]), 4)
    truth = light_of(points, 4)
    x, z = (points[:, each] / 2 + 0.5 for each in (0, 2))
    # Each triangle has three of the corners, whose light is nearly the same.
    shares = np.stack([(1 - x) * (1 - z), (1 - x) * z, x * (1 - z), x * z], axis=1)
    degree = np.repeat(np.arange(5), 2 * np.arange(5) + 1)
    wrong = np.sum(((shares @ corners - truth) / (degree + 1)) ** 2) / len(points)
    floor = np.sum((truth / (degree + 1)) ** 2) / len(points)
    above = np.sum((light_of(np.array([[99.0, 0.0, 0.0]]), 4) / (degree + 1)) ** 2)
    area = 4 * HALF**2 / (4 + 4 * HALF**2)  # of the square, which is off by nothing
    expected = np.sqrt((1 - area) * wrong / ((1 - area) * floor + area * above))
    assert found == pytest.approx(expected, rel=0.12)


def test_a_mesh_without_shadows_is_right_between_its_vertices(tmp_path, recwarn):
    path = squares(tmp_path / "floor.obj", 0)
    assert error_between(load_mesh(path), shrm.transfer(path, order=4)) < 1e-6
    assert not recwarn


def test_texels_are_not_asked(tmp_path, recwarn):
    """Their shadows are where they are."""
    pytest.importorskip("xatlas")
    shrm.transfer(squares(tmp_path / "table.obj", HALF), order=1, samples=16, texture=64)
    assert not recwarn
