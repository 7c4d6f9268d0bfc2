"""Files for Babylon.js, three.js, glTF and DirectX, read by code of others."""

import json
import struct
import zlib

import numpy as np
import OpenImageIO as oiio
import pytest

from shrm_cli.errors import ArgumentError, MapError
from shrm_cli.export import engine as engines
from shrm_cli.export.engines.coefficients import coefficients_json
from shrm_cli.export.harmonics import babylon, ext_lights_image_based
from shrm_cli.export.make import Asked, Source, gather, packaged
from shrm_cli.export.packing import ALL
from shrm_cli.export.pixels import FORMATS, RGBD, encoded, rgba_png, rgbd_pictures
from shrm_cli.probe.open import open_probe
from shrm_cli.probe.probe import Probe
from shrm_cli.probe.resample import to_grid
from shrm_cli.sphere.grid.cube import Cube
from tests.brute_force import unit
from tests.cli.helpers import ROOT
from tests.export.readers import look_up, read_ktx2
from tests.web.ball import lambert

HEIGHT = 32


@pytest.fixture(scope="module")
def probe():
    v, u = np.meshgrid(np.arange(HEIGHT) + 0.5, np.arange(2 * HEIGHT) + 0.5, indexing="ij")
    values = 1 + 0.5 * np.sin(2 * np.pi * u / 64)[..., None] * np.array([0.2, 0.7, 1.0])
    values += (v / HEIGHT)[..., None] * np.array([1.0, 0.4, 0.1])
    values[5:8, 9:13] += [9, 5, 2]
    return Probe.from_array(values, "latlong")


def packed(name, probe, size=32, texels=None):
    chosen = engines.engine(name)
    light, _, _ = gather(Source("light", "light.exr", probe=probe), chosen, Asked(size=size))
    return light, chosen.pack(light, texels or ALL[(chosen.formats or ("rgba16f",))[0]])


def contents(package, folder):
    for file in package.files:
        file.write(folder / file.name)
    return {file.name: (folder / file.name).read_bytes() for file in package.files}


def read_png(data, folder):
    """The bytes of a PNG as OpenImageIO reads them, without multiplying colours with alpha."""
    path = folder / "one.png"
    path.write_bytes(data)
    config = oiio.ImageSpec()
    config["oiio:UnassociatedAlpha"] = 1
    image = oiio.ImageInput.open(str(path), config)
    assert image is not None, oiio.geterror()
    return np.array(image.read_image(oiio.UINT8))


def decoded(pixels):
    """The linear radiance of RGBD's bytes."""
    pixels = np.asarray(pixels, dtype=float) / 255
    return pixels[..., :3] ** 2.2 / pixels[..., 3:]


# ---- RGBD ----------------------------------------------------------------------------------------


def test_pictures_keep_colours_where_alpha_is_small(tmp_path, rng):
    pixels = rng.integers(0, 256, (5, 7, 4), dtype=np.uint8)
    pixels[0, :, 3] = 1
    assert np.array_equal(read_png(rgba_png(pixels), tmp_path), pixels)


def test_rgbd_keeps_radiance_to_a_step_of_eight_bits(rng):
    radiance = np.exp(rng.uniform(np.log(1e-3), np.log(255), (4000, 1))) * rng.uniform(
        0.2, 1, (4000, 3)
    )
    radiance[:2] = [[0, 0, 0], [255, 255, 255]]
    pixels = RGBD.pack(radiance)
    assert pixels[:, 3].min() >= 1
    assert pixels[1].tolist() == [255, 255, 255, 1]
    # Half a step of the encoded value, whose derivative is largest at the brighter end.
    high = ((np.minimum(pixels[:, :3] + 0.5, 255.5)) / 255) ** 2.2 / (pixels[:, 3:] / 255.0)
    low = (np.maximum(pixels[:, :3] - 0.5, 0) / 255) ** 2.2 / (pixels[:, 3:] / 255.0)
    assert np.all((radiance >= low * (1 - 1e-12)) & (radiance <= high * (1 + 1e-12)))


def test_the_divisor_is_that_of_babylon(rng):
    radiance = rng.uniform(0, 255, (500, 3))
    largest = radiance.max(axis=1)
    expected = np.clip(np.floor(np.maximum(255 / largest, 1)), 0, 255)
    assert np.array_equal(RGBD.pack(radiance)[:, 3], expected)


def test_hostile_values_are_clipped_and_counted_or_refused():
    faces = np.ones((6, 2, 2, 3))
    faces[0, 0, 0] = [300, 1, 1]
    faces[1, 0, :, 2] = -0.5
    faces[2, 1, 1] = 70000
    data, clipped = encoded(faces, RGBD, "level 0")
    assert len(rgbd_pictures(data, 2)) == 6
    assert (clipped.above, clipped.below, clipped.most, clipped.least) == (2, 2, 70000, -0.5)
    for bad in (np.nan, np.inf, -np.inf):
        faces[3, 0, 0, 1] = bad
        with pytest.raises(MapError, match="1 texels are not finite"):
            encoded(faces, RGBD, "level 0")


@pytest.mark.parametrize(("name", "most"), [("babylon", 255), ("gltf", 255), ("directx", 65504)])
def test_what_a_file_cannot_hold_is_said_once(probe, name, most):
    bright = np.full((32, 64, 3), 0.5)
    bright[3, 5] = 1e6
    _, package = packed(name, Probe.from_array(bright, "latlong"))
    [warning] = package.warnings
    assert f"({most})" in warning
    assert "of level 0" in warning
    assert not packed(name, probe)[1].warnings


@pytest.mark.parametrize("name", ["babylon", "gltf", "playcanvas"])
def test_what_pictures_of_eight_bits_lose_is_known_and_can_be_limited(probe, name):
    """A lamp that was clipped took 98 % of a level with it, and nothing but a count was said."""
    asked = Asked(size=32, max_error=0.1)
    made = packaged(Source("light", "light.exr", probe), engines.engine(name), asked)
    assert 0.001 < max(each.rms for each in made.losses) < 0.01
    assert any("packing changes" in line for line in made.told)
    bright = np.full((32, 64, 3), 0.5)
    bright[3, 5] = 1e4
    source = Source("light", "light.exr", Probe.from_array(bright, "latlong"))
    with pytest.raises(ArgumentError, match=r"0\.1 is not kept: rgb[dp] changes"):
        packaged(source, engines.engine(name), asked)
    made = packaged(source, engines.engine(name), Asked(size=32, texels="auto"))
    assert made.losses[0].rms > 0.5


# ---- Babylon.js ----------------------------------------------------------------------------------


def read_env(data):
    assert data[:8] == bytes.fromhex("86168796f6d69636")
    end = data.index(b"\0", 8)
    return json.loads(data[8:end]), data[end + 1 :]


def test_env_files_hold_all_levels(probe, tmp_path):
    light, package = packed("babylon", probe)
    head, body = read_env(contents(package, tmp_path)["light.env"])
    assert (head["version"], head["width"], head["imageType"]) == (2, 32, "image/png")
    mips = head["specular"]["mipmaps"]
    assert len(mips) == 6 * 6
    assert sum(mip["length"] for mip in mips) == len(body)
    assert head["specular"]["lodGenerationScale"] == 0.8
    for level in range(6):
        faces = []
        for face in range(6):
            mip = mips[6 * level + face]
            picture = read_png(body[mip["position"] :][: mip["length"]], tmp_path)
            assert picture.shape == (32 >> level, 32 >> level, 4)
            faces.append(decoded(picture[::-1]))  # pictures stand on their heads
        if level < len(light.levels):
            directions = unit(np.random.default_rng(level), 50)
            found = look_up(np.array(faces), directions * [1, 1, -1])
            faces, true = np.array(faces), _gl(light.levels[level])
            assert np.allclose(found, look_up(true, directions), rtol=0.03)
            mirrored = true[[0, 1, 2, 3, 5, 4]]
            mirrored = np.stack(
                [f[::-1] if k in (2, 3) else f[:, ::-1] for k, f in enumerate(mirrored)]
            )
            rms = np.sqrt(((faces - mirrored) ** 2).sum() / (true**2).sum())
            assert package.losses[level].rms == pytest.approx(rms, rel=1e-6)


def _gl(cube):
    """OpenEXR's faces turned to those of graphics interfaces, +Y and -Y by half a turn."""
    size = cube.shape[1]
    faces = cube.reshape(6, size, size, 3)
    return np.stack([f[::-1] if k in (2, 3) else f[:, ::-1] for k, f in enumerate(faces)])


def test_levels_of_babylon_end_at_alpha_one():
    chosen = engines.engine("babylon")
    for size in (64, 256, 512):
        sizes = chosen.sizes(size)
        roughness = np.array(chosen.roughness(sizes))
        assert roughness[-1] == 1
        assert np.all(np.diff(roughness) > 0)
        alphas = roughness[1:-1] ** 2
        lod = 0.8 * np.log2(size * alphas)  # what the shader computes
        assert np.allclose(lod, np.arange(1, len(alphas) + 1))
    with pytest.raises(ArgumentError, match="too sharp"):
        chosen.roughness(chosen.sizes(4096))
    with pytest.raises(ArgumentError, match="power of two"):
        chosen.sizes(100)


def test_polynomials_shade_as_babylon_does(rng):
    nine = rng.standard_normal((9, 3))
    normals = unit(rng, 20)
    x, y, z = normals.T
    p = {name: np.array(values) for name, values in babylon(nine).items()}
    # SphericalHarmonics.FromPolynomial and preScaleForRendering, numbers of its source.
    pi = np.pi
    l00 = pi * 0.376127 * (p["xx"] + p["yy"] + p["zz"]) * np.sqrt(1 / (4 * pi))
    first = pi * 0.977204 * np.sqrt(3 / (4 * pi))
    mixed = pi * 1.16538 * np.sqrt(15 / (4 * pi))
    l20 = pi * (1.34567 * p["zz"] - 0.672834 * (p["xx"] + p["yy"])) * np.sqrt(5 / (16 * pi))
    l22 = pi * 1.16538 * (p["xx"] - p["yy"]) * np.sqrt(15 / (16 * pi))
    shaded = (
        l00
        + first * (np.outer(x, p["x"]) + np.outer(y, p["y"]) + np.outer(z, p["z"]))
        + mixed * (np.outer(x * y, p["xy"]) + np.outer(y * z, p["yz"]) + np.outer(z * x, p["zx"]))
        + np.outer(3 * z * z - 1, l20)
        + np.outer(x * x - y * y, l22)
    )
    assert np.allclose(shaded, lambert(nine, normals), atol=2e-5)


# ---- glTF ----------------------------------------------------------------------------------------


def test_gltf_has_every_image_and_an_intensity(probe, tmp_path):
    light, package = packed("gltf", probe)
    files = contents(package, tmp_path)
    document = json.loads(files["light.gltf"])
    [found] = document["extensions"]["EXT_lights_image_based"]["lights"]
    assert found["intensity"] == 1
    assert found["specularImageSize"] == 32
    assert [len(level) for level in found["specularImages"]] == [6] * len(light.levels)
    for k, level in enumerate(found["specularImages"]):
        for image in level:
            picture = read_png(files[document["images"][image]["uri"]], tmp_path)
            assert picture.shape == (32 >> k, 32 >> k, 4)
    assert document["scenes"][0]["extensions"]["EXT_lights_image_based"]["light"] == 0
    # Coefficients of irradiance, for harmonics with the Condon-Shortley phase, mirrored in z.
    nine = np.array(found["irradianceCoefficients"])
    assert np.allclose(nine[0], np.pi * light.nine()[0])
    assert np.allclose(nine[1], -2 * np.pi / 3 * light.nine()[1])
    assert np.allclose(nine[2], -2 * np.pi / 3 * light.nine()[2])
    assert np.allclose(nine[8], np.pi / 4 * light.nine()[8])


# ---- three.js ------------------------------------------------------------------------------------


def test_three_has_a_cube_coefficients_and_a_loader(probe, tmp_path):
    light, package = packed("three", probe, texels=ALL["rgba16f"])
    files = contents(package, tmp_path)
    assert set(files) == {"shrm-environment.js", "light.ktx2", "light_sh.json"}
    assert np.allclose(json.loads(files["light_sh.json"])["three"], light.nine().ravel())
    assert b"export async function loadEnvironment" in files["shrm-environment.js"]
    mips = read_ktx2(files["light.ktx2"]).mips
    assert [mip.shape[1] for mip in mips] == [32, 16, 8]
    directions = unit(np.random.default_rng(0), 50)
    for mip, cube in zip(mips[:-1], light.levels, strict=False):
        found = look_up(mip, directions * [-1, 1, 1])
        assert np.allclose(found, look_up(_gl(cube), directions), rtol=2e-3)
    # The last is E / pi, but for the width of its texels and for degrees above 2.
    found = look_up(mips[-1], directions * [-1, 1, 1])
    assert np.allclose(found, lambert(light.nine(), directions), rtol=0.06)


def test_three_loads_uastc_by_itself(probe, tmp_path):
    """What the README says is what tests/web/pages/three.js does, in three.js itself."""
    _, package = packed("three", probe)
    assert set(contents(package, tmp_path)) == {"light.ktx2", "light_sh.json"}
    page = (ROOT / "tests" / "web" / "pages" / "three.js").read_text()
    assert package.loading[0] in page
    assert package.loading[2] == 'scene.environment = await loader.loadAsync("light.ktx2");'
    for line in (package.loading[2].replace('"light.ktx2"', "url"), package.loading[3]):
        assert line in page


# ---- DDS -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["rgba16f", "rgb9e5", "r11g11b10"])
def test_dds_files_follow_the_header(probe, tmp_path, name):
    light, package = packed("directx", probe, texels=FORMATS[name])
    data = contents(package, tmp_path)["light.dds"]
    assert data[:4] == b"DDS "
    size, flags, height, width, pitch, _, mips = struct.unpack_from("<7I", data, 4)
    assert (size, height, width, mips) == (124, 32, 32, len(light.levels))
    assert flags & 0x21007 == 0x21007
    assert pitch == 32 * FORMATS[name].size
    assert struct.unpack_from("<2I4s", data, 76) == (32, 4, b"DX10")
    caps, caps2 = struct.unpack_from("<2I", data, 108)
    assert caps & 0x401008 == 0x401008
    assert caps2 == 0xFE00
    number, dimension, misc, count, _ = struct.unpack_from("<5I", data, 128)
    assert number == {"rgba16f": 10, "rgb9e5": 67, "r11g11b10": 26}[name]
    assert (dimension, misc, count) == (3, 4, 1)
    texels = sum((32 >> k) ** 2 for k in range(mips))
    assert len(data) == 148 + 6 * texels * FORMATS[name].size


def test_dds_cubes_are_read_back_as_probes(probe, tmp_path):
    light, package = packed("directx", probe)
    contents(package, tmp_path)
    back = to_grid(open_probe(tmp_path / "light.dds"), Cube(32))
    assert np.allclose(back, light.levels[0], rtol=2e-3)


# ---- JSON ----------------------------------------------------------------------------------------


def test_json_names_every_convention(rng):
    nine = rng.standard_normal((9, 3))
    found = json.loads(coefficients_json(nine))
    assert set(found["meanings"]) == set(found) - {"basis", "meanings"}
    normals = unit(rng, 5)
    x, y, z = normals.T
    terms = [np.ones(5), y, z, x, x * y, y * z, 3 * z * z - 1, x * z, x * x - y * y]
    assert np.allclose(np.stack(terms, 1) @ found["polynomial"], lambert(nine, normals), atol=1e-5)
    assert np.allclose(found["three"], nine.ravel())
    assert np.allclose(found["ext_lights_image_based"], ext_lights_image_based(nine))


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_json_refuses_what_is_not_finite(bad):
    nine = np.zeros((9, 3))
    nine[4, 1] = bad
    with pytest.raises(ValueError, match="JSON"):
        coefficients_json(nine)


def test_a_png_has_right_checks():
    data = rgba_png(np.zeros((2, 2, 4), np.uint8))
    at = 8
    kinds = []
    while at < len(data):
        length, kind = struct.unpack_from(">I4s", data, at)
        kinds.append(kind)
        [check] = struct.unpack_from(">I", data, at + 8 + length)
        assert check == zlib.crc32(data[at + 4 : at + 8 + length])
        at += 12 + length
    assert kinds == [b"IHDR", b"IDAT", b"IEND"]
