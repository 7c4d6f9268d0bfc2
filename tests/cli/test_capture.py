"""`shrm probe capture`: what the file says of its place, and what is refused."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

import shrm_cli as shrm
from shrm_cli.rooms import capture
from tests.cli.helpers import assert_refused, done, read_exr, run, write_exr
from tests.cli.test_grid import write_gltf
from tests.geometry.shapes import icosphere
from tests.rooms import shapes

SMALL = ("--size", 16, "--samples", 4)


@pytest.fixture(scope="module", autouse=True)
def _few_patches():
    """Rooms of few patches: nothing here measures the brightness of walls."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(capture, "_PATCHES", 12)
        yield


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A folder with a room whose lamp is a material, a white sky, and a probe of the room."""
    folder = tmp_path_factory.mktemp("room")
    parts = [shapes.box([0, 0, 0], [4, 2, 3]), shapes.ceiling_lamp(2, 1.5, 1.99)]
    write_gltf(folder / "room.glb", parts, [("wall", 0.5, 0), ("lamp", 0, 10)])
    write_exr(folder / "white.exr", np.ones((16, 32, 3), np.float32))
    done("probe", "capture", folder / "room.glb", "--at", "1,1,1", "-o", folder / "p.exr", *SMALL)
    return folder


@pytest.fixture
def folder(made, tmp_path, monkeypatch):
    """Current folder with these files."""
    for each in made.iterdir():
        shutil.copy(each, tmp_path)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_probe_holds_its_place_and_the_box_of_the_room(folder):
    said = json.loads(
        done("probe", "capture", "room.glb", "--at", "1,1,1", "-o", "q.exr", *SMALL, "--json")
    )
    header, channels = read_exr("p.exr")
    proxy = {"at": [1, 1, 1], "min": [0, 0, 0], "max": [4, 2, 3]}
    assert json.loads(header["shrm:proxy"]) == said["proxy"] == proxy
    recipe = json.loads(header["shrm:recipe"])
    assert recipe["mesh"] == "room.glb"
    assert recipe["noise"] == pytest.approx(said["noise"], abs=1e-5)
    assert 0 < said["noise"] < 0.5
    assert channels["R"].shape == (16, 32)
    assert channels["R"].max() == 10
    assert (folder / "q.exr").read_bytes() == (folder / "p.exr").read_bytes()


def test_options_reach_the_room(folder):
    base = ("probe", "capture", "room.glb", "--at", "1,1,1", *SMALL)
    done(*base, "--emit", "lamp=20,10,0", "--albedo", "wall=0", "-o", "a.exr")
    _, channels = read_exr("a.exr")
    lamp = channels["R"] > 19
    assert lamp.any()
    for name, value in (("R", 20), ("G", 10), ("B", 0)):
        assert (channels[name][lamp] == value).all()
    assert np.median(channels["R"]) == 0
    box = ("--box", "-1,0,0,5,3,3.5")
    done(*base, *box, "-o", "b.exr")
    assert json.loads(read_exr("b.exr")[0]["shrm:proxy"])["max"] == [5, 3, 3.5]


def test_light_from_outside_is_seen(folder):
    base = ("probe", "capture", "room.glb", "--probe", "white.exr", "--box", "8,0,0,12,2,2")
    said = run(*base, "--at", "10,1,1", "-o", "p.exr", *SMALL)
    assert said.code == 0
    _, channels = read_exr("p.exr")
    assert np.median(channels["G"]) == pytest.approx(1, rel=1e-3)
    assert channels["G"].min() == pytest.approx(0, abs=1e-3)  # backs of walls


def test_places_are_checked(folder):
    base = ("probe", "capture", "room.glb", "-o", "q.exr", *SMALL)
    assert_refused(run(*base, "--at", "9,1,1"), 1, "--at 9,1,1", "not within the box")
    assert_refused(run(*base, "--at", "1,1,1", "--box", "0,0,0,0,2,3"), 1, "--box", "flat")
    assert_refused(run(*base, "--at", "1,1"), 2, "--at")
    assert_refused(run(*base), 2, "--at")
    assert_refused(run("probe", "capture", "none.glb", "--at", "1,1,1", "-o", "q.exr"), 1, "none")
    assert not (folder / "q.exr").exists()


def test_a_place_within_a_wall_is_told(folder):
    parts = [shapes.box([0, 0, 0], [4, 2, 3], inward=False), shapes.ceiling_lamp(2, 1.5, 1.99)]
    write_gltf(folder / "inside_out.glb", parts, [("wall", 0.5, 0), ("lamp", 0, 10)])
    said = run("probe", "capture", "inside_out.glb", "--at", "1,1,1", "-o", "p.exr", *SMALL)
    assert said.code == 0
    assert "back of surfaces" in said.err


@pytest.fixture
def captured(folder):
    """The box of p.exr, which is in the current folder."""
    return {"at": [1, 1, 1], "min": [0, 0, 0], "max": [4, 2, 3]}


def held(path):
    """The proxy box of a map, as `shrm info` tells it."""
    return json.loads(done("info", path, "--json")).get("proxy")


@pytest.mark.parametrize(
    "options",
    [
        ("--brdf", "ggx:roughness=0.5", "--eps", "0.1"),
        ("--brdf", "0.5*lambertian+0.5*ggx:roughness=0.5", "--eps", "0.1"),
        ("--brdf", "ggx:roughness=0.6", "--to", "principal"),
        ("--brdf", "ggx:roughness=0.6", "--to", "cabral", "--eps", "0.1"),
        ("--to", "splitsum", "--size", 8),
        ("--to", "she"),
        ("--to", "irradiance"),
    ],
)
def test_maps_of_every_form_hold_the_box(captured, options):
    done("prefilter", "p.exr", *options, "-o", "m.exr")
    assert held("m.exr") == captured
    assert held("p.exr") == captured


def test_boxes_are_given_and_replaced(captured, folder):
    base = ("prefilter", "--to", "irradiance", "--force", "-o", "m.exr")
    done(*base, "p.exr", "--box", "-1,0,0,5,3,4")
    assert held("m.exr") == {"at": [1, 1, 1], "min": [-1, 0, 0], "max": [5, 3, 4]}
    done(*base, "p.exr", "--at", "2,1,1.5")
    assert held("m.exr")["at"] == [2, 1, 1.5]
    done(*base, "white.exr")
    assert held("m.exr") is None
    done(*base, "white.exr", "--box", "0,0,0,2,4,6")
    assert held("m.exr") == {"at": [1, 2, 3], "min": [0, 0, 0], "max": [2, 4, 6]}
    assert_refused(run(*base, "white.exr", "--at", "1,1,1"), 1, "--at", "--box")
    assert_refused(run(*base, "p.exr", "--at", "9,1,1"), 1, "--at 9,1,1", "not within")
    # A file whose attribute is none of a box counts as one without.
    write_exr(folder / "odd.exr", np.ones((8, 16, 3), np.float32), **{"shrm:proxy": '{"at": 3}'})
    done(*base, "odd.exr")
    assert held("m.exr") is None


def test_maps_in_other_boxes_are_other_maps(captured):
    base = ("prefilter", "p.exr", "--to", "irradiance")
    done(*base)
    done(*base)
    assert_refused(run(*base, "--box", "-1,0,0,5,3,4"), 1, "--force")
    done("sun", "p.exr", "-o", "residual.exr")
    assert held("residual.exr") == captured


def test_a_box_is_turned_with_its_probe(captured):
    base = ("prefilter", "p.exr", "--to", "irradiance", "--force", "-o", "m.exr")
    done(*base, "--yaw", 90)  # +Z becomes +X
    assert held("m.exr") == {"at": [1, 1, -1], "min": [0, 0, -4], "max": [3, 2, 0]}
    said = run(*base, "--yaw", 30)
    assert said.code == 0
    assert "proxy box is left out" in said.err
    assert held("m.exr") is None
    done("prefilter", "p.exr", "--to", "irradiance", "--force", "-o", "m.exr")
    done("convert", "m.exr", "--to", "irradiance", "--yaw", 90, "-o", "t.exr")
    assert held("t.exr") == {"at": [1, 1, -1], "min": [0, 0, -4], "max": [3, 2, 0]}
    done("convert", "m.exr", "--to", "irradiance", "--yaw", 30, "-o", "u.exr")
    assert held("u.exr") is None
    done("convert", "p.exr", "--to", "hcross", "--size", 8, "-o", "h.exr")
    assert held("h.exr") == captured


def test_pictures_obey_the_box_until_told_otherwise(captured, folder):
    done("prefilter", "p.exr", "--brdf", "ggx:roughness=0.5", "--eps", "0.1", "-o", "m.exr")
    done("prefilter", "p.exr", "--brdf", "ggx:roughness=0.5", "--eps", "0.1", "-o", "n.exr",
         "--box", "-1e6,-1e6,-1e6,1e6,1e6,1e6")  # fmt: skip
    small = ("--size", 32)
    ball = ("render", "--mesh", "ball.glb", "--plain", *small)
    vertices, faces = icosphere(2)
    write_gltf(folder / "ball.glb", [(0.3 * vertices + [3, 1, 2], faces, vertices)],
               [("ball", 0.5, 0)])  # fmt: skip
    pictures = {}
    for name, extra in (("box", ("m.exr",)), ("none", ("m.exr", "--no-box")), ("far", ("n.exr",))):
        done(*ball, *extra, "-o", f"{name}.exr")
        pictures[name] = read_exr(f"{name}.exr")[1]["R"]
    np.testing.assert_allclose(pictures["none"], pictures["far"], rtol=0.01, atol=1e-3)
    assert np.abs(pictures["box"] - pictures["none"]).max() > 0.05
    # A sphere at the same place looks nearly the same, and at the probe's as without a place.
    done("render", "m.exr", *small, "-o", "plain.exr")
    done("render", "m.exr", *small, "--place", "1,1,1", "--radius", 0, "-o", "home.exr")
    done("render", "m.exr", *small, "--place", "3,1,2", "--radius", 0.3, "-o", "there.exr")
    plain, home, there = (read_exr(f"{name}.exr")[1]["R"] for name in ("plain", "home", "there"))
    np.testing.assert_allclose(home, plain, rtol=1e-3)
    assert np.abs(there - plain).max() > 0.05
    assert there[16, 16] == pytest.approx(pictures["box"][16, 16], rel=0.1)


def test_light_that_becomes_another_stays_in_its_box_and_light_that_turns_says_it_does_not(
    captured, folder
):
    """A map that became itself looked as without a box, 56 % off, and its first frame did not."""
    spec = ("--brdf", "0.3*lambertian+0.7*ggx:roughness=0.5", "--eps", "0.1")
    done("prefilter", "p.exr", *spec, "-o", "m.exr")
    done("prefilter", "p.exr", *spec, "--box", "-1e6,-1e6,-1e6,1e6,1e6,1e6", "-o", "n.exr")
    vertices, faces = icosphere(2)
    write_gltf(folder / "ball.glb", [(0.3 * vertices + [3, 1, 2], faces, vertices)],
               [("ball", 0.5, 0)])  # fmt: skip
    base, drawn = ("render", "--mesh", "ball.glb", "--plain", "--size", 24), {}
    for name, extra in (
        ("still", ("m.exr",)), ("itself", ("m.exr", "--blend-to", "m.exr", "--blend", 0.5)),
        ("far", ("n.exr",)), ("both", ("m.exr", "--blend-to", "n.exr", "--blend", 0.25)),
    ):  # fmt: skip
        result = run(*base, *extra, "-o", f"{name}.exr")
        assert (result.code, result.err) == (0, "")
        drawn[name] = read_exr(f"{name}.exr")[1]["R"]
    near = {"rtol": 2e-3, "atol": 1e-3}
    np.testing.assert_allclose(drawn["itself"], drawn["still"], **near)
    np.testing.assert_allclose(drawn["both"], 0.75 * drawn["still"] + 0.25 * drawn["far"], **near)
    assert np.abs(drawn["still"] - drawn["far"]).max() > 0.05
    (line,) = run(*base, "m.exr", "--turn-light", "y:90", "-o", "t.exr").err.splitlines()
    assert line.startswith("Warning: m.exr: its proxy box is left out")
    assert run(*base, "m.exr", "--turn-light", "y:90", "--no-box", "-o", "u.exr").err == ""
    assert run("render", "m.exr", "--turn-light", "y:90", "--size", 16, "-o", "v.exr").err == ""


def test_what_stands_outside_the_box_is_told(captured, folder):
    """It was a patchwork of the room's walls, without a word."""
    done("prefilter", "p.exr", "--to", "irradiance", "-o", "m.exr")
    vertices, faces = icosphere(1)
    for name, place in (("in", [3, 1, 2]), ("out", [3, 1, 3])):
        mesh = 0.3 * vertices + place, faces, vertices
        write_gltf(folder / f"{name}.glb", [mesh], [("ball", 0.5, 0)])
    base = ("render", "m.exr", "--size", 16, "-o", "r.png")
    words = "m.exr: {} of what it lights lies outside its box, which goes from 0,0,0 to 4,2,3"
    assert run(*base, "--mesh", "in.glb", "--plain").err == ""
    half = run(*base, "--mesh", "out.glb", "--plain").err
    assert "lies outside its box" in half
    assert 0.3 < int(half.split("% of what")[0].split()[-1]) / 100 < 0.6
    assert run(*base, "--mesh", "out.glb", "--plain", "--no-box").err == ""
    objects = [f'[[objects]]\nmesh = "{name}.glb"\nplain = true\n' for name in ("in", "out")]
    scene = "".join(objects)
    (folder / "s.toml").write_text(scene)
    part = run(*base, "--mesh", "s.toml").err
    assert part.startswith("Warning: m.exr: ")
    shares = [float(each.split("% of what")[0].split()[-1]) for each in (half, part)]
    assert shares[1] == pytest.approx(shares[0] / 2, abs=1)
    (folder / "s.toml").write_text(scene + 'map = "m.exr"\n')
    own = run(*base, "--mesh", "s.toml").err
    assert own.count("lies outside its box") == 1
    assert own.startswith("Warning: a map of representation irradiance of p.exr: ")
    assert own.split(": ")[2] == half.split(": ")[2]
    assert words.format("100%") in run(*base, "--place", "9,9,9").err
    assert run(*base, "--place", "3,1,2").err == ""
    shown = run("view", "m.exr", "--mesh", "out.glb", "-o", "page.html")
    assert shown.code == 0
    assert "lies outside its box" in shown.err


def test_places_need_a_box_and_a_sphere(captured):
    done("prefilter", "white.exr", "--to", "irradiance", "-o", "w.exr")
    done("prefilter", "p.exr", "--to", "irradiance", "-o", "m.exr")
    base = ("render", "-o", "r.png", "--size", 16)
    assert_refused(run(*base, "w.exr", "--place", "1,1,1"), 2, "--place", "w.exr has none")
    assert_refused(run(*base, "m.exr", "--radius", "1"), 2, "--radius", "with --place")
    assert_refused(run(*base, "m.exr", "--no-box"), 2, "--no-box", "--mesh")
    mesh = ("--mesh", "room.glb")
    assert_refused(run(*base, *mesh, "m.exr", "--place", "1,1,1"), 2, "--place", "spheres")


def readme(engine, *options):
    done("export", "p.exr", "--for", engine, *options, "-o", engine)
    return next(Path(engine).glob("*_README.md")).read_text()


def test_engines_are_told_of_the_box(captured):
    """A place of (1, 1, 1) in a box of 4 x 2 x 3, whose middle is (2, 1, 1.5)."""
    unity = readme("unity")
    assert "captured at (1, 1, 1) in the box from (0, 0, 0) to (4, 2, 3)" in unity
    assert "probe.transform.position = new Vector3(-1f, 1f, 1f); probe.boxProjection" in unity
    assert (
        "probe.center = new Vector3(-1f, 0f, 0.5f); probe.size = new Vector3(4f, 2f, 3f)" in unity
    )
    unreal = readme("unreal")
    assert "Location 200, 150, 100; Scale 200, 150, 100; Capture Offset -100, -50, 0" in unreal
    godot = readme("godot")
    assert "probe.position = Vector3(2, 1, 1.5)" in godot
    assert "probe.origin_offset = Vector3(-1, 0, -0.5)" in godot
    assert "Filament looks it up as if all of it were far away" in readme("filament", "--size", 32)
    done("prefilter", "p.exr", "--to", "irradiance", "-o", "s.exr")
    assert run("export", "s.exr", "--for", "filament", "-o", "map").code == 0
    assert "captured at (1, 1, 1)" in next(Path("map").glob("*_README.md")).read_text()


def test_the_function_makes_the_same(captured):
    made = shrm.capture("room.glb", (1, 1, 1), size=16, samples=4)
    done("probe", "capture", "room.glb", "--at", "1,1,1", "--size", 16, "--samples", 4,
         "--precision", "float", "-o", "same.exr")  # fmt: skip
    np.testing.assert_array_equal(made.image(), shrm.open_probe("same.exr").image())
    assert made.proxy == shrm.open_probe("same.exr").proxy


def test_a_place_without_light_is_told(folder):
    """A room without openings, around which is light."""
    write_gltf(folder / "dark.glb", [shapes.box([0, 0, 0], [4, 2, 3])], [("wall", 0.5, 0)])
    place = ("probe", "capture", "dark.glb", "--at", "1,1,1", "--probe", "white.exr", *SMALL)
    made = run(*place, "-o", "dark.exr")
    assert made.code == 0
    assert made.err.startswith("Warning: dark.exr: nothing lights this place, so that it is black")
    assert run(*place, "--emit", "wall=1", "-o", "lit.exr").err == ""
