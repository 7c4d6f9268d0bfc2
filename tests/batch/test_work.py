"""What workers do: the same bytes as `prefilter` makes, and a record of each job."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shrm_cli.batch import work
from shrm_cli.batch.entry import Entry
from shrm_cli.maps.file import open_map
from shrm_cli.maps.options import SHARED
from shrm_cli.prefilter import prefilter
from shrm_cli.probe import image_file
from shrm_cli.probe.lighting import project
from shrm_cli.probe.open import open_probe
from shrm_cli.probe.shared import HeldImage, shared, shared_if_held
from shrm_cli.vocabulary import DEFAULT_EPS
from tests.batch.helpers import Here, edit, forget, records_of, statuses, write_probes
from tests.cli.helpers import noise, write_exr

FORMS = {
    "shrm": {"eps": 0.1}, "principal": {"maps": 4}, "cabral": {"eps": 0.2}, "irradiance": {},
    "splitsum": {"levels": 3}, "she": {},
}  # fmt: skip


@pytest.fixture
def probe(tmp_path, monkeypatch):
    """The name of a probe in the current folder."""
    monkeypatch.chdir(tmp_path)
    write_probes(tmp_path, 1, 32)
    return "p0.exr"


def entry_of(*probes, **changes):
    fields = {"brdfs": ("phong:exponent=16",), "to": ("shrm", "irradiance"), **changes}
    return Entry(probes, **fields)


def test_every_form_has_the_bytes_that_prefilter_writes(probe, tmp_path):
    entry = entry_of(probe, to=tuple(FORMS), own=FORMS, reading={"yaw": 20.0})
    records = records_of(entry)
    assert {record["status"] for record in records} == {"made"}
    for record in records:
        to = record["to"]
        made = prefilter(open_probe(probe, yaw=20.0), record["brdf"], to=to, **FORMS[to])
        made.save("alone.exr")
        with open("alone.exr", "rb") as one, open(record["output"], "rb") as other:
            assert one.read() == other.read(), to


def test_records_tell_what_was_made(probe):
    record, _ = records_of(entry_of(probe), workers=_one())
    made = open_map(record["output"])
    assert (record["probe"], record["brdf"], record["to"]) == (probe, "phong:exponent=16", "shrm")
    assert (record["order_f"], record["order_p"]) == (made.info.order_f, made.info.order_p)
    assert record["predicted_error"] == pytest.approx(made.info.predicted_error, rel=1e-6)
    assert record["size"] == made.size
    assert record["bytes"] > 0
    assert record["seconds"] > 0


def test_a_probe_is_read_once_for_all_its_outputs(probe, monkeypatch):
    read = []
    original = image_file.ImageFile.read
    monkeypatch.setattr(image_file.ImageFile, "read", lambda *a: read.append(a[1:]) or original(*a))
    records = records_of(entry_of(probe, to=tuple(FORMS), own=FORMS), workers=_one())
    assert len(records) == len(FORMS)
    assert len(read) == 1


def _one():
    workers = Here()
    workers.workers = 1
    return workers


def test_a_shared_probe_is_projected_once_to_each_order(probe):
    both = shared(open_probe(probe))
    first = project(both, 8)
    assert project(both, 8) is first
    alone = project(open_probe(probe), 8)
    np.testing.assert_array_equal(first.coefficients, alone.coefficients)
    np.testing.assert_array_equal(first.energy, alone.energy)
    assert both.digest() == open_probe(probe).digest()
    assert both.reading() == open_probe(probe).reading()


def test_pixels_that_are_too_many_are_not_held(probe, monkeypatch):
    assert isinstance(shared_if_held(open_probe(probe)).images[0], HeldImage)
    monkeypatch.setattr("shrm_cli.probe.shared.MOST_BYTES", 100)
    plain = open_probe(probe)
    assert shared_if_held(plain) is plain


@pytest.fixture
def made(probe):
    """An entry whose outputs are there."""
    entry = entry_of(probe, output="{probe}.{to}.exr")
    assert set(statuses(records_of(entry)).values()) == {"made"}
    return entry


def again(entry, **changes):
    """What becomes of an entry's outputs when it is run again with changes."""
    fields = {name: getattr(entry, name) for name in entry.__dataclass_fields__}
    terms = {name: changes.pop(name) for name in ("force", "only_looks") if name in changes}
    return {
        record["to"]: record["status"] for record in records_of(Entry(**fields | changes), **terms)
    }


def test_what_is_there_already_is_skipped(made):
    assert again(made) == {"shrm": "skipped", "irradiance": "skipped"}
    assert again(made, force=True) == {"shrm": "made", "irradiance": "made"}


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"brdfs": ("phong:exponent=17",)}, {"shrm": "made", "irradiance": "skipped"}),
        ({"arguments": {"eps": 0.2}}, {"shrm": "made", "irradiance": "skipped"}),
        ({"own": {"irradiance": {"window": "hann"}}}, {"shrm": "skipped", "irradiance": "made"}),
        ({"reading": {"yaw": 5.0}}, {"shrm": "made", "irradiance": "made"}),
        ({"precision": "float"}, {"shrm": "made", "irradiance": "made"}),
    ],
)
def test_what_other_options_made_is_made_again(made, changes, expected):
    assert again(made, **changes, only_looks=True) == {
        to: "waiting" if status == "made" else status for to, status in expected.items()
    }
    assert again(made, **changes) == expected
    assert again(made, **changes) == {"shrm": "skipped", "irradiance": "skipped"}


def test_what_another_probe_or_version_made_is_made_again(made, probe, monkeypatch):
    write_exr(probe, noise(32, 64) * 2)
    assert again(made) == {"shrm": "made", "irradiance": "made"}
    monkeypatch.setattr(work.registry, "sources", lambda to: "another")
    (first, *_) = records_of(made, only_looks=True)
    assert first["status"] == "waiting"
    assert first["why"] == "another version or state of shrm made it"


def test_another_default_makes_other_maps(made, monkeypatch):
    """The default tolerance is recorded like one that is given."""
    assert again(made, arguments={"eps": DEFAULT_EPS}) == dict.fromkeys(made.to, "skipped")
    monkeypatch.setitem(SHARED, "eps", replace(SHARED["eps"], default=0.07))
    found = {record["to"]: record for record in records_of(made, only_looks=True)}
    why = "it was made with other options (`eps` 0.03 there, 0.07 here)"
    assert found["shrm"]["why"] == why
    assert found["irradiance"]["status"] == "skipped"


@pytest.mark.parametrize(
    "damage", [lambda data: data[:3000], lambda data: data[:-300] + bytes(300)]
)
def test_damaged_outputs_are_made_again(made, damage):
    """Cut off, or with an end of zeros, as full disks and broken copies leave files."""
    whole = {}
    for path in Path(".").glob("p0.*.exr"):
        whole[path] = path.read_bytes()
        path.write_bytes(damage(whole[path]))
    assert len(whole) == 2
    told = {record["why"] for record in records_of(made, only_looks=True)}
    assert told == {"it is damaged"}
    assert again(made) == dict.fromkeys(made.to, "made")
    assert all(path.read_bytes() == data for path, data in whole.items())


def other_form(path):
    prefilter("p0.exr", to="irradiance").save(path)


def other_probe(path):
    write_exr("other.exr", noise(32, 64) * 3)
    prefilter("other.exr", "phong:exponent=16").save(path)


@pytest.mark.parametrize(
    ("put", "why"),
    [
        (lambda path: path.write_text("my notes"), "it is no map that can be read"),
        (lambda path: path.write_bytes(b"my\0\0"), "it is no map that can be read"),
        (lambda path: write_exr(path, noise(8, 16)), "it is no map that can be read"),
        (other_form, "it is a map of representation irradiance"),
        (other_probe, "another probe made it"),
        (edit, "it was changed since shrm made it"),
    ],
)
def test_what_is_no_earlier_output_is_kept(made, put, why):
    """A user's own file of that name is refused alone, and `force` replaces it."""
    path = Path("p0.shrm.exr")
    whole = path.read_bytes()
    put(path)
    there = path.read_bytes()
    for terms in ({}, {"only_looks": True}):
        found = {record["to"]: record for record in records_of(made, **terms)}
        assert found["shrm"]["status"] == "failed"
        assert f"p0.shrm.exr: exists, and {why}" in found["shrm"]["error"]
        assert "`force`" in found["shrm"]["error"]
        assert found["irradiance"]["status"] == "skipped"
    assert path.read_bytes() == there
    assert again(made, force=True)["shrm"] == "made"
    assert path.read_bytes() == whole


@pytest.mark.parametrize("zeros", [False, True])
@pytest.mark.parametrize("left", [0, 2, 8, 100, 345, 700, 1200, 2600, -1])
def test_what_was_cut_off_anywhere_is_made_again(made, left, zeros):
    """Also within the header, where the file does not say what it is; zeros may follow."""
    path = Path("p0.irradiance.exr")
    whole = path.read_bytes()
    path.write_bytes(whole[:left] + zeros * bytes(len(whole[left:])))
    if path.read_bytes() == whole:  # the last byte is a zero
        return
    (record,) = (each for each in records_of(made) if each["to"] == "irradiance")
    assert (record["status"], record.get("why")) == ("made", "it is damaged")
    assert path.read_bytes() == whole


def test_files_of_earlier_versions_are_made_again(made):
    forget("p0.irradiance.exr")
    (record,) = (each for each in records_of(made) if each["to"] == "irradiance")
    assert record["status"] == "made"
    assert record["why"] == "an earlier version of shrm made it, which recorded no digest"
    assert set(again(made).values()) == {"skipped"}


@pytest.mark.slow
def test_a_measured_file_that_changed_is_another_brdf(probe, tmp_path):
    table = tmp_path / "t.npz"

    def save_table(scale):
        from tests.cli.helpers import run

        assert run("brdf", f"lambertian:albedo={scale}", "--save", str(table)).code == 0

    save_table(0.5)
    entry = entry_of(probe, brdfs=("./t.npz",), to=("shrm",))
    assert list(statuses(records_of(entry)).values()) == ["made"]
    work._material.cache_clear()
    table.unlink()
    save_table(0.6)
    assert list(statuses(records_of(entry)).values()) == ["made"]


def test_what_cannot_be_made_does_not_stop_the_others(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_probes(tmp_path, 3)
    (tmp_path / "p1.exr").write_bytes(b"damaged")
    names = ("p0.exr", "p1.exr", "gone.exr", "p2.exr")
    records = records_of(entry_of(*names, to=("irradiance",), brdfs=()))
    found = {record["probe"]: record for record in records}
    assert {name: each["status"] for name, each in found.items()} == {
        "p0.exr": "made", "p1.exr": "failed", "gone.exr": "failed", "p2.exr": "made",
    }  # fmt: skip
    assert "p1.exr: not an image" in found["p1.exr"]["error"]
    assert "gone.exr: no such file" in found["gone.exr"]["error"]


def test_one_form_that_fails_does_not_stop_the_others_of_its_probe(probe):
    entry = entry_of(probe, brdfs=("ward:ax=0.2,ay=0.5", "lambertian"))
    failed, *others = records_of(entry, workers=_one())
    assert failed["status"] == "failed"
    assert "anisotropic" in failed["error"]
    assert [record["status"] for record in others] == ["made", "made"]


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="has no named pipes")
def test_a_pipe_in_an_output_s_place_is_kept(probe):
    os.mkfifo("p0.irradiance.exr")
    found = statuses(records_of(entry_of(probe, output="{probe}.{to}.exr")))
    assert found == {"p0.shrm.exr": "made", "p0.irradiance.exr": "failed"}


def test_an_output_that_cannot_be_written_fails_alone(probe, tmp_path):
    (tmp_path / "p0.irradiance.exr").mkdir()
    found = statuses(records_of(entry_of(probe, output="{probe}.{to}.exr")))
    assert found == {"p0.shrm.exr": "made", "p0.irradiance.exr": "failed"}
