"""Parallax: pictures of shiny things in a room, looked up where rays meet the room's box.

The truth is Mitsuba's path tracer, or a probe of the very place that is shown.
"""

from dataclasses import replace

import numpy as np
import pytest

from shrm_cli.errors import ArgumentError
from shrm_cli.geometry.mesh import make_mesh
from shrm_cli.prefilter import prefilter
from shrm_cli.probe.probe import Probe
from shrm_cli.probe.proxy import ProxyBox
from shrm_cli.render.boxed import Placed, outside
from shrm_cli.render.camera import Lens, Viewer, aimed
from shrm_cli.render.mesh import MeshSubject
from shrm_cli.render.stage import Actor, Look, Stage
from shrm_cli.rooms.capture import trace_probe
from shrm_cli.sphere.grid.latlong import latlong_directions
from tests.brute_force import unit
from tests.geometry.shapes import icosphere
from tests.rooms import shapes

LOW, HIGH, AT = np.array([-1.0, 0, 2]), np.array([3.0, 2.5, 7]), np.array([0.5, 1.6, 3])
BOX = ProxyBox.of(LOW, HIGH, AT)


def wall(places):
    """What the walls of the box send: smooth over each, and different from wall to wall."""
    x, y, z = np.moveaxis((places - LOW) / (HIGH - LOW), -1, 0)
    waves = [np.sin(7 * x) * np.cos(4 * z), np.cos(5 * y + 3 * x), np.sin(6 * z - 4 * y)]
    return 1.5 + np.stack(waves, axis=-1)


def seen(place, height=64):
    """The probe of a place: rays are followed in small steps until they leave the box."""
    ways = latlong_directions(2 * height, height).reshape(-1, 3)
    near, far = np.zeros(len(ways)), np.full(len(ways), 20.0)
    for _ in range(50):
        middle = (near + far) / 2
        points = place + middle[:, None] * ways
        inside = np.all((points >= LOW) & (points <= HIGH), axis=1)
        near, far = np.where(inside, middle, near), np.where(inside, far, middle)
    light = wall(place + near[:, None] * ways).reshape(height, 2 * height, 3)
    return replace(Probe.from_array(light.astype(np.float32)), proxy=BOX)


def proof(*values):
    """A case that `make prove` runs."""
    return pytest.param(*values, marks=pytest.mark.proof)


@pytest.mark.parametrize(
    ("spec", "form", "options"),
    [
        proof("ggx:roughness=0.25,f0=1", "shrm", {"eps": 0.02}),
        proof("0.1*lambertian+0.9*ggx:roughness=0.25", "shrm", {"eps": 0.02}),
        ("0.1*lambertian+0.9*microfacet:sigma=0.15", "shrm", {"eps": 0.05}),
        (None, "splitsum", {}),
        proof("ggx:roughness=0.25,f0=1", "shrm", {"eps": 0.02, "frame": "local"}),
        proof("ggx:roughness=0.25,f0=1", "principal", {}),
        proof("ggx:roughness=0.3,f0=1", "cabral", {}),
        proof("0.1*lambertian+0.9*ggx:roughness=0.25", "principal", {}),
        ("lambertian", "shrm", {}),
        (None, "irradiance", {}),
    ],
)
def test_light_at_another_place_is_that_of_a_probe_there(rng, spec, form, options):
    place = np.array([1.4, 1.1, 4.3])
    there = {} if spec is None else {"brdf": spec}
    made, truth = (prefilter(seen(each), to=form, **there, **options) for each in (AT, place))
    normals, views = unit(rng, 400), unit(rng, 400)
    views *= np.where(np.sum(normals * views, axis=1) < 0.1, -1.0, 1.0)[:, None]
    kept = np.sum(normals * views, axis=1) > 0.1
    normals, views = normals[kept], views[kept]
    shown, other = (each.shaded(0.25, (0.9, 0.8, 0.7)) for each in (made, truth))
    expected = other.radiance(normals, views)
    boxed = Placed.of(made, shown, "map", place, 0.0).radiance(normals, views)
    plain = shown.radiance(normals, views)
    error, without = (np.sqrt(np.mean((e - expected) ** 2)) for e in (boxed, plain))
    # A diffuse surface sees half of the room, and the box is right for what is above it alone.
    share = 0.8 if form == "irradiance" or spec == "lambertian" else 0.25
    assert error < share * without, (error, without, np.sqrt(np.mean(expected**2)))


def test_at_the_place_of_the_probe_nothing_changes(rng):
    made = prefilter(seen(AT), "0.5*lambertian+0.5*ggx:roughness=0.4", to="shrm", eps=0.03)
    normals, views = unit(rng, 50), unit(rng, 50)
    found = Placed.of(made, made, "map", AT, 0.0).radiance(normals, views)
    np.testing.assert_allclose(found, made.radiance(normals, views), rtol=1e-6, atol=1e-9)
    # The radius is a tenth of the shortest edge, and points beyond the box have light as well.
    assert Placed.of(made, made, "map", AT, None).radius == pytest.approx(0.25)
    far = Placed.of(made, made, "map", [9, 9, 9], 100.0)
    assert np.isfinite(far.radiance(normals, views)).all()


def test_a_map_without_a_box_has_no_place():
    made = prefilter(replace(seen(AT), proxy=None), to="irradiance")
    with pytest.raises(ArgumentError, match="has none"):
        Placed.of(made, made, "map.exr", AT, None)


@pytest.mark.parametrize(
    ("beyond", "share", "is_told"),
    [(0.007, 1.0, False), (0.014, 1.0, True), (0.5, 0.007, False), (0.5, 0.014, True)],
)
def test_what_stands_at_the_walls_is_in_the_room_and_what_is_beyond_them_is_told(
    rng, beyond, share, is_told
):
    """A hundredth of the box's edge beyond a wall, and a hundredth of all points, are no other
    place."""
    made = prefilter(seen(AT, 8), to="irradiance")
    points = rng.uniform(LOW, HIGH, (1000, 3))
    points[: int(1000 * share), 0] = HIGH[0] + beyond * (HIGH - LOW)[0]
    assert bool(outside([made], ["m.exr"], points)) == is_told


def colored_room():
    """A room with a panel of another colour on each wall, and a lamp."""
    parts = [shapes.box([0, 0, 0], [4, 3, 4]), shapes.ceiling_lamp(2)]
    albedo, emission = [[0.7] * 3, [0] * 3], [[0] * 3, [8, 8, 7]]
    for axis, value, (a, b), color in (
        (0, 0.01, ([0.5, 1.5], [1, 2]), [0.8, 0.1, 0.1]),
        (0, 3.99, ([1, 2.5], [2, 3]), [0.1, 0.8, 0.1]),
        (2, 0.01, ([1, 2], [1, 2.5]), [0.1, 0.1, 0.8]),
        (2, 3.99, ([2, 3], [0.5, 1.5]), [0.8, 0.8, 0.1]),
        (1, 0.01, ([0.5, 1.5], [2.5, 3.5]), [0.1, 0.7, 0.8]),
    ):
        corners = np.zeros((4, 3))
        corners[:, axis] = value
        corners[:, (axis + 1) % 3] = a[0], a[1], a[1], a[0]
        corners[:, (axis + 2) % 3] = b[0], b[0], b[1], b[1]
        normal = np.eye(3)[axis] * (1 if value < 1 else -1)
        parts.append((corners, np.array([[0, 1, 2], [0, 2, 3]]), np.tile(normal, (4, 1))))
        albedo.append(color)
        emission.append([0] * 3)
    return shapes.room(parts, albedo, emission)


@pytest.mark.proof
def test_a_shiny_ball_in_a_room_beside_mitsuba():
    mitsuba = pytest.importorskip("mitsuba", reason="mitsuba is not installed")
    mitsuba.set_variant("scalar_rgb")
    room, at, middle, size = colored_room(), np.array([2, 1.5, 2.0]), np.array([3.0, 0.9, 2.8]), 48
    found = trace_probe(room, at, 128, 32)
    box = ProxyBox.of([0, 0, 0], [4, 3, 4], at)
    probe = replace(Probe.from_array(found.pixels), proxy=box)
    made = prefilter(probe, "ggx:roughness=0.15,f0=1", to="principal")
    vertices, faces = icosphere(4)
    mesh = make_mesh("ball", 0.4 * vertices + middle, faces)
    stage, lens, viewer = (
        Stage.of([Actor(mesh, [Look()])]),
        Lens(size, size, 35.0),
        Viewer(-150, 20),
    )
    aim = aimed(mesh.vertices, [viewer], lens)
    boxed, plain = (
        MeshSubject(stage, lens, aim, each).draw(stage.reflectors(made), viewer)
        for each in (True, False)
    )
    ball = {
        "type": "sphere", "center": middle.tolist(), "radius": 0.4,
        "bsdf": {"type": "roughconductor", "distribution": "ggx", "alpha": 0.0225,
                 "material": "none"},
    }  # fmt: skip
    look = mitsuba.ScalarTransform4f().look_at(
        origin=aim.eye(viewer).tolist(), target=aim.target.tolist(), up=[0, 1, 0]
    )
    film = {"type": "hdrfilm", "width": size, "height": size, "rfilter": {"type": "box"}}
    sensor = {
        "type": "perspective", "fov": 35.0, "to_world": look, "film": film,
        "sampler": {"type": "independent", "sample_count": 256},
    }  # fmt: skip
    scene = {"type": "scene", **shapes.for_mitsuba(mitsuba, room), "ball": ball, "sensor": sensor}
    way = mitsuba.load_dict({"type": "path", "max_depth": 16})
    truth = np.array(mitsuba.render(mitsuba.load_dict(scene, optimize=False), integrator=way))
    y, x = np.mgrid[:size, :size] + 0.5 - size / 2
    inside = np.hypot(x, y) < 0.4 * size
    assert (boxed[inside] > 0).all()
    whole = truth[..., :3][inside]
    error, without = (
        np.sqrt(((each[inside] - whole) ** 2).sum() / (whole**2).sum()) for each in (boxed, plain)
    )
    assert error < 0.15, error
    assert without > 0.8, without
    typical, far = (np.median(np.abs(each[inside] / whole - 1)) for each in (boxed, plain))
    assert typical < 0.05, typical
    assert far > 0.1, far
