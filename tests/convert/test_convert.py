"""`convert` with objects, and what it refuses; what it makes of files is tested by the command."""

import numpy as np
import pytest

import shrm_cli as shrm
from shrm_cli.maps import size
from shrm_cli.maps.size import stored_bytes
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
    ("to", "own"), [("cabral", {}), ("lightfield", {"views": 4}), ("kautz-mccool", {"slices": 3})]
)
def test_explicit_maps_are_not_fitted_to_themselves(to, own, tmp_path):
    """They hold what a fit of their order leaves: linear light is not of any order."""
    source = make_shrm(3, 2).converted(to, **own)
    rough = np.random.default_rng(1).uniform(size=source.images.shape)
    source = source.with_planes(list(rough.astype(np.float32)), source.sampling, source.info)
    for arguments in ({}, own, {"max_size": 10**7}):
        made = shrm.convert(source, to, **arguments)
        np.testing.assert_array_equal(made.map.images, source.images)
    result = made.save(tmp_path / "a.exr").result
    assert result["fit_residual"] == source.info.fit_residual == 0
    assert result["maps"] == source.count
    smaller = shrm.convert(source, to, size=4).map
    np.testing.assert_array_equal(smaller.images, source.resampled(4).images)
    assert shrm.convert(source, to, order_p=1).map.info.fit_residual > 0
    if own:
        more = {name: count + 1 for name, count in own.items()}
        assert shrm.convert(source, to, **more).map.count > source.count
        assert shrm.convert(source, to, max_size=(source.count - 1) * 2304).map.count < source.count


def test_maps_do_not_grow_beyond_the_bytes_that_all_may_have():
    """A light field of P = 8 has 6,400 cubes by itself, 1.1 GB of them where a lamp needs 48."""
    source = make_shrm(3, 2, size=64)  # 10 P are 20 x 20 views of 147 kB, which are 59 MB
    assert shrm.convert(source, "lightfield").map.count == 14**2
    assert shrm.convert(source, "lightfield", max_size=10**7).map.count == 8**2
    assert shrm.convert(source, "lightfield", views=15).map.count == 15**2
    assert shrm.convert(source, "lightfield", size=16).map.count == 20**2
    with pytest.raises(shrm.ArgumentError, match="10 MB does not hold 225 cubes"):
        shrm.convert(source, "lightfield", views=15, max_size=10**7)
    with pytest.raises(shrm.ArgumentError, match="1 MB does not hold 12 cubes"):
        shrm.convert(source, "cabral", max_size=10**6)
    assert shrm.convert(source, "kautz-mccool", max_size=10**6).map.count == 6


def test_shrms_of_maps_have_the_orders_that_fit(monkeypatch):
    """That of principal functions has 81 coefficients by itself."""
    source = shrm.prefilter(latlong(16), "microfacet:sigma=0.3", to="principal", size=8)
    whole = shrm.convert(source, "shrm").map
    assert whole.order_p == 8
    bound = stored_bytes(8, 30)
    small = shrm.convert(source, "shrm", max_size=bound).map
    assert small.order_p == 4
    assert small.info.added_error > whole.info.added_error
    monkeypatch.setattr(size, "DEFAULT_MAX_SIZE", bound)
    assert shrm.convert(source, "shrm").map.order_p == 4
    assert shrm.convert(whole, "shrm", frame="local").map.order_p == 8  # which is no larger
    with pytest.raises(shrm.ArgumentError, match="does not hold 81 cubes"):
        shrm.convert(source, "shrm", order_p=8, max_size=bound)


@pytest.mark.parametrize(
    ("to", "arguments", "words"),
    [
        ("cabral", {"by": "normal"}, "`by` does not apply to what is seen from no `view`"),
        ("latlong", {"shader": "glsl"}, "`shader` does not apply to `to` latlong"),
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


def test_light_is_turned_by_name_as_the_command_turns_it(probe):
    made = shrm.prefilter(probe, to="irradiance")
    turned = shrm.convert(made, "irradiance", yaw=30)
    other = shrm.convert(made, "irradiance", reading=shrm.ReadOptions(yaw=30))
    np.testing.assert_array_equal(turned.map.coefficients, other.map.coefficients)
    assert not np.allclose(turned.map.coefficients, made.coefficients)
