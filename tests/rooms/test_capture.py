"""Probes of places in rooms, against closed forms and Mitsuba's path tracer."""

from dataclasses import replace

import numpy as np
import pytest

from shrm_cli import settings
from shrm_cli.geometry.rays import Rays
from shrm_cli.probe.disc import Disc
from shrm_cli.probe.probe import Probe
from shrm_cli.rooms import capture
from shrm_cli.rooms.capture import trace_probe
from shrm_cli.sphere.grid.latlong import latlong_directions
from tests.rooms import shapes

AT = np.array([2.5, 1.2, 2.2])


@pytest.fixture
def few_patches(monkeypatch):
    """Rooms of patches four times as long, which does not matter to what is tested with them."""
    monkeypatch.setattr(capture, "_PATCHES", 12)


def test_a_furnace_is_equally_bright_everywhere(few_patches):
    """Walls that send e and reflect a of all light: L = e / (1 - a), from anywhere."""
    room = shapes.room([shapes.box([-1, -1, -1], [1, 1, 1])], [[0.6, 0.3, 0.9]], [[1, 2, 3]])
    found = trace_probe(room, [0.2, 0.1, -0.3], 8, 64)
    expected = np.array([1, 2, 3]) / (1 - np.array([0.6, 0.3, 0.9]))
    np.testing.assert_allclose(found.pixels / expected, 1, atol=0.05)
    np.testing.assert_allclose((found.pixels / expected).mean(axis=(0, 1)), 1, atol=2e-3)
    assert found.behind == 0
    assert found.noise < 0.01


def test_paths_are_the_same_in_any_number_of_threads(few_patches, monkeypatch):
    """Chances are drawn before threads begin, and progress comes from blocks that are done."""
    monkeypatch.setattr(capture, "_PATHS_AT_ONCE", 256)
    room = shapes.room([shapes.box([-1, -1, -1], [1, 1, 1])], [[0.6, 0.3, 0.9]], [[1, 2, 3]])
    found = []
    for threads in (1, 3):
        with settings.using(threads=threads):
            found.append(trace_probe(room, [0.2, 0.1, -0.3], 8, 64))
    np.testing.assert_array_equal(found[0].pixels, found[1].pixels)
    assert found[0].noise == found[1].noise


def test_the_box_is_that_of_the_room_that_is_seen():
    """Of two rooms the one of the place; where a side is open, that of the mesh."""
    parts = [shapes.box([0, 0, 0], [4, 3, 4]), shapes.box([4.2, -1, 0], [8.2, 3, 4])]
    both = shapes.room(parts, [[0.5] * 3] * 2, [[1] * 3] * 2)
    for at, low, high in (
        ([1, 1, 1], [0, 0, 0], [4, 3, 4]),
        ([6, 1, 2], [4.2, -1, 0], [8.2, 3, 4]),
    ):
        for found, expected in zip(
            capture.box_around(both, np.array(at)), (low, high), strict=True
        ):
            np.testing.assert_allclose(found, expected, atol=1e-5)
    crate = shapes.room([shapes.box([0, 0, 0], [2, 2, 2], inward=False)], [[0.5] * 3], [[1] * 3])
    low, high = capture.box_around(crate, np.array([1.0, 1, -1]))
    np.testing.assert_allclose([low, high], [[0, 0, 0], [2, 2, 2]])


@pytest.mark.parametrize(("tip", "is_taken"), [(1.5, True), (1.75, False)])
def test_corners_between_the_looks_count_where_they_are_near(tip, is_taken):
    """Looks fall short of the tip of a tent by .019 of the room's size, of a longer one by .025.

    What is farther from all that is met may be of another room.
    """
    points = np.array([[tip, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]])
    corners = points[[[a, b, c] for a in (0, 1) for b in (2, 3) for c in (4, 5)]]
    inwards = -np.repeat(corners.mean(axis=1), 3, axis=0)
    inwards /= np.linalg.norm(inwards, axis=1, keepdims=True)
    tent = corners.reshape(-1, 3), np.arange(24).reshape(8, 3), inwards
    room = shapes.room([tent], [[0.5] * 3], [[0] * 3])
    _, high = capture.box_around(room, np.zeros(3))
    assert (abs(high[0] - tip) < 1e-5) == is_taken
    np.testing.assert_allclose(high[1:], 1, atol=1e-5)


def test_the_box_ends_at_the_near_side_of_walls():
    """Of walls of 10 cm it was the far side; a floor that goes on below them is hidden there."""
    walls = [
        shapes.box(low, high, inward=False)
        for low, high in (
            ([-0.1, -0.1, -0.1], [4.1, 0, 4.1]), ([-0.1, 3, -0.1], [4.1, 3.1, 4.1]),
            ([-0.1, 0, -0.1], [0, 3, 4.1]), ([4, 0, -0.1], [4.1, 3, 4.1]),
            ([0, 0, -0.1], [4, 3, 0]), ([0, 0, 4], [4, 3, 4.1]),
        )
    ]  # fmt: skip
    room = shapes.room(walls, [[0.5] * 3] * 6, [[0] * 3] * 6)
    low, high = capture.box_around(room, np.array([1.0, 1.5, 2.0]))
    np.testing.assert_allclose([low, high], [[0, 0, 0], [4, 3, 4]], atol=1e-5)


def test_lamps_and_the_sky_are_seen_as_they_are(few_patches):
    """Outside, beside a black box that faces away: all of the sky, and black where the box is."""
    room = shapes.room([shapes.box([0, 0, 0], [2, 2, 2], inward=False)], [[0] * 3], [[5, 0, 1]])
    sky = np.zeros((16, 32, 3), np.float32)
    sky[:8] = 3.0
    room = replace(room, sky=Probe.from_array(0 * sky))
    found = trace_probe(room, [1, 1, -1], 32, 16, Probe.from_array(sky))
    directions = latlong_directions(64, 32)
    faces, _, _ = Rays(room.mesh).first_hits(np.array([1, 1, -1]), directions.reshape(-1, 3))
    inner = np.zeros((32, 64), bool)
    met = (faces >= 0).reshape(32, 64)
    inner[1:-1, 1:-1] = np.all(
        [met[1 + i : 31 + i, 1 + j : 63 + j] for i in (-1, 0, 1) for j in (-1, 0, 1)], axis=0
    )
    assert inner.sum() > 50
    np.testing.assert_allclose(found.pixels[inner], np.tile([5, 0, 1], (inner.sum(), 1)))
    np.testing.assert_allclose(found.pixels[:4], 3, rtol=1e-5)
    np.testing.assert_allclose(found.pixels[-4:], 0, atol=1e-5)


def test_the_sun_of_a_sky_shines_in(few_patches):
    """A floor under a disc of light overhead, and nothing else: its radiance is a / pi E."""
    points, faces, normals = shapes.box([-9, 0, -9], [9, 3, 9])
    floor = (points[faces][..., 1] < 0.1).all(axis=1)
    used = np.unique(faces[floor])
    part = points[used], np.searchsorted(used, faces[floor]), normals[used]
    room = shapes.room([part], [[0.5, 0.2, 0.1]], [[0] * 3])
    sun = Disc(np.array([0.0, 1, 0]), 0.02, np.array([50.0, 60, 70]))
    room = replace(room, sky=Probe.from_array(np.zeros((8, 16, 3), np.float32)), discs=(sun,))
    found = trace_probe(room, [0, 1, 0], 16, 4)
    expected = np.array([0.5, 0.2, 0.1]) / np.pi * sun.irradiance
    np.testing.assert_allclose(found.pixels[-6:], np.broadcast_to(expected, (6, 32, 3)), rtol=1e-3)
    assert found.pixels[:7].max() == 0


def test_the_stated_noise_is_that_of_independent_runs(few_patches, monkeypatch):
    """Their spread about their mean, pixel by pixel: twice as much or half would be seen."""
    room, half, runs = shapes.two_rooms(), capture._Paths.half, []
    for run in range(6):
        monkeypatch.setattr(
            capture._Paths, "half",
            lambda paths, samples, number, progress, run=run: half(
                paths, samples, 2 * run + number, progress
            ),
        )  # fmt: skip
        runs.append(trace_probe(room, AT, 16, 8))
    images = np.array([each.pixels for each in runs], dtype=float)
    weights = np.sin((np.arange(16) + 0.5) * np.pi / 16)[:, None, None]
    whole = (weights * images.mean(axis=0) ** 2).sum()
    spread = np.sqrt((weights * images.var(axis=0, ddof=1)).sum() / whole)
    stated = np.sqrt(np.mean([each.noise**2 for each in runs]))
    assert stated == pytest.approx(spread, rel=0.2)
    assert runs[0].noise == pytest.approx(spread, rel=0.4)


def test_backs_are_black_and_told(few_patches):
    room = shapes.two_rooms()
    found = trace_probe(room, [1.4, 0.4, 1.4], 16, 2)  # within the crate
    assert found.behind > 0.8  # its bottom lies in the floor, whose front is seen
    assert found.pixels[:8].max() == 0


@pytest.mark.proof
def test_radiance_beside_mitsuba(rng):
    """Along random directions that meet no edge, in a room with a crate and a lamp."""
    mitsuba = pytest.importorskip("mitsuba", reason="mitsuba is not installed")
    mitsuba.set_variant("scalar_rgb")
    room = shapes.two_rooms()
    height = 128
    found = trace_probe(room, AT, height, 64)
    directions = latlong_directions(2 * height, height)
    faces, _, _ = Rays(room.mesh).first_hits(AT, directions.reshape(-1, 3))
    normals = room.normals[faces].reshape(directions.shape)
    shown = np.concatenate([normals, room.emission[faces].reshape(directions.shape)], axis=-1)
    rows, columns = rng.integers(4, height - 4, 150), rng.integers(1, 2 * height - 1, 150)
    near = [shown[rows + i, columns + j] for i in (-1, 0, 1) for j in (-1, 0, 1)]
    smooth = np.ptp(near, axis=0).max(axis=-1) < 1e-9
    rows, columns = rows[smooth][:80], columns[smooth][:80]
    assert len(rows) == 80
    expected = seen_by_mitsuba(mitsuba, room, directions[rows, columns])
    ours = found.pixels[rows, columns]
    off = (ours - expected) / expected
    assert np.sqrt(np.mean(off**2)) < 0.03, np.sqrt(np.mean(off**2))
    assert abs(off.mean()) < 0.005


def seen_by_mitsuba(mitsuba, room, directions):
    """The radiance that meets the place from directions, shape (n, 3)."""
    scene = shapes.for_mitsuba(mitsuba, room)
    film = {"type": "hdrfilm", "width": 1, "height": 1, "rfilter": {"type": "box"}}
    for k, direction in enumerate(directions):
        scene[f"meter{k:03d}"] = {
            "type": "radiancemeter", "origin": AT.tolist(), "direction": direction.tolist(),
            "film": film, "sampler": {"type": "independent", "sample_count": 4096},
        }  # fmt: skip
    scene = mitsuba.load_dict({"type": "scene", **scene}, optimize=False)
    way = mitsuba.load_dict({"type": "path", "max_depth": 24})
    found = [
        mitsuba.render(scene, sensor=sensor, integrator=way, seed=k)
        for k, sensor in enumerate(scene.sensors())
    ]
    return np.array([np.array(each)[0, 0, :3] for each in found])
