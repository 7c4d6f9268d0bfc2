"""Keyframes of scenes: what they say of the frames between them, and what is refused."""

import numpy as np
import pytest

from shrm_cli.errors import MeshError
from shrm_cli.render.camera import Viewer
from shrm_cli.render.moving import moments_between, read_keys
from shrm_cli.sphere.directions import turn_matrix

OBJECT = '[[objects]]\nmesh = "a.obj"\n'


def keys_of(tmp_path, text):
    path = tmp_path / "scene.toml"
    path.write_text(OBJECT + text)
    return read_keys(path)


def test_frames_lie_on_lines_between_keys(tmp_path):
    text = """
    [[key]]
    frame = 2
    turn = 10
    view = [0, 0]
    [[key]]
    frame = 4
    blend = 0.5
    [[key]]
    frame = 6
    turn = [90, 8, -4]
    blend = 1.0
    view = [40, -20]
    """
    frames = moments_between(keys_of(tmp_path, text), Viewer(7, 7))
    assert [each.share for each in frames] == [0.5, 0.5, 0.5, 0.5, 0.75, 1.0]
    views = [(each.viewer.azimuth, each.viewer.elevation) for each in frames]
    assert views == [(0, 0), (0, 0), (10, -5), (20, -10), (30, -15), (40, -20)]
    np.testing.assert_allclose(frames[0].turn, turn_matrix(10), atol=1e-15)
    np.testing.assert_allclose(frames[3].turn, turn_matrix(50, 4, -2), atol=1e-15)
    np.testing.assert_allclose(frames[5].turn, turn_matrix(90, 8, -4), atol=1e-15)


def test_what_no_key_names_stays(tmp_path):
    one, two = moments_between(keys_of(tmp_path, "[[key]]\nframe = 2\nblend = 1"), Viewer(7, 3))
    for each in (one, two):
        assert (each.share, each.turn, each.viewer) == (1.0, None, Viewer(7, 3))
    assert keys_of(tmp_path, "") == []


def test_each_parameter_has_its_own_keys(tmp_path):
    text = """
    [[key]]
    frame = 1
    vary = {ax = 0.5}
    [[key]]
    frame = 2
    vary = {ay = 2}
    [[key]]
    frame = 5
    vary = {ax = 0.1, ay = 5.0}
    """
    frames = moments_between(keys_of(tmp_path, text), Viewer(7, 7))
    found = [[each.values[name] for name in ("ax", "ay")] for each in frames]
    np.testing.assert_allclose(found, [[0.5, 2], [0.4, 2], [0.3, 3], [0.2, 4], [0.1, 5]])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[[key]]\nturn = 3", "key 1: frame must be a whole number within 1 .. 9999"),
        ("[[key]]\nframe = 2\n[[key]]\nframe = 2", "key 2: frame must be a whole number within 3"),
        ("[[key]]\nframe = 10000", "within 1 .. 9999"),
        ("[[key]]\nframe = true", "whole number"),
        ("[[key]]\nframe = 1\nturn = nan", "turn must be a number or three"),
        ("[[key]]\nframe = 1\nturn = [1, 2]", "turn must be a number or three"),
        ("[[key]]\nframe = 1\nturn = [1, 2, inf]", "turn must have finite numbers"),
        ("[[key]]\nframe = 1\nblend = 1.5", "blend must be a number within 0 .. 1"),
        ("[[key]]\nframe = 1\nview = 3", r"view must be \[azimuth, elevation\]"),
        ("[[key]]\nframe = 1\nview = [0, 91]", "elevation of 91, outside"),
        ("[[key]]\nframe = 1\nspin = 1", "'spin' is none of frame, turn, blend, view"),
        ("[[key]]\nframe = 1\nvary = 0.3", "vary must be values of parameters"),
        ("[[key]]\nframe = 1\nvary = {ay = inf}", "vary must be values of parameters"),
        ('[[key]]\nframe = 1\nvary = {ay = "wear.png"}', "vary must be values of parameters"),
        ("[key]\nframe = 1", r"tables \[\[objects\]\] and \[\[key\]\] alone"),
    ],
)
def test_wrong_keys_are_told(tmp_path, text, said):
    with pytest.raises(MeshError, match=f"scene.toml.*{said}"):
        keys_of(tmp_path, text)
