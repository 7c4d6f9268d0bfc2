"""Exports for engines, from a probe in memory to files on disk, looked up as the engines do it.

The light is smooth, with a lamp at no special place, so that nothing is where it should be by
chance. What the engines find in the files is compared with sums over the probe's pixels.
"""

import json
import re
from pathlib import Path

import numpy as np
import OpenEXR
import OpenImageIO as oiio
import pytest

import shrm_cli as shrm
from shrm_cli.errors import ArgumentError, MapError, OutputError
from shrm_cli.export import engine as engines
from shrm_cli.export import ktx, make
from shrm_cli.export.make import Asked, Source, packaged, write
from shrm_cli.probe.probe import Probe
from shrm_cli.vocabulary import ENGINES
from tests.brute_force import latlong_samples, unit
from tests.export.readers import look_up, read_ktx1, read_ktx2
from tests.ggx import lobe, moments
from tests.makers import prefilter_irradiance as irradiance_of
from tests.makers import prefilter_split_sum as split_sum_of

HEIGHT = 64
LAMP = np.array([0.48, 0.6, -0.64])
MINE = [
    "filament", "bevy", "gltf-sample-viewer", "unity", "unreal", "godot", "cesium", "playcanvas",
    "model-viewer", "blender", "realitykit", "usd",
]  # fmt: skip


def light(directions):
    """Return the radiance from some directions, shape (n, 3)."""
    smooth = 1 + 0.5 * directions @ np.array([[0.9, 0.1, -0.3], [0.2, -0.8, 0.4], [0.1, 0.5, 0.8]])
    lamp = np.exp(40 * (directions @ LAMP - 1))
    return smooth + lamp[:, None] * np.array([9.0, 6.0, 3.0])


@pytest.fixture(scope="module")
def samples():
    """Return the directions of the probe's pixels, and radiance times solid angle."""
    directions, weights = (np.asarray(each) for each in latlong_samples(HEIGHT))
    return directions, light(directions) * weights[:, None]


@pytest.fixture(scope="module")
def probe():
    directions = np.asarray(latlong_samples(HEIGHT)[0])
    return Probe.from_array(light(directions).reshape(HEIGHT, 2 * HEIGHT, 3), "latlong")


def exported(probe, name, folder, **asked):
    """Export a probe, and return the package and the folder."""
    made = packaged(Source("sky", "sky.exr", probe), engines.engine(name), Asked(**asked))
    write(made, folder)
    return made


def filtered(samples, roughness, axis):
    """Return the mean of the light by GGX's lobe for N = V = R, summed over the pixels."""
    directions, energy = samples
    above = directions @ axis > 0
    weights = lobe(roughness, axis, axis, directions[above])[0]
    solid_angles = (energy / light(directions))[above, :1]
    return weights @ energy[above] / (weights @ solid_angles)


def irradiance(samples, normals):
    directions, energy = samples
    return np.maximum(normals @ directions.T, 0) @ energy


def assert_levels(mips, roughness, lookup, samples, rng):
    """Check that each mip holds the filtered light at its texels, where the engine finds it."""
    for faces, rough in zip(mips, roughness, strict=True):
        size = faces.shape[1]
        for direction in unit(rng, 12):
            value, center = texel(faces, lookup @ direction)
            place = lookup.T @ center
            if rough == 0:
                wanted = light(place[None])[0]
            elif rough < 0.2:  # too sharp for the sum over the probe's pixels
                continue
            else:
                wanted = filtered(samples, rough, place)
            assert value == pytest.approx(wanted, rel=0.02 if rough else 0.06), (rough, size)


def texel(faces, direction):
    """Return what OpenGL finds in faces, and the direction of that texel's centre."""
    size = faces.shape[1]
    grid = np.indices((6, size, size)).reshape(3, -1).T.reshape(6, size, size, 3)
    face, row, column = look_up(grid, [direction])[0]
    s, t = (2 * column + 1) / size - 1, (2 * row + 1) / size - 1
    center = np.array(
        [(1, -t, -s), (-1, -t, s), (s, 1, t), (s, -1, -t), (s, -t, 1), (-s, -t, -1)][face]
    )
    return faces[face, row, column], center / np.linalg.norm(center)


def test_every_engine_has_its_module():
    for name, module in ENGINES.items():
        if not (Path(engines.__file__).parent / "engines" / f"{module}.py").exists():
            assert name not in MINE
            continue
        found = engines.engine(name)
        assert found.name == name
        assert found.title


def test_filament(probe, samples, tmp_path, rng):
    made = exported(probe, "filament", tmp_path, size=64, skybox=32)
    names = {file.name for file in made.files}
    assert names == {"sky_ibl.ktx", "sky_skybox.ktx", "sh.txt", "sky_README.md"}
    found = read_ktx1((tmp_path / "sky_ibl.ktx").read_bytes())
    assert [mip.shape[1] for mip in found.mips] == [64, 32, 16]
    roughness = [1 - np.sqrt(1 - k / 2) for k in range(3)]
    assert_levels(found.mips, roughness, np.eye(3), samples, rng)
    sky = read_ktx1((tmp_path / "sky_skybox.ktx").read_bytes())
    assert_levels(sky.mips, [0.0], np.eye(3), samples, rng)
    # The key, the text, and the light agree.
    numbers = [float(each) for each in found.pairs["sh"].rstrip(b"\0").split()]
    assert len(numbers) == 27
    lines = (tmp_path / "sh.txt").read_text().splitlines()
    text = [float(v) for line in lines for v in line[1 : line.index(")")].split(",")]
    assert text == pytest.approx(numbers, rel=1e-8)
    assert np.reshape(numbers, (9, 3)) == pytest.approx(shader_coefficients(samples), abs=2e-3)


def shader_coefficients(samples):
    """Return what Filament's shader wants, by sums over the pixels: (9, 3).

    They are E's coefficients divided by pi (eq. 4.11 and 4.13 of Ramamoorthi's thesis), with the
    constants of the harmonics once more.
    """
    directions, energy = samples
    x, y, z = directions.T
    a, b, c = 0.488603, 1.092548, 0.315392
    norms = np.array([0.282095, a, a, a, b, b, c, b, b / 2])
    terms = np.array([1 + 0 * x, y, z, x, x * y, y * z, 3 * z * z - 1, x * z, x * x - y * y])
    lambert = np.array([np.pi] + [2 * np.pi / 3] * 3 + [np.pi / 4] * 5)
    return (lambert / np.pi * norms**2)[:, None] * (terms @ energy)


@pytest.mark.parametrize("texels", ["rgb9e5", "rgba16f"])
def test_bevy(probe, samples, tmp_path, rng, texels):
    made = exported(probe, "bevy", tmp_path, size=32, texels=texels, skybox=20)
    lookup = np.diag([1.0, 1, -1])  # environment_map.wgsl: sample_dir.z = -sample_dir.z
    found = read_ktx2((tmp_path / "sky_specular.ktx2").read_bytes())
    assert found.header["texels"] == texels
    assert [mip.shape[1] for mip in found.mips] == [32, 16, 8]
    assert_levels(found.mips, [0, 0.5, 1], lookup, samples, rng)
    diffuse = read_ktx2((tmp_path / "sky_diffuse.ktx2").read_bytes())
    for direction in unit(rng, 20):
        value, center = texel(diffuse.mips[0], lookup @ direction)
        wanted = irradiance(samples, (lookup @ center)[None])[0] / np.pi
        assert value == pytest.approx(wanted, rel=5e-3)
    sky = read_ktx2((tmp_path / "sky_skybox.ktx2").read_bytes())  # skybox.wgsl: z is negated, too
    assert [mip.shape[1] for mip in sky.mips] == [20]
    assert_levels(sky.mips, [0], lookup, samples, rng)
    assert any('load::<Image>("sky_skybox.ktx2").into()' in line for line in made.loading)


def test_gltf_sample_viewer(probe, samples, tmp_path, rng, monkeypatch):
    monkeypatch.setattr(make, "TABLE_SIZE", 4)
    exported(probe, "gltf-sample-viewer", tmp_path, size=32, table=True)
    found = read_ktx2((tmp_path / "sky_ggx.ktx2").read_bytes())
    assert_levels(found.mips, [0, 1], np.eye(3), samples, rng)
    diffuse = read_ktx2((tmp_path / "sky_lambertian.ktx2").read_bytes())
    value, center = texel(diffuse.mips[0], np.array([0.3, 0.5, -0.2]))
    assert value == pytest.approx(irradiance(samples, center[None])[0] / np.pi, rel=5e-3)
    table = read_png(tmp_path / "sky_lut_ggx.png") / 65535
    for row, column in [(1, 0), (2, 3), (3, 1)]:
        roughness, cosine = (row + 0.5) / 4, (column + 0.5) / 4
        first, tail = moments(roughness, cosine, 300, 300)[:, 0]
        assert table[row, column] == pytest.approx([first - tail, tail, 0], abs=1e-3)
    # The viewer turns by rotateY(90 degrees) of gl-matrix, and its panoramas have +X in the centre.
    data = (tmp_path / "sky.hdr").read_bytes()
    start = data.index(b"\n", data.index(b"-Y ")) + 1
    assert data[:start] == b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 64 +X 128\n"
    pixels = np.frombuffer(data, np.uint8, offset=start).reshape(64, 128, 4).astype(float)
    image = pixels[..., :3] * np.exp2(pixels[..., 3:] - 136)
    places = samples[0]
    for x, y, z in unit(rng, 50):
        turned = (z, y, -x)
        u = 0.5 + 0.5 * np.arctan2(turned[2], turned[0]) / np.pi
        v = np.arccos(turned[1]) / np.pi
        row, column = int(v * 64), int(u * 128) % 128
        wanted = light(places[[row * 128 + column]])[0]
        assert np.abs(image[row, column] - wanted).max() < wanted.max() / 128
        near = light(np.array([[x, y, z]]))[0]
        assert image[row, column] == pytest.approx(near, rel=0.3)


def read_png(path):
    image = oiio.ImageInput.open(str(path))
    pixels = image.read_image("uint16")
    image.close()
    return pixels


def latlong(folder, name):
    with OpenEXR.File(str(folder / name), separate_channels=True) as file:
        channels = file.channels()
        return np.stack([channels[c].pixels for c in "RGB"], axis=-1).astype(float)


def assert_latlong(image, place, rng):
    """Check an image, by the engine's place (u, v) of each of our directions."""
    height, width = image.shape[:2]
    for direction in unit(rng, 100):
        u, v = place(*direction)
        value = image[min(int(v * height), height - 1), int(u * width) % width]
        assert value == pytest.approx(light(direction[None])[0], rel=0.3)


def test_godot(probe, tmp_path, rng):
    exported(probe, "godot", tmp_path)

    def place(x, y, z):
        """sky.glsl: atan(x, -z), from 0 to 2 pi, and acos(y)."""
        return np.arctan2(x, -z) % (2 * np.pi) / (2 * np.pi), np.arccos(y) / np.pi

    assert_latlong(latlong(tmp_path, "sky_panorama.exr"), place, rng)


def test_blender(probe, tmp_path, rng):
    exported(probe, "blender", tmp_path)

    def place(x, y, z):
        """`direction_to_equirectangular` of Cycles, in Blender's axes; its v is 1 on top."""
        x, y, z = x, -z, y
        u = -np.arctan2(y, x) / (2 * np.pi) + 0.5
        return u, 1 - (np.arctan2(z, np.hypot(x, y)) / np.pi + 0.5)

    assert_latlong(latlong(tmp_path, "sky_world.exr"), place, rng)


def test_usd(probe, tmp_path, rng):
    exported(probe, "usd", tmp_path)

    def place(x, y, z):
        """By the words of USD's schema, from longitude pi at the left to -pi at the right."""
        return 0.5 - np.arctan2(x, z) / (2 * np.pi), 0.5 - np.arcsin(y) / np.pi

    assert_latlong(latlong(tmp_path, "sky_dome.exr"), place, rng)
    text = (tmp_path / "sky.usda").read_text()
    assert "@./sky_dome.exr@" in text
    assert 'DomeLight_1 "Dome"' in text
    assert 'poleAxis = "Y"' in text


def test_realitykit(probe, tmp_path, rng):
    exported(probe, "realitykit", tmp_path)

    def place(x, y, z):
        """Apple's words: a scan clockwise, seen from above, that begins behind, at +Z."""
        behind, left = z, -x
        return np.arctan2(left, behind) % (2 * np.pi) / (2 * np.pi), np.arccos(y) / np.pi

    assert_latlong(latlong(tmp_path, "sky_skybox.exr"), place, rng)


def test_unity(probe, samples, tmp_path, rng):
    exported(probe, "unity", tmp_path)

    def place(x, y, z):
        """A Skybox/Panoramic material with Rotation 90, in Unity's axes, where x is -x."""
        x = -x
        x, z = z, -x  # the sky is turned by 90 degrees, so the direction by as many back
        return 0.5 - np.arctan2(z, x) / (2 * np.pi), np.arccos(y) / np.pi

    assert_latlong(latlong(tmp_path, "sky_latlong.exr"), place, rng)
    sh = json.loads((tmp_path / "sky_sh.json").read_text())
    x, y, z = np.array([-0.6, 0.64, 0.48])  # Unity's, that is (0.6, 0.64, 0.48) of ours
    terms = [1, y, z, x, x * y, y * z, 3 * z * z - 1, x * z, x * x - y * y]
    found = [np.dot(sh[channel], terms) for channel in ("red", "green", "blue")]
    wanted = irradiance(samples, np.array([[0.6, 0.64, 0.48]]))[0] / np.pi
    assert found == pytest.approx(wanted, rel=0.02)


def test_unreal(probe, tmp_path, rng):
    exported(probe, "unreal", tmp_path)

    def place(x, y, z):
        """`LookupLongLat`, where directions have Unreal's y and z exchanged; (x, z, y) of ours."""
        unreal_x, unreal_y, unreal_z = x, z, y
        across, up, along = unreal_x, unreal_z, unreal_y
        return (1 + np.arctan2(across, -along) / np.pi) / 2, np.arccos(up) / np.pi

    assert_latlong(latlong(tmp_path, "sky_longlat.exr"), place, rng)
    assert "Condon-Shortley" in json.loads((tmp_path / "sky_sh.json").read_text())["meaning"]


# ---- maps ----------------------------------------------------------------------------------------


def test_a_split_sum_that_fits_gives_the_same_levels(probe, tmp_path):
    split = split_sum_of(probe, levels=3, mapping="filament", size=64).map
    source = Source.of_maps("sky", [("sky.splitsum.exr", split)])
    made = packaged(source, engines.engine("filament"), Asked(skybox=0))
    write(made, tmp_path)
    other = tmp_path / "probe"
    exported(probe, "filament", other, size=64, skybox=0)
    ours, theirs = (read_ktx1((each / "sky_ibl.ktx").read_bytes()) for each in (tmp_path, other))
    for one, other in zip(ours.mips, theirs.mips, strict=True):
        assert (np.abs(one - other) < 0.04 * other).all()  # a step of five bits is 3.1 %
    numbers = [
        [float(each) for each in found.pairs["sh"].rstrip(b"\0").split()]
        for found in (ours, theirs)
    ]
    scale = max(map(abs, numbers[1]))
    assert numbers[0] == pytest.approx(numbers[1], abs=2e-3 * scale)


@pytest.mark.parametrize(
    ("levels", "mapping", "size", "asked", "why"),
    [
        (5, "linear", 64, {}, r"roughness 0, 0\.25, .*, 1; Filament looks up 0, 0\.293, 1 at size"),
        (3, "linear", 64, {"size": 64}, r"--mapping filament --levels 3 --mips --size 64"),
        (3, "linear", 64, {}, r"--mapping filament --levels 5 --mips --size 256"),
        (3, "filament", 32, {"size": 64}, r"level 0 has 32 texels along an edge, not 64"),
    ],
)
def test_a_split_sum_that_does_not_fit_is_refused(probe, levels, mapping, size, asked, why):
    split = split_sum_of(probe, levels=levels, mapping=mapping, size=size).map
    source = Source.of_maps("sky", [("sky.splitsum.exr", split)])
    with pytest.raises(MapError, match=why):
        packaged(source, engines.engine("filament"), Asked(**asked))


def test_an_irradiance_map_gives_coefficients_and_cubes(probe, samples, tmp_path):
    finer = irradiance_of(probe, 20).map
    source = Source.of_maps("sky", [("sky.irradiance.exr", finer)])
    for name, wanted in (
        ("filament", {"sh.txt", "sky_README.md"}),
        ("bevy", {"sky_diffuse.ktx2", "sky_README.md"}),
    ):
        made = packaged(source, engines.engine(name), Asked())
        assert {file.name for file in made.files} == wanted
        named = re.findall(r"\w+\.(?:ktx2?|txt)", "\n".join(made.loading))
        assert set(named) == wanted - {"sky_README.md"}
    with pytest.raises(MapError, match="nothing in it is what Godot reads"):
        packaged(source, engines.engine("godot"), Asked())


def test_maps_that_engines_do_not_read_are_refused(probe):
    nine = irradiance_of(probe).map
    with pytest.raises(MapError, match="second map of a kind"):
        Source.of_maps("sky", [("a.exr", nine), ("b.exr", nine)])


# ---- what is said, and what is refused -----------------------------------------------------------


@pytest.mark.parametrize("name", MINE)
def test_everything_is_said(probe, tmp_path, name):
    size = {"size": 32} if engines.engine(name).wants_levels else {}
    made = exported(probe, name, tmp_path / "out", **size)
    text = (tmp_path / "out" / "sky_README.md").read_text()
    for file in made.files[:-1]:
        assert f"`{file.name}`" in text
    for line in [*made.told, *made.loading]:
        assert line in text
    assert made.told
    assert made.loading
    assert made.warnings == []


@pytest.mark.parametrize("name", sorted({*MINE} - {"blender", "usd"}))  # which take floats
def test_bright_light_is_clipped_with_one_warning_a_file(tmp_path, name):
    image = np.ones((32, 64, 3))
    image[5, 9] = 1e6
    bright = Probe.from_array(image, "latlong")
    size = {"size": 32} if engines.engine(name).wants_levels else {}
    made = exported(bright, name, tmp_path, **size)
    above = [line for line in made.warnings if "were clipped" in line]
    assert above
    assert len(above) == len({line.partition(":")[0] for line in above})
    assert all("dim them with `clamp`" in line for line in above)


def test_a_map_of_bright_light_is_to_be_made_anew():
    """`clamp` does not apply to maps."""
    image = np.ones((32, 64, 3))
    image[5, 9] = 1e6
    split = split_sum_of(Probe.from_array(image), levels=3, mapping="linear", size=32).map
    source = Source.of_maps("sun", [("sun.splitsum.exr", split)])
    (line,) = packaged(source, engines.engine("directx"), Asked()).warnings
    assert "; make the map anew, and dim them with `clamp` there" in line


def test_coefficients_that_would_be_negative_are_windowed_and_it_is_told():
    pixels = np.full((32, 64, 3), 0.05, np.float32)
    pixels[8, 20] = 2000
    source = Source("sun", "sun.exr", Probe.from_array(pixels))
    auto = packaged(source, engines.engine("json"), Asked())
    (line,) = [each for each in auto.told if "windowed" in each]
    assert "RMS" in line
    assert not any("irradiance falls" in each for each in auto.warnings)
    plain = packaged(source, engines.engine("json"), Asked(window="none"))
    assert not any("windowed" in each for each in plain.told)
    assert any("irradiance falls to -" in each for each in plain.warnings)


@pytest.mark.parametrize(
    ("name", "asked", "argument"),
    [
        ("filament", {"texels": "rgb9e5"}, "texels"),
        ("godot", {"texels": "rgba16f"}, "texels"),
        ("filament", {"size": 100}, "size"),
        ("filament", {"size": 8}, "size"),
        ("three", {"size": 8}, "size"),  # a single level would be shown at every roughness
        ("gltf", {"size": 16}, "size"),
        ("three", {"skybox": 64}, "skybox"),
        ("bevy", {"skybox": 6, "texels": "bc6h", "size": 32}, "skybox"),
        ("bevy", {"texels": "astc6x6"}, "texels"),  # wgpu panics where blocks are cut
        ("bevy", {"window": "auto"}, "window"),
        ("godot", {"window": "none"}, "window"),
        ("unity", {"table": True}, "table"),
    ],
)
def test_what_an_engine_has_not_is_refused(probe, name, asked, argument):
    with pytest.raises(ArgumentError) as caught:
        packaged(Source("sky", "sky.exr", probe), engines.engine(name), Asked(**asked))
    assert caught.value.argument == argument


def test_ktx2_without_zstandard_is_larger_and_says_so(probe, tmp_path, monkeypatch):
    exported(probe, "bevy", tmp_path, size=32)
    monkeypatch.setattr(ktx, "find_spec", lambda name: None)
    made = exported(probe, "bevy", tmp_path / "plain", size=32)
    assert sum("not compressed" in line for line in made.told) == 1
    for name in ("sky_specular.ktx2", "sky_diffuse.ktx2"):
        plain, packed = tmp_path / "plain" / name, tmp_path / name
        assert plain.stat().st_size > packed.stat().st_size
        one, other = read_ktx2(plain.read_bytes()), read_ktx2(packed.read_bytes())
        assert (one.mips[0] == other.mips[0]).all()


def test_files_appear_together_or_not_at_all(probe, tmp_path):
    made = packaged(Source("sky", "sky.exr", probe), engines.engine("godot"), Asked())

    def fails(path):
        raise OutputError(f"{path}: no room")

    made.files[-1] = engines.OutputFile("sky_README.md", fails)
    with pytest.raises(OutputError, match="no room"):
        write(made, tmp_path / "out")
    assert not list(tmp_path.iterdir())


def test_other_files_are_kept(probe, tmp_path):
    made = exported(probe, "godot", tmp_path)
    write(made, tmp_path)  # the same bytes again
    other = exported(probe, "godot", tmp_path / "other", size=16)
    with pytest.raises(OutputError, match="exists, and other inputs or options made it"):
        write(other, tmp_path)
    write(other, tmp_path, kept=False)
    assert latlong(tmp_path, "sky_panorama.exr").shape == (16, 32, 3)


def test_the_library_takes_probes_as_it_takes_their_files(probe, tmp_path):
    path = "probes/studio.exr"
    shrm.export(shrm.open_probe(path), "json", tmp_path / "ours")
    shrm.export(path, "json", tmp_path / "theirs")
    ours, theirs = (sorted((tmp_path / each).iterdir()) for each in ("ours", "theirs"))
    assert [(each.name, each.read_bytes()) for each in ours] == [
        (each.name, each.read_bytes()) for each in theirs
    ]
    assert shrm.export([probe], "json").files[0].name.startswith("array")
    for two in ([path, "probes/sky.exr"], [probe, path], [path, "light.irradiance.exr"]):
        with pytest.raises(ArgumentError, match=r"begin with a probe, .+; export it alone"):
            shrm.export(two, "json")
