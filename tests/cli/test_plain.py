"""`shrm convert --view` and `--mips`: plain images of maps, read by OpenImageIO."""

import json
import math

import numpy as np
import OpenImageIO as oiio
import pytest

from shrm_cli.maps.file import open_map
from shrm_cli.maps.kinds import LightMap
from shrm_cli.prefilter import prefilter
from tests import oracles
from tests.cli.helpers import assert_refused, done, polynomial_light, run, write_exr
from tests.render.materials import under_random_light
from tests.render.test_oneview import direction

BRDF = ("--brdf", "microfacet:sigma=0.5", "--size", "8")
GLOSSY = (*BRDF, "--order-f", "4", "--order-p", "1")
FORMS = {
    "shrm": ("--to", "shrm", *GLOSSY),
    "local": ("--to", "shrm", "--frame", "local", *GLOSSY),
    "compressed": ("--to", "shrm", "--compress", "pca:2", *GLOSSY),
    "principal": ("--to", "principal", "--maps", "4", *BRDF),
    "cabral": ("--to", "cabral", *GLOSSY),
    "kautz-mccool": ("--to", "kautz-mccool", *GLOSSY),
    "lightfield": ("--to", "lightfield", *GLOSSY),
    "irradiance": ("--to", "irradiance"),
    "splitsum": ("--to", "splitsum", "--levels", "0.5,1.0", "--size", "8"),
    "she": ("--to", "she", "--p-order", "2", "--q-order", "1"),
}
PIXELS = [(2, 5), (7, 20), (9, 30), (12, 11)]
AZIMUTH, ELEVATION = 30.0, 25.0


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("plain")
    light = polynomial_light(oracles.latlong_pixels(32, 16)).astype(np.float32)
    write_exr(folder / "probe.exr", light)
    return folder


def levels(path):
    """All mip levels of a file, as an independent reader has them."""
    source = oiio.ImageInput.open(str(path))
    found = []
    while source.seek_subimage(0, len(found)):
        found.append(source.read_image(0, len(found), 0, 3, oiio.FLOAT))
    oiio.geterror()
    return found


def picture(path):
    return oiio.ImageBuf(str(path)).get_pixels(oiio.FLOAT)


def viewer():
    azimuth, elevation = math.radians(AZIMUTH), math.radians(ELEVATION)
    flat = math.cos(elevation)
    return np.array([flat * math.sin(azimuth), math.sin(elevation), flat * math.cos(azimuth)])


@pytest.mark.parametrize(
    "form", [pytest.param(f, marks=pytest.mark.slow) if f == "principal" else f for f in FORMS]
)
def test_every_form_for_one_view(made, form):
    source, target = made / f"{form}.exr", made / f"{form}.view.exr"
    done("prefilter", made / "probe.exr", *FORMS[form], "--quiet", "-o", source)
    found = open_map(source)
    surface = ()
    if isinstance(found, LightMap):
        surface, found = ("--roughness", "0.6", "--f0", "0.5"), found.shaded(0.6, (0.5,) * 3)
    said = json.loads(
        done(
            "convert", source, "--to", "latlong", "--view", f"{AZIMUTH},{ELEVATION}", "--by",
            "reflection", "--size", 16, *surface, "--precision", "float", "--json", "-o", target,
        )
    )  # fmt: skip
    assert (said["by"], said["width"], said["height"]) == ("reflection", 32, 16)
    pixels = picture(target)
    for row, column in PIXELS:
        total = direction(row, column, 16) + viewer()
        expected = found.radiance(total / math.sqrt(total @ total), viewer())
        np.testing.assert_allclose(pixels[row, column], expected, rtol=2e-4, atol=1e-5)


def test_the_look_up_of_the_map_is_the_default(made, tmp_path):
    done("prefilter", made / "probe.exr", "--to", "irradiance", "-o", tmp_path / "i.exr")
    text = done(
        "convert", tmp_path / "i.exr", "--to", "latlong", "--view", "0,0", "--precision", "float",
        "-o", tmp_path / "o.exr",
    )  # fmt: skip
    assert "over the normal" in text
    pixels = picture(tmp_path / "o.exr")
    assert pixels.shape == (256, 512, 3)
    found = open_map(tmp_path / "i.exr")
    for row, column in [(10, 20), (200, 400)]:  # one of them faces away from the viewer
        normal = direction(row, column, 256)
        np.testing.assert_allclose(pixels[row, column], found.radiance(normal, normal), rtol=1e-4)


def test_names_and_defaults(made, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done("prefilter", made / "probe.exr", *FORMS["shrm"], "--quiet", "-o", "m.shrm.exr")
    command = ("convert", "m.shrm.exr", "--to", "latlong", "--view", "30,-5")
    assert "over the mirror direction, seen from 30,-5, 512 x 256" in done(*command)
    path = tmp_path / "m.shrm.latlong.view30_-5.exr"
    before = path.read_bytes()
    done(*command)
    assert path.read_bytes() == before
    assert_refused(run(*command, "--size", "64"), 1, path.name, "--force")
    # The other meaning of a pixel, of the same view, has a name of its own.
    assert "over the normal, seen from 30,-5" in done(*command, "--by", "normal")
    assert (tmp_path / "m.shrm.latlong.view30_-5.normal.exr").exists()
    assert path.read_bytes() == before


def test_negative_light_is_told_and_left_out(tmp_path):
    under_random_light().save(tmp_path / "m.exr", "float")
    arguments = ("--to", "latlong", "--view", "0,0", "--size", 16, "-o", tmp_path / "o.exr")
    result = run("convert", tmp_path / "m.exr", *arguments)
    assert result.code == 0
    assert "of 512 pixels were negative (least -" in result.err
    assert "make the map anew and take --to auto without --eps or orders" in result.err
    assert len(result.err.splitlines()) == 1
    assert picture(tmp_path / "o.exr").min() == 0


def test_what_helps_against_negative_light_is_that_of_the_map(tmp_path):
    """Principal maps were said to leave less of it, also to those who had made one."""
    image = np.zeros((32, 64, 3), np.float32)
    image[10, 20] = 1e4
    brdf = "phong:exponent=16"
    prefilter(image, brdf, to="principal", eps=0.1, sun="keep").save(tmp_path / "m.exr")
    arguments = ("--to", "latlong", "--view", "0,0", "--size", 16, "-o", tmp_path / "o.exr")
    result = run("convert", tmp_path / "m.exr", *arguments)
    assert "of 512 pixels were negative (least -" in result.err
    assert "mostly beside lamps" in result.err
    assert result.err.strip().endswith("make the map anew and dim them by --clamp")


def test_product_textures_with_light_and_without(tmp_path):
    done("product", "lambertian", "--size", "16", "--order", "2", "-o", tmp_path / "t.exr")
    command = ("--to", "latlong", "--view", "0,0", "--size", 16, "-o", tmp_path / "o.exr")
    result = run("convert", tmp_path / "t.exr", *command)
    assert_refused(result, 1, "t.exr", "holds no light", "--to product")
    light = np.zeros((9, 3))
    light[0], light[1] = 3, [0.5, 0.2, -0.3]
    lit = open_map(tmp_path / "t.exr").lit(light)
    lit.save(tmp_path / "lit.exr", "float")
    done("convert", tmp_path / "lit.exr", *command, "--by", "normal", "--precision", "float")
    normal = direction(5, 14, 16)
    expected = lit.radiance(normal, np.array([0.0, 0, 1]))
    found = picture(tmp_path / "o.exr")[5, 14]
    np.testing.assert_allclose(found, expected, rtol=1e-3)
    # A white surface reflects E / pi of L00 and, 2/3 of it, L1-1, which is light from +Y.
    shown = 0.282095 * light[0] + 2 / 3 * 0.488603 * normal[1] * light[1]
    np.testing.assert_allclose(found, shown, rtol=0.02)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--to", "hcross", "--view", "0,0"], "--view applies with --to latlong"),
        (["--to", "latlong", "--by", "normal"], "--by applies with --view"),
        (["--to", "latlong", "--roughness", "0.5"], "--roughness applies with --view"),
        (["--to", "strip", "--mips"], "--mips applies to split sums"),
        (["--to", "latlong", "--view", "0,0", "--mips"], "--mips applies to split sums"),
        (["--to", "openexr", "--mips", "--size", "8"], "--size applies to lat-longs"),
    ],
)
def test_options_that_do_not_fit(made, arguments, words):
    done("prefilter", made / "probe.exr", *FORMS["shrm"], "--quiet", "-o", made / "s.exr")
    result = run("convert", made / "s.exr", *arguments, "-o", made / "x.exr")
    assert_refused(result, 2, words)


# ---- mip levels -----------------------------------------------------------------------------


@pytest.fixture(scope="module")
def chain(tmp_path_factory):
    """A split sum of 16, 8, 4, 2 and 1 texels, under light that is linear in the direction."""
    folder = tmp_path_factory.mktemp("chain")
    light = 2 + oracles.latlong_pixels(64, 32) @ np.diag([1.0, 0.5, -0.7])
    primaries = (0.68, 0.32, 0.265, 0.69, 0.15, 0.06, 0.3127, 0.329)
    write_exr(folder / "probe.exr", light.astype(np.float32), chromaticities=primaries)
    path = folder / "c.splitsum.exr"
    said = json.loads(
        done(
            "prefilter", folder / "probe.exr", "--to", "splitsum", "--mips", "--size", 16,
            "--precision", "float", "--json", "-o", path,
        )
    )  # fmt: skip
    assert [level["size"] for level in said["levels"]] == [16, 8, 4, 2, 1]
    return path


def test_cubes_are_the_levels_of_the_split_sum(chain, tmp_path):
    target = tmp_path / "c.exr"
    command = ("convert", chain, "--to", "openexr", "--mips", "-o", target)
    assert "7 mip levels from 16 x 96" in done(*command)
    found = levels(target)
    assert [each.shape[:2] for each in found] == [
        (96, 16), (48, 8), (24, 4), (12, 2), (6, 1), (3, 1), (1, 1)
    ]  # fmt: skip
    source = oiio.ImageInput.open(str(chain))
    for k, level in enumerate(found[:5]):
        np.testing.assert_array_equal(level, source.read_image(k, 0, 0, 3, oiio.FLOAT))
    np.testing.assert_allclose(found[5], found[4].reshape(3, 2, 1, 3).mean(axis=1), rtol=1e-6)
    np.testing.assert_allclose(found[6][0, 0], found[4].mean(axis=(0, 1)), rtol=1e-6)
    spec = oiio.ImageInput.open(str(target)).spec()
    assert spec.tile_width == 64
    recipe = json.loads(spec.getattribute("shrm:recipe"))
    assert recipe["roughness"] == [0, 0.25, 0.5, 0.75, 1, 1, 1]
    assert spec.getattribute("chromaticities")[0] == pytest.approx(0.68)
    before = target.read_bytes()
    done(*command)
    assert target.read_bytes() == before


@pytest.mark.parametrize("sampling", ["center", "border"])
def test_lat_longs_of_light_that_is_linear(chain, tmp_path, sampling):
    """Every lobe keeps the mean and the form of such light, and broad ones weaken it."""
    target = tmp_path / "l.exr"
    done("convert", chain, "--to", "latlong", "--mips", "--to-sampling", sampling, "-o", target)
    found = levels(target)
    assert [each.shape[:2] for each in found] == [
        (32, 64), (16, 32), (8, 16), (4, 8), (2, 4), (1, 2), (1, 1)
    ]  # fmt: skip
    source = oiio.ImageInput.open(str(target)).spec()
    assert source.getattribute("textureformat") == {
        "center": "Plain Texture", "border": "LatLong Environment",
    }[sampling]  # fmt: skip
    kept = []
    for level in found[:3]:  # the cubes of the others are too coarse to be interpolated closely
        height = len(level)
        if sampling == "center":
            pixels = np.array(
                [[direction(i, j, height) for j in range(2 * height)] for i in range(height)]
            )
        else:
            across, down = np.linspace(1, -1, 2 * height), np.linspace(0.5, -0.5, height)
            longitude, latitude = np.meshgrid(across * np.pi, down * np.pi)
            pixels = np.stack(
                [
                    np.cos(latitude) * np.sin(longitude),
                    np.sin(latitude),
                    np.cos(latitude) * np.cos(longitude),
                ],
                axis=-1,
            )
        shape = pixels * [1.0, 0.5, -0.7]
        factor = np.sum((level - 2) * shape) / np.sum(shape**2)
        np.testing.assert_allclose(level, 2 + factor * shape, atol=0.02)
        kept.append(factor)
    assert kept[0] == pytest.approx(1, abs=0.01)
    assert kept[0] > kept[1] > kept[2] > 0.5
    np.testing.assert_allclose(found[-1][0, 0], 2, atol=0.01)
    # Below the split sum's levels pixels are averages: of these two, of half the sphere each.
    if sampling == "center":
        half = found[-2][0]
        np.testing.assert_allclose(half.mean(axis=0), found[-1][0, 0], rtol=1e-3)
        assert half[0, 0] > 2 > half[1, 0]


def test_openimageio_looks_the_light_up_where_it_is(chain, tmp_path):
    """Its texture system knows environments; wide look-ups take coarse levels, of rough lobes."""
    target = str(tmp_path / "e.exr")
    done("convert", chain, "--to", "latlong", "--mips", "--to-sampling", "border", "-o", target)
    textures, how = oiio.TextureSystem(), oiio.TextureOpt()

    def seen(toward, spread):
        toward = tuple(float(each) for each in toward)
        return np.array(
            textures.environment(target, how, toward, (spread, 0, 0), (0, spread, 0), 3)
        )

    for toward in [(0, 0, 1), (1, 0, 0), (0, 1, 0), (0.6, 0.48, 0.64), (-0.6, 0.64, -0.48)]:
        np.testing.assert_allclose(
            seen(toward, 0), 2 + np.array(toward) * [1.0, 0.5, -0.7], atol=0.015
        )
    sharp, broad = (abs(seen((0.6, 0.48, 0.64), spread) - 2) for spread in (0, 1))
    assert (broad < 0.95 * sharp).all()


def test_other_split_sums_are_no_mip_chains(made, tmp_path):
    source = tmp_path / "s.exr"
    done("prefilter", made / "probe.exr", "--to", "splitsum", "--levels", 3, "-o", source)
    result = run("convert", source, "--to", "latlong", "--mips", "-o", tmp_path / "x.exr")
    assert_refused(result, 1, "s.exr", "no mip chain", "--to splitsum --mips")
    done("prefilter", made / "probe.exr", *FORMS["shrm"], "--quiet", "-o", source, "--force")
    result = run("convert", source, "--to", "latlong", "--mips", "-o", tmp_path / "x.exr")
    assert_refused(result, 1, "made of split sums")
    assert not (tmp_path / "x.exr").exists()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--size", "12"], "do not halve down to one; take --size 8"),
        (["--size", "4", "--levels", "4"], "halve into 3 levels, not 4"),
        (["--size", "8", "--map-sampling", "border"], "--mips needs texels at their centers"),
    ],
)
def test_chains_that_cannot_be(made, tmp_path, arguments, words):
    result = run(
        "prefilter", made / "probe.exr", "--to", "splitsum", "--mips", *arguments, "-o",
        tmp_path / "x.exr",
    )  # fmt: skip
    assert result.code in (1, 2)
    assert words in result.err
    assert not (tmp_path / "x.exr").exists()


@pytest.mark.parametrize(("size", "advice"), [(1, 16), (7, 16), (24, 16), (40, 32)])
def test_what_is_advised_for_other_heights_works(chain, tmp_path, size, advice):
    """Options of prefiltering are not advised: --levels is none of `convert`."""
    made = tmp_path / "x.exr"
    arguments = ["convert", chain, "--to", "latlong", "--mips", "-o", made, "--size"]
    result = run(*arguments, size)
    assert_refused(result, 1, f"take --size {advice}")
    assert "--levels" not in result.err
    assert not made.exists()
    assert run(*arguments, advice).code == 0


def test_filaments_five_levels(made, tmp_path):
    said = json.loads(
        done(
            "prefilter", made / "probe.exr", "--to", "splitsum", "--mips", "--mapping", "filament",
            "--levels", 3, "--size", 16, "--json", "-o", tmp_path / "f.exr",
        )
    )  # fmt: skip
    assert [level["size"] for level in said["levels"]] == [16, 8, 4]
