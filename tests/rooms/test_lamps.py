"""Lamps in closed form against sums over their triangles, and what grids hold of them."""

import json
from dataclasses import replace

import numpy as np
import pytest

import shrm_cli as shrm
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.errors import MeshError
from shrm_cli.geometry.rays import Rays
from shrm_cli.rooms.bake import Gathering, bake
from shrm_cli.rooms.brightness import Brightness
from shrm_cli.rooms.grid import Lattice, read_grid, write_grid
from shrm_cli.rooms.lamps import (
    MOST_LAMPS,
    Lamps,
    SeenLamps,
    lamps_of,
    polygon_coefficients,
    polygon_irradiance,
)
from shrm_cli.rooms.lit import in_grid
from shrm_cli.sphere.directions import horizontal_tangents
from tests.oracles import real_harmonics
from tests.rooms import shapes
from tests.rooms.test_bake import points_of
from tests.rooms.test_grid import directions, lit

SQUARE = np.array([[[-0.5, 0, -0.5], [0.5, 0, -0.5], [0.5, 0, 0.5]],
                   [[-0.5, 0, -0.5], [0.5, 0, 0.5], [-0.5, 0, 0.5]]])  # fmt: skip
"""Triangles that send light down."""


def summed(triangle, point, cuts=120):
    """Directions to small parts of a triangle, and their solid angles, 0 from behind."""
    row, column = (each.ravel() for each in np.meshgrid(*[np.arange(cuts)] * 2, indexing="ij"))
    halves = []
    for third in (1 / 3, 2 / 3):
        inside = row + column < cuts - (third > 0.5)
        halves.append(np.stack([row[inside] + third, column[inside] + third]) / cuts)
    u, v = np.concatenate(halves, axis=1)[..., None]
    a, b, c = triangle - point
    ways = a + u * (b - a) + v * (c - a)
    distance = np.linalg.norm(ways, axis=1)
    area = np.cross(b - a, c - a) / 2 / cuts**2
    return ways / distance[:, None], np.maximum(-(ways @ area) / distance**3, 0)


def seen_triangles(rng, count, away=0.0):
    """Triangles that show their fronts to the origin, not too near, and unit vectors."""
    found = []
    while len(found) < count:
        corners = rng.standard_normal((3, 3)) + away * directions(rng, 1)
        front = np.cross(corners[1] - corners[0], corners[2] - corners[0])
        height = front @ corners[0] / np.linalg.norm(front)
        if abs(height) > 0.2:
            found.append(corners if height < 0 else corners[::-1])
    return np.array(found), directions(rng, count)


@pytest.mark.parametrize("away", [0.0, 4.0])
def test_irradiance_is_lamberts_above_the_horizon(rng, away):
    corners, normals = seen_triangles(rng, 60, away)
    found = polygon_irradiance(np.moveaxis(corners, 0, -1), normals.T)
    above = (np.einsum("ncv,nv->nc", corners, normals) > 0).sum(axis=1)
    assert set(above) == {0, 1, 2, 3}  # those that the horizon cuts, and others
    for triangle, normal, value in zip(corners, normals, found, strict=True):
        ways, areas = summed(triangle, np.zeros(3))
        expected = areas @ np.maximum(ways @ normal, 0)
        assert value == pytest.approx(expected, rel=2e-3, abs=2e-6)
    assert not found[above == 0].any()


@pytest.mark.parametrize("order", [0, 1, 4, 7])
def test_coefficients_are_integrals_over_triangles(rng, order):
    corners, _ = seen_triangles(rng, 8)
    found = polygon_coefficients(np.moveaxis(corners, 0, -1), order)
    for triangle, values in zip(corners, found, strict=True):
        ways, areas = summed(triangle, np.zeros(3))
        expected = areas @ real_harmonics(order, ways)
        np.testing.assert_allclose(values, expected, atol=2e-3 * np.abs(expected).max())


@pytest.mark.parametrize("distance", [0.3, 3.0, 5.5, 12, 60])
def test_lamps_shine_from_their_front_at_all_distances(rng, distance):
    lamps = Lamps(SQUARE, np.array([[1.0, 2, 3], [1, 2, 3]]), np.array([0, 1]))
    below = rng.uniform(-1, 1, (10, 3)) * distance / 2 - [0, distance, 0]
    normals, shares = directions(rng, 10), rng.uniform(0, 1, (10, 2))
    irradiance = lamps.irradiance(below, normals, shares)
    light = lamps.coefficients(below, 3, shares)
    for k, point in enumerate(below):
        parts = [summed(triangle, point) for triangle in SQUARE]
        expected = sum(
            share * areas @ np.maximum(ways @ normals[k], 0)
            for share, (ways, areas) in zip(shares[k], parts, strict=True)
        )
        whole = sum(areas.sum() for _, areas in parts)
        np.testing.assert_allclose(irradiance[k], expected * np.arange(1, 4), atol=0.03 * whole)
        series = sum(
            share * areas @ real_harmonics(3, ways)
            for share, (ways, areas) in zip(shares[k], parts, strict=True)
        )
        np.testing.assert_allclose(light[k], np.outer(series, [1, 2, 3]), atol=0.03 * whole)
    above = below * [1, -1, 1]
    assert not lamps.irradiance(above, normals, shares).any()
    assert not lamps.coefficients(above, 3, shares).any()


def test_shares_are_those_of_probes_that_know_them():
    lamps = Lamps(SQUARE[:1], np.ones((1, 3)), np.array([0]))
    seen = SeenLamps(lamps, np.array([[0.5], [-1], [1], [-1]]), np.zeros((4, 4, 3)))
    probes = np.array([[0, 1, 2], [1, 3, 1], [1, 2, 3]])
    weights = np.array([[0.25, 0.5, 0.25], [0.2, 0.3, 0.5], [0.4, 0.2, 0.4]])
    np.testing.assert_allclose(seen.shares(probes, weights)[:, 0], [0.75, 0, 1])


def ball(middle, radius, cuts):
    """Triangles of a ball, seen from outside, shape (f, 3, 3)."""
    theta, phi = np.linspace(0, np.pi, cuts + 1)[:, None], np.linspace(0, 2 * np.pi, 2 * cuts + 1)
    x, z = np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi)
    points = np.stack([x, np.broadcast_to(np.cos(theta), x.shape), z], axis=-1).round(12)
    a, b, c, d = points[:-1, :-1], points[:-1, 1:], points[1:, :-1], points[1:, 1:]
    quads = [np.stack(each, axis=2).reshape(-1, 3, 3) for each in ((a, b, d), (a, d, c))]
    found = np.concatenate(quads)
    is_sound = np.linalg.norm(
        np.cross(found[:, 1] - found[:, 0], found[:, 2] - found[:, 0]), axis=1
    )
    return radius * found[is_sound > 1e-9] + middle


def test_what_touches_is_one_lamp_and_has_few_triangles(rng):
    fine = ball([0, 0, 0], 0.05, 30)
    panels = SQUARE + np.array([3, 0, 0])
    corners = np.concatenate([fine, panels])
    radiance = np.concatenate([np.full((len(fine), 3), 200.0), np.full((2, 3), 1.0)])
    first, second = lamps_of(corners, radiance)
    np.testing.assert_array_equal(first.rows, np.arange(len(fine)))
    np.testing.assert_array_equal(second.lamps.corners, panels)
    assert len(first.lamps.of) <= 128 < len(fine)
    points, normals = 2 * directions(rng, 50), directions(rng, 50)
    found = first.lamps.irradiance(points, normals, np.ones((50, 1)))
    # From afar that is a disc, whose area is the ball's shadow.
    facing = np.maximum(-np.einsum("nv,nv->n", normals, points) / 2, 0)
    expected = np.pi * 200 * (0.05 / 2) ** 2 * facing
    off = np.sqrt(np.mean((found[:, 0] - expected) ** 2) / np.mean(expected**2))
    assert off < 0.05


def test_no_more_lamps_than_are_looked_for_are_kept():
    corners = np.concatenate([SQUARE + np.array([2 * k, 0, 0]) for k in range(MOST_LAMPS + 6)])
    radiance = np.repeat(np.arange(1.0, MOST_LAMPS + 7), 2)[:, None] * np.ones(3)
    found = lamps_of(corners, radiance)
    assert len(found) == MOST_LAMPS
    assert min(each.lamps.radiance.min() for each in found) == 7  # the brightest


# ---- in grids ------------------------------------------------------------------------------------


def lit_by_lamps():
    """A grid of random light, without walls, whose probes see parts of two lamps."""
    grid, rng = lit(walls=False), np.random.default_rng(8)
    beside = SQUARE[:1] + np.array([1, 0.2, 0])
    corners = np.concatenate([SQUARE, beside]) + np.array([0.5, 1.4, 4])
    lamps = Lamps(corners, rng.uniform(1, 3, (3, 3)), np.array([0, 0, 1]))
    seen = rng.uniform(0, 1, (grid.lattice.count, 2))
    seen[::5, 0] = -1
    others = 0.1 * grid.direct.astype(np.float32)
    return replace(grid, lamps=SeenLamps(lamps, seen, others))


def test_files_hold_lamps_as_the_page_says(tmp_path, rng):
    """Irradiance from the arrays of a file alone, by docs/grid.md."""
    grid = lit_by_lamps()
    write_grid(tmp_path / "a.npz", grid)
    held = np.load(tmp_path / "a.npz", allow_pickle=False)  # noqa: TID251  (what users do)
    settings = json.loads(str(held["settings"]))
    low, high = held["box"]
    shape = np.array(settings["shape"])
    points, normals = rng.uniform(low, high, (15, 3)), directions(rng, 15)
    found = read_grid(tmp_path / "a.npz").irradiance(points, normals)
    np.testing.assert_allclose(grid.irradiance(points, normals), found, rtol=1e-5)
    of = np.repeat(np.arange(len(settings["lamps"])), settings["lamps"])
    factors = np.repeat([np.pi, 2 * np.pi / 3, np.pi / 4], [1, 3, 5])
    for point, normal, value in zip(points, normals, found, strict=True):
        total, light, known = np.zeros((2, 2)), np.zeros((9, 3)), 0.0
        place = np.clip((point - low) / (high - low) * shape - 0.5, 0, shape - 1)
        for probe, (x, y, z) in enumerate(np.ndindex(*shape)):
            share = np.prod(np.maximum(1 - np.abs(place - [x, y, z]), 0))
            way = low + (np.array([x, y, z]) + 0.5) / shape * (high - low) - point
            weight = share * (((1 + normal @ way / np.linalg.norm(way)) / 2) ** 2 + 0.2)
            light += weight * (held["reflected"] + held["others"])[probe]
            known += weight
            is_known = held["seen"][probe] >= 0
            total += np.where(is_known, weight, 0) * [held["seen"][probe], [1, 1]]
        expected = factors * real_harmonics(2, normal[None])[0] @ light / known
        for (*triangle, radiance), lamp in zip(held["lamps"], of, strict=True):
            ways, areas = summed(np.array(triangle), point)
            share = total[0, lamp] / total[1, lamp]
            expected += share * radiance * (areas @ np.maximum(ways @ normal, 0))
        np.testing.assert_allclose(value, np.maximum(expected, 0), rtol=2e-3)


def test_light_of_lamps_is_known_to_any_order(rng):
    grid = lit_by_lamps()
    points, normals = rng.uniform(grid.lattice.low, grid.lattice.high, (20, 3)), directions(rng, 20)
    low, high = grid.light(points, normals), grid.light(points, normals, 5)
    np.testing.assert_allclose(high[:, :9], low, atol=1e-9)
    dark = replace(grid, lamps=replace(grid.lamps, seen=0 * grid.lamps.seen))
    assert np.abs(high[:, 9:]).max() > 0.01
    assert not dark.light(points, normals, 5)[:, 9:].any()


@pytest.mark.parametrize("fault", ["counts", "triangles", "seen", "others", "nan", "many"])
def test_files_whose_lamps_do_not_fit_are_refused(tmp_path, fault):
    grid = lit_by_lamps()
    known = grid.lamps
    if fault == "counts":
        known = replace(known, lamps=replace(known.lamps, of=np.array([0, 2, 2])))
    elif fault == "triangles":
        known = replace(known, lamps=replace(known.lamps, of=np.array([0, 0, 1, 1])))
    elif fault == "seen":
        known = replace(known, seen=known.seen[:, :1])
    elif fault == "others":
        known = replace(known, others=known.others[:, :4])
    elif fault == "nan":
        known = replace(known, seen=known.seen * np.nan)
    else:
        corners = np.zeros((2000, 3, 3))
        many = Lamps(corners, corners[:, 0], np.repeat([0, 1], 1000))
        known = replace(known, lamps=many)
    write_grid(tmp_path / "a.npz", replace(grid, lamps=known))
    with pytest.raises(MeshError, match=r"a\.npz"):
        read_grid(tmp_path / "a.npz")


def test_grids_without_lamps_have_all_light_in_coefficients(tmp_path, rng):
    """As those that were written before."""
    grid = lit_by_lamps()
    write_grid(tmp_path / "a.npz", replace(grid, lamps=None))
    found = read_grid(tmp_path / "a.npz")
    points, normals = rng.uniform(grid.lattice.low, grid.lattice.high, (20, 3)), directions(rng, 20)
    assert found.lamps is None
    np.testing.assert_allclose(
        found.irradiance(points, normals), lit(walls=False).irradiance(points, normals), rtol=1e-6
    )


BALL = ball([2, 2.3, 2], 0.06, 10)
BULB = BALL.reshape(-1, 3), np.arange(3 * len(BALL)).reshape(-1, 3)
LAMPS = {
    "panel": shapes.ceiling_lamp(2),
    "spot": shapes.ceiling_lamp(2, half=0.1),
    "ceiling": shapes.ceiling_lamp(2, half=2),
    "bulb": (*BULB, (BULB[0] - [2, 2.3, 2]) / 0.06),
    "wall": (np.array([[0.05, 1, 1.8], [0.05, 1, 2.2], [0.05, 1.8, 2.2], [0.05, 1.8, 1.8]]),
             np.array([[0, 1, 2], [0, 2, 3]]), np.tile([1.0, 0, 0], (4, 1))),
}  # fmt: skip


@pytest.mark.parametrize("lamp", [
    "panel", "bulb",
    *(pytest.param(each, marks=pytest.mark.proof) for each in ("spot", "ceiling", "wall")),
])  # fmt: skip
def test_a_crate_shadows_lamps_of_all_kinds(rng, lamp):
    """Light straight from lamps, between the probes and on the floor, beside what is gathered.

    What is left are the edges of shadows, which are as soft as the probes lie.
    """
    parts = [
        shapes.box([0, 0, 0], [4, 3, 4]),
        shapes.box([1, 0, 1], [1.8, 0.8, 1.8], inward=False),
        LAMPS[lamp],
    ]
    room = shapes.room(parts, [[0] * 3, [0] * 3, [0] * 3], [[0] * 3, [0] * 3, [5, 4, 3]])
    grid = bake(room, Lattice(*room.mesh.bounds, (10, 8, 10)), 2, samples=256)
    gathering = Gathering(Brightness(room, Rays(room.mesh), 1.0), 2, 1024)
    points, normals = points_of(room, 400, rng)
    points[:200, 1], normals[:200] = 0.02, [0, 1, 0]  # the floor, with its shadows
    both = [gathering.irradiance(points[k : k + 50], normals[k : k + 50], k)
            for k in range(0, 400, 50)]  # fmt: skip
    _, truth, behind = (np.concatenate(each) for each in zip(*both, strict=True))
    free = behind < 0.05

    def off(found):
        return np.sqrt(((found - truth)[free] ** 2).sum() / (truth[free] ** 2).sum())

    error = off(grid.irradiance(points, normals))
    assert error < 0.11
    assert error < 0.6 * off(replace(grid, lamps=None).irradiance(points, normals))


def summed_brdf(gathering, brdf, points, normals, tangents, views):
    """What surfaces reflect, by sums over directions and over points of lamps."""
    around, lamps, _ = gathering._of(gathering._look(points), len(points))
    ways, straight = gathering._arriving(points, 0)
    even, result = gathering._area * (around + lamps), []
    for k, normal in enumerate(normals):
        frame = np.array([tangents[k], np.cross(normal, tangents[k]), normal])
        result.append(sum(
            np.sum(brdf.transfer(each @ frame.T, frame @ views[k]) * light, axis=0)
            for each, light in ((gathering._directions, even[k]), (ways[k], straight[k]))
        ))  # fmt: skip
    return np.array(result)


@pytest.mark.proof
def test_product_textures_reflect_the_lamp_beside_them(rng):
    """A ball just below a lamp, beside sums over all that is seen from its very points."""
    parts = [shapes.box([0, 0, 0], [4, 3, 4]), LAMPS["panel"]]
    room = shapes.room(parts, [[0.6] * 3, [0] * 3], [[0] * 3, [10, 10, 10]])
    grid = bake(room, Lattice(*room.mesh.bounds, (8, 6, 8)), 2, samples=256)
    gathering = Gathering(Brightness(room, Rays(room.mesh), 0.5), 1, 1024)
    normals = directions(rng, 2000)
    normals[:, 2] = np.abs(normals[:, 2])
    points, views = [2.3, 2.55, 2] + 0.3 * normals, np.tile([0.0, 0, 1], (2000, 1))
    given = points, normals, horizontal_tangents(normals), views
    texture = shrm.product("ggx:roughness=0.6", order=4, size=32)
    lit_by, change = in_grid(texture, grid, "auto")
    assert change == 0  # the lamp is known to the texture's order, whatever the grid's is
    some = [each[:80] for each in given]
    truth = summed_brdf(gathering, parse_spec("ggx:roughness=0.6"), *some)
    blind, _ = in_grid(texture, replace(grid, lamps=None), "auto")
    off, before = (
        np.linalg.norm(each.placed_radiance(*some) - truth) / np.linalg.norm(truth)
        for each in (lit_by, blind)
    )
    assert off < 0.06 < 0.15 < before
    shiny, change = in_grid(shrm.product("ggx:roughness=0.4", order=4, size=32), grid, "auto")
    assert change > 0.05
    black = (shiny.placed_radiance(*given) < 0).any(axis=1)
    assert black.mean() < 0.01
