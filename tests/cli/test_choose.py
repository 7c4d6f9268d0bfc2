"""`shrm choose`: its table, JSON, picture and map, beside the library."""

import json
import shlex
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest

import shrm_cli as shrm
from shrm_cli.cli.choose import _flags, _report
from shrm_cli.plan.search import Goal
from tests import oracles
from tests.cli.helpers import ROOT, assert_refused, done, polynomial_light, run, write_exr

MATTE, PAINT = "lambertian:albedo=0.5", "0.6*lambertian+0.4*ggx:roughness=0.7"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("choose")
    light = polynomial_light(oracles.latlong_pixels(32, 16)).astype(np.float32)
    write_exr(path / "p.exr", light)
    (path / "broken.exr").write_bytes(b"no image")
    return path


@pytest.fixture(autouse=True)
def within(folder, monkeypatch):
    monkeypatch.chdir(folder)


def test_json_is_what_the_library_says():
    said = json.loads(done("choose", "p.exr", "--brdf", MATTE, "--budget", "500", "--json"))
    (told,) = said["choices"]
    (choice,) = shrm.choose("p.exr", MATTE, budget=500)
    assert told["probe"] == "p.exr"
    assert told["brdf"] == MATTE
    assert told["budget"] == 500
    assert told["goal"] == {"error": 0.05, "wrong_share": 0.05}
    assert told["is_kept"] == choice.is_kept
    assert choice.offers[told["recommended"]] == choice.recommended
    for row, each in zip(told["offers"], choice.offers, strict=True):
        assert row["arguments"] == json.loads(json.dumps(each.arguments))
        assert row.pop("arguments").keys() == each.arguments.keys()
        assert row.pop("measured") == list(each.measured)
        assert row == {name: getattr(each, name) for name in row}
    page = (ROOT / "docs" / "choose.md").read_text()
    for key in (*said, *told, *told["offers"][0]):
        assert f"`{key}`" in page, key


def test_offers_with_spots_are_marked():
    def offer(count, **marks):
        return shrm.Offer(
            "shrm", "cubes", count, 0.01, 0.01, (), 4, 52, None, lambda: None, **marks
        )

    def report(*offers):
        goal = Goal(0.05, 0.05)
        return _report("p.exr", shrm.Choice("p", "b", goal, None, offers, offers[-1], True))

    spotted = report(offer(100, has_spots=True), offer(200, on_front=True))
    assert [line[:6] for line in spotted[2:4]] == ["     s", "  >b  "]
    assert spotted[4].endswith("; ~: measured; s: has black spots")
    assert report(offer(200))[3].endswith("; ~: measured")


def test_the_command_that_is_told_makes_the_map():
    text = done("choose", "p.exr", "--brdf", MATTE)
    (line,) = (each.strip() for each in text.splitlines() if each.startswith("  shrm prefilter"))
    done(*line.split()[1:], "-o", "m.exr")
    assert shrm.open_map("m.exr").representation == "irradiance"
    taken = [each for each in text.splitlines() if each.startswith("  >")]
    assert len(taken) == 1
    assert "irradiance" in taken[0]


def test_fewest_bytes_are_said_to_be_of_maps_with_the_lamps_in_them():
    assert ": the fewest bytes that keep" in done("choose", "p.exr", "--brdf", MATTE)
    pixels = np.full((32, 64, 3), 0.5, dtype=np.float32)
    pixels[10, 20] = 900
    write_exr("sun.exr", pixels)
    text = done("choose", "sun.exr", "--brdf", MATTE)
    assert ": the fewest bytes, of maps with the lamps in them, that keep" in text


def test_ranges_are_told_as_the_command_takes_them():
    (choice,) = shrm.choose("p.exr", "ggx:roughness=0.3")
    (offer,) = (each for each in choice.offers if each.arguments and each.arguments["to"] == "she")
    words = _flags(offer.arguments, choice.brdf)
    assert "0.3..0.3" in words
    done("prefilter", "p.exr", *words, "-o", "she.exr")
    assert shrm.open_map("she.exr").roughness_range == pytest.approx((0.3, 0.3))


def test_the_command_that_is_told_can_be_pasted_into_a_shell():
    """The probe's name is quoted, and it is read as it was read."""
    Path("my probe's.exr").write_bytes(Path("p.exr").read_bytes())
    turned = ("--yaw", "30", "--mirror")
    text = done("choose", "my probe's.exr", "--brdf", MATTE, *turned)
    (line,) = (each.strip() for each in text.splitlines() if each.startswith("  shrm prefilter"))
    done(*shlex.split(line)[1:], "-o", "told.exr")
    done("prefilter", "p.exr", *turned, "--to", "irradiance", "--order-f", "2", "-o", "made.exr")
    told, made = shrm.open_map("told.exr"), shrm.open_map("made.exr")
    np.testing.assert_array_equal(told.coefficients, made.coefficients)


def test_the_map_and_the_picture_are_written():
    said = json.loads(
        done("choose", "p.exr", "--brdf", PAINT, "--map", "m.exr", "-o", "c.png", "--json")
    )
    assert said["files"] == ["c.png", "m.exr"]
    (told,) = said["choices"]
    best = told["offers"][told["recommended"]]
    made = shrm.open_map("m.exr")
    assert made.representation == best["form"]
    assert made.cube_count == best["look_ups"]
    picture = oiio.ImageBuf("c.png")
    pixels = picture.get_pixels(oiio.UINT8)[..., :3].reshape(-1, 3)
    assert pixels.shape[0] > 10**5
    for color in ((0xD5, 0x5E, 0x00), (0x00, 0x72, 0xB2), (0xE6, 0x9F, 0x00)):  # the forms' marks
        assert (pixels == color).all(axis=1).sum() > 50


def test_what_cannot_be_used_leaves_the_rest_alone():
    result = run("choose", "p.exr", "broken.exr", "--brdf", MATTE)
    assert result.code == 1
    assert "take irradiance" in result.out
    assert "broken.exr" in result.err


def test_nothing_that_fits_is_a_failure_after_the_table():
    """A map that was asked for is not there, so that a script must not go on."""
    result = run("choose", "p.exr", "--brdf", MATTE, "--budget", "10", "--map", "none.exr")
    assert result.code == 1
    assert "irradiance" in result.out
    assert "take " not in result.out
    assert "no form fits in 10 bytes, the least takes 108 bytes; raise --budget" in result.err
    assert not Path("none.exr").exists()


@pytest.mark.parametrize(
    ("arguments", "code", "word"),
    [
        (("broken.exr", "--brdf", MATTE), 1, "broken.exr"),
        (("p.exr", "--brdf", "no-such"), 1, "no-such"),
        (("p.exr", "--brdf", MATTE, "--brdf", PAINT, "--map", "m.exr"), 2, "--map"),
        (("p.exr", *["--brdf", MATTE] * 25, "-o", "c.png"), 2, "24"),
        (("p.exr", "--brdf", MATTE, "--budget", "much"), 2, "much"),
        (("p.exr", "--brdf", MATTE, "-o", "c.jpg"), 1, ".png"),
        (("p.exr", "--brdf", MATTE, "--map", "p.exr"), 1, "p.exr"),
    ],
)
def test_wrong_usage_is_refused(arguments, code, word):
    assert_refused(run("choose", *arguments), code, word)


def test_pixels_that_were_refused_are_not_said_to_be_filled(tmp_path):
    pixels = np.ones((8, 16, 3), np.float32)
    pixels[3, 5] = np.nan
    write_exr(tmp_path / "nan.exr", pixels)
    result = run("choose", "p.exr", tmp_path / "nan.exr", "--brdf", MATTE)
    assert result.code == 1
    (line,) = result.err.splitlines()
    assert "1 pixel is NaN or infinite" in line
