"""`shrm render --mesh`: files, scenes, cameras and errors."""

import json
import shutil
from dataclasses import replace

import numpy as np
import pytest

from shrm_cli.maps.irradiance.irradiance import Irradiance
from shrm_cli.maps.splitsum.split_sum import SplitSum
from tests.cli.helpers import run
from tests.cli.test_render import read
from tests.geometry.shapes import TETRAHEDRON, glb, gltf_tree, icosphere, obj
from tests.render.assets import globe, packed_glb, png
from tests.render.materials import INFO, furnace, under_random_light

PBR = {"baseColorFactor": [0.8, 0.4, 0.2, 1], "metallicFactor": 0, "roughnessFactor": 0.5}
SCENE = """
[[objects]]
mesh = "ball.obj"
map = "red.exr"
translate = [-2, 0, 0]
[[objects]]
mesh = "ball.obj"
translate = [2, 0, 0]
scale = 0.5
"""


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    """Meshes, maps and a scene, which are made once."""
    made = tmp_path_factory.mktemp("inputs")
    rng = np.random.default_rng(5)
    (made / "ball.obj").write_bytes(obj(*icosphere(2)))
    tree = gltf_tree(*TETRAHEDRON, material={"pbrMetallicRoughness": PBR})
    (made / "paint.glb").write_bytes(glb(*tree))
    (made / "scene.toml").write_text(SCENE)
    under_random_light().save(made / "a.exr", "float")
    furnace((1.0, 0, 0)).save(made / "red.exr", "float")
    levels = tuple(rng.random((6 * size, size, 3)) for size in (8, 4))
    SplitSum(levels, (0.0, 1.0), "linear", INFO).save(made / "split.exr", "float")
    even = 0.1 * rng.random((9, 3)) + [[4, 4, 4], *[[0] * 3] * 8]  # positive from all sides
    irradiance = Irradiance(even, replace(INFO, order_f=2))
    irradiance.save(made / "irradiance.exr", "float")
    return made


@pytest.fixture
def folder(inputs, tmp_path, monkeypatch):
    """Current folder with meshes, maps and a scene."""
    shutil.copytree(inputs, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def done(*arguments):
    result = run("render", *arguments)
    assert result.code == 0, result.err
    return result


def test_a_picture_of_a_mesh(folder):
    said = json.loads(
        done("a.exr", "--mesh", "ball.obj", "--size", "48x32", "--fov", "50", "--json").out
    )
    assert [each["file"] for each in said["files"]] == ["a.ball.png"]
    assert (said["width"], said["height"], said["triangles"]) == (48, 32, 320)
    assert said["fov"] == 50
    np.testing.assert_allclose(said["target"], 0, atol=1e-6)
    assert read("a.ball.png").shape[:2] == (32, 48)


def test_pictures_do_not_depend_on_folders(folder):
    (folder / "sub").mkdir()
    (folder / "sub" / "ball.obj").write_bytes((folder / "ball.obj").read_bytes())
    done("a.exr", "--mesh", "ball.obj", "--size", "16", "-o", "one.exr")
    done("a.exr", "--mesh", "sub/ball.obj", "--size", "16", "-o", "two.exr")
    assert (folder / "one.exr").read_bytes() == (folder / "two.exr").read_bytes()


def test_turntables_and_sheets(folder):
    done("a.exr", "red.exr", "--mesh", "ball.obj", "--size", "32x16", "--frames", "2")
    frames = [read(f"sheet.ball.000{k}.png") for k in (1, 2)]
    assert frames[0].shape == frames[1].shape
    height, width = frames[0].shape[:2]
    assert width > 64
    assert 16 < height < 100
    assert not np.array_equal(*frames)


def test_the_camera_is_given(folder):
    near, far = (
        read_of("red.exr", "--distance", each, "--target", "0,0,0", "--fov", "30")
        for each in (4, 8)
    )
    assert (near > 0).sum() > 3.5 * (far > 0).sum()


def read_of(*arguments):
    done(*arguments, "--mesh", "ball.obj", "--size", "64", "-o", "x.exr")
    return read("x.exr")[..., 0]


def test_a_scene_of_two_maps(folder):
    done("a.exr", "--mesh", "scene.toml", "--size", "60x30", "-o", "x.exr")
    picture = read("x.exr")
    assert picture[15, 17, 0] == pytest.approx(1, rel=0.01)
    np.testing.assert_allclose(picture[15, 17, 1:], 0, atol=0.01)
    # The first ball is twice as large as the other.
    red = np.abs(picture[:, :30]).max(axis=-1) > 0
    other = np.abs(picture[:, 30:]).max(axis=-1) > 0
    assert red.sum() == pytest.approx(4 * other.sum(), rel=0.2)


def test_materials_of_gltf_need_light_for_their_diffuse_part(folder):
    result = done("split.exr", "--mesh", "paint.glb", "--size", "32", "-o", "x.exr")
    assert "only the specular part" in result.err
    assert "--irradiance" in result.err
    specular = read("x.exr")
    arguments = ("--irradiance", "irradiance.exr", "--size", "32", "-o", "y.exr")
    assert done("split.exr", "--mesh", "paint.glb", *arguments).err == ""
    both = read("y.exr")
    assert (both >= specular).all()
    assert both.mean() > specular.mean()
    rougher = done("split.exr", "--mesh", "paint.glb", *arguments, "--roughness", "0.9")
    assert rougher.err == ""
    assert not np.array_equal(read("y.exr"), both)


def refused(*arguments):
    result = run("render", *arguments)
    assert result.code in (1, 2)
    assert result.err.startswith("Error: ")
    assert result.err.count("\n") == 1
    assert "internal" not in result.err
    return result.err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((), "Missing argument"),
        (("--mesh", "ball.obj"), "Missing argument"),
        (("a.exr", "--fov", "30"), "--fov applies with --mesh"),
        (("a.exr", "--brush", "uv"), "--brush applies with --mesh"),
        (("a.exr", "--size", "32x16"), "--size"),
        (("a.exr", "--size", "32x"), "not a size"),
        (("a.exr", "--size", "8"), "range"),
        (("a.exr", "--mesh", "ball.obj", "--brush", "uv"), "texture coordinates"),
        (("a.exr", "--mesh", "ball.obj", "--brush", "0,0,0"), "direction"),
        (("a.exr", "--mesh", "ball.obj", "--target", "1,2"), "X,Y,Z"),
        (("a.exr", "--mesh", "ball.obj", "--distance", "0"), "--distance"),
        (("a.exr", "--mesh", "ball.obj", "--roughness", "0.3"), "--roughness applies"),
        (("a.exr", "--mesh", "none.obj"), "none.obj: no such file"),
        (("a.exr", "--mesh", "a.exr"), "ends in"),
        (("a.exr", "--mesh", "none.toml"), "none.toml: no such file"),
        (("split.exr", "--mesh", "ball.obj", "--irradiance", "irradiance.exr"), "no materials"),
        (("split.exr", "--mesh", "paint.glb", "--irradiance", "a.exr"), "not irradiance"),
        (("--mesh", "scene.toml"), "Missing argument"),
        (("a.exr", "--mesh", "ball.obj", "-o", "ball.obj"), "ball.obj"),
    ],
)
def test_what_is_refused(folder, arguments, words):
    assert words in refused(*arguments)
    assert not list(folder.glob("*.png"))


BALL = '[[objects]]\nmesh = "ball.obj"\n'
BAD = {
    "": "[[objects]]",
    "x = ": "no TOML",
    "x = 1": "[[objects]]",
    "objects = [1]": "none of",
    "[[objects]]": "mesh",
    '[[objects]]\nmesh = "gone.obj"': "gone.obj: no such file",
    BALL + "color = 1": "'color' is none of",
    BALL + "roughness = 7": "roughness",
    BALL + "roughness = nan": "roughness",
    BALL + 'f0 = "unobtainium"': "unobtainium",
    BALL + "f0 = [1, 2]": "f0",
    BALL + "brush = [0, 0, 0]": "brush",
    BALL + 'brush = "uv"': "bad.toml: object 1: brush cannot be uv",
    BALL + "anisotropy = 0.5": "split sums of GGX",
    BALL + 'map = "split.exr"\nanisotropy = 2': "within 0 .. 1",
    BALL + 'map = "split.exr"\nanisotropy = 0.5\ntaps = 4': "3, 5 or 8",
    BALL + 'map = "split.exr"\ntaps = 5': "taps are 0, 1, 2 or 3",
    BALL + "scale = 0": "scale",
    BALL + "scale = inf": "scale",
    BALL + "scale = [1, 1, 1" + "0" * 400 + "]": "scale",
    BALL + "translate = 3": "translate",
    BALL + 'map = "gone.exr"': "gone.exr",
    BALL + 'irradiance = "a.exr"': "not irradiance",
    '[[objects]]\nmesh = "../ball.obj"': "object 1: mesh: '../ball.obj' leaves the scene's folder",
    BALL + 'map = "/etc/passwd"': "map: '/etc/passwd' leaves the scene's folder",
    BALL + 'irradiance = "C:a.exr"': "irradiance: 'C:a.exr' leaves the scene's folder",
    BALL + 'vary = "b/../../wear.png"': "vary: 'b/../../wear.png' leaves the scene's folder",
    BALL * 300: "more than 256",
    "a = " + "[" * 5000: "nested too deeply",
}


@pytest.mark.parametrize("text", BAD)
def test_bad_scenes(folder, text):
    (folder / "bad.toml").write_text(text)
    said = refused("a.exr", "--mesh", "bad.toml")
    assert BAD[text] in said
    assert said.startswith(("Error: bad.toml: ", "Error: gone.", "Error: a.exr: "))


def test_links_of_a_scene_lead_to_no_file_elsewhere(folder):
    (folder / "in").mkdir()
    (folder / "in" / "ball.obj").symlink_to(folder / "ball.obj")
    (folder / "in" / "bad.toml").write_text('[[objects]]\nmesh = "ball.obj"')
    assert "mesh: 'ball.obj' leaves the scene's folder" in refused("--mesh", "in/bad.toml", "a.exr")


def test_a_scene_with_maps_of_its_own_takes_no_other(folder):
    (folder / "own.toml").write_text(BALL + 'map = "red.exr"\n')
    assert "leave MAP out" in refused("a.exr", "--mesh", "own.toml")
    done("--mesh", "own.toml", "--size", "16")
    assert (folder / "own.png").exists()


def test_an_object_is_brushed_as_a_mesh_alone_is(folder):
    """Of several objects, each may be: the other one does not change."""
    surface = "roughness = 0.4\nanisotropy = 0.7\ntaps = 8\nbrush = [0, 1, 0]\n"
    (folder / "brushed.toml").write_text(BALL + surface)
    camera = ("--size", "24", "--fov", "40", "--distance", "4", "--target", "0,0,0")
    done("split.exr", "--mesh", "brushed.toml", *camera, "-o", "x.exr")
    options = ("--roughness", "0.4", "--anisotropy", "0.7", "--taps", "8", "--brush", "0,1,0")
    done("split.exr", "--mesh", "ball.obj", *options, *camera, "-o", "y.exr")
    even = ("--roughness", "0.4", "--brush", "0,1,0")
    done("split.exr", "--mesh", "ball.obj", *even, *camera, "-o", "z.exr")
    np.testing.assert_array_equal(read("x.exr"), read("y.exr"))
    assert np.abs(read("x.exr") - read("z.exr")).max() > 0.02


def test_surfaces_of_a_file_are_drawn_and_said(folder):
    """Where a map holds its own BRDF, colours count, and a warning names what does not."""
    pictures = [png(np.full((2, 2, 3), 128)), png(np.full((2, 2, 3), 200))]
    textures = {"baseColorTexture": {"index": 0}, "metallicRoughnessTexture": {"index": 1}}
    worn = {"name": "worn\n", "pbrMetallicRoughness": textures, "alphaMode": "BLEND"}
    (folder / "worn.glb").write_bytes(packed_glb(globe(6), worn, pictures))
    arguments = ("--mesh", "worn.glb", "--size", "32")
    result = done("split.exr", *arguments, "--irradiance", "irradiance.exr", "-o", "x.exr")
    assert (
        result.err == "Warning: worn.glb: not drawn of the material 'worn\\n' (alphaMode BLEND)\n"
    )
    assert "worn.glb: with its own materials, 1; --plain leaves them out" in result.out
    result = done("a.exr", *arguments, "-o", "y.exr")
    assert "(alphaMode BLEND, textures of roughness and metallic, which split sums" in result.err
    result = done("a.exr", *arguments, "--plain", "-o", "z.exr")
    assert result.err == ""
    assert "materials" not in result.out
    gray = ((128 / 255 + 0.055) / 1.055) ** 2.4
    np.testing.assert_allclose(read("y.exr"), gray * read("z.exr"), rtol=2e-3, atol=1e-6)
    said = json.loads(done("a.exr", *arguments, "--plain", "--json").out)
    assert "materials" not in said
    assert said["plain"] is True


def test_textures_that_cannot_be_read_are_one_line(folder):
    """Without the surface the mesh is drawn."""
    from tests.geometry.shapes import gltf

    paint = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}
    tree, data = gltf_tree(*TETRAHEDRON, uvs=np.zeros((4, 2)), material=paint)
    for image, why in (
        ({"uri": "missing.png"}, "'missing.png' is missing"),
        ({"uri": "../a.png"}, "'../a.png' is not in its folder"),
        ({"uri": "http://a.b/c.png"}, "is not in its folder"),
        ({"uri": "data:image/png;base64,AAAA"}, "neither PNG"),
        ({"bufferView": 99}, "index beyond"),
    ):
        tree |= {"images": [image], "textures": [{"source": 0}]}
        (folder / "bad.gltf").write_bytes(gltf(tree, data))
        assert why in refused("a.exr", "--mesh", "bad.gltf", "--size", "16")
        done("a.exr", "--mesh", "bad.gltf", "--size", "16", "--plain")
    scene = SCENE + '[[objects]]\nmesh = "bad.gltf"\nplain = %s\n'
    (folder / "scene.toml").write_text(scene % "true")
    done("a.exr", "--mesh", "scene.toml", "--size", "16")
    (folder / "scene.toml").write_text(scene % '"no"')
    assert "plain must be true or false" in refused("a.exr", "--mesh", "scene.toml")
    assert "no materials" in refused(
        "split.exr", "--mesh", "paint.glb", "--plain", "--irradiance", "irradiance.exr"
    )
