"""`shrm render`: files, names, settings and errors."""

import json
import os
import re
import shutil
import subprocess
import sys

import numpy as np
import OpenImageIO as oiio
import pytest
from click.testing import CliRunner

from shrm_cli.cli.render import render
from shrm_cli.errors import MapError, OutputError, ProbeError, ShrmError
from shrm_cli.files.image import write_image
from shrm_cli.files.png import encode_srgb
from shrm_cli.files.whole import protecting
from shrm_cli.maps.info import MapInfo
from shrm_cli.maps.irradiance.irradiance import Irradiance
from shrm_cli.maps.shrm.shrm import Shrm
from shrm_cli.maps.splitsum.split_sum import SplitSum
from shrm_cli.render.camera import Viewer
from shrm_cli.render.drawing import SphereSubject
from shrm_cli.render.sphere import render_background, render_sphere
from tests.cli.helpers import NO_MODULES, told_to_bars
from tests.geometry.shapes import icosphere, obj
from tests.render.materials import furnace, spot, under_random_light

P3 = (0.68, 0.32, 0.265, 0.69, 0.15, 0.06, 0.3127, 0.329)


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    """Two maps and a probe, which are made once."""
    made = tmp_path_factory.mktemp("inputs")
    under_random_light().save(made / "a.microfacet.shrm.exr", "float")
    spot((0, 0, 1)).save(made / "spot.exr", "float")
    steps = np.linspace(0, 1, 32 * 64 * 3, dtype=np.float32)
    write_image(made / "room.exr", steps.reshape(32, 64, 3), "float")
    return made


@pytest.fixture
def folder(inputs, tmp_path, monkeypatch):
    """Current folder with two maps and a probe."""
    shutil.copytree(inputs, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run(*arguments):
    with protecting():  # as `main` does it for every command
        return CliRunner().invoke(render, [str(argument) for argument in arguments])


def done(*arguments):
    result = run(*arguments)
    assert result.exit_code == 0, result.output
    assert result.stderr == ""
    return result.stdout


def read(path):
    image = oiio.ImageBuf(str(path))
    return image.get_pixels(image.spec().format)


def files(folder):
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.slow
def test_default_is_a_png_of_512_beside_us(folder):
    (folder / "elsewhere").mkdir()
    (folder / "a.microfacet.shrm.exr").rename(folder / "elsewhere" / "b.microfacet.shrm.exr")
    stdout = done("elsewhere/b.microfacet.shrm.exr")
    assert stdout == "b.microfacet.shrm.png: 512 x 512, 8-bit sRGB\n"
    expected = render_sphere(under_random_light(), Viewer(), 512)
    different = read("b.microfacet.shrm.png").astype(int) - encode_srgb(expected)
    assert np.abs(different).max() <= 1


def test_exr_is_linear_with_view_exposure_and_recipe(folder):
    options = ["--view", "-30,10", "--size", 40, "--exposure", 1.5, "--precision", "float"]
    stdout = done("a.microfacet.shrm.exr", "-o", "x.exr", *options)
    assert stdout == "x.exr: 40 x 40, float\n"
    expected = render_sphere(under_random_light(), Viewer(-30, 10), 40) * 2**1.5
    np.testing.assert_allclose(read("x.exr"), np.maximum(expected, 0), atol=1e-5)
    spec = oiio.ImageInput.open("x.exr").spec()
    recipe = json.loads(spec.get_string_attribute("shrm:recipe"))
    assert recipe["render"] == ["a.microfacet.shrm.exr"]
    assert recipe["view"] == [-30, 10]
    assert recipe["exposure"] == 1.5
    assert done("a.microfacet.shrm.exr", "-o", "x.exr", "--size", 40).endswith(", half\n")


def test_chromaticities_are_those_of_the_first_map(folder):
    info = MapInfo(0, 0, 0.03, 1.0, 0.0, chromaticities=P3)
    wide = Shrm(np.ones((24, 4, 1, 3), np.float32), "global", "reflection", info)
    wide.save("wide.exr")
    done("wide.exr", "-o", "one.exr", "--size", 16)
    done("wide.exr", "spot.exr", "-o", "two.exr", "--size", 16)
    chromaticities = [
        oiio.ImageInput.open(name).spec().getattribute("chromaticities")
        for name in ("one.exr", "two.exr")
    ]
    # The other map is shown in the primaries of the first one.
    np.testing.assert_allclose(chromaticities, [P3, P3], rtol=1e-6)


def test_background_is_shown_and_exposed(folder):
    from shrm_cli.probe.open import open_probe
    from shrm_cli.probe.options import ReadOptions

    done("spot.exr", "-o", "x.exr", "--size", 32, "--background", "room.exr", "--exposure", 1,
         "--view", "70,-20", "--yaw", "40", "--precision", "float")  # fmt: skip
    turned = open_probe("room.exr", ReadOptions(yaw=40))
    expected = 2 * render_background(turned, Viewer(70, -20), 32)
    picture = read("x.exr")
    corners = np.hypot(*np.mgrid[-15.5:16, -15.5:16]) > 16
    np.testing.assert_allclose(picture[corners], expected[corners], rtol=1e-5)
    assert not np.allclose(picture[16, 16], expected[16, 16], rtol=1e-2)


def test_sheet_of_several_maps(folder):
    options = ["--size", 32, "--exposure", -1, "--precision", "float"]
    stdout = done("spot.exr", "a.microfacet.shrm.exr", "spot.exr", "--columns", 3, *options)
    assert stdout == "sheet.png: 104 x 56, 8-bit sRGB\n"
    done("spot.exr", "a.microfacet.shrm.exr", "-o", "s.exr", *options)
    done("spot.exr", "-o", "1.exr", *options)
    done("a.microfacet.shrm.exr", "-o", "2.exr", *options)
    sheet = read("s.exr")
    np.testing.assert_array_equal(sheet[2:34, 2:34], read("1.exr"))
    np.testing.assert_array_equal(sheet[2:34, 36:68], read("2.exr"))
    labels = sheet[34:54, 2:34], sheet[34:54, 36:68]
    assert labels[0].max() > 0.9
    assert (labels[0] != labels[1]).any()


def test_frames_walk_from_z_towards_x(folder):
    """The light stays at +Z, so it moves to the left of a viewer who walks to the right."""
    options = ["--size", 64, "--precision", "float"]
    stdout = done("spot.exr", "--frames", 8, "-o", "t.%02d.exr", *options)
    assert stdout.splitlines() == [f"t.0{k}.exr: 64 x 64, float" for k in range(1, 9)]
    columns = []
    for k in (8, 1, 2):
        row, column = np.unravel_index(np.argmax(read(f"t.0{k}.exr")[..., 0]), (64, 64))
        assert abs(row - 31.5) < 1
        columns.append((column + 0.5 - 32) / (0.45 * 64))
    # N halves the angle between light and viewer: 22.5 degrees from the picture's centre.
    offset = np.sin(np.radians(22.5))
    np.testing.assert_allclose(columns, [offset, 0, -offset], atol=0.03)
    done("spot.exr", "--view", "135,0", "-o", "single.exr", *options)
    np.testing.assert_allclose(read("t.04.exr"), read("single.exr"), atol=1e-6)


def test_names_of_frames(folder):
    done("a.microfacet.shrm.exr", "--frames", 2, "--size", 16)
    done("a.microfacet.shrm.exr", "spot.exr", "--frames", 1, "--size", 16)
    made = [name for name in files(folder) if name.endswith(".png")]
    assert made == [
        "a.microfacet.shrm.0001.png",
        "a.microfacet.shrm.0002.png",
        "sheet.0001.png",
    ]
    assert read("sheet.0001.png").shape == (40, 38, 3)


def test_json_lists_files_and_settings(folder):
    stdout = done("spot.exr", "--size", 20, "--frames", 2, "--view", "10,5", "--json")
    value = json.loads(stdout)
    assert value["files"] == [
        {"file": "spot.0001.png", "azimuth": 10, "pixels": "8-bit sRGB"},
        {"file": "spot.0002.png", "azimuth": 190, "pixels": "8-bit sRGB"},
    ]
    assert value["maps"] == ["spot.exr"]
    assert (value["view"], value["size"], value["exposure"]) == ([10, 5], 20, 0)
    assert (value["width"], value["height"], value["background"]) == (20, 20, None)


def test_quiet_prints_nothing(folder):
    assert done("spot.exr", "--size", 16, "--quiet") == ""
    assert (folder / "spot.png").exists()


def test_same_bytes_twice(folder):
    done("spot.exr", "--size", 30)
    first = (folder / "spot.png").read_bytes()
    done("spot.exr", "--size", 30)
    assert (folder / "spot.png").read_bytes() == first


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        (["missing.exr"], MapError, "missing.exr: no such file"),
        (["room.exr"], MapError, "room.exr: an image, but not a map"),
        (["spot.exr", "room.exr"], MapError, "room.exr: an image, but not a map"),
        (["spot.exr", "--background", "no.exr"], ProbeError, "no.exr"),
        (["spot.exr", "-o", "x.jpg"], OutputError, "what is written is .png, .exr"),
        (["spot.exr", "-o", "spot.exr"], OutputError, "overwrite the input"),
        (["spot.exr", "--background", "room.exr", "-o", "room.exr"], OutputError, "overwrite"),
        (["spot.exr", "-o", "no/x.png"], OutputError, "no folder"),
        (["spot.exr", "--frames", "3", "-o", "x.png"], OutputError, "x.%04d.png"),
        (["spot.exr", "--frames", "3", "-o", "x.%04d.gif"], OutputError, "is one file"),
        (["spot.exr"] * 9 + ["--size", "8000"], OutputError, "smaller `size`"),
        (["hot.exr", "-o", "x.exr", "--precision", "half"], OutputError, "overflows half"),
    ],
)
def test_failures_are_one_line_and_leave_nothing(folder, arguments, error, message):
    furnace((1e6, 1, 1)).save("hot.exr", "float")
    before = files(folder)
    result = run(*arguments)
    assert isinstance(result.exception, error)
    assert isinstance(result.exception, ShrmError)
    assert message in str(result.exception)
    assert "\n" not in str(result.exception)
    assert result.output == ""
    assert files(folder) == before


def test_folder_without_permission(folder, monkeypatch):
    # The tests may run as root, whom no permission stops.
    monkeypatch.setattr("os.access", lambda path, mode: mode == os.R_OK)
    assert "no permission" in str(run("spot.exr").exception)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "MAP..."),
        (["."], "directory"),
        (["spot.exr", "--size", "15"], "--size"),
        (["spot.exr", "--size", "8193"], "--size"),
        (["spot.exr", "--exposure", "nan"], "--exposure"),
        ([], "shrm prefilter PROBE --brdf SPEC makes one"),
        (["--mesh", "a.glb"], "shrm prefilter PROBE --to splitsum makes one for the materials"),
        (["--mesh", "a.glb", "--probe", "sky.exr"], "shrm prefilter sky.exr --to splitsum"),
        (["spot.exr", "--exposure", "inf"], "--exposure"),
        (["spot.exr", "--exposure", "33"], "--exposure"),
        (["spot.exr", "--view", "0,91"], "--view"),
        (["spot.exr", "--view", "0"], "--view"),
        (["spot.exr", "--frames", "0"], "--frames"),
        (["spot.exr", "--columns", "0"], "--columns"),
        (["spot.exr", "--yaw", "nan"], "--yaw"),
    ],
)
def test_wrong_usage(folder, arguments, message):
    before = files(folder)
    result = run(*arguments)
    assert result.exit_code == 2
    assert message in result.stderr
    assert files(folder) == before


def test_dark_and_bright_limits_of_exposure(folder):
    result = run("spot.exr", "--size", 16, "--exposure", -32, "-o", "dark.png")
    assert (result.exit_code, result.stderr.count("\n")) == (0, 1)
    assert "dark.png: all but black at an exposure of -32; --exposure -2 shows it" in result.stderr
    assert not read("dark.png").any()
    # The paper and the labels of a sheet are not dark.
    result = run("spot.exr", "spot.exr", "--size", 16, "--exposure", -32, "-o", "sheet.png")
    assert result.stderr.count("Warning: sheet.png, spot: all but black at an exposure of -32") == 2
    done("spot.exr", "--size", 16, "--exposure", 32, "-o", "bright.exr")
    assert np.isfinite(read("bright.exr")).all()


def test_an_exposure_that_nobody_named_shows_the_picture(folder):
    furnace(64.0).save(folder / "bright.exr", "float")
    told = done("bright.exr", "--size", 32, "-o", "ball.png", "--json")
    assert json.loads(told)["exposure"] == -7.25  # 64 becomes .42
    assert "exposure       -7.25" in done("bright.exr", "--size", 32, "-o", "ball.png")
    assert np.all(read("ball.png")[16, 16] == encode_srgb(np.float32([64 * 2**-7.25])))
    # A sheet has one exposure, and its paper and labels stay as they are.
    done("bright.exr", "bright.exr", "--size", 32, "-o", "sheet.png")
    done("spot.exr", "spot.exr", "--size", 32, "-o", "other.png")
    paper, other = read("sheet.png"), read("other.png")
    assert paper.shape == other.shape
    np.testing.assert_array_equal(paper[:3], other[:3])
    done("bright.exr", "--size", 32, "-o", "ball.exr")
    np.testing.assert_allclose(read("ball.exr")[16, 16, :3], 64, rtol=1e-3)
    result = run("bright.exr", "--size", 32, "--exposure", 0, "-o", "ball.png")
    assert "Warning: ball.png: all but white at an exposure of 0; --exposure -7.25" in result.stderr


@pytest.mark.parametrize("mesh", [False, True])
@pytest.mark.parametrize(("level", "behind"), [(0.7, 0.01), (0.2, 90.0), (0.2, 1e-4)])
def test_what_is_behind_changes_no_exposure(folder, mesh, level, behind):
    """Most of a white ball before a dim wall was white, and bright walls hid that a ball is."""
    light = np.zeros((9, 3))
    light[0], light[2] = 0.2 * np.sqrt(4 * np.pi), 0.8 * np.sqrt(4 * np.pi / 3)
    Irradiance(np.pi * level * light, MapInfo(2, 0, 0.03, 1.0, 0.0)).save(folder / "ball.exr")
    write_image(folder / "wall.exr", np.full((16, 32, 3), behind, np.float32), "float")
    (folder / "ball.obj").write_bytes(obj(*icosphere(2)))
    drawn = ["ball.exr", "--size", 64, *(["--mesh", "ball.obj"] if mesh else [])]
    alone = json.loads(done(*drawn, "-o", "alone.png", "--json"))
    drawn, is_white = [*drawn, "--background", "wall.exr"], level > 0.5
    before = json.loads(done(*drawn, "-o", "wall.png", "--json"))
    assert before["exposure"] == alone["exposure"]
    assert (alone["exposure"] < 0) == is_white
    options = ["--exposure", -9, "-o", "wall.png"]
    told = "wall.png: all but black at an exposure of -9"
    assert (told in run(*drawn, *options).stderr) == (not is_white)
    told = "Warning: wall.png, ball: all but black"
    assert run("ball.exr", *drawn, *options).stderr.count(told) == (0 if is_white else 2)


def test_pictures_are_drawn_once_whatever_shows_them(folder, monkeypatch):
    drawn = []

    def counted(subject, *rest):
        drawn.append(rest)
        return render_sphere(*rest[:2], subject.size, *rest[2:])

    monkeypatch.setattr(SphereSubject, "draw", counted)
    furnace(64.0).save(folder / "bright.exr", "float")
    told = done("bright.exr", "--size", 32, "--frames", 3, "-o", "ball.%04d.png")
    assert "exposure       -7.25" in told
    assert len(drawn) == 3


MAIN = "from shrm_cli.cli.main import main; main()"


def process(*arguments, code=MAIN):
    command = [sys.executable, "-c", code, *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)


@pytest.fixture
def package_path(monkeypatch):
    """Let processes in other folders import the package as we do."""
    monkeypatch.setenv("PYTHONPATH", ":".join(path or "." for path in sys.path))


def test_as_a_process(package_path, folder):
    result = process("render", "a.microfacet.shrm.exr", "--size", "32")
    assert (result.returncode, result.stderr) == (0, "")
    assert result.stdout == "a.microfacet.shrm.png: 32 x 32, 8-bit sRGB\n"
    result = process("render", "missing.exr")
    assert (result.returncode, result.stdout) == (1, "")
    assert result.stderr == "Error: missing.exr: no such file; name a map\n"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["x.png", "x.exr"])
def test_full_disk_as_a_process(package_path, folder, name):
    before = files(folder)
    limited = f"{NO_MODULES}; import resource as r; r.setrlimit(r.RLIMIT_FSIZE, (900, 900)); {MAIN}"
    result = process("render", "a.microfacet.shrm.exr", "--size", "64", "-o", name, code=limited)
    assert (result.returncode, result.stdout) == (1, "")
    assert result.stderr.startswith(f"Error: {name}: cannot be written (")
    assert result.stderr.count("\n") == 1
    assert files(folder) == before


def test_help_needs_no_numpy(package_path):
    code = "import sys, shrm_cli.cli.render; assert not {'numpy', 'tqdm'} & sys.modules.keys()"
    assert process(code=code).returncode == 0


def test_rows_are_counted_for_the_progress_bar(folder, monkeypatch):
    seen = told_to_bars(monkeypatch, "render")
    done("spot.exr", "a.microfacet.shrm.exr", "--frames", 2, "--size", 16)
    (total,) = {total for _, total in seen}
    assert seen == sorted(seen)
    assert {steps for steps, _ in seen} >= {k * total / 4 for k in (1, 2, 3, 4)}


def test_warnings_of_the_background_are_told(folder):
    pixels = np.ones((8, 16, 3), np.float32)
    pixels[2, 3] = -1
    write_image("negative.exr", pixels, "float")
    arguments = ["spot.exr", "-o", "x.png", "--size", "16", "--background", "negative.exr"]
    result = CliRunner().invoke(render, arguments)
    assert result.exit_code == 0
    assert result.stderr.startswith("Warning: negative.exr: 1 pixel with negative radiance")
    quiet = CliRunner().invoke(render, [*arguments, "--quiet"])
    assert (quiet.stdout, quiet.stderr) == ("", "")


def white_split_sum(*roughness):
    """Light of radiance 1 from everywhere, at some roughnesses."""
    level = np.ones((24, 4, 3), np.float32)
    return SplitSum((level,) * len(roughness), roughness, "linear", MapInfo(0, 0, 0.0, 1.0, 0.0))


def help_text():
    return " ".join(run("--help").stdout.split())


def test_split_sums_are_shown_with_a_roughness_and_a_reflectance(folder):
    white_split_sum(0.0, 1.0).save("white.splitsum.exr", "float")
    options = ["-o", "x.exr", "--size", 32, "--precision", "float"]
    done("white.splitsum.exr", *options)
    smooth, default = ["--roughness", 0.05, "--f0", "0.04/0.5/1"], read("x.exr")[16, 16]
    done("white.splitsum.exr", *options, *smooth)
    middle = read("x.exr")[16, 16]
    np.testing.assert_allclose(middle, [0.04, 0.5, 1], rtol=5e-3)
    spec = oiio.ImageInput.open("x.exr").spec()
    recipe = json.loads(spec.get_string_attribute("shrm:recipe"))
    assert (recipe["roughness"], recipe["f0"]) == (0.05, [0.04, 0.5, 1])
    assert {"[default: 0.5]", "[default: 1]"} <= set(re.findall(r"\[.*?\]", help_text()))
    done("white.splitsum.exr", *options, "--roughness", 0.5, "--f0", 1)
    np.testing.assert_array_equal(read("x.exr")[16, 16], default)
    value = json.loads(done("white.splitsum.exr", *options, "--f0", "gold", "--json"))
    assert (value["roughness"], value["f0"]) == (0.5, [1, 0.782, 0.344])


def test_irradiance_is_shown_as_white_and_diffuse(folder):
    """E over pi: with L = 2 in the constant harmonic alone, 2 everywhere."""
    info = MapInfo(0, 0, 0.0, 1.0, 0.0)
    Irradiance(np.full((1, 3), 2 * np.sqrt(4 * np.pi)), info).save("e.exr", "float")
    done("e.exr", "-o", "x.exr", "--size", 16, "--precision", "float")
    np.testing.assert_allclose(read("x.exr")[8, 8], 2, rtol=1e-5)


def test_of_several_maps_those_that_need_a_surface_get_it(folder):
    white_split_sum(0.0, 1.0).save("white.exr", "float")
    options = ["--size", 32, "--precision", "float"]
    surface = ["--roughness", 0.05, "--f0", 0.25]
    done("spot.exr", "white.exr", "-o", "s.exr", *options, *surface)
    done("spot.exr", "-o", "1.exr", *options)
    done("white.exr", "-o", "2.exr", *options, *surface)
    sheet = read("s.exr")
    np.testing.assert_array_equal(sheet[2:34, 2:34], read("1.exr"))
    np.testing.assert_array_equal(sheet[2:34, 36:68], read("2.exr"))
    recipe = oiio.ImageInput.open("1.exr").spec().get_string_attribute("shrm:recipe")
    assert "roughness" not in json.loads(recipe)
    assert "roughness" not in json.loads(done("spot.exr", "-o", "1.exr", "--json"))


def test_a_roughness_that_a_map_was_not_made_for_is_warned_of(folder):
    white_split_sum(0.6, 1.0).save("rough.exr")
    arguments = ["rough.exr", "-o", "x.png", "--size", "16"]
    result = CliRunner().invoke(render, arguments)
    warning = "Warning: rough.exr: it was made for roughness 0.6 .. 1, not 0.5\n"
    assert (result.exit_code, result.stderr) == (0, warning)
    assert CliRunner().invoke(render, [*arguments, "--quiet"]).stderr == ""
    assert done(*arguments, "--roughness", 0.6) != ""


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ["spot.exr", "--roughness", "0.5"],
            "--roughness applies to split sums and SH exponentials",
        ),
        (["spot.exr", "spot.exr", "--f0", "1"], "--f0 applies to split sums and SH exponentials"),
        (["white.exr", "--roughness", "0.04"], "--roughness"),
        (["white.exr", "--roughness", "1.1"], "--roughness"),
        (["white.exr", "--roughness", "nan"], "--roughness"),
        (["white.exr", "--f0", "1.5"], "f0=1.5 is outside 0 .. 1"),
        (["white.exr", "--f0", "nan"], "--f0"),
        (["white.exr", "--f0", "1/1"], "f0=1/1 has 2 channels; give R/G/B"),
        (["white.exr", "--f0", "1,1,1"], "'1,1,1' is not a colour such as 0.04, 1/0.78/0.34"),
        (["white.exr", "--f0", "1,roughness=1"], "is not a colour"),
        (["white.exr", "--f0", ""], "is not a colour"),
        (["white.exr", "--f0", "gould"], "did you mean gold?"),
    ],
)
def test_wrong_usage_of_the_surface(folder, arguments, message):
    white_split_sum(0.0, 1.0).save("white.exr")
    before = files(folder)
    result = run(*arguments)
    assert result.exit_code == 2
    assert message in " ".join(result.stderr.split())
    assert files(folder) == before
