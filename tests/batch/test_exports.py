"""Folders of engines' files as outputs of a batch."""

import json

import numpy as np
import pytest

from shrm_cli import sources
from shrm_cli.batch import exports
from shrm_cli.export import cubes
from tests.batch.helpers import work_here
from tests.cli.helpers import assert_refused, done, run, write_exr


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Current folder with two probes; batches work in this process."""
    work_here(monkeypatch)
    for seed, name in enumerate(("a", "b")):
        image = np.random.default_rng(seed).random((16, 32, 3), np.float32)
        write_exr(tmp_path / f"{name}.exr", image)
    monkeypatch.chdir(tmp_path)
    return tmp_path


BOTH = ("batch", "*.exr", "--for", "cesium", "--for", "three", "--size", "16")


def records(folder):
    lines = (folder / "batch.jsonl").read_text().splitlines()
    return [each for each in map(json.loads, lines) if each["status"] not in ("begun", "ended")]


def statuses(folder, *arguments):
    (folder / "batch.jsonl").unlink(missing_ok=True)
    said = run(*(arguments or BOTH))
    return said, {each["output"]: each["status"] for each in records(folder)}


def test_a_batch_makes_what_shrm_export_makes(folder):
    said = json.loads(done(*BOTH, "--json"))
    assert said["made"] == 4
    for engine in ("three", "cesium"):
        done("export", "a.exr", "--for", engine, "--size", "16", "-o", f"alone.{engine}")
        alone = {each.name: each.read_bytes() for each in (folder / f"alone.{engine}").iterdir()}
        made = {each.name: each.read_bytes() for each in (folder / f"a.{engine}").iterdir()}
        record = json.loads(made.pop("a_export.json"))
        assert made == alone
        assert {name: size for name, (size, *_) in record["files"].items()} == {
            name: len(data) for name, data in alone.items()
        }
    told = {(each["to"], each["engine"]) for each in records(folder)}
    assert told == {("export", "three"), ("export", "cesium")}
    assert all(each["bytes"] > 1000 for each in records(folder))


def test_options_are_for_the_engines_that_have_them(folder):
    """`--for three --for godot --max-error` was refused, which `shrm export` takes."""
    given = ("a.exr", "--for", "cesium", "--for", "unity", "--max-error", ".1", "--firefly-safe")
    done("batch", *given, "--size", "16", "-o", "{engine}")
    for engine, name in (("cesium", "max_error"), ("unity", "firefly_safe")):
        options = json.loads((folder / engine / "a_export.json").read_text())["options"]
        assert {"max_error", "firefly_safe"} & options.keys() == {name}


@pytest.mark.proof
def test_what_is_there_and_whole_is_kept(folder):
    done(*BOTH)
    before = {each: each.stat().st_mtime_ns for each in folder.rglob("*.ktx2")}
    _, found = statuses(folder)
    assert set(found.values()) == {"skipped"}
    assert {each: each.stat().st_mtime_ns for each in folder.rglob("*.ktx2")} == before
    cut = folder / "a.three" / "a.ktx2"
    whole = cut.read_bytes()
    cut.write_bytes(whole[:500])
    (folder / "b.cesium" / "b_sh.js").unlink()
    _, found = statuses(folder)
    assert found.pop("a.three") == found.pop("b.cesium") == "made"
    assert set(found.values()) == {"skipped"}
    assert cut.read_bytes() == whole
    write_exr(folder / "b.exr", np.ones((16, 32, 3), np.float32))
    _, found = statuses(folder)
    assert {name for name, status in found.items() if status == "made"} == {"b.three", "b.cesium"}
    _, found = statuses(folder, *BOTH[:-1], "32")
    assert set(found.values()) == {"made"}
    assert "`size` 16 there, 32 here" in records(folder)[0]["why"]


def test_what_another_state_of_the_packing_made_is_made_anew(folder, monkeypatch):
    command = ("batch", "a.exr", "--for", "three", "--size", "16")
    done(*command)
    real = sources._folder_digest

    def changed(name, root):
        return b"changed" if name == "export" else real(name, root)

    monkeypatch.setattr(sources, "_folder_digest", changed)
    sources.fingerprint.cache_clear()
    try:
        _, found = statuses(folder, *command)
    finally:
        sources.fingerprint.cache_clear()
    assert found == {"a.three": "made"}
    assert "state of shrm" in records(folder)[0]["why"]


def test_what_a_missing_package_left_large_is_made_anew_with_it(folder, monkeypatch):
    command = ("batch", "a.exr", "--for", "bevy", "--size", "64")
    path = folder / "a.bevy" / "a_specular.ktx2"
    monkeypatch.setattr(cubes, "can_compress", lambda: False)
    monkeypatch.setattr(exports, "can_compress", lambda: False)
    done(*command)
    large = path.stat().st_size
    assert statuses(folder, *command)[1] == {"a.bevy": "skipped"}
    monkeypatch.undo()
    monkeypatch.chdir(folder)
    work_here(monkeypatch)
    assert statuses(folder, *command)[1] == {"a.bevy": "made"}
    assert "without the package zstandard" in records(folder)[0]["why"]
    assert path.stat().st_size < large
    assert statuses(folder, *command)[1] == {"a.bevy": "skipped"}


@pytest.mark.parametrize("left", [slice(0, 3000), slice(0, -300), slice(0, 0), slice(9, 9)])
def test_what_was_not_written_whole_is_made_anew(folder, left):
    """Cut off, with zeros in place of its end, empty, or with nothing but zeros."""
    command = ("batch", "a.exr", "--for", "bevy", "--size", "64")
    done(*command)
    path = folder / "a.bevy" / "a_diffuse.ktx2"
    whole = path.read_bytes()
    path.write_bytes(whole[left].ljust(len(whole) if left.stop in (-300, 9) else 0, b"\0"))
    assert statuses(folder, *command)[1] == {"a.bevy": "made"}
    assert "damaged" in records(folder)[0]["why"]
    assert path.read_bytes() == whole


@pytest.mark.parametrize("change", ["edited", "own"])
def test_what_is_not_ours_stays_whatever_else_is_asked_for(folder, change):
    command = ("batch", "a.exr", "--for", "filament", "--size", "32", "--skybox")
    done(*command, "0")
    path = folder / "a.filament" / ("a_README.md" if change == "edited" else "a_skybox.ktx")
    # What is shorter is not cut where it begins with something else.
    path.write_text("mine")
    said, found = statuses(folder, *command, "16")
    assert found == {"a.filament": "failed"}
    assert "--force" in said.err
    assert path.name in said.err
    assert path.read_text() == "mine"
    (folder / "a.filament" / "a_ibl.ktx").unlink()
    assert statuses(folder, *command, "16")[1] == {"a.filament": "failed"}
    assert path.read_text() == "mine"
    assert statuses(folder, *command, "16", "--force")[1] == {"a.filament": "made"}
    assert path.read_bytes() != b"mine"
    assert statuses(folder, *command, "16")[1] == {"a.filament": "skipped"}


def test_a_run_that_ended_between_files_is_finished(folder):
    command = ("batch", "a.exr", *BOTH[2:])
    done(*command)
    path = folder / "a.three" / "a_export.json"
    held = json.loads(path.read_text())
    files = held.pop("files")
    path.write_text(json.dumps(held))
    (folder / "a.three" / "a.ktx2").unlink()
    _, found = statuses(folder, *command)
    assert found == {"a.three": "made", "a.cesium": "skipped"}
    assert json.loads(path.read_text())["files"] == files


def test_files_that_no_longer_belong_there_go_and_others_stay(folder):
    done("batch", "a.exr", "--for", "filament", "--size", "32", "--skybox", "16")
    before = {each.name for each in (folder / "a.filament").iterdir()}
    (folder / "a.filament" / "mine.txt").write_text("mine")
    done("batch", "a.exr", "--for", "filament", "--size", "32", "--skybox", "0")
    after = {each.name for each in (folder / "a.filament").iterdir()}
    assert "mine.txt" in after
    assert before - after
    assert after - {"mine.txt"} < before


@pytest.mark.proof
@pytest.mark.parametrize("change", ["edited", "foreign", "file", "record"])
def test_what_others_made_is_not_replaced(folder, change):
    done(*BOTH)
    place = folder / "a.three"
    if change == "edited":
        (place / "a_README.md").write_text((place / "a_README.md").read_text() + "notes\n")
    elif change == "foreign":
        (place / "a_export.json").unlink()
    elif change == "file":
        for each in place.iterdir():
            each.unlink()
        place.rmdir()
        place.write_text("a file")
    else:
        held = json.loads((place / "a_export.json").read_text())
        held |= {"probe": "other.exr", "probe_sha256": "0" * 64}
        (place / "a_export.json").write_text(json.dumps(held))
    said, found = statuses(folder)
    assert found.pop("a.three") == "failed"
    assert set(found.values()) == {"skipped"}
    assert "--force" in said.err
    if change != "file":
        said, found = statuses(folder, *BOTH, "--force")
        assert set(found.values()) == {"made"}


@pytest.mark.proof
@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        "{",
        '{"files": {"../x": [1, "0"]}}',
        '{"files": {"a.ktx2": ["x", 1, 2]}}',
        "9" * 2**21,
    ],
)
def test_damaged_records_are_made_anew(folder, text):
    done("batch", "a.exr", "--for", "cesium", "--size", "16")
    path = folder / "a.cesium" / "a_export.json"
    if text.startswith("{") and len(text) > 1:
        text = json.dumps({**json.loads(path.read_text()), **json.loads(text)})
    path.write_text(text)
    _, found = statuses(folder, "batch", "a.exr", "--for", "cesium", "--size", "16")
    assert found == {"a.cesium": "made"}
    assert "a.ktx2" in json.loads(path.read_text())["files"]


@pytest.mark.proof
def test_a_manifest_names_engines_beside_forms(folder):
    (folder / "bake.toml").write_text(
        'probes = ["*.exr"]\n'
        "[[entry]]\n"
        'for = "all"\n'
        'output = "engines/{engine}/{probe}"\n'
        "size = 32\n"
        "[[entry]]\n"
        'to = ["irradiance", "export"]\n'
        'for = ["bevy"]\n'
        'output = "maps/{probe}.{engine}.{to}.exr"\n'
        "[entry.export]\n"
        "size = 16\n"
    )
    run("batch", "bake.toml")
    assert not [each for each in records(folder) if each["status"] == "failed"]
    assert (folder / "engines" / "godot" / "b").is_dir()
    assert (folder / "maps" / "b.irradiance.exr").is_file()
    assert (folder / "maps" / "b.bevy.export.exr").is_dir()
    # Files of engines are no probes.
    run("batch", "**/*.exr", "--to", "irradiance", "--dry-run", "-o", "x/{folder}/{probe}.exr")
    said = json.loads(run("batch", "**/*.exr", "--for", "json", "--dry-run", "--json").out)
    assert said["jobs"] == 2
    assert said["predictions"] == [{"to": "export", "brdf": None, "engine": "json", "outputs": 2}]


@pytest.mark.parametrize(
    ("arguments", "code", "parts"),
    [
        (("--to", "export"), 2, ["--for", "missing"]),
        (("--for", "three", "--to", "irradiance"), 2, ["--for", "--to export"]),
        (("--for", "unity", "--format", "bc6h"), 2, ["--format", "Unity"]),
        (("--for", "three", "-o", "s3://a/{probe}"), 1, ["s3://a/a", "folders of this machine"]),
        (("--for", "three", "--for", "bevy", "-o", "{probe}"), 1, ["{engine}"]),
        (("--for", "three", "--eps", "0.1"), 2, ["--eps"]),
        (("--to", "irradiance", "--skybox", "8"), 2, ["--skybox"]),
    ],
)
def test_what_is_refused(folder, arguments, code, parts):
    assert_refused(run("batch", "a.exr", *arguments), code, *parts)
    assert sorted(each.name for each in folder.iterdir()) == ["a.exr", "b.exr"]
