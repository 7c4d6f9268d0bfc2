"""`shrm render --turn-light` and `--blend-to`: frames, moving pictures and errors."""

import json
import shutil
from dataclasses import replace

import numpy as np
import OpenEXR
import pytest

from shrm_cli.files.image import write_image
from shrm_cli.maps.file import open_map
from shrm_cli.maps.irradiance.irradiance import Irradiance
from shrm_cli.sphere.directions import turn_matrix
from tests.cli.helpers import MESH, assert_refused, noise, run, write_exr
from tests.cli.test_render import read
from tests.render.assets import globe, packed_glb, png
from tests.render.materials import INFO, furnace, spot, under_random_light


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    """Maps of two lights, a mesh and what was baked of it, which are made once."""
    made = tmp_path_factory.mktemp("inputs")
    under_random_light().save(made / "a.exr", "float")
    spot((0, 0, 1)).save(made / "spot.exr", "float")
    rng = np.random.default_rng(3)
    for name in ("sky", "night"):
        light = 0.3 * rng.normal(size=(9, 3)) + [[4, 4, 4], *[[0] * 3] * 8]
        Irradiance(light, replace(INFO, order_f=2)).save(made / f"{name}.irradiance.exr", "float")
    (made / "roof.obj").write_text(MESH)
    result = run(
        "transfer", made / "roof.obj", "--samples", "64", "--order", "2", "-o", made / "roof.npz"
    )
    assert result.code == 0, result.err
    return made


@pytest.fixture
def folder(inputs, tmp_path, monkeypatch):
    """Current folder with maps, a mesh and its transfer."""
    shutil.copytree(inputs, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("frames", [(), ("--frames", "3")])
@pytest.mark.parametrize("name", ["a.webm", "a.%04d.webm"])
def test_other_pictures_are_refused_by_one_line(folder, frames, name):
    """With frames, a.webm was told to be a.%04d.webm, which was told to be a.png."""
    result = run("render", "a.exr", "-o", name, *frames)
    assert_refused(result, 1, f"{name}: what is written is .png, .exr, .apng, .gif, .mp4;")


def done(*arguments):
    result = run("render", *arguments, "--precision", "float")
    assert result.code == 0, result.err
    assert result.err == ""


def recipe(path):
    return json.loads(OpenEXR.File(path).parts[0].header["shrm:recipe"])


def turned(folder, yaw):
    """The irradiance map, turned by its own coefficients."""
    open_map("sky.irradiance.exr").turned(turn_matrix(yaw)).save(folder / "turned.exr", "float")


@pytest.mark.parametrize("mesh", [[], ["--mesh", "roof.obj"], ["--mesh", "roof.obj", "--transfer"]])
def test_a_turned_light_is_the_turned_map(folder, mesh):
    """On spheres, on meshes, and with the mesh's own shadows."""
    mesh = [*mesh, "roof.npz"] if "--transfer" in mesh else mesh
    options = [*mesh, "--size", "64"]
    turned(folder, 73)
    done("turned.exr", *options, "-o", "truth.exr")
    done("sky.irradiance.exr", *options, "--turn-light", "y:73", "-o", "found.exr")
    done("sky.irradiance.exr", *options, "-o", "still.exr")
    truth, found = read("truth.exr"), read("found.exr")
    np.testing.assert_allclose(found, truth, atol=2e-6 * truth.max())
    assert np.abs(read("still.exr") - truth).max() > 0.02 * truth.max()
    assert recipe("found.exr")["turn_light"] == np.round(turn_matrix(yaw=73), 9).tolist()
    assert "turn_light" not in recipe("still.exr")


def test_frames_turn_the_light_and_not_the_viewer(folder):
    done("a.exr", "--size", "32", "--turn-light", "0/2/0:180", "--frames", "2", "-o", "f%02d.exr")
    done("a.exr", "--size", "32", "-o", "first.exr")
    done("a.exr", "--size", "32", "--turn-light", "y:90", "-o", "second.exr")
    np.testing.assert_array_equal(read("f01.exr"), read("first.exr"))
    np.testing.assert_allclose(read("f02.exr"), read("second.exr"), atol=1e-6)
    assert recipe("f02.exr")["view"] == [0, 0]


@pytest.mark.parametrize("mesh", [[], ["--mesh", "roof.obj"], ["--mesh", "roof.obj", "--transfer"]])
def test_frames_go_from_one_light_to_another(folder, mesh):
    mesh = [*mesh, "roof.npz"] if "--transfer" in mesh else mesh
    options = [*mesh, "--size", "48"]
    names = "sky.irradiance.exr", "night.irradiance.exr"
    for name in names:
        done(name, *options, "-o", f"{name[:3]}.exr")
    done(names[0], *options, "--blend-to", names[1], "--frames", "3", "-o", "f%02d.exr")
    sky, night = read("sky.exr"), read("nig.exr")
    assert np.abs(sky - night).max() > 0.05
    np.testing.assert_array_equal(read("f01.exr"), sky)
    np.testing.assert_allclose(read("f02.exr"), (sky + night) / 2, atol=1e-5)
    np.testing.assert_array_equal(read("f03.exr"), night)
    assert recipe("f02.exr")["blend_to"] == [names[1]]
    done(names[0], *options, "--blend-to", names[1], "--blend", "0.25", "-o", "part.exr")
    np.testing.assert_allclose(read("part.exr"), 0.75 * sky + 0.25 * night, atol=1e-5)


@pytest.mark.parametrize("suffix", ["gif", "apng"])
def test_moving_pictures_hold_the_frames(folder, suffix):
    image = pytest.importorskip("PIL.Image", reason="Pillow is not installed")
    options = ["spot.exr", "--size", "32", "--turn-light", "y:360", "--frames", "5"]
    result = run("render", *options, "--fps", "10", "-o", f"turn.{suffix}")
    assert result.out == f"turn.{suffix}: 32 x 32, 5 frames, 10 a second\n"
    done(*options, "-o", "f%02d.png")
    with image.open(f"turn.{suffix}") as found:
        assert (found.n_frames, found.info["duration"]) == (5, 100)
        for k in range(5):
            found.seek(k)
            pixels = np.asarray(found.convert("RGB")).astype(int)
            expected = read(f"f{k + 1:02d}.png")
            assert expected.dtype == np.uint8
            off = pixels - expected
            # The colours of a GIF are mixed: what squares show is nearer than their pixels.
            squares = np.abs(off.reshape(8, 4, 8, 4, 3).mean(axis=(1, 3)))
            assert np.abs(off).max() <= (0 if suffix == "apng" else 5)
            assert squares.max() <= (0 if suffix == "apng" else 1.25)


def test_moving_pictures_that_show_nothing_say_which_exposure_would(folder):
    pytest.importorskip("PIL.Image", reason="Pillow is not installed")
    options = ["render", "spot.exr", "--size", "16", "--frames", "2", "--exposure"]
    (moving, still) = (run(*options, "-14", "-o", name) for name in ("a.gif", "a%02d.png"))
    assert moving.err.startswith("Warning: a.gif: all but black at an exposure of -14; --exposure ")
    assert moving.err.replace("a.gif", "a01.png") == still.err
    assert run(*options, "0", "-o", "b.gif").err == ""


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["a.exr", "--turn-light", "w:3"], "'w:3' is not AXIS:DEGREES such as y:90"),
        (["a.exr", "--turn-light", "0/0/0:3"], "0/0/0 is no axis"),
        (["a.exr", "--turn-light", "y:inf"], "is not AXIS:DEGREES"),
        (["a.exr", "--blend", "0.5"], "--blend applies with --blend-to"),
        (["a.exr", "--blend-to", "phong.exr"], "phong.exr: it is of another"),
        (["a.exr", "spot.exr", "--blend-to", "a.exr"], "1 --blend-to of 2 MAP; give one for each"),
        (["a.exr", "--blend-to", "none.exr"], "none.exr"),
        (["a.exr", "--fps", "3"], "--fps applies to moving pictures"),
        (["a.exr", "-o", "a.%04d.png"], "what is made without --frames is one file; leave"),
        (["a.exr", "-o", "a%d.png"], "a%d.png: what is made without --frames is one file; leave"),
        (["a.exr", "-o", "a%4d.exr"], "a%4d.exr: what is made without --frames is one file; leave"),
        (["a.exr", "-o", "a%d.gif"], "a%d.gif: a moving picture is one file; leave the number"),
        (["a.exr", "--frames", "2", "-o", "a%d.png"], "one place for their number, such as a.%04d"),
        (["a.exr", "--max-memory", "1GB"], "--max-memory applies to moving pictures"),
        (["a.exr", "--frames", "2", "-o", "a.gif", "--max-memory", "1MB"], "is too little"),
        (["a.exr", "--blend-to", "a.exr", "--background-to", "p.exr"], "applies with --background"),
    ],
)
def test_what_is_wrong_is_said_in_a_line(folder, arguments, said):
    phong = {"name": "phong", "parameters": {"exponent": 20}}
    replace(furnace((1.0, 1, 1)), info=replace(INFO, brdf=phong)).save(folder / "phong.exr")
    result = run("render", *arguments)
    assert result.code != 0
    assert said in result.err.splitlines()[-1]


def test_folders_may_have_names_like_numbers(folder):
    (folder / "50%done").mkdir()
    assert run("render", "a.exr", "--size", "16", "-o", "50%done/a.png").code == 0
    assert (folder / "50%done" / "a.png").exists()


def test_keys_of_a_scene_move_light_and_viewer(folder):
    (folder / "scene.toml").write_text(
        '[[objects]]\nmesh = "roof.obj"\n[[key]]\nframe = 1\nturn = 0\nview = [20, 30]\n'
        "[[key]]\nframe = 3\nturn = 80\nview = [40, 10]\n"
    )
    options = ["--mesh", "scene.toml", "--size", "48"]
    done("sky.irradiance.exr", *options, "-o", "f%02d.exr")
    turned(folder, 40)
    done("turned.exr", "--mesh", "roof.obj", "--size", "48", "--view", "30,20", "-o", "truth.exr",
         "--distance", str(recipe("f02.exr")["distance"]))  # fmt: skip
    truth = read("truth.exr")
    np.testing.assert_allclose(read("f02.exr"), truth, atol=2e-6 * truth.max())
    assert recipe("f03.exr")["view"] == [40, 10]
    assert not (folder / "f04.exr").exists()
    result = run("render", "sky.irradiance.exr", *options, "--frames", "2")
    assert "--frames applies without [[key]] in the scene" in result.err
    result = run("render", "sky.irradiance.exr", *options, "--blend-to", "night.irradiance.exr")
    assert "need each other" in result.err


def test_textured_surfaces_turn_their_light_too(folder):
    """Roughness and metalness that vary, under split sums and irradiance of a turned probe."""
    shape = globe(12)
    rough = np.random.default_rng(4).integers(0, 256, (8, 16, 3))
    rough[..., 1] = 96 + rough[..., 1] % 33  # few of the values between which surfaces are drawn
    material = {"pbrMetallicRoughness": {"metallicRoughnessTexture": {"index": 0}}}
    (folder / "globe.glb").write_bytes(packed_glb(shape, material, [png(rough)]))
    write_exr(folder / "light.exr", np.random.default_rng(5).random((16, 32, 3), np.float32))
    for name, yaw in (("still", "0"), ("turned", "90")):
        for form in ("splitsum", "irradiance"):
            levels = ("--levels", "3", "--size", "32") if form == "splitsum" else ()
            result = run("prefilter", "light.exr", "--to", form, *levels, "--yaw", yaw,
                         "-o", f"{name}.{form}.exr")  # fmt: skip
            assert result.code == 0, result.err
    camera = ("--mesh", "globe.glb", "--size", "48")
    for name, turn in (("still", ("--turn-light", "y:90")), ("turned", ())):
        maps = (f"{name}.splitsum.exr", "--irradiance", f"{name}.irradiance.exr")
        done(*maps, *camera, *turn, "-o", f"{name}.exr")
    still = ("still.splitsum.exr", "--irradiance", "still.irradiance.exr")
    done(*still, *camera, "-o", "o.exr")
    moved, expected, rest = (read(f"{name}.exr") for name in ("still", "turned", "o"))
    scale = np.sqrt(np.mean(expected**2))
    assert np.sqrt(np.mean((moved - expected) ** 2)) < 0.002 * scale
    assert np.sqrt(np.mean((rest - expected) ** 2)) > 0.02 * scale
    to = ("--blend-to", "turned.splitsum.exr", "--irradiance-to", "turned.irradiance.exr")
    done(*still, *camera, *to, "--blend", "0.25", "-o", "part.exr")
    blend = 0.75 * rest + 0.25 * expected
    np.testing.assert_allclose(read("part.exr"), blend, atol=2e-3 * blend.max())
    assert recipe("part.exr")["irradiance_to"] == "turned.irradiance.exr"
    done(*still, *camera, *to, "--frames", "3", "-o", "f%02d.exr")
    ends = rest, (rest + expected) / 2, expected
    for frame, truth in enumerate(ends, start=1):
        np.testing.assert_allclose(read(f"f{frame:02d}.exr"), truth, atol=2e-3 * truth.max())
    scene = '[[objects]]\nmesh = "globe.glb"\n'
    keys = "".join(f"[[key]]\nframe = {k}\nblend = {k - 1}\n" for k in (1, 2))
    (folder / "s.toml").write_text(scene + keys)
    done(*still, "--mesh", "s.toml", "--size", "48", *to, "-o", "s%02d.exr")
    for frame, truth in ((1, rest), (2, expected)):
        np.testing.assert_allclose(read(f"s{frame:02d}.exr"), truth, atol=2e-3 * truth.max())
    own = scene + 'irradiance = "still.irradiance.exr"\n'
    for text, given, said in (
        (own + scene + keys, to, "leave the maps and the light of objects out"),
        (own + keys, to, "no materials are drawn of s.toml"),
        (own + scene + keys, to[:2], "of which all light is that of MAP"),
    ):
        (folder / "s.toml").write_text(text)
        light = still if given == to else still[:1]
        result = run("render", *light, "--mesh", "s.toml", *given, "-o", "no%02d.exr")
        assert result.code != 0
        assert said in result.err, result.err
    for given, said in (
        (to[:2], "give --irradiance-to beside --irradiance"),
        (to[2:], "--irradiance-to applies with --blend-to and --irradiance"),
        ((*to[:2], "--irradiance-to", "turned.splitsum.exr"), "not irradiance"),
    ):
        result = run("render", *still, *camera, *given, "-o", "no.exr")
        assert result.code != 0
        assert said in result.err, result.err


def test_glossy_transfer_under_a_turned_light_is_that_under_the_turned_probe(folder):
    """The light of the product texture is that of a probe, which is read turned or not."""
    write_image(folder / "room.exr", noise(16, 32), "float")
    run("product", "phong:exponent=5", "--order", "2", "--size", "16", "-o", "paint.exr")
    result = run(
        "transfer", "roof.obj", "--samples", "64", "--order", "2", "--matrices", "-o", "t.npz"
    )
    assert result.code == 0, result.err
    options = ["paint.exr", "--mesh", "roof.obj", "--transfer", "t.npz", "--size", "48"]
    options += ["--probe", "room.exr", "--window", "none", "--precision", "float"]
    for arguments in (
        ["--roll", "50", "-o", "truth.exr"],
        ["--turn-light", "z:50", "-o", "found.exr"],
        ["-o", "still.exr"],
    ):
        result = run("render", *options, *arguments)
        assert result.code == 0, result.err
    truth = read("truth.exr")
    np.testing.assert_allclose(read("found.exr"), truth, atol=1e-5 * truth.max())
    assert np.abs(read("still.exr") - truth).max() > 0.01 * truth.max()


def test_objects_with_an_own_vary_keep_it_beside_keys_that_turn_the_light(folder):
    """Values of keys are for what follows nothing else, and pass by maps of light alone."""
    write_image(folder / "room.exr", noise(16, 32), "float")
    corners = "".join(f"v {x} {y} 0 1 1 1\n" for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1)))
    (folder / "white.obj").write_text(corners + "f 1 2 3 4\n")
    for line in (
        ("product", "ward:ax=0.5", "--vary", "ay=0.2..0.5", "--steps", "2", "--order", "2",
         "--size", "8", "-o", "paint.exr"),
        ("prefilter", "room.exr", "--to", "splitsum", "--levels", "2", "--size", "8",
         "-o", "levels.exr"),
    ):  # fmt: skip
        result = run(*line)
        assert result.code == 0, result.err
    keys = "".join(f"[[key]]\nframe = {k}\nturn = 9\nvary = {{ay = 0.{2 * k}}}\n" for k in (1, 2))
    light = '[[objects]]\nmesh = "roof.obj"\nmap = "levels.exr"\ntranslate = [3, 0, 0]\n'
    for name, own in (("own", 'vary = "vertex"'), ("keyed", "")):
        scene = f'[[objects]]\nmesh = "white.obj"\nplain = true\n{own}\n{light}{keys}'
        (folder / "s.toml").write_text(scene)
        done("paint.exr", "--probe", "room.exr", "--mesh", "s.toml", "--size", "48",
             "-o", f"{name}%02d.exr")  # fmt: skip
    first, last, keyed, later = (
        read(f"{name}.exr") for name in ("own01", "own02", "keyed01", "keyed02")
    )
    np.testing.assert_array_equal(first, last)
    assert np.abs(keyed - later).max() > 0.01 * keyed.max()


def test_maps_of_which_nothing_varies_are_told_what_makes_some(folder):
    """It was said that there is none."""
    result = run("render", "a.exr", "--vary", "ay=0.2", "-o", "x.png")
    assert_refused(result, 1, "no map has a parameter 'ay' that varies; shrm product --vary makes")


def test_frames_in_which_nothing_moves_are_told(folder):
    """A scene of one keyframe is a still film; one of two keys that differ is none."""
    (folder / "s.toml").write_text('[[objects]]\nmesh = "roof.obj"\n[[key]]\nframe = 2\nturn = 9\n')
    options = ["sky.irradiance.exr", "--size", "32", "-o", "f%02d.png"]
    rest = run("render", *options, "--mesh", "s.toml")
    assert "f%02d.png: nothing moves: its 2 frames are alike" in rest.err
    whole = run("render", *options, "--turn-light", "y:720", "--frames", "2")
    assert "its 2 frames are alike" in whole.err
    moves = run("render", *options, "--turn-light", "y:90", "--frames", "2")
    with open(folder / "s.toml", "a") as scene:
        scene.write("[[key]]\nframe = 3\nturn = 30\n")
    keys = run("render", *options, "--mesh", "s.toml")
    walk = run("render", *options, "--frames", "2")
    assert (moves.code, keys.code, walk.code) == (0, 0, 0)
    assert "alike" not in moves.err + keys.err + walk.err
