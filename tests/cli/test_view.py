"""`shrm view`: the page it writes, and what it refuses; tests/web opens pages in a browser."""

import json
import re
import shutil
import urllib.error
import urllib.request
from contextlib import contextmanager
from importlib import import_module

import numpy as np
import pytest

from tests.cli.helpers import MAIN, assert_refused, done, run, snapshot, start, write_exr
from tests.maps.shader import cases

# A shell without job control starts processes with SIGINT ignored; a terminal does not.
TERMINAL = f"""
import signal
signal.signal(signal.SIGINT, signal.default_int_handler)
{MAIN}"""


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A folder with a small map of light, one of a BRDF, and a probe."""
    folder = tmp_path_factory.mktemp("made")
    light = np.ones((8, 16, 3), dtype=np.float32) + np.arange(16)[None, :, None] / 8
    write_exr(folder / "probe.exr", light.astype(np.float32))
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        done("prefilter", "probe.exr", "--brdf", "phong:exponent=4", "-o", "glossy.exr", "--quiet")
        done("prefilter", "probe.exr", "--to", "splitsum", "--levels", "2", "--size", "8", "-o",
             "light.exr", "--quiet")  # fmt: skip
    return folder


@pytest.fixture
def folder(made, tmp_path, monkeypatch):
    """The current folder, with those maps and the probe."""
    shutil.copytree(made, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def written(name):
    """The text of a page, and the description of its scene."""
    with open(name, encoding="utf-8") as file:
        text = file.read()
    found = re.search(r'<script type="application/json" class="shrm-scene">(.*?)</script>', text)
    return text, json.loads(found[1])


def test_a_page_is_one_file_without_addresses(folder):
    shown = ["glossy.exr", "light.exr", "--probe", "probe.exr", "--no-truth"]
    out = done("view", *shown, "-o", "a.html")
    assert re.match(r"a\.html: .* kB, opens in a browser without a network", out)
    rounded = re.search(r"rounded by up to (.*)% \(RMS\); --lossless", out)
    assert 0 < float(rounded[1]) < 2
    text, scene = written("a.html")
    assert not re.search(r"https?:|[\"'(]//|\bsrc=|@import|url\(", text)
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', text)[1]
    assert policy.startswith("default-src 'none';")
    assert "connect-src 'none'" in policy
    assert "unsafe" not in policy
    assert len(re.findall("<script>", text)) == 1
    assert [each["name"] for each in scene["maps"]] == ["glossy", "light"]
    assert scene["truths"] == []
    assert (scene["sky"]["width"], scene["sky"]["height"]) == (16, 8)
    assert len(re.findall('class="shrm-block"', text)) == len(scene["blocks"])
    out = json.loads(done("view", *shown, "-o", "b.html", "--lossless", "--json"))
    assert out["rounding_error"] == 0
    done("view", *shown, "-o", "b.html")
    assert (folder / "a.html").read_bytes() == (folder / "b.html").read_bytes()


def test_light_alone_has_the_surface_of_the_map_beside_it(folder):
    """Unless another is asked for; a map of gold beside a white split sum is no comparison."""
    gold = "ggx:roughness=0.7,f0=gold"
    done(
        "prefilter", "probe.exr", "--brdf", gold, "--to", "cabral", "--size", "16", "-o", "gold.exr"
    )
    done("prefilter", "probe.exr", "--to", "splitsum", "--levels", "3", "--size", "16",
         "-o", "light.split.exr")  # fmt: skip
    out = done("view", "light.split.exr", "gold.exr", "-o", "a.html")
    assert re.search(
        r"maps of light alone have the surface of gold\.exr, ggx:.*roughness=0\.7", out
    )
    _, scene = written("a.html")
    assert scene["start"]["roughness"] == 0.7
    np.testing.assert_allclose(scene["start"]["f0"], [1.0, 0.782, 0.344], atol=1e-6)
    assert any("surface of gold.exr" in note for note in scene["notes"])
    out = done("view", "light.split.exr", "gold.exr", "--f0", "0.04", "-o", "a.html")
    _, scene = written("a.html")
    assert (scene["start"]["roughness"], scene["start"]["f0"]) == (0.5, [0.04] * 3)
    assert "surface of" not in out


def test_errors_of_lamps_beside_a_map_are_among_its_facts(folder):
    """Nearly all that is wrong with a map may be theirs."""
    light = np.ones((64, 128, 3), dtype=np.float32)
    light[20, 40:44] = 300
    write_exr("tube.exr", light)
    asked = "--brdf", "phong:exponent=32", "--sun", "split", "--to", "shrm", "-o", "discs.exr"
    made = json.loads(run("prefilter", "tube.exr", *asked, "--json").out)
    done("view", "discs.exr", "-o", "a.html")
    (shown,) = written("a.html")[1]["maps"]
    assert ["by lamps beside it", f"{made['lamp_error']:.2%}"] in shown["facts"]
    done("view", "glossy.exr", "-o", "a.html")
    assert "by lamps beside it" not in dict(written("a.html")[1]["maps"][0]["facts"])


def test_the_truth_of_several_views(folder):
    options = ["--view", "10,20", "--view", "-30,0", "--truth-size", "16", "--source-height", "8"]
    options += ["--exact"]
    shown = ["glossy.exr", "--probe", "probe.exr", *options]
    out = json.loads(done("view", *shown, "-o", "a.html", "--json"))
    assert (out["truths"], out["views"]) == (2, [[10, 20], [-30, 0]])
    _, scene = written("a.html")
    assert [each["view"] for each in scene["truths"]] == [[10, 20], [-30, 0]]
    assert scene["start"]["view"] == [10, 20]
    assert ["probe", "probe.exr, 128 pixels"] in scene["truth_facts"]


def test_tangents_follow_a_direction_or_the_mesh(folder):
    (folder / "a.obj").write_text(
        "v 0 0 0\nv 0 1 0\nv 1 0 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3"
    )
    shown = [
        "light.exr",
        "--anisotropy",
        "0.5",
        "--probe",
        "probe.exr",
        "--truth-size",
        "16",
        "--exact",
    ]
    done("view", *shown, "--brush", "0,0,2", "-o", "a.html")
    scene = written("a.html")[1]
    assert scene["start"]["brush"] == scene["truths"][0]["brush"] == [0, 0, 1]
    assert [each["tangents"] for each in scene["maps"]] == [True]
    done("view", *shown, "--brush", "uv", "--mesh", "a.obj", "-o", "b.html")
    scene = written("b.html")[1]
    assert (scene["start"]["brush"], scene["truths"][0]["brush"]) == ("uv", None)
    assert "tangents" in scene["shapes"][2]


def test_maps_of_different_brdfs_have_no_truth(folder):
    result = run("view", "glossy.exr", "light.exr", "--probe", "probe.exr", "-o", "a.html")
    assert result.code == 0
    assert result.err.startswith("Warning: no truth: light.exr: its BRDF is ggx")
    assert written("a.html")[1]["truths"] == []


def test_maps_of_another_probe_are_told_of(folder):
    write_exr(folder / "other.exr", np.ones((8, 16, 3), np.float32))
    shown = ["view", "glossy.exr", "--no-truth", "-o", "a.html", "--probe"]
    assert run(*shown, "other.exr").err == "Warning: glossy.exr: its probe is not other.exr\n"
    assert run(*shown, "probe.exr").err == ""


def test_a_small_page_has_a_small_probe_and_no_smaller_maps(folder):
    light = np.ones((256, 512, 3), dtype=np.float32)
    write_exr("large.exr", light)
    common = ["view", "glossy.exr", "--probe", "large.exr", "--no-truth", "-o", "a.html"]
    result = run(*common, "--max-size", "1MB")
    assert result.code == 0
    assert "the probe behind the shape has 128 rows, not 256" in result.err
    (folder / "a.html").unlink()
    refused = run("view", "glossy.exr", "-o", "a.html", "--max-size", "1000")
    assert_refused(refused, 1, "--output", "--max-size", "shrm convert")
    assert not (folder / "a.html").exists()


@pytest.mark.parametrize(
    ("arguments", "code", "part"),
    [
        (["glossy.exr", "-o", "a.png"], 1, "a.png"),
        (["glossy.exr", "-o", "no/folder/a.html"], 1, "a.html"),
        (["glossy.exr", "-o", "glossy.exr"], 1, "glossy.exr"),
        (["probe.exr", "-o", "a.html"], 1, "probe.exr"),
        (["missing.exr", "-o", "a.html"], 1, "missing.exr"),
        (["glossy.exr", "--mesh", "missing.obj", "-o", "a.html"], 1, "missing.obj"),
        (["glossy.exr", "--roughness", "0.3", "-o", "a.html"], 2, "--roughness"),
        (["glossy.exr", "--no-truth", "-o", "a.html"], 2, "--no-truth"),
        (["glossy.exr", "--brdf", "phong", "-o", "a.html"], 2, "--brdf"),
        (["glossy.exr", "--yaw", "3", "-o", "a.html"], 2, "--yaw"),
        (["glossy.exr", "--max-size", "3MB"], 2, "--max-size"),
        (["glossy.exr", "--no-open", "-o", "a.html"], 2, "--no-open"),
        (["glossy.exr", "--brush", "1,0,0", "-o", "a.html"], 2, "--brush applies to brushed"),
        (["light.exr", "--brush", "uv", "-o", "a.html"], 2, "--brush cannot be uv: the sphere"),
        (["glossy.exr", "-o", "a.html", *["--view", "0,0"] * 9], 2, "--view"),
        (["light.exr", "--taps", "5", "-o", "a.html"], 2, "without anisotropy give 0, 1, 2 or 3"),
        (
            ["light.exr", "--anisotropy", "0.5", "--taps", "1", "-o", "a.html"],
            2,
            "--taps is 1; with anisotropy give 3, 5 or 8",
        ),
        ([], 2, "MAP"),
    ],
)
def test_what_is_refused(folder, arguments, code, part):
    before = snapshot(folder)
    assert_refused(run("view", *arguments), code, part)
    assert snapshot(folder) == before


def test_a_page_that_is_too_large_is_refused_before_the_truth(folder, monkeypatch):
    def fail(*_):
        raise AssertionError("the truth was computed")

    monkeypatch.setattr(import_module("shrm_cli.view.scene"), "_truth_pictures", fail)
    arguments = ["glossy.exr", "--probe", "probe.exr", "-o", "a.html", "--max-size", "10"]
    assert_refused(run("view", *arguments), 1, "more than 10 bytes", "--max-size")
    assert not (folder / "a.html").exists()


def test_maps_that_shaders_cannot_show(folder):
    done("product", "ward", "--order", "2", "--size", "8", "-o", "p.exr")
    result = run("view", "p.exr", "-o", "a.html")
    assert_refused(result, 1, "p.exr", "product texture that holds no light", "give --probe")
    lit = done("view", "p.exr", "--probe", "probe.exr", "--no-truth", "-o", "lit.html")
    assert "shrm_lighting" in (folder / "lit.html").read_text()
    assert "opens in a browser" in lit
    cases.irradiance(17).save("sharp.exr")
    result = run("view", "sharp.exr", "-o", "a.html")
    assert_refused(result, 1, "sharp.exr", "17", "shrm convert")


@contextmanager
def ended(child):
    """End a server whatever happens, which nobody would wait for otherwise."""
    try:
        yield
    finally:
        child.kill()


def test_it_serves_this_machine_alone_until_it_is_interrupted(folder):
    with start("view", "glossy.exr", "--no-open", "--quiet", code=TERMINAL) as child, ended(child):
        url = child.stdout.readline().strip()
        assert re.fullmatch(r"http://127\.0\.0\.1:\d+/[-\w]{32}/", url)
        root = url[: url.index("/", 8) + 1]
        with urllib.request.urlopen(url) as answer:
            assert "connect-src 'self'" in answer.read().decode()
        with urllib.request.urlopen(f"{url}0.bin") as answer:
            assert len(answer.read()) > 100
        stranger = urllib.request.Request(url, headers={"Host": "evil.example:80"})
        without = [
            root,
            f"{root}0.bin",
            f"{root}x/",
            f"{root}{'A' * 32}/",
            url[:-1],
            url[:-2] + "/",
        ]
        for refused in (stranger, f"{url}../glossy.exr", f"{url}99.bin", *without):
            with pytest.raises(urllib.error.HTTPError, match="404"):
                urllib.request.urlopen(refused)
        child.send_signal(2)
        _, err = child.communicate(timeout=60)
    assert (child.returncode, err.strip()) == (130, "Error: interrupted")
