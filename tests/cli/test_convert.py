"""`shrm convert`, by what it writes."""

import json
import shutil

import numpy as np
import OpenEXR
import OpenImageIO as oiio
import pytest

from shrm_cli.maps.file import open_map
from tests import oracles
from tests.cli.helpers import (
    MAIN,
    assert_refused,
    done,
    noise,
    polynomial_light,
    process,
    read_exr,
    run,
    snapshot,
    write_exr,
)

EXPLICIT = ["cabral", "kautz-mccool", "lightfield"]
CUBE = {"openexr": (1, 6), "strip": (6, 1), "hcross": (4, 3), "vcross": (3, 4)}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Current folder with a smooth probe, and its map `m.shrm.exr`, P = 2."""
    light = polynomial_light(oracles.latlong_pixels(64, 32)).astype(np.float32)
    write_exr(tmp_path / "probe.exr", light)
    monkeypatch.chdir(tmp_path)
    done("prefilter", "probe.exr", "--brdf", "microfacet", "--to", "shrm", "-o", "m.shrm.exr",
         "--size", "16")  # fmt: skip
    return tmp_path


def relative(found, expected):
    """RMS of the difference over the RMS of what is expected."""
    return np.sqrt(np.sum((found - expected) ** 2) / np.sum(expected**2))


@pytest.mark.slow
@pytest.mark.parametrize("target", EXPLICIT)
def test_a_map_prefiltered_or_converted_is_the_same(folder, target):
    shared = ("--to", target, "--precision", "float")
    shared += ("--views", "8") if target == "lightfield" else ()
    done("convert", "m.shrm.exr", *shared)
    done("prefilter", "probe.exr", "--brdf", "microfacet", "--size", "16", *shared,
         "-o", "direct.exr")  # fmt: skip
    converted, direct = open_map(f"m.{target}.exr"), open_map("direct.exr")
    # The SHRM in between was rounded to half.
    assert relative(converted.images, direct.images) < 5e-4
    assert converted.info.brdf == direct.info.brdf
    assert converted.info.added_error == pytest.approx(direct.info.added_error, rel=1e-2)


@pytest.mark.slow
@pytest.mark.parametrize(("target", "bound"), [("cabral", 1e-3), ("lightfield", 1e-4)])
def test_there_and_back(folder, target, bound):
    done("convert", "m.shrm.exr", "--to", target, "-o", "there.exr")
    report = json.loads(done("convert", "there.exr", "--to", "shrm", "-o", "back.exr", "--json"))
    before, after = open_map("m.shrm.exr"), open_map("back.exr")
    assert after.coefficients.shape == before.coefficients.shape
    assert relative(after.coefficients, before.coefficients) < bound
    # What the fit leaves is the rounding of the images to half, and it is stored.
    assert 0 < report["fit_residual"] < 1e-3
    assert after.info.fit_residual == pytest.approx(report["fit_residual"], rel=1e-6)


def test_kautz_mccool_comes_back_without_azimuth(folder):
    done("convert", "m.shrm.exr", "--to", "kautz-mccool", "-o", "there.exr")
    done("convert", "there.exr", "--to", "shrm", "--frame", "local", "-o", "back.exr")
    before, after = open_map("m.shrm.exr").to_frame("local"), open_map("back.exr")
    zonal = [0, 2, 6]
    assert relative(after.coefficients[:, :, zonal], before.coefficients[:, :, zonal]) < 1e-3
    assert after.azimuth_free
    # Interpolating between the slices adds a little to what the azimuth had.
    lost = relative(after.coefficients, before.coefficients)
    assert lost < after.info.added_error < 1.2 * lost


def test_frames_there_and_back(folder):
    done("convert", "m.shrm.exr", "--to", "shrm", "--frame", "local", "-o", "local.exr")
    assert open_map("local.exr").frame == "local"
    done("convert", "local.exr", "--to", "shrm", "-o", "kept.exr")
    assert open_map("kept.exr").frame == "local"
    done("convert", "local.exr", "--to", "shrm", "--frame", "global", "-o", "back.exr")
    before, after = open_map("m.shrm.exr"), open_map("back.exr")
    assert after.frame == "global"
    assert relative(after.coefficients, before.coefficients) < 1e-3


def test_lower_orders(folder):
    report = json.loads(
        done("convert", "m.shrm.exr", "--to", "shrm", "--order-p", "1", "-o", "low.exr", "--json")
    )
    before, after = open_map("m.shrm.exr"), open_map("low.exr")
    assert np.array_equal(after.coefficients, before.coefficients[:, :, :4])
    assert (after.info.order_p, report["order_p"], report["maps"]) == (1, 1, 4)
    assert after.info.added_error > 0
    result = run("convert", "m.shrm.exr", "--to", "shrm", "--order-p", "3", "-o", "high.exr")
    assert_refused(result, 1, "order P = 2", "--order-p")


def test_too_few_samples_for_an_order(folder):
    done("convert", "m.shrm.exr", "--to", "cabral", "-o", "c.exr")
    result = run("convert", "c.exr", "--to", "shrm", "--order-p", "3", "-o", "x.exr")
    assert_refused(result, 1, "12 cabral images", "P = 2", "--order-p")


def test_numbers_of_samples_and_components(folder):
    done("convert", "m.shrm.exr", "--to", "kautz-mccool", "--slices", "7", "-o", "k.exr")
    assert open_map("k.exr").count == 7
    done("convert", "m.shrm.exr", "--to", "lightfield", "--views", "6", "-o", "l.exr")
    assert open_map("l.exr").count == 36
    done("convert", "m.shrm.exr", "--to", "shrm", "--compress", "pca:4", "-o", "c.exr")
    small = open_map("c.exr")
    assert (small.cube_count, small.matrix.shape) == (4, (4, 9))
    done("convert", "c.exr", "--to", "shrm", "-o", "whole.exr")
    whole = open_map("whole.exr")
    assert whole.coefficients.shape[2] == 9
    assert whole.info.added_error == small.info.added_error > 0
    done("convert", "m.shrm.exr", "--to", "shrm", "--compress", "pca:0.3", "-o", "t.exr")
    done("convert", "m.shrm.exr", "--to", "shrm", "--compress", "pca:9", "-o", "all.exr")
    assert json.loads(done("info", "all.exr", "--json"))["components"] == 9
    assert 1 <= open_map("t.exr").cube_count < 9
    assert open_map("t.exr").info.added_error <= 0.3


@pytest.mark.parametrize("layout", list(CUBE))
@pytest.mark.parametrize("orientation", ["openexr", "gl"])
def test_maps_in_cube_layouts(folder, layout, orientation):
    arguments = ["--to", layout, "--to-orientation", orientation, "-o", "there.exr"]
    done("convert", "m.shrm.exr", *arguments)
    header, channels = read_exr("there.exr")
    columns, rows = CUBE[layout]
    assert channels["sh000.R"].shape == (rows * 16, columns * 16)
    done("convert", "there.exr", "--to", "openexr", "--to-orientation", "openexr", "-o", "b.exr")
    assert np.array_equal(open_map("b.exr").coefficients, open_map("m.shrm.exr").coefficients)
    plain = (layout, orientation) == ("openexr", "openexr")
    assert ("shrm:layout" in header) == (not plain)


def test_a_map_as_lat_long_shows_the_map(folder):
    done("convert", "m.shrm.exr", "--to", "latlong")
    source = oiio.ImageInput.open("m.shrm.latlong.exr")
    assert (source.spec().width, source.spec().height) == (64, 32)
    _, channels = read_exr("m.shrm.latlong.exr")
    found = open_map("m.shrm.exr")
    directions = oracles.latlong_pixels(64, 32)
    expected = np.array(
        [found._sampler(direction)[0] for direction in directions[5, ::7]]
    )  # sh000.R
    assert channels["sh000.R"][5, ::7] == pytest.approx(expected, rel=2e-3)
    # And every reader takes it for what it is.
    again = open_map("m.shrm.latlong.exr")
    assert relative(again.coefficients, found.coefficients) < 5e-3
    done("render", "m.shrm.latlong.exr", "--size", "16", "-o", "x.exr")


def test_local_maps_are_no_lat_longs(folder):
    done("convert", "m.shrm.exr", "--to", "shrm", "--frame", "local", "-o", "l.exr")
    before = snapshot(folder)
    assert_refused(run("convert", "l.exr", "--to", "latlong"), 1, "local", "--frame global")
    assert snapshot(folder) == before


@pytest.mark.parametrize("target", ["openexr", "strip", "hcross", "vcross", "faces"])
def test_a_probe_there_and_back(folder, target):
    write_exr(
        "noise.exr", noise(16, 96).reshape(16, 6, 16, 3).transpose(1, 0, 2, 3).reshape(96, 16, 3)
    )
    name = "there_%.exr" if target == "faces" else "there.exr"
    done("convert", "noise.exr", "--to", target, "-o", name, "--precision", "float")
    done("convert", name, "--to", "openexr", "-o", "back.exr", "--precision", "float")
    before, after = read_exr("noise.exr")[1], read_exr("back.exr")[1]
    for c in "RGB":
        assert np.array_equal(before[c], after[c])


@pytest.mark.parametrize("sampling", ["center", "border"])
def test_a_lat_long_as_a_cube(folder, sampling):
    done("convert", "probe.exr", "--to", "openexr", "--size", "16", "--to-sampling", sampling)
    header, channels = read_exr("probe.openexr.exr")
    assert ("envmap" in header) == (sampling == "border")
    if sampling == "border":
        assert header["envmap"] == OpenEXR.ENVMAP_CUBE
    s = (2 * np.arange(16) + 1) / 16 - 1 if sampling == "center" else np.linspace(-1, 1, 16)
    # +Z: right is -X, down is -Y (ImfEnvmap.h).
    points = np.stack(np.broadcast_arrays(-s[None, :], -s[:, None], 1.0), axis=-1)
    points /= np.linalg.norm(points, axis=-1, keepdims=True)
    expected = polynomial_light(points)
    for k, c in enumerate("RGB"):
        assert channels[c][64:80] == pytest.approx(expected[..., k], abs=0.02)


def test_yaw_and_layout_of_a_probe_are_read(folder):
    done("convert", "probe.exr", "--to", "latlong", "--yaw", "90", "-o", "turned.exr")
    before, after = read_exr("probe.exr")[1], read_exr("turned.exr")[1]
    # From +Z towards +X, a quarter to the left.
    assert after["R"] == pytest.approx(np.roll(before["R"], -16, axis=1), rel=2e-3)


def test_a_probe_is_no_map(folder):
    result = run("convert", "probe.exr", "--to", "cabral")
    assert_refused(result, 2, "probe.exr", "no map", "shrm prefilter")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--to", "cabral", "--slices", "4"], ("--slices", "kautz-mccool")),
        (["--to", "cabral", "--views", "4"], ("--views", "lightfield")),
        (["--to", "cabral", "--frame", "local"], ("--frame",)),
        (["--to", "latlong", "--order-p", "1"], ("--order-p",)),
        (["--to", "cabral", "--compress", "pca:2"], ("--compress", "shrm")),
        (["--to", "shrm", "--compress", "pca:0"], ("--compress", "pca:K")),
        (["--to", "shrm", "--compress", "svd:2"], ("--compress", "pca:K")),
        (["--to", "shrm", "--compress", "pca:nan"], ("--compress", "pca:K")),
        (["--to", "ball"], ("--to",)),
    ],
)
def test_options_that_do_not_fit(folder, arguments, words):
    before = snapshot(folder)
    assert_refused(run("convert", "m.shrm.exr", *arguments), 2, *words)
    assert snapshot(folder) == before


def test_too_many_components(folder):
    result = run("convert", "m.shrm.exr", "--to", "shrm", "--compress", "pca:10", "-o", "x.exr")
    assert_refused(result, 1, "10 components", "1 .. 9")


def test_maps_as_angular_maps_are_refused(folder):
    assert_refused(run("convert", "m.shrm.exr", "--to", "angular"), 1, "angular", "latlong")


def test_inputs_are_kept(folder):
    before = snapshot(folder)
    result = run("convert", "m.shrm.exr", "--to", "latlong", "-o", "m.shrm.exr")
    assert_refused(result, 1, "m.shrm.exr", "overwrite the input")
    result = run("convert", "probe.exr", "--to", "strip", "-o", "probe.exr")
    assert_refused(result, 1, "probe.exr", "overwrite the input")
    assert_refused(run("convert", "none.exr", "--to", "strip"), 1, "none.exr", "no such file")
    assert_refused(run("convert", "probe.exr", "--to", "faces", "-o", "x.exr"), 2, "%")
    assert snapshot(folder) == before


@pytest.mark.slow
def test_the_same_bytes_twice(folder):
    for target in [*EXPLICIT, "latlong"]:
        for name in ("one.exr", "two.exr"):
            done("convert", "m.shrm.exr", "--to", target, "-o", name)
        assert (folder / "one.exr").read_bytes() == (folder / "two.exr").read_bytes()


@pytest.mark.parametrize(
    "arguments",
    [
        ["prefilter", "m.shrm.exr", "--brdf", "phong", "-o", "x.exr"],
        ["reference", "m.shrm.exr", "--brdf", "phong", "-o", "x.exr"],
        ["render", "m.shrm.exr", "--background", "m.shrm.exr", "-o", "x.exr"],
    ],
)
def test_a_map_is_no_probe(folder, arguments):
    before = snapshot(folder)
    assert_refused(run(*arguments), 1, "m.shrm.exr", "a map", "not a light probe")
    assert snapshot(folder) == before


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["convert", "m.shrm.exr", "--to", "cabral", "--mirror"], "--mirror applies to probes"),
        (["info", "m.shrm.exr", "--mirror"], "--mirror applies to probes"),
        (["render", "m.shrm.exr", "--clamp", "3", "-o", "x.exr"], "--clamp applies with --back"),
    ],
)
def test_options_about_probes_are_not_ignored(folder, arguments, words):
    before = snapshot(folder)
    assert_refused(run(*arguments), 2, words, "leave it out")
    assert snapshot(folder) == before


def test_what_no_attribute_can_tell_is_said(folder):
    """OpenEXR's envmap attribute means its own orientation."""
    result = run(
        "convert", "probe.exr", "--to", "openexr", "--to-orientation", "gl",
        "--to-sampling", "border", "-o", "gl.exr",
    )  # fmt: skip
    assert result.code == 0
    assert "--sampling border" in result.err
    assert "--orientation gl" in result.err
    assert "envmap" not in read_exr("gl.exr")[0]


def test_smaller_maps_say_what_they_lost(folder):
    done("convert", "m.shrm.exr", "--to", "openexr", "--size", "4", "-o", "small.exr")
    whole, small = open_map("m.shrm.exr"), open_map("small.exr")
    rng = np.random.default_rng(3)
    normals = rng.normal(size=(500, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    views = np.array([0.3, 0.5, np.sqrt(1 - 0.34)])
    lost = relative(small.radiance(normals, views), whole.radiance(normals, views))
    assert small.info.added_error == pytest.approx(lost, rel=0.5)
    assert small.info.added_error > 0.003


def test_a_brdf_is_not_overwritten(folder):
    done("brdf", "lambertian", "--save", "matte.exr")
    before = snapshot(folder)
    for spec in ("matte.exr", "0.5*matte.exr+0.5*lambertian"):
        result = run("prefilter", "probe.exr", "--brdf", spec, "-o", "matte.exr")
        assert_refused(result, 1, "matte.exr", "overwrite the input")
    result = run("brdf", "0.5*matte.exr+0.5*lambertian", "--save", "matte.exr")
    assert_refused(result, 1, "matte.exr", "overwrite the input")
    assert snapshot(folder) == before


ENGINES = {
    "irradiance": ("--size", "8", "--precision", "float"),
    "splitsum": ("--levels", "0.5,1.0", "--size", "16"),
    "she": ("--p-order", "2", "--q-order", "1"),
}


@pytest.fixture(scope="module")
def engine_maps(tmp_path_factory):
    """A map of each kind that engines use, made once."""
    made = tmp_path_factory.mktemp("engines")
    light = polynomial_light(oracles.latlong_pixels(64, 32)).astype(np.float32)
    write_exr(made / "probe.exr", light)
    for kind, options in ENGINES.items():
        done(
            "prefilter",
            made / "probe.exr",
            "--to",
            kind,
            *options,
            "-o",
            made / f"probe.{kind}.exr",
        )
    return made


@pytest.fixture
def engines(folder, engine_maps):
    """Besides: copies of them."""
    for kind in ENGINES:
        shutil.copy(engine_maps / f"probe.{kind}.exr", folder)
    return folder


def test_irradiance_of_another_size_is_exact(engines):
    report = json.loads(
        done("convert", "probe.irradiance.exr", "--to", "openexr", "--size", "12",
             "--to-sampling", "border", "--json")
    )  # fmt: skip
    assert report["file"] == "probe.irradiance.openexr.exr"
    assert (report["size"], report["sampling"], report["precision"]) == (12, "border", "float")
    done("prefilter", "probe.exr", "--to", "irradiance", "--size", "12", "--map-sampling", "border",
         "--precision", "float", "-o", "direct.exr")  # fmt: skip
    (made, planes), (direct, expected) = read_exr(report["file"]), read_exr("direct.exr")
    for name, plane in expected.items():
        np.testing.assert_array_equal(planes[name], plane)
    # The options are those of its prefiltering, which asked for another size.
    options = [json.loads(header.pop("shrm:options")) for header in (made, direct)]
    assert made.pop("shrm:digest") != direct.pop("shrm:digest")
    assert [each["size"] for each in options] == [8, 12]
    assert {key: str(value) for key, value in made.items()} == {
        key: str(value) for key, value in direct.items()
    }


@pytest.mark.parametrize("layout", [*CUBE, "latlong"])
def test_irradiance_in_other_layouts(engines, layout):
    done("convert", "probe.irradiance.exr", "--to", layout, "-o", "there.exr")
    header, channels = read_exr("there.exr")
    assert header["shrm:version"] == 3
    columns, rows = (4, 2) if layout == "latlong" else CUBE[layout]
    assert channels["G"].shape == (rows * 8, columns * 8)
    done("convert", "there.exr", "--to", "openexr", "-o", "back.exr")
    assert (engines / "back.exr").read_bytes() == (engines / "probe.irradiance.exr").read_bytes()


@pytest.mark.parametrize("kind", list(ENGINES))
def test_what_engines_use_becomes_itself(engines, kind):
    done("convert", f"probe.{kind}.exr", "--to", kind, "-o", "same.exr")
    assert open_map("same.exr").representation == kind
    one, two = run("info", f"probe.{kind}.exr"), run("info", "same.exr")
    assert one.out.splitlines()[1:] == two.out.splitlines()[1:]
    done("convert", f"probe.{kind}.exr", "--to", kind, "-o", "half.exr", "--precision", "half")
    with OpenEXR.File("half.exr") as file:
        assert file.parts[0].channels["RGB"].pixels.dtype == np.float16


@pytest.mark.parametrize("to", ["irradiance", "openexr"])
def test_irradiance_is_turned_without_its_probe(engines, to):
    """In two steps, which is the same as reading the probe so."""
    angles = "--yaw", 30, "--pitch", -20, "--roll", 70
    done("convert", "probe.irradiance.exr", "--to", to, "--roll", 70, "-o", "rolled.exr")
    done("convert", "rolled.exr", "--to", to, *angles[:4], "-o", "turned.exr")
    done("prefilter", "probe.exr", "--to", "irradiance", *ENGINES["irradiance"], *angles,
         "-o", "direct.exr")  # fmt: skip
    maps = [open_map(name) for name in ("probe.irradiance.exr", "turned.exr", "direct.exr")]
    before, turned, direct = (each.coefficients for each in maps)
    scale = abs(direct).max()
    assert abs(before - direct).max() > 0.05 * scale
    np.testing.assert_allclose(turned, direct, rtol=0, atol=1e-6 * scale)
    readings = [each.info.options["reading"] for each in maps]
    assert "axes" not in readings[0]
    np.testing.assert_allclose(readings[1].pop("axes"), readings[2].pop("axes"), atol=3e-9)
    assert readings[1] == readings[2] == readings[0]


def test_what_is_no_light_alone_cannot_be_turned(engines):
    for name in ("m.shrm.exr", "probe.splitsum.exr"):
        kind = name.split(".")[1]
        before = snapshot(engines)
        result = run("convert", name, "--to", kind, "--pitch", 5, "-o", "x.exr")
        assert_refused(result, 1, f"representation {kind} cannot be turned", "prefilter its probe")
        assert "--yaw, --pitch and --roll" in result.err
        assert snapshot(engines) == before


@pytest.mark.parametrize("kind", list(ENGINES))
@pytest.mark.parametrize("target", ["shrm", "cabral", "irradiance", "splitsum", "she"])
def test_what_engines_use_becomes_nothing_else(engines, kind, target):
    if target == kind:
        return
    before = snapshot(engines)
    result = run("convert", f"probe.{kind}.exr", "--to", target, "-o", "x.exr")
    assert_refused(result, 2, f"--to {target}", kind, f"shrm prefilter PROBE --to {target}")
    assert snapshot(engines) == before


@pytest.mark.parametrize("target", list(ENGINES))
def test_what_engines_use_is_made_from_probes_alone(engines, target):
    before = snapshot(engines)
    result = run("convert", "m.shrm.exr", "--to", target, "-o", "x.exr")
    assert_refused(result, 2, "representation shrm", f"shrm prefilter PROBE --to {target}")
    result = run("convert", "probe.exr", "--to", target, "-o", "x.exr")
    assert_refused(result, 2, "probe.exr is no map", "shrm prefilter")
    assert snapshot(engines) == before


@pytest.mark.parametrize(
    ("kind", "arguments", "code", "words"),
    [
        ("splitsum", ["--to", "strip"], 1, "OpenEXR's cube only"),
        ("splitsum", ["--to", "hcross"], 1, "OpenEXR's cube only"),
        ("splitsum", ["--to", "openexr", "--to-orientation", "gl"], 1, "OpenEXR's cube only"),
        ("splitsum", ["--to", "latlong"], 1, "no single image; give --view for what a viewer"),
        ("she", ["--to", "latlong"], 2, "no images; give --view for what a viewer sees"),
        ("irradiance", ["--to", "angular"], 1, "angular"),
        ("she", ["--to", "openexr"], 2, "no images"),
        ("she", ["--to", "strip"], 2, "no images"),
        ("splitsum", ["--to", "openexr", "--size", "8"], 2, "--size does not apply"),
        (
            "splitsum",
            ["--to", "splitsum", "--to-sampling", "border", "-o", "x.exr"],
            2,
            "--to-sampling does not apply",
        ),
        ("she", ["--to", "she", "--size", "8", "-o", "x.exr"], 2, "--size does not apply"),
        (
            "irradiance",
            ["--to", "irradiance", "--frame", "local"],
            2,
            "--frame applies with --to shrm",
        ),
        (
            "irradiance",
            ["--to", "irradiance", "--order-p", "1"],
            2,
            "--order-p applies with --to shrm",
        ),
        (
            "irradiance",
            ["--to", "irradiance", "--slices", "3"],
            2,
            "--slices applies with --to kautz",
        ),
        (
            "irradiance",
            ["--to", "irradiance", "--compress", "pca:2"],
            2,
            "--compress applies with --to shrm",
        ),
        ("irradiance", ["--to", "irradiance", "--mirror"], 2, "--mirror applies to probes"),
        ("irradiance", ["--to", "irradiance"], 1, "overwrite the input"),
        ("irradiance", ["--to", "irradiance", "--size", "5000", "-o", "x.exr"], 2, "--size"),
    ],
)
def test_what_says_nothing_of_what_engines_use(engines, kind, arguments, code, words):
    before = snapshot(engines)
    assert_refused(run("convert", f"probe.{kind}.exr", *arguments), code, words)
    assert snapshot(engines) == before


def test_a_mip_chain_as_a_lat_long_is_asked_for_by_mips(engines):
    done("prefilter", "probe.exr", "--to", "splitsum", "--mips", "-o", "chain.exr")
    result = run("convert", "chain.exr", "--to", "latlong", "-o", "x.exr")
    assert_refused(result, 1, "chain.exr: ", "give --mips for its levels", "or --view for")
    done("convert", "chain.exr", "--to", "latlong", "--mips", "-o", "x.exr")


def test_a_file_that_is_not_there_is_said_to_be_missing(folder):
    for target in ("cabral", "strip"):
        assert_refused(run("convert", "no.exr", "--to", target), 1, "no.exr: no such file")


def test_six_faces_on_a_full_disk(folder):
    """Either all faces are written or none of them; here the fourth fails."""
    code = f"""
import OpenEXR
write, count = OpenEXR.File.write, []
def write_some(self, name):
    count.append(name)
    if len(count) == 4:
        raise RuntimeError('cannot write "x". No space left on device.')
    write(self, name)
OpenEXR.File.write = write_some
{MAIN}"""
    (folder / "sky_+X.exr").write_text("old")
    before = snapshot(folder)
    command = ("convert", "probe.exr", "--to", "faces", "--size", "4", "-o", "sky_%.exr")
    result = process(*command, code=code)
    assert_refused(result, 1, "sky_-Y.exr: cannot be written (No space left on device)")
    assert snapshot(folder) == before
    done(*command)
    assert len(snapshot(folder)) == len(before) + 5


def test_what_zh3_leaves_out_is_told(folder):
    """Three decimals of what the map's own coefficients lose, in irradiance."""
    done("prefilter", "probe.exr", "--to", "irradiance", "-o", "sh.exr")
    told = done("convert", "sh.exr", "--to", "irradiance", "--form", "zh3", "-o", "zh3.exr")
    factors = np.repeat([np.pi, 2 * np.pi / 3, np.pi / 4], [1, 3, 5])[:, None]
    whole, left = (factors * open_map(name).coefficients for name in ("sh.exr", "zh3.exr"))
    lost = np.linalg.norm(left - whole) / np.linalg.norm(whole)
    assert lost > 0.001
    assert f"  RMS error      {lost:.3%} added by its form\n" in told
    assert "RMS" not in done("convert", "sh.exr", "--to", "irradiance", "-o", "same.exr")
