"""`shrm compare`: numbers, the picture, what is told, and bad input."""

import json
import math
import os
import re
import shutil
from importlib import import_module

import numpy as np
import OpenImageIO as oiio
import pytest

from shrm_cli.files.image import write_image
from shrm_cli.files.png import encode_srgb
from shrm_cli.maps.file import open_map
from shrm_cli.maps.info import MapInfo
from shrm_cli.maps.shrm.shrm import Shrm
from shrm_cli.probe.open import open_probe
from shrm_cli.render.camera import Viewer, sphere_coverage
from shrm_cli.render.sphere import render_sphere
from tests.brute_force import latlong_samples, phong, reflected
from tests.cli.helpers import (
    MAIN,
    NO_MODULES,
    assert_refused,
    done,
    noise,
    polynomial_light,
    process,
    run,
    snapshot,
    write_exr,
)
from tests.makers import prefilter_irradiance, prefilter_split_sum
from tests.oracles import latlong_pixels
from tests.render.materials import furnace

P3 = (0.68, 0.32, 0.265, 0.69, 0.15, 0.06, 0.3127, 0.329)
SPEC = "phong:exponent=8"
SMALL = ["--size", 16, "--no-picture"]
TRUE = [*SMALL, "--view", "40,20"]
"""One view instead of three, for truths, which are sums over all directions at each point."""
SUMMED = [*TRUE, "--exact"]
"""A sum over few pixels, for what does not depend on how a truth is found."""


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """A probe, and maps of it: fine and coarse, yawed, of another BRDF; another probe's map."""
    folder = tmp_path_factory.mktemp("compare")
    directions = latlong_pixels(32, 16)
    write_exr(folder / "room.exr", polynomial_light(directions).astype(np.float32))
    write_exr(folder / "noise.exr", noise())
    fine = ["--eps", 0.001, "--size", 32, "--precision", "float"]
    for name, probe, spec, *options in [
        ("fine", "room", SPEC, *fine),
        ("coarse", "room", SPEC, "--order-f", 1),
        ("yawed", "room", SPEC, "--yaw", 90, *fine),
        ("matte", "room", "lambertian", *fine),
        ("noisy", "noise", SPEC),
    ]:
        output = folder / f"{name}.map.exr"
        result = run("prefilter", folder / f"{probe}.exr", "--brdf", spec, "-o", output, *options)
        assert result.code == 0, result.err
    return folder


@pytest.fixture
def folder(files, tmp_path, monkeypatch):
    """Current folder with the files."""
    for path in files.iterdir():
        (tmp_path / path.name).write_bytes(path.read_bytes())
    monkeypatch.chdir(tmp_path)
    return tmp_path


def strict(text):
    """JSON as its standard has it, without NaN and infinities."""

    def refuse(name):
        raise AssertionError(name)

    return json.loads(text, parse_constant=refuse)


def told(*arguments):
    """JSON of a command that may warn."""
    result = run("compare", *arguments, "--json")
    assert result.code == 0, result.err
    return strict(result.out)


def read(path):
    image = oiio.ImageBuf(str(path))
    return image.get_pixels(image.spec().format)


def by_formula(name, other, view, size):
    """RMSE, relative RMSE, maximum and PSNR of pictures of two maps."""
    right = np.arange(size) + 0.5 - size / 2
    weights = sphere_coverage(size, *np.meshgrid(right, right))[..., None]
    inside = weights[..., 0] > 0
    found, expected = (
        (render_sphere(open_map(path), Viewer(*view), size) / np.maximum(weights, 1e-300))[inside]
        for path in (other, name)
    )
    weights = weights[inside] / weights.sum() / 3
    rmse = math.sqrt((weights * (found - expected) ** 2).sum())
    scale = math.sqrt((weights * expected**2).sum())
    largest = np.abs(found - expected).max()
    return [rmse, rmse / scale, largest, 20 * math.log10(expected.max() / rmse)]


def test_a_map_compared_with_itself_says_zero(folder):
    value = strict(done("compare", "fine.map.exr", "fine.map.exr", *SMALL, "--json"))
    errors = ("rmse", "relative_rmse", "maximum", "median_relative_error", "p95_relative_error")
    shares = "wrong_share", "negative_share"
    zero = {**dict.fromkeys((*errors, *shares, "hdr_flip"), 0), "psnr": None}
    maps = [{"file": "fine.map.exr", **zero}]
    assert value["baseline"] == "fine.map.exr"
    assert [each["view"] for each in value["views"]] == [[0, 0], [120, 20], [240, -20]]
    assert [each["maps"] for each in value["views"]] == [maps] * 3
    assert value["summary"] == maps
    assert value["picture"] is None
    assert value["warnings"] == []


def test_a_yawed_probes_map_is_not_the_same(folder):
    (summary,) = told("fine.map.exr", "yawed.map.exr", *SMALL)["summary"]
    assert summary["relative_rmse"] > 0.1
    assert summary["psnr"] < 30


def test_numbers_of_each_view(folder):
    options = ["--view", "30,10", "--view", "-100,-50", "--size", 40, "--exposure", 3]
    value = told("fine.map.exr", "coarse.map.exr", "yawed.map.exr", *options)
    assert (value["size"], value["probe"]) == (40, None)
    assert [each["view"] for each in value["views"]] == [[30, 10], [-100, -50]]
    keys = ["rmse", "relative_rmse", "maximum", "psnr"]
    for each in value["views"]:
        assert [row["file"] for row in each["maps"]] == ["coarse.map.exr", "yawed.map.exr"]
        for row in each["maps"]:
            expected = by_formula("fine.map.exr", row["file"], each["view"], 40)
            np.testing.assert_allclose([row[key] for key in keys], expected, rtol=1e-5)
    for index, row in enumerate(value["summary"]):
        squares = [each["maps"][index]["rmse"] ** 2 for each in value["views"]]
        assert row["rmse"] == pytest.approx(math.sqrt(sum(squares) / 2))
        assert row["maximum"] == max(each["maps"][index]["maximum"] for each in value["views"])


def test_table(folder):
    furnace((1, 1, 1)).save("one.exr", "float")
    furnace((1, 1, 1.5)).save("two.exr", "float")
    furnace((0, 0, 0)).save("a.black.one.exr", "float")
    views = ["--view", "0,0", "--view", "-33.5,10"]
    lines = done("compare", "one.exr", "two.exr", "a.black.one.exr", *views, *SMALL).splitlines()
    columns = "RMSE  relative  median     p95   >5%    <0   FLIP  max     PSNR"
    # The luminance of (1, 1, 1.5) is 1 + 0.5 * 0.0722. What FLIP says is another test's matter.
    two = "0.2887    28.87%    3.6%    3.6%    0%  0.0%  FLIP?  0.5  10.8 dB  two"
    black = "     1   100.00%  100.0%  100.0%  100%  0.0%  FLIP?    1   0.0 dB  a.black.one"
    lines = [re.sub(r" 0\.\d{3} ", " FLIP? ", line) for line in lines]
    assert lines == [
        "compared with one.exr",
        "view        " + columns + "  map",
        "0,0       " + two,
        "0,0       " + black,
        "-33.5,10  " + two,
        "-33.5,10  " + black,
        "all       " + two,
        "all       " + black,
    ]
    out = done("compare", "a.black.one.exr", "two.exr", "a.black.one.exr", *SMALL)
    cells = [line.split() for line in out.splitlines()[-2:]]
    assert cells[0] == [
        *("all", "1.19", "inf", "inf", "inf", "100%", "0.0%", "-", "1.5", "-inf", "dB", "two")
    ]
    assert cells[1] == [
        *("all", "0", "0.00%", "0.0%", "0.0%", "0%", "0.0%", "-", "0", "inf", "dB", "a.black.one")
    ]
    value = told("a.black.one.exr", "two.exr", *SMALL)
    assert value["views"][0]["flip_exposures"] is None
    for key in ("relative_rmse", "psnr", "median_relative_error", "p95_relative_error", "hdr_flip"):
        assert value["summary"][0][key] is None, key


def of_luminance(name, other, views, size):
    """Median, p95 and share above 5 % of the relative error, share of negatives, of two maps.

    A pixel counts as often as thousandths of it are covered.
    """
    right = np.arange(size) + 0.5 - size / 2
    weights = sphere_coverage(size, *np.meshgrid(right, right))
    inside = weights > 0
    shown, true = (
        np.concatenate([
            render_sphere(open_map(path), Viewer(*view), size)[inside] @ [0.2126, 0.7152, 0.0722]
            for view in views
        ]) / np.tile(weights[inside], len(views))
        for path in (other, name)
    )  # fmt: skip
    often = np.tile(np.round(1000 * weights[inside]).astype(int), len(views))
    shown, true = np.repeat(shown, often), np.repeat(true, often)
    errors = np.abs(shown - true) / np.maximum(true, 0.02 * true.mean())
    median, p95 = np.percentile(errors, [50, 95])
    return [median, p95, np.mean(errors > 0.05), np.mean(shown < 0)]


@pytest.mark.slow
def test_what_is_seen_of_each_view_and_of_all(folder):
    views = [[30, 10], [-100, -50]]
    options = ["--view", "30,10", "--view", "-100,-50", "--size", 40, "--no-picture"]
    names = ["fine.map.exr", "coarse.map.exr"]
    value = told("noisy.map.exr", *names, *options)
    keys = ["median_relative_error", "p95_relative_error", "wrong_share", "negative_share"]
    for index, name in enumerate(names):
        for view, each in zip(views, value["views"], strict=True):
            expected = of_luminance("noisy.map.exr", name, [view], 40)
            row = each["maps"][index]
            np.testing.assert_allclose([row[key] for key in keys], expected, rtol=0.01, atol=1e-3)
        expected = of_luminance("noisy.map.exr", name, views, 40)
        row = value["summary"][index]
        np.testing.assert_allclose([row[key] for key in keys], expected, rtol=0.01, atol=1e-3)
        assert expected[1] > 1.2 * expected[0] > 0.01


def test_flip_and_its_exposures(folder):
    evaluator = pytest.importorskip("flip_evaluator")
    options = ["--view", "30,10", "--view", "-100,-50", "--size", 40, "--no-picture"]
    names = ["coarse.map.exr", "yawed.map.exr"]
    value = told("fine.map.exr", *names, *options)
    right = np.arange(40) + 0.5 - 20
    weights = sphere_coverage(40, *np.meshgrid(right, right))
    for each in value["views"]:
        truth, *shown = (
            np.maximum(render_sphere(open_map(path), Viewer(*each["view"]), 40), 0)
            for path in ("fine.map.exr", *names)
        )
        for row, picture in zip(each["maps"], shown, strict=True):
            errors, _, chosen = evaluator.evaluate(
                truth, picture, "HDR", applyMagma=False, parameters={}
            )
            expected = np.average(errors[..., 0], weights=weights)
            assert row["hdr_flip"] == pytest.approx(expected, abs=1e-5)
            exposures = [chosen[key] for key in ("startExposure", "stopExposure", "numExposures")]
            assert list(each["flip_exposures"]) == ["start", "stop", "number"]
            assert list(each["flip_exposures"].values()) == pytest.approx(exposures, abs=1e-4)
    for index, row in enumerate(value["summary"]):
        of_views = [each["maps"][index]["hdr_flip"] for each in value["views"]]
        assert row["hdr_flip"] == pytest.approx(sum(of_views) / 2)
        assert row["hdr_flip"] > 0.01


HINT = "flip-evaluator is not installed, so HDR-FLIP is left out; pip install flip-evaluator"


@pytest.mark.parametrize(("options", "hints"), [([], [HINT]), (["--no-flip"], [])])
def test_without_flip_its_column_is_left_out(folder, monkeypatch, options, hints):
    monkeypatch.setattr(import_module("shrm_cli.render.seen"), "can_flip", lambda: False)
    result = run("compare", "fine.map.exr", "coarse.map.exr", *SMALL, *options)
    assert result.code == 0
    assert result.err.splitlines() == [f"Warning: {hint}" for hint in hints]
    header = result.out.splitlines()[1].split()
    assert header == ["view", "RMSE", "relative", "median", "p95", ">5%", "<0", "max",
                      "PSNR", "map"]  # fmt: skip
    value = told("fine.map.exr", "coarse.map.exr", *SMALL, *options)
    assert value["warnings"] == hints
    assert value["summary"][0]["hdr_flip"] is None
    assert [each["flip_exposures"] for each in value["views"]] == [None] * 3
    assert value["summary"][0]["p95_relative_error"] > 0


@pytest.mark.parametrize("option", ["--no-flip", "--quiet"])
def test_flip_is_not_loaded_unless_it_is_needed(folder, option):
    code = (
        "import sys\nsys.argv = ['shrm', 'compare', 'fine.map.exr', 'coarse.map.exr', "
        f"'--size', '16', '--no-picture', '{option}']\n"
        "from shrm_cli.cli.main import main\n"
        "try:\n    main()\nexcept SystemExit as end:\n    assert not end.code\n"
        "assert 'flip_evaluator' not in sys.modules"
    )
    found = process(code=code)
    assert (found.code, found.err) == (0, "")


def test_the_table_fits_into_a_hundred_columns(folder):
    furnace((12, 34, 5)).save("city.microfacet.shrm.exr")
    out = done("compare", "noisy.map.exr", "city.microfacet.shrm.exr", *SMALL)
    assert out.splitlines()[-1].endswith("city.microfacet.shrm")
    assert "240,-20" in out
    assert max(len(line) for line in out.splitlines()) <= 100


def test_picture_has_a_row_for_each_view(folder):
    options = ["--size", 32, "--view", "0,0", "--view", "90,5", "--exposure", -1, "--amplify", 3]
    out = done("compare", "fine.map.exr", "coarse.map.exr", *options)
    assert out.splitlines()[-1] == "compare.png: 104 x 110, 8-bit sRGB"
    out = done("compare", "fine.map.exr", "coarse.map.exr", *options, "-o", "c.exr")
    assert out.splitlines()[-1] == "c.exr: 104 x 110, half"
    assert told("fine.map.exr", "coarse.map.exr", *options, "-o", "c.exr")["picture"] == "c.exr"
    linear, shown = read("c.exr"), read("compare.png").astype(int)
    assert np.abs(encode_srgb(linear).astype(int) - shown).max() <= 1
    fine, coarse = open_map("fine.map.exr"), open_map("coarse.map.exr")
    for row, view in [(2, (0, 0)), (56, (90, 5))]:
        tiles = [linear[row : row + 32, left : left + 32] for left in (2, 36, 70)]
        first, second = (render_sphere(each, Viewer(*view), 32) for each in (fine, coarse))
        np.testing.assert_allclose(tiles[0], first / 2, rtol=2e-3, atol=1e-3)
        np.testing.assert_allclose(tiles[1], second / 2, rtol=2e-3, atol=1e-3)
        np.testing.assert_allclose(tiles[2], 1.5 * np.abs(second - first), rtol=2e-3, atol=1e-3)
        assert linear[row + 32 : row + 52].max() > 0.5  # labels


def test_exr_remembers_what_was_compared(folder):
    info = MapInfo(0, 0, 0.03, 1.0, 0.0, chromaticities=P3)
    wide = Shrm(np.ones((24, 4, 1, 3), np.float32), "global", "reflection", info)
    (folder / "in").mkdir()
    wide.save("in/wide.exr")
    view = ["--size", 16, "--view", "5,6"]
    done("compare", "in/wide.exr", "in/wide.exr", "-o", "one.exr", *view, "--amplify", 2)
    done("compare", "in/wide.exr", "fine.map.exr", "-o", "two.exr", *view)
    specs = [oiio.ImageInput.open(name).spec() for name in ("one.exr", "two.exr")]
    assert json.loads(specs[0].get_string_attribute("shrm:recipe")) == {
        "compare": ["wide.exr", "wide.exr"],
        "probe": None,
        "views": [[5, 6]],
        "brdf": {},
        "size": 16,
        "exposure": 0,
        "amplify": 2,
    }
    for spec in specs:  # the other map is shown in the primaries of the first one
        np.testing.assert_allclose(spec.getattribute("chromaticities"), P3, rtol=1e-6)


def test_maps_of_the_same_name_have_labels_with_their_folders(folder, monkeypatch):
    for name in ("x", "y"):
        (folder / name).mkdir()
        furnace((1, 1, 1)).save(f"{name}/map.EXR")
    found = []

    def note(self, first, names, *numbers):
        found.append([first, *names])
        return np.zeros((4, 4, 3), np.float32)

    monkeypatch.setattr(import_module("shrm_cli.render.comparison").Comparison, "picture", note)
    options = ["--size", 16, "--view", "0,0", "--no-flip"]
    assert run("compare", "x/map.EXR", "y/map.EXR", *options).code == 0
    assert run("compare", "x/map.EXR", "fine.map.exr", *options).code == 0
    assert run("compare", "x/map.EXR", "x/map.EXR", *options).code == 0
    truth = ["--probe", "room.exr", "--brdf", SPEC, "--exact"]
    assert run("compare", "fine.map.exr", *truth, *options).code == 0
    assert found == [["x/map", "y/map"], ["map", "fine.map"], ["map", "map"], ["truth", "fine.map"]]


def test_same_bytes_twice_and_nothing_printed(folder):
    arguments = ["compare", "fine.map.exr", "coarse.map.exr", "--size", 16, "--quiet"]
    assert done(*arguments) == ""
    first = (folder / "compare.png").read_bytes()
    assert done(*arguments) == ""
    assert (folder / "compare.png").read_bytes() == first


def test_truth_of_a_probe(folder):
    value = strict(
        done("compare", "fine.map.exr", "coarse.map.exr", "--probe", "room.exr", *TRUE, "--json")
    )
    assert value["baseline"] == "truth"
    assert value["probe"] == "room.exr"
    assert value["brdf"] == {"name": "phong", "parameters": {"exponent": 8}}
    fine, coarse = value["summary"]
    assert fine["relative_rmse"] < 0.01
    assert coarse["relative_rmse"] > 3 * fine["relative_rmse"]
    out = done("compare", "fine.map.exr", "--probe", "room.exr", "--brdf", SPEC, *TRUE)
    first = "compared with truth of room.exr, summed adaptively, 95 % within "
    assert out.splitlines()[0].startswith(first)
    assert f"{fine['rmse']:.4g}" in out.splitlines()[-1]


def test_truth_obeys_the_options_of_the_probe(folder):
    yawed = told("yawed.map.exr", "--probe", "room.exr", "--yaw", 90, *SUMMED)["summary"][0]
    assert yawed["relative_rmse"] < 0.01
    wrong = told("yawed.map.exr", "--probe", "room.exr", *SUMMED)["summary"][0]
    assert wrong["relative_rmse"] > 0.1
    rough = told("fine.map.exr", "--probe", "room.exr", "--source-height", 4, *SUMMED)["summary"][0]
    assert 0.003 < rough["relative_rmse"] < 0.2


def test_truth_against_brute_force(folder):
    """Black differs from the truth by all of the truth: its mean square over the disc."""
    furnace((0, 0, 0)).save("black.exr")
    options = ["--brdf", SPEC, "--view", "40,20", "--size", 24, "--no-picture"]
    found = told("black.exr", "--probe", "room.exr", *options)["summary"][0]
    azimuth, elevation = np.radians([40, 20])
    right = np.array([np.cos(azimuth), 0, -np.sin(azimuth)])
    view = np.array([np.sin(azimuth), 0, np.cos(azimuth)]) * np.cos(elevation)
    view[1] = np.sin(elevation)
    up = np.cross(view, right)
    light, weights = latlong_samples(48)  # so many that the sum is the integral
    radiance, rho_hat = polynomial_light(light), phong(8)
    values = []
    steps = (np.arange(24) + 0.5) / 12 - 1
    for x, y in np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2):
        if x * x + y * y < 1:
            normal = x * right + y * up + np.sqrt(1 - x * x - y * y) * view
            reflection = 2 * (normal @ view) * normal - view
            values.append(reflected(rho_hat, reflection, view, light, weights, radiance))
    assert found["rmse"] == pytest.approx(np.sqrt(np.mean(np.square(values))), rel=0.01)
    assert found["maximum"] == pytest.approx(np.max(values), rel=0.01)
    assert found["relative_rmse"] == pytest.approx(1)


def test_unlike_maps_are_warned_of(folder):
    result = run("compare", "fine.map.exr", "noisy.map.exr", "matte.map.exr", *SMALL)
    assert result.code == 0
    assert result.err.splitlines() == [
        "Warning: noisy.map.exr: its probe is not that of fine.map.exr",
        "Warning: matte.map.exr: its BRDF is lambertian:albedo=1, not phong:exponent=8",
    ]
    truth = ["--probe", "room.exr", "--brdf", SPEC]
    result = run("compare", "fine.map.exr", "noisy.map.exr", "matte.map.exr", *truth, *SUMMED)
    assert result.err.splitlines() == [
        "Warning: noisy.map.exr: its probe is not room.exr",
        "Warning: matte.map.exr: its BRDF is lambertian:albedo=1, not phong:exponent=8",
    ]
    value = told("fine.map.exr", "noisy.map.exr", *truth, *SUMMED)
    assert value["warnings"] == ["noisy.map.exr: its probe is not room.exr"]
    quiet = run("compare", "fine.map.exr", "noisy.map.exr", *SMALL, "--quiet")
    assert (quiet.out, quiet.err) == ("", "")


def test_warnings_of_the_probe_are_told(folder):
    pixels = noise()
    pixels[2, 3] = -1
    write_exr("negative.exr", pixels)
    result = run("compare", "noisy.map.exr", "--probe", "negative.exr", *SUMMED)
    assert result.err.startswith("Warning: negative.exr: 1 pixel with negative radiance")


def test_progress_of_the_truth(folder, monkeypatch):
    bars = {}

    class Bar:
        def __init__(self, label):
            self.seen = bars.setdefault(label, [])

        def __enter__(self):
            return lambda done, total: self.seen.append((done, total))

        def __exit__(self, *error):
            return None

    monkeypatch.setattr("shrm_cli.cli.compare.progress_bar", Bar)
    views = ["--view", "0,0", "--view", "90,5"]
    done("compare", "fine.map.exr", "--probe", "room.exr", *SMALL, *views)
    assert bars["flipping"] == [(1, 2), (2, 2)]
    seen = bars["comparing"]
    (total,) = {total for _, total in seen}
    steps = [steps for steps, _ in seen]
    assert steps == sorted(steps)
    assert steps[-1] == total
    assert len(set(steps)) > 6  # within views too


REFUSED = {
    "missing map": (["fine.map.exr", "no.exr"], "no.exr: no such file"),
    "no map": (["fine.map.exr", "room.exr"], "room.exr: an image, but not a map"),
    "missing probe": (["fine.map.exr", "--probe", "no.exr"], "no.exr: no such file"),
    "unlike maps": (
        ["fine.map.exr", "matte.map.exr", "--probe", "room.exr"],
        "matte.map.exr: its BRDF is lambertian:albedo=1, but that of fine.map.exr is "
        "phong:exponent=8; give --brdf",
    ),
    "no such BRDF": (["fine.map.exr", "--probe", "room.exr", "--brdf", "fong"], "'fong'", "phong"),
    "no BRDF": (["plain.exr", "--probe", "room.exr"], "plain.exr: its BRDF", "give --brdf"),
    "onto a map": (["fine.map.exr", "coarse.map.exr", "-o", "coarse.map.exr"], "overwrite"),
    "onto the probe": (["fine.map.exr", "--probe", "room.exr", "-o", "room.exr"], "overwrite"),
    "jpeg": (["fine.map.exr", "coarse.map.exr", "-o", "x.jpg"], "x.jpg", ".png or .exr"),
    "no folder": (["fine.map.exr", "coarse.map.exr", "-o", "no/x.png"], "there is no folder no"),
    "too large": (["fine.map.exr"] * 12 + ["--size", 2048], "give a smaller --size or fewer maps"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refused_in_one_line_before_anything_is_written(folder, case):
    arguments, *parts = REFUSED[case]
    furnace((1, 1, 1)).save("plain.exr")
    before = snapshot(folder)
    assert_refused(run("compare", *arguments), 1, *parts)
    assert snapshot(folder) == before


def test_folder_without_permission(folder, monkeypatch):
    # The tests may run as root, whom no permission stops.
    monkeypatch.setattr("os.access", lambda path, mode: mode == os.R_OK)
    assert_refused(run("compare", "fine.map.exr", "coarse.map.exr"), 1, "compare.png", "permission")


def test_values_that_no_float_holds(folder):
    furnace((5e37, 1, 1)).save("bright.exr", "float")
    before = snapshot(folder)
    arguments = ["bright.exr", "fine.map.exr", "--size", 16, "-o", "x.exr"]
    assert_refused(run("compare", *arguments, "--exposure", 4), 1, "x.exr", "not finite in 32-bit")
    assert snapshot(folder) == before
    assert told("bright.exr", "fine.map.exr", *SMALL)["summary"][0]["rmse"] > 1e37


@pytest.mark.proof
@pytest.mark.parametrize("name", ["x.png", "x.exr"])
def test_full_disk(folder, name):
    before = snapshot(folder)
    limited = f"{NO_MODULES}; import resource as r; r.setrlimit(r.RLIMIT_FSIZE, (900, 900)); {MAIN}"
    result = process("compare", "fine.map.exr", "coarse.map.exr", "-o", name, code=limited)
    assert_refused(result, 1, f"Error: {name}: cannot be written (")
    assert snapshot(folder) == before


USAGE = {
    "nothing": ([], "MAP..."),
    "one map": (["fine.map.exr"], "name another, or give --probe"),
    "BRDF alone": (["a", "b", "--brdf", "phong"], "--brdf applies with --probe; leave it out"),
    "height alone": (
        ["a", "b", "--source-height", 9],
        "--source-height applies with --probe; leave",
    ),
    "yaw alone": (["a", "b", "--yaw", 0], "--yaw applies with --probe; leave it out"),
    "two wishes": (["a", "b", "-o", "x.png", "--no-picture"], "--no-picture exclude each other"),
    "view": (["a", "b", "--view", "0"], "--view"),
    "elevation": (["a", "b", "--view", "0,91"], "--view"),
    "small": (["a", "b", "--size", 15], "--size"),
    "large": (["a", "b", "--size", 2049], "--size"),
    "exposure": (["a", "b", "--exposure", "nan"], "--exposure"),
    "bright": (["a", "b", "--exposure", 33], "--exposure"),
    "factor nan": (["a", "b", "--amplify", "nan"], "--amplify"),
    "factor inf": (["a", "b", "--amplify", "inf"], "--amplify"),
    "factor zero": (["a", "b", "--amplify", 0], "--amplify"),
    "source": (["a", "b", "--source-height", 1], "--source-height"),
    "clamp": (["fine.map.exr", "--probe", "room.exr", "--clamp", "nan"], "--clamp"),
}


@pytest.mark.parametrize("case", USAGE)
def test_wrong_usage(folder, case):
    arguments, part = USAGE[case]
    before = snapshot(folder)
    assert_refused(run("compare", *arguments), 2, part)
    assert snapshot(folder) == before


def test_a_broken_picture_leaves_the_old_one(folder):
    write_image("compare.exr", noise())
    furnace((5e37, 1, 1)).save("bright.exr", "float")
    before = snapshot(folder)
    arguments = ["bright.exr", "fine.map.exr", "--size", 16, "--exposure", 4, "-o", "compare.exr"]
    assert_refused(run("compare", *arguments), 1, "compare.exr")
    assert snapshot(folder) == before


ROUGH = ["--roughness", 0.7, "--f0", "1/0.5/0.04"]


@pytest.fixture(scope="module")
def white(tmp_path_factory):
    """Maps of white light of radiance 2: a split sum, irradiance, and an SHRM of GGX."""
    folder = tmp_path_factory.mktemp("white")
    white = write_exr(folder / "white.exr", np.full((16, 32, 3), 2, np.float32))
    probe = open_probe(white)
    prefilter_split_sum(probe, (0.5, 0.7, 1.0), size=8).map.save(folder / "white.splitsum.exr")
    prefilter_irradiance(probe).map.save(folder / "white.irradiance.exr")
    done("prefilter", white, "--brdf", "ggx:f0=1/0.5/0.04,roughness=0.7", "-o", folder / "ggx.exr",
         "--order-f", 16, "--order-p", 8, "--quiet")  # fmt: skip
    return folder


@pytest.fixture
def engines(white, tmp_path, monkeypatch):
    """Current folder with the maps of white light."""
    shutil.copytree(white, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.slow
@pytest.mark.proof
def test_the_truth_of_a_split_sum_is_ggx_of_that_surface(engines):
    """White light is prefiltered exactly: scale and bias give all that GGX reflects."""
    truth = ["--probe", "white.exr", *TRUE]
    value = strict(done("compare", "white.splitsum.exr", *truth, *ROUGH, "--json"))
    assert value["brdf"] == {"name": "ggx", "parameters": {"roughness": 0.7, "f0": [1, 0.5, 0.04]}}
    assert (value["roughness"], value["f0"]) == (0.7, [1, 0.5, 0.04])
    assert value["summary"][0]["relative_rmse"] < 0.002
    for other in ("ggx:roughness=0.5,f0=1/0.5/0.04", "ggx:roughness=0.7"):
        result = run("compare", "white.splitsum.exr", *truth, *ROUGH, "--brdf", other, "--json")
        assert strict(result.out)["summary"][0]["relative_rmse"] > 0.03
        assert "white.splitsum.exr: its BRDF is ggx:roughness=0.7,f0=1/0.5/0.04, not" in result.err
    defaults = strict(done("compare", "white.splitsum.exr", *truth, "--roughness", 0.5, "--json"))
    assert defaults["brdf"] == {"name": "ggx", "parameters": {"roughness": 0.5, "f0": 1}}
    assert defaults["f0"] == [1, 1, 1]


@pytest.mark.slow
def test_split_sums_beside_an_shrm_of_the_same_surface(engines):
    pair = ["white.splitsum.exr", "ggx.exr"]
    value = strict(done("compare", *pair, "--probe", "white.exr", *SUMMED, *ROUGH, "--json"))
    assert [row["file"] for row in value["summary"]] == pair
    assert max(row["relative_rmse"] for row in value["summary"]) < 0.1
    assert value["warnings"] == []
    alone = strict(done("compare", *pair, *SMALL, *ROUGH, "--json"))
    assert alone["baseline"] == "white.splitsum.exr"
    assert alone["brdf"]["parameters"]["roughness"] == 0.7
    assert alone["summary"][0]["relative_rmse"] < 0.1
    assert_refused(
        run("compare", *pair, "--probe", "white.exr", *SMALL, "--roughness", 0.5),
        1,
        "ggx.exr: its BRDF is ggx:f0=1/0.5/0.04,roughness=0.7, but that of white.splitsum.exr is "
        "ggx:roughness=0.5,f0=1; give --brdf, or another --roughness and --f0",
    )
    outside = run("compare", *pair, *SMALL, *ROUGH[2:], "--roughness", 0.3)
    assert outside.err.splitlines() == [
        "Warning: white.splitsum.exr: it was made for roughness 0.5 .. 1, not 0.3",
        "Warning: ggx.exr: its BRDF is ggx:f0=1/0.5/0.04,roughness=0.7, not "
        "ggx:roughness=0.3,f0=1/0.5/0.04",
    ]


def test_the_truth_of_irradiance_is_white_and_diffuse(engines):
    value = strict(done("compare", "white.irradiance.exr", "--probe", "white.exr", *TRUE, "--json"))
    assert value["brdf"] == {"name": "lambertian", "parameters": {"albedo": 1}}
    assert value["summary"][0]["relative_rmse"] < 0.01
    assert "roughness" not in value
    assert value["summary"][0]["maximum"] < 0.02


def test_the_surface_is_in_the_recipe(engines):
    pair = ["white.splitsum.exr", "white.splitsum.exr"]
    done("compare", *pair, "--size", 16, "-o", "x.exr", *ROUGH)
    spec = oiio.ImageInput.open("x.exr").spec()
    recipe = json.loads(spec.get_string_attribute("shrm:recipe"))
    assert (recipe["roughness"], recipe["f0"]) == (0.7, [1, 0.5, 0.04])


SURFACE = {
    "roughness of none": (["fine.map.exr", "coarse.map.exr", "--roughness", 0.5], "and no MAP is"),
    "f0 of none": (["fine.map.exr", "coarse.map.exr", "--f0", 1], "--f0 applies to split sums"),
    "range": (["a", "b", "--roughness", "0.5..1"], "--roughness applies as a range with --rep"),
    "falling": (["a", "b", "--roughness", "1..0.5"], "does not rise"),
    "smooth": (["a", "b", "--roughness", 0.01], "--roughness"),
    "f0": (["a", "b", "--f0", "2"], "f0=2 is outside 0 .. 1"),
    "eps": (["a", "b", "--eps", 0.1], "--eps applies with --representations"),
    "steps": (["a", "b", "--steps", 3], "--steps applies with --representations"),
}


@pytest.mark.parametrize("case", SURFACE)
def test_wrong_usage_of_the_surface(folder, case):
    arguments, part = SURFACE[case]
    before = snapshot(folder)
    assert_refused(run("compare", *arguments), 2, part)
    assert snapshot(folder) == before


@pytest.mark.parametrize("options", [["--no-picture"], ["--no-picture", "--json"]])
def test_values_near_the_end_of_the_range(folder, options):
    """Differences of 3e38 are beyond 32-bit floats, of which JSON has no infinity."""
    huge = np.full((24, 4, 9, 3), 3e38, np.float32)
    Shrm(huge, "global", "reflection", MapInfo(0, 2, 0.1, 0.9, 0.1)).save("huge.exr")
    for maps in (["huge.exr", "coarse.map.exr"], ["coarse.map.exr", "huge.exr"]):
        found = run("compare", *maps, "--size", 16, "--no-flip", *options)
        assert found.code == 0
        assert f"Warning: {maps[1]}: its values, or those that it is compared with" in found.err
        if "--json" in options:
            assert strict(found.out)["summary"][0]["rmse"] is None
        else:
            assert " inf " in found.out
