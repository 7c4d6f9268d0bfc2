"""Options as keywords, and messages that name the argument that is wrong."""

import math

import numpy as np
import pytest

from shrm_cli.errors import ProbeError
from shrm_cli.probe.open import open_probe
from shrm_cli.probe.options import ReadOptions, with_keywords
from shrm_cli.probe.pixels import PixelPolicy
from shrm_cli.probe.probe import Probe
from tests.probe import scenes

WRONG = {
    "layout": [
        ("cube", "`layout` 'cube' is not known; give one of latlong, openexr, strip"),
        (3, "`layout` 3 is not known"),
    ],
    "orientation": [("dx", "`orientation` 'dx' .* openexr, gl")],
    "sampling": [("edge", "`sampling` 'edge' .* center, border")],
    "up": [("x", "`up` 'x' .* y, z"), (None, "`up` None")],
    "yaw": [(math.nan, "`yaw` must be a finite number of degrees, not nan"), ("30", "'30'")],
    "pitch": [(math.inf, "`pitch` must be a finite number of degrees, not inf")],
    "roll": [
        (True, "`roll` must be a finite number of degrees, not True"),
        (1e9, r"`roll` of 1e\+09 degrees is beyond 1e\+06; give less"),
    ],
    "mirror": [(1, "`mirror` must be True or False, not 1")],
    "clamp": [(0, "`clamp` must be a positive number, not 0"), (math.inf, "inf"), ("a", "'a'")],
    "fix_nonfinite": [("yes", "`fix_nonfinite` must be True or False, not 'yes'")],
}  # fmt: skip


@pytest.fixture
def path(tmp_path):
    return scenes.write(tmp_path / "a.exr", scenes.latlong(8))


def test_keywords_are_the_options(path):
    probe = open_probe(path, layout="latlong", yaw=30, mirror=True, up="z", sampling="border")
    expected = open_probe(path, ReadOptions("latlong", None, "border", 30, True, "z"))
    np.testing.assert_array_equal(probe.matrix, expected.matrix)
    assert (probe.grid, probe.layout) == (expected.grid, expected.layout)
    assert probe.sampling == "border"


def test_keywords_of_the_pixels(path):
    assert open_probe(path, clamp=2.0, fix_nonfinite=True).policy == PixelPolicy(True, 2.0)
    assert open_probe(path, pixels=PixelPolicy(True), clamp=3).policy == PixelPolicy(True, 3)


def test_keywords_replace_options(path):
    options = ReadOptions(yaw=10, mirror=True, pixels=PixelPolicy(True, 4.0))
    found = with_keywords(options, {"yaw": 20, "clamp": None})
    assert found == ReadOptions(yaw=20, mirror=True, pixels=PixelPolicy(True, None))
    assert with_keywords(options, {}) == options


def test_unknown_keywords_are_refused(path):
    with pytest.raises(ProbeError, match=r"`rotation` says nothing .* give `at`, .* `yaw`"):
        open_probe(path, rotation=30)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [(name, *case) for name, cases in WRONG.items() for case in cases],
)
def test_wrong_values_are_refused(path, name, value, message):
    with pytest.raises(ProbeError, match=message) as caught:
        open_probe(path, **{name: value})
    assert f"`{name}`" in str(caught.value)
    with pytest.raises(ProbeError) as again:
        Probe.from_array(scenes.latlong(8), **{name: value})
    assert str(again.value) == str(caught.value)


def test_wrong_values_of_files_alone(path):
    with pytest.raises(ProbeError, match="`linearize` must be True or False"):
        open_probe(path, linearize="sRGB")
    with pytest.raises(ProbeError, match="`pixels` must be a PixelPolicy"):
        open_probe(path, pixels={"clamp": 1})


def test_numbers_of_numpy_are_numbers(path):
    probe = open_probe(path, yaw=np.float32(90), mirror=np.bool_(True), clamp=np.int64(3))
    assert probe.policy.clamp == 3
