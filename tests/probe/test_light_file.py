"""Light files: what is in them is summed, in harmonics and in pixels, or refused."""

import hashlib

import numpy as np
import pytest

from shrm_cli.color import conversion
from shrm_cli.errors import ProbeError
from shrm_cli.probe import light_sum
from shrm_cli.probe.lighting import project
from shrm_cli.probe.make import latlong_solid_angles
from shrm_cli.probe.open import open_probe
from shrm_cli.probe.options import ReadOptions
from shrm_cli.probe.sky import SUN_RADIUS, SUN_SOLID_ANGLE, sky, sun_radiance
from shrm_cli.vocabulary import PRIMARIES
from tests import oracles
from tests.cli.helpers import noise
from tests.probe import scenes

ORDER = 6
DISC = "[[disc]]\nazimuth = 40\nelevation = 30\nradius = 20\nradiance = 3\n"


@pytest.fixture
def folder(tmp_path):
    scenes.write(tmp_path / "a.exr", noise(16, 32))
    scenes.write(tmp_path / "b.exr", noise(32, 64)[::-1])
    return tmp_path


def lights(folder, text, name="lights.toml"):
    (folder / name).write_text(text)
    return folder / name


def test_a_sum_of_probes_and_discs(folder):
    """The discs are integrated here, by points within them."""
    path = lights(folder, """
        [[probe]]
        file = "a.exr"
        yaw = 30
        roll = -20
        scale = [1, 0.5, 0]
        [[probe]]
        file = "b.exr"
        clamp = 0.9
        [[disc]]
        direction = [0, 3, 4]
        radius = 25
        radiance = [2, 1, 0.5]
        [[disc]]
        azimuth = 90
        elevation = -45
        solid_angle = 0.4
        irradiance = 5
    """)  # fmt: skip
    found = project(open_probe(path), ORDER)
    expected = project(open_probe(folder / "a.exr", yaw=30, roll=-20), ORDER).coefficients
    expected = expected * [1, 0.5, 0]
    expected += project(open_probe(folder / "b.exr", clamp=0.9), ORDER).coefficients
    cosine = 1 - 0.4 / (2 * np.pi)
    slanted = np.array([0.5**0.5, -(0.5**0.5), 0])
    for axis, radius, radiance in (
        (np.array([0, 0.6, 0.8]), np.radians(25), np.array([2, 1, 0.5])),
        (slanted, np.arccos(cosine), np.full(3, 5 / (np.pi * (1 - cosine**2)))),
    ):
        directions, areas = oracles.disc_rule(axis, radius)
        values = oracles.real_harmonics(ORDER, directions).T @ areas
        expected += values[:, None] * radiance
    np.testing.assert_allclose(found.coefficients, expected, rtol=0, atol=1e-12)


def test_the_pixels_of_a_sum(folder):
    """They hold the same light as the harmonics, and the energy of lights that overlap."""
    scenes.write(folder / "a.exr", scenes.latlong(64))
    path = lights(folder, """
        [[probe]]
        file = "a.exr"
        scale = 2
        [[disc]]
        direction = [1, 0.3, 0]
        radius = 40
        radiance = [2, 1, 0.5]
        [[disc]]
        direction = [1, 0.8, 0.3]
        radius = 30
        radiance = [0, 4, 1]
    """)  # fmt: skip
    probe = open_probe(path, yaw=70, mirror=True)
    exact = project(probe, ORDER)
    drawn = open_probe(scenes.write(folder / "drawn.exr", probe.image()), yaw=70, mirror=True)
    assert drawn.height == 512
    found = project(drawn, ORDER)
    scale = np.linalg.norm(exact.coefficients)
    assert np.linalg.norm(found.coefficients - exact.coefficients) < 2e-3 * scale
    np.testing.assert_allclose(found.energy, exact.energy, rtol=5e-3)
    alone = sum(
        project(open_probe(lights(folder, text, "one.toml")), 0).energy
        for text in ("[[" + part for part in path.read_text().split("[[")[1:])
    )
    assert (exact.energy > 1.1 * alone).all()
    directions = oracles.random_directions(np.random.default_rng(1), 50)
    np.testing.assert_allclose(probe.radiance(directions), drawn.radiance(directions), rtol=1e-6)


@pytest.mark.parametrize("elevation", [35, 3])
def test_the_sun_and_the_rest_of_a_sky(folder, elevation):
    """The sun in a pixel lies up to half a pixel beside its place, which finer waves tell."""
    rows, radiance = 256, sun_radiance(elevation, 3.0)
    scenes.write(folder / "sky.exr", sky(rows, 50, elevation))
    scenes.write(folder / "rest.exr", sky(rows, 50, elevation, has_disc=False))
    path = lights(folder, f"""
        [[probe]]
        file = "rest.exr"
        [[disc]]
        azimuth = 50
        elevation = {elevation}
        radius = {np.degrees(SUN_RADIUS)}
        radiance = {radiance.tolist()}
    """)  # fmt: skip
    whole = project(open_probe(folder / "sky.exr"), 8).coefficients
    found = project(open_probe(path), 8).coefficients
    rest = project(open_probe(folder / "rest.exr"), 8).coefficients
    sun = np.linalg.norm(radiance) * SUN_SOLID_ANGLE
    assert np.linalg.norm((whole - rest)[0]) == pytest.approx(sun / np.sqrt(4 * np.pi), rel=1e-3)
    for degree in range(9):
        rows_of_degree = slice(degree**2, (degree + 1) ** 2)
        error = np.linalg.norm((found - whole)[rows_of_degree])
        size = np.linalg.norm((found - rest)[rows_of_degree])
        assert error < (1e-4 + degree * np.pi / rows / 2) * size


def test_options_turn_the_whole(folder):
    path = lights(folder, DISC + '[[probe]]\nfile = "a.exr"\npitch = 5\n')
    turned = open_probe(path, yaw=90, pitch=10, roll=-30, mirror=True, up="z")
    np.testing.assert_array_equal(
        turned.matrix, ReadOptions(yaw=90, pitch=10, roll=-30, mirror=True, up="z").matrix()
    )
    plain = project(open_probe(path), ORDER).coefficients
    found = project(turned, ORDER).coefficients
    directions = oracles.random_directions(np.random.default_rng(2), 20)
    np.testing.assert_allclose(
        oracles.real_harmonics(ORDER, directions @ turned.matrix.T) @ found,
        oracles.real_harmonics(ORDER, directions) @ plain,
        atol=1e-12,
    )


def test_the_hash_is_of_all_files(folder):
    text = DISC + '[[probe]]\nfile = "a.exr"\n'
    path = lights(folder, text)
    first = open_probe(path)
    image = (folder / "a.exr").read_bytes()
    before = first.digest()
    assert before == hashlib.sha256(text.encode() + image).hexdigest()
    assert first.paths == [path, folder / "a.exr"]
    scenes.write(folder / "a.exr", noise(16, 32)[::-1])
    assert open_probe(path).digest() != before


def test_names_are_relative_to_the_light_file(folder, monkeypatch):
    (folder / "below").mkdir()
    scenes.write(folder / "below" / "c.exr", noise(8, 16))
    path = lights(folder, '[[probe]]\nfile = "below/c.exr"\n', "UPPER.TOML")
    monkeypatch.chdir(folder / "below")
    assert project(open_probe(path), 2).energy.min() > 0
    monkeypatch.chdir(folder)
    assert open_probe("UPPER.TOML").image_of_sum.terms[0].probe.name == "below/c.exr"


@pytest.mark.slow
def test_what_the_probes_needed_is_told(folder):
    pixels = noise(16, 32)
    pixels[3, 4] = -1
    scenes.write(folder / "a.exr", pixels)
    path = lights(
        folder, DISC + '[[probe]]\nfile = "a.exr"\n[[probe]]\nfile = "b.exr"\nclamp = 0.5\n'
    )
    for read in (lambda probe: project(probe, 2), lambda probe: probe.image()):
        probe = open_probe(path)
        read(probe)
        first, second = probe.report.warnings()
        assert "a.exr: 1 pixel with negative radiance" in first
        assert "b.exr: " in second
        assert "clamped" in second
    dark = open_probe(lights(folder, DISC.replace("= 3\n", "= 0\n"), "dark.toml"))
    project(dark, 2)
    assert dark.report.warnings() == ["the probe is black"]


def test_rows_are_those_of_the_finest_probe_within_limits(folder, monkeypatch):
    both = lights(folder, '[[probe]]\nfile = "a.exr"\n[[probe]]\nfile = "b.exr"\n', "both.toml")
    for least, most, expected in ((8, 64, 32), (48, 64, 48), (8, 20, 20)):
        monkeypatch.setattr(light_sum, "_LEAST_ROWS", least)
        monkeypatch.setattr(light_sum, "_MOST_ROWS", most)
        probe = open_probe(both)
        assert (probe.height, probe.grid.size, len(probe.image())) == (expected,) * 3


@pytest.mark.parametrize("stated", [(None, "acescg"), ("acescg",) * 2, ("rec709", "acescg")])
@pytest.mark.parametrize("asked", [None, "rec2020"])
def test_lights_of_different_primaries(folder, stated, asked):
    """Their sum in the first primaries that are stated, or in those that are asked for."""
    known = {**PRIMARIES, None: PRIMARIES["rec709"]}
    for name, space in zip("ab", stated, strict=True):
        attributes = {} if space is None else {"chromaticities": known[space]}
        scenes.write_exr(folder / f"{name}.exr", scenes.rgb(0.2 * noise(8, 16) + 0.9), **attributes)
    path = lights(folder, '[[probe]]\nfile = "a.exr"\n[[probe]]\nfile = "b.exr"\n')
    disc = "[[disc]]\nazimuth = 0\nelevation = 0\nradius = 30\nradiance = [1, 0.2, 0.1]\n"
    text = path.read_text() + disc + 'primaries = "p3"\n'
    path.write_text(text if asked is None else f'working = "{asked}"\n{text}')
    found = open_probe(path)
    target = asked or next(space for space in stated if space)
    assert found.chromaticities == pytest.approx(PRIMARIES[target])
    expected = project(open_probe(lights(folder, disc, "disc.toml")), 2).coefficients
    expected = expected @ conversion(PRIMARIES["p3"], PRIMARIES[target]).T
    for name, space in zip("ab", stated, strict=True):
        own = project(open_probe(folder / f"{name}.exr"), 2).coefficients
        matrix = conversion(known[space], PRIMARIES[target])
        expected = expected + (own if matrix is None else own @ matrix.T)
    np.testing.assert_allclose(project(found, 2).coefficients, expected, atol=1e-5)
    told = [line for line in found.report.notes if "converted to" in line]
    assert len(told) == (asked is None and len({known[each] for each in stated}) - 1)


WRONG = {
    "nothing": ("# nothing\n", "0 lights; give 1 to 1000"),
    "no TOML": ("[[disc", "no TOML"),
    "no text": (b"\xff\xfe\x00", "no text"),
    "deep": ("a = " + "[" * 50_000, "nested too deeply|no TOML"),
    "huge": ("#" * 2**21, "larger than 1,048,576 bytes"),
    "many discs": ("[[disc]]\n" * 1001, "1,001 lights; give 1 to 1000"),
    "a scene": ("[[objects]]\n[[key]]\n", "a scene, and no light; shrm render MAP --mesh"),
    "unknown": ("[[lamp]]\n", "unknown key 'lamp'; give disc, probe"),
    "a table": ("[disc]\n", r"'disc' must be tables; write \[\[disc\]\]"),
    "numbers": ("probe = [1, 2]\n", "'probe' must be tables"),
    "key of a disc": (DISC + "colour = 3\n", "disc 1: unknown key 'colour'; give azimuth"),
    "NaN": (DISC.replace("20", "nan"), "disc 1: 'radius' must be a number from 0 to 180"),
    "infinite": (DISC.replace("= 3\n", "= inf\n"), "'radiance' must be a number from 0 to 3.4"),
    "huge number": (DISC.replace("= 3\n", f"= 1{'0' * 400}\n"), "'radiance' must be a number"),
    "endless number": (DISC.replace("= 3\n", f"= 1{'0' * 9000}\n"), "no TOML|'radiance'"),
    "negative radius": (DISC.replace("20", "-2"), "'radius' must be a number from 0"),
    "no radius": (DISC.replace("20", "0"), "disc 1: too small; give a radius"),
    "no size": (DISC.replace("radius = 20\n", ""), "'radius' is missing, or 'solid_angle'"),
    "two sizes": (DISC + "solid_angle = 1\n", "'radius' excludes 'solid_angle'"),
    "too large": (DISC.replace("radius = 20", "solid_angle = 13"), "'solid_angle' must be"),
    "no brightness": (DISC.replace("radiance = 3\n", ""), "'radiance' is missing, or 'irrad"),
    "negative light": (DISC.replace("= 3\n", "= [1, 2, -3]\n"), "'radiance' must be a number"),
    "two channels": (DISC.replace("= 3\n", "= [1, 2]\n"), "'radiance' must be one number or three"),
    "text": (DISC.replace("= 3\n", '= "3"\n'), "'radiance' must be a number"),
    "truth": (DISC.replace("= 3\n", "= true\n"), "'radiance' must be a number"),
    "a date": (DISC.replace("= 3\n", "= 2020-01-01\n"), "'radiance' must be a number"),
    "no elevation": (DISC.replace("elevation = 30\n", ""), "'elevation' must be a number"),
    "two directions": (DISC + "direction = [1, 0, 0]\n", "'direction' excludes 'azimuth'"),
    "no direction": (
        "[[disc]]\ndirection = [0, 0, 0]\nradius = 3\nradiance = 1\n", "'direction' is 0",
    ),
    "flat direction": (
        "[[disc]]\ndirection = [0, 1]\nradius = 3\nradiance = 1\n", "must be three numbers",
    ),
    "no file": ("[[probe]]\nyaw = 3\n", "probe 1: 'file' must be the name"),
    "no such file": ('[[probe]]\nfile = "c.exr"\n', "probe 1: .*c.exr: no such file"),
    "no image": ('[[probe]]\nfile = "text.exr"\n', "probe 1: .*text.exr"),
    "a folder": ('[[probe]]\nfile = "."\n', "a directory"),
    "above": ('[[probe]]\nfile = "../a.exr"\n', "leaves the light file's folder"),
    "above, Windows": ('[[probe]]\nfile = "b\\\\..\\\\..\\\\a.exr"\n', "leaves the light file's"),
    "elsewhere": ('[[probe]]\nfile = "/etc/passwd"\n', "leaves the light file's folder"),
    "a disk": ('[[probe]]\nfile = "C:a.exr"\n', "leaves the light file's folder"),
    "NUL": ('[[probe]]\nfile = "a\\u0000.exr"\n', "probe 1: .*cannot be opened"),
    "itself": ('[[probe]]\nfile = "lights.toml"\n', "is a light file; name images"),
    "key of a probe": ('[[probe]]\nfile = "a.exr"\npixels = 3\n', "unknown key 'pixels'"),
    "value of a key": ('[[probe]]\nfile = "a.exr"\nyaw = nan\n', "probe 1: 'yaw' must be a finite"),
    "huge value": (
        f'[[probe]]\nfile = "a.exr"\nroll = 1{"0" * 400}\n', "'roll' must be a finite number",
    ),
    "huge clamp": (
        f'[[probe]]\nfile = "a.exr"\nclamp = 1{"0" * 400}\n', "'clamp' must be a positive",
    ),
    "unhashable": ('[[probe]]\nfile = "a.exr"\nlayout = [1]\n', r"'layout' \[1\] is not known"),
    "scale": ('[[probe]]\nfile = "a.exr"\nscale = -1\n', "'scale' must be a number from 0"),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_what_is_not_sound_is_refused_in_one_line(folder, case):
    text, words = WRONG[case]
    (folder / "text.exr").write_text("no image")
    path = folder / "lights.toml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(ProbeError, match=words) as error:
        open_probe(path)
    said = str(error.value)
    assert "\n" not in said
    assert len(said) < 400 + len(str(folder)) * 2
    assert said.startswith(str(path))


def test_links_lead_to_no_file_elsewhere(folder, tmp_path_factory):
    """Of those within the folder each is followed, and the folder itself may be one."""
    out = tmp_path_factory.mktemp("out")
    scenes.write(out / "a.exr", np.ones((8, 16, 3)))
    (out / "white.txt").write_text("1 1 1\n")
    (folder / "link.exr").symlink_to(out / "a.exr")
    (folder / "face_+X.exr").symlink_to(out / "a.exr")
    (folder / "link.txt").symlink_to(out / "white.txt")
    (folder / "there").symlink_to(out)
    for name in ("link.exr", "there/a.exr", "face_%.exr"):
        with pytest.raises(ProbeError, match="leaves the light file's folder; put the image"):
            open_probe(lights(folder, f'[[probe]]\nfile = "{name}"\n'))
    with pytest.raises(ProbeError, match="'file' must be a name in the light file's folder"):
        open_probe(lights(folder, '[[sh]]\nfile = "link.txt"\n'))
    (folder / "inner.exr").symlink_to(folder / "a.exr")
    lights(folder, '[[probe]]\nfile = "inner.exr"\n')
    (out / "project").symlink_to(folder)
    assert open_probe(out / "project" / "lights.toml").image().shape[2] == 3


def test_lights_that_are_too_bright_for_pixels_together(folder):
    bright = 'scale = 1e30\nfile = "a.exr"\n'
    scenes.write(folder / "a.exr", np.full((8, 16, 3), 1e30))
    probe = open_probe(lights(folder, f"{DISC}[[probe]]\n{bright}"))
    with pytest.raises(ProbeError, match="its lights together exceed 32-bit floats; scale down"):
        probe.image()


@pytest.mark.parametrize(
    "option",
    [
        {"layout": "angular"}, {"orientation": "gl"}, {"sampling": "border"}, {"linearize": True},
        {"part": "1"}, {"layer": "left"}, {"clamp": 3.0}, {"fix_nonfinite": True},
    ],
    ids=lambda option: next(iter(option)),
)  # fmt: skip
def test_options_about_images_do_not_apply_to_the_whole(folder, option):
    (name,) = option
    with pytest.raises(ProbeError, match=f"`{name}` says nothing about a light file"):
        open_probe(lights(folder, DISC), **option)


def test_energies_of_lights_that_do_not_overlap(folder):
    """A disc of 0.5 degrees has its own energy, not that of the pixels that it is spread over."""
    far = "[[disc]]\nazimuth = -140\nelevation = -30\nradius = 0.05\nradiance = [9, 5, 2]\n"
    light = project(open_probe(lights(folder, DISC + far)), 2)
    areas = [4 * np.pi * np.sin(np.radians(radius) / 2) ** 2 for radius in (20, 0.05)]
    expected = areas[0] * 9 + areas[1] * np.array([81, 25, 4])
    np.testing.assert_allclose(light.energy, expected, rtol=1e-12)
    assert latlong_solid_angles(512).max() > areas[1]


def test_all_lights_of_a_sum_are_converted(folder):
    path = lights(folder, """
        [[probe]]
        file = "a.exr"
        scale = [1, 0.5, 0.25]
        [[disc]]
        azimuth = 40
        elevation = 30
        radius = 20
        radiance = [3, 2, 1]
        [[sh]]
        coefficients = [[2, 2, 2], [0.1, 0.2, 0], [0, 0.1, 0.3], [0.2, 0, 0.1]]
    """)  # fmt: skip
    source = open_probe(path)
    expected = project(source, ORDER).coefficients @ conversion(None, PRIMARIES["acescg"]).T
    converted = source.in_primaries(PRIMARIES["acescg"])
    np.testing.assert_allclose(
        project(converted, ORDER).coefficients, expected, rtol=0, atol=1e-6
    )  # fmt: skip
    assert converted.digest() != source.digest()
    assert converted.in_primaries(PRIMARIES["acescg"]) is converted
