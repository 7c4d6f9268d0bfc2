"""Colors from reading to PNG: the same light in other primaries makes the same picture."""

import json

import numpy as np
import OpenImageIO as oiio
import pytest

from shrm_cli.vocabulary import PRIMARIES
from tests.cli.helpers import assert_refused, done, run
from tests.probe import scenes

# Published: ACES AP1 to Rec.709 with Bradford's adaptation (ampas/aces-dev, to six digits).
AP1_TO_709 = np.array(
    [
        [1.705051, -0.621792, -0.083259],
        [-0.130256, 1.140805, -0.010548],
        [-0.024003, -0.128969, 1.152972],
    ]
)
MATTE = ("--brdf", "microfacet:sigma=0.4")
GGX = ("--brdf", "ggx:roughness=0.7")
FORMS = {
    "shrm": ((*MATTE, "--to", "shrm"), ()),
    "local": ((*MATTE, "--frame", "local"), ()),
    "sum": (("--brdf", "0.5*lambertian+0.5*ggx:roughness=0.6", "--split"), ()),
    "compressed": ((*MATTE, "--compress", "pca:3"), ()),
    "cabral": ((*MATTE, "--to", "cabral"), ()),
    "kautz-mccool": ((*MATTE, "--to", "kautz-mccool"), ()),
    "lightfield": ((*MATTE, "--to", "lightfield", "--eps", "0.2"), ()),
    "principal": ((*GGX, "--to", "principal"), ()),
    "irradiance": (("--to", "irradiance"), ()),
    "zh3": (("--to", "irradiance", "--form", "zh3"), ()),
    "splitsum": (("--to", "splitsum", "--levels", "3"), ("--roughness", "0.6")),
    "she": (("--to", "she"), ("--roughness", "0.6")),
    "product": (
        (*GGX, "--to", "product", "--window", "none", "--texels", "16", "--order", "2"),
        (),
    ),
}
LINEAR = [name for name in FORMS if name not in ("she", "principal")]


@pytest.fixture(scope="module")
def home(tmp_path_factory):
    """A room with a warm and a cold lamp, in Rec.709 and in ACEScg, with and without saying so."""
    folder = tmp_path_factory.mktemp("primaries")
    rng = np.random.default_rng(5)
    pixels = rng.uniform(0.1, 0.3, (16, 32, 3)) * [0.8, 0.9, 1.0]
    pixels[3:6, 5:9] += [6, 4, 2]
    pixels[4:9, 20:24] += [1, 2, 3]
    wide = pixels @ np.linalg.inv(AP1_TO_709).T
    scenes.write_exr(folder / "709.exr", scenes.rgb(pixels))
    said = {"chromaticities": PRIMARIES["acescg"]}
    scenes.write_exr(folder / "ap1.exr", scenes.rgb(wide), **said)
    scenes.write_exr(folder / "silent.exr", scenes.rgb(wide))
    return folder


@pytest.fixture(autouse=True)
def _here(home, monkeypatch):
    monkeypatch.chdir(home)


def picture(name, shown, out="x.png"):
    done("render", name, "-o", out, "--size", 24, "--exposure", -1, *shown)
    return oiio.ImageBuf(out).get_pixels(oiio.UINT8).astype(int)


@pytest.mark.parametrize("form", sorted(FORMS.keys() - {"local", "compressed", "lightfield"}))
def test_round_trip(form):
    """Within one step of 8 bits; and in what --working makes of light whose file is silent."""
    making, shown = FORMS[form]
    done("prefilter", "709.exr", *making, "-o", "a.exr")
    done("prefilter", "ap1.exr", *making, "-o", "b.exr")
    expected = picture("a.exr", shown)
    assert expected.std() > 3
    assert np.ptp(expected, axis=-1).max() > 10  # it has colors
    # The exponential is fitted to each channel, and P, Q of other channels are other ones.
    fitted = 4 if form == "she" else 1
    assert np.abs(picture("b.exr", shown) - expected).max() <= fitted
    if form not in ("shrm", "splitsum", "she"):
        return
    read = ("--primaries", "acescg", "--working", "rec709")
    done("prefilter", "silent.exr", *making, *read, "-o", "c.exr")
    assert np.abs(picture("c.exr", shown) - expected).max() <= 1
    assert json.loads(done("info", "c.exr", "--json"))["chromaticities"][0] == pytest.approx(0.64)


@pytest.mark.parametrize("form", LINEAR)
def test_converted_maps(form):
    """A matrix on all that the file holds; the attribute is on every part, and says so."""
    making, shown = FORMS[form]
    done("prefilter", "709.exr", *making, "-o", "a.exr")
    kind = json.loads(done("info", "a.exr", "--json"))["representation"]
    layout = "openexr" if kind in ("shrm", "cabral", "kautz-mccool", "lightfield") else kind
    done("convert", "a.exr", "--to", layout, "--working", "acescg", "-o", "b.exr", "--quiet")
    source = oiio.ImageInput.open("b.exr")
    part = 0
    while source.seek_subimage(part, 0):
        found = source.spec().getattribute("chromaticities")
        assert found == pytest.approx(PRIMARIES["acescg"], abs=1e-6)
        part += 1
    assert part
    assert np.abs(picture("b.exr", shown) - picture("a.exr", shown)).max() <= 1
    # And it is the map that the converted light makes.
    if form in ("shrm", "sum", "splitsum", "irradiance"):
        done("prefilter", "709.exr", *making, "--working", "acescg", "-o", "c.exr", "--quiet")
        text = done(
            "compare", "c.exr", "b.exr", "--no-picture", "--no-flip", "--size", 24, "--json", *shown
        )
        assert json.loads(text)["summary"][0]["relative_rmse"] < 2e-3


@pytest.mark.parametrize("form", ["she", "principal"])
def test_maps_that_cannot_be_converted(form):
    done("prefilter", "709.exr", *FORMS[form][0], "-o", "a.exr")
    result = run("convert", "a.exr", "--to", form, "--working", "acescg", "-o", "b.exr")
    assert result.code == 1
    assert "prefilter its probe with --working" in result.err
    done("convert", "a.exr", "--to", form, "--primaries", "p3", "-o", "b.exr")
    found = json.loads(done("info", "b.exr", "--json"))["chromaticities"]
    assert found == pytest.approx(PRIMARIES["p3"], abs=1e-6)


def test_maps_of_different_primaries_are_compared_in_those_of_the_first():
    for probe in ("709", "ap1"):
        done("prefilter", f"{probe}.exr", *MATTE, "-o", f"{probe}.shrm.exr")
    for pair in (("709.shrm.exr", "ap1.shrm.exr"), ("ap1.shrm.exr", "709.shrm.exr")):
        result = run("compare", *pair, "--no-picture", "--size", 24, "--json", "--no-flip")
        assert "its probe is not that of" in result.err
        text = result.out
        assert json.loads(text)["summary"][0]["relative_rmse"] < 2e-3
    truth = (
        "--probe",
        "ap1.exr",
        "--no-picture",
        "--size",
        24,
        "--json",
        "--no-flip",
        "--view",
        "0,0",
    )
    rows = json.loads(run("compare", "709.shrm.exr", "ap1.shrm.exr", *truth).out)["summary"]
    assert rows[0]["relative_rmse"] == pytest.approx(rows[1]["relative_rmse"], rel=1e-2)
    done("render", "709.shrm.exr", "ap1.shrm.exr", "-o", "sheet.exr", "--size", 24)
    sheet = oiio.ImageBuf("sheet.exr").get_pixels(oiio.FLOAT)[2:26]
    assert sheet[:, 2:26].std() > 0.1
    np.testing.assert_allclose(sheet[:, 2:26], sheet[:, 28:52], atol=4e-3)


def test_a_background_is_in_the_primaries_of_the_map():
    done("prefilter", "709.exr", *MATTE, "-o", "a.exr")
    pictures = [
        picture("a.exr", ("--background", name, "--exposure", "0"), f"{name}.png")
        for name in ("709.exr", "ap1.exr")
    ]
    assert np.abs(pictures[0] - pictures[1]).max() <= 1


def test_metals_depend_on_the_primaries_that_they_multiply_in():
    """Products of colors differ with the primaries: --working rec709 makes those of Rec.709."""
    gold = ("--brdf", "ggx:roughness=0.7,f0=gold")
    done("prefilter", "709.exr", *gold, "-o", "a.exr")
    done("prefilter", "ap1.exr", *gold, "-o", "b.exr")
    done("prefilter", "ap1.exr", *gold, "--working", "rec709", "-o", "c.exr")
    pictures = [picture(name, ()) for name in ("a.exr", "b.exr", "c.exr")]
    assert np.abs(pictures[2] - pictures[0]).max() <= 1
    assert 1 < np.abs(pictures[1] - pictures[0]).max() < 15


def test_what_a_png_cannot_show_is_told(tmp_path):
    pixels = np.full((16, 32, 3), 0.5) * [0.02, 1, 0.02]
    said = {"chromaticities": PRIMARIES["acescg"]}
    scenes.write_exr(tmp_path / "green.exr", scenes.rgb(pixels), **said)
    done("prefilter", tmp_path / "green.exr", "--to", "irradiance", "-o", "green.irr.exr")
    text = done("render", "green.irr.exr", "-o", "x.png", "--size", 24)
    assert "% of it outside its colors" in text


def test_probes_are_converted():
    done("convert", "ap1.exr", "--to", "latlong", "--working", "rec709", "-o", "back.exr")
    found = oiio.ImageBuf("back.exr").get_pixels(oiio.FLOAT)
    expected = oiio.ImageBuf("709.exr").get_pixels(oiio.FLOAT)
    np.testing.assert_allclose(found, expected, rtol=2e-3, atol=2e-4)


@pytest.mark.parametrize("value", ["acesgc", "1,2,3", "nan"])
def test_what_are_no_primaries(value):
    result = run("prefilter", "709.exr", *MATTE, "--working", value)
    assert result.code in (1, 2)
    assert "eight numbers" in result.err
    assert "rec2020" in result.err


def test_impossible_primaries_say_why():
    result = run("prefilter", "709.exr", *MATTE, "--working", ",".join(["0.3"] * 8))
    assert_refused(result, 1, "--working 0.3, 0.3", "on one line")


def test_eight_numbers():
    numbers = ",".join(map(str, PRIMARIES["p3"]))
    found = json.loads(done("info", "silent.exr", "--primaries", numbers, "--json"))
    assert found["chromaticities"] == pytest.approx(PRIMARIES["p3"])
