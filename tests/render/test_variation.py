"""A parameter that varies over a mesh: by its vertices' colours, or by an image."""

import numpy as np
import pytest

from shrm_cli.brdf.models.ggx import Ggx
from shrm_cli.brdf.spec import parse_spec
from shrm_cli.errors import MeshError, ProbeError
from shrm_cli.geometry.mesh import make_mesh
from shrm_cli.geometry.rays import Rays
from shrm_cli.maps.product.make import product
from shrm_cli.probe.disc import Disc
from shrm_cli.render.variation import Variation, open_variation
from shrm_cli.render.vertex_colors import LampsOnMesh, vertex_colors
from shrm_cli.sphere.directions import normalize
from shrm_cli.transfer.bake import Plan, bake
from shrm_cli.vocabulary import LUMINANCE
from tests.cli.helpers import assert_refused, done, read_exr, run, write_exr
from tests.oracles import disc_rule
from tests.probe import scenes
from tests.transfer import meshes

QUAD = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
FACES = np.array([[0, 1, 2], [0, 2, 3]])
UVS = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
OBJ = """v -1 -1 0
v 1 -1 0
v 1 1 0
v -1 1 0
vt 0 0
vt 1 0
vt 1 1
vt 0 1
vn 0 0 1
f 1/1/1 2/2/1 3/3/1 4/4/1
"""


def quad(**given):
    return make_mesh("quad", QUAD, FACES, **given)


def test_vertices_are_interpolated():
    colors = np.array([[0.0, 0, 0], [1, 1, 1], [1, 1, 1], [0, 0, 0]])
    mesh = quad(colors=colors)
    weights = np.array([[0.2, 0.5, 0.3], [1.0, 0, 0], [0, 0.25, 0.75]])
    found = Variation().shares(mesh, np.array([0, 1, 1]), weights)
    np.testing.assert_allclose(found, [0.8, 0.0, 0.25], atol=1e-6)


def test_an_image_is_read_bilinearly_and_its_top_is_at_v_1():
    image = np.repeat([[[0.0], [1.0]], [[0.5], [0.25]]], 3, axis=2)
    mesh = quad(uvs=UVS)
    # The middles of the texels, as barycentric coordinates of the triangles 0 and 1.
    places = {(0.25, 0.75): 0.0, (0.75, 0.75): 1.0, (0.25, 0.25): 0.5, (0.75, 0.25): 0.25,
              (0.5, 0.5): 0.4375, (0.0, 0.75): 0.5}  # fmt: skip
    for (u, v), expected in places.items():
        face, weights = (0, [1 - u, u - v, v]) if u >= v else (1, [1 - v, u, v - u])
        found = Variation(image).shares(mesh, np.array([face]), np.array([weights]))
        assert found[0] == pytest.approx(expected), (u, v)


def test_red_and_green_tell_two_parameters():
    red, green, blue = (np.eye(3)[k] for k in range(3))
    colors = np.array([red, green, red + green, blue])
    weights = np.array([[0.2, 0.5, 0.3], [0.0, 0.0, 1.0]])
    found = Variation().shares(quad(colors=colors), np.array([0, 1]), weights, 2)
    np.testing.assert_allclose(found, [[0.5, 0.8], [0.0, 0.0]], atol=1e-6)
    image = np.array([[red, green], [0.5 * red + 0.25 * green, blue]])
    found = Variation(image).shares(quad(uvs=UVS), np.array([0]), np.array([[0.5, 0.0, 0.5]]), 2)
    np.testing.assert_allclose(found, [[1.5 / 4, 1.25 / 4]], atol=1e-6)


def test_what_a_mesh_lacks_is_named(tmp_path):
    with pytest.raises(MeshError, match="no vertex colours"):
        open_variation("vertex", quad())
    with pytest.raises(MeshError, match="no texture coordinates"):
        open_variation("wear.png", quad())
    with pytest.raises(ProbeError, match="no such file"):
        open_variation(str(tmp_path / "wear.png"), quad(uvs=UVS))


def test_a_picture_of_a_brdf_that_varies(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "quad.obj").write_text(OBJ)
    steps = (np.linspace(0, 1, 8) * 255).astype(np.uint8)
    scenes.write_png(tmp_path / "wear.png", np.broadcast_to(steps[None, :, None], (8, 8, 3)))
    light = np.full((16, 32, 3), 0.2, np.float32)
    light[:8] = 1
    write_exr(tmp_path / "probe.exr", light)
    done("product", "lambertian", "--vary", "albedo=0.2..1", "--steps", "2", "--size", "8",
         "--order", "2", "-o", "grey.exr")  # fmt: skip
    shared = ("render", "grey.exr", "--probe", "probe.exr",
              "--mesh", "quad.obj", "--size", "32")  # fmt: skip
    done(*shared, "--vary", "wear.png", "-o", "varied.exr")
    done(*shared, "-o", "middle.exr")
    varied, middle = (read_exr(name)[1]["G"] for name in ("varied.exr", "middle.exr"))
    assert middle[16, 8] == pytest.approx(middle[16, 24], rel=0.02)
    # At share s the albedo is 0.2 + 0.8 s; the picture of s = 1/2 is that without an image. The
    # quad fills 0.9 of the picture's 32 columns, and the image changes from texel to texel.
    columns = np.arange(6, 26)
    u = ((columns + 0.5) / 32 - 0.5) / 0.9 + 0.5
    expected = (0.2 + 0.8 * (u * 8 - 0.5) / 7) / 0.6
    np.testing.assert_allclose(varied[16, columns] / middle[16, columns], expected, rtol=0.02)
    assert_refused(run(*shared, "--vary", "vertex", "-o", "x.exr"), 1, "no vertex colours")
    done("transfer", "quad.obj", "--matrices", "--samples", "4096", "-o", "quad.npz")
    done(*shared, "--transfer", "quad.npz", "--vary", "wear.png", "-o", "shadowed.exr")
    shadowed = read_exr("shadowed.exr")[1]["G"]
    np.testing.assert_allclose(shadowed[16, columns], varied[16, columns], rtol=0.01)
    done("product", "lambertian", "--size", "8", "--order", "2", "-o", "plain.exr")
    result = run("render", "plain.exr", *shared[2:], "--vary", "wear.png", "-o", "x.exr")
    assert_refused(result, 2, "--vary")
    (tmp_path / "scene.toml").write_text('[[objects]]\nmesh = "quad.obj"\nvary = "wear.png"\n')
    done(*shared[:4], "--mesh", "scene.toml", "--size", "32", "-o", "scene.exr")
    np.testing.assert_array_equal(read_exr("scene.exr")[1]["G"], varied)


ONE = [("ay", 0.3, 0.6)]
TWO = [("ax", 0.3, 0.6), *ONE]


@pytest.fixture(scope="module", params=[ONE, TWO], ids=["one", "two"])
def ball(request):
    """A ball of which each vertex has a colour, its transfer, and what varies over it."""
    mesh = meshes.sphere(2)
    colors = np.random.default_rng(4).random((len(mesh.vertices), 3))
    colored = make_mesh("ball", mesh.vertices, mesh.faces, mesh.normals, colors=colors)
    baked = bake(Plan(colored, 2, samples=4096, glossy=True))
    return colored, baked, product("ward:ax=0.5", 2, 8, request.param, steps=3)


def corners(mesh, eye):
    """Points at the first corners of triangles that see the eye, their normals and their views."""
    normals, views = mesh.normals, eye - mesh.vertices
    views /= np.linalg.norm(views, axis=1, keepdims=True)
    first = mesh.faces[:, 0]
    own = np.flatnonzero(np.sum(normals * views, axis=1)[first] > 0.2)
    points = own, np.tile([1.0, 0.0, 0.0], (len(own), 1))
    return points, normals[first[own]], views[first[own]], first[own]


def test_with_its_own_shadows_each_point_has_its_own_parameters(ball):
    """At vertices of a ball, which hides nothing from itself, they are those without a transfer."""
    mesh, baked, textures = ball
    lit = textures.lit(np.random.default_rng(5).normal(size=(9, 3)) + np.eye(9, 3) * 9)
    points, normals, views, own = corners(mesh, np.array([0.0, 3.0, 6.0]))
    shown = vertex_colors(mesh, baked, lit, variation=Variation())
    found = shown.radiance(np.array([0.0, 3.0, 6.0]), points, normals, views)
    shares = mesh.colors[own][:, : lit.varies] if lit.varies > 1 else mesh.colors[own] @ LUMINANCE
    truth = lit.varied_radiance(normals, baked.frames[own, 0], views, shares)

    def error(of):
        return np.sqrt(np.mean((of - np.maximum(truth, 0)) ** 2) / np.mean(truth**2))

    assert error(found) < 1e-6
    middle = vertex_colors(mesh, baked, lit)
    assert error(middle.radiance(np.array([0.0, 3.0, 6.0]), points, normals, views)) > 0.03


def test_lamps_are_reflected_by_the_parameters_of_each_point(ball):
    mesh, baked, textures = ball
    disc = Disc(np.array([0.0, 0.6, 0.8]), 0.01, np.array([100.0, 80.0, 60.0]))
    points, normals, views, own = corners(mesh, np.array([0.0, 3.0, 6.0]))
    seen = np.flatnonzero(normals @ disc.direction > 0.3)
    points = points[0][seen], points[1][seen]
    normals, views, own = normals[seen], views[seen], own[seen]
    dark = textures.lit(np.zeros((9, 3)))
    shown = vertex_colors(mesh, baked, dark, [disc], variation=Variation())
    found = shown.radiance(np.array([0.0, 3.0, 6.0]), points, normals, views)
    shares = (
        mesh.colors[own][:, :2]
        if dark.varies > 1
        else mesh.colors[own] @ np.array(LUMINANCE)[:, None]
    )
    expected = []
    for normal, view, tangent, share in zip(
        normals, views, baked.frames[own, 0], shares, strict=True
    ):
        frame = np.array([tangent, np.cross(normal, tangent), normal])
        wanted = {
            "ax": 0.5,
            **{k: a + s * (b - a) for (k, (a, b)), s in zip(dark.ways.items(), share, strict=True)},
        }
        value = parse_spec(f"ward:ax={wanted['ax']},ay={wanted['ay']}").evaluate(
            (frame @ disc.direction)[None], (frame @ view)[None]
        )[0]
        expected.append(value * disc.solid_angle * (normal @ disc.direction) * disc.radiance)
    np.testing.assert_allclose(found, expected, rtol=0.01, atol=1e-3 * np.max(expected))


@pytest.mark.parametrize("share", [0.0, 0.15625, 0.6875, 1.0])
def test_a_large_lamp_takes_the_directions_that_the_roughness_of_a_point_needs(share, monkeypatch):
    """It is what a sum over its disc says, and rough points take few of a mirror's directions."""
    radius, counted, evaluate = 0.14, [], Ggx.evaluate
    mesh = make_mesh("quad", QUAD, FACES)
    view, sharp, rough = np.array([0.6, 0.0, 0.8]), 0.2, 0.7

    def brdf(shares):
        return parse_spec(f"ggx:roughness={sharp + (rough - sharp) * shares[0]}")

    def counting(self, light, view):
        counted.append(light.size // 3)
        return evaluate(self, light, view)

    directions = [normalize(np.array([x, 0.1, 0.8])) for x in (-0.62, -0.5, 0.3)]
    discs = [Disc(each, radius, np.ones(3)) for each in directions]
    lamps = LampsOnMesh(mesh, Rays(mesh), discs, brdf)
    point = np.zeros(1, int), np.array([[0.2, 0.3, 0.5]])

    def reflected(at):
        lit = point, np.array([[0.0, 0, 1]]), view[None], np.array([[1.0, 0, 0]])
        return lamps.radiance(*lit, None, np.array([[at]]))[0]

    expected = np.zeros(3)
    for disc in discs:
        light, areas = disc_rule(disc.direction, radius, 96)
        expected += areas @ brdf((share,)).transfer(light, view[None])
    np.testing.assert_allclose(reflected(share), expected, rtol=2e-3)
    taken = {}
    for at in (0.0, 1.0):
        reflected(at)  # finds the rules
        monkeypatch.setattr(Ggx, "evaluate", counting)
        counted.clear()
        reflected(at)
        taken[at] = sum(counted)
        monkeypatch.undo()
    assert taken[1.0] < taken[0.0] / 4
