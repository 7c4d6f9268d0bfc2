"""`shrm sun`: what it prints and writes, and what it refuses."""

import json

import numpy as np
import pytest

from shrm_cli.probe.sky import SUN_RADIUS, sky, sun_radiance
from tests.cli.helpers import assert_refused, done, read_exr, run, snapshot, write_exr


@pytest.fixture
def folder(tmp_path, monkeypatch):
    write_exr(tmp_path / "sky.exr", sky(128, 45, 35))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_json_tells_the_sun(folder):
    values = json.loads(done("sun", "sky.exr", "--json"))
    (lamp,) = values["lamps"]
    assert lamp["azimuth"] == pytest.approx(45, abs=0.5)
    assert lamp["elevation"] == pytest.approx(35, abs=0.5)
    expected = sun_radiance(35, 3.0) * np.pi * np.sin(SUN_RADIUS) ** 2
    np.testing.assert_allclose(lamp["irradiance"], expected, rtol=0.01)
    assert values["irradiance"]["relative_rms_error"] < 1e-3
    assert set(snapshot(folder)) == {"sky.exr"}


def test_text_is_for_people(folder):
    text = done("sun", "sky.exr")
    assert text.startswith("sky.exr: 1 lamp\n")
    assert "of a pixel: 1.41" in text
    assert "RMS error 0.0" in text
    forced = done("sun", "sky.exr", "--sun-radius", "0.265")
    assert "radius 0.265 " in forced
    assert done("sun", "sky.exr", "--count", "0", "--quiet") == ""


def test_files_stand_for_the_probe(folder):
    text = done("sun", "sky.exr", "-o", "rest.exr", "--light-file", "sun.toml", "--usd", "sun.usda")
    assert "written: rest.exr, sun.toml, sun.usda" in text
    _, channels = read_exr("rest.exr")
    assert channels["G"].max() < 0.01 * sky(128, 45, 35).max()
    both = [
        json.loads(done("prefilter", name, "--to", "irradiance", "-o", "e.exr", "--json"))
        for name in ("sky.exr", "sun.toml")
    ]
    first, second = (np.array(each["lighting_coefficients"]) for each in both)
    np.testing.assert_allclose(second, first, rtol=0, atol=2e-3 * np.abs(first).max())
    before = snapshot(folder)
    done("sun", "sky.exr", "-o", "rest.exr", "--light-file", "sun.toml", "--usd", "sun.usda")
    assert snapshot(folder) == before


def test_a_sum_is_a_probe(folder):
    done("sun", "sky.exr", "-o", "rest.exr", "--light-file", "sun.toml", "--quiet")
    (lamp,) = json.loads(done("sun", "sun.toml", "--json"))["lamps"]
    assert lamp["azimuth"] == pytest.approx(45, abs=0.5)


@pytest.mark.parametrize("engine", ["three", "filament", "blender", "gltf"])
def test_lines_for_engines(folder, engine):
    text = done("sun", "sky.exr", "--for", engine)
    assert ("{" in text) == (engine != "blender")
    assert "RMS" not in text


def test_lamps_that_stay_are_told(folder):
    image = sky(128, 45, 35)
    image[60, 200] = 8e4
    write_exr("two.exr", image)
    result = run("sun", "two.exr", "--count", "1")
    assert result.code == 0
    assert "1 more lamp stays in the residual; --count takes more" in result.err
    none = run("sun", "two.exr", "--count", "0")
    assert "2 more lamps stay in the residual" in none.err
    assert "nothing compact" not in none.out


def test_light_beyond_floats_is_refused(folder):
    write_exr("bright.exr", np.full((16, 32, 3), 3e38, np.float32))
    before = snapshot(folder)
    for arguments in (["sun", "bright.exr", "-o", "rest.exr"], ["info", "bright.exr"]):
        assert_refused(run(*arguments), 1, "bright.exr", "beyond 32-bit floats", "--clamp")
    assert snapshot(folder) == before


@pytest.mark.parametrize(("arguments", "code", "parts"), [
    (["sky.exr", "--light-file", "sun.toml"], 2, ["--light-file", "give -o"]),
    (["sky.exr", "--usd", "sun.usda"], 2, ["--usd", "give -o"]),
    (["sky.exr", "-o", "sky.exr"], 1, ["sky.exr", "would overwrite the input"]),
    (["sky.exr", "-o", "rest.png"], 1, ["rest.png", ".exr"]),
    (["sky.exr", "-o", "r.exr", "--light-file", "no/s.toml"], 1, ["no/s.toml", "no folder no"]),
    (["sky.exr", "-o", "r.exr", "--light-file", "in/s.toml"], 1, ["in/s.toml", "into one"]),
    (["sky.exr", "--for", "gltf", "--json"], 2, ["--for excludes --json"]),
    (["sky.exr", "--error", "2"], 2, ["--error", "not between 0 and 1"]),
    (["none.exr"], 1, ["none.exr"]),
])  # fmt: skip
def test_what_is_refused(folder, arguments, code, parts):
    (folder / "in").mkdir()
    before = snapshot(folder)
    assert_refused(run("sun", *arguments), code, *parts)
    assert snapshot(folder) == before


def test_a_proof_beyond_the_allowed_error_is_a_warning(folder):
    """A probe of few rows is resampled when it is turned, which its light does not survive."""
    image = np.random.default_rng(1).uniform(0, 1, (16, 32, 3)).astype(np.float32) ** 4
    write_exr(folder / "small.exr", image)
    found = run("sun", "small.exr", "--yaw", "33", "--pitch", "40")
    assert found.code == 0
    assert "Warning: small.exr: residual and discs change the irradiance by " in found.err
    assert "--error" in found.err
    assert "change the irradiance" not in run("sun", "small.exr").err


def test_a_radius_that_no_lamp_has_is_named(folder):
    """It was said that --count takes more lamps."""
    found = run("sun", "sky.exr", "--sun-radius", "50")
    assert found.code == 0
    assert "0 lamps" in found.out
    (line,) = found.err.splitlines()
    assert line.startswith(
        "Warning: sky.exr: the brightest lamp stays in the residual: a disc of 50 "
    )
    assert "give another --sun-radius, or leave it out" in line
    assert "--count" not in line
    assert "stays" not in run("sun", "sky.exr", "--sun-radius", "1").err
