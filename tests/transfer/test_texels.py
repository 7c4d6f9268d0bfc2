"""Transfer by texels: beside closed forms where no vertex is near, and looked up without seams."""

import json
import sys
from dataclasses import replace

import numpy as np
import pytest

from shrm_cli.brdf.spec import parse_spec
from shrm_cli.errors import MeshError, TransferError
from shrm_cli.geometry.mesh import make_mesh
from shrm_cli.geometry.rays import Rays
from shrm_cli.geometry.texels import Texels, charted, sampled
from shrm_cli.maps.irradiance.irradiance import Irradiance
from shrm_cli.maps.product.prefilter import product_texture
from shrm_cli.prefilter import prefilter
from shrm_cli.render.vertex_colors import vertex_colors
from shrm_cli.transfer.bake import Plan, bake
from shrm_cli.transfer.file import read_transfer, write_transfer
from shrm_cli.transfer.gather import DiffuseLight, Gathering
from tests.cli.helpers import assert_refused, done, run
from tests.oracles import real_harmonics as harmonics
from tests.render.assets import globe
from tests.rooms.shapes import box
from tests.transfer import meshes

WHITE = np.r_[np.sqrt(4 * np.pi), np.zeros(24)]
"""Coefficients of radiance 1 from everywhere."""


def corner(height=1.0, length=200.0):
    """A floor of two triangles, 0 < x < 1, and a wall at x = 0, in two charts."""
    floor, across = meshes.quad((0, -1, 0), (1, -1, 0), (1, 1, 0), (0, 1, 0))
    wall, _ = meshes.quad(
        (0, -length, 0), (0, length, 0), (0, length, height), (0, -length, height)
    )
    square = np.array([(0, 0), (1, 0), (1, 1), (0, 1)])
    uvs = np.concatenate([0.05 + 0.4 * square, [0.55, 0.05] + 0.4 * square])
    normals = np.repeat([[0, 0, 1.0], [1.0, 0, 0]], 4, axis=0)
    points, faces = np.concatenate([floor, wall]), np.concatenate([across, across + 4])
    return make_mesh("corner", points, faces, normals, uvs)


def points_of(mesh, count=300, seed=3):
    rng = np.random.default_rng(seed)
    return rng.integers(len(mesh.faces), size=count), rng.dirichlet(np.ones(3), size=count)


def test_a_floor_of_two_triangles_is_shadowed_by_a_wall():
    """A long wall whose edge is seen at an angle leaves (1 + cos angle) / 2 of white light."""
    mesh = corner()
    faces, weights = points_of(mesh)
    faces %= 2  # on the floor
    x = mesh.interpolated(mesh.vertices, faces, weights)[:, 0]
    expected = np.pi * (1 + x / np.hypot(x, 1)) / 2
    errors = {}
    for texture in (None, 64):
        baked = bake(Plan(mesh, texture=texture))
        found = baked.at(mesh, baked.vectors[..., 0] @ WHITE[:, None], faces, weights)[:, 0]
        errors[texture] = np.abs(found / expected - 1)[x > 0.05].max()
    assert errors[64] < 0.01, errors
    assert errors[None] > 0.05, errors


@pytest.mark.parametrize("shape", [(5, 7), (16, 9)])
def test_texels_stand_for_the_nearest_points_of_triangles(rng, shape):
    """Beside points that are strewn densely over the triangles."""
    height, width = shape
    corners = rng.uniform(0, 1, (3, 3, 2))
    found = sampled(corners, np.zeros(3, int), shape)
    shares = rng.dirichlet(np.ones(3), 40_000)
    edge = np.linspace(0, 1, 5001)[:, None]
    sides = [np.hstack([edge, 1 - edge, 0 * edge])[:, order] for order in
             ([0, 1, 2], [1, 2, 0], [2, 0, 1])]  # fmt: skip
    strewn = np.einsum("nc,fcv->fnv", np.concatenate([shares, *sides]), corners).reshape(-1, 2)
    strewn = strewn * [width, -height] + [0, height]
    for row in range(height):
        for column in range(width):
            away = strewn - [column + 0.5, row + 0.5]
            nearest = away[np.einsum("nv,nv->n", away, away).argmin()]
            place = found.rows[row, column]
            if np.abs(np.abs(nearest).max() - 1) > 0.05:
                assert (place >= 0) == (np.abs(nearest).max() < 1)
            if place >= 0:
                at = found.weights[place] @ corners[found.faces[place]]
                own = at * [width, -height] + [0, height] - [column + 0.5, row + 0.5]
                # Points on a border are up to a quarter of a texel within.
                assert np.linalg.norm(own) < np.linalg.norm(nearest) + 0.26


@pytest.mark.parametrize(("edge", "beyond"), [(8, False), (256, True)])
def test_points_on_borders_lie_a_little_within(edge, beyond):
    """By a hundredth of the way to the middle, and by a quarter of a texel at the most."""
    corners = np.array([[0.0, 0], [1, 0], [0, 1]])
    found = sampled(corners[None], np.zeros(1, int), (edge, edge))
    row, column = np.nonzero(found.rows >= 0)
    weights = found.weights[(column >= row)]  # their middles are not within the triangle
    inset = 3 * weights.min(axis=1, keepdims=True)
    on_border = (weights - inset / 3) / (1 - inset)
    ways = edge * np.linalg.norm((1 / 3 - on_border) @ corners, axis=1)
    assert len(weights) >= edge
    np.testing.assert_allclose(inset[:, 0], np.minimum(0.01, 0.25 / ways), rtol=1e-6)
    assert (inset < 0.0099).any() == beyond


@pytest.mark.parametrize("part", [0.7, 1.5])
def test_middles_on_a_border_but_for_rounding_count_as_on_it(part):
    """A triangle begins a little before the middles of the third column of 8 x 8 texels."""

    def triangle(least, width):
        """One in which these middles have that least weight."""
        start = 2.5 - least * width
        places = np.array([[start, 0.0], [start, 8], [start + width, 4]])
        return (places * [1, -1] + [0, 8]) / 8

    made = sampled(triangle(1e-4 * part, 5)[None], np.zeros(1, int), (8, 8))
    weight = made.weights[made.rows[4, 2]].min()
    assert weight == pytest.approx(1e-4 * part if part > 1 else 0.99e-4 * part + 0.01 / 3, rel=1e-6)
    both = np.array([triangle(1e-6 * part, 5), triangle(1e-6 * part, -2)])
    assert sampled(both, np.zeros(2, int), (8, 8)).is_flat == (part < 1)


def test_look_ups_are_bilinear_and_leave_out_what_is_empty():
    rows = np.array([[0, 1, 2], [3, -1, 4]])
    corners = np.array([[[0.5, 0.5], [0.5, 0.5], [0.9, 0.5]]])
    texels = Texels(rows, corners, np.zeros((5, 3)))
    found, shares = texels.places(np.array([0]), np.array([[1.0, 0, 0]]))
    # The middle lies on column 1, half way between a row that is known and one that is not.
    values = np.array([10.0, 20, 30, 40, 50])
    assert shares[0] @ values[found[0]] == pytest.approx(20)
    found, shares = texels.places(np.array([0]), np.array([[0.375, 0, 0.625]]))
    # A quarter of a texel's width right of it: column 1.75.
    expected = (0.25 * 20 + 0.75 * 30 + 0.75 * 50) / (0.25 + 0.75 + 0.75)
    assert shares[0] @ values[found[0]] == pytest.approx(expected)


def test_own_coordinates_serve_where_charts_do_not_overlap(monkeypatch):
    monkeypatch.setitem(sys.modules, "xatlas", None)
    mesh = corner()
    found = charted(mesh, 32)
    np.testing.assert_array_equal(found.texcoords, mesh.uvs[mesh.faces])
    over = np.array([(0.1, 0.1), (0.9, 0.1), (0.9, 0.9), (0.1, 0.9)] * 2)
    for wrong in (over, mesh.uvs + 1, None):
        with pytest.raises(MeshError, match="pip install xatlas"):
            charted(replace(mesh, uvs=wrong), 32)
    close = np.where(mesh.uvs[:, :1] > 0.5, mesh.uvs - [0.09, 0], mesh.uvs)
    assert charted(replace(mesh, uvs=close), 512).is_apart
    with pytest.raises(MeshError, match="pip install xatlas"):
        charted(replace(mesh, uvs=close), 32)


def test_charts_that_are_made_show_no_seam():
    """Of a ball that sees the whole sky, all over, and along both sides of each edge."""
    pytest.importorskip("xatlas", reason="xatlas is not installed")
    mesh = meshes.sphere(3)
    baked = bake(Plan(mesh, order=2, samples=16, texture=160))
    again = charted(mesh, 160)
    np.testing.assert_array_equal(again.rows, baked.texels.rows)
    assert baked.vectors.shape[0] > 5000
    edges = np.repeat(np.arange(len(mesh.faces)), 3), np.tile(
        [[0.5, 0.5, 0], [0, 0.5, 0.5], [0.5, 0, 0.5]], (len(mesh.faces), 1)
    )  # fmt: skip
    for points in (points_of(mesh, 2000), edges):
        normals = mesh.interpolated(mesh.normals, *points)
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        factors = np.repeat([np.pi, 2 * np.pi / 3, np.pi / 4], [1, 3, 5])
        found = baked.at(mesh, baked.vectors[..., 0], *points)
        np.testing.assert_allclose(found, factors * harmonics(2, normals), atol=0.02)


@pytest.mark.parametrize(("mesh", "size"), [(meshes.sphere(3), 160), (meshes.box(False), 64)])
def test_charts_that_are_made_take_the_texels_that_are_given(mesh, size):
    """They are packed again, at another scale, until hardly any room is left."""
    pytest.importorskip("xatlas", reason="xatlas is not installed")
    assert 0.95 * size < max(charted(mesh, size).rows.shape) <= size


def test_no_atlas_ends_as_soon_as_it_is_made(monkeypatch):
    """Its threads may be falling asleep then, and it waits for them forever; nor are all kept."""
    xatlas = pytest.importorskip("xatlas", reason="xatlas is not installed")
    made, ended, real = [], [], xatlas.Atlas

    class Watched:
        def __init__(self):
            self.atlas, self.number = real(), len(made)
            made.append(self.number)

        def __getattr__(self, name):
            return getattr(self.atlas, name)

        def __getitem__(self, index):
            return self.atlas[index]

        def __del__(self):
            ended.append(len(made) - self.number)

    monkeypatch.setattr(xatlas, "Atlas", Watched)
    for _ in range(8):
        charted(meshes.box(False), 64)
    assert min(ended) > 5
    assert len(made) - len(ended) < 10


def test_charts_of_more_vertices_than_triangles_fit():
    """Sides that share no vertices have four of them for two triangles each."""
    pytest.importorskip("xatlas", reason="xatlas is not installed")
    sides = [meshes.quad((k, 0, 0), (k, 1, 0), (k, 1, 1), (k, 0, 1)) for k in range(9)]
    found = charted(make_mesh("sides", *meshes.joined(*sides)), 64)
    assert found.is_apart
    assert set(found.faces) == set(range(18))


def test_seams_that_are_closed_but_for_rounding_are_no_borders():
    """A globe ends at sin 2 pi, which is not 0; charts of xatlas go on over it."""
    pytest.importorskip("xatlas", reason="xatlas is not installed")
    mesh = make_mesh("globe", *globe(12)[:3])
    assert np.unique(mesh.vertices[:, 0]).size > np.unique(mesh.vertices[:, 0].round(9)).size
    assert charted(mesh, 64).is_apart


def test_too_few_texels_for_the_charts_are_refused():
    pytest.importorskip("xatlas", reason="xatlas is not installed")
    with pytest.raises(MeshError, match="do not fit into 16 texels"):
        charted(meshes.box(inwards=False, divided=3), 16)


def test_a_floor_is_not_dark_where_a_crate_stands_on_it():
    """Its texels below the crate are black, and points beside it looked them up."""
    crate = meshes.box(inwards=False, divided=1)
    floor, across = meshes.quad((-4, -4, -1), (4, -4, -1), (4, 4, -1), (-4, 4, -1))
    points, faces = meshes.joined((crate.vertices, crate.faces), (floor, across))
    normals = np.concatenate([crate.normals, np.tile([0, 0, 1.0], (4, 1))])
    mesh = make_mesh("crate", points, faces, normals)
    baked = bake(Plan(mesh, texture=128, samples=256))
    light = baked.vectors[..., 0] @ WHITE[:, None]
    around = np.linspace(-0.9, 0.9, 40)
    for away in (1.002, 1.02):
        for place in ([away, 0], [-away, 0], [0, away], [0, -away]):
            beside = np.where(np.array(place) == 0, around[:, None], place)
            y, x = beside.T[::-1]
            side = (x < y).astype(int)  # the two triangles of the floor
            u, v = (x + 4) / 8, (y + 4) / 8
            weights = np.where(
                side[:, None] == 0, np.stack([1 - u, u - v, v], 1), np.stack([1 - v, u, v - u], 1)
            )
            found = baked.at(mesh, light, len(crate.faces) + side, weights)[:, 0]
            assert 0.4 * np.pi < found.min() < 0.7 * np.pi, (away, place)


def furnace():
    """A closed box whose sides have charts of their own."""
    mesh = meshes.box()
    side = np.arange(len(mesh.vertices)) // (len(mesh.vertices) // 6)
    axis = (side // 2)[:, None]
    rest = np.take_along_axis(mesh.vertices, np.hstack([(axis + 1) % 3, (axis + 2) % 3]), axis=1)
    places = np.stack([side % 3, side // 3], axis=1)
    return replace(mesh, uvs=(places + 0.5 + 0.35 * rest) / [3, 2])


def test_no_light_slips_in_where_walls_meet():
    """Of a deep room that is open at one end, walls at the other end see a fifth of the sky.

    The charts of xatlas have corners at the middles of texels, but for rounding.
    """
    points, faces, normals = box([0, 0, 0], [4, 3, 4])
    faces = faces[normals[faces[:, 0], 2] != -1]
    mesh = make_mesh("room", points, faces, normals)
    baked = bake(Plan(mesh, order=0, texture=128, samples=256))
    deep = baked.texels.positions[:, 2] < 0.5
    assert deep.sum() > 1000
    light = baked.vectors[deep, 0, 0] * np.sqrt(4 * np.pi)
    assert light.max() < 0.3 * np.pi


def test_texels_light_each_other_as_in_a_furnace():
    mesh = furnace()
    plan = Plan(mesh, texture=40)
    gathering = Gathering(plan.sites, plan.frames(), Rays(mesh), 0, 32)
    total = np.full((len(plan.sites.positions), 1, 1), 2.0, np.float32)
    arrived, _ = gathering.transfer(slice(0, len(total)), DiffuseLight(0.5 / np.pi * total))
    np.testing.assert_allclose(arrived, 1, rtol=1e-4)


def test_glossy_texels_are_what_a_map_shows_in_the_open():
    """With views from the texels' own places: the eye is near."""
    mesh = corner(height=1e-3)
    product = product_texture(parse_spec("ggx:roughness=0.5,f0=1"), 4).map
    light = np.random.default_rng(2).standard_normal((25, 3))
    light[0] = 12.0  # negative light would be cut off, at texels and at points
    lit = product.lit(light)
    baked = bake(Plan(mesh, samples=16, texture=24, glossy=True))
    shown = vertex_colors(mesh, baked, lit)
    faces, weights = points_of(mesh, 50)
    faces %= 2
    places, eye = mesh.interpolated(mesh.vertices, faces, weights), np.array([2.0, -1, 1.5])
    kept = places[:, 0] > 0.1
    views = eye - places
    views /= np.linalg.norm(views, axis=1, keepdims=True)
    normals = np.tile([0.0, 0, 1], (len(faces), 1))
    expected = np.maximum(lit.radiance(normals, views), 0)
    found = shown.radiance(eye, (faces, weights), normals, views)
    np.testing.assert_allclose(found[kept], expected[kept], atol=0.03 * expected.max())


def test_files_hold_textures(tmp_path):
    mesh = corner()
    baked = bake(Plan(mesh, samples=16, texture=24, albedo=np.linspace(0, 1, 8)[:, None]))
    write_transfer(tmp_path / "t.npz", baked, mesh)
    found = read_transfer(tmp_path / "t.npz")
    for name in ("vectors", "albedo"):
        np.testing.assert_array_equal(getattr(found, name), getattr(baked, name))
    np.testing.assert_array_equal(found.texels.rows, baked.texels.rows)
    np.testing.assert_allclose(found.texels.texcoords, baked.texels.texcoords, atol=1e-6)
    with np.load(tmp_path / "t.npz", allow_pickle=False) as held:  # noqa: TID251
        assert json.loads(str(held["settings"]))["version"] == 2
        arrays = dict(held)
    drawn = prefilter(np.ones((8, 16, 3), np.float32), to="irradiance")
    assert isinstance(drawn, Irradiance)
    points = points_of(mesh)
    ways = (np.zeros((300, 3)),) * 2
    np.testing.assert_allclose(
        vertex_colors(mesh, found, drawn).radiance(np.zeros(3), points, *ways),
        vertex_colors(mesh, baked, drawn).radiance(np.zeros(3), points, *ways), atol=1e-5,
    )  # fmt: skip
    few = arrays["texcoords"][:3]
    np.savez(tmp_path / "few.npz", **{**arrays, "texcoords": few})
    with pytest.raises(TransferError, match="not the mesh"):
        vertex_colors(mesh, read_transfer(tmp_path / "few.npz"), drawn)
    wrong = {
        "rows": arrays["rows"] + 1, "positions": arrays["positions"][:-1],
        "texcoords": arrays["texcoords"] * np.nan,
    }  # fmt: skip
    for name, value in wrong.items():
        np.savez(tmp_path / "wrong.npz", **{**arrays, name: value})
        with pytest.raises(TransferError, match="its texture"):
            read_transfer(tmp_path / "wrong.npz")


def test_the_command_bakes_textures_and_draws_them(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    mesh = corner(length=1.0)
    lines = [f"v {x} {y} {z}" for x, y, z in mesh.vertices]
    lines += [f"vt {u} {v}" for u, v in mesh.uvs]
    lines += [f"f {a}/{a} {b}/{b} {c}/{c}" for a, b, c in mesh.faces + 1]
    (tmp_path / "corner.obj").write_text("\n".join(lines) + "\n")
    options = ("corner.obj", "--texture", "32", "--samples", "16")
    assert "of a texture of 32 x 32" in done("transfer", *options)
    assert '"texels": ' in done("transfer", *options, "--json", "-o", "again.npz")
    written = [(tmp_path / name).read_bytes() for name in ("corner.transfer.npz", "again.npz")]
    assert written[0] == written[1]
    done("probe", "furnace", "--size", "8", "-o", "white.exr")
    shown = ("--probe", "white.exr", "--mesh", "corner.obj", "--size", "24", "-o", "a.png")
    done("render", *shown, "--transfer", "again.npz")
    refused = run("transfer", *options, "-o", "a.glb")
    assert_refused(refused, 1, "textures of transfer are written as .npz only")
