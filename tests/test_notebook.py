"""What notebooks show: parsed as HTML, its pictures decoded by Pillow."""

import base64
import io
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import shrm_cli as shrm
from shrm_cli.analysis.facts import map_facts, probe_facts
from shrm_cli.sphere.grid.latlong import LatLong
from tests.cli.helpers import environment

MOST_BYTES = 60_000
HOSTILE = '<b onclick="x">&amp;.exr'


class Read(HTMLParser):
    """The elements, the texts and the pictures of some HTML."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.texts, self.open, self.pictures = [], [], [], []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        if tag == "img":
            head, data = dict(attributes)["src"].split(",")
            assert head == "data:image/png;base64"
            picture = Image.open(io.BytesIO(base64.b64decode(data, validate=True)))
            self.pictures.append(np.asarray(picture, dtype=float))
        else:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.texts.append(data)


def shown(thing):
    text = thing._repr_html_()
    assert len(text) <= MOST_BYTES
    read = Read(text)
    assert not read.open
    return read


def half_lit():
    """Light from above alone, (1, .5, .25)."""
    up = LatLong(32).directions()[..., 1:2] > 0
    return np.where(up, np.array([1.0, 0.5, 0.25]), 0.0).astype(np.float32)


def test_a_probe_is_a_lat_long_with_its_numbers():
    probe = shrm.Probe.from_array(half_lit(), layout="latlong")
    read = shown(probe)
    (picture,) = read.pictures
    rows, columns, _ = picture.shape
    assert columns == 2 * rows
    red, green, blue = picture[: rows // 2 - 4].mean(axis=(0, 1))
    assert red > green > blue > 50
    assert picture[rows // 2 + 4 :].max() < 10
    facts = probe_facts(probe, stats=True)
    assert {str(facts["width"]), facts["sha256"], "white balance"} <= set(read.texts)


@pytest.mark.parametrize("to", ["shrm", "irradiance", "splitsum", "she", "cabral"])
def test_a_map_is_a_ball_with_its_numbers(to):
    brdf = "lambertian" if to in ("shrm", "cabral") else None
    made = shrm.prefilter(shrm.Probe.from_array(half_lit(), layout="latlong"), brdf, to=to)
    read = shown(made)
    (picture,) = read.pictures
    size = len(picture)
    assert picture.shape == (size, size, 4)
    assert picture[0, 0, 3] == 0
    assert picture[size // 2, size // 2, 3] == 255
    assert picture[size // 8, size // 2, 0] > 2 * picture[-size // 8, size // 2, 0]
    facts = map_facts(made)
    for name in ("predicted_error", "added_error"):
        assert (name.replace("_", " ") in read.texts) == (facts.get(name) is not None)


def test_tables_keep_their_lines_and_name_no_options():
    """Notebooks would fold lines into one; a row that is too long to be read is left out."""
    light = shrm.Probe.from_array(half_lit(), layout="latlong")
    levels = shrm.prefilter(light, to="splitsum", size=8, levels=[0.3, 1.0])
    (told,) = [text for text in shown(levels).texts if text.startswith("roughness 0.3")]
    assert told.splitlines()[1].startswith("roughness 1")
    assert "white-space: pre-line" in levels._repr_html_()
    for thing in (levels, shrm.prefilter(light, to="irradiance")):
        assert not [text for text in shown(thing).texts if "--json" in text]


def test_light_of_coefficients_is_a_lat_long():
    """Beyond the horizon it is as dark as a series of odd degrees has it."""
    light = shrm.project(shrm.Probe.from_array(half_lit(), layout="latlong"), 5)
    read = shown(light)
    (picture,) = read.pictures
    rows = len(picture)
    upper, lower = picture[: rows // 2 - 8].mean(axis=(0, 1)), picture[rows // 2 + 8 :].mean()
    assert upper[0] > upper[1] > upper[2] > 3 * lower
    assert {"light to order 5", "36", "0.5, 0.25, 0.125"} <= set(read.texts)


def test_light_without_its_lamps_is_shown_beside_their_numbers(tmp_path):
    light = tmp_path / "lamp.toml"
    light.write_text(
        "[[disc]]\ndirection = [-1, 0, 0]\nradius = 3\nradiance = [900, 300, 100]\n"
        "[[sh]]\ncoefficients = [[1, 2, 3]]\n"
    )
    lit = shrm.to_layout(shrm.open_probe(light), "latlong", size=128)
    read = shown(shrm.split_lamps(shrm.Probe.from_array(lit, layout="latlong")))
    (picture,) = read.pictures
    assert np.ptp(picture.reshape(-1, 3), axis=0).max() < 12
    (lamp,) = [text for text in read.texts if text.startswith("direction")]
    assert lamp.startswith("direction -1, ")


def test_a_ball_needs_nothing_of_meshes(tmp_path):
    """Whose modules took a quarter of the time until a first picture."""
    shrm.prefilter(half_lit(), to="irradiance").save(tmp_path / "white.exr")
    code = (
        "import sys, shrm_cli; shrm_cli.open_map('white.exr')._repr_html_()\n"
        "print(*(name for name in sys.modules if name.startswith('shrm_cli.geometry')))"
    )
    line = [sys.executable, "-c", code]
    told = subprocess.run(line, cwd=tmp_path, env=environment(), capture_output=True, text=True)
    assert (told.returncode, told.stdout, told.stderr) == (0, "\n", "")


def test_names_of_files_are_text():
    probe = shrm.Probe.from_array(half_lit(), layout="latlong", name=HOSTILE)
    for thing in (probe, shrm.prefilter(probe, "lambertian")):
        read = shown(thing)
        assert HOSTILE in read.texts
        assert set(read.tags) <= {"div", "p", "img", "table", "tr", "th", "td"}


def test_a_light_file_is_shown_with_its_lamps(tmp_path):
    """Its disc is the brightest place of the picture."""
    light = tmp_path / "lamp.toml"
    light.write_text("[[disc]]\ndirection = [-1, 0, 0]\nradius = 12\nradiance = [9, 3, 1]\n")
    probe = shrm.open_probe(light)
    read = shown(probe)
    (picture,) = read.pictures
    rows, columns, _ = picture.shape
    row, column = np.unravel_index(picture[..., 0].argmax(), (rows, columns))
    brightest = LatLong(rows).directions()[row, column]
    assert brightest @ [-1, 0, 0] > np.cos(np.radians(14))
    assert "light file" in read.texts


def test_a_file_that_went_says_why(tmp_path):
    path = tmp_path / "gone.exr"
    path.write_bytes(Path("probes/furnace.exr").read_bytes())
    probe = shrm.open_probe(path)
    path.unlink()
    read = shown(probe)
    assert not read.pictures
    assert any("gone.exr" in text for text in read.texts)
