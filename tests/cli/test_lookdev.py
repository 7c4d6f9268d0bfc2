"""`shrm lookdev`: its cells are the pictures of `shrm render` of the maps of `shrm prefilter`."""

import itertools
import json
from importlib import import_module

import numpy as np
import OpenImageIO as oiio
import pytest

from shrm_cli.render.sheet import Grid
from tests import oracles
from tests.cli.helpers import assert_refused, done, polynomial_light, run, write_exr

P3 = (0.68, 0.32, 0.265, 0.69, 0.15, 0.06, 0.3127, 0.329)
PHONG = "phong:exponent=8"
RED = "lambertian:albedo=0.8/0.2/0.1"
MATERIALS = ("--brdf", PHONG, "--brdf", RED)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Two probes, of different brightness and primaries, and a file that is none."""
    light = polynomial_light(oracles.latlong_pixels(32, 16)).astype(np.float32)
    write_exr(tmp_path / "dim.exr", light / 10)
    write_exr(tmp_path / "wide.exr", light[:, ::-1] * 3, chromaticities=P3)
    (tmp_path / "broken.exr").write_bytes(b"no image")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def read(path):
    image = oiio.ImageBuf(str(path))
    return image.get_pixels(image.spec().format)


def cell(sheet, grid, row, column):
    top, left = grid.origin(row, column)
    return sheet[top : top + grid.tile, left : left + grid.tile]


@pytest.mark.parametrize("exposure", [(), ("--exposure", "0.5")])
def test_cells_are_what_render_shows(folder, exposure):
    arguments = ("--size", "48", "--view", "20,10")
    said = json.loads(
        done("lookdev", "dim.exr", "wide.exr", *MATERIALS, *arguments, *exposure, "--json")
    )
    assert said["files"] == ["lookdev.png"]
    sheet, grid = read("lookdev.png"), Grid(2, 2, 48)
    assert sheet.shape == (*grid.shape, 3)
    for column, (probe, facts) in enumerate(zip(("dim", "wide"), said["probes"], strict=True)):
        assert facts["name"] == probe
        for row, spec in enumerate((PHONG, RED)):
            done(
                "prefilter", f"{probe}.exr", "--brdf", spec, "--to", "principal",
                "--error", "0.05", "-o", "m.exr", "--quiet", "--precision", "float",
            )  # fmt: skip
            done(
                "render", "m.exr", *arguments, "--background", f"{probe}.exr",
                "--exposure", facts["exposure"], "-o", "r.png", "--quiet",
            )  # fmt: skip
            difference = np.abs(cell(sheet, grid, row, column).astype(int) - read("r.png"))
            assert difference.max() <= 1
    stops = [each["exposure"] for each in said["probes"]]
    assert stops == [0.5, 0.5] if exposure else stops[0] > stops[1] + 3


def test_frames_turn_the_probe(folder):
    """The viewer walks around the sphere: to him the probe turns the other way."""
    done("lookdev", "dim.exr", *MATERIALS, "--size", 32, "--frames", 4, "-o", "t.%02d.exr")
    for k in range(4):
        arguments = ("--size", 32, "--yaw", -90 * k, "-o", "one.exr", "--force")[:-1]
        done("lookdev", "dim.exr", *MATERIALS, *arguments)
        np.testing.assert_allclose(
            read(f"t.{k + 1:02d}.exr").astype(float), read("one.exr"), atol=0.01
        )
    assert np.abs(read("t.01.exr").astype(float) - read("t.02.exr")).max() > 0.1


@pytest.mark.parametrize("suffix", ["gif", "apng"])
def test_moving_pictures(folder, suffix):
    library = pytest.importorskip("PIL.Image")
    name = f"turn.{suffix}"
    text = done("lookdev", "dim.exr", *MATERIALS, "--size", 32, "--frames", 5, "-o", name)
    assert "5 frames, 24 a second" in text
    done("lookdev", "dim.exr", *MATERIALS, "--size", 32, "--frames", 5, "-o", "t.%02d.png")
    with library.open(name) as found:
        assert found.n_frames == 5
        found.seek(3)
        pixels = np.asarray(found.convert("RGB")).astype(int)
    assert np.abs(pixels - read("t.04.png")).mean() <= (0 if suffix == "apng" else 3)


def test_a_pair_that_fails_says_so_and_the_others_are_shown(folder):
    result = run("lookdev", "dim.exr", "broken.exr", *MATERIALS, "--size", 64, "-o", "s.png")
    assert result.code == 1
    (line,) = result.err.splitlines()  # which is one for all materials
    assert line.startswith("Warning: broken.exr: ")
    sheet, grid = read("s.png"), Grid(2, 2, 64)
    assert cell(sheet, grid, 0, 0).max() > 200
    failed = cell(sheet, grid, 0, 1)
    assert (failed == failed[..., :1]).all()  # grey letters on a grey ground
    assert failed.std() > 5
    done("lookdev", "dim.exr", *MATERIALS, "--size", 64, "-o", "alone.png")
    np.testing.assert_array_equal(cell(sheet, grid, 1, 0), cell(read("alone.png"), grid, 1, 0))


def test_a_pair_that_cannot_be_made(folder):
    """No SHRM holds a brushed surface: one row fails, the other does not."""
    result = run(
        "lookdev", "dim.exr", "--brdf", RED, "--brdf", "ward:ax=0.5,ay=0.2", "--size", 32,
        "--to", "shrm", "-o", "s.png", "--json",
    )  # fmt: skip
    assert result.code == 1
    said = json.loads(result.out)
    assert len(said["failures"]) == 1
    assert said["failures"][0].startswith("dim.exr, ward:ax=0.5,ay=0.2: ")
    assert said["predicted_errors"][0][1] is None
    assert said["predicted_errors"][0][0] < 0.05


def test_nothing_is_written_where_nothing_can_be_shown(folder):
    before = sorted(folder.iterdir())
    assert_refused(run("lookdev", "broken.exr", "--brdf", RED), 1, "broken.exr")
    assert_refused(run("lookdev", "dim.exr", "--brdf", "no-such"), 1, "no-such")
    assert sorted(folder.iterdir()) == before


def test_a_page(folder):
    text = done("lookdev", "dim.exr", "wide.exr", *MATERIALS, "--size", 32, "-o", "p.html")
    assert "2 materials x 2 probes" in text
    page = (folder / "p.html").read_text()
    assert page.count("<canvas") == 4
    before = page
    done("lookdev", "dim.exr", "wide.exr", *MATERIALS, "--size", 32, "-o", "p.html")
    assert (folder / "p.html").read_text() == before


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["--fps", "5"], 2, "--fps applies to moving pictures"),
        (["-o", "x.html", "--frames", "3"], 2, "--frames applies to pictures"),
        (["-o", "x.png", "--frames", "3"], 1, "one place for their number"),
        (["-o", "x.png", "--precision", "half"], 2, "--precision applies to EXR"),
        (["-o", "x.avi"], 1, "name it so"),
        (["-o", "dim.exr"], 1, "overwrite the input"),
    ],
)
def test_what_does_not_fit_is_refused(folder, arguments, code, words):
    before = (folder / "dim.exr").read_bytes()
    assert_refused(run("lookdev", "dim.exr", "--brdf", RED, *arguments), code, words)
    assert (folder / "dim.exr").read_bytes() == before


@pytest.mark.parametrize("name", ["turn.gif", "turn.apng"])
def test_frames_that_do_not_fit_into_memory_are_refused_before_work(folder, monkeypatch, name):
    def fail(*_):
        raise AssertionError("maps were made")

    monkeypatch.setattr(import_module("shrm_cli.lookdev.sheet"), "make_column", fail)
    probe = "dim.exr"
    long = ["--brdf", "lambertian", "--size", "1024", "--frames", "9999", "-o", name]
    found = run("lookdev", probe, *long, "--max-memory", "4GB")
    assert_refused(found, 2, "--max-memory 4 GB is too little", "frames take", ".mp4")
    still = ["--brdf", "lambertian", "--size", "1024", "-o", "a.png", "--max-memory", "1MB"]
    assert_refused(run("lookdev", probe, *still), 2, "--max-memory 1 MB is too little", "--size")
    assert not (folder / name).exists()


def test_a_long_turntable_says_how_long_it_takes(folder, monkeypatch):
    """A frame takes a second by a clock that moves a second when it is looked at."""
    seconds = itertools.count()
    monkeypatch.setattr(
        import_module("shrm_cli.lookdev.sheet"), "perf_counter", lambda: next(seconds)
    )
    probe = "dim.exr"
    few = ["--brdf", "lambertian", "--size", "16", "--frames", "9", "-o", "a.%02d.png"]
    assert "rendering takes about 8 s more" in run("lookdev", probe, *few, terminal=True).err


def test_why_a_cell_fails_is_told_in_flags(folder):
    image = np.ones((16, 32, 3), np.float32)
    image[3, 3] = np.nan
    write_exr(folder / "nan.exr", image)
    found = run("lookdev", "nan.exr", "--brdf", "lambertian", "-o", "a.png")
    assert_refused(found, 1, "Error: nan.exr: ", "--fix-nonfinite")
    result = run("lookdev", "dim.exr", "nan.exr", "--brdf", RED, "--size", 32, "-o", "p.html")
    page = (folder / "p.html").read_text()
    for told in (result.err, page):
        assert "give --fix-nonfinite" in told
        assert "fix_nonfinite" not in told
