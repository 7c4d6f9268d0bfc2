"""`shrm probe capture`: what the file says of its place, and what is refused."""

import json

import numpy as np
import pytest

from tests.cli.helpers import assert_refused, done, read_exr, run, write_exr
from tests.cli.test_grid import write_gltf
from tests.rooms import shapes

SMALL = ("--size", 16, "--samples", 4)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Current folder with a room whose lamp is a material, and a white sky."""
    parts = [shapes.box([0, 0, 0], [4, 2, 3]), shapes.ceiling_lamp(2, 1.5, 1.99)]
    write_gltf(tmp_path / "room.glb", parts, [("wall", 0.5, 0), ("lamp", 0, 10)])
    write_exr(tmp_path / "white.exr", np.ones((16, 32, 3), np.float32))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_probe_holds_its_place_and_the_box_of_the_room(folder):
    said = json.loads(
        done("probe", "capture", "room.glb", "--at", "1,1,1", "-o", "p.exr", *SMALL, "--json")
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
    before = (folder / "p.exr").read_bytes()
    done("probe", "capture", "room.glb", "--at", "1,1,1", "-o", "p.exr", *SMALL)
    assert (folder / "p.exr").read_bytes() == before


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
    base = ("probe", "capture", "room.glb", "-o", "p.exr", *SMALL)
    assert_refused(run(*base, "--at", "9,1,1"), 1, "--at 9,1,1", "not within the box")
    assert_refused(run(*base, "--at", "1,1,1", "--box", "0,0,0,0,2,3"), 1, "--box", "flat")
    assert_refused(run(*base, "--at", "1,1"), 2, "--at")
    assert_refused(run(*base), 2, "--at")
    assert_refused(run("probe", "capture", "none.glb", "--at", "1,1,1", "-o", "p.exr"), 1, "none")
    assert not (folder / "p.exr").exists()


def test_a_place_within_a_wall_is_told(folder):
    parts = [shapes.box([0, 0, 0], [4, 2, 3], inward=False), shapes.ceiling_lamp(2, 1.5, 1.99)]
    write_gltf(folder / "inside_out.glb", parts, [("wall", 0.5, 0), ("lamp", 0, 10)])
    said = run("probe", "capture", "inside_out.glb", "--at", "1,1,1", "-o", "p.exr", *SMALL)
    assert said.code == 0
    assert "back of surfaces" in said.err
