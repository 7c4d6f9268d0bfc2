"""The order that a mesh is baked to, against integrals over the opening of a room."""

import numpy as np
import pytest

from shrm_cli.errors import ArgumentError
from shrm_cli.geometry.mesh import make_mesh
from shrm_cli.geometry.rays import Rays
from shrm_cli.transfer.bake import Plan, transfer_plan
from shrm_cli.transfer.gather import MISSED, ORDERS, missed_by_order, sites_of, sufficient_order
from tests.oracles import real_harmonics
from tests.transfer import meshes

SIZE = np.array([4.0, 3.0, 4.0])
"""A room from the origin to here, which is open at its largest z."""


def room(step):
    """Its five walls, in points of a grid each, with normals that look inwards."""
    vertices, normals, faces = [], [], []
    for axis, is_far in ((0, 0), (0, 1), (1, 0), (1, 1), (2, 0)):
        along = [other for other in range(3) if other != axis]
        first, second = (np.linspace(0, SIZE[other], step) for other in along)
        points = np.zeros((step, step, 3))
        points[..., along[0]], points[..., along[1]] = np.meshgrid(first, second, indexing="ij")
        points[..., axis] = is_far * SIZE[axis]
        start = sum(map(len, vertices))
        index = start + np.arange(step * step).reshape(step, step)
        a, b, c, d = (
            each.ravel()
            for each in (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:])
        )
        faces += [np.stack([a, b, c], -1), np.stack([a, c, d], -1)]
        vertices.append(points.reshape(-1, 3))
        normals.append(np.tile(np.eye(3)[axis] * (1 - 2 * is_far), (step * step, 1)))
    return make_mesh("room", np.vstack(vertices), np.vstack(faces), np.vstack(normals))


def through_the_opening(points, normals, directions):
    """The cosines of directions at each point, 0 for those that a wall is in the way of."""
    result = []
    for point, normal in zip(points, normals, strict=True):
        away = (SIZE[2] - point[2]) / np.maximum(directions[:, 2], 1e-12)
        x, y = point[:2, None] + away * directions[:, :2].T
        free = (directions[:, 2] > 0) & (x > 0) & (x < SIZE[0]) & (y > 0) & (y < SIZE[1])
        result.append(free * np.maximum(directions @ normal, 0))
    return np.array(result)


def evenly(count):
    heights = 1 - (2 * np.arange(count) + 1) / count
    turns = np.pi * (3 - np.sqrt(5)) * np.arange(count)
    flat = np.sqrt(1 - heights**2)
    return np.stack([flat * np.cos(turns), flat * np.sin(turns), heights], axis=-1)


def test_what_orders_miss_is_what_the_irradiance_of_random_lights_misses():
    mesh, directions, last = room(9), evenly(10_000), ORDERS[-1]
    sites = sites_of(mesh)
    seen = through_the_opening(sites.origins, mesh.normals, directions)
    transfer = seen @ real_harmonics(last, directions)
    transfer *= 4 * np.pi / len(directions)
    degree = np.floor(np.sqrt(np.arange((last + 1) ** 2)))
    rng = np.random.default_rng(5)
    lights = rng.standard_normal(((last + 1) ** 2, 400)) / (degree[:, None] + 1)
    found = missed_by_order(sites, Rays(mesh))
    whole = transfer @ lights
    for order in ORDERS[:-1]:
        missed = transfer[:, degree > order] @ lights[degree > order]
        expected = np.sqrt(np.sum(missed**2) / np.sum(whole**2))
        assert found[order] == pytest.approx(expected, rel=0.15), order
    assert found[last] == 0


def test_rooms_take_more_than_bodies():
    body, open_room = meshes.sphere(2), room(9)
    assert transfer_plan(body).order == 4
    assert transfer_plan(meshes.bumps(24)).order == 6
    assert transfer_plan(open_room).order == 12
    missed = missed_by_order(sites_of(open_room), Rays(open_room))
    assert missed[12] <= MISSED < missed[10]
    assert transfer_plan(open_room, order=5).order == 5
    assert transfer_plan(open_room, matrices=True).order == 4


def test_what_sees_nothing_takes_the_least_order():
    """Within a closed sphere nothing is lit, but for the noise of rays along its triangles."""
    closed = meshes.sphere(1, inwards=True)
    assert sufficient_order(sites_of(closed), Rays(closed)) in ORDERS


def test_matrices_end_before_vectors_do():
    Plan(room(2), 16)
    with pytest.raises(ArgumentError, match=r"0 \.\. 8"):
        Plan(room(2), 9, glossy=True)
