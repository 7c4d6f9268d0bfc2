"""Maps with lamps beside them: their files, and what happens to them."""

import json
from dataclasses import replace

import numpy as np
import OpenEXR
import pytest

from shrm_cli.brdf.spec import parse_spec
from shrm_cli.errors import BrdfError, MapError
from shrm_cli.maps.base import Map
from shrm_cli.maps.file import open_map
from shrm_cli.maps.info import in_primaries
from shrm_cli.maps.lamps.map import LampMap
from shrm_cli.maps.wrong_pixels import Negative
from shrm_cli.probe.disc import Disc
from shrm_cli.vocabulary import PRIMARIES
from tests.brute_force import unit
from tests.maps.scenes import make_shrm

DISCS = (
    Disc(np.array([0.6, 0.0, 0.8]), 0.02, np.array([50.0, 40.0, 30.0])),
    Disc(np.array([0.0, -1.0, 0.0]), 0.01, np.array([10.0, 90.0, 0.0])),
)
GGX = {"name": "ggx", "parameters": {"roughness": 0.4, "f0": 1.0}}
"""The record of the BRDF of the maps."""


def made(brdf=GGX):
    shrm = make_shrm(4, 2, 6)
    shrm = replace(shrm, info=replace(shrm.info, brdf=brdf, predicted_error=0.04))
    return LampMap(shrm, DISCS, 0.25, 0.01)


@pytest.fixture
def points():
    rng = np.random.default_rng(2)
    return unit(rng, 50), unit(rng, 50)


def test_a_file_brings_the_lamps_back(tmp_path, points):
    path, before = tmp_path / "map.exr", made()
    before.save(path, "float")
    after = open_map(path)
    assert isinstance(after, Map)
    np.testing.assert_allclose(after.radiance(*points), before.radiance(*points), rtol=0, atol=1e-5)
    rest = before.radiance(*points) - before.map.radiance(*points)
    assert np.abs(rest).max() > 0.1
    assert (after.left, after.error) == (before.left, before.error)
    assert len(after.summary()["lamps"]) == 2


def test_errors_are_relative_to_all_light(tmp_path):
    """And in the file to the light of its cubes."""
    path, lit = tmp_path / "map.exr", made()
    assert lit.summary()["predicted_error"] == lit.info.predicted_error == pytest.approx(0.01)
    lit.save(path)
    with OpenEXR.File(str(path)) as file:
        assert file.header()["shrm:predicted_error"] == pytest.approx(0.04)
    assert open_map(path).info.predicted_error == pytest.approx(0.01)


def test_no_advice_takes_lamps_out_that_are_beside_it():
    (line,) = Negative(0.01, 0.01).warnings(made())
    assert line.endswith("dim what is left by `clamp`")


def test_earlier_versions_refuse_the_file(tmp_path):
    """They would lose the lamps without a word."""
    made().save(tmp_path / "map.exr")
    with OpenEXR.File(str(tmp_path / "map.exr")) as file:
        assert file.header()["shrm:version"] == 6


@pytest.mark.parametrize(
    "change",
    [
        lambda lamps: lamps | {"left": 1.5},
        lambda lamps: lamps | {"error": "none"},
        lambda lamps: lamps | {"more": 1},
        lambda lamps: lamps | {"discs": []},
        lambda lamps: lamps | {"discs": lamps["discs"] * 65},
        lambda lamps: lamps | {"discs": 3},
        lambda lamps: lamps["discs"],
        lambda lamps: changed(lamps, radius=0),
        lambda lamps: changed(lamps, radius=91),
        lambda lamps: changed(lamps, radius=True),
        lambda lamps: changed(lamps, radiance=[1, 2]),
        lambda lamps: changed(lamps, radiance=[1, 2, -(10**39)]),
        lambda lamps: changed(lamps, radiance=[1, 2, 10**39]),
        lambda lamps: changed(lamps, direction=[0, 0, 0]),
        lambda lamps: changed(lamps, direction=[1, 1, 0]),
        lambda lamps: changed(lamps, direction="up"),
        lambda lamps: changed(lamps, name="sun"),
    ],
)
def test_files_are_not_trusted(tmp_path, change):
    path = tmp_path / "map.exr"
    made().save(path)
    with OpenEXR.File(str(path), separate_channels=True) as file:
        header, channels = dict(file.header()), file.channels()
        header["shrm:lamps"] = json.dumps(change(json.loads(header["shrm:lamps"])))
        OpenEXR.File(header, channels).write(str(path))
    with pytest.raises(MapError, match="shrm:lamps is missing or wrong"):
        open_map(path)


def changed(lamps, **values):
    first, *others = lamps["discs"]
    return lamps | {"discs": [{**first, **values}, *others]}


def test_lamps_go_along(tmp_path, points):
    """Into other forms and layouts, in which the cubes alone change."""
    lit = made()
    lamps = lit.radiance(*points) - lit.map.radiance(*points)
    for other in (lit.converted("cabral"), lit.resampled(9)):
        found = other.radiance(*points) - other.map.radiance(*points)
        np.testing.assert_allclose(found, lamps, rtol=0, atol=1e-12)
    lit.save(tmp_path / "cross.exr", "float", "hcross", "gl")
    found = open_map(tmp_path / "cross.exr").radiance(*points)
    np.testing.assert_allclose(found, lit.radiance(*points), rtol=0, atol=1e-4)


def test_what_would_lose_them_is_refused():
    lit = made()
    with pytest.raises(MapError, match="lamps"):
        in_primaries(lit, PRIMARIES["rec2020"])
    with pytest.raises(MapError, match="turned"):
        lit.turned(np.eye(3))
    with pytest.raises(MapError, match="lamps"):
        lit.to_shrm()


def test_a_measured_brdf_that_is_not_there(tmp_path, points):
    lit = made({"name": "merl", "parameters": {"file": "gold.binary", "sha256": "0" * 64}})
    path = tmp_path / "map.exr"
    lit.save(path)
    after = open_map(path)
    assert len(after.summary()["lamps"]) == 2
    with pytest.raises(BrdfError, match=r"gold\.binary does not lie beside it; put the file there"):
        after.radiance(*points)
    known = replace(after, known=parse_spec("ggx"))
    assert np.isfinite(known.radiance(*points)).all()
