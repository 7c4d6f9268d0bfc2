"""Coefficients of many probes in one file, beside integrals and beside maps of irradiance."""

import json
import sys
from dataclasses import dataclass

import numpy as np
import pytest

import shrm_cli as shrm
from shrm_cli.batch.collect import (
    Collection,
    check_collection,
    lighting_of,
    read_collection,
    write_collection,
)
from shrm_cli.errors import ArgumentError, MapError, OrderError, OutputError
from shrm_cli.probe.probe import Probe
from tests import brute_force, oracles
from tests.probe import scenes


@dataclass
class Found:
    probe: str
    coefficients: np.ndarray | None
    digest: str = 64 * "0"


@pytest.fixture
def probe(tmp_path):
    return shrm.open_probe(scenes.write(tmp_path / "probe.exr", scenes.latlong(64)))


def gathered(rng, count=3, order=2):
    return [
        Found(f"probes/{index} é.exr", rng.normal(size=((order + 1) ** 2, 3)), f"{index:064x}")
        for index in range(count)
    ]


def test_radiance_is_the_integral_of_light_times_harmonics(probe):
    assert scenes.error(lighting_of(probe, 3), scenes.coefficients(3)) < 1e-5


def test_irradiance_is_the_integral_over_the_hemisphere(probe, rng):
    """The expansion to order 8 at normals, beside the sum over all directions (eq. 4.1)."""
    coefficients = lighting_of(probe, 8, "irradiance")
    normals = brute_force.unit(rng, 20)
    directions, weights = brute_force.sphere_rule(400)
    cosine = np.maximum(normals @ directions.T, 0)
    truth = (cosine * weights) @ scenes.radiance(directions)
    found = oracles.real_harmonics(8, normals) @ coefficients
    assert np.abs(found - truth).max() < 2e-3 * truth.max()


@pytest.mark.filterwarnings("ignore:.*the irradiance falls")
@pytest.mark.parametrize(
    ("order", "window"), [(2, "none"), (4, "hann"), (3, "lanczos:3.5"), (2, "auto")]
)
def test_both_are_those_of_the_map_of_irradiance(order, window):
    """The sun is so strong that the window `auto` has something to do.

    The map comes from a projection to a higher order, which rounds 32-bit pixels differently.
    """
    pixels = np.full((32, 64, 3), 0.01)
    pixels[8, 20] = 10_000.0
    probe = Probe.from_array(pixels)
    made = shrm.prefilter(probe, to="irradiance", order_f=order, window=window)
    scale = np.abs(made.series).max()
    for what, expected in (("radiance", made.coefficients), ("irradiance", made.series)):
        assert np.abs(lighting_of(probe, order, what, window) - expected).max() < 1e-6 * scale
    plain = lighting_of(probe, order)
    assert (np.abs(plain - made.coefficients).max() > 1e-3 * scale) == (window != "none")


def test_what_cannot_be_collected_is_refused(probe):
    with pytest.raises(OrderError, match=r"outside 0 \.\. 512"):
        lighting_of(probe, 513)
    with pytest.raises(ArgumentError, match="no such window"):
        lighting_of(probe, 2, window="box")


def test_an_archive_holds_everything_and_is_read_back(tmp_path, rng):
    found = gathered(rng)
    failed = Found("failed.exr", None)
    path = tmp_path / "light.npz"
    made = Collection.of([found[0], failed, *found[1:]], "irradiance", 2, "hann")
    write_collection(path, made)
    with np.load(path, allow_pickle=False) as plain:  # noqa: TID251  (what users do)
        assert plain["names"].tolist() == [each.probe for each in found]
        assert plain["sha256"].tolist() == [each.digest for each in found]
        assert plain["coefficients"].shape == (3, 9, 3)
        assert plain["coefficients"].dtype == np.float64
        settings = json.loads(str(plain["settings"]))
    assert "Condon-Shortley" in settings["basis"]
    assert "l(l+1)+m" in settings["basis"]
    assert "without a factor 1/pi" in settings["units"]
    assert (settings["what"], settings["order"]) == ("irradiance", 2)
    assert (settings["window"], settings["shape"]) == ("hann", [9, 3])
    again = read_collection(path)
    assert (again.what, again.order, again.window) == ("irradiance", 2, "hann")
    assert list(again.names) == [each.probe for each in found]
    assert list(again.digests) == [each.digest for each in found]
    assert np.array_equal(again.coefficients, np.stack([each.coefficients for each in found]))
    write_collection(tmp_path / "again.npz", made)
    assert (tmp_path / "again.npz").read_bytes() == path.read_bytes()


def test_the_stated_basis_is_the_one_of_the_coefficients():
    """One pixel's light along an axis gives harmonics of the axis, with the stated signs."""
    height = 64
    directions, weights = brute_force.latlong_samples(height)
    for axis, index in ((1, 1), (2, 2), (0, 3)):
        pixel = int(np.argmax(directions[:, axis]))
        pixels = np.zeros((2 * height * height, 3))
        pixels[pixel] = 1 / weights[pixel]
        probe = Probe.from_array(pixels.reshape(height, 2 * height, 3))
        found = lighting_of(probe, 1)[:, 0]
        expected = np.array([0.282095, 0, 0, 0])
        expected[index] = 0.488603
        # The pixel lies half its width beside the axis, and the rows' weights are not areas.
        assert np.abs(found - expected).max() < 0.03


def test_names_hold_no_passwords_and_only_text(tmp_path, rng):
    coefficients = rng.normal(size=(1, 3))
    found = [
        Found("https://me:secret@host/a.exr?sig=secret", coefficients),
        Found("bad\udcff.exr", coefficients),
    ]
    write_collection(tmp_path / "light.npz", Collection.of(found, "radiance", 0))
    assert b"secret" not in (tmp_path / "light.npz").read_bytes().replace(b"\0", b"")
    assert list(read_collection(tmp_path / "light.npz").names) == [
        "https://***@host/a.exr?...", "bad\\udcff.exr",
    ]  # fmt: skip


def test_a_table_holds_everything(tmp_path, rng):
    parquet = pytest.importorskip("pyarrow.parquet")
    found = gathered(rng, order=3)
    path = tmp_path / "light.parquet"
    made = Collection.of(found, "radiance", 3)
    write_collection(path, made)
    table = parquet.read_table(path)
    assert table.column_names == ["probe", "sha256", "coefficients"]
    assert table["probe"].to_pylist() == [each.probe for each in found]
    assert table["sha256"].to_pylist() == [each.digest for each in found]
    assert str(table.schema.field("coefficients").type).startswith("fixed_size_list")
    settings = json.loads(table.schema.metadata[b"shrm"])
    assert settings == made.settings()
    rows = np.array(table["coefficients"].to_pylist()).reshape(-1, *settings["shape"])
    assert np.array_equal(rows, made.coefficients)
    write_collection(tmp_path / "again.parquet", made)
    assert (tmp_path / "again.parquet").read_bytes() == path.read_bytes()


def test_outputs_are_checked_before_the_work(tmp_path, rng, monkeypatch):
    with pytest.raises(OutputError, match=r"are \.npz or \.parquet"):
        check_collection(tmp_path / "light.csv")
    with pytest.raises(OutputError, match="there is no folder"):
        check_collection(tmp_path / "none" / "light.npz")
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(OutputError, match="pip install pyarrow, or write"):
        check_collection(tmp_path / "light.parquet")
    check_collection(tmp_path / "light.npz")
    with pytest.raises(OutputError, match="no probe has coefficients"):
        write_collection(tmp_path / "light.npz", Collection.of([], "radiance", 2))
    assert list(tmp_path.iterdir()) == []


def test_damaged_files_are_refused(tmp_path, rng):
    path = tmp_path / "light.npz"
    write_collection(path, Collection.of(gathered(rng), "radiance", 2))
    whole = path.read_bytes()

    def refuse(match):
        with pytest.raises(MapError, match=match):
            read_collection(path)

    path.write_bytes(whole[:-100])
    refuse("damaged or truncated")
    names, digests, coefficients = ["a", "b"], ["0", "1"], np.zeros((2, 9, 3))
    good = {"version": 1, "what": "radiance", "order": 2, "window": "none"}
    for changes, array, match in (
        ({}, coefficients[:1], "2 names, 2 digests and coefficients of shape"),
        ({"order": 3}, coefficients, "for order 3"),
        ({"order": "2"}, coefficients, "settings are damaged"),
        ({"what": "light"}, coefficients, "settings are damaged"),
        ({"version": 2}, coefficients, "not a collection of this version"),
    ):
        settings = json.dumps({**good, **changes})
        np.savez(path, coefficients=array, names=names, sha256=digests, settings=settings)
        refuse(match)
    np.savez(path, coefficients=coefficients)
    refuse("no array 'settings'")
    np.savez(
        path, coefficients=coefficients, names=np.array(names, object), sha256=digests,
        settings=json.dumps(good),
    )  # fmt: skip
    refuse("which is wrong")
    path.unlink()
    refuse("no such file; name one that shrm batch wrote")
