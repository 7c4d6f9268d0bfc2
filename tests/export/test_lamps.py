"""Exports whose lamps are lights of the engine: `--sun split`."""

import json
import re
import tracemalloc

import numpy as np
import pytest

from shrm_cli.analysis.probe_statistics import probe_statistics
from shrm_cli.color import REC709
from shrm_cli.errors import ArgumentError
from shrm_cli.export import engine as engines
from shrm_cli.export.engine import Package
from shrm_cli.export.lamps import better_cures
from shrm_cli.export.make import Asked, Source, gather, packaged
from shrm_cli.export.pixels import CURE
from shrm_cli.probe import pixels
from shrm_cli.probe.probe import Probe
from shrm_cli.sphere.grid.cube import Cube
from shrm_cli.vocabulary import ENGINES, PRIMARIES
from tests.brute_force import latlong_samples, unit

ROWS = 64
NAMES = [name for name in ENGINES if engines.engine(name).lamps]
SPLIT = Asked(size=32, sun="split")


@pytest.fixture(scope="module")
def lit():
    """A smooth sky with three suns of a few pixels; their directions, and the image."""
    directions, _ = latlong_samples(ROWS)
    image = (1 + 0.4 * np.asarray(directions)).reshape(ROWS, 2 * ROWS, 3)
    for row, column, color in ((12, 20, (900, 700, 500)), (30, 90, (90, 200, 400)),
                               (25, 60, (300, 200, 200))):  # fmt: skip
        image[row : row + 2, column : column + 2] = color
    return image


def source(image):
    return Source("light", "light.exr", probe=Probe.from_array(image, "latlong"))


def lamps_of(made):
    (file,) = (each for each in made.files if each.name == "light_lamps.json")
    return file


@pytest.mark.parametrize("name", NAMES)
def test_surfaces_get_the_same_light(lit, name, tmp_path, rng):
    """What is left and the lamps of the list, beside sums over the pixels of the probe."""
    engine = engines.engine(name)
    made = packaged(source(lit), engine, SPLIT)
    file = lamps_of(made)
    file.write(tmp_path / file.name)
    lamps = json.loads((tmp_path / file.name).read_text())["lamps"]
    assert len(lamps) == min(3, engine.lamps)
    directions, areas = (np.asarray(each) for each in latlong_samples(ROWS))
    normals = unit(rng, 40)
    cosines = np.maximum(normals @ directions.T, 0)
    whole = (cosines * areas) @ lit.reshape(-1, 3)
    light, _, _ = gather(source(lit), engine, Asked(size=ROWS, sun="split"))
    if light.latlong is None:
        cube = Cube(ROWS)
        areas = cube.weights()
        cosines = np.maximum(normals @ cube.directions().reshape(-1, 3).T, 0)
    pixels = light.levels[0] if light.latlong is None else light.latlong
    left = (cosines * np.ravel(areas)) @ pixels.reshape(-1, 3)
    given = sum(
        np.maximum(normals @ lamp["direction"], 0)[:, None] * lamp["irradiance"] for lamp in lamps
    )
    off = np.sqrt(((left + given - whole) ** 2).mean() / (whole**2).mean())
    assert off < 0.01
    assert np.sqrt(((left - whole) ** 2).mean() / (whole**2).mean()) > 0.1


@pytest.mark.parametrize("name", NAMES)
def test_levels_are_smooth_without_their_lamps(lit, name):
    engine = engines.engine(name)
    whole, _, _ = gather(source(lit), engine, Asked(size=32))
    light, told, _ = gather(source(lit), engine, SPLIT)
    images = [(each.levels[0] if each.levels else each.latlong) for each in (whole, light)]
    assert images[0].max() > 80
    assert images[1].max() < 2
    assert any(line.startswith("lamps: ") for line in told)


@pytest.mark.parametrize(("name", "word"), [("filament", "const float"), ("bevy", "let")])
def test_lines_say_by_what_lamps_are_scaled_before_they_are(lit, name, word):
    """The engine's own intensity of the environment; without a value the lines did not compile."""
    code = "\n".join(packaged(source(lit), engines.engine(name), SPLIT).loading)
    given = re.search(rf"{word} scale = ([0-9.]+)f?;", code)
    assert given
    assert given.end() < code.index("* scale")
    own = re.search(r"intensity: ([0-9.]+), \.\.default", code)
    assert float(given[1]) == (float(own[1]) if own else 30000)


def test_light_without_lamps_is_left_alone():
    image = np.ones((ROWS, 2 * ROWS, 3))
    made = packaged(source(image), engines.engine("three"), SPLIT)
    plain = packaged(source(image), engines.engine("three"), Asked(size=32))
    assert [each.name for each in made.files] == [each.name for each in plain.files]
    assert made.loading == plain.loading
    assert "lamps: none was found" in made.told


def test_long_lamps_become_no_more_lights_than_an_engine_has():
    """A tube is several discs."""
    image = np.full((ROWS, 2 * ROWS, 3), 0.1)
    image[24:26, 30:40] = 300

    class Few(type(engines.engine("three"))):
        lamps = 2

    whole, few = (
        gather(source(image), each, SPLIT)[0] for each in (engines.engine("three"), Few())
    )
    assert len(few.discs) <= 2 < len(whole.discs) <= 16


def test_as_many_lamps_are_taken_out_as_there_are_and_an_engine_holds():
    """Twelve lamps: three.js takes all of them, Godot the strongest eight."""
    image = np.full((ROWS, 2 * ROWS, 3), 0.1)
    for number in range(12):
        image[20 + 3 * (number % 3), 5 + 10 * number] = 200 - 5 * number
    counts = {}
    for name in ("three", "godot"):
        light, told, _ = gather(source(image), engines.engine(name), SPLIT)
        counts[name] = len(light.discs)
        pixels = light.latlong if light.latlong is not None else light.levels[0]
        assert (pixels.max() < 1) == (name == "three")
        assert any("4 more stay" in line for line in told) == (name == "godot")
    assert counts == {"three": 12, "godot": 8}


@pytest.mark.parametrize(("name", "words"), [("three", "`sun` split"), ("unity", "shrm sun")])
def test_clipped_lamps_are_better_taken_out_than_dimmed(name, words):
    """Where nothing else is clipped; what `clamp` loses is that of the pixels."""
    image = np.ones((ROWS, 2 * ROWS, 3))
    image[30, 40] = 1e6
    asked = Asked(size=32)
    (line, *_) = packaged(source(image), engines.engine(name), asked).warnings
    limit = 65216 if name == "three" else 65504
    _, areas = (np.asarray(each).reshape(ROWS, -1) for each in latlong_samples(ROWS))
    lost = (1e6 - limit) * areas[30, 40] / (image[..., 0] * areas).sum()
    assert words in line
    assert float(re.search(r"loses ([\d.]+)% of the light", line)[1]) == pytest.approx(
        100 * lost, abs=0.1
    )
    image[:20] = 7e4  # a sky, which is no lamp, is clipped, too, and would be lost by `clamp`
    (line, *_) = packaged(source(image), engines.engine(name), asked).warnings
    assert "scale the light by 1e-4" in line


def test_what_is_advised_is_of_light_in_the_primaries_that_are_written():
    """It was of the file's own: a wall of 250 is 280 of red in Rec.709, which RGBD clips, too."""
    image = np.full((ROWS, 2 * ROWS, 3), 1.0)
    image[30:34, 60:64] = (250, 60, 60)
    image[12, 20] = 5000
    wide = Probe.from_array(image, "latlong", chromaticities=PRIMARIES["p3"])
    told = [
        packaged(Source("light", "light.exr", each), engines.engine("babylon"), Asked(size=64))
        for each in (wide, wide.in_primaries(REC709))
    ]
    assert told[0].warnings == told[1].warnings


def test_what_has_no_lights_is_refused(lit):
    with pytest.raises(
        ArgumentError, match="lamps are not made for Unity; export what shrm sun leaves"
    ):
        packaged(source(lit), engines.engine("unity"), SPLIT)


def test_what_is_told_of_lamps_of_a_large_probe_takes_little_memory(monkeypatch):
    """Less than three times that of its pixels; in arrays of all of them it was five times."""
    image = np.ones((1024, 2048, 3), np.float32)
    image[300, 400] = 1e6
    monkeypatch.setattr(pixels, "_BLOCK_PIXELS", 2**17)
    made = Package(warnings=[f"clipped; {CURE}"], limit=65504.0)
    probe = Probe.from_array(image, "latlong")
    tracemalloc.start()
    try:
        (line,) = better_cures(made, probe, engines.engine("bevy"))
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert "take the lamps out with `sun` split" in line
    assert peak < 3 * image.nbytes


def test_the_part_of_the_light_is_that_of_luminance():
    """Of the sum of the channels this blue lamp has a third, where `shrm info` says a tenth."""
    image = np.full((ROWS, 2 * ROWS, 3), 0.5)
    image[12:14, 20:22] = (0, 0, 900)
    found = source(image)
    _, told, _ = gather(found, engines.engine("three"), SPLIT)
    (share,) = (float(x) for line in told for x in re.findall(r"^lamps: (\S+)% of the light", line))
    assert share / 100 == pytest.approx(sum(probe_statistics(found.probe).lamp_shares), abs=1e-3)
    assert share < 15
