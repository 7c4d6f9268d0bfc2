"""`--shader` and `--to layers`, by what they print and write."""

import json
from importlib import import_module

import numpy as np
import OpenEXR
import pytest

from shrm_cli.maps.file import open_map
from shrm_cli.maps.shader.code import written_code
from shrm_cli.maps.shader.file import pack
from tests.cli.helpers import assert_refused, done, run, snapshot, write_exr

FORMS = {
    "shrm": ["--brdf", "phong:exponent=4"],
    "principal": ["--brdf", "phong:exponent=4"],
    "cabral": ["--brdf", "phong:exponent=4"],
    "splitsum": ["--levels", "0.5,1", "--size", 8],
    "she": [],
}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_exr("probe.exr", np.random.default_rng(0).random((8, 16, 3)).astype(np.float32))
    return tmp_path


@pytest.mark.parametrize("to", FORMS)
def test_the_code_is_alone_on_stdout(folder, to):
    options = ("prefilter", "probe.exr", "--to", to, *FORMS[to], "-o", "map.exr")
    for language, textures in (("glsl", "layers"), ("hlsl", "cube-array"), ("c", "layers")):
        asked = ("--shader", language, *(() if language == "c" else ("--textures", textures)))
        result = run(*options, *asked)
        assert result.code == 0
        if textures == "layers" and to != "she":  # code without the map's own numbers
            assert result.out == written_code(open_map("map.exr"), language, textures).text
        assert result.out.startswith("/* The light of a probe")
        assert "shrm_radiance(" in result.out
        assert result.err.startswith("map.exr: ")


def test_the_code_of_even_surfaces(folder):
    asked = ("--to", "splitsum", *FORMS["splitsum"], "-o", "map.exr", "--shader", "glsl")
    result = run("prefilter", "probe.exr", *asked, "--taps", 2)
    assert result.code == 0
    assert result.out == written_code(open_map("map.exr"), "glsl", even_taps=2).text
    assert "shrm_even(" in result.out


@pytest.mark.parametrize(("options", "taps"), [([], 5), (["--taps", 8], 8)])
def test_the_code_of_brushed_surfaces(folder, options, taps):
    asked = ("--to", "splitsum", *FORMS["splitsum"], "-o", "map.exr", "--shader", "hlsl")
    result = run("prefilter", "probe.exr", *asked, "--anisotropy", *options)
    assert result.code == 0
    assert result.out == written_code(open_map("map.exr"), "hlsl", None, taps).text
    assert "shrm_brushed(" in result.out


@pytest.mark.parametrize(
    ("options", "code", "words"),
    [
        (["splitsum", "--anisotropy"], 2, "--anisotropy applies with --shader"),
        (
            ["splitsum", "--shader", "c", "--taps", 5],
            2,
            "--taps is 5; without anisotropy give 0, 1, 2 or 3",
        ),
        (["splitsum", "--taps", 1], 2, "--taps applies with --shader"),
        (["she", "--shader", "c", "--anisotropy"], 2, "--anisotropy applies with --to splitsum"),
        (["splitsum", "--brdf", "charlie", "--shader", "c", "--anisotropy"], 2, "of GGX"),
        (["splitsum", "--brdf", "charlie", "--shader", "c", "--taps", 1], 2, "of GGX"),
        (["auto", "--brdf", "phong", "--shader", "c", "--taps", 1], 2, "with --to splitsum"),
        (["splitsum", "--shader", "c", "--textures", "cube-array"], 2, "c reads no cube-array"),
    ],
)
def test_code_that_is_not_there_is_refused_before_the_work(
    folder, monkeypatch, options, code, words
):
    before = snapshot(folder)
    monkeypatch.setattr(
        import_module("shrm_cli.prefilter"), "make", lambda *_: pytest.fail("the map was made")
    )
    assert_refused(run("prefilter", "probe.exr", "--size", 8, "--to", *options), code, words)
    assert snapshot(folder) == before


@pytest.mark.parametrize("to", ["principal", "splitsum", "she"])
def test_the_file_holds_the_textures(folder, to):
    done("prefilter", "probe.exr", "--to", to, *FORMS[to], "-o", "map.exr")
    values = json.loads(
        done("convert", "map.exr", "--to", "layers", "--shader", "glsl", "-o", "t.exr", "--json")
    )
    made = open_map("map.exr")
    assert values["shader"] == written_code(made, "glsl", "layers").text
    textures = pack(made)
    assert values["textures"] == {each.name: list(each.values.shape[:3]) for each in textures}
    parts = {part.header["name"]: part for part in OpenEXR.File("t.exr").parts}
    assert len(parts) == sum(len(each.values) for each in textures)
    for texture in textures:
        for number, layer in enumerate(texture.values):
            stored = parts[f"{texture.name}.{number:03d}"].channels["RGB"].pixels
            np.testing.assert_array_equal(stored, layer)


@pytest.mark.parametrize("options", [("--yaw", "30"), ("--form", "zh3"), ()])
def test_files_of_maps_tell_their_code(folder, options):
    """No probe is needed, and none of the options that the map was made with."""
    done("prefilter", "probe.exr", "--to", "irradiance", "-o", "map.exr")
    convert = ("convert", "map.exr", "--to", "irradiance", *options, "-o", "new.exr")
    code = done(*convert, "--shader", "c", "--quiet").rstrip("\n")
    assert code == written_code(open_map("new.exr"), "c").text.rstrip("\n")
    assert json.loads(done(*convert, "--shader", "c", "--json"))["shader"].rstrip("\n") == code


@pytest.mark.parametrize(
    ("options", "code", "words"),
    [
        (["m.exr", "--to", "layers", "--size", 4], 2, "--size applies to all but --to layers"),
        (["m.exr", "--to", "openexr", "--shader", "c"], 2, "--shader applies to all but images"),
        (["probe.exr", "--to", "layers"], 2, "probe.exr is no map"),
        (["missing.exr", "--to", "layers"], 1, "missing.exr: no such file"),
        (["m.exr", "--to", "layers", "-o", "m.exr"], 1, "m.exr"),
        (["m.exr", "--to", "layers"], 1, "its code holds all numbers"),
    ],
    ids=lambda value: str(value)[:40],
)
def test_what_is_refused(folder, options, code, words):
    done("prefilter", "probe.exr", "--to", "irradiance", "-o", "m.exr")
    before = snapshot(folder)
    assert_refused(run("convert", *options), code, words)
    assert snapshot(folder) == before


def test_layers_are_of_the_code_alone(folder):
    result = run("prefilter", "probe.exr", "--brdf", "phong", "--textures", "layers")
    assert_refused(result, 2, "--textures applies with --shader")
    result = run(
        "prefilter", "probe.exr", "--brdf", "phong", "--shader", "c", "--textures", "cube-array"
    )
    assert_refused(result, 2, "c reads no cube-array")
