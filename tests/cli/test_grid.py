"""`shrm grid`: a room that is baked, and grids in other forms."""

import json
from pathlib import Path

import numpy as np
import pytest

from shrm_cli.rooms import make
from shrm_cli.rooms.grid import read_grid
from tests.cli.helpers import assert_refused, done, read_exr, run, snapshot, write_exr
from tests.rooms import shapes


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Current folder with a room whose lamp is a material, and a white sky."""
    parts = [shapes.box([0, 0, 0], [4, 2, 3]), shapes.ceiling_lamp(2, 1.5, 1.99)]
    write_gltf(tmp_path / "room.glb", parts, [("wall", 0.5, 0), ("lamp", 0, 10)])
    write_gltf(tmp_path / "dark.glb", parts[:1], [("wall", 0.5, 0)])
    write_exr(tmp_path / "white.exr", np.ones((16, 32, 3), np.float32))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def write_gltf(path, parts, materials):
    """Write pieces as a GLB, with a grey albedo and a radiance each."""
    buffer, views, accessors, primitives = b"", [], [], []
    for number, (points, faces, normals) in enumerate(parts):
        for values, kind in ((points.astype("<f4"), "VEC3"), (normals.astype("<f4"), "VEC3"),
                             (faces.astype("<u4").reshape(-1), "SCALAR")):  # fmt: skip
            views.append({"buffer": 0, "byteOffset": len(buffer), "byteLength": values.nbytes})
            accessors.append(
                {
                    "bufferView": len(views) - 1,
                    "componentType": 5125 if kind == "SCALAR" else 5126,
                    "count": len(values),
                    "type": kind,
                }
            )
            buffer += values.tobytes()
        first = len(accessors) - 3
        attributes = {"POSITION": first, "NORMAL": first + 1}
        primitives.append({"attributes": attributes, "indices": first + 2, "material": number})
    strength = "KHR_materials_emissive_strength"
    tree = {
        "asset": {"version": "2.0"},
        "buffers": [{"byteLength": len(buffer)}],
        "bufferViews": views,
        "accessors": accessors,
        "meshes": [{"primitives": primitives}],
        "nodes": [{"mesh": 0}],
        "scenes": [{"nodes": [0]}],
        "scene": 0,
        "materials": [
            {
                "name": name,
                "pbrMetallicRoughness": {"baseColorFactor": [*[grey] * 3, 1], "metallicFactor": 0},
                "emissiveFactor": [1.0 if bright else 0.0] * 3,
                "extensions": {strength: {"emissiveStrength": bright}},
            }
            for name, grey, bright in materials
        ],
    }
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    head = b"glTF" + np.array([2, 28 + len(text) + len(buffer)], "<u4").tobytes()
    chunk = np.array([len(text), 0x4E4F534A], "<u4").tobytes()
    data = np.array([len(buffer), 0x004E4942], "<u4").tobytes()
    path.write_bytes(head + chunk + text + data + buffer)


SMALL = ("--size", "4,2,3", "--samples", "64")


def test_probes_that_lie_too_far_apart_are_told(folder):
    """Light that comes through a window only was 29 % off, without a word."""
    said = done("grid", "room.glb", "--size", "2,1,1", "--samples", "64")
    assert "the sky, too, changes faster than the probes lie; --size 4,2,2 is nearer" in said
    even = done("grid", "dark.glb", "--probe", "white.exr", "--emit", "wall=1", "--albedo",
                "wall=0", "-o", "e.npz", "--size", "2,1,1", "--samples", "64")  # fmt: skip
    assert "changes faster" not in even


def test_rooms_without_lamps_have_one_error(folder):
    """Engines were said not to know the lamps, of which there are none."""
    (folder / "floor.obj").write_text("v 0 0 0\nv 0 0 4\nv 4 0 4\nv 4 0 0\nf 1 2 3 4\n")
    floor = ("grid", "floor.obj", *SMALL, "--box", "0,0,0,4,2,4", "--probe", "white.exr")
    for name in ("a.npz", "a.json"):
        said = done(*floor, "-o", name)
        assert said.count("% off") == 1
        assert "irradiance between the probes is " in said
        assert "lamps" not in said
    assert "which do not know the lamps" in done("grid", "room.glb", *SMALL, "-o", "b.json")


def test_a_room_is_baked(folder):
    said = json.loads(done("grid", "room.glb", *SMALL, "--json"))
    assert said["file"] == "room.grid.npz"
    assert said["shape"] == [4, 2, 3]
    assert said["lamps"] == 1
    assert said["error"] < said["error_coefficients"] / 3
    found = read_grid("room.grid.npz")
    assert found.lattice.low == pytest.approx([0, 0, 0])
    assert found.lattice.high == pytest.approx([4, 2, 3])
    assert found.direct[:, 0].min() > 0
    assert found.reflected[:, 0].min() > 0
    assert done("render", "room.grid.npz", "--size", 16).startswith("room.grid.png: 16 x 16")
    told = done("info", "room.grid.npz")
    assert "grid of probes" in told
    before = (folder / "room.grid.npz").read_bytes()
    done("grid", "room.glb", *SMALL)
    assert (folder / "room.grid.npz").read_bytes() == before
    assert_refused(run("grid", "room.glb", *SMALL, "--order", "1"), 1, "exists", "--force")
    done("grid", "room.glb", *SMALL, "--order", "1", "--force")
    assert read_grid("room.grid.npz").order == 1


@pytest.mark.parametrize(
    "other", [("--order", "1"), ("--emit", "lamp=3"), ("--probe", "white.exr")]
)
def test_a_grid_of_other_options_is_refused_before_the_work(folder, monkeypatch, other):
    done("grid", "room.glb", *SMALL)

    def fail(*given):
        raise AssertionError("it was baked")

    monkeypatch.setattr(make, "bake", fail)
    assert_refused(run("grid", "room.glb", *SMALL, *other), 1, "exists", "--force")


def test_a_grid_that_is_cut_off_is_made_again(folder):
    done("grid", "room.glb", *SMALL)
    whole = Path("room.grid.npz").read_bytes()
    for part in (whole[:300], b""):
        Path("room.grid.npz").write_bytes(part)
        done("grid", "room.glb", *SMALL)
        assert Path("room.grid.npz").read_bytes() == whole
    Path("room.grid.npz").write_bytes(whole[:300])  # of other options, which is known at the end
    assert_refused(run("grid", "room.glb", *SMALL, "--order", "1"), 1, "exists", "--force")
    Path("room.grid.npz").write_text("mine")
    assert_refused(run("grid", "room.glb", *SMALL), 1, "exists", "--force")


def test_materials_are_changed_by_their_names(folder):
    done("grid", "room.glb", *SMALL, "-o", "a.npz")
    done("grid", "room.glb", *SMALL, "--albedo", "wall=0", "-o", "b.npz")
    done("grid", "room.glb", *SMALL, "--emit", "lamp=20,10,0", "-o", "c.npz")
    a, b, c = (read_grid(f"{name}.npz") for name in "abc")
    assert not b.reflected.any()
    np.testing.assert_allclose(b.direct, a.direct)
    np.testing.assert_allclose(c.direct, a.direct * [2, 1, 0], rtol=1e-5, atol=1e-6)


def test_light_from_outside(folder):
    """A closed room has none of it, and a box beside the room has all."""
    said = run("grid", "dark.glb", *SMALL, "--probe", "white.exr", "-o", "in.npz")
    assert said.code == 0
    assert not read_grid("in.npz").coefficients.any()
    box = ("--box", "10,0,0,11,1,1")
    done("grid", "dark.glb", *SMALL, *box, "--probe", "white.exr", "-o", "out.npz")
    light = read_grid("out.npz").reflected[:, 0]
    np.testing.assert_allclose(light, np.sqrt(4 * np.pi), rtol=0.02)


@pytest.mark.parametrize("name", ["a.json", "a.ktx2", "a.exr"])
def test_other_forms(folder, name):
    done("grid", "room.glb", *SMALL, "-o", f"direct_{name}")
    done("grid", "room.glb", *SMALL)
    done("grid", "room.grid.npz", "-o", name)
    assert (folder / name).read_bytes() == (folder / f"direct_{name}").read_bytes()
    done("grid", "room.grid.npz", "--light", "reflected", "-o", f"dim_{name}")
    assert (folder / name).read_bytes() != (folder / f"dim_{name}").read_bytes()


def test_a_table_of_probes(folder):
    rows = [f"{x},0,0,white.exr" for x in range(3)]
    (folder / "t.csv").write_text("\n".join(["x,y,z,file", *rows]) + "\n")
    said = json.loads(done("grid", "t.csv", "--json"))
    assert said["shape"] == [3, 1, 1]
    assert said["walls"] is False
    np.testing.assert_allclose(
        read_grid("t.grid.npz").reflected[:, 0], np.sqrt(4 * np.pi), rtol=1e-3
    )


@pytest.mark.parametrize("file", ["../white.exr", "/etc/passwd", "C:white.exr"])
def test_a_table_leads_to_no_file_elsewhere(folder, file):
    (folder / "below").mkdir()
    (folder / "below" / "t.csv").write_text(f"x,y,z,file\n0,0,0,{file}\n")
    assert_refused(run("grid", "below/t.csv"), 1, "t.csv: line 2: ", "leaves the table's folder")


def test_links_of_a_table_lead_to_no_file_elsewhere(folder):
    (folder / "below").mkdir()
    (folder / "below" / "link.exr").symlink_to(folder / "white.exr")
    (folder / "below" / "t.csv").write_text("x,y,z,file\n0,0,0,link.exr\n")
    assert_refused(run("grid", "below/t.csv"), 1, "t.csv: line 2: ", "leaves the table's folder")


def test_a_box_behind_surfaces_is_said(folder):
    points, faces, normals = shapes.box([0, 0, 0], [4, 2, 3], inward=False)
    write_gltf(folder / "out.glb", [(points, faces, normals)], [("wall", 0.5, 1)])
    said = run("grid", "out.glb", *SMALL)
    assert said.code == 0
    assert "turn them round" in said.err


def test_a_box_that_no_light_reaches_is_said(folder):
    said = run("grid", "room.glb", "--box", "90,90,90,91,91,91", *SMALL)
    assert said.code == 0
    assert "no light reaches the probes; give --box within the room" in said.err


@pytest.mark.parametrize(
    ("arguments", "code", "parts"),
    [
        (("dark.glb",), 1, ["nothing in it sends light", "--emit", "--probe"]),
        (("room.glb", "--emit", "sun=1"), 1, ["no material 'sun'", "lamp, wall"]),
        (("room.glb", "--albedo", "wall=2"), 1, ["--albedo"]),
        (("room.glb", "--emit", "lamp"), 2, ["NAME=R,G,B"]),
        (("room.glb", "--box", "0,0,0,1,0,1"), 2, ["--box", "flat"]),
        (("flat.obj", "--probe", "white.exr"), 2, ["--box must be given, for the room is flat"]),
        (("room.glb", "--size", "9999,9999,9999"), 2, ["--size", "are the most"]),
        (("room.glb", "-o", "a.txt"), 1, ["a.txt", ".npz"]),
        (("room.glb", "--light", "reflected"), 2, ["--light"]),
        (("none.glb",), 1, ["none.glb", "no such file"]),
        (("none.csv",), 1, ["none.csv"]),
    ],
)
def test_what_is_refused(folder, arguments, code, parts):
    (folder / "flat.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 0 1\nf 1 3 2\n")
    before = snapshot(folder)
    small = SMALL if "--size" not in arguments and not arguments[0].endswith("csv") else ()
    assert_refused(run("grid", *arguments, *small), code, *parts)
    assert snapshot(folder) == before


def test_a_mesh_stands_in_the_light_of_a_grid(folder):
    """It is brighter below the lamp than beside it, as white and as product texture."""
    done("grid", "room.glb", *SMALL)
    for name, x in (("below", 2.0), ("beside", 0.4)):
        corners = [(x - 0.2, 0.5, 1.3), (x - 0.2, 0.5, 1.7), (x + 0.2, 0.5, 1.7)]
        lines = [f"v {a} {b} {c}" for a, b, c in corners]
        (folder / f"{name}.obj").write_text("\n".join([*lines, "f 1 2 3"]))
    done("product", "lambertian", "--order", "8", "--size", "8", "-o", "p.exr")
    means = {}
    for name in ("below", "beside"):
        for kind, arguments in (
            ("white", ("room.grid.npz",)), ("product", ("p.exr", "--probe", "room.grid.npz")),
        ):  # fmt: skip
            target = f"{kind}.{name}.exr"
            view = ("--view", "0,90", "--size", "32x32", "-o", target)
            assert "outside" not in done("render", *arguments, "--mesh", f"{name}.obj", *view)
            means[kind, name] = read_exr(target)[1]["G"].max()
    assert means["white", "below"] > 2 * means["white", "beside"]
    for name in ("below", "beside"):
        assert means["product", name] == pytest.approx(means["white", name], rel=0.01)
    done("render", "room.grid.npz", "--place", "0.5,0.5,0.5", "--size", "32", "-o", "ball.png")
    refused = [
        (("room.grid.npz", "--turn-light", "y:30"), 1, "the light of a grid of probes stays"),
        (("p.exr", "--probe", "room.grid.npz", "--yaw", "5"), 2, "--yaw"),
        (("p.exr", "--probe", "room.glb"), 1, "room.glb"),
    ]
    for arguments, code, part in refused:
        before = snapshot(folder)
        assert_refused(run("render", *arguments, "--size", "32"), code, part)
        assert snapshot(folder) == before


def test_what_shadows_itself_stands_in_the_light_of_a_grid(folder):
    """A single triangle has no shadow of its own: it looks as without its transfer."""
    done("grid", "room.glb", *SMALL)
    lines = ["v 1.95 0.5 1.45", "v 1.95 0.5 1.55", "v 2.05 0.5 1.55", "f 1 2 3"]
    (folder / "leaf.obj").write_text("\n".join(lines))
    run("transfer", "leaf.obj", "--matrices", "--albedo", "1", "--order", "8", "-o", "t.npz")
    done("product", "ggx:roughness=0.6", "--order", "4", "--size", "16", "-o", "p.exr")
    # From afar: between the corners, what they reflect towards their own views is interpolated.
    look = ("--view", "0,60", "--fov", "5", "--size", "32x32", "--exposure", "0")
    view = ("--mesh", "leaf.obj", *look)
    for given in (["room.grid.npz"], ["p.exr", "--probe", "room.grid.npz"]):
        means = []
        for baked in ([], ["--transfer", "t.npz"]):
            assert run("render", *given, *baked, *view, "-o", "x.exr").code == 0
            means.append(read_exr("x.exr")[1]["G"].max())
        assert means[1] == pytest.approx(means[0], rel=0.01)
    alone = run("render", "--probe", "room.grid.npz", "--transfer", "t.npz", *view, "-o", "y.exr")
    assert (alone.code, alone.err) == (0, "")
    turned = run("render", "room.grid.npz", "--transfer", "t.npz", *view, "--turn-light", "y:20")
    assert_refused(turned, 1, "the light of a grid of probes stays")


@pytest.mark.parametrize(
    "line", [("grid", *SMALL), ("probe", "capture", "--at", "2,1,1.5", "--size", "8")]
)
def test_what_is_changed_of_the_light_past_a_room_is_told(folder, line):
    pixels = np.ones((16, 32, 3), np.float32)
    pixels[4, 5] = -3
    write_exr(folder / "sky.exr", pixels)
    cut = len(line) - len(SMALL) if line[0] == "grid" else 2
    result = run(*line[:cut], "room.glb", *line[cut:], "--probe", "sky.exr", "-o", "x.exr")
    assert result.code == 0
    assert "sky.exr: 1 pixel with negative radiance was clamped to 0 (minimum -3)" in result.err
