"""`shrm product`, and what other commands do with its textures."""

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from shrm_cli.maps.file import open_map
from shrm_cli.probe.lighting import project
from shrm_cli.probe.open import open_probe
from shrm_cli.render.camera import Viewer
from shrm_cli.render.sphere import render_sphere
from tests.cli.helpers import MESH, assert_refused, done, read_exr, run, write_exr

BRUSHED = "ward:ax=0.5,ay=0.2"
SMALL = ("--size", "8", "--order", "2")


@pytest.fixture
def probe(tmp_path):
    image = np.random.default_rng(1).uniform(0, 1, (16, 32, 3)).astype(np.float32)
    image[4, 9] = 60, 50, 40
    return write_exr(tmp_path / "probe.exr", image)


@pytest.fixture
def texture(tmp_path):
    path = tmp_path / "brushed.exr"
    done("product", BRUSHED, *SMALL, "-o", path)
    return path


def test_a_texture_of_a_brushed_metal(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = json.loads(done("product", BRUSHED, *SMALL, "--json"))
    assert result["file"].endswith(".product.exr")
    assert (result["order"], result["size"], result["channels"]) == (2, 8, 1)
    assert result["lit"] is False
    assert 0 < result["residual"] <= 1e-4
    header, planes = read_exr(tmp_path / result["file"])
    assert header["shrm:representation"] == "product"
    assert sorted(planes) == [f"sh{k:03d}" for k in range(9)]
    text = done("product", BRUSHED, *SMALL)
    assert "9 coefficients, grey" in text


def test_another_texture_of_that_name_is_kept(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done("product", BRUSHED, *SMALL)
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    assert_refused(run("product", BRUSHED, "--size", "9"), 1, "it has order 2 and 8 texels")
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before
    done("product", BRUSHED, "--size", "9", "--order", "1", "--force")


def test_objects_of_a_scene_cannot_have_a_texture_without_light(tmp_path, texture, monkeypatch):
    """It was said that --probe is missing, which was then said to apply to MAP alone."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    (tmp_path / "paint.exr").write_bytes(Path(texture).read_bytes())
    (tmp_path / "s.toml").write_text('[[objects]]\nmesh = "a.obj"\nmap = "paint.exr"\n')
    result = run("render", "--mesh", "s.toml", "-o", "x.png")
    assert_refused(result, 1, "object 1: paint.exr holds no light", "name it before the scene")


@pytest.mark.slow
def test_pictures_need_the_light_of_a_probe(tmp_path, texture, probe):
    picture = tmp_path / "x.exr"
    assert_refused(run("render", texture, "-o", picture), 1, "holds no light", "--probe")
    assert not picture.exists()
    done("render", texture, "--probe", probe, "--size", "32", "-o", picture)
    _, planes = read_exr(picture)
    assert planes["G"][16, 16] > 0
    done("render", texture, "--probe", probe, "--window", "auto", "--size", "32", "-o", picture)
    assert min(plane.min() for plane in read_exr(picture)[1].values()) > -1e-4
    for name in ("boxcar", "hann:-1"):
        result = run("render", texture, "--probe", probe, "--window", name, "-o", picture)
        assert_refused(result, 2, "window")
    lit = tmp_path / "lit.exr"
    done("prefilter", probe, "--brdf", BRUSHED, "--to", "product", "--order", "2", "--texels", "8",
         "-o", lit)  # fmt: skip
    done("render", lit, "--size", "32", "-o", tmp_path / "y.exr")
    _, again = read_exr(tmp_path / "y.exr")
    np.testing.assert_allclose(again["G"], planes["G"], rtol=2e-3, atol=1e-4)
    assert_refused(run("render", lit, "--probe", probe, "-o", picture), 2, "no MAP is one")


@pytest.mark.parametrize("subject", [(), ("--mesh", "pyramid.obj")], ids=["sphere", "mesh"])
def test_no_light_in_a_picture_is_negative(tmp_path, monkeypatch, subject):
    """Few harmonics of a lamp are less than nothing beside it: there a linear picture is black."""
    monkeypatch.chdir(tmp_path)
    Path("pyramid.obj").write_text(MESH)
    image = np.full((16, 32, 3), 0.05, np.float32)
    image[4, 9] = 600, 500, 40
    texture = tmp_path / "gold.exr"
    done("product", "ggx:roughness=0.4,f0=gold", "--size", "8", "--order", "3", "-o", texture)
    lamp, picture = write_exr(tmp_path / "lamp.exr", image), tmp_path / "x.exr"
    shared = "--probe", lamp, "--window", "none", "--size", "48", "--precision", "float"
    assert run("render", texture, *shared, *subject, "-o", picture).code == 0
    windowed = run("render", texture, "--probe", lamp, *subject, "-o", "windowed.exr")
    share = re.search(r"without it \(--window none\) ([\d.]+)% would lack a color", windowed.err)
    assert float(share[1]) > 1
    _, planes = read_exr(picture)
    assert all(planes[c].min() == 0 for c in "RGB")
    assert (planes["R"] > 1).any()
    if not subject:
        lit = open_map(texture).lit(project(open_probe(lamp), 3))
        truth = render_sphere(lit, Viewer(), 48)
        assert truth.min() < -1
        expected = np.maximum(truth, 0)
        np.testing.assert_allclose(planes["R"], expected[..., 0], atol=1e-4 * expected.max())


def test_what_is_black_at_an_end_of_what_varies_is_told(tmp_path):
    """The middle is soft enough to show nothing negative; 4.5 % were black without a word."""
    image = np.full((16, 32, 3), 0.05, np.float32)
    image[4, 9] = 600, 500, 40
    lamp, texture = write_exr(tmp_path / "lamp.exr", image), tmp_path / "worn.exr"
    few = "--steps", 2, "--size", 8
    made = run("product", "ward:ay=0.1", "--vary", "ax=0.1..0.9", *few, "-o", texture)
    assert made.code == 0  # with a warning of its few steps, which are enough here
    said = run("view", texture, "--probe", lamp, "-o", tmp_path / "x.html")  # which shows all
    assert said.code == 0
    assert "worn.exr: with ax=0.1, " in said.err
    assert "of what is visible is black" in said.err
    shown = "render", texture, "--probe", lamp, "--size", "16", "-o", tmp_path / "x.exr"
    for value, is_told in (("ax=0.9", False), ("ax=0.1", True), (None, False)):
        said = run(*shown, *(() if value is None else ("--vary", value)))  # no other is shown
        assert said.code == 0
        assert ("of what is visible is black" in said.err) == is_told


def test_the_error_that_is_told_is_that_of_the_value_that_is_drawn(tmp_path):
    """The sharpest end of a range was told of whatever was drawn, 86 % for 57 %."""
    image = np.full((32, 64, 3), 0.002, np.float32)
    image[8:11, 10:14] = 20
    dark, wide = write_exr(tmp_path / "dark.exr", image), tmp_path / "wide.exr"
    few, order = ("--steps", "5", "--size", "16"), ("--order", "4")
    made = run("product", "phong", "--vary", "exponent=4..100", *order, *few, "-o", wide)
    assert made.code == 0

    def told(texture, *options):
        said = run("render", texture, "--probe", dark, "--size", "16", "--window", "none",
                   "-o", tmp_path / "x.exr", *options)  # fmt: skip
        assert said.code == 0
        found = re.search(r"\.exr: (.*)the reflected light is wrong by ([\d.]+)%", said.err)
        return ("", 0.0) if found is None else (found[1], float(found[2]))

    for value in (28, 52, 100):
        alone = tmp_path / f"{value}.exr"
        assert run("product", f"phong:exponent={value}", *order, *few[2:], "-o", alone).code == 0
        where, error = told(wide, "--vary", f"exponent={value}")
        assert where == f"with exponent={value}, "
        assert error == pytest.approx(told(alone)[1], abs=1.5)
    middle = told(wide)
    assert middle == ("", told(wide, "--vary", "exponent=52")[1])
    moving = run("view", wide, "--probe", dark, "-o", tmp_path / "x.html").err
    assert f"with exponent=100, the reflected light is wrong by {error:.1f}%" in moving


def test_the_truth_of_a_texture(tmp_path, texture, probe):
    """Light of order 2 is all that this probe has, so that the texture shows the truth."""
    image = np.zeros((16, 32, 3), np.float32)
    y = np.cos(np.pi * (np.arange(16) + 0.5) / 16)
    image[:] = (1 + y + y**2)[:, None, None]
    smooth = write_exr(tmp_path / "smooth.exr", image)
    out = done("compare", texture, "--probe", smooth, "--size", "32", "--no-flip", "--no-picture",
               "--json")  # fmt: skip
    summary = json.loads(out)["summary"][0]
    assert summary["relative_rmse"] < 0.02


def test_info_tells_what_a_texture_is(texture):
    values = json.loads(done("info", texture, "--json"))
    assert values["representation"] == "product"
    assert values["lit"] is False
    assert values["brdf"]["name"] == "ward"


def test_a_texture_that_is_converted_is_said_to_have_no_cubes(texture, tmp_path):
    target = tmp_path / "x.exr"
    out = done("convert", texture, "--to", "product", "--precision", "float", "-o", target)
    assert out.splitlines()[0] == f"{target}: product, float"
    assert "cube" not in out


def test_what_takes_no_brushed_metal_names_what_does(tmp_path, probe):
    target = tmp_path / "x.exr"
    for to in ("shrm", "cabral"):
        result = run("prefilter", probe, "--brdf", BRUSHED, "--to", to, "-o", target)
        assert_refused(result, 1, "anisotropic", "--to principal")
        assert not target.exists()
    for to in ("shrm", "irradiance"):
        done("product", "lambertian", *SMALL, "-o", tmp_path / "t.exr")
        result = run("convert", tmp_path / "t.exr", "--to", to, "-o", target)
        assert_refused(result, 2, "made from the probe")


@pytest.mark.slow
def test_options_of_the_form(tmp_path, probe):
    target = tmp_path / "x.exr"
    for given, words in (
        (["--order", "17"], ["17"]),
        (["--eps", "0.1"], ["--eps", "applies"]),
        (["--size", "8"], ["--size", "applies"]),
    ):
        result = run("prefilter", probe, "--brdf", BRUSHED, "--to", "product", *given, "-o", target)
        assert_refused(result, 2, *words)
    out = done("prefilter", probe, "--brdf", BRUSHED, "--to", "product", "--texels", "8",
               "--window", "hann", "-o", target)  # fmt: skip
    assert "window         hann" in out
    assert "would lack a color" in out
    assert open_map(target).lighting.shape == (25, 3)


@pytest.mark.slow
def test_a_parameter_that_varies(tmp_path, probe, monkeypatch):
    monkeypatch.chdir(tmp_path)
    varied = ("product", "ward:ax=0.5", "--vary", "ay=0.2..0.5", "--steps", "3", *SMALL)
    result = json.loads(done(*varied, "--json"))
    assert result["values"] == pytest.approx([0.2, 0.35, 0.5])
    assert "3 values of ay from 0.2 to 0.5" in done(*varied)
    found = open_map(result["file"])
    assert (list(found.steps.values), len(found.textures)) == (["ay"], 3)
    assert found.textures[1].info.brdf["parameters"]["ay"] == pytest.approx(0.35)
    done("render", result["file"], "--probe", probe, "--size", "16", "-o", "x.exr")
    done("product", "ward:ax=0.5,ay=0.35", *SMALL, "-o", "middle.exr")
    done("render", "middle.exr", "--probe", probe, "--size", "16", "-o", "y.exr")
    _, middle = read_exr("x.exr")
    _, alone = read_exr("y.exr")
    np.testing.assert_allclose(middle["G"], alone["G"], rtol=2e-3, atol=1e-4)
    for given, code, words in (
        (["--vary", "az=0..1"], 1, ["no parameter 'az'", "ax, ay, color"]),
        (["--vary", "ay=0.5..0.2"], 2, ["NAME=LOW..HIGH"]),
        (["--vary", "ay=0.1..9"], 1, ["ay=9 is outside"]),
        (["--steps", "3"], 2, ["--vary"]),
    ):
        assert_refused(run("product", "ward:ax=0.5", *SMALL, *given, "-o", "z.exr"), code, *words)
    assert_refused(run(*varied[:4], "--steps", "2", *SMALL), 1, "another range")


@pytest.mark.proof
def test_two_parameters_that_vary(tmp_path, probe, monkeypatch):
    monkeypatch.chdir(tmp_path)
    varied = ("product", "ward", "--vary", "ax=0.3..0.4", "--vary", "ay=0.3..0.4", *SMALL)
    result = json.loads(done(*varied, "--steps", "3", "--json"))
    assert (result["parameters"], len(result["values"])) == (["ax", "ay"], 2)
    assert result["step_error"] <= 0.01
    text = done(*varied, "--steps", "2", "-o", "two.exr", "--force")
    assert "2 values of ax from 0.3 to 0.4 x 2 values of ay from 0.3 to 0.4" in text
    assert f"by sums of {len(open_map('two.exr').textures)} textures" in text
    told = json.loads(done("info", result["file"], "--json"))
    assert {name: told[name] for name in ("parameters", "values", "textures")} == {
        name: result[name] for name in ("parameters", "values", "textures")
    }
    assert told["brdf"]["parameters"]["ax"] == pytest.approx(0.35)
    done("render", result["file"], "--probe", probe, "--size", "16", "-o", "x.exr")
    done("product", "ward:ax=0.35,ay=0.35", *SMALL, "-o", "middle.exr")
    done("render", "middle.exr", "--probe", probe, "--size", "16", "-o", "y.exr")
    middle, alone = (read_exr(name)[1]["G"] for name in ("x.exr", "y.exr"))
    assert np.linalg.norm(middle - alone) < 0.01 * np.linalg.norm(alone)


SCENE = """
[[objects]]
mesh = "roof.obj"
[[key]]
frame = 1
vary = {ay = 0.2}
[[key]]
frame = 3
vary = {ay = 0.5}
"""


@pytest.fixture(scope="module")
def textures(tmp_path_factory):
    """A folder with a texture of which ay varies, those of three of its values, and a scene."""
    folder = tmp_path_factory.mktemp("worn")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        done("product", "ward:ax=0.5", "--vary", "ay=0.2..0.5", "--steps", "3", *SMALL,
             "-o", "worn.exr")  # fmt: skip
        for ay in ("0.2", "0.35", "0.5"):
            done("product", f"ward:ax=0.5,ay={ay}", *SMALL, "-o", f"{ay}.exr")
        Path("roof.obj").write_text(MESH)
        Path("scene.toml").write_text(SCENE)
        done("transfer", "roof.obj", "--matrices", "--samples", "64", "--order", "2",
             "-o", "roof.npz")  # fmt: skip
    return folder


@pytest.fixture
def worn(textures, probe, tmp_path, monkeypatch):
    """The current folder, with those textures, that scene, and a probe."""
    shutil.copytree(textures, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.slow
@pytest.mark.parametrize(
    ("of", "varied"),
    [
        ((), ("--vary", "ay=0.2..0.5", "--frames", "3")),
        (("--mesh", "roof.obj"), ("--vary", "ay=0.2..0.5", "--frames", "3")),
        (("--mesh", "roof.obj"), ("--mesh", "scene.toml")),
        (
            ("--mesh", "roof.obj", "--transfer", "roof.npz"),
            ("--vary", "ay=0.2..0.5", "--frames", "3"),
        ),
    ],
    ids=["sphere", "mesh", "keys", "shadows"],
)
def test_a_parameter_moves_over_frames(worn, of, varied):
    """Each frame is the picture of the texture that has its value, with the same lamps."""
    shared = ("--probe", "probe.exr", "--window", "none", "--size", "16", "--precision", "float")
    done("render", "worn.exr", *shared, *of, *varied, "-o", "f.%04d.exr")
    seen = []
    for number, ay in enumerate(("0.2", "0.35", "0.5"), 1):
        header, planes = read_exr(f"f.{number:04d}.exr")
        assert json.loads(header["shrm:recipe"])["vary"] == pytest.approx({"ay": float(ay)})
        done("render", f"{ay}.exr", *shared, *of, "-o", "alone.exr")
        alone = read_exr("alone.exr")[1]["G"]
        np.testing.assert_allclose(planes["G"], alone, rtol=2e-3, atol=1e-3 * alone.max())
        seen.append(planes["G"])
    assert np.ptp(seen, axis=0).max() > 0.02 * np.max(seen)


@pytest.mark.slow
def test_a_value_of_a_parameter_is_shown_while_the_viewer_walks(worn):
    shared = ("--probe", "probe.exr", "--window", "none", "--size", "16", "--frames", "2")
    done("render", "worn.exr", *shared, "--vary", "ay=0.5", "-o", "f.%04d.exr")
    done("render", "0.5.exr", *shared, "-o", "g.%04d.exr")
    one, two = ([read_exr(f"{name}.000{k}.exr")[1]["G"] for k in (1, 2)] for name in "fg")
    np.testing.assert_allclose(one, two, rtol=2e-3, atol=1e-3 * np.max(two))
    assert np.abs(two[0] - two[1]).max() > 0.05 * np.max(two)


@pytest.mark.slow
def test_values_that_a_texture_does_not_have_are_refused(worn):
    for given, code, words in (
        (["ay=0.2..0.5"], 2, ["--frames"]),
        (["ay=0.6"], 1, ["ay varies from 0.2 to 0.5", "cannot be 0.6"]),
        (["ay=0.2", "ay=0.3"], 2, ["--vary"]),
        (["ay=0.2", "wear.png"], 2, ["--vary"]),
        (["vertex"], 2, ["--vary", "with --mesh, or as NAME=X"]),
        (["0.3"], 2, ["--vary 0.3 names no parameter; give NAME=0.3"]),
        (["az=1"], 1, ["'az'", "ay"]),
    ):
        options = [word for each in given for word in ("--vary", each)]
        result = run("render", "worn.exr", "--probe", "probe.exr", *options, "-o", "x.png")
        assert_refused(result, code, *words)
    for wrong in ("0.9", "-1"):
        Path("scene.toml").write_text(SCENE.replace("ay = 0.5", f"ay = {wrong}"))
        shared = ("worn.exr", "--probe", "probe.exr", "--mesh", "scene.toml")
        result = run("render", *shared, "-o", "x.%04d.png")
        assert_refused(result, 1, "ay varies from 0.2 to 0.5")
        result = run("render", *shared, "--vary", "ay=0.3", "-o", "x.%04d.png")
        assert_refused(result, 2, "--vary", "[[key]]")
