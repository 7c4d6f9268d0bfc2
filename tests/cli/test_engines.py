"""`shrm prefilter --to irradiance`, `splitsum` and `she`: options, files and reports."""

import json
import os
import shutil
from itertools import product
from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from shrm_cli.errors import MapError
from shrm_cli.maps.file import open_map
from tests import oracles
from tests.brute_force import sphere_rule
from tests.cli.helpers import (
    assert_refused,
    done,
    noise,
    polynomial_light,
    process,
    read_exr,
    run,
    several,
    snapshot,
    write_exr,
)

KINDS = ("irradiance", "splitsum", "she")
# Small, so that each command takes a moment.
SMALL = {
    "irradiance": ("--size", 8),
    "splitsum": ("--levels", "0.5,1.0", "--size", 16),
    "she": ("--p-order", 2, "--q-order", 1),
}
SHARED_KEYS = {"file", "representation", "probe", "probe_sha256", "bytes", "precision", "warnings"}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Current folder with a smooth probe, and one with a sun that leaves a negative side."""
    directions = oracles.latlong_pixels(64, 32)
    write_exr(tmp_path / "probe.exr", polynomial_light(directions).astype(np.float32))
    sun = np.full((32, 64, 3), 0.05, np.float32)
    sun[8, 20] = 2000.0
    write_exr(tmp_path / "sun.exr", sun)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def prefiltered(kind, *options, probe="probe.exr"):
    """What a command prints as JSON; options replace the small ones."""
    given = options or SMALL[kind]
    return json.loads(done("prefilter", probe, "--to", kind, "--json", "--force", *given))


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """A folder with a small map of each kind, made once, and what was printed of it."""
    made = tmp_path_factory.mktemp("engines")
    light = polynomial_light(oracles.latlong_pixels(64, 32)).astype(np.float32)
    write_exr(made / "probe.exr", light)
    values = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(made)
        for kind in KINDS:
            result = run("prefilter", "probe.exr", "--to", kind, "--json", *SMALL[kind])
            assert (result.code, result.err) == (0, "")
            values[kind] = json.loads(result.out)
    return made, values


@pytest.fixture
def sound(small, tmp_path, monkeypatch):
    """Current folder with those maps alone; a function gives what was printed of one."""
    made, values = small
    for kind in KINDS:
        shutil.copy(made / f"probe.{kind}.exr", tmp_path)
    monkeypatch.chdir(tmp_path)
    return values.__getitem__


def test_works_as_typed_in_the_issue(folder):
    commands = (("prefilter", "probe.exr", "--to", kind, *SMALL[kind]) for kind in KINDS)
    names = [f"probe.{kind}.exr" for kind in KINDS]
    for name, result in zip(names, several(*commands), strict=True):
        assert (result.code, result.err) == (0, "")
        assert result.out.startswith(f"{name}: ")
        assert f"{os.path.getsize(name):,} bytes" in result.out
    assert sorted(snapshot(folder)) == sorted(["probe.exr", *names, "sun.exr"])


@pytest.mark.parametrize("kind", KINDS)
def test_json_says_what_the_file_holds(sound, kind):
    values = sound(kind)
    assert values.keys() >= SHARED_KEYS
    assert values["representation"] == kind
    assert values["file"] == f"probe.{kind}.exr"
    assert values["bytes"] == os.path.getsize(values["file"])
    assert values["warnings"] == []
    made = open_map(values["file"])
    assert made.representation == kind
    assert (made.info.probe, made.info.probe_sha256) == (values["probe"], values["probe_sha256"])
    assert values["precision"] == ("float" if kind == "she" else "half")


@pytest.mark.parametrize("kind", KINDS)
def test_every_part_says_what_the_conventions_list(sound, kind):
    with OpenEXR.File(f"probe.{kind}.exr", separate_channels=True) as file:
        headers = [dict(part.header) for part in file.parts]
        channels = [set(part.channels) for part in file.parts]
    assert len(headers) == (2 if kind == "splitsum" else 1)
    for header, names in zip(headers, channels, strict=True):
        assert names == set("RGB")
        assert header["shrm:representation"] == kind
        assert header["shrm:version"] == 3
        assert header["shrm:probe"] == "probe.exr"
        assert header["shrm:frame"] == "global"
        assert header["shrm:P"] == 0
        name = json.loads(header["shrm:brdf"])["name"]
        assert name.startswith("lambertian" if kind == "irradiance" else "ggx")
        assert len(header["shrm:probe_sha256"]) == 64


@pytest.mark.parametrize("kind", KINDS)
def test_two_runs_give_identical_bytes(folder, small, kind):
    """Whatever the folder, the name of the output, and the threads."""
    first, _ = small
    prefiltered(kind, *SMALL[kind], "--threads", 1, "-o", "two.exr")
    assert (folder / "two.exr").read_bytes() == (first / f"probe.{kind}.exr").read_bytes()


@pytest.mark.parametrize(("kind", "count"), [("irradiance", 1), ("splitsum", 2), ("she", 0)])
def test_what_engines_use_is_no_shrm(sound, kind, count):
    made = open_map(f"probe.{kind}.exr")
    assert made.cube_count == count
    with pytest.raises(MapError, match=f"{kind} has no SHRM"):
        made.to_shrm()


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("precision", ["half", "float"])
def test_precision_is_obeyed(folder, kind, precision):
    values = prefiltered(kind, *SMALL[kind], "--precision", precision)
    assert values["precision"] == precision
    with OpenEXR.File(values["file"], separate_channels=True) as file:
        types = {channel.pixels.dtype for part in file.parts for channel in part.channels.values()}
    assert types == {np.dtype(np.float16 if precision == "half" else np.float32)}


@pytest.mark.parametrize("kind", KINDS)
def test_quiet_prints_nothing(folder, kind):
    result = run("prefilter", "probe.exr", "--to", kind, *SMALL[kind], "--quiet")
    assert (result.code, result.out, result.err) == (0, "", "")


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_wrong_with_a_probe_is_told(folder, kind):
    pixels = noise()
    pixels[3, 4] = -1
    write_exr("bad.exr", pixels)
    result = run("prefilter", "bad.exr", "--to", kind, *SMALL[kind], "--json")
    assert result.code == 0
    warning = "bad.exr: 1 pixel with negative radiance was clamped to 0 (minimum -1)"
    assert warning in json.loads(result.out)["warnings"]
    assert f"Warning: {warning}\n" in result.err


@pytest.mark.parametrize("kind", KINDS[:2])
def test_a_black_probe_gives_a_black_map(folder, kind):
    write_exr("black.exr", np.zeros((8, 16, 3), np.float32))
    result = run("prefilter", "black.exr", "--to", kind, *SMALL[kind])
    assert result.code == 0
    assert result.err == "Warning: black.exr: the probe is black\n"
    made = open_map(f"black.{kind}.exr")
    shown = made if kind == "irradiance" else made.shaded(0.7, (1.0, 1.0, 1.0))
    normals = oracles.random_directions(np.random.default_rng(0), 20)
    assert np.abs(shown.radiance(normals, normals)).max() < 1e-6


def test_a_black_probe_has_no_logarithm(folder):
    write_exr("black.exr", np.zeros((8, 16, 3), np.float32))
    before = snapshot(folder)
    assert_refused(run("prefilter", "black.exr", "--to", "she"), 1, "black.exr: the probe is black")
    assert snapshot(folder) == before


@pytest.mark.parametrize("kind", KINDS)
def test_reading_options_reach_the_probe(folder, kind):
    """Light that is written turned by 90 degrees, and read so."""
    x, y, z = np.moveaxis(oracles.latlong_pixels(64, 32), -1, 0)
    light = polynomial_light(np.stack([-z, y, x], axis=-1)).astype(np.float32)
    write_exr("turned.exr", light)
    prefiltered(kind, *SMALL[kind], "-o", "by_hand.exr", "--precision", "float", probe="turned.exr")
    prefiltered(kind, *SMALL[kind], "-o", "option.exr", "--precision", "float", "--yaw", 90)
    with OpenEXR.File("by_hand.exr") as one, OpenEXR.File("option.exr") as two:
        for a, b in zip(one.parts, two.parts, strict=True):
            scale = np.abs(a.channels["RGB"].pixels).max()
            np.testing.assert_allclose(
                b.channels["RGB"].pixels, a.channels["RGB"].pixels, atol=2e-4 * scale
            )


FOREIGN = [
    ("irradiance", ["--brdf", "phong"], "--brdf", "white Lambertian"),
    ("she", ["--brdf", "ggx"], "--brdf", "GGX"),
    *[(kind, ["--eps", 0.03], "--eps", "shrm") for kind in KINDS],
    *[(kind, ["--order-p", 2], "--order-p", "shrm") for kind in KINDS],
    *[(kind, ["--center", "normal"], "--center", "shrm") for kind in KINDS],
    *[(kind, ["--split"], "--split", "shrm") for kind in KINDS],
    *[(kind, ["--no-split"], "--split", "shrm") for kind in KINDS],
    *[(kind, ["--slices", 4], "--slices", "kautz-mccool") for kind in KINDS],
    *[(kind, ["--views", 4], "--views", "lightfield") for kind in KINDS],
    *[(kind, ["--compress", "pca:2"], "--compress", "shrm") for kind in KINDS],
    *[(kind, ["--domain", "frequency"], "--domain", "cabral") for kind in KINDS],
    *[(kind, ["--source-height", 8], "--source-height", "cabral") for kind in KINDS],
    *[(kind, ["--frame", "global"], "--frame", "shrm") for kind in KINDS],
    *[(kind, ["--order-f", 2], "--order-f", "irradiance") for kind in ("splitsum", "she")],
    *[(kind, ["--window", "auto"], "--window", "irradiance") for kind in ("splitsum", "she")],
    ("irradiance", ["--textures", "layers"], "--textures", "shrm"),
    *[(kind, ["--levels", 5], "--levels", "splitsum") for kind in ("irradiance", "she")],
    *[(kind, ["--mapping", "linear"], "--mapping", "splitsum") for kind in ("irradiance", "she")],
    *[(kind, ["--p-order", 4], "--p-order", "she") for kind in ("irradiance", "splitsum")],
    *[(kind, ["--q-order", 2], "--q-order", "she") for kind in ("irradiance", "splitsum")],
    *[(kind, ["--roughness", "0.5..1"], "--roughness", "she") for kind in KINDS[:2]],
    ("she", ["--size", 16], "--size", "irradiance or splitsum"),
    ("she", ["--map-sampling", "border"], "--map-sampling", "irradiance or splitsum"),
    ("shrm", ["--brdf", "phong", "--window", "hann"], "--window", "irradiance"),
    ("cabral", ["--brdf", "phong", "--levels", 5], "--levels", "splitsum"),
    ("cabral", ["--brdf", "phong", "--mapping", "unreal"], "--mapping", "splitsum"),
    ("shrm", ["--brdf", "phong", "--p-order", 4], "--p-order", "she"),
    ("lightfield", ["--brdf", "phong", "--q-order", 2], "--q-order", "she"),
    ("kautz-mccool", ["--brdf", "phong", "--roughness", "0.5..1"], "--roughness", "she"),
]


@pytest.mark.parametrize(
    ("kind", "options", "name", "owner"), FOREIGN, ids=lambda value: str(value)[:30]
)
def test_options_that_say_nothing_are_refused(folder, kind, options, name, owner):
    before = snapshot(folder)
    result = run("prefilter", "probe.exr", "--to", kind, *options)
    assert_refused(result, 2, f"Error: {name} applies with --to ", owner)
    assert snapshot(folder) == before


@pytest.mark.parametrize("kind", ["shrm", "cabral", "kautz-mccool", "lightfield"])
def test_other_representations_need_a_brdf(folder, kind):
    result = run("prefilter", "probe.exr", "--to", kind)
    assert_refused(result, 2, "--brdf is missing", f"--to {kind} needs", "shrm prefilter --help")


@pytest.mark.parametrize(
    ("kind", "option", "value", "words"),
    [
        ("irradiance", "--order-f", "513", "0<=x<=512"),
        ("irradiance", "--shader", "metal", "'glsl'"),
        ("irradiance", "--size", "0", "4<=x<=4096"),
        ("splitsum", "--levels", "0", "0 levels are not 1 .. 64"),
        ("splitsum", "--levels", "65", "65 levels are not 1 .. 64"),
        ("splitsum", "--levels", "9" * 5000, "999999999 levels are not 1 .. 64"),
        ("splitsum", "--levels", "0.5,0.5", "does not rise"),
        ("splitsum", "--levels", "0.9,0.5", "does not rise"),
        ("splitsum", "--levels", "0.5,1.5", "a roughness outside 0 .. 1"),
        ("splitsum", "--levels", "-0.5,1", "a roughness outside 0 .. 1"),
        ("splitsum", "--levels", "2.5", "a roughness outside 0 .. 1"),
        ("splitsum", "--levels", "nan,1", "neither a number of levels"),
        ("splitsum", "--levels", "many", "neither a number of levels"),
        ("splitsum", "--levels", "", "neither a number of levels"),
        ("splitsum", "--mapping", "unity", "'filament'"),
        ("she", "--p-order", "17", "0<=x<=16"),
        ("she", "--q-order", "-1", "0<=x<=16"),
        ("she", "--roughness", "1..0.5", "does not rise within 0.05 .. 1"),
        ("she", "--roughness", "0..1", "does not rise within 0.05 .. 1"),
        ("she", "--roughness", "0.5..2", "does not rise within 0.05 .. 1"),
        ("she", "--roughness", "0.5....1", "is not a range A..B"),
        ("she", "--roughness", "0.2,0.5..", "is not a range A..B"),
        ("she", "--roughness", "nan..1", "is not a range A..B"),
        ("she", "--roughness", "..", "is not a range A..B"),
        ("she", "--roughness", "0.2..0.5..1", "is not a range A..B"),
        ("she", "--roughness", "rough", "is not a range A..B"),
    ],
)
def test_wrong_values(folder, kind, option, value, words):
    before = snapshot(folder)
    result = run("prefilter", "probe.exr", "--to", kind, option, value)
    assert_refused(result, 2, f"'{option}'", words)
    assert snapshot(folder) == before


@pytest.mark.parametrize("kind", KINDS)
def test_inputs_are_kept(folder, kind):
    before = snapshot(folder)
    result = run("prefilter", "probe.exr", "--to", kind, "-o", "probe.exr")
    assert_refused(result, 1, "probe.exr", "overwrite the input")
    result = run("prefilter", "probe.exr", "--to", kind, "-o", "x.png")
    assert_refused(result, 1, "x.png", "what is written is .exr")
    result = run("prefilter", "none.exr", "--to", kind)
    assert_refused(result, 1, "none.exr")
    assert snapshot(folder) == before


# Irradiance.


def test_coefficients_and_cube_are_the_integrals(folder):
    """Light of degree 3 has no more irradiance than nine coefficients hold, since A_3 = 0."""
    values = prefiltered("irradiance", "--size", 8, "--precision", "float")
    channels = [oracles.project(lambda d, k=k: polynomial_light(d)[..., k], 2, 3) for k in range(3)]
    expected = np.stack(channels, axis=1)
    np.testing.assert_allclose(values["lighting_coefficients"], expected, atol=5e-3)
    header, channels = read_exr("probe.irradiance.exr")
    stored = json.loads(header["shrm:lighting_coefficients"])
    assert stored == values["lighting_coefficients"]
    assert json.loads(header["shrm:irradiance_matrices"]) == values["irradiance_matrices"]
    light, weights = sphere_rule(256)
    radiance = polynomial_light(light)
    texels = oracles.cube_texels(8).reshape(48, 8, 3)
    for row, column in [(3, 5), (11, 0), (18, 7), (30, 2), (47, 4)]:
        cosines = np.maximum(light @ texels[row, column], 0)
        found = [channels[c][row, column] for c in "RGB"]
        np.testing.assert_allclose(found, (weights * cosines) @ radiance, rtol=3e-3)


@pytest.mark.parametrize("order", [0, 1, 3, 7])
def test_any_order(folder, order):
    values = prefiltered("irradiance", "--order-f", order)
    assert (values["order_f"], values["coefficients"]) == (order, (order + 1) ** 2)
    made = open_map("probe.irradiance.exr")
    assert made.coefficients.shape == ((order + 1) ** 2, 3)
    assert values["lighting_coefficients"] == made.coefficients.tolist()
    header, _ = read_exr("probe.irradiance.exr")
    assert header["shrm:F"] == order
    assert (values["irradiance_matrices"] is None) == (order > 2)
    assert ("shrm:irradiance_matrices" in header) == (order <= 2)


def test_one_is_told_as_one(folder):
    assert "irradiance, 1 coefficient and a" in done(
        "prefilter", "probe.exr", "--to", "irradiance", "--order-f", 0
    )
    assert "split sum, 1 level by" in done(
        "prefilter", "probe.exr", "--to", "splitsum", "--levels", 1
    )


def test_a_negative_side_is_told_and_by_default_removed(folder):
    plain = run("prefilter", "sun.exr", "--to", "irradiance", "--window", "none", "--json")
    values = json.loads(plain.out)
    assert values["minimum_irradiance"] < 0
    assert plain.err == f"Warning: {values['warnings'][0]}\n"
    assert ": the irradiance falls to -" in plain.err
    assert "--window auto" in plain.err
    assert min(plane.min() for plane in read_exr("sun.irradiance.exr")[1].values()) < 0
    windowed = prefiltered("irradiance", "--force", probe="sun.exr")
    assert windowed["minimum_irradiance"] >= 0
    assert windowed["minimum_without_window"] == pytest.approx(values["minimum_irradiance"])
    assert windowed["warnings"] == []
    window = windowed["window"]
    assert (window["name"], window["width"]) == ("least", None)
    assert window["factors"][0] == 1
    assert 0 < window["energy_lost"] < 1
    assert window["change"] > 0
    ratio = np.array(windowed["lighting_coefficients"]) / values["lighting_coefficients"]
    degree = [0, 1, 1, 1, 2, 2, 2, 2, 2]
    factors = np.array(window["factors"])[degree]
    np.testing.assert_allclose(ratio, np.stack([factors] * 3, axis=1), rtol=1e-9)
    assert min(plane.min() for plane in read_exr("sun.irradiance.exr")[1].values()) >= 0


def test_what_a_window_costs_is_reported(folder):
    text = done("prefilter", "sun.exr", "--to", "irradiance")
    assert "window         least: takes " in text
    assert "% of the energy, changes " in text
    assert "over all sides and channels, -" in text
    assert "window         none is needed" in done("prefilter", "probe.exr", "--to", "irradiance")
    text = done("prefilter", "probe.exr", "--to", "irradiance", "--window", "hann:4", "--force")
    assert "window         hann of width 4: takes " in text
    made = open_map("probe.irradiance.exr")
    assert made.window.name == "hann"
    np.testing.assert_allclose(made.window.factors, [1, (1 + np.sqrt(0.5)) / 2, 0.5], atol=1e-12)


@pytest.mark.parametrize("spec", ["hamming", "hann:-1", "hann:x", "auto:3", ""])
def test_windows_that_there_are_not(folder, spec):
    before = snapshot(folder)
    result = run("prefilter", "probe.exr", "--to", "irradiance", "--window", spec)
    assert_refused(result, 2, f"--window {spec!r}")
    assert snapshot(folder) == before


@pytest.mark.parametrize(("language", "first"), [
    ("glsl", "vec3 shrm_irradiance(vec3 normal)"),
    ("hlsl", "float3 shrm_irradiance(float3 normal)"),
    ("c", "static void shrm_irradiance("),
])  # fmt: skip
def test_the_shader_is_alone_on_stdout(folder, language, first):
    options = ("prefilter", "probe.exr", "--to", "irradiance", "--shader", language)
    result = process(*options) if language == "c" else run(*options)
    assert result.code == 0
    assert result.out.startswith("/* Irradiance")
    assert first in result.out
    assert result.out.endswith("}\n")
    assert result.err.startswith("probe.irradiance.exr: irradiance, 9 coefficients")
    assert (folder / "probe.irradiance.exr").exists()
    quiet = run(*options, "--quiet")
    assert (quiet.out, quiet.err) == (result.out, "")
    values = json.loads(done(*options, "--json"))
    assert values["shader"] == result.out
    assert "shader" not in prefiltered("irradiance")


def test_no_shader_of_irradiance_above_order_16(folder):
    before = snapshot(folder)
    result = run("prefilter", "probe.exr", "--to", "irradiance", "--shader", "c", "--order-f", 17)
    assert_refused(result, 1, "up to 16, not 17", "--order-f")
    assert snapshot(folder) == before


def test_bright_light_goes_to_float_and_says_so(folder):
    write_exr("bright.exr", np.full((8, 16, 3), 1e5, np.float32))
    result = run("prefilter", "bright.exr", "--to", "irradiance")
    assert result.err == (
        "Warning: bright.irradiance.exr: written as 32-bit float, for values beyond half's range\n"
    )
    pixels = read_exr("bright.irradiance.exr")[1]["G"]
    np.testing.assert_allclose(pixels, 1e5 * np.pi, rtol=1e-5)


# Split sums.


def test_parts_of_a_split_sum(folder):
    values = prefiltered("splitsum", "--levels", "0.4,0.7,1.0", "--size", 32)
    assert [level["roughness"] for level in values["levels"]] == [0.4, 0.7, 1.0]
    with OpenEXR.File("probe.splitsum.exr", separate_channels=True) as file:
        headers = [dict(part.header) for part in file.parts]
        shapes = [part.channels["G"].pixels.shape for part in file.parts]
    assert [header["name"] for header in headers] == [
        "roughness0.40", "roughness0.70", "roughness1.00",
    ]  # fmt: skip
    assert [header["shrm:roughness"] for header in headers] == pytest.approx([0.4, 0.7, 1.0])
    assert {header["shrm:mapping"] for header in headers} == {"linear"}
    assert shapes == [(6 * level["size"], level["size"]) for level in values["levels"]]
    assert shapes == sorted(shapes, reverse=True)
    windows = {str(header["displayWindow"]) for header in headers}
    assert len(windows) == 1


@pytest.mark.parametrize("mapping", ["linear", "filament", "unreal"])
def test_mappings(folder, mapping):
    values = prefiltered("splitsum", "--levels", 3, "--mapping", mapping, "--size", 16)
    expected = {
        "linear": [0, 0.5, 1],
        "filament": [0, 1 - np.sqrt(0.5), 1],
        "unreal": [2 ** (-2 / 1.2), 2 ** (-1 / 1.2), 1],
    }[mapping]
    assert [level["roughness"] for level in values["levels"]] == pytest.approx(expected)
    made = open_map("probe.splitsum.exr")
    assert made.mapping == mapping
    assert made.roughness == pytest.approx(expected, rel=1e-6)


def test_the_table_of_levels(folder):
    text = done("prefilter", "probe.exr", "--to", "splitsum", "--levels", "0,0.6,1.0", "--size", 16)
    first, heading, *rows, last = text.splitlines()
    assert "N = V = R is assumed: shrm compare PROBE --representations" in last
    assert first.startswith("probe.splitsum.exr: split sum, 3 levels by the mapping linear, half, ")
    assert " ".join(heading.split()) == "roughness texels F made by RMS error predicted"
    assert [row.split()[0] for row in rows] == ["0", "0.6", "1"]
    assert "resampling" in rows[0]
    assert "coefficients" in rows[2]


def test_white_light_stays_white(folder):
    write_exr("white.exr", np.full((16, 32, 3), 0.75, np.float32))
    prefiltered("splitsum", "--levels", "0,0.5,1.0", "--size", 16, probe="white.exr")
    with OpenEXR.File("white.splitsum.exr", separate_channels=True) as file:
        for part in file.parts:
            for channel in part.channels.values():
                np.testing.assert_allclose(channel.pixels, 0.75, rtol=1e-3)


def test_levels_that_cannot_be_made(folder):
    before = snapshot(folder)
    options = ("prefilter", "probe.exr", "--to", "splitsum", "--size", 16)
    assert_refused(run(*options, "--levels", "0.001,1.0"), 1, "roughness 0.001")
    assert_refused(run(*options, "--levels", "0,1.0", "--mapping", "unreal"), 1, "unreal")
    assert snapshot(folder) == before


# SH exponentials.


def test_orders_and_range_of_an_exponential(folder):
    values = prefiltered("she", "--p-order", 3, "--q-order", 1, "--roughness", "0.6..0.9")
    assert (values["p_order"], values["q_order"]) == (3, 1)
    made = open_map("probe.she.exr")
    assert (len(made.p_coefficients), len(made.q_coefficients)) == (16, 3)
    assert made.ggx_alpha == pytest.approx((0.36, 0.81), rel=1e-6)
    header, channels = read_exr("probe.she.exr")
    assert channels["R"].shape == (1, 19)
    assert (header["shrm:p_order"], header["shrm:q_order"]) == (3, 1)


def test_orders_of_an_exponential_by_default(folder):
    text = done("prefilter", "probe.exr", "--to", "she")
    assert text.startswith("probe.she.exr: SH exponential, 25 + 8 coefficients a channel, float, ")
    assert "P = 4, Q = 2" in text
    assert read_exr("probe.she.exr")[1]["B"].shape == (1, 33)


@pytest.mark.parametrize("kind", KINDS)
def test_defaults_go_together(folder, kind):
    """What is made by default is shown by default, without a warning."""
    done("prefilter", "probe.exr", "--to", kind)
    assert run("render", f"probe.{kind}.exr", "--size", 16).err == ""


@pytest.mark.parametrize("kind", KINDS[:2])
def test_sampling_of_the_written_cubes(folder, kind):
    for sampling in ("center", "border"):
        prefiltered(kind, *SMALL[kind], "--map-sampling", sampling)
        assert open_map(f"probe.{kind}.exr").sampling == sampling
        with OpenEXR.File(f"probe.{kind}.exr") as file:
            tagged = ["envmap" in part.header for part in file.parts]
        assert set(tagged) == {sampling == "border"}


DAMAGE = [
    *[(kind, {"shrm:version": 8}, "newer shrm (format 8)") for kind in KINDS],
    *[(kind, {"shrm:brdf": "["}, "shrm:brdf") for kind in KINDS],
    *[(kind, {"shrm:F": 10**6}, "shrm:F") for kind in KINDS],
    *[(kind, {"shrm:F": None}, "shrm:F") for kind in KINDS],
    *[(kind, {"shrm:center": "tangent"}, "make it again") for kind in KINDS],
    *[(kind, {"shrm:frame": "local"}, "make it again") for kind in KINDS],
    *[(kind, {"shrm:layout": "strip", "shrm:orientation": "gl"}, "strip") for kind in KINDS],
    ("irradiance", {"shrm:F": 3}, "make it again"),
    ("irradiance", {"shrm:lighting_coefficients": "[[1, 2"}, "shrm:lighting_coefficients"),
    ("irradiance", {"shrm:lighting_coefficients": "[" * 10**5}, "shrm:lighting_coefficients"),
    ("irradiance", {"shrm:lighting_coefficients": "[[1, 2, 3]]"}, "shrm:lighting_coefficients"),
    ("irradiance", {"shrm:lighting_coefficients": None}, "shrm:lighting_coefficients"),
    ("irradiance", {"shrm:irradiance_matrices": "{}"}, "shrm:irradiance_matrices"),
    ("splitsum", {"shrm:mapping": "unity"}, "shrm:mapping"),
    ("splitsum", {"shrm:roughness": float("nan")}, "roughness"),
    ("splitsum", {"shrm:roughness": "rough"}, "roughness"),
    ("she", {"shrm:p_order": 3}, "coefficients"),
    ("she", {"shrm:p_order": 2**31 - 1}, "shrm:p_order"),
    ("she", {"shrm:q_order": -1}, "shrm:q_order"),
    ("she", {"shrm:q_order": "1"}, "shrm:q_order"),
    ("she", {"shrm:ggx_alpha": 0.5}, "shrm:ggx_alpha"),
]


@pytest.mark.parametrize(("kind", "changes", "words"), DAMAGE, ids=lambda value: str(value)[:40])
def test_damaged_files(sound, kind, changes, words):
    """Every part is changed; None removes."""
    with OpenEXR.File(f"probe.{kind}.exr", separate_channels=True) as file:
        parts = [
            OpenEXR.Part(
                {k: v for k, v in {**part.header, **changes}.items() if v is not None},
                {name: channel.pixels for name, channel in part.channels.items()},
            )
            for part in file.parts
        ]
    OpenEXR.File(parts).write("damaged.exr")
    before = snapshot(".")
    assert_refused(run("info", "damaged.exr"), 1, "damaged.exr: ", words)
    assert snapshot(".") == before


@pytest.mark.parametrize(
    ("kind", "name"),
    [
        ("irradiance", "lighting_coefficients"), ("irradiance", "irradiance_matrices"),
        ("irradiance", "window"), ("splitsum", "mapping"), ("she", "law"),
    ],
)  # fmt: skip
def test_attributes_of_a_type_that_nobody_knows(sound, kind, name):
    """OpenImageIO gives their bytes as an array."""
    path = Path(f"probe.{kind}.exr").resolve()
    data = path.read_bytes()
    before = f"shrm:{name}\0string\0".encode()
    assert before in data
    path.write_bytes(data.replace(before, before.replace(b"string", b"strinG")))
    assert_refused(run("info", path), 1, f"{path}: ", f"shrm:{name}")


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_every_flipped_byte_is_survived(sound, kind):
    """Damage anywhere in the headers gives a map or one line, and nothing else."""
    name = f"probe.{kind}.exr"
    data = Path(name).read_bytes()
    rng = np.random.default_rng(0)
    messages = []
    for position in rng.permutation(min(len(data), 4000))[:300]:
        broken = bytearray(data)
        broken[position] ^= 1 << int(rng.integers(8))
        Path("b.exr").write_bytes(broken)
        try:
            open_map("b.exr")
        except MapError as error:
            messages.append(str(error))
    assert len(messages) > 30
    assert not [message for message in messages if "\n" in message]


def test_truncated_files(sound):
    """As a process, at whose end libraries print of what nobody fetched."""
    names = []
    for kind, part in product(KINDS, (0.5, 0.98)):
        data = Path(f"probe.{kind}.exr").read_bytes()
        names.append(f"{kind}-{part}.exr")
        Path(names[-1]).write_bytes(data[: int(part * len(data))])
    for name, found in zip(names, several(*(("info", name) for name in names)), strict=True):
        assert_refused(found, 1, f"{name}: ")
