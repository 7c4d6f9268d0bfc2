"""Numbered names, and the turn of the views."""

import numpy as np
import pytest

from shrm_cli.errors import OutputError
from shrm_cli.render.camera import Viewer
from shrm_cli.render.moving import frame_paths, turntable


def test_names_are_numbered_from_one():
    assert frame_paths("a.%04d.png", 2) == ["a.0001.png", "a.0002.png"]
    assert frame_paths("x/50%/%02d-b%.exr", 1) == ["x/50%/01-b%.exr"]
    assert frame_paths("%01d.png", 11)[8:] == ["9.png", "10.png", "11.png"]


@pytest.mark.parametrize("pattern", ["a.png", "%d.png", "%4d.png", "%04d/a.png", "%02d%02d.png"])
def test_names_need_one_place_for_the_number(pattern):
    with pytest.raises(OutputError, match=r"one place for their number, such as .*%04d\.png$"):
        frame_paths(pattern, 3)


def test_the_example_has_the_place_that_the_name_lacks():
    with pytest.raises(OutputError, match=r"such as b\.%04d\.png$"):
        frame_paths("b.%d.png", 3)


def test_views_are_equal_steps_from_the_first():
    views = turntable(Viewer(30, -20), 4)
    assert [(view.azimuth, view.elevation) for view in views] == [
        (30, -20),
        (120, -20),
        (210, -20),
        (300, -20),
    ]
    steps = np.diff([view.azimuth for view in turntable(Viewer(), 7)])
    np.testing.assert_allclose(steps, 360 / 7)


def test_azimuth_turns_from_z_towards_x():
    np.testing.assert_allclose(turntable(Viewer(), 4)[1].direction, [1, 0, 0], atol=1e-15)
