"""`shrm probe`: the files it writes, opened with OpenEXR alone."""

import json
from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from tests.cli.helpers import assert_refused, done, process, read_exr, run, snapshot

KINDS = ["furnace", "impulse", "sky", "studio"]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def image(path):
    header, channels = read_exr(path)
    return header, np.stack([channels[c].astype(float) for c in "RGB"], axis=-1)


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_is_a_lat_long_with_its_recipe(folder, kind):
    assert done("probe", kind, "-o", "p.exr", "--size", 16).startswith("p.exr: 32 x 16, ")
    header, pixels = image("p.exr")
    assert pixels.shape == (16, 32, 3)
    assert np.isfinite(pixels).all()
    assert pixels.min() >= 0
    assert pixels.max() > 0
    assert header["compression"] == OpenEXR.ZIP_COMPRESSION
    assert not {"envmap", "capDate"} & header.keys()
    recipe = json.loads(header["shrm:recipe"])
    assert (recipe["probe"], recipe["size"]) == (kind, 16)
    assert sorted(snapshot(folder)) == ["p.exr"]


@pytest.mark.parametrize("kind", KINDS)
def test_two_runs_write_the_same_bytes(folder, kind):
    for name in "ab":
        done("probe", kind, "-o", f"{name}.exr", "--size", 32)
    assert (folder / "a.exr").read_bytes() == (folder / "b.exr").read_bytes()


def test_default_size_is_256(folder):
    assert process("probe", "furnace", "-o", "p.exr").out == "p.exr: 512 x 256, half\n"


def test_furnace_has_its_radiance(folder):
    done("probe", "furnace", "-o", "p.exr", "--size", 4, "--radiance", "1,0.5,0.25")
    assert (image("p.exr")[1] == (1, 0.5, 0.25)).all()
    done("probe", "furnace", "-o", "p.exr", "--size", 4, "--radiance", "3")
    assert (image("p.exr")[1] == 3).all()


@pytest.mark.parametrize(
    ("direction", "row", "column"),
    # Height 8: the centre column looks along +Z, the left quarter along +X, the top row up.
    [("1,1", 3, 7), ("-1,-1", 4, 8), ("91,80", 0, 3), ("-89,-80", 7, 11)],
)
def test_impulse_is_where_it_was_asked(folder, direction, row, column):
    done("probe", "impulse", "-o", "p.exr", "--size", 8, "--direction", direction)
    header, pixels = image("p.exr")
    assert np.argwhere(pixels.any(axis=-1)).tolist() == [[row, column]]
    assert json.loads(header["shrm:recipe"])["direction"] == [
        float(x) for x in direction.split(",")
    ]


def test_sun_is_where_it_was_asked(folder):
    options = ["--size", 64, "--sun", "90,45", "--turbidity", 2, "--ground-albedo", 0]
    assert done("probe", "sky", "-o", "p.exr", *options).startswith("p.exr: 128 x 64, ")
    _, pixels = image("p.exr")
    row, column = np.unravel_index(pixels.sum(axis=-1).argmax(), pixels.shape[:2])
    assert abs(row - 15.5) <= 1  # 45 degrees up of 180
    assert abs(column - 31.5) <= 1  # the left quarter is +X
    assert pixels[40:].max() == 0


def test_key_light_sets_the_contrast(folder):
    done("probe", "studio", "-o", "p.exr", "--size", 64, "--key", 500)
    assert image("p.exr")[1].max() == pytest.approx(500, rel=1e-3)


def test_precision(folder):
    bright = ["probe", "furnace", "--size", 2, "-o", "p.exr", "--radiance"]
    assert done(*bright, 65504).endswith(", half\n")
    assert done(*bright, 1e5).endswith(", float\n")
    assert done(*bright, 1, "--precision", "float").endswith(", float\n")
    assert read_exr("p.exr")[1]["R"].dtype == np.float32
    before = snapshot(folder)
    result = run(*bright, 1e5, "--precision", "half")
    assert_refused(result, 1, "p.exr", "100000 overflows half", "--precision auto or float")
    assert snapshot(folder) == before


def test_quiet_prints_nothing(folder):
    assert done("probe", "furnace", "-o", "p.exr", "--size", 2, "--quiet") == ""


@pytest.mark.parametrize(
    ("arguments", "code", "parts"),
    [
        (["furnace"], 2, ["-o", "shrm probe furnace --help"]),
        (["furnace", "-o", "p.exr", "--size", "1"], 2, ["--size", "2<=x<=8192"]),
        (["furnace", "-o", "p.exr", "--size", "9000"], 2, ["--size"]),
        (["furnace", "-o", "p.exr", "--radiance", "-1"], 2, ["--radiance", "below 0"]),
        (["furnace", "-o", "p.exr", "--radiance", "1,2"], 2, ["--radiance", "one number"]),
        (["furnace", "-o", "p.exr", "--radiance", "nan"], 2, ["--radiance"]),
        (["furnace", "-o", "p.exr", "--radiance", "1e39"], 1, ["radiance"]),
        (["impulse", "-o", "p.exr", "--direction", "1"], 2, ["--direction", "AZ,EL"]),
        (["impulse", "-o", "p.exr", "--direction", "1,91"], 2, ["--direction", "-90 .. 90"]),
        (["impulse", "-o", "p.exr", "--direction", "inf,0"], 2, ["--direction"]),
        (["sky", "-o", "p.exr", "--turbidity", "1"], 2, ["--turbidity", "1.7 .. 10"]),
        (["sky", "-o", "p.exr", "--turbidity", "nan"], 2, ["nan is not in the range 1.7 .. 10"]),
        (["sky", "-o", "p.exr", "--ground-albedo", "nan"], 2, ["nan", "0 .. 1"]),
        (["sky", "-o", "p.exr", "--sun", "0,-5"], 2, ["elevation -5 of '0,-5' is outside 0 .. 90"]),
        (["sky", "-o", "p.exr", "--sun", "10,95"], 2, ["outside 0 .. 90; give AZ,EL"]),
        (["impulse", "-o", "p.exr", "--direction", "0,95"], 2, ["outside -90 .. 90"]),
        (["sky", "-o", "p.exr", "--size", "12.5"], 2, ["'12.5' is no whole number"]),
        (["sky", "-o", "p.exr", "--turbidity", "hazy"], 2, ["'hazy' is not a number"]),
        (["studio", "-o", "p.exr", "--key", "-1"], 2, ["--key"]),
        (["studio", "-o", "p.exr", "--key", "nan"], 2, ["nan", "0 .. 65504"]),
        (["studo", "-o", "p.exr"], 2, ["studo"]),
        (["furnace", "-o", "."], 1, ["a directory; name a file"]),
        (["furnace", "-o", "no/p.exr"], 1, ["no/p.exr", "make it first"]),
        (["furnace", "-o", "/proc/p.exr", "--size", "2"], 1, ["/proc/p.exr: cannot be written"]),
    ],
)
def test_bad_input(folder, arguments, code, parts):
    assert_refused(run("probe", *arguments), code, *parts)
    assert snapshot(folder) == {}


def test_output_is_checked_before_the_work(folder, monkeypatch):
    monkeypatch.setattr("shrm_cli.furnace", lambda *_: pytest.fail("worked first"))
    assert_refused(run("probe", "furnace", "-o", "no/p.exr"), 1, "there is no folder no")


def test_a_sky_without_its_sun_and_the_light_file_that_is_printed(folder):
    """The disc is printed as light files have it; with it the light is that of the whole sky."""
    done("probe", "sky", "--size", 64, "--sun", "30,50", "-o", "whole.exr")
    said = done("probe", "sky", "--size", 64, "--sun", "30,50", "--no-sun", "-o", "rest.exr")
    first, *disc = said.splitlines()
    assert first.startswith("rest.exr: 128 x 64")
    Path("sun.toml").write_text("\n".join(["[[probe]]", 'file = "rest.exr"', *disc]))
    whole, rest, sum_of_both = (
        np.array(json.loads(done("info", name, "--json"))["mean"])
        for name in ("whole.exr", "rest.exr", "sun.toml")
    )
    assert (whole > 1.2 * rest).all()
    np.testing.assert_allclose(sum_of_both, whole, rtol=1e-3)
    header, _ = read_exr("rest.exr")
    assert json.loads(header["shrm:recipe"])["no_sun"] is True
    assert done("probe", "sky", "--size", 8, "--no-sun", "--quiet", "-o", "q.exr") == ""
