"""`shrm reference`: files, names, settings and errors."""

import json

import numpy as np
import pytest

from shrm_cli.brdf.spec import parse_spec
from shrm_cli.probe.open import open_probe
from shrm_cli.probe.options import ReadOptions
from shrm_cli.reference import Reference
from shrm_cli.render.camera import Viewer
from shrm_cli.render.sphere import render_sphere
from tests import brute_force
from tests.cli.helpers import (
    assert_refused,
    done,
    noise,
    polynomial_light,
    process,
    read_exr,
    run,
    snapshot,
    told_to_bars,
    write_exr,
)

P3 = (0.68, 0.32, 0.265, 0.69, 0.15, 0.06, 0.3127, 0.329)
QUICK = ["--brdf", "microfacet:sigma=0.3", "--size", 16]
SUMMED = [*QUICK, "--exact"]
"""A sum over few pixels, for what does not depend on how a truth is found."""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    write_exr(tmp_path / "noise.exr", noise(), chromaticities=P3)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def picture(path):
    header, channels = read_exr(path)
    return header, np.stack([channels[c] for c in "RGB"], axis=-1)


def test_default_is_an_exr_beside_us(folder):
    out = done("reference", "noise.exr", "--brdf", "phong:exponent=9", "--size", 24)
    told, error = out.rsplit(" within ", 1)
    assert 0 < float(error.removesuffix("%\n")) < 1
    assert told == (
        "noise.phong-exponent-9.reference.exr: 24 x 24, half\n"
        "  BRDF           phong:exponent=9\n"
        "  view           azimuth 0, elevation 0\n"
        "  source         512 pixels of noise.exr\n"
        "  truth          summed adaptively, 95 %"
    )
    header, pixels = picture("noise.phong-exponent-9.reference.exr")
    truth = Reference(open_probe("noise.exr"), parse_spec("phong:exponent=9"))
    np.testing.assert_allclose(pixels, render_sphere(truth, Viewer(), 24), rtol=1e-3, atol=1e-5)
    np.testing.assert_allclose(header["chromaticities"], P3, rtol=1e-6)
    assert json.loads(header["shrm:recipe"])["reference"]["probe"] == "noise.exr"


def test_a_pixel_is_an_integral_over_the_whole_sphere(folder):
    """The middle of an odd picture: N = R = V. Its light is smooth, so the rule is exact enough."""
    directions, weights = brute_force.latlong_samples(64)
    light = polynomial_light(directions)
    write_exr("smooth.exr", light.reshape(64, 128, 3).astype(np.float32))
    done("reference", "smooth.exr", "--brdf", "microfacet:sigma=0.3", "--view", "50,30",
         "--size", 17, "--exposure", 2, "--precision", "float", "-o", "x.exr")  # fmt: skip
    a, e = np.radians([50, 30])
    view = np.array([np.sin(a) * np.cos(e), np.sin(e), np.cos(a) * np.cos(e)])
    expected = brute_force.reflected(
        brute_force.microfacet(0.3), view, view, directions, weights, light
    )
    np.testing.assert_allclose(picture("x.exr")[1][8, 8], 4 * expected, rtol=1e-3)


def test_settings_reach_the_integral(folder):
    arguments = ["--view", "70,-20", "--yaw", 40, "--source-height", 8, "--exposure", -1]
    value = json.loads(
        done(
            "reference",
            "noise.exr",
            *QUICK,
            *arguments,
            "-o",
            "x.exr",
            "--precision",
            "float",
            "--json",
        )
    )
    probe = open_probe("noise.exr", ReadOptions(yaw=40))
    truth = Reference(probe, parse_spec("microfacet:sigma=0.3"), 8)
    header, pixels = picture("x.exr")
    np.testing.assert_allclose(pixels, render_sphere(truth, Viewer(70, -20), 16) / 2, rtol=1e-6)
    assert value == {
        "file": "x.exr",
        "view": [70, -20],
        "size": 16,
        "exposure": -1,
        "brdf": {"name": "microfacet", "parameters": {"sigma": 0.3}},
        "probe": "noise.exr",
        "probe_sha256": probe.digest(),
        "source_height": 8,
        "exact": False,
        "source_pixels": 128,
        "truth_error": None,
        "precision": "float",
        "warnings": [],
    }
    recipe = json.loads(header["shrm:recipe"])["reference"]
    reading = recipe.pop("reading")
    assert (reading["layout"], reading["axes"][1]) == ("latlong", [0, 1, 0])
    assert recipe.items() <= value.items()
    assert recipe["view"] == [70, -20]


def test_bytes_depend_on_neither_threads_nor_folders(folder):
    (folder / "elsewhere").mkdir()
    write_exr("elsewhere/noise.exr", noise(), chromaticities=P3)
    done("reference", "noise.exr", *QUICK, "-o", "a.exr", "--threads", 1)
    done("reference", "elsewhere/noise.exr", *QUICK, "-o", "b.exr", "--threads", 3)
    assert (folder / "a.exr").read_bytes() == (folder / "b.exr").read_bytes()


def test_png_and_quiet(folder):
    assert done("reference", "noise.exr", *SUMMED, "-o", "x.png", "--quiet") == ""
    assert (folder / "x.png").read_bytes()[:4] == b"\x89PNG"


def test_points_are_counted_for_the_progress_bar(folder, monkeypatch):
    seen = told_to_bars(monkeypatch, "reference")
    done("reference", "noise.exr", *QUICK)
    assert len(seen) > 3
    assert seen == sorted(seen)
    assert seen[-1][0] == seen[-1][1] > 16 * 16 * np.pi / 4 * 0.81


def test_warnings_of_the_probe_are_told(folder):
    pixels = noise()
    pixels[2, 3] = -1
    write_exr("negative.exr", pixels)
    result = run("reference", "negative.exr", *SUMMED)
    assert result.code == 0
    assert result.err.startswith("Warning: negative.exr: 1 pixel with negative radiance")
    value = json.loads(run("reference", "negative.exr", *SUMMED, "--json").out)
    assert len(value["warnings"]) == 1
    assert run("reference", "negative.exr", *SUMMED, "--quiet").err == ""


@pytest.mark.parametrize(
    ("arguments", "code", "parts"),
    [
        (["missing.exr", "--brdf", "phong"], 1, ["missing.exr"]),
        (["noise.exr", "--brdf", "fong"], 1, ["'fong'", "phong"]),
        (["noise.exr"], 2, ["--brdf"]),
        (["noise.exr", "--brdf", "phong", "-o", "x.jpg"], 1, [".png or .exr"]),
        (["noise.exr", "--brdf", "phong", "-o", "noise.exr"], 1, ["overwrite the input"]),
        (["noise.exr", "--brdf", "phong", "-o", "no/x.exr"], 1, ["no folder"]),
        (["noise.exr", "--brdf", "phong", "--source-height", 1], 2, ["--source-height"]),
        (["noise.exr", "--brdf", "phong", "--size", 8], 2, ["--size"]),
        (["noise.exr", "--brdf", "phong", "--view", "0,91"], 2, ["--view"]),
        (["noise.exr", "--brdf", "phong", "--exposure", "nan"], 2, ["--exposure"]),
        (["noise.exr", "--brdf", "phong", "--yaw", "inf"], 2, ["--yaw"]),
        (["noise.exr", "--brdf", "lambertian", "--size", 16, "--exposure", 32, "--precision",
          "half"], 1, ["overflows half"]),
    ],
)  # fmt: skip
def test_failures_are_one_line_and_leave_nothing(folder, arguments, code, parts):
    before = snapshot(folder)
    assert_refused(run("reference", *arguments), code, *parts)
    assert snapshot(folder) == before


def test_as_a_process(folder):
    result = process("reference", "noise.exr", *SUMMED, "-o", "x.png")
    assert (result.code, result.err) == (0, "")
    assert result.out.startswith("x.png: 16 x 16, 8-bit sRGB\n")
