"""Surfaces in a grid of probes, each point of which is under its own light."""

import numpy as np
import pytest

import shrm_cli as shrm
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.errors import MapError
from shrm_cli.geometry.mesh import make_mesh
from shrm_cli.render.boxed import outside, reflected
from shrm_cli.render.camera import Viewer
from shrm_cli.render.lit import lit_maps
from shrm_cli.render.moving import moving_light
from shrm_cli.rooms.grid import Lattice, ProbeGrid, write_grid
from shrm_cli.rooms.lit import InGrid, in_grid, open_lit
from shrm_cli.sphere.directions import normalize
from tests.oracles import real_harmonics, sphere_rule
from tests.rooms.test_grid import lit

BRUSHED = "ashikhmin-shirley:nu=6,nv=24"


def surfaces(rng, grid, count):
    """Points of a grid's box, with normals, tangents, and views that see their fronts."""
    points = rng.uniform(grid.lattice.low, grid.lattice.high, (count, 3))
    normals = normalize(rng.standard_normal((count, 3)))
    across = rng.standard_normal((count, 3))
    tangents = normalize(across - np.sum(across * normals, axis=1, keepdims=True) * normals)
    views = normalize(normals + 0.8 * normalize(rng.standard_normal((count, 3))))
    return points, normals, tangents, views


def test_diffuse_surfaces_reflect_their_irradiance(rng):
    grid = lit()
    points, normals, tangents, views = surfaces(rng, grid, 50)
    found = InGrid(grid, "a").placed_radiance(points, normals, tangents, views)
    np.testing.assert_allclose(found, grid.irradiance(points, normals) / np.pi)


@pytest.mark.parametrize(("order", "of_grid"), [(4, 2), (2, 4)])
def test_a_brushed_surface_reflects_the_light_of_its_place(rng, order, of_grid):
    """Beside the integral of the BRDF times the interpolated light, harmonic by harmonic."""
    grid = lit(order=of_grid)
    made, brdf = shrm.product(BRUSHED, order=order, size=128), parse_spec(BRUSHED)
    room, change = in_grid(made, grid, "none")
    assert change == 0
    given = surfaces(rng, grid, 12)
    found = reflected(room, room, (given[1], given[3], given[2]), given[0])
    directions, weights = sphere_rule(200)
    known = min(order, of_grid)
    for point, normal, tangent, view, value in zip(*given, found, strict=True):
        light = grid.light(point[None], normal[None])[0, : (known + 1) ** 2]
        frame = np.array([tangent, np.cross(normal, tangent), normal])
        arriving = real_harmonics(known, directions @ frame) @ light
        above = directions[:, 2] > 0
        f = brdf.evaluate(directions[above], frame @ view)
        cosine = (weights * directions[:, 2])[above, None]
        # Texels of the product texture are interpolated: that is what is left.
        np.testing.assert_allclose(value, np.sum(f * cosine * arriving[above], axis=0), rtol=0.01)


def test_points_have_the_light_of_their_side_of_a_room():
    lattice = Lattice(np.zeros(3), np.array([4.0, 1, 1]), (2, 1, 1))
    light = np.zeros((2, 9, 3), np.float32)
    light[:, 0] = [[1, 0, 0], [0, 0, 1]]
    grid = ProbeGrid(lattice, light, 0 * light, None, np.ones(2, bool))
    up = np.array([[0.0, 1, 0]] * 3)
    points = np.array([[0.5, 0.5, 0.5], [3.5, 0.5, 0.5], [2, 0.5, 0.5]])
    made = shrm.product("lambertian", order=2, size=8)
    for room in (InGrid(grid, ""), in_grid(made, grid, "auto")[0]):
        near = reflected(room, room, (up, up, None), points)
        middle = room.radiance(up[0], up[0])
        np.testing.assert_allclose(near[:2, [1, 1]], 0, atol=1e-9)
        assert near[0, 0] > 0.1 > near[0, 2]
        assert near[1, 2] > 0.1 > near[1, 0]
        # Without a place surfaces are in the middle, where both probes count alike.
        np.testing.assert_allclose(middle, near[2])
        assert middle[0] == pytest.approx(middle[2])


def test_windows_are_those_of_the_light_around(rng):
    """A lamp beside some probes blurs what is near it, and leaves the other end as it was."""
    lattice = Lattice(np.zeros(3), np.array([6.0, 1, 1]), (6, 1, 1))
    light = np.zeros((6, 25, 3), np.float32)
    light[:, 0] = 1
    lamp = real_harmonics(4, np.array([[0.0, 1, 0]]))[0]
    light[:2] += 20 * lamp[:, None].astype(np.float32)
    grid = ProbeGrid(lattice, light, 0 * light, None, np.ones(6, bool))
    made = shrm.product("ggx:roughness=0.4", order=4, size=16)
    room, change = in_grid(made, grid, "auto")
    places = grid.lattice.points()
    found = room.light(places, np.tile([0.0, 1, 0], (6, 1)), 4)
    kept = found / np.where(light == 0, 1, light)
    assert 0.05 < change < 1
    assert kept[0, 20, 0] < 0.8  # the harmonic of the greatest effect of a lamp overhead
    np.testing.assert_allclose(found[-1], light[-1])
    normals = normalize(rng.standard_normal((4000, 3)))
    views = normalize(normals + 0.9 * normalize(rng.standard_normal((4000, 3))))
    dark = [
        np.mean(reflected(each, each, (normals, views, None), np.full((4000, 3), 0.5)) < 0)
        for each in (room, in_grid(made, grid, "none")[0])
    ]
    assert dark[0] < 0.02 < dark[1]


def test_pictures_of_meshes_are_lit_point_by_point(tmp_path, monkeypatch):
    """A wall along a room that is red at one end and blue at the other."""
    monkeypatch.chdir(tmp_path)
    lattice = Lattice(np.zeros(3), np.array([8.0, 2, 2]), (8, 1, 1))
    light = np.zeros((8, 4, 3), np.float32)
    light[:, 0, 0], light[:, 0, 2] = np.linspace(1, 0, 8), np.linspace(0, 1, 8)
    write_grid("hall.grid.npz", ProbeGrid(lattice, light, 0 * light, None, np.ones(8, bool)))
    corners = np.array([[0, 0, 1], [8, 0, 1], [8, 2, 1], [0, 2, 1]], float)
    lines = [f"v {x} {y} {z}" for x, y, z in corners]
    (tmp_path / "wall.obj").write_text("\n".join([*lines, "f 1 2 3", "f 1 3 4"]))
    (tmp_path / "scene.toml").write_text('[[objects]]\nmesh = "wall.obj"\nmap = "hall.grid.npz"\n')
    shrm.product("lambertian", order=2, size=8).save("white.product.exr")
    pictures = [
        shrm.render("hall.grid.npz", mesh="wall.obj", size=(64, 16)),
        shrm.render([], mesh="scene.toml", size=(64, 16)),
        shrm.render("white.product.exr", probe="hall.grid.npz", mesh="wall.obj", size=(64, 16)),
    ]
    for each in pictures:
        red, blue = each[8, 4:60, 0], each[8, 4:60, 2]
        assert (np.diff(red) <= 1e-6).all()
        assert (np.diff(blue) >= -1e-6).all()
        assert red[0] > 5 * blue[0]
        assert blue[-1] > 5 * red[-1]
        np.testing.assert_allclose(each, pictures[0], atol=2e-3)


def test_the_light_of_a_grid_stays(tmp_path):
    write_grid(tmp_path / "a.grid.npz", lit())
    room = open_lit(tmp_path / "a.grid.npz")
    (moment,) = moving_light(Viewer(0, 0), None, ([0, 1, 0], 40))
    with pytest.raises(MapError, match="the light of a grid of probes stays where it is"):
        moment.moved(room)


def test_light_keeps_its_primaries():
    primaries = (0.713, 0.293, 0.165, 0.83, 0.128, 0.044, 0.32168, 0.33767)
    plain = lit()
    facts = {"chromaticities": list(primaries)}
    known = ProbeGrid(plain.lattice, plain.reflected, plain.direct, None, plain.alive, facts)
    assert InGrid(plain, "").info.chromaticities is None
    assert InGrid(known, "").info.chromaticities == primaries
    made = shrm.product("lambertian", order=2, size=8)
    (room,), _ = lit_maps([made], ["a"], known, None)
    assert room.info.chromaticities == primaries


def test_meshes_outside_of_the_grid_are_told(tmp_path):
    room = InGrid(lit(), "a.npz")
    triangle = make_mesh(
        "t", np.array([[9.0, 9, 9], [10, 9, 9], [9, 10, 9]]), np.array([[0, 1, 2]])
    )
    (line,) = outside([room], ["a.npz"], triangle.vertices)
    assert "lies outside its box, which goes from -1,0,2 to 2,1,7" in line
