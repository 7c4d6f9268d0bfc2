"""`shrm transfer`, and meshes that are rendered with what it bakes."""

import json

import numpy as np
import OpenImageIO as oiio
import pytest

from shrm_cli.transfer import bake
from shrm_cli.transfer.file import read_transfer
from tests.cli.helpers import assert_refused, done, run, snapshot, write_exr
from tests.transfer import meshes


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Current folder with a mesh in which there are valleys, and white light from everywhere."""
    mesh = meshes.bumps(10)
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in mesh.vertices]
    lines += [f"f {a} {b} {c}" for a, b, c in mesh.faces + 1]
    (tmp_path / "bumps.obj").write_text("\n".join(lines) + "\n")
    write_exr(tmp_path / "white.exr", np.ones((16, 32, 3), np.float32))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def pixels(path):
    return oiio.ImageBuf(str(path)).get_pixels(oiio.FLOAT)[..., :3]


def test_it_says_what_it_wrote(folder):
    said = json.loads(done("transfer", "bumps.obj", "--samples", "32", "--json"))
    assert said["file"] == "bumps.transfer.npz"
    assert (said["vertices"], said["order"], said["channels"]) == (100, 6, 1)
    assert said["mesh"] == "bumps.obj"
    assert said["bytes"] == (folder / "bumps.transfer.npz").stat().st_size
    held = done("info", "bumps.transfer.npz")
    assert "precomputed transfer" in held
    assert "bumps.obj" in held
    assert sorted(snapshot(folder)) == ["bumps.obj", "bumps.transfer.npz", "white.exr"]


def test_the_same_run_gives_the_same_bytes(folder):
    options = ("--samples", "32", "--bounces", "1", "--albedo", "0.9,0.5,0.1", "--matrices")
    done("transfer", "bumps.obj", *options, "-o", "a.npz", "--threads", "1")
    (folder / "deeper").mkdir()
    (folder / "deeper" / "bumps.obj").write_bytes((folder / "bumps.obj").read_bytes())
    done("transfer", "deeper/bumps.obj", *options, "-o", "b.npz", "--threads", "3")
    assert (folder / "a.npz").read_bytes() == (folder / "b.npz").read_bytes()
    assert read_transfer("a.npz").vectors.shape == (100, 25, 3)


def test_a_file_of_the_default_name_is_kept(folder):
    done("transfer", "bumps.obj", "--samples", "32")
    done("transfer", "bumps.obj", "--samples", "32")
    assert_refused(run("transfer", "bumps.obj", "--samples", "16"), 1, "exists", "--force")
    done("transfer", "bumps.obj", "--samples", "16", "--force")
    assert not (folder / "bumps.transfer.npz.part").exists()
    whole = (folder / "bumps.transfer.npz").read_bytes()
    (folder / "bumps.transfer.npz").write_bytes(whole[:300])  # as a full disk leaves it
    done("transfer", "bumps.obj", "--samples", "16")
    assert (folder / "bumps.transfer.npz").read_bytes() == whole


@pytest.mark.parametrize(
    ("kept", "asked"),
    [
        ((), ("--samples", "16")),
        ((), ("--order", "2")),
        ((), ("--matrices",)),
        ((), ("--albedo", "0.9")),
        (("--albedo", "0.9,0.5,0.1"), ("--albedo", "0.9,0.5,0.2")),
        (("--matrices",), ("--matrices", "--brush", "1,0,0")),
        ((), ("--texture", "24")),
        (("--texture", "64"), ("--texture", "24")),
        (None, ()),
    ],
)
def test_another_file_of_the_default_name_is_kept_before_the_work(folder, monkeypatch, kept, asked):
    if kept is None:
        (folder / "bumps.transfer.npz").write_text("mine")
    else:
        done("transfer", "bumps.obj", "--samples", "32", *kept)

    def fail(*given, **named):
        raise AssertionError("it was baked")

    monkeypatch.setattr(bake, "bake", fail)
    line = ("transfer", "bumps.obj", "--samples", "32", *asked)
    assert_refused(run(*line), 1, "exists", "--force")


@pytest.mark.parametrize(
    "options",
    [("--albedo", "0.9,0.5,0.1"), ("--matrices", "--brush", "1,0,0"), ("--texture", "24")],
)
def test_the_same_file_of_the_default_name_is_made_again(folder, options):
    for _ in range(2):
        done("transfer", "bumps.obj", "--samples", "32", *options)


def test_faces_of_another_mesh_are_kept(folder):
    """Their name is PIFu's, whatever the output is called."""
    line = ("transfer", "bumps.obj", "--samples", "16", "--order", "2", "-o", "a.txt")
    (folder / "face.npy").write_text("mine")
    assert_refused(run(*line), 1, "face.npy", "exists", "--force")
    assert (folder / "face.npy").read_text() == "mine"
    assert not (folder / "a.txt").exists()
    done(*line, "--force")
    assert (folder / "face.npy").read_bytes() != b"mine"
    done(*line[:-1], "b.txt")


@pytest.mark.parametrize("name", ["a.glb", "a.ply", "bounce0.txt"])
def test_other_formats(folder, name):
    done("transfer", "bumps.obj", "--samples", "16", "--order", "2", "-o", name)
    assert (folder / name).stat().st_size > 1000
    assert (folder / "face.npy").exists() == (name == "bounce0.txt")
    told = json.loads(done("info", name, "--json"))
    assert "precomputed transfer" in told["kind"]
    assert told["vertices"] == json.loads(done("info", "bumps.obj", "--json"))["vertices"]


def test_light_beside_triangles_of_pifu_is_no_transfer(folder):
    done("transfer", "bumps.obj", "--samples", "16", "--order", "2", "-o", "bounce0.txt")
    np.savetxt(folder / "light.txt", np.ones((9, 3)), fmt="%.8f")
    kind = json.loads(done("info", "light.txt", "--json", "--no-stats"))["kind"]
    assert kind == "coefficients of light"


@pytest.mark.parametrize(
    ("arguments", "code", "parts"),
    [
        (("--order", "17"), 2, ["--order"]),
        (("--order", "9", "--matrices"), 2, ["--order"]),
        (("--bounces", "3"), 2, ["--bounces"]),
        (("--albedo", "1.1"), 2, ["--albedo"]),
        (("--albedo", "nan"), 2, ["--albedo"]),
        (("--albedo", "vertex"), 2, ["--albedo", "no vertex colours"]),
        (("--brush", "1,0,0"), 2, ["--brush", "with --matrices"]),
        (("--brush", "uv", "--matrices"), 2, ["--brush", "no texture coordinates"]),
        (("--brdf", "ggx"), 2, ["--brdf", "with --bounces"]),
        (("--brdf", "ggx", "--bounces", "1", "--albedo", "0.3"), 2, ["--albedo", "without --brdf"]),
        (("-o", "a.exr"), 1, ["a.exr", ".npz"]),
        (("-o", "a.ply", "--matrices"), 1, ["a.ply", ".npz only"]),
        (("-o", "bounce0.txt", "--order", "1"), 1, ["order 2"]),
        (("-o", "none/a.npz"), 1, ["there is no folder"]),
    ],
)
def test_what_is_refused(folder, arguments, code, parts):
    assert_refused(run("transfer", "bumps.obj", "--samples", "4", *arguments), code, *parts)


def test_the_mesh_is_not_overwritten(folder):
    done("transfer", "bumps.obj", "--samples", "4", "-o", "a.ply")
    assert_refused(run("transfer", "a.ply", "--samples", "4", "-o", "a.ply"), 1, "the input")


def test_rendered_meshes_have_shadows(folder):
    """In white light a free diffuse surface is its albedo, and valleys are darker."""
    light = ("--to", "irradiance", "--order-f", "4", "-o", "white.irradiance.exr")
    done("prefilter", "white.exr", *light)
    done("product", "lambertian:albedo=0.8", "-o", "paint.exr", "--size", "16")
    options = ("--samples", "128", "--albedo", "0.8")
    done("transfer", "bumps.obj", *options, "-o", "direct.npz", "--matrices")
    bounced = ("--order", "4", "--bounces", "2", "-o", "bounced.npz")
    done("transfer", "bumps.obj", *options, *bounced)
    camera = ("--mesh", "bumps.obj", "--view", "0,0", "--size", "48")
    done("render", "white.irradiance.exr", *camera, "-o", "free.exr")
    free = pixels("free.exr")
    seen = free[..., 0] > 0.9
    shaded = {}
    for name in ("direct", "bounced"):
        given = (*camera, "--transfer", f"{name}.npz", "-o", f"{name}.exr")
        done("render", "white.irradiance.exr", *given)
        shaded[name] = pixels(f"{name}.exr")[seen].mean(axis=1)
    assert shaded["direct"].max() <= 0.81
    assert shaded["direct"].min() < 0.6
    assert (shaded["bounced"] >= shaded["direct"] - 1e-3).all()
    assert shaded["bounced"].mean() > 1.03 * shaded["direct"].mean()
    glossy = ("--probe", "white.exr", "--transfer", "direct.npz", "-o", "glossy.exr")
    done("render", "paint.exr", *camera, *glossy)
    np.testing.assert_allclose(pixels("glossy.exr")[seen].mean(axis=1), shaded["direct"], atol=0.03)


def test_a_probe_in_place_of_a_map_has_lamps_with_shadows(folder):
    """A lamp that valleys see in part only, beside light that has no lamp."""
    image = np.full((32, 64, 3), 0.1, np.float32)
    image[10:12, 16:19] = 300
    write_exr(folder / "lamp.exr", image)
    options = ("--samples", "64", "--order", "4", "--albedo", "0.8")
    done("transfer", "bumps.obj", *options, "-o", "t.npz")
    done("transfer", "bumps.obj", "--samples", "64", "--bounces", "1", "-o", "b.npz")
    done("transfer", "bumps.obj", "--samples", "8", "--bounces", "1", "--matrices", "-o", "m.npz")
    done("product", "ggx:roughness=0.5", "-o", "paint.exr", "--size", "8")
    camera = ("--mesh", "bumps.obj", "--view", "0,0", "--size", "48")
    said = run("render", "--probe", "white.exr", *camera, "--transfer", "t.npz", "-o", "w.exr")
    assert "Warning" not in said.err
    assert pixels("w.exr").max() == pytest.approx(0.8, abs=0.02)
    done("render", "--probe", "lamp.exr", *camera, "--transfer", "t.npz", "-o", "apart.exr")
    done("prefilter", "lamp.exr", "--to", "irradiance", "-o", "lamp.irradiance.exr")
    flat = ("lamp.irradiance.exr", *camera, "--transfer", "t.npz", "-o", "flat.exr")
    said = run("render", *flat)
    assert "lamp.irradiance.exr: has light of order 2 for a transfer of order 4" in said.err
    assert "--probe" in said.err
    lit, blurred = (pixels(name)[20:28, 10:38].mean(axis=2) for name in ("apart.exr", "flat.exr"))
    assert lit.std() / lit.mean() > 1.2 * blurred.std() / blurred.mean()
    done("render", "--probe", "lamp.exr", *camera, "--transfer", "b.npz")
    assert (folder / "lamp.bumps.png").exists()
    said = run("render", "paint.exr", "--probe", "lamp.exr", *camera, "--transfer", "m.npz")
    assert "bake it with 0 bounces" in said.err


def test_renders_that_are_refused(folder):
    done("prefilter", "white.exr", "--to", "irradiance", "-o", "white.irradiance.exr")
    done("product", "lambertian", "-o", "paint.exr", "--size", "8")
    done("prefilter", "white.exr", "--to", "splitsum", "--size", "8", "-o", "split.exr")
    done("transfer", "bumps.obj", "--samples", "4", "-o", "t.npz")
    (folder / "scene.toml").write_text('[[objects]]\nmesh = "bumps.obj"\n')
    text = (folder / "bumps.obj").read_text()
    (folder / "other.obj").write_text(text.replace("v -1 -1", "v -2 -1", 1))
    diffuse, glossy = ("white.irradiance.exr",), ("paint.exr", "--probe", "white.exr")
    for arguments, code, *parts in (
        ((*diffuse, "--transfer", "t.npz"), 2, "with --mesh"),
        ((*diffuse, "--mesh", "scene.toml", "--transfer", "t.npz"), 2, "not to a scene; name"),
        ((*diffuse, "--mesh", "none.toml", "--transfer", "none.npz"), 2, "not to a scene; name"),
        ((*diffuse, "--mesh", "other.obj", "--transfer", "t.npz"), 1, "other.obj: not the mesh"),
        ((*glossy, "--mesh", "bumps.obj", "--transfer", "t.npz"), 1, "--matrices"),
        (("split.exr", "--mesh", "bumps.obj", "--transfer", "t.npz"), 1, "splitsum"),
        (
            (*diffuse, "--mesh", "bumps.obj", "--transfer", "t.npz", "--brush", "1,0,0"),
            2,
            "without --transfer",
        ),
        ((*diffuse, "--mesh", "bumps.obj", "--transfer", "none.npz"), 1, "none.npz: no such file"),
        (
            (*diffuse, "--mesh", "bumps.obj", "--transfer", "bumps.obj"),
            1,
            "bumps.obj: no transfer file (those for engines are not read); name the .npz that "
            "shrm transfer MESH -o x.npz writes",
        ),
        ((*diffuse, "--mesh", "bumps.obj", "--transfer", "white.exr"), 1, "no transfer file"),
        (("--mesh", "bumps.obj", "--transfer", "t.npz"), 2, "MAP", "--probe"),
        (
            (*diffuse, "--probe", "white.exr", "--mesh", "bumps.obj", "--transfer", "t.npz"),
            2,
            "product textures that hold no light",
        ),
    ):
        assert_refused(run("render", *arguments, "--size", "16", "-o", "a.png"), code, *parts)


def test_a_parameter_that_varies_is_in_the_middle_of_its_range(folder):
    """As it is without a transfer, of which a convex mesh needs none."""
    done("transfer", "bumps.obj", "--samples", "32", "--matrices", "-o", "t.npz")
    done("product", "ward:ax=0.5", "--vary", "ay=0.2..0.4", "--steps", "3", "--size", "8",
         "-o", "v.exr")  # fmt: skip
    done("product", "ward:ax=0.5,ay=0.3", "--size", "8", "-o", "one.exr")
    for name in ("v", "one"):
        done("render", f"{name}.exr", "--probe", "white.exr", "--mesh", "bumps.obj",
             "--transfer", "t.npz", "--size", "32", "-o", f"{name}.png")  # fmt: skip
    np.testing.assert_allclose(pixels("v.png"), pixels("one.png"), atol=1 / 255)
    assert pixels("v.png").max() > 0.2


def test_lamps_turn_with_their_light(folder):
    """The lamp, its shadows and what bounces, as of a probe that is read turned."""
    image = np.full((32, 64, 3), 0.1, np.float32)
    image[10:12, 16:19] = 300
    write_exr(folder / "lamp.exr", image)
    done("transfer", "bumps.obj", "--samples", "64", "--bounces", "1", "-o", "t.npz")
    camera = ("--mesh", "bumps.obj", "--view", "0,0", "--size", "32", "--transfer", "t.npz")
    done("render", "--probe", "lamp.exr", *camera, "--turn-light", "y:45", "-o", "a.exr")
    done("render", "--probe", "lamp.exr", "--yaw", "45", *camera, "-o", "b.exr")
    done("render", "--probe", "lamp.exr", *camera, "-o", "c.exr")
    turned, read, still = (pixels(name) for name in ("a.exr", "b.exr", "c.exr"))
    assert np.abs(turned - read).mean() < 0.02 * read.mean()
    assert np.abs(turned - still).mean() > 0.1 * read.mean()


def test_glossy_bounces_are_those_of_a_brdf(folder):
    said = json.loads(done(
        "transfer", "bumps.obj", "--bounces", "1", "--brdf", "ggx:roughness=0.6,f0=gold",
        "--samples", "32", "--order", "2", "-o", "gold.npz", "--json",
    ))  # fmt: skip
    assert (said["matrices"], said["channels"]) == (True, 3)
    assert said["brdf"].startswith("ggx:")
    held = read_transfer("gold.npz")
    assert held.facts.brdf == said["brdf"]
    assert held.matrices is not None


def test_bounces_of_another_brdf_are_told(folder):
    baked = ("--samples", "16", "--order", "2", "-o", "gold.npz", "--quiet")
    spec = "ggx:roughness=0.6,f0=gold"
    done("transfer", "bumps.obj", "--bounces", "1", "--brdf", spec, *baked)
    for name, each in ("own", spec), ("other", "ggx:roughness=0.6"):
        done("product", each, "--order", "2", "--size", "8", "-o", f"{name}.exr", "--quiet")
    view = ("--mesh", "bumps.obj", "--transfer", "gold.npz", "--probe", "white.exr", "--size", "16")
    said = {
        name: run("render", *name, *view, "-o", "a.png").err
        for name in (("own.exr",), ("other.exr",), ())
    }
    told = {
        name: "what the mesh reflects onto itself is of ggx" in each for name, each in said.items()
    }
    assert told == {("own.exr",): False, ("other.exr",): True, (): True}


def test_missing_files_of_materials_are_told(folder):
    text = (folder / "bumps.obj").read_text()
    (folder / "lost.obj").write_text(f"mtllib gone.mtl\nusemtl wall\n{text}")
    result = run("transfer", "lost.obj", "--samples", "16", "--bounces", "1", "-o", "a.npz")
    assert "by the material 'wall', whose file 'gone.mtl' is missing" in result.err
    done("transfer", "lost.obj", "--samples", "16", "--albedo", "0.3", "-o", "b.npz")


def test_the_albedo_that_was_baked_is_told(folder):
    """Nothing said whether it was the mesh's own, or which."""
    (folder / "q.mtl").write_text("newmtl a\nKd .5 .25 .1\n")
    (folder / "q.obj").write_text("mtllib q.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\n")
    few = ("transfer", "q.obj", "--samples", "16")
    assert "  albedo         0.5, 0.25, 0.1 on average\n" in done(*few)
    assert "  albedo        0.5, 0.25, 0.1\n" in done("info", "q.transfer.npz")
    assert json.loads(done(*few, "--albedo", "0.3", "-o", "b.npz", "--json"))["albedo"] == [0.3]
    assert "albedo" not in done(*few, "--order", "2", "-o", "bounce0.txt")


def test_a_lamp_alone_is_no_black_probe(folder):
    """What is left of a light without its lamps may be black, which is not the light's fault."""
    (folder / "sun.toml").write_text(
        "[[disc]]\nazimuth = 20\nelevation = 60\nradius = 0.3\nradiance = 9e4\n"
    )
    done("transfer", "bumps.obj", "--samples", "16", "-o", "t.npz")
    options = ("--mesh", "bumps.obj", "--transfer", "t.npz", "--size", "32", "-o", "lit.png")
    said = run("render", "--probe", "sun.toml", *options)
    assert (said.code, said.err) == (0, "")
    (folder / "black.toml").write_text("[[sh]]\ncoefficients = [0]\n")
    assert "the probe is black" in run("render", "--probe", "black.toml", *options).err


@pytest.mark.parametrize("suffix", ["glb", "ply"])
def test_info_tells_what_is_baked_into_a_mesh(folder, suffix):
    done("transfer", "bumps.obj", "--samples", "16", "--order", "3", "-o", f"a b.{suffix}")
    baked = json.loads(done("info", f"a b.{suffix}", "--json"))
    plain = json.loads(done("info", "bumps.obj", "--json"))
    assert (baked["kind"], plain["kind"]) == ("mesh with precomputed transfer", "mesh")
    assert (baked["transfer"]["order"], baked["transfer"]["bounces"]) == (3, 0)
    assert "transfer" not in plain
    assert baked["triangles"] == plain["triangles"]
    np.testing.assert_allclose(baked["high"], plain["high"])
    see = f"shrm render MAP --mesh 'a b.{suffix}'"
    assert baked["see"] == f"shrm transfer 'a b.{suffix}' -o x.npz, then {see} --transfer x.npz"
    assert plain["see"] == "shrm render MAP --mesh bumps.obj"
    assert_refused(run("info", "bumps.obj", "--yaw", "5"), 2, "to probes; FILE is a mesh")
