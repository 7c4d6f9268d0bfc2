"""Baked rooms against closed forms, and against Mitsuba."""

from dataclasses import replace

import numpy as np
import pytest

from shrm_cli.errors import MeshError
from shrm_cli.geometry.rays import Rays
from shrm_cli.probe.disc import Disc
from shrm_cli.probe.probe import Probe
from shrm_cli.rooms.bake import Gathering, bake
from shrm_cli.rooms.brightness import Brightness, Patches
from shrm_cli.rooms.emitters import Emitters
from shrm_cli.rooms.grid import Lattice
from tests.rooms import shapes


def points_of(room, count, rng):
    """Points between the corners of a room's box, and normals."""
    low, high = room.mesh.bounds
    points = rng.uniform(low, high, (count, 3))
    normals = rng.standard_normal((count, 3))
    return points, normals / np.linalg.norm(normals, axis=1, keepdims=True)


def test_patches_are_found_by_their_points(rng):
    """Each point lies in its patch: by coordinates in it, which none other has within 0 .. 1."""
    room = shapes.room([shapes.box([0, 0, 0], [2, 1, 3])], [[0.5] * 3], [[1] * 3])
    patches = Patches(room, 0.4)
    faces = rng.integers(len(room.mesh.faces), size=3000)
    weights = rng.dirichlet(np.ones(3), size=3000)
    numbers = patches.at(faces, weights)
    np.testing.assert_array_equal(patches.owner[numbers], faces)
    corners = room.mesh.corners(faces)
    cuts = np.sqrt(np.bincount(patches.owner))[faces]
    points = np.einsum("nc,ncv->nv", weights, corners)
    # Of the patches of a triangle, the one that a point lies in has the nearest middle by the
    # metric in which the triangle is equilateral.
    flat = np.array([[0, 0], [1, 0], [0.5, np.sqrt(0.75)]])
    edges = corners[:, 1:] - corners[:, :1]
    for k in range(0, 3000, 37):
        own = np.flatnonzero(patches.owner == faces[k])
        solve = np.linalg.pinv(edges[k].T)
        places = (patches.centers[own] - corners[k, 0]) @ solve.T @ flat[1:]
        place = (points[k] - corners[k, 0]) @ solve.T @ flat[1:]
        nearest = own[np.argmin(np.linalg.norm(places - place, axis=1))]
        assert nearest == numbers[k], cuts[k]


def test_a_furnace_is_equally_bright_everywhere(rng):
    """Walls that send e and reflect a of all light: L = e / (1 - a)."""
    room = shapes.room([shapes.box([-1, -1, -1], [1, 1, 1])], [[0.6, 0.3, 0.9]], [[1, 2, 3]])
    grid = bake(room, Lattice(*room.mesh.bounds, (2, 2, 2)), 2)
    expected = np.pi * np.array([1, 2, 3]) / (1 - np.array([0.6, 0.3, 0.9]))
    points, normals = points_of(room, 100, rng)
    found = grid.irradiance(points, normals)
    np.testing.assert_allclose(found, np.broadcast_to(expected, found.shape), rtol=1e-2)
    assert grid.facts["error"] < 5e-3
    assert grid.alive.all()


@pytest.mark.parametrize("albedo", [0.0, 0.5, 0.97, 0.995])
def test_light_goes_on_until_little_is_left(albedo):
    """Of white walls that send 1, by L = 1 / (1 - a); a hundred bounces left out a half."""
    room = shapes.room([shapes.box([-1, -1, -1], [1, 1, 1])], [[albedo] * 3], [[1, 1, 1]])
    radiance = Brightness(room, Rays(room.mesh), 1.0).radiance[:-1]
    expected = albedo / (1 - albedo)
    np.testing.assert_allclose(radiance, expected, rtol=0.02)
    np.testing.assert_allclose(radiance.mean(axis=0), expected, rtol=2e-3)


def test_walls_that_lose_no_light_are_refused():
    room = shapes.room([shapes.box([-1, -1, -1], [1, 1, 1])], [[0.5, 1.0, 0.5]], [[1, 1, 1]])
    with pytest.raises(MeshError, match=r"^the walls reflect all light.* lower `albedo`$"):
        Brightness(room, Rays(room.mesh), 1.0)


def rectangle_factor(point, normal, corners):
    """Lambert's formula: the irradiance from a polygon of radiance 1 that is above the horizon."""
    ways = corners - point
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    total = np.zeros(3)
    for first, second in zip(ways, np.roll(ways, -1, axis=0), strict=True):
        across = np.cross(first, second)
        total += np.arccos(np.clip(first @ second, -1, 1)) * across / np.linalg.norm(across)
    return abs(total @ normal) / 2


@pytest.mark.parametrize("half", [0.02, 1.4])
def test_light_straight_from_a_lamp_is_that_of_lamberts_formula(rng, half):
    parts = [shapes.box([0, 0, 0], [4, 3, 4]), shapes.ceiling_lamp(2, half=half)]
    room = shapes.room(parts, [[0] * 3] * 2, [[0] * 3, [3, 2, 1]])
    gathering = Gathering(Brightness(room, Rays(room.mesh), 1.0), 2, 1024)
    points = rng.uniform([0, 0, 0], [4, 2.5, 4], (200, 3))
    up = np.tile([0.0, 1, 0], (200, 1))
    reflected, direct, behind = gathering.irradiance(points, up)
    corners = shapes.ceiling_lamp(2, half=half)[0]
    expected = np.array([rectangle_factor(point, up[0], corners) for point in points])
    off = direct / (expected[:, None] * [3, 2, 1]) - 1
    assert np.sqrt(np.mean(off**2)) < 0.02
    assert abs(off.mean()) < 0.003
    assert reflected.max() == 0
    assert behind.max() == 0


def test_a_lamp_between_many_is_found(rng):
    """Half of the samples go by area, so that a dim lamp next door has enough of them."""
    room = shapes.two_rooms(bright=1e4)
    emitters = Emitters(room, Rays(room.mesh), 256)
    points = rng.uniform([4.4, 0.5, 0.5], [8, 2, 3.5], (50, 3))
    directions, light = emitters.arriving(points, 0, lambda ways: np.zeros(ways.shape[:2]))
    found = np.einsum("ns,nsc->nc", np.maximum(directions[..., 1], 0), light)
    corners = shapes.ceiling_lamp(6.2)[0]
    expected = [rectangle_factor(point, np.array([0, 1.0, 0]), corners) for point in points]
    off = found[:, 0] / (0.3 * np.array(expected)) - 1
    assert np.sqrt(np.mean(off**2)) < 0.03


def test_lamps_of_many_triangles_do_not_hide_themselves_and_what_is_near_does(rng):
    """By a tilted lamp of 3200, and by a lid 1.5 mm beneath a lamp, a thousandth of the way."""
    across = np.linspace(1.5, 2.5, 41)
    x, z = (each.ravel() for each in np.meshgrid(across, across, indexing="ij"))
    first = (np.arange(40)[:, None] * 41 + np.arange(40)).reshape(-1, 1)
    faces = np.concatenate([first + np.array(each) for each in ((0, 41, 42), (0, 42, 1))])
    normal = np.array([-0.3, -1, -0.2]) / np.sqrt(1.13)
    points = np.stack([x, 2.9 - 0.3 * (x - 1.5) - 0.2 * (z - 1.5), z], axis=1)
    tilted = points, faces, np.tile(normal, (len(x), 1))
    lid = shapes.box([1, 2.988, 1], [3, 2.9885, 3], inward=False)
    points = rng.uniform([0.1, 0.05, 0.1], [3.9, 1.5, 3.9], (1000, 3))
    for lamp, more, share in ((tilted, [], 1), (shapes.ceiling_lamp(2), [lid], 0)):
        parts = [shapes.box([0, 0, 0], [4, 3, 4]), lamp, *more]
        room = shapes.room(parts, [[0] * 3] * len(parts), [[0] * 3, [5] * 3, [0] * 3][: len(parts)])
        lit = np.flatnonzero(room.emission.any(axis=1))
        emitters = Emitters(room, Rays(room.mesh), 256, lit)
        np.testing.assert_array_equal(emitters.partly(points, 0)[0], share)


def test_penumbras_of_a_sun_have_as_many_steps_as_its_samples_make(rng, monkeypatch):
    """On the floor of a box without a lid; beside 512 directions within the sun."""
    points, faces, normals = shapes.box([0, 0, 0], [2, 2, 2])
    kept = faces[(points[faces][..., 1] < 1.9).any(axis=1)]
    room = shapes.room([(points, kept, normals)], [[0] * 3], [[0] * 3])
    sun = Disc(np.array([0.6, 0.8, 0]), 0.1, np.ones(3))
    emitters = Emitters(replace(room, discs=(sun,)), Rays(room.mesh), 1)
    places = rng.uniform([0.2, 1e-3, 0.2], [1.8, 1e-3, 1.8], (400, 3))

    def seen():
        return emitters.arriving(places, 0, np.ones_like)[1].sum(axis=1)

    found = seen()
    monkeypatch.setattr("shrm_cli.rooms.emitters._OF_DISC", 512)
    truth = seen()
    assert np.sqrt(np.mean((found - truth) ** 2) / np.mean(truth**2)) < 0.15


def test_patches_are_as_bright_as_many_directions_and_samples_find_them(monkeypatch):
    room = shapes.two_rooms()
    rays = Rays(room.mesh)
    found = Brightness(room, rays, 1.0).radiance
    monkeypatch.setattr("shrm_cli.rooms.brightness._DIRECTIONS", 768)
    monkeypatch.setattr("shrm_cli.rooms.brightness._SAMPLES", 384)
    truth = Brightness(room, rays, 1.0).radiance
    assert np.sqrt(np.mean((found - truth) ** 2) / np.mean(truth**2)) < 0.017


def test_shadows_of_each_of_many_lamps_are_told(rng):
    """Between beams, of which each hides a part of some of 64 lamps, beside 512 points a lamp."""
    lamps = [shapes.ceiling_lamp(x, z, half=0.2) for x in range(1, 16, 2) for z in range(1, 16, 2)]
    beams = [shapes.box([0, 2.6, z], [16, 2.7, z + 0.8], inward=False) for z in range(1, 16, 2)]
    parts = [shapes.box([0, 0, 0], [16, 3, 16]), *beams, *lamps]
    room = shapes.room(parts, [[0] * 3] * len(parts), [[0] * 3] * 9 + [[5] * 3] * 64)
    rays = Rays(room.mesh)
    gathering = Gathering(Brightness(room, rays, 8.0), 1, 64)
    points = rng.uniform([0, 0, 0], [16, 2.5, 16], (20, 3))
    seen = gathering.probe(points, 0, 16.0).seen
    faces = np.flatnonzero(room.emission.any(axis=1))
    truth = [Emitters(room, rays, 512, faces[group.rows]).partly(points, 0)[0]
             for group in gathering.groups]  # fmt: skip
    truth = np.stack(truth, axis=1)
    assert ((truth > 0.01) & (truth < 0.99)).mean() > 0.2
    assert np.sqrt(np.mean((seen - truth) ** 2)) < 0.067


def test_the_sky_comes_through_an_opening(rng):
    """A box without a lid, black, under a white sky with a sun: both in closed form."""
    points, faces, normals = shapes.box([0, 0, 0], [2, 2, 2])
    lid = (points[faces][..., 1] > 1.9).all(axis=1)
    kept = faces[~lid]
    used = np.unique(kept)
    kept = np.searchsorted(used, kept)
    room = shapes.room([(points[used], kept, normals[used])], [[0] * 3], [[0] * 3])
    sky = Probe.from_array(np.full((16, 32, 3), 2.0, np.float32))
    sun = Disc(np.array([0.0, 1, 0]), 0.02, np.array([50.0, 60, 70]))
    room = replace(room, sky=sky, discs=(sun,))
    gathering = Gathering(Brightness(room, Rays(room.mesh), 1.0), 2, 4096)
    places = rng.uniform([0.2, 0.1, 0.2], [1.8, 1.5, 1.8], (60, 3))
    up = np.tile([0.0, 1, 0], (60, 1))
    reflected, direct, _ = gathering.irradiance(places, up)
    lid_corners = np.array([[0, 2, 0], [2, 2, 0], [2, 2, 2], [0, 2, 2]], float)
    expected = [2 * rectangle_factor(place, up[0], lid_corners) for place in places]
    np.testing.assert_allclose(reflected[:, 0], expected, rtol=0.02)
    np.testing.assert_allclose(direct, np.tile(sun.irradiance, (60, 1)), rtol=1e-3)


def test_probes_may_lie_on_surfaces():
    """Walls at no distance were NaN, which no reader of grids takes."""
    parts = [shapes.box([0, 0, 0], [4, 4, 4]), shapes.box([1, 0, 1], [3, 1, 3], inward=False)]
    room = shapes.room(parts, [[0.5] * 3] * 2, [[1] * 3, [0] * 3])
    grid = bake(room, Lattice(*room.mesh.bounds, (4, 4, 2)), 1, samples=64)
    assert (grid.lattice.points()[:, 2] == 1).any()
    assert np.isfinite(grid.walls).all()


@pytest.mark.parametrize(("turned", "is_alive"), [(1, True), (2, False)])
def test_a_wall_that_is_turned_by_mistake_does_not_kill_probes(turned, is_alive):
    """From the middle of a cube each side is a sixth of all directions; a third tells a wall."""
    corners, faces, normals = shapes.box([0, 0, 0], [4, 4, 4])
    normals[: 4 * turned] *= -1
    room = shapes.room([(corners, faces, normals)], [[0.5] * 3], [[1] * 3])
    grid = bake(room, Lattice(*room.mesh.bounds, (3, 3, 3)), 1, samples=256)
    assert grid.alive.ravel()[13] == is_alive


def test_hardly_any_light_leaks_through_a_wall_that_is_thin_beside_its_cells(rng, monkeypatch):
    """On the floor and the wall of a dark room, of which each weight of probes keeps a part out."""
    monkeypatch.setattr("shrm_cli.rooms.bake._PROOFS", 8)
    parts = [
        shapes.box([0, 0, 0], [1, 1.5, 2]),
        shapes.box([1.02, 0, 0], [2.02, 1.5, 2]),
        shapes.ceiling_lamp(0.5, z=1, y=1.49, half=0.25),
    ]
    room = shapes.room(parts, [[0.7] * 3, [0.7] * 3, [0] * 3], [[0] * 3, [0] * 3, [10] * 3])
    grid = bake(room, Lattice(*room.mesh.bounds, (4, 4, 8)), 2, samples=256)
    floor, wall = rng.uniform([1.02, 0, 0], [1.42, 1.5, 2], (2, 2000, 3))
    floor[:, 1], wall[:, 0] = 0, 1.02
    lit = rng.uniform([0, 0, 0], [1, 1.5, 2], (500, 3))
    means = [
        grid.irradiance(points, np.broadcast_to(normal, points.shape), direct=False).mean()
        for points, normal in ((floor, [0, 1.0, 0]), (wall, [1.0, 0, 0]), (lit, [0, 1.0, 0]))
    ]
    assert sum(means[:2]) / 2 < 6e-5 * means[2]


@pytest.mark.proof
def test_light_does_not_leak_through_a_thin_wall(rng):
    """One room is dark: no point in it has a twentieth of the other room's light."""
    room = shapes.two_rooms(dim=0.0)
    grid = bake(room, Lattice(*room.mesh.bounds, (16, 6, 8)), 2, samples=512)
    points, normals = points_of(room, 5000, rng)
    light = grid.irradiance(points, normals).mean(axis=1)
    bright = light[points[:, 0] < 4].mean()
    dark = light[points[:, 0] > 4.2]
    assert dark.max() < 0.002 * bright
    leaking = replace(grid, walls=None).irradiance(points, normals).mean(axis=1)
    assert leaking[points[:, 0] > 4.2].max() > 0.2 * bright
    # Of the probes, those within the crate are left out, and no others.
    places = grid.lattice.points()
    inside = ((places > [1, 0, 1]) & (places < [1.8, 0.8, 1.8])).all(axis=1)
    np.testing.assert_array_equal(~grid.alive, inside)
    assert inside.any()


@pytest.mark.proof
@pytest.mark.parametrize(("wall", "size"), [(0.1, (16, 6, 8)), (0.02, (16, 8, 16))])
def test_no_point_beside_a_thin_wall_has_light_from_beyond(rng, wall, size):
    """Neither floors, nor the wall itself, nor what stands against it and faces it."""
    inner = 4 + wall
    parts = [
        shapes.box([0, 0, 0], [4, 3, 4]),
        shapes.box([inner, 0, 0], [8.2, 3, 4]),
        shapes.ceiling_lamp(2),
    ]
    room = shapes.room(parts, [[0.7] * 3, [0.7] * 3, [0] * 3], [[0] * 3, [0] * 3, [10] * 3])
    grid = bake(room, Lattice(*room.mesh.bounds, size), 2, samples=512)
    points = rng.uniform([inner, 0, 0], [inner + 0.4, 3, 4], (4000, 3))
    normals = rng.standard_normal((4000, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    points[:1000, 1], normals[:1000] = 0, [0, 1, 0]
    points[1000:2000, 0], normals[1000:2000] = inner, [1, 0, 0]
    found = grid.irradiance(points, normals)
    lit = grid.irradiance(*points_of(room, 500, rng))
    assert found.max() < 0.05 * lit[lit > 0.01].mean()


@pytest.mark.proof
def test_stated_errors_are_those_at_other_points(rng):
    room = shapes.two_rooms()
    grid = bake(room, Lattice(*room.mesh.bounds, (10, 4, 5)), 2, samples=256)
    gathering = Gathering(Brightness(room, Rays(room.mesh), 0.4), 2, 1024)
    points, normals = points_of(room, 300, rng)
    reflected, direct, behind = gathering.irradiance(points, normals)
    free = behind < 0.25
    everything, alone = reflected + direct, replace(grid, lamps=None)
    for name, truth, found in (
        ("error", everything, grid.irradiance(points, normals)),
        ("error_coefficients", everything, alone.irradiance(points, normals)),
        ("error_reflected", reflected, grid.irradiance(points, normals, direct=False)),
    ):
        missed = found - truth
        error = np.sqrt((missed[free] ** 2).sum() / (truth[free] ** 2).sum())
        assert 0.5 * error < grid.facts[name] < 2 * error
    assert grid.facts["error"] < 0.2 * grid.facts["error_coefficients"]


@pytest.mark.proof
@pytest.mark.slow
def test_two_rooms_beside_mitsuba(rng):
    """Irradiance of all light at 2000 random points, beside Mitsuba's path tracer at each of them.

    Points nearer to a wall than Mitsuba's discs are large are left out, and those in the crate.
    """
    mitsuba = pytest.importorskip("mitsuba", reason="mitsuba is not installed")
    mitsuba.set_variant("scalar_rgb")
    room = shapes.two_rooms()
    grid = bake(room, Lattice(*room.mesh.bounds, (16, 8, 16)), 2)
    points, normals = points_of(room, 2000, rng)
    in_crate = ((points > [1, 0, 1]) & (points < [1.8, 0.8, 1.8])).all(axis=1)
    in_wall = (points[:, 0] > 4) & (points[:, 0] < 4.2)
    away = np.abs(points[:, None] - room.mesh.vertices).min(axis=(1, 2))
    free = np.flatnonzero(~in_crate & ~in_wall & (away > 1e-3))
    halves = [
        np.concatenate([
            path_traced(mitsuba, room, points[part], normals[part], seed + 2 * part[0])
            for part in np.array_split(free, 10)
        ])
        for seed in (0, 1)
    ]  # fmt: skip
    found, expected = grid.irradiance(points, normals)[free], (halves[0] + halves[1]) / 2
    noise = ((halves[0] - halves[1]) ** 2).sum() / 4
    left = ((found - expected) ** 2).sum() - noise
    assert left < 0.015**2 * (expected**2).sum()
    assert noise < 0.03**2 * (expected**2).sum()
    assert abs(found.sum() / expected.sum() - 1) < 0.01
    # In the dim room nothing of the bright one is seen.
    dim = points[free, 0] > 4.2
    assert np.abs(found - expected)[dim].max() < 0.05 * expected[~dim].mean()


def path_traced(mitsuba, room, points, normals, seed):
    """The irradiance of tiny discs by Mitsuba, shape (n, 3)."""
    shapes_of = shapes.for_mitsuba(mitsuba, room)
    film = {"type": "hdrfilm", "width": 1, "height": 1, "rfilter": {"type": "box"}}
    for k, (point, normal) in enumerate(zip(points, normals, strict=True)):
        up = np.cross(normal, [1.0, 0, 0] if abs(normal[0]) < 0.9 else [0, 1.0, 0])
        place = mitsuba.ScalarTransform4f().look_at(
            origin=point.tolist(), target=(point + normal).tolist(), up=up.tolist()
        ) @ mitsuba.ScalarTransform4f().scale(1e-4)
        sensor = {
            "type": "irradiancemeter",
            "film": film,
            "sampler": {"type": "independent", "sample_count": 2048},
        }
        shapes_of[f"meter{k:04d}"] = {"type": "disk", "to_world": place, "sensor": sensor}
    scene = mitsuba.load_dict({"type": "scene", **shapes_of}, optimize=False)
    way = mitsuba.load_dict({"type": "path", "max_depth": 24})
    numbered = enumerate(scene.sensors(), 1000 * seed)
    found = [mitsuba.render(scene, sensor=sensor, integrator=way, seed=k) for k, sensor in numbered]
    return np.array([np.array(each)[0, 0, :3] for each in found])
