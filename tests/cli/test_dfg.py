"""`shrm dfg`: the table, reopened by OpenEXR and used as its attributes say."""

import json
import re
import struct

import numpy as np
import OpenEXR
import OpenImageIO as oiio
import pytest

import shrm_cli as shrm
from shrm_cli.brdf.environment import dfg
from shrm_cli.brdf.environment.environment_brdf import brushed_table
from shrm_cli.brdf.models.ggx import Ggx
from tests.cli.helpers import assert_refused, done, read_exr, run, snapshot, write_exr


def albedo(roughness, cosine, f0, count=400):
    """Directional albedo of GGX by the midpoint rule over the light's own angles."""
    a2 = roughness**4
    height = (np.arange(count)[:, None] + 0.5) / count
    azimuth = (np.arange(count) + 0.5) / count * np.pi
    view = np.array([np.sqrt(1 - cosine**2), 0, cosine])
    light = np.stack(
        np.broadcast_arrays(
            np.sqrt(1 - height**2) * np.cos(azimuth), np.sqrt(1 - height**2) * np.sin(azimuth),
            height,
        ), axis=-1,
    )  # fmt: skip
    half = light + view
    half /= np.linalg.norm(half, axis=-1, keepdims=True)
    d = a2 / (np.pi * (half[..., 2] ** 2 * (a2 - 1) + 1) ** 2)
    lambdas = [(np.sqrt(1 + a2 * (1 / c**2 - 1)) - 1) / 2 for c in (light[..., 2], cosine)]
    fresnel = f0 + (1 - f0) * (1 - half @ view) ** 5
    value = fresnel * d / (1 + sum(lambdas)) / (4 * cosine)
    return float(value.mean() * 2 * np.pi)


def test_the_table_holds_scale_and_bias(tmp_path):
    target = tmp_path / "table.exr"
    out = done("dfg", "--size", "8", "-o", target, "--precision", "float")
    assert "f0 * R + G" in out
    header, planes = read_exr(target)
    assert header["shrm:table"] == "dfg"
    assert header["shrm:multiscatter"] == 0
    assert header["shrm:reflectance"] == "f0 * R + G"
    assert {plane.shape for plane in planes.values()} == {(8, 8)}
    assert not planes["B"].any()
    for row, column in [(3, 0), (3, 5), (5, 2), (7, 7)]:
        roughness, cosine = (row + 0.5) / 8, (column + 0.5) / 8
        for f0 in (0.04, 0.7):
            found = f0 * planes["R"][row, column] + planes["G"][row, column]
            assert found == pytest.approx(albedo(roughness, cosine, f0), abs=2e-4)


def test_the_other_table_loses_nothing_in_a_white_furnace(tmp_path):
    target = tmp_path / "table.exr"
    result = json.loads(
        done("dfg", "--multiscatter", "--size", "8", "-o", target, "--precision", "float", "--json")
    )
    header, planes = read_exr(target)
    assert header["shrm:multiscatter"] == 1
    assert result["reflectance"] == header["shrm:reflectance"]
    low, high = planes["R"], planes["G"]
    mixed = low * (1 - 1.0) + high * 1.0
    assert np.abs(mixed * (1 + 1.0 * (1 / high - 1)) - 1).max() < 1e-6
    row, column = 6, 3
    single = 0.3 * (high[row, column] - low[row, column]) + low[row, column]
    assert single == pytest.approx(albedo(6.5 / 8, 3.5 / 8, 0.3), abs=2e-4)
    assert result["white_furnace"]["minimum"] == pytest.approx(high.min(), rel=1e-6)
    assert result["maximum"] == pytest.approx(high.max(), rel=1e-6)


def lobe_integral(roughness, cosine, f0, count=400):
    """Albedo, and N.L and T.L times the lobe, of GGX by the midpoint rule over the light."""
    a2 = roughness**4
    height = (np.arange(count)[:, None] + 0.5) / count
    azimuth = (np.arange(2 * count) + 0.5) / count * np.pi
    view = np.array([np.sqrt(1 - cosine**2), 0, cosine])
    sine = np.sqrt(1 - height**2)
    light = np.stack(np.broadcast_arrays(
        sine * np.cos(azimuth), sine * np.sin(azimuth), height
    ), axis=-1)  # fmt: skip
    half = light + view
    half /= np.linalg.norm(half, axis=-1, keepdims=True)
    d = a2 / (np.pi * (half[..., 2] ** 2 * (a2 - 1) + 1) ** 2)
    lambdas = [(np.sqrt(1 + a2 * (1 / c**2 - 1)) - 1) / 2 for c in (light[..., 2], cosine)]
    fresnel = f0 + (1 - f0) * (1 - half @ view) ** 5
    value = fresnel * d / (1 + sum(lambdas)) / (4 * cosine)
    # Tangential is what points away from the viewer.
    return np.array([np.mean(value * k) for k in (1, height, -light[..., 0])]) * 2 * np.pi


def test_moments_are_those_of_the_lobe(tmp_path):
    """As its attributes say it is used: how much is reflected, and from where on average."""
    target = tmp_path / "moments.exr"
    result = json.loads(
        done("dfg", "--moments", "--size", "8", "-o", target, "--precision", "float", "--json")
    )
    header, planes = read_exr(target)
    assert set(planes) == {f"{kind}.{moment}" for kind in ("base", "tail") for moment in "ENT"}
    assert (header["shrm:table"], header["shrm:moments"]) == ("dfg", 2)
    assert header["shrm:multiscatter"] == 0
    assert result["moments"] is True
    for name in ("channels", "reflectance", "mean_direction"):
        assert result[name] == header[f"shrm:{name}"]
    assert header["shrm:reflectance"] == "mix(tail.E, base.E, f0)"
    assert "mix(tail.T, base.T, f0) * T" in header["shrm:mean_direction"]
    for row, column in [(3, 1), (3, 5), (5, 2), (7, 7)]:
        for f0 in (0.04, 1.0):
            cosine = (column + 0.5) / 8
            expected = lobe_integral((row + 0.5) / 8, cosine, f0)
            expected[2] /= np.sqrt(1 - cosine**2)  # it multiplies a vector of this length
            for moment, value in zip("ENT", expected, strict=True):
                base, tail = (planes[f"{kind}.{moment}"][row, column] for kind in ("base", "tail"))
                assert (1 - f0) * tail + f0 * base == pytest.approx(value, abs=2e-4)
    assert result["white_furnace"]["maximum"] == pytest.approx(planes["base.E"].max(), rel=1e-6)


def test_moments_hold_the_plain_table(tmp_path):
    for options in (["--moments"], []):
        target = tmp_path / f"{len(options)}.exr"
        done("dfg", "--size", "6", "-o", target, "--precision", "float", *options)
    moments, plain = (read_exr(tmp_path / f"{k}.exr")[1] for k in (1, 0))
    np.testing.assert_allclose(moments["base.E"], plain["R"] + plain["G"], atol=1e-6)
    np.testing.assert_allclose(moments["tail.E"], plain["G"], atol=1e-6)


def test_info_tells_of_textures(tmp_path):
    done("dfg", "--size", "8", "-o", tmp_path / "a.ktx2", "--precision", "float")
    told = json.loads(done("info", tmp_path / "a.ktx2", "--json"))
    assert told["kind"].startswith("KTX 2 texture")
    assert (told["holds"], told["width"], told["height"], told["mips"]) == ("a picture", 8, 8, 1)
    assert (told["texels"], told["packed"]) == ("rgba32f", False)
    (tmp_path / "b.ktx2").write_bytes((tmp_path / "a.ktx2").read_bytes()[:20])
    assert_refused(run("info", tmp_path / "b.ktx2"), 1, "b.ktx2")


def test_info_tells_of_moments(tmp_path):
    target = tmp_path / "moments.exr"
    text = done("dfg", "--moments", "--size", "4", "-o", target)
    assert "base.E, base.N, base.T, tail.E, tail.N, tail.T; half" in text
    assert "mean           (mix(tail.N" in text
    values = json.loads(done("info", target, "--json"))
    assert values["kind"] == "environment-BRDF table"
    assert (values["moments"], values["multiscatter"]) == (True, False)
    assert values["mean_direction"] in done("info", target)
    assert "(1 - V.H)^5" in values["channels"]
    done("dfg", "--size", "4", "-o", target)
    plain = json.loads(done("info", target, "--json"))
    assert plain["moments"] is False
    assert "mean_direction" not in plain


def test_two_runs_give_the_same_bytes_and_half_is_the_default(tmp_path):
    for name in ("a.exr", "b.exr"):
        assert ", " not in done("dfg", "--size", "4", "-o", tmp_path / name, "--quiet")
    one, other = snapshot(tmp_path).values()
    assert one == other
    with OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True) as file:
        assert file.channels()["R"].pixels.dtype == np.float16


def test_it_is_no_map(tmp_path):
    target = tmp_path / "table.exr"
    done("dfg", "--size", "4", "-o", target)
    assert_refused(run("render", target, "-o", tmp_path / "x.png"), 1, "table.exr")


@pytest.mark.parametrize(
    ("arguments", "code", "part"),
    [
        (["--moments", "--multiscatter"], 2, "--multiscatter"),
        (["--size", "1"], 2, "--size"),
        (["--size", "2000"], 2, "--size"),
        (["-o", "table.jpg"], 1, ".exr, .ktx2, .png"),
        (["-o", "no/such/folder/table.exr"], 1, "table.exr"),
    ],
)
def test_what_is_refused(tmp_path, monkeypatch, arguments, code, part):
    monkeypatch.chdir(tmp_path)
    assert_refused(run("dfg", *arguments), code, part)
    assert snapshot(tmp_path) == {}


def test_a_table_is_no_probe(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done("dfg", "--size", "8", "-o", "table.exr")
    refused = run("prefilter", "table.exr", "--to", "irradiance")
    assert_refused(refused, 1, "table.exr: a table that shrm made, not a light probe")


@pytest.mark.parametrize("name", [b"shrm:multiscatter", b"shrm:moments"])
def test_an_attribute_of_an_unknown_type_is_refused(tmp_path, name):
    """OpenImageIO gives its bytes, as an array, which is neither true nor false."""
    target = tmp_path / "table.exr"
    done("dfg", "--size", "4", "-o", target)
    data = target.read_bytes()
    assert name + b"\0int\0" in data
    target.write_bytes(data.replace(name + b"\0int\0", name + b"\0xnt\0"))
    assert_refused(run("info", target), 1, f"{name.decode()} is wrong")


def test_a_table_of_cloth_in_every_container(tmp_path):
    plain = tmp_path / "sheen.exr"
    done("dfg", "--brdf", "charlie:color=1/0.5/0.25", "--size", "8", "-o", plain)
    header, planes = read_exr(plain)
    assert (header["shrm:columns"], header["shrm:brdf"]) == ("albedo", "charlie:color=1/0.5/0.25")
    np.testing.assert_allclose(planes["G"], planes["R"] / 2, rtol=2e-3)
    assert "columns       albedo" in done("info", plain)
    for precision in ("half", "float"):
        texture = tmp_path / f"{precision}.ktx2"
        done("dfg", "--brdf", "charlie", "--size", "8", "-o", texture, "--precision", precision)
        data = texture.read_bytes()
        number, _, width, height, depth, layers, faces, levels = struct.unpack_from("<8I", data, 12)
        assert (width, height, depth, layers, faces, levels) == (8, 8, 0, 0, 1, 1)
        assert number == {"half": 97, "float": 109}[precision]
        offset, length = struct.unpack_from("<2Q", data, 80)
        texels = np.frombuffer(data[offset : offset + length], f"<f{length // 256}")
        texels = texels.reshape(8, 8, 4)
        assert (texels[..., 3] == 1).all()
        np.testing.assert_allclose(texels[..., 0], planes["R"], rtol=2e-3, atol=1e-6)
    picture = tmp_path / "sheen.png"
    done("dfg", "--brdf", "charlie", "--size", "8", "-o", picture)
    data = picture.read_bytes()
    assert data[24:26] == bytes([16, 2])  # the bit depth of RGB
    words = oiio.ImageInput.open(str(picture)).read_image("uint16")
    np.testing.assert_allclose(words[..., 0] / 65535, planes["R"], atol=5e-4)


def test_cloth_that_gains_energy_is_said_to(tmp_path):
    """What passes to below was said to be 1 - max, which is negative at grazing angles."""
    result = done("dfg", "--brdf", "charlie", "--size", "64", "-o", tmp_path / "sheen.exr")
    assert "lets max(0, 1 - max(R, G, B)) through" in result
    texels = shrm.dfg("charlie", size=64).texels
    gained = (texels.max(axis=-1) > 1).mean()
    assert 0 < gained < 0.02
    assert f"gains energy   in {gained:.1%} of the texels" in result
    assert texels.max() > 1.05
    assert "gains energy" not in done(
        "dfg", "--brdf", "ggx:f0=1", "--size", "8", "-o", tmp_path / "a.exr"
    )


def test_a_table_of_brushed_surfaces(tmp_path):
    path = tmp_path / "brushed.exr"
    told = done("dfg", "--brdf", "ggx:anisotropy=0.6", "--size", "8", "-o", path)
    assert "along.R, along.G, between.R, between.G, across.R, across.G" in told
    header, planes = read_exr(path)
    assert header["shrm:columns"] == "brushed"
    table = brushed_table(Ggx(anisotropy=0.6), 8)
    np.testing.assert_allclose(planes["across.G"], table[..., 5], rtol=2e-3, atol=1e-6)
    assert "columns       brushed" in done("info", path)


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (["--brdf", "phong"], "no roughness"),
        (["--brdf", "ggx:ax=0.3,ay=0.1"], "give only anisotropy and mapping"),
        (["--brdf", "ggx:anisotropy=0.6", "-o", "a.ktx2"], "three columns, not 6"),
        (["--brdf", "charlie:roughness=0.09"], "leave roughness out"),
        (["--brdf", "ward:ax=0.1,ay=0.3"], "the same all around"),
        (["--brdf", "charlie", "--columns", "gltf"], "exclude each other"),
        (["--columns", "turquin", "-o", "a.png"], "PNG holds 0 .. 1"),
        (["--moments", "-o", "a.ktx2"], "three columns, not 6"),
        (["-o", "a.png", "--precision", "half"], "16 bits"),
    ],
)
def test_tables_that_cannot_be_made_or_held(tmp_path, monkeypatch, options, told):
    monkeypatch.chdir(tmp_path)
    code = 2 if "exclude" in told else 1
    assert_refused(run("dfg", "--size", "4", *options), code, told)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("options", [["--columns", "filament"], ["--brdf", "charlie"]])
def test_values_beyond_png_are_refused_by_a_coarse_table(tmp_path, monkeypatch, options):
    made, sizes = shrm.dfg, []
    monkeypatch.setattr(
        shrm, "dfg", lambda *given, **named: sizes.append(named["size"]) or made(*given, **named)
    )
    assert_refused(run("dfg", *options, "-o", tmp_path / "a.png"), 1, "PNG holds 0 .. 1")
    assert sizes == [32]


@pytest.mark.parametrize(
    "options",
    [
        ["--brdf", "ggx:anisotropy=0.6", "-o", "a.ktx2"],
        ["--moments", "-o", "a.png"],
        ["-o", "a.png", "--precision", "half"],
    ],
)
def test_what_a_texture_cannot_hold_is_refused_before_it_is_integrated(monkeypatch, options):
    monkeypatch.setattr(dfg, "dfg", lambda *_, **__: pytest.fail("the table was integrated"))
    assert_refused(run("dfg", *options), 1, options[options.index("-o") + 1])


def test_the_examples_of_the_help_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    examples = re.findall(r"^ +shrm (dfg .*)$", done("dfg", "--help"), re.M)
    for example in examples:
        done(*example.split(), "--size", "4", "--force")
    assert len(examples) == 3


def test_a_table_whose_columns_are_unknown_is_refused(tmp_path):
    target = tmp_path / "table.exr"
    done("dfg", "--columns", "turquin", "--size", "4", "-o", target)
    assert "columns       turquin" in done("info", target)
    header, planes = read_exr(target)
    pixels = np.stack([planes[each] for each in "RGB"], axis=-1)
    write_exr(target, pixels, **{**header, "shrm:columns": "seven"})
    assert_refused(run("info", target), 1, "shrm:columns is wrong; make it again with shrm dfg")
