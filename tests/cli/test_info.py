"""`shrm info`: maps and probes, for people and for programs."""

import hashlib
import json
import re
import struct
from pathlib import Path

import numpy as np
import pytest

from shrm_cli.batch.collect import Collection, write_collection
from shrm_cli.brdf.spec import parse_spec
from tests import oracles
from tests.brdf.measured.goniometer_files import write_goniometer
from tests.cli.helpers import (
    assert_refused,
    done,
    noise,
    process,
    run,
    several,
    snapshot,
    write_exr,
)
from tests.fuzz.exr_header import Attribute, parse

MAP_KEYS = [
    "file", "kind", "representation", "frame", "center", "size", "sampling", "maps", "domain",
    "order_f", "order_p", "order_carried", "epsilon", "brdf_energy_captured", "predicted_error",
    "added_error", "filter_error", "storage_error", "fit_residual", "brdf", "probe",
    "probe_sha256", "chromaticities", "warnings",
]  # fmt: skip
PROBE_KEYS = [
    "file", "kind", "layout", "width", "height", "sampling", "format", "channels", "encoding",
    "minimum", "maximum", "mean", "mean_luminance", "stops", "irradiance", "white_balance",
    "light_from", "clipped", "primaries", "lamps", "advice", "sha256", "warnings",
]  # fmt: skip


@pytest.fixture
def folder(tmp_path, monkeypatch):
    write_exr(tmp_path / "probe.exr", noise())
    monkeypatch.chdir(tmp_path)
    return tmp_path


def lines(text):
    """The pairs of the human form: the name of the file, then a line each."""
    first, *rest = text.splitlines()
    pairs = (line.split("  ", 2)[1:] for line in rest)
    return first, {key: value.strip() for key, value in pairs}


def test_map_as_json(folder):
    made = json.loads(
        done(
            "prefilter",
            "probe.exr",
            "--brdf",
            "microfacet:sigma=0.3",
            "--eps",
            "0.03",
            "--json",
            "-o",
            "m.exr",
        )
    )
    values = json.loads(done("info", "m.exr", "--json"))
    assert list(values) == MAP_KEYS
    assert values["kind"] == "map"
    assert values["maps"] == (values["order_p"] + 1) ** 2
    assert values["chromaticities"] is None
    assert values["warnings"] == []
    # What prefilter said is what info says, under the same names.
    for key in made.keys() & values.keys() - {"file", "warnings"}:
        expected = made[key]
        if isinstance(expected, float):
            expected = pytest.approx(expected, rel=1e-6)
        assert values[key] == expected
    assert values["epsilon"] == 0.03


def test_map_for_people(folder):
    done("prefilter", "probe.exr", "--brdf", "microfacet", "-o", "m.exr", "--frame", "local")
    name, pairs = lines(done("info", "m.exr"))
    assert name == "m.exr"
    assert pairs["kind"] == "map"
    assert pairs["frame"] == "local"
    assert (pairs["order f"], pairs["order p"]) == ("11", "2")
    assert pairs["epsilon"] == "0.03"
    assert pairs["brdf"] == "name microfacet, parameters sigma 0.2"
    assert pairs["probe"] == "probe.exr"
    assert pairs["chromaticities"] == "none"
    facts = json.loads(done("info", "m.exr", "--json"))
    assert facts["predicted_error"] > 0.01
    assert pairs["predicted error"] == f"{facts['predicted_error']:.2%} (RMS)"
    assert pairs["brdf energy captured"] == f"{facts['brdf_energy_captured']:.2%}"


@pytest.mark.parametrize(("spec", "frame", "count"), [
    ("phong", "local", 1), ("microfacet", "local", 9), ("microfacet", "global", 9)
])  # fmt: skip
def test_stored_coefficients_are_counted(folder, spec, frame, count):
    done("prefilter", "probe.exr", "--brdf", spec, "--frame", frame, "-o", "m.exr")
    assert json.loads(done("info", "m.exr", "--json"))["maps"] == count


def test_probe_as_json(folder):
    pixels = noise()
    values = json.loads(done("info", "probe.exr", "--json"))
    assert list(values) == PROBE_KEYS
    assert values["kind"] == "probe"
    assert (values["layout"], values["format"]) == ("latlong", "openexr")
    assert (values["width"], values["height"]) == (32, 16)
    assert values["minimum"] == pytest.approx(pixels.min(axis=(0, 1)).tolist())
    assert values["maximum"] == pytest.approx(pixels.max(axis=(0, 1)).tolist())
    assert values["sha256"] == hashlib.sha256((folder / "probe.exr").read_bytes()).hexdigest()
    # The mean is over the sphere: rows weigh by their solid angle.
    edges = np.cos(np.pi * np.arange(17) / 16)
    weights = (edges[:-1] - edges[1:]) / 2
    expected = weights @ pixels.astype(float).mean(axis=1)
    assert values["mean"] == pytest.approx(expected.tolist(), rel=0.01)


def test_a_probe_without_reading_its_pixels(folder):
    values = json.loads(done("info", "probe.exr", "--no-stats", "--json"))
    gathered = PROBE_KEYS[PROBE_KEYS.index("minimum") : PROBE_KEYS.index("sha256")]
    assert list(values) == [key for key in PROBE_KEYS if key not in gathered]
    whole = json.loads(done("info", "probe.exr", "--json"))
    assert values == {key: whole[key] for key in values}


def test_the_brightest_lamps_are_lines(folder):
    image = np.ones((64, 128, 3), np.float32)
    image[16, 32] = image[40, 90] = 9e4
    write_exr("lamps.exr", image)
    text = done("info", "lamps.exr")
    places = [
        line.split("azimuth")[1].split(",")[0] for line in text.splitlines() if "radius" in line
    ]
    assert sorted(float(place) for place in places) == pytest.approx([-74.5, 88.6], abs=0.1)


@pytest.mark.parametrize(("level", "radius"), [(9e4, 0.5), (9e3, 0.5), (90, 0.5), (9e3, 3)])
def test_small_lamps_that_hold_much_of_the_light_are_worth_advice(folder, level, radius):
    """The share by hand: what is brighter than the ground, over everything."""
    directions = oracles.latlong_pixels(512, 256)
    places = np.array([[0.0, 0.6, 0.8], [0.8, 0.0, -0.6]])
    is_lamp = (directions @ places.T > np.cos(np.radians(radius))).any(axis=-1)
    image = np.repeat(np.where(is_lamp, level, 1.0)[..., None], 3, axis=2).astype(np.float32)
    write_exr("lamps.exr", image)
    edges = np.cos(np.pi * np.arange(257) / 256)
    light = (edges[:-1] - edges[1:]) @ image[..., 0].astype(float)
    share = 1 - 2 * 512 / light.sum()
    values = json.loads(done("info", "lamps.exr", "--json"))
    advice = values["advice"]
    if level > 100:
        assert sum(lamp["share"] for lamp in values["lamps"]) == pytest.approx(share, rel=0.02)
    assert bool(advice) == (share > 0.02 and radius < 1)
    if advice:
        words = r"2 lamps of [\d. to]+ degrees hold (\d+)% of the light: `--sun split`"
        found = re.fullmatch(words, advice)
        assert int(found[1]) == pytest.approx(100 * share, abs=1.5)
    assert lines(done("info", "lamps.exr"))[1]["advice"] == (advice or "none")


def test_numbers_of_a_probe_have_units(folder):
    text = done("info", "probe.exr")
    pairs = lines(text)[1]
    assert pairs["maximum"].endswith(" of radiance")
    assert "in all" in pairs["stops"]
    assert " degrees, directionality 0." in pairs["light from"]
    assert "radiance x sr" in text
    assert "; kelvin " in pairs["white balance"]


def test_probe_for_people(folder):
    name, pairs = lines(done("info", "probe.exr"))
    assert name == "probe.exr"
    assert pairs["kind"] == "probe"
    assert pairs["layout"] == "latlong"
    assert pairs["width"] == "32"
    assert "orientation" not in pairs
    assert len(pairs["mean"].split(", ")) == 3


def test_cubes_have_an_orientation(folder):
    write_exr("cube.exr", np.ones((24, 4, 3), np.float32))
    write_exr("strip.exr", np.ones((4, 24, 3), np.float32))
    for name, orientation in [("cube.exr", "openexr"), ("strip.exr", "gl")]:
        assert json.loads(done("info", name, "--json"))["orientation"] == orientation
    values = json.loads(done("info", "strip.exr", "--orientation", "openexr", "--json"))
    assert values["orientation"] == "openexr"


def test_warnings_go_to_stderr_and_into_json(folder):
    pixels = noise()
    pixels[0, 0, 1] = -2
    write_exr("negative.exr", pixels)
    human = process("info", "negative.exr")
    assert human.code == 0
    assert human.err == (
        "Warning: negative.exr: 1 pixel with negative radiance was clamped to 0 (minimum -2)\n"
    )
    assert "Warning" not in human.out
    values = json.loads(run("info", "negative.exr", "--json").out)
    warning = human.err.removeprefix("Warning: ").rstrip()
    assert values["warnings"] == [warning]
    assert values["minimum"][1] == 0


def test_quiet_prints_nothing(folder):
    write_exr("black.exr", np.zeros((8, 16, 3), np.float32))
    assert run("info", "black.exr").err == "Warning: black.exr: the probe is black\n"
    result = run("info", "black.exr", "--quiet")
    assert (result.code, result.out, result.err) == (0, "", "")
    assert run("info", "missing.exr", "--quiet").err != ""


def test_a_newer_map_is_not_taken_for_a_probe(folder):
    pixels = np.ones((6, 1, 3), np.float32)
    write_exr("new.exr", pixels, **{"shrm:representation": "shrm", "shrm:version": 9})
    assert_refused(run("info", "new.exr"), 1, "new.exr", "newer shrm (format 9)", "update shrm")


def test_bad_files(folder):
    """As a process: OpenImageIO would print what nobody fetched when it ends."""
    (folder / "directory.exr").mkdir()
    (folder / "empty.exr").touch()
    (folder / "text.exr").write_text("no image")
    done("prefilter", "probe.exr", "--brdf", "microfacet", "--to", "shrm", "-o", "map.exr")
    (folder / "cut-map.exr").write_bytes((folder / "map.exr").read_bytes()[:-2000])
    (folder / "cut-probe.exr").write_bytes((folder / "probe.exr").read_bytes()[:-100])
    before = snapshot(folder)
    names = [f"{kind}.exr" for kind in ("missing", "directory", "empty", "text", "cut-map",
             "cut-probe")]  # fmt: skip
    for name, found in zip(names, several(*(("info", name) for name in names)), strict=True):
        assert_refused(found, 1, f"{name}: ")
    assert snapshot(folder) == before


def test_a_table_of_a_brdf(folder):
    done("brdf", "lambertian", "--save", "matte.exr")
    values = json.loads(done("info", "matte.exr", "--json"))
    assert values["kind"] == "BRDF table"
    assert values["center"] == "normal"
    assert "shrm brdf matte.exr" in done("info", "matte.exr")
    done("brdf", "lambertian", "--save", "matte.npz")
    packed = json.loads(done("info", "matte.npz", "--json"))
    assert {**packed, "file": "matte.exr", "see": values["see"]} == values
    assert packed["see"] == "shrm brdf matte.npz"


def test_a_collection_of_coefficients(folder):
    write_collection(
        "light.npz", Collection(["a", "b"], ["1", "2"], np.ones((2, 4, 3)), "radiance", 1)
    )
    values = json.loads(done("info", "light.npz", "--json"))
    assert (values["kind"], values["probes"]) == ("collection of coefficients", 2)
    assert (values["what"], values["order"], values["shape"]) == ("radiance", 1, [4, 3])
    assert_refused(run("info", "light.npz", "--yaw", "5"), 2, "a collection of coefficients")


@pytest.mark.slow
def test_a_measured_brdf(folder):
    write_goniometer("paint.brdf", parse_spec("microfacet:sigma=0.5"), 4, 4)
    values = json.loads(done("info", "paint.brdf", "--json"))
    assert (values["kind"], values["format"]) == ("measured BRDF", "goniometer")
    assert values["see"] == "shrm brdf paint.brdf"
    assert_refused(run("info", "paint.brdf", "--yaw", "5"), 2, "measured BRDF")


def test_archives_that_are_no_table(folder):
    np.savez("numbers.npz", values=np.ones(3), others=np.ones(3))
    refused = process("info", "numbers.npz")  # whose end would print what is not fetched
    assert_refused(refused, 1, "numbers.npz: an archive, not an image")


@pytest.mark.parametrize(
    ("names", "what"),
    [
        (["reflected", "direct", "box", "settings"], "a grid of probes, not one"),
        (["vectors", "albedo", "settings"], "give it to --transfer of shrm render"),
    ],
)
def test_what_else_shrm_keeps_in_archives_is_told_from_a_probe(folder, names, what):
    np.savez("other.npz", **dict.fromkeys(names, np.ones(3)))
    assert_refused(run("export", "other.npz", "--for", "three"), 1, "other.npz: ", what)


@pytest.mark.parametrize("command", [["info"], ["prefilter", "--to", "irradiance"]])
def test_a_table_that_is_cut_is_told_as_such(folder, command):
    """The directory of an archive is at its end; what is left still begins as one."""
    done("brdf", "lambertian", "--save", "matte.npz")
    path = folder / "matte.npz"
    names = []
    for kept in (path.stat().st_size // 2, 40):
        names.append(f"cut-{kept}.npz")
        (folder / names[-1]).write_bytes(path.read_bytes()[:kept])
    results = several(*((*command, name) for name in names))
    for name, refused in zip(names, results, strict=True):
        assert_refused(refused, 1, f"{name}: a damaged or truncated archive, not an image; copy it")
        assert "--brdf" in refused.err


@pytest.mark.parametrize("name", ["matte.exr", "matte.npz"])
def test_a_table_of_a_brdf_is_no_probe(folder, name):
    done("brdf", "lambertian", "--save", name)
    for command in (["prefilter", name, "--brdf", "phong"], ["convert", name, "--to", "strip"]):
        assert_refused(run(*command), 1, f"{name}: a", "not a", "--brdf")


ENGINE_KEYS = [
    "file", "kind", "representation", "frame", "center", "probe", "probe_sha256",
    "chromaticities", "warnings",
]  # fmt: skip


def test_irradiance(folder):
    made = json.loads(
        done("prefilter", "probe.exr", "--to", "irradiance", "--window", "hann", "--json")
    )
    values = json.loads(done("info", "probe.irradiance.exr", "--json"))
    assert values.keys() >= set(ENGINE_KEYS)
    shared = (
        "representation", "center", "size", "sampling", "order_f", "coefficients",
        "lighting_coefficients", "irradiance_matrices", "minimum_irradiance", "probe_sha256",
    )  # fmt: skip
    for key in shared:
        assert values[key] == made[key]
    for key in ("predicted_error", "added_error"):
        assert values[key] == pytest.approx(made[key], rel=1e-6)
    assert values["window"]["name"] == "hann"
    assert values["window"]["width"] == 3
    assert values["window"]["factors"] == pytest.approx([1, 0.75, 0.25])
    _, pairs = lines(done("info", "probe.irradiance.exr"))
    assert pairs["order f"] == "2"
    assert "name hann, width 3, factors 1, 0.75, 0.25" in pairs["window"]


def test_many_coefficients_are_left_to_json(folder):
    done("prefilter", "probe.exr", "--to", "irradiance", "--order-f", "20", "--quiet")
    assert (
        len(json.loads(done("info", "probe.irradiance.exr", "--json"))["lighting_coefficients"])
        == 441
    )
    _, pairs = lines(done("info", "probe.irradiance.exr"))
    assert pairs["coefficients"] == "441"
    assert pairs["lighting coefficients"] == "see --json"


def test_split_sum(folder):
    made = json.loads(
        done(
            "prefilter", "probe.exr", "--to", "splitsum", "--levels", "0.4,0.7,1.0", "--size", "16",
            "--mapping", "filament", "--json",
        )
    )  # fmt: skip
    values = json.loads(done("info", "probe.splitsum.exr", "--json"))
    assert values.keys() >= set(ENGINE_KEYS)
    assert (values["mapping"], values["size"]) == ("filament", made["size"])
    assert [level["roughness"] for level in values["levels"]] == pytest.approx([0.4, 0.7, 1])
    for found, expected in zip(values["levels"], made["levels"], strict=True):
        for key in ("size", "order_f", "domain"):
            assert found[key] == expected[key]
    text = done("info", "probe.splitsum.exr")
    assert "mapping" in text
    for level in values["levels"]:
        assert f"roughness {level['roughness']:g}, size {level['size']}" in text


def test_exponential(folder):
    done(
        "prefilter", "probe.exr", "--to", "she", "--p-order", "3", "--q-order", "1",
        "--roughness", "0.6..0.9",
    )  # fmt: skip
    values = json.loads(done("info", "probe.she.exr", "--json"))
    assert values.keys() >= set(ENGINE_KEYS)
    assert (values["p_order"], values["q_order"]) == (3, 1)
    assert values["coefficients"] == 16 + 3
    assert values["roughness"] == pytest.approx([0.6, 0.9], rel=1e-6)
    assert values["ggx_alpha"] == pytest.approx([0.36, 0.81], rel=1e-6)
    assert np.shape(values["p_coefficients"]) == (16, 3)
    assert np.shape(values["q_coefficients"]) == (3, 3)
    _, pairs = lines(done("info", "probe.she.exr"))
    assert (pairs["p order"], pairs["q order"]) == ("3", "1")
    done("prefilter", "probe.exr", "--to", "she", "--q-order", "0", "--force")
    assert lines(done("info", "probe.she.exr"))[1]["q coefficients"] == "none"


@pytest.mark.parametrize("multiscatter", [False, True])
def test_an_environment_table(folder, multiscatter):
    option = "--multiscatter" if multiscatter else "--no-multiscatter"
    done("dfg", "--size", "8", option, "-o", "dfg.exr")
    values = json.loads(done("info", "dfg.exr", "--json"))
    assert values["kind"] == "environment-BRDF table"
    assert (values["width"], values["height"]) == (8, 8)
    assert values["multiscatter"] is multiscatter
    _, pairs = lines(done("info", "dfg.exr"))
    assert pairs["multiscatter"] == ("yes" if multiscatter else "no")
    assert "bias" in pairs["channels"]
    assert "f0" in pairs["reflectance"]
    assert_refused(run("info", "dfg.exr", "--mirror"), 2, "environment-BRDF table")


def test_levels_of_a_split_sum_are_all_shown(folder):
    levels = [0.3 + 0.05 * k for k in range(12)]
    spec = ",".join(f"{level:.2f}" for level in levels)
    done("prefilter", "probe.exr", "--to", "splitsum", "--levels", spec, "--size", "8")
    text = done("info", "probe.splitsum.exr")
    assert text.count("domain frequency") + text.count("domain angular") == 12


@pytest.mark.parametrize(
    "command",
    [
        ("dfg", "--size", "16", "-o"),
        ("dfg", "--size", "16", "--moments", "-o"),
        ("brdf", "ggx:roughness=0.5", "--save"),
    ],
)
def test_tables_that_are_cut_off(folder, command):
    done(*command, "t.exr")
    assert "table" in done("info", "t.exr")
    data = (folder / "t.exr").read_bytes()
    (folder / "cut.exr").write_bytes(data[: len(data) * 3 // 4])
    assert_refused(run("info", "cut.exr"), 1, "cut.exr: damaged", "make it again")


@pytest.mark.parametrize(
    ("kind", "data"),
    [
        (b"string", b"abcdefgh"),
        (b"chromaticities", struct.pack("<8f", *[float("nan")] * 8)),
        (b"chromaticities", struct.pack("<8f", *[float("inf")] * 8)),
    ],
)
def test_chromaticities_that_are_none(folder, kind, data):
    """They were shown as eight letters, and passed on to files that could not be written."""
    headers = parse((folder / "probe.exr").read_bytes())
    headers.parts[0].append(Attribute(b"chromaticities", kind, data))
    (folder / "odd.exr").write_bytes(headers.packed())
    assert "chromaticities" not in json.loads(done("info", "odd.exr", "--json"))
    done("prefilter", "odd.exr", "--brdf", "phong", "--to", "shrm", "--size", "4", "-o", "m.exr")
    assert json.loads(done("info", "m.exr", "--json"))["chromaticities"] is None


@pytest.mark.slow
def test_a_light_file(folder):
    """What is in it, what it comes to, and the hash of its files."""
    text = (
        '[[probe]]\nfile = "probe.exr"\nscale = 2\nyaw = 90\n'
        "[[disc]]\ndirection = [1, 0, 0]\nsolid_angle = 6.283185307179586\nirradiance = [3, 2, 1]\n"
    )
    (folder / "lights.toml").write_text(text)
    value = json.loads(done("info", "lights.toml", "--json"))
    assert (value["kind"], value["width"], value["height"]) == ("light file", 1024, 512)
    (probe,), (disc,) = value["probes"], value["discs"]
    assert (probe["file"], probe["scale"], probe["layout"]) == ("probe.exr", [2, 2, 2], "latlong")
    np.testing.assert_allclose(probe["axes"], [[0, 0, 1], [0, 1, 0], [-1, 0, 0]])
    assert (disc["azimuth"], disc["elevation"]) == (90, 0)
    assert disc["radius"] == pytest.approx(90)
    np.testing.assert_allclose(disc["radiance"], np.array([3, 2, 1]) / np.pi)
    files = text.encode() + (folder / "probe.exr").read_bytes()
    assert value["sha256"] == hashlib.sha256(files).hexdigest()
    alone = np.array(json.loads(done("info", "probe.exr", "--json"))["mean"])
    expected = 2 * alone + np.array([3, 2, 1]) / np.pi / 2
    np.testing.assert_allclose(value["mean"], expected, rtol=1e-3)
    _, pairs = lines(done("info", "lights.toml"))
    assert pairs["discs"].startswith("azimuth 90, elevation 0, radius 90, solid angle 6.28319")
    assert pairs["probes"].startswith("file probe.exr, scale 2, 2, 2")
    assert_refused(run("info", "lights.toml", "--layout", "strip"), 1, "--layout says nothing")


def test_light_without_green_has_no_balance_over_it(tmp_path):
    image = np.zeros((16, 32, 3), np.float32)
    image[..., 2] = 1
    write_exr(tmp_path / "blue.exr", image)
    assert "over green none; xy 0.15, 0.06" in done("info", tmp_path / "blue.exr")
    found = json.loads(done("info", tmp_path / "blue.exr", "--json"))
    assert found["white_balance"]["over_green"] is None


def test_textures_of_a_map_are_called_so(folder):
    """Their parts are no lights to choose from."""
    done(
        "prefilter", "probe.exr", "--brdf", "microfacet", "--to", "shrm", "-o", "m.exr", "--size", 8
    )
    done("convert", "m.exr", "--to", "layers", "-o", "t.exr")
    values = json.loads(done("info", "t.exr", "--json"))
    assert (values["kind"], values["of"]) == ("textures of --shader", "shrm")
    assert values["probe"] == "probe.exr"
    layers, height, width = values["shrm_layers"]
    assert layers == json.loads(done("info", "m.exr", "--json"))["maps"]
    assert min(height, width) > 8
    _, told = lines(done("info", "t.exr"))
    assert told["shrm layers"] == f"{layers}, {height}, {width}"
    assert_refused(run("info", "t.exr", "--layout", "latlong"), 2, "holds the textures of a map")
    result = run("prefilter", "t.exr", "--brdf", "phong", "-o", "x.exr")
    assert_refused(result, 1, "t.exr", "textures that shrm made", "name the probe")


def test_files_that_are_no_images_are_told_by_their_type(tmp_path):
    for name in ("page.html", "log.jsonl", "light.ktx"):
        (tmp_path / name).write_text("<html>")
        said = f"{name}: {Path(name).suffix} is no type of image that is read; give .exr, .hdr"
        assert_refused(run("info", tmp_path / name), 1, said)


def test_what_rounds_to_0_has_no_sign(folder):
    """Light from straight ahead came from an azimuth of -0.0."""
    (folder / "a.toml").write_text("[[sh]]\ncoefficients = [1, 0, 0.5, -1e-9]\n")
    assert "azimuth 0.0, elevation 0.0 degrees" in done("info", "a.toml")


@pytest.mark.parametrize(
    ("options", "file", "kind", "size"),
    [
        (["babylon"], "probe.env", "environment of Babylon.js", {"width": 32, "levels": 6}),
        (["filament"], "probe_ibl.ktx", "KTX 1 texture of engines", {"width": 32, "height": 32}),
        (["gltf"], "probe.gltf", "light of glTF (EXT_lights_image_based)", {"width": 32}),
        (["unity"], "probe_sh.json", "coefficients in the axes of an engine", {}),
        (["unreal"], "probe_sh.json", "coefficients in the axes of an engine", {}),
        (["directx", "--format", "rgb9e5"], "probe.dds", "DDS texture of engines", {"width": 32}),
        (["directx", "--format", "r11g11b10"], "probe.dds", "DDS texture of engines", {}),
    ],
)
def test_files_for_engines_are_told(folder, options, file, kind, size):
    """They were no TIFF, no type of image, without triangles or without radiance."""
    done("export", "probe.exr", "--for", *options, "--size", "32", "-o", "made")
    told = json.loads(done("info", f"made/{file}", "--json"))
    assert (told["kind"], told["bytes"]) == (kind, (folder / "made" / file).stat().st_size)
    assert told.items() >= size.items()
    assert told["use"] == "for engines; shrm reads the probe or the map that it was made of"
    assert_refused(run("info", f"made/{file}", "--yaw", "5"), 2, "is for engines")
    if file.endswith((".env", ".ktx", ".json")):
        refused = run("prefilter", f"made/{file}", "--to", "irradiance", "-o", "x.exr")
        assert_refused(refused, 1, file, "for engines", "name the probe or the map")
    if file.endswith((".env", ".dds")):
        data = (folder / "made" / file).read_bytes()
        for kept in (len(data) // 2, len(data) - 1):
            (folder / file).write_bytes(data[:kept])
            assert_refused(run("info", file), 1, f"{file}: damaged or truncated; export it again")


@pytest.mark.parametrize(
    ("kind", "tree"),
    [
        ("lamps beside a map", {"about": "Lamps", "lamps": []}),
        (
            "grid of probes",
            dict.fromkeys(["type", "version", "min", "max", "resolution", "coefficients"], 1),
        ),
    ],
)
def test_json_for_engines_is_told_by_its_keys(folder, kind, tree):
    (folder / "a.json").write_text(json.dumps(tree))
    assert json.loads(done("info", "a.json", "--json"))["kind"] == kind
    assert_refused(run("prefilter", "a.json", "--to", "irradiance"), 1, f"a.json: {kind}, for eng")


def test_ktx2_is_for_engines(folder):
    done("export", "probe.exr", "--for", "three", "--size", "16", "-o", "made")
    refused = run("prefilter", "made/probe.ktx2", "--to", "irradiance", "-o", "x.exr")
    assert_refused(refused, 1, "probe.ktx2: a file for engines, not an image that is read")
    data = (folder / "made" / "probe.ktx2").read_bytes()
    for kept in (20, 100, len(data) - 1):
        (folder / "cut.ktx2").write_bytes(data[:kept])
        assert_refused(run("info", "cut.ktx2"), 1, "cut.ktx2: damaged or truncated; export it")


def test_the_irradiance_of_coefficients_is_that_of_the_coefficients(folder):
    """Not that of their pixels, which are negative nowhere, and so not quite this light."""
    light = np.array([1.5, 0.5, -0.25, 3.0])[:, None] * [1, 0.5, 0.25]  # 1, y, z, x
    np.save(folder / "light.npy", light)
    told = json.loads(run("info", "light.npy", "--json").out)
    constant, linear = np.pi * np.sqrt(1 / (4 * np.pi)), 2 * np.pi / 3 * np.sqrt(3 / (4 * np.pi))
    for axis, along in (("X", 3), ("Y", 1), ("Z", 2)):
        for sign in (1, -1):
            wanted = constant * light[0] + sign * linear * light[along]
            found = told["irradiance"][f"{'+' if sign > 0 else '-'}{axis}"]
            np.testing.assert_allclose(found, wanted, rtol=1e-6)
    np.testing.assert_allclose(told["mean"], light[0] / np.sqrt(4 * np.pi), rtol=1e-6)
