"""A parameter that varies over a mesh: by its vertices' colours, or by an image."""

import numpy as np
import pytest

from shrm_cli.errors import MeshError, ProbeError
from shrm_cli.geometry.mesh import make_mesh
from shrm_cli.render.variation import Variation, open_variation
from tests.cli.helpers import assert_refused, done, read_exr, run, write_exr
from tests.probe import scenes

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
    done("product", "lambertian", "--size", "8", "--order", "2", "-o", "plain.exr")
    result = run("render", "plain.exr", *shared[2:], "--vary", "wear.png", "-o", "x.exr")
    assert_refused(result, 2, "--vary")
    (tmp_path / "scene.toml").write_text('[[objects]]\nmesh = "quad.obj"\nvary = "wear.png"\n')
    done(*shared[:4], "--mesh", "scene.toml", "--size", "32", "-o", "scene.exr")
    np.testing.assert_array_equal(read_exr("scene.exr")[1]["G"], varied)
