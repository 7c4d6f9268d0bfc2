"""`shrm prefilter --sun split`: what is printed, and what becomes of the file."""

import json

import numpy as np
import pytest

from shrm_cli.probe.sky import sky
from tests.batch.helpers import work_here
from tests.cli.helpers import assert_refused, done, noise, run, write_exr


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with a sky, whose sun is beside a map of it."""
    folder = tmp_path_factory.mktemp("sun")
    write_exr(folder / "sky.exr", sky(64, 45, 35))
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        command = ("prefilter", "sky.exr", "--brdf", "ggx:roughness=.5", "--sun", "split")
        (folder / "told.txt").write_text(done(*command, "-o", "m.exr"))
    return folder


@pytest.fixture(autouse=True)
def _in_folder(folder, monkeypatch):
    monkeypatch.chdir(folder)


def test_it_says_what_there_is(folder):
    assert "1 disc beside the map" in (folder / "told.txt").read_text()
    values = json.loads(done("info", "m.exr", "--json"))
    (lamp,) = values["lamps"]
    assert set(lamp) == {"direction", "radius", "radiance"}
    assert 0 <= values["lamp_error"] < 1
    assert "lamps" in done("info", "m.exr")
    assert values["probe"] == "sky.exr"


@pytest.mark.proof
def test_it_is_compared_with_its_probe():
    """More light than the map without its sun, and about as much as the truth."""
    done("prefilter", "sky.exr", "--brdf", "ggx:roughness=.5", "-o", "plain.exr")
    command = ("compare", "plain.exr", "m.exr", "--probe", "sky.exr", "--size", "32")
    found = run(*command, "--no-picture", "--no-flip", "--json")
    assert found.code == 0
    rows = json.loads(found.out)["summary"]
    assert json.loads(found.out)["warnings"] == []
    assert rows[1]["relative_rmse"] < 0.05


def test_batches_make_it_once(monkeypatch):
    work_here(monkeypatch)
    command = ("batch", "sky.exr", "--brdf", "lambertian", "--sun", "split")
    assert "1 made" in done(*command)
    assert "1 there already" in done(*command)
    assert "1 made" in done("batch", "sky.exr", "--brdf", "lambertian")


def test_conversions_lose_nothing_in_silence():
    done("convert", "m.exr", "--to", "latlong", "-o", "laid.exr")
    assert len(json.loads(done("info", "laid.exr", "--json"))["lamps"]) == 1
    found = run("convert", "m.exr", "--to", "layers", "-o", "layers.exr")
    assert found.code == 0
    assert "textures hold no lamps" in found.err
    found = run("convert", "m.exr", "--to", "layers", "--shader", "glsl", "-o", "layers.exr")
    assert "textures hold no lamps" not in found.err
    assert "shrm_lamps(n, v)" in found.out
    assert_refused(run("convert", "m.exr", "--to", "openexr", "--working", "p3"), 1, "lamps")


def test_code_of_other_brushed_brdfs_is_refused():
    command = ("prefilter", "sky.exr", "--brdf", "poulin-fournier", "--sun", "split")
    found = run(*command, "--shader", "c", "-o", "none.exr")
    assert_refused(found, 1, "there is none of poulin-fournier")


def test_code_of_others_reads_a_table():
    command = ("prefilter", "sky.exr", "--brdf", "lafortune", "--sun", "split", "--shader", "c")
    found = run(*command, "-o", "table.exr")
    assert found.code == 0
    assert "shrm_lobe: what lamps' light is times" in found.out


def test_pages_show_it():
    done("view", "m.exr", "-o", "page.html", "--quiet")
    with open("page.html", encoding="utf-8") as page:
        assert "shrm_lamps" in page.read()


@pytest.mark.parametrize("to", ["irradiance", "splitsum", "she", "product"])
def test_maps_of_light_alone_take_none(to):
    brdf = ("--brdf", "lambertian") if to == "product" else ()
    found = run("prefilter", "sky.exr", *brdf, "--to", to, "--sun", "split")
    assert_refused(found, 2, "--sun applies with --to")


def test_auto_names_it_where_it_helps():
    """In a gloss that shows the sun so sharply that no map of some kilobytes keeps it, beside what
    shaders have no code for lamps in, whose table would not fit.
    """
    spec = "0.5*lafortune:fit=clay+0.5*ggx:roughness=0.1"
    asked = ("--brdf", spec, "-o", "coat.exr", "--max-size")
    write_exr("fine.exr", sky(64, 45, 35))
    found = run("prefilter", "fine.exr", *asked, "100kB")
    assert "take them out with --sun split, as discs, or dim them by --clamp" in found.err
    write_exr("noise.exr", noise(64, 128))
    found = run("prefilter", "noise.exr", *asked, "12kB")
    assert "dim them by --clamp" in found.err
    assert "--sun split" not in found.err


def test_large_lamps_are_named_alike_and_what_is_named_helps():
    """A light file of the same lamps, which was named, was as often wrong in as many bytes."""
    pixels = np.full((64, 128, 3), 0.05, np.float32)
    pixels[20:24, 30:34] = 40
    write_exr("box.exr", pixels)
    asked = ("--brdf", "ggx:roughness=.2", "--max-size", "200kB", "--json")
    found = run("prefilter", "box.exr", *asked, "--sun", "keep", "-o", "box.map.exr")
    assert "take them out with --sun split, as discs" in found.err
    apart = run("prefilter", "box.exr", *asked, "--sun", "split", "-o", "apart.exr")
    share = "predicted_wrong_share"
    assert json.loads(apart.out)[share] < json.loads(found.out)[share] / 2
    fibres = run("prefilter", "box.exr", "--brdf", "kajiya-kay", "--max-size", "6kB")
    assert "--sun split" not in fibres.err
