"""`convert` with objects, and what it refuses; what it makes of files is tested by the command."""

import numpy as np
import pytest

import shrm_cli as shrm
from tests.maps.scenes import make_shrm
from tests.probe.scenes import latlong


@pytest.fixture(scope="module")
def probe():
    return shrm.Probe.from_array(latlong(16), layout="latlong")


def test_a_probe_that_is_no_file(probe, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    made = shrm.convert(probe, "strip", size=4)
    np.testing.assert_array_equal(made.image, shrm.to_layout(probe, "strip", size=4))
    written = made.save("strip.exr", "float")
    assert written.result["files"] == ["strip.exr"]
    np.testing.assert_array_equal(shrm.to_layout(shrm.open_probe("strip.exr"), "strip"), made.image)


def test_a_ball_that_was_written_says_what_it_is(probe, tmp_path):
    """Its shape does not: a square image may be a face of a cube."""
    shrm.convert(probe, "angular", size=64).save(tmp_path / "ball.exr")
    ball = shrm.open_probe(tmp_path / "ball.exr")
    assert ball.layout == "angular"
    found, expected = (shrm.project(each, 3).coefficients for each in (ball, probe))
    np.testing.assert_allclose(found, expected, atol=0.02 * np.abs(expected).max())


def test_six_files_need_a_place_for_the_name_of_the_face(probe, tmp_path):
    made = shrm.convert(probe, "faces", size=4)
    with pytest.raises(shrm.ArgumentError, match="has no % in place of"):
        made.save(tmp_path / "x.exr")
    assert list(tmp_path.iterdir()) == []
    files = made.save(tmp_path / "x_%.exr").result["files"]
    assert sorted(files) == sorted(map(str, tmp_path.iterdir()))
    assert len(files) == 6


def test_a_map_that_is_no_file(tmp_path):
    source = make_shrm(3, 2)
    made = shrm.convert(source, "cabral")
    np.testing.assert_array_equal(made.map.images, source.converted("cabral").images)
    turned = shrm.convert(source, "latlong", view=(30.0, 10.0), by="normal", size=8)
    assert turned.picture.shape == (8, 16, 3)
    assert turned.save(tmp_path / "seen.exr").result["view"] == [30.0, 10.0]


@pytest.mark.parametrize(
    ("to", "arguments", "words"),
    [
        ("cabral", {"by": "normal"}, "`by` does not apply to what is seen from no `view`"),
        ("cabral", {"shader": "glsl"}, "`shader` does not apply to `to` cabral"),
        ("latlong", {"slices": 4}, "`slices` does not apply to `to` latlong"),
        ("layers", {"size": 4}, "`size` does not apply to `to` layers"),
        ("strip", {"view": (0.0, 0.0)}, "strip is no plain image"),
        ("latlong", {"view": (0.0, 0.0), "f0": "gold"}, "`f0` applies to split sums"),
        ("latlong", {"view": (0.0, 0.0), "mips": True}, "`mips` does not apply to a single `view`"),
        ("nothing", {}, "'nothing' is none of shrm, cabral"),
    ],
)
def test_what_changes_nothing_is_refused(to, arguments, words):
    with pytest.raises(shrm.ArgumentError, match=words):
        shrm.convert(make_shrm(3, 2), to, **arguments)


@pytest.mark.parametrize("to", ["shrm", "layers", "nothing"])
def test_probes_become_no_maps(probe, to):
    with pytest.raises(shrm.ArgumentError, match=f"{to}: .* is no map|{to!r} is none of"):
        shrm.convert(probe, to)
    with pytest.raises(shrm.ArgumentError, match="`view` does not apply to probes"):
        shrm.convert(probe, "latlong", view=(0.0, 0.0))
