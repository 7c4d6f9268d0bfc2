"""The surface that maps of light alone are shown as."""

import json
import shutil
from dataclasses import dataclass, field

import click
import numpy as np
import pytest

from shrm_cli.maps.file import open_map
from shrm_cli.maps.info import MapInfo
from shrm_cli.maps.kinds import LightMap
from shrm_cli.maps.splitsum.split_sum import BrushedSplitSum, ShadedSplitSum
from shrm_cli.render.camera import Viewer
from shrm_cli.render.lit import shaded_maps
from shrm_cli.render.sphere import render_sphere
from tests.cli.helpers import ROOT, assert_refused, done, read_exr, run
from tests.maps.shader import cases
from tests.render.materials import furnace


@dataclass
class Recorder(LightMap):
    """A map of light alone that notes the surface it is told."""

    told: list = field(default_factory=list)
    roughness_range = (0.2, 0.5)
    info = MapInfo(0, 0, 0.03, 1.0, 0.0)

    def surface(self, roughness, f0, anisotropy, taps):
        assert anisotropy == 0
        self.told.append((roughness, f0))
        return furnace((1, 2, 3))


@pytest.fixture
def command():
    """A command that runs without any option."""
    with click.Context(click.Command("render")) as context:
        yield context


def test_all_maps_are_shown_as_one_surface(command):
    recorder, white = Recorder(), furnace((1, 1, 1))
    shown, surface, warnings = shaded_maps([white, recorder], "ab", 0.6, "1/0.5/0.25")
    assert shown[0] is white
    assert recorder.told == [(0.6, (1.0, 0.5, 0.25))]
    assert surface == {"roughness": 0.6, "f0": [1.0, 0.5, 0.25]}
    assert warnings == ["b: it was made for roughness 0.2 .. 0.5, not 0.6"]


def test_the_surface_where_none_is_asked_for(command):
    recorder = Recorder()
    assert shaded_maps([recorder], "a", None, None)[2] == []
    assert recorder.told == [(0.5, (1.0, 1.0, 1.0))]


def test_maps_of_a_brdf_get_no_surface(command):
    white = furnace((1, 1, 1))
    assert shaded_maps([white], "a", None, None) == ([white], {}, [])


@pytest.fixture
def splits(tmp_path, monkeypatch):
    """A folder with a split sum of GGX, one of cloth, and a map of a BRDF."""
    monkeypatch.chdir(tmp_path)
    for name in ("linear", "cloth"):
        cases.FORMS[f"splitsum {name}"]().save(f"{name}.exr")
    cases.FORMS["shrm"]().save("shrm.exr")


def test_brushed_surfaces_are_drawn(splits):
    drawn = {}
    for name, more in {
        "even": [], "none": ["--anisotropy", 0], "five": ["--anisotropy", 0.6],
        "eight": ["--anisotropy", 0.6, "--taps", 8], "two": ["--taps", 2],
        "three": ["--taps", 3], "once": ["--taps", 0],
    }.items():  # fmt: skip
        told = done(
            "render", "linear.exr", "--size", 32, "--precision", "float", *more, "-o", f"{name}.exr"
        )
        assert ("--taps 0 shows that" in told) == (name in ("even", "none"))
        drawn[name] = np.stack([read_exr(f"{name}.exr")[1][c] for c in "RGB"], axis=-1)
    np.testing.assert_array_equal(drawn["even"], drawn["none"])
    np.testing.assert_array_equal(drawn["even"], drawn["three"])
    assert np.abs(drawn["five"] - drawn["even"]).max() > 0.01
    assert np.abs(drawn["five"] - drawn["eight"]).max() > 0.001
    made = open_map("linear.exr")
    shown = BrushedSplitSum(made, 0.5, (1.0, 1.0, 1.0), 0.6)
    np.testing.assert_allclose(drawn["five"], render_sphere(shown, Viewer(0, 0), 32), atol=1e-6)
    shown = made.shaded(0.5, taps=2)
    np.testing.assert_allclose(drawn["two"], render_sphere(shown, Viewer(0, 0), 32), atol=1e-6)
    assert np.abs(drawn["two"] - drawn["even"]).max() > 0.01
    engine = ShadedSplitSum(made, 0.5, (1.0, 1.0, 1.0))
    np.testing.assert_allclose(drawn["once"], render_sphere(engine, Viewer(0, 0), 32), atol=1e-6)


def test_brushed_surfaces_are_compared_with_their_own_truth(splits):
    shutil.copy(ROOT / "probes" / "studio.exr", "studio.exr")
    told = run(
        "compare", "linear.exr", "--probe", "studio.exr", "--anisotropy", 0.6, "--size", 16,
        "--no-picture", "--no-flip", "--json", "--source-height", 32,
    )  # fmt: skip
    assert json.loads(told.out)["brdf"]["parameters"]["anisotropy"] == 0.6


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["shrm.exr", "--anisotropy", 0.6], "--anisotropy applies to split sums of GGX"),
        (["cloth.exr", "--anisotropy", 0.6], "--anisotropy applies to split sums of GGX"),
        (["linear.exr", "--taps", 5], "--taps is 5; without anisotropy give 0, 1, 2 or 3"),
        (["linear.exr", "--anisotropy", 0.6, "--taps", 1], "with anisotropy give 3, 5 or 8"),
        (["cloth.exr", "--taps", 1], "--taps applies to split sums of GGX"),
        (["linear.exr", "--anisotropy", 1.1], "--anisotropy"),
        (["linear.exr", "--anisotropy", 0.6, "--taps", 4], "--taps"),
    ],
)
def test_what_is_not_brushed_is_refused(splits, arguments, message):
    assert_refused(run("render", *arguments, "--size", 16), 2, message)
