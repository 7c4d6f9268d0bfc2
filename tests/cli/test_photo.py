"""`shrm probe brackets`, `ball` and `unclip`: a probe of photographs, up to its sun."""

import json

import numpy as np
import pytest

from shrm_cli.files.image import write_image
from shrm_cli.files.png import encode_srgb, write_png
from shrm_cli.probe.open import open_probe
from shrm_cli.sphere.grid.latlong import latlong_directions
from tests.cli.helpers import run, write_exr
from tests.photo.camera import direction, photograph, srgb, write_exposure
from tests.photo.test_ball import waves
from tests.photo.test_unclip import irradiance

SIZE, ROWS = 96, 32
SUN = direction(-50, 35)


def light(directions):
    """Waves and a sun, which no exposure holds."""
    return waves(directions) + 4000.0 * (directions @ SUN > np.cos(0.05))[:, None]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Current folder with three exposures of a mirror ball from two sides."""
    monkeypatch.chdir(tmp_path)
    for number, azimuth in enumerate((0, 90)):
        ball = photograph(light, direction(azimuth), SIZE)
        for k, time in enumerate((1 / 500, 1 / 60, 1 / 8)):
            write_exposure(tmp_path / f"{number}{k}.png", ball * 64 / 100, time * 5, srgb, k)
    return tmp_path


def test_a_probe_of_photographs(folder):
    """From eight bits to a probe whose sun is as bright as it was, by the shortest commands."""
    for number in (0, 1):
        photos = [f"{number}{k}.png" for k in range(3)]
        made = run("probe", "brackets", *photos, "-o", f"{number}.exr", "--json")
        told = json.loads(made.out)
        assert 0 < told["clipped"] < 0.01
        assert f"{number}.exr: " in made.err
        assert "white in the shortest exposure, too" in made.err
        assert told["photos"] == photos
        assert max(told["differences"]) < 0.1
        assert "differs" not in made.err
    made = run("probe", "ball", "0.exr", "1.exr", "-o", "probe.exr", "--size", str(ROWS))
    assert made.code == 0
    assert made.err == ""
    assert "probe.exr: 64 x 32" in made.out
    assert "1.exr: times " in made.out
    directions = latlong_directions(2 * ROWS, ROWS)
    truth = waves(directions.reshape(-1, 3)).reshape(ROWS, 2 * ROWS, 3)
    found = open_probe("probe.exr").image()
    scale = np.median(found / truth)
    is_sky = directions @ SUN < np.cos(0.3)
    assert np.quantile(np.abs(found / scale / truth - 1)[is_sky], 0.95) < 0.06
    # A white card of all albedo, facing up, is photographed with the rest.
    up = np.array([0.0, 1.0, 0.0])
    flux = 4000.0 * 2 * np.pi * (1 - np.cos(0.05)) * SUN[1]
    card = scale * (irradiance(truth, up) + flux) * 0.5 / np.pi
    words = ("--card", ",".join(map(str, card)), "--albedo", "0.5", "-o", "sunny.exr")
    assert run("probe", "unclip", "probe.exr", *words).code == 0
    sunny = open_probe("sunny.exr").image()
    other = np.array([-0.6, 0.64, 0.48])
    wanted = scale * (irradiance(truth, other) + flux * (SUN @ other) / SUN[1])
    np.testing.assert_allclose(irradiance(sunny, other), wanted, rtol=0.05)
    # Without the reading, surfaces that face the sun were far too dark.
    assert (irradiance(found, other) < 0.7 * wanted).all()


def test_exposures_that_do_not_belong_together_are_told(folder):
    """Exposures of both balls, as `*.png` names them, were merged without a word."""
    made = run("probe", "brackets", "00.png", "11.png", "02.png", "-o", "mixed.exr")
    assert made.code == 0
    assert "Warning: 11.png: differs by " in made.err
    assert "from 00.png in the median, where neither is black or white; check" in made.err
    far = run(
        "probe", "brackets", "00.png", "02.png", "--times", "1,1e6", "-o", "far.exr", "--json"
    )
    assert json.loads(far.out)["differences"] == [0, None]
    assert (
        "02.png: shows next to nothing that is neither black nor white in it and in 00" in far.err
    )


def test_a_panorama_of_eight_bits_gets_its_sun(folder):
    """It was told to give --linearize, which there was not."""
    up, directions = np.array([0.0, 1.0, 0.0]), latlong_directions(64, 32)
    sky = np.full((32, 64, 3), 0.2, np.float32)
    sky[directions @ SUN > np.cos(0.12)] = 1.0
    picture = encode_srgb(sky)
    write_png("sky.png", picture)
    assert "give --linearize" in run("probe", "unclip", "sky.png", "--ratio", 8, "-o", "a.exr").err
    made = run("probe", "unclip", "sky.png", "--linearize", "--ratio", 8, "-o", "a.exr")
    assert (made.code, made.err) == (0, "")
    found = irradiance(open_probe("a.exr").image(), up)
    shadow = irradiance(np.where(sky == 1, 0, sky), up)
    np.testing.assert_allclose(found, 8 * shadow, rtol=0.02)


@pytest.fixture
def clipped(tmp_path, monkeypatch):
    """Write a dim sky whose sun was clipped, and return its pixels, shape (32, 64, 3)."""
    monkeypatch.chdir(tmp_path)
    sky = np.full((32, 64, 3), 0.2, np.float32)
    sky[latlong_directions(64, 32) @ SUN > np.cos(0.12)] = 1.0
    write_exr(tmp_path / "clip.exr", sky)
    return sky


@pytest.mark.parametrize(
    ("words", "wanted"),
    [
        (("--irradiance", "7"), (7, 7, 7)),
        (("--card", "0.4"), (6.9813, 6.9813, 6.9813)),
        (("--card", "0.8", "--albedo", "0.36"), (6.9813, 6.9813, 6.9813)),
        (("--irradiance", "7,6,5"), (7, 6, 5)),
    ],
)
def test_a_reading_is_one_number_or_three(clipped, words, wanted):
    """One number was refused, because it is a list of one."""
    made = run("probe", "unclip", "clip.exr", *words, "-o", "a.exr")
    assert (made.code, made.err) == (0, "")
    found = irradiance(open_probe("a.exr").image(), np.array([0.0, 1.0, 0.0]))
    np.testing.assert_allclose(found, wanted, rtol=2e-3)


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (("--card", "0.01"), "--card gives an irradiance that is below the irradiance 0.6"),
        (("--irradiance", "0.1"), "--irradiance is below the irradiance 0.6"),
        (("--ratio", "1.001"), "--ratio is below the irradiance 0.6"),
    ],
)
def test_readings_that_are_too_low_are_named_as_they_were_given(clipped, words, line):
    made = run("probe", "unclip", "clip.exr", *words, "-o", "a.exr")
    assert made.code == 2
    assert line in made.err
    assert "that clip.exr gives already" in made.err


def test_photographs_that_differ_are_told(folder):
    write_exr(folder / "a.exr", photograph(waves, direction(0), SIZE))
    write_exr(folder / "b.exr", photograph(lambda d: waves(3 * d[:, ::-1]), direction(90), SIZE))
    made = run("probe", "ball", "a.exr", "b.exr", "-o", "c.exr")
    assert made.code == 0
    assert "b.exr: differs by " in made.err
    assert "check --camera and --circle" in made.err


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (("brackets", "00.png", "-o", "x.exr"), "00.png: is one exposure; name two photographs"),
        (("brackets", "x_*.png", "-o", "x.exr"), "x_*.png: no such file"),
        (("brackets", "00.png", "01.png", "--times", "1/0,1", "-o", "x.exr"), "is not a list of"),
        (("brackets", "00.png", "01.png", "-o", "00.png"), "would overwrite the input"),
        (("ball", "00.png", "-o", "x.exr"), "give --linearize"),
        (("ball", "00.png", "--linearize", "--circle", "1,2", "-o", "x.exr"), "not X,Y,RADIUS"),
        (
            ("unclip", "00.png", "-o", "x.exr"),
            "--card or --ratio or --irradiance must be given; see shrm probe unclip --help",
        ),
        (("unclip", "x.exr", "--ratio", "2", "--card", "1", "-o", "y.exr"), "--card"),
    ],
)
def test_wrong_usage_is_one_line(folder, words, line):
    made = run("probe", *words)
    assert made.code != 0
    assert line in made.err
    assert not (folder / "x.exr").exists()


@pytest.fixture
def sunny(tmp_path, monkeypatch):
    """Write a sky whose blurred sun was clipped, and what a reading made of it."""
    monkeypatch.chdir(tmp_path)
    height = latlong_directions(128, 64) @ SUN
    glow = 200 * np.exp((height - 1) / 0.04**2)
    sky = np.minimum(0.2 + glow[..., None] * [1, 0.9, 0.8], 20)
    write_exr(tmp_path / "clip.exr", sky.astype(np.float32))
    assert run("probe", "unclip", "clip.exr", "--card", "0.8,0.7,0.6", "-o", "uc.exr").code == 0
    return tmp_path


@pytest.mark.parametrize("words", [(), ("--yaw", "30"), ("--working", "acescg")])
def test_what_a_reading_made_is_not_clipped(sunny, words):
    """Its pixels have one value still, but the right one."""
    for name, is_clipped in (("clip.exr", True), ("uc.exr", False)):
        assert ("may be clipped" in run("sun", name, *words).err) == is_clipped
        told = json.loads(run("info", name, *words, "--json").out)
        assert ("share the maximum" in told["clipped"]) == is_clipped
        into = ("--brdf", "ggx:roughness=0.5", "-o", f"map_{name}")
        made = run("prefilter", name, *words, "--sun", "split", *into)
        assert made.code == 0
        assert ("may be clipped" in made.err) == is_clipped


def test_what_was_clipped_after_a_reading_is_clipped(sunny):
    """Programs keep the attributes of what they clip again."""
    made = open_probe("uc.exr").image()
    recipe = {"probe": "unclip", "radiance": made.max(axis=(0, 1)).tolist()}
    again = np.minimum(made, 0.5 * made.max())
    for pixels, is_clipped in ((made, False), (again, True)):
        write_image("x.exr", pixels, "float", {"shrm:recipe": json.dumps(recipe)})
        assert ("may be clipped" in run("sun", "x.exr").err) == is_clipped
    write_image("x.exr", made, "float", {"shrm:recipe": json.dumps({"probe": "unclip"})})
    assert "may be clipped" in run("sun", "x.exr").err


@pytest.fixture
def panorama(tmp_path, monkeypatch):
    """Write a picture of 8 bits whose sun is white, and a grey one; no lamp is found in either."""
    monkeypatch.chdir(tmp_path)
    directions = latlong_directions(128, 64)
    sky = np.repeat(0.3 + 0.2 * directions[..., 1:2], 3, axis=-1).astype(np.float32)
    write_png("grey.png", encode_srgb(sky))
    glow = 50 * np.exp((directions @ SUN - 1) / 0.03**2)
    write_png("sky.png", encode_srgb(sky + glow[..., None].astype(np.float32)))
    return tmp_path


@pytest.mark.parametrize(
    "words",
    [
        ("sun",),
        ("prefilter", "--brdf", "ggx:roughness=0.5"),
        ("prefilter", "--brdf", "ggx:roughness=0.5", "--working", "acescg"),
        ("prefilter", "--brdf", "ggx:roughness=0.5", "--sun", "split"),
    ],
)
def test_a_sun_that_is_white_in_a_picture_is_told_once(panorama, words):
    """Its map was dim without a word."""
    for name, count in (("sky.png", 1), ("grey.png", 0)):
        made = run(words[0], name, "--linearize", *words[1:])
        assert made.code == 0
        told = [line for line in made.err.splitlines() if "shrm probe unclip" in line]
        assert len(told) == count
        for line in told:
            assert line.startswith(f"Warning: {name}: ")
            assert "% of the sphere is white, the end of its integers" in line


@pytest.mark.parametrize(("name", "is_white"), [("sky.png", True), ("grey.png", False)])
def test_what_mends_a_white_sun_is_advice(panorama, name, is_white):
    made = run("info", name, "--linearize", "--json")
    told = json.loads(made.out)
    assert ("the end of its integers" in told["clipped"]) == is_white
    assert ("shrm probe unclip" in told["advice"]) == is_white
    assert made.err == ""


def test_floats_of_a_picture_end_at_one(panorama):
    """Windows and a bright sky are not four times the mean."""
    write_exr(panorama / "sky.exr", open_probe("sky.png", linearize=True).image())
    told = json.loads(run("info", "sky.exr", "--json").out)
    assert "R reaches 1, where pictures of integers end" in told["clipped"]
    for pixels in (np.ones((16, 32, 3)), np.full((16, 32, 3), 0.5)):
        pixels[0, 0] = 1
        write_exr(panorama / "even.exr", pixels.astype(np.float32))
        assert json.loads(run("info", "even.exr", "--json").out)["clipped"] == ""
