"""`shrm prefilter`: the file it writes, opened with OpenEXR alone, and what it reports."""

import hashlib
import json

import numpy as np
import OpenEXR
import pytest

from shrm_cli.maps.file import open_map
from tests import brute_force, oracles
from tests.cli.helpers import (
    WRONG_PICTURE,
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

P3 = (0.68, 0.32, 0.265, 0.69, 0.15, 0.06, 0.3127, 0.329)
NAME = "probe.microfacet.shrm.exr"
COMMAND = ("prefilter", "probe.exr", "--brdf", "microfacet", "--eps", "0.03")
STANDARD = {
    "compression", "dataWindow", "displayWindow", "lineOrder", "pixelAspectRatio",
    "screenWindowCenter", "screenWindowWidth", "type",
}  # fmt: skip
OURS = {
    "shrm:representation", "shrm:version", "shrm:program", "shrm:sources", "shrm:digest",
    "shrm:frame", "shrm:center", "shrm:F", "shrm:P",
    "shrm:epsilon", "shrm:brdf_energy_captured", "shrm:predicted_error", "shrm:brdf",
    "shrm:probe", "shrm:probe_sha256", "shrm:filter_error", "shrm:options",
}  # fmt: skip
KEYS = [
    "file", "representation", "frame", "center", "size", "sampling", "maps", "domain", "order_f",
    "order_p", "order_carried", "epsilon", "brdf_energy_captured", "predicted_error",
    "added_error", "filter_error", "storage_error", "error_bound", "predicted_wrong_share",
    "negative_share", "worst_negative_share", "brdf", "probe", "probe_sha256", "bytes",
    "precision", "warnings",
]  # fmt: skip


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Current folder with a smooth probe, 64 x 32."""
    light = polynomial_light(oracles.latlong_pixels(64, 32)).astype(np.float32)
    write_exr(tmp_path / "probe.exr", light)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def names(order_p):
    """Channel names by hand: sh000.R to sh008.B for P = 2."""
    return {f"sh{index:03d}.{colour}" for index in range((order_p + 1) ** 2) for colour in "RGB"}


def stacked(channels, order_p):
    """Coefficients (6N, N, (P+1)^2, 3) of a file's channels."""
    planes = [
        np.stack([channels[f"sh{k:03d}.{c}"].astype(float) for c in "RGB"], axis=-1)
        for k in range((order_p + 1) ** 2)
    ]
    return np.stack(planes, axis=2)


def test_works_as_typed_in_the_issue(folder):
    result = process(*COMMAND)
    assert result.code == 0
    assert result.out.startswith(f"{NAME}: global SHRM, 6 x 32 x 32 texels of 9 coefficients, half")
    assert "F = 11, P = 2" in result.out
    assert sorted(snapshot(folder)) == ["probe.exr", NAME]


def test_header_says_what_the_conventions_list(folder):
    done(*COMMAND)
    header, channels = read_exr(NAME)
    assert header.keys() == STANDARD | OURS
    assert channels.keys() == names(2)
    for pixels in channels.values():
        assert pixels.shape == (6 * 32, 32)
        assert pixels.dtype == np.float16
    assert header["compression"] == OpenEXR.ZIP_COMPRESSION
    assert header["type"] == OpenEXR.scanlineimage
    exactly = {
        "shrm:representation": "shrm",
        "shrm:version": 1,
        "shrm:frame": "global",
        "shrm:center": "reflection",
        "shrm:F": 11,
        "shrm:P": 2,
        "shrm:probe": "probe.exr",
        "shrm:probe_sha256": hashlib.sha256((folder / "probe.exr").read_bytes()).hexdigest(),
    }
    for name, value in exactly.items():
        assert header[name] == value
        assert type(header[name]) is type(value)
    assert json.loads(header["shrm:brdf"]) == {"name": "microfacet", "parameters": {"sigma": 0.2}}
    assert type(header["shrm:epsilon"]) is float
    assert header["shrm:epsilon"] == pytest.approx(0.03)
    assert type(header["shrm:brdf_energy_captured"]) is float
    assert 0.97 <= header["shrm:brdf_energy_captured"] < 0.98
    assert type(header["shrm:predicted_error"]) is float
    assert 0 < header["shrm:predicted_error"] < 0.1


@pytest.mark.parametrize("sampling", ["center", "border"])
@pytest.mark.parametrize("frame", ["global", "local"])
def test_coefficients_are_the_integral(folder, frame, sampling):
    """Every channel, at its texel, in its frame: summed over V they are the reflected light."""
    done(
        "prefilter", "probe.exr", "--brdf", "microfacet:sigma=0.5", "-o", "out.exr", "--size", 8,
        "--order-f", 4, "--order-p", 10, "--precision", "float", "--eps", 0.9,
        "--frame", frame, "--map-sampling", sampling,
    )  # fmt: skip
    header, channels = read_exr("out.exr")
    assert (header["shrm:frame"], header["shrm:F"], header["shrm:P"]) == (frame, 4, 10)
    assert header.get("envmap") == (OpenEXR.ENVMAP_CUBE if sampling == "border" else None)
    assert channels.keys() == names(10)
    coefficients = stacked(channels, 10)
    assert coefficients.shape == (48, 8, 121, 3)
    texels = oracles.cube_texels(8, sampling).reshape(48, 8, 3)
    light, weights = brute_force.sphere_rule(256)
    radiance = polynomial_light(light)
    rho_hat = brute_force.microfacet(0.5)
    rng = np.random.default_rng(3)
    for row, column in zip(rng.permutation(48)[:12], rng.integers(0, 8, 12), strict=True):
        reflection, view = texels[row, column], brute_force.unit(rng, 1)[0]
        if reflection @ view < -0.5:  # grazing, where P would have to be larger
            view = -view
        expected = brute_force.reflected(rho_hat, reflection, view, light, weights, radiance)
        own = view @ local_frame(reflection) if frame == "local" else view
        found = oracles.real_harmonics(10, own) @ coefficients[row, column]
        np.testing.assert_allclose(found, expected, rtol=6e-3)


def local_frame(center):
    """Columns of Rz(beta) Ry(alpha)."""
    theta, phi = np.arccos(center[2]), np.arctan2(center[1], center[0])
    return oracles.turn("z", phi) @ oracles.turn("y", theta)


@pytest.mark.parametrize("frame", ["global", "local"])
def test_half_is_the_rounded_float(folder, frame):
    rest = ("prefilter", "probe.exr", "--brdf", "microfacet", "--frame", frame)
    done(*rest, "--precision", "half", "-o", "half.exr")
    done(*rest, "--precision", "float", "-o", "float.exr")
    halves, floats = read_exr("half.exr")[1], read_exr("float.exr")[1]
    assert halves.keys() == floats.keys()
    for name, values in floats.items():
        assert values.dtype == np.float32
        assert halves[name].dtype == np.float16
        np.testing.assert_array_equal(halves[name], values.astype(np.float16))


def test_our_reader_finds_the_same_values(folder):
    done("prefilter", "probe.exr", "--brdf", "microfacet", "--eps", "0.03", "-o", "out.exr",
         "--precision", "float")  # fmt: skip
    np.testing.assert_array_equal(
        open_map("out.exr").coefficients, stacked(read_exr("out.exr")[1], 2)
    )


@pytest.mark.parametrize(
    ("spec", "frame", "center", "indices"),
    [
        ("lambertian", "global", "normal", {0}),
        ("phong:exponent=8", "local", "reflection", {0}),
        ("microfacet", "local", "reflection", set(range(9))),
    ],
)
def test_center_and_channels_of_each_brdf(folder, spec, frame, center, indices):
    done("prefilter", "probe.exr", "--brdf", spec, "--frame", frame, "-o", "out.exr")
    header, channels = read_exr("out.exr")
    assert header["shrm:center"] == center
    assert channels.keys() == {f"sh{index:03d}.{c}" for index in indices for c in "RGB"}


def test_furnace_by_value(folder):
    write_exr("furnace.exr", np.full((16, 32, 3), (1.0, 2.0, 0.5), np.float32))
    done("prefilter", "furnace.exr", "--brdf", "lambertian:albedo=0.5", "--precision", "float")
    channels = read_exr("furnace.lambertian-albedo-0.5.shrm.exr")[1]
    for colour, radiance in zip("RGB", (1.0, 2.0, 0.5), strict=True):
        # Y_00 = 1 / sqrt(4 pi).
        reflected = channels[f"sh000.{colour}"] / np.sqrt(4 * np.pi)
        np.testing.assert_allclose(reflected, 0.5 * radiance, rtol=2e-6)


def test_chromaticities_pass_through(folder):
    write_exr("p3.exr", noise(), chromaticities=P3)
    done("prefilter", "p3.exr", "--brdf", "lambertian", "-o", "out.exr")
    header, _ = read_exr("out.exr")
    assert header.keys() == STANDARD | OURS | {"chromaticities", "shrm:carried"}
    np.testing.assert_allclose(header["chromaticities"], P3, rtol=1e-6)


def test_sampling_is_of_both_probe_and_map_unless_one_is_named(folder):
    border = polynomial_light(oracles.latlong_pixels(64, 32, "border"))
    write_exr("border.exr", border.astype(np.float32))

    def values(probe, *options):
        rest = ("--brdf", "lambertian", "-o", "out.exr", "--precision", "float")
        done("prefilter", probe, *rest, *options)
        header, channels = read_exr("out.exr")
        return channels["sh000.R"], "envmap" in header

    center_map, tagged = values("probe.exr")
    assert not tagged
    border_map, tagged = values("probe.exr", "--map-sampling", "border")
    assert tagged
    assert np.abs(border_map - center_map).max() > 0.02
    assert np.abs(values("border.exr")[0] - center_map).max() > 0.01
    for probe, options, expected in [
        ("probe.exr", ("--sampling", "center"), center_map),
        ("border.exr", ("--probe-sampling", "border"), center_map),
        ("border.exr", ("--sampling", "border"), border_map),
        ("border.exr", ("--sampling", "border", "--map-sampling", "center"), center_map),
        ("probe.exr", ("--sampling", "border", "--probe-sampling", "center"), border_map),
    ]:
        found, tagged = values(probe, *options)
        np.testing.assert_allclose(found, expected, atol=1e-5)
        assert tagged is (expected is border_map)


@pytest.mark.slow
def test_runs_are_identical_whatever_the_threads(folder):
    digests = set()
    for options in [[], ["--threads", 1], ["--threads", 7]]:
        result = process(*COMMAND, "--quiet", *options)
        assert (result.code, result.err) == (0, "")
        digests.add(hashlib.sha256((folder / NAME).read_bytes()).hexdigest())
    assert len(digests) == 1


def test_bytes_do_not_depend_on_the_folder(folder):
    (folder / "there").mkdir()
    done(*COMMAND)
    done("prefilter", folder / "probe.exr", *COMMAND[2:], "-o", "there/x.exr")
    assert (folder / "there/x.exr").read_bytes() == (folder / NAME).read_bytes()


def test_eps_chooses_the_orders(folder):
    rough = json.loads(done(*COMMAND[:4], "--eps", 0.2, "--json", "-o", "rough.exr"))
    fine = json.loads(done(*COMMAND[:4], "--eps", 0.01, "--json"))
    assert rough["order_f"] < 11 < fine["order_f"]
    assert rough["brdf_energy_captured"] >= 0.8
    assert fine["brdf_energy_captured"] >= 0.99


def test_orders_and_size_can_be_forced(folder):
    result = run(*COMMAND, "--order-f", 3, "--order-p", 1, "--size", 12, "--json")
    assert result.code == 0
    assert WRONG_PICTURE in result.err
    values = json.loads(result.out)
    assert (values["order_f"], values["order_p"], values["size"]) == (3, 1, 12)
    header, channels = read_exr(NAME)
    assert (header["shrm:F"], header["shrm:P"]) == (3, 1)
    assert channels.keys() == names(1)
    assert channels["sh000.R"].shape == (72, 12)
    enough = run(*COMMAND, "--order-f", 20, "--order-p", 5, "--force")
    assert (enough.code, enough.err) == (0, "")


@pytest.mark.parametrize(("orders", "side"), [((0, 0), 16), ((6, 0), 16), ((7, 0), 32)])
def test_default_size_follows_f(folder, orders, side):
    options = ["--order-f", orders[0], "--order-p", orders[1], "-o", "out.exr", "--eps", 0.99]
    assert run("prefilter", "probe.exr", "--brdf", "phong", *options).code == 0
    assert read_exr("out.exr")[1]["sh000.R"].shape == (6 * side, side)


def test_bright_light_goes_to_float_and_says_so(folder):
    write_exr("sun.exr", np.full((8, 16, 3), 1e5, np.float32))
    result = run("prefilter", "sun.exr", "--brdf", "lambertian", "-o", "out.exr")
    assert result.code == 0
    assert result.err.startswith("Warning: out.exr: written as 32-bit float")
    assert result.err.count("\n") == 1
    assert result.out.startswith("out.exr: global SHRM")
    pixels = read_exr("out.exr")[1]["sh000.G"]
    assert pixels.dtype == np.float32
    np.testing.assert_allclose(pixels, 1e5 * np.sqrt(4 * np.pi), rtol=1e-5)
    asked = run("prefilter", "sun.exr", "--brdf", "lambertian", "--precision", "float")
    assert (asked.code, asked.err) == (0, "")


def test_half_that_overflows_is_refused(folder):
    write_exr("sun.exr", np.full((8, 16, 3), 1e5, np.float32))
    before = snapshot(folder)
    result = run("prefilter", "sun.exr", "--brdf", "lambertian", "--precision", "half")
    assert_refused(result, 1, "sun.lambertian.shrm.exr", "overflows half", "--precision auto")
    assert snapshot(folder) == before


def test_half_holds_up_to_its_largest_value(folder):
    """65519 rounds to half's 65504, 65520 to infinity."""
    for radiance, fits in [(65519.0, True), (65521.0, False)]:
        level = np.float32(radiance / np.sqrt(4 * np.pi))
        write_exr("edge.exr", np.full((8, 16, 3), level, np.float32))
        options = ["--brdf", "lambertian", "--precision", "half", "-o", f"{fits}.exr"]
        assert (run("prefilter", "edge.exr", *options).code == 0) is fits
    assert read_exr("True.exr")[1]["sh000.R"].max() == 65504


@pytest.mark.proof
def test_the_share_of_wrong_pixels_is_that_of_compare(folder):
    """Predicted over all pairs of directions and views, and measured in three views."""
    out = process(*COMMAND[:4], "--order-p", "1", "-o", "a.exr").out
    (line,) = [line.split() for line in out.splitlines() if line.startswith("  pixels ")]
    assert " ".join(line[2:]) == "predicted to be wrong by more than 5%"
    values = json.loads(process(*COMMAND[:4], "--order-p", "1", "-o", "a.exr", "--json").out)
    assert line[1] == f"{values['predicted_wrong_share']:.1%}"
    options = "--probe", "probe.exr", "--size", "32", "--no-picture", "--no-flip"
    found = json.loads(process("compare", "a.exr", *options, "--json").out)["summary"][0]
    assert found["wrong_share"] > 0.1
    assert values["predicted_wrong_share"] == pytest.approx(found["wrong_share"], rel=0.2, abs=0.05)


def test_json_is_alone_on_stdout_with_stable_keys(folder):
    pixels = noise()
    pixels[3, 4] = -1
    write_exr("negative.exr", pixels)
    result = process("prefilter", "negative.exr", *COMMAND[2:], "--json")
    assert result.code == 0
    values = json.loads(result.out)
    assert list(values) == KEYS
    assert values["file"] == "negative.microfacet.shrm.exr"
    assert values["epsilon"] == 0.03
    assert values["predicted_error"] <= values["error_bound"]
    assert values["brdf"] == {"name": "microfacet", "parameters": {"sigma": 0.2}}
    warning, picture = values["warnings"]
    assert WRONG_PICTURE in picture
    assert warning == ("negative.exr: 1 pixel with negative radiance was clamped to 0 (minimum -1)")
    assert result.err == f"Warning: {warning}\nWarning: {picture}\n"
    header, _ = read_exr(values["file"])
    for key in ("frame", "center", "probe", "probe_sha256"):
        assert values[key] == header[f"shrm:{key}"]
    for key in ("epsilon", "brdf_energy_captured", "predicted_error"):
        assert values[key] == pytest.approx(header[f"shrm:{key}"], rel=1e-6)


@pytest.mark.parametrize(
    "asked",
    [
        ("--eps", "0.3"), ("--to", "shrm", "--max-size", "30kB"), ("--order-f", "2"),
        ("--to", "cabral", "-o", NAME), ("--error", ".8", "-o", NAME),
    ],
)  # fmt: skip
def test_one_line_says_how_wrong_the_picture_of_a_form_is_that_was_named(folder, asked):
    result = run(*COMMAND[:4], *asked, "--json")
    values = json.loads(result.out)
    share = values["predicted_wrong_share"]
    assert share > 0.05
    (line,) = [each for each in values["warnings"] if "wrong" in each]
    assert line.startswith(f"{NAME}: {100 * share:.2g}% {WRONG_PICTURE}")
    causes = [values[f"{cause}_error"] for cause in ("predicted", "added", "filter")]
    assert f"its light by {np.linalg.norm(causes):.1%} (RMS)" in line
    assert "--to auto, without --eps, --error or orders, chooses the form" in line
    assert f"Warning: {line}\n" in result.err
    quiet = run(*COMMAND[:4], *asked, "--quiet", "--force")
    assert (quiet.code, quiet.out, quiet.err) == (0, "", "")


def test_a_large_error_of_few_pixels_is_told(folder):
    """Of the glints of a lamp, which four cubes blur, only few pixels see anything."""
    pixels = np.full((32, 64, 3), 0.2, np.float32)
    pixels[8, 20] = 400
    write_exr("spot.exr", pixels)
    asked = "--brdf", "0.5*lambertian+0.1*ggx:roughness=0.3", "--to", "principal", "--json"
    values = json.loads(run("prefilter", "spot.exr", *asked, "--maps", "4").out)
    assert values["predicted_wrong_share"] < 0.05
    (line,) = values["warnings"]
    assert f"{WRONG_PICTURE}, its light by 18" in line
    # Whoever asks for an error gets no more than that.
    asked = *asked, "-o", "rough.exr"
    assert WRONG_PICTURE not in run("prefilter", "spot.exr", *asked, "--error", "0.15").err


def test_no_line_says_that_a_picture_is_right(folder):
    for asked in (("--eps", "0.005"), ("--to", "auto")):
        result = run(*COMMAND[:4], *asked, "--json", "-o", "right.exr", "--force")
        values = json.loads(result.out)
        assert values["predicted_wrong_share"] <= 0.05
        assert not values["warnings"]


@pytest.mark.parametrize(("seen", "told"), [("0.9", []), ("0.05", ["no map keeps"])])
def test_who_says_what_may_be_wrong_is_told_once_where_more_is(folder, seen, told):
    asked = ("--to", "shrm", "--seen", seen, "--error", "0.9", "--max-size", "10kB")
    values = json.loads(run(*COMMAND[:4], *asked, "--json").out)
    assert 0.05 < values["predicted_wrong_share"] <= 0.9
    lines = [each for each in values["warnings"] if "wrong" in each]
    assert [each.removeprefix(f"{NAME}: ")[:12] for each in lines] == told
    assert all(each.endswith("Other forms may: take --to auto") for each in lines)


def test_quiet_prints_nothing(folder):
    write_exr("black.exr", np.zeros((8, 16, 3), np.float32))
    assert "Warning" in run("prefilter", "black.exr", *COMMAND[2:]).err
    result = run("prefilter", "black.exr", *COMMAND[2:], "--quiet", "--order-f", "2", "--force")
    assert (result.code, result.out, result.err) == (0, "", "")


def test_an_old_output_is_replaced(folder):
    (folder / NAME).write_text("old")
    done(*COMMAND, "--force")
    assert read_exr(NAME)[0]["shrm:F"] == 11
    assert sorted(snapshot(folder)) == ["probe.exr", NAME]


@pytest.mark.parametrize(
    ("probe", "spec", "expected"),
    [
        ("a.b.exr", "phong:exponent=32", "a.b.phong-exponent-32.shrm.exr"),
        ("sub/x.exr", "microfacet", "x.microfacet.shrm.exr"),
        ("prö be.exr", "lambertian", "prö be.lambertian.shrm.exr"),
    ],
)
def test_default_output_is_named_after_probe_and_brdf(folder, probe, spec, expected):
    (folder / "sub").mkdir()
    write_exr(probe, noise())
    done("prefilter", probe, "--brdf", spec, "--eps", 0.1)
    assert read_exr(expected)[0]["shrm:probe"] == probe.split("/")[-1]


def test_six_files_are_one_probe(folder):
    for face in ("+X", "-X", "+Y", "-Y", "+Z", "-Z"):
        write_exr(f"sky_{face}.exr", np.ones((4, 4, 3), np.float32))
    values = json.loads(done("prefilter", "sky_%.exr", "--brdf", "lambertian", "--json"))
    assert values["file"] == "sky.lambertian.shrm.exr"
    assert values["probe"] == "sky_%.exr"


@pytest.mark.parametrize(
    ("options", "in_file"),
    [
        (["--mirror"], lambda x, y, z: (-x, y, z)),
        (["--yaw", 90], lambda x, y, z: (-z, y, x)),
        (["--up", "z"], lambda x, y, z: (x, -z, y)),
        (["--clamp", 1e9], lambda x, y, z: (x, y, z)),
    ],
)
def test_reading_options_reach_the_probe(folder, options, in_file):
    """As if the light had been written turned, by hand: the file's direction for the world's."""
    x, y, z = np.moveaxis(oracles.latlong_pixels(64, 32), -1, 0)
    light = polynomial_light(np.stack(in_file(x, y, z), axis=-1))
    write_exr("turned.exr", light.astype(np.float32))
    rest = ("--brdf", "microfacet:sigma=0.4", "--size", 16, "--precision", "float", "-o")
    done("prefilter", "turned.exr", *rest, "by_hand.exr")
    done("prefilter", "probe.exr", *rest, "by_option.exr", *options)
    expected, found = (read_exr(name)[1] for name in ("by_hand.exr", "by_option.exr"))
    for name, values in expected.items():
        np.testing.assert_allclose(found[name], values, atol=2e-5)


def test_clamp_is_reported(folder):
    result = run("prefilter", "probe.exr", "--brdf", "lambertian", "--clamp", 1)
    assert result.code == 0
    assert "pixels were clamped, which removed " in result.err


def test_an_order_that_the_brdf_does_not_have_is_told(folder):
    result = run("prefilter", "probe.exr", "--brdf", "phong", "--order-p", 3, "-o", "m.exr")
    assert result.code == 0
    assert "phong does not depend on the view, so P = 0 only" in result.err
    assert open_map("m.exr").order_p == 0


@pytest.mark.parametrize(
    ("options", "what"),
    [
        (["--brdf", "microfacet", "--order-p", 1], "of 4 coefficients"),
        (["--brdf", "microfacet", "--order-p", 1, "--compress", "pca:3"], "of 3 components"),
        (["--brdf", "microfacet", "--order-p", 1, "--compress", "pca:4"], "of 4 components"),
        (["--brdf", "0.5*lambertian+0.5*phong", "--compress", "pca:1"], "of 2 components"),
    ],
)
def test_components_are_called_so_even_where_none_is_left_out(folder, options, what):
    done_with_remarks = run("prefilter", "probe.exr", *options, "-o", "c.exr")
    assert done_with_remarks.code == 0
    assert what in done_with_remarks.out.splitlines()[0]


def test_split_is_refused_or_answered(folder):
    result = run("prefilter", "probe.exr", "--brdf", "phong", "--split")
    assert_refused(result, 2, "--split applies to sums", "phong:exponent=32 has a single term")
