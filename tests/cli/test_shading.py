"""The surface that maps of light alone are shown as."""

from dataclasses import dataclass, field

import click
import pytest

from shrm_cli.cli.shading import shaded_maps
from shrm_cli.maps.info import MapInfo
from tests.render.materials import furnace


@dataclass
class Recorder:
    """A map of light alone that notes the surface it is told."""

    told: list = field(default_factory=list)
    needs_surface = True
    roughness_range = (0.2, 0.5)
    info = MapInfo(0, 0, 0.03, 1.0, 0.0)

    def shaded(self, roughness, f0):
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
