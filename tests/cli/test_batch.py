"""`shrm batch`: what it makes, prints and logs, and what it refuses."""

import json
import re
import shlex
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

from shrm_cli.batch.collect import read_collection
from shrm_cli.maps.file import open_map
from shrm_cli.prefilter import prefilter
from shrm_cli.probe.lighting import project
from shrm_cli.probe.open import open_probe
from tests.batch.helpers import edit, log_lines, statuses, work_here, write_probes
from tests.cli.helpers import assert_refused, noise, run, write_exr


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Current folder with five probes."""
    monkeypatch.chdir(tmp_path)
    write_probes(tmp_path / "probes", 5)
    return tmp_path


@pytest.fixture
def here(monkeypatch):
    """Batches work in this process."""
    work_here(monkeypatch)


IRRADIANCE = ("batch", "probes/*.exr", "--to", "irradiance", "-o", "out/{probe}.exr")


def test_a_folder_of_probes(folder):
    result = run(*IRRADIANCE, "--to", "shrm", "--brdf", "phong:exponent=8", "--eps", "0.1", "-o",
                 "out/{probe}.{brdf}.{to}.exr", "--jobs", "2")  # fmt: skip
    assert (result.code, result.err) == (0, "")
    assert re.fullmatch(
        r"10 outputs: 10 made, [\d,]+ bytes; batch\.jsonl tells of each\n", result.out
    )
    made = sorted(path.name for path in (folder / "out").iterdir())
    assert made == sorted(
        f"p{k}.{form}.exr" for k in range(5) for form in ("irradiance", "phong-exponent-8.shrm")
    )
    for k in range(5):
        assert open_map(folder / f"out/p{k}.irradiance.exr").info.probe == f"p{k}.exr"
    lines = log_lines(folder / "batch.jsonl")
    assert {line["status"] for line in lines} == {"made"}
    assert all(line["seconds"] > 0 and line["time"] for line in lines)


@pytest.fixture
def made(folder, here):
    """The same folder with the irradiance of all probes but one, which is damaged."""
    (folder / "probes/p3.exr").write_bytes(b"damaged")
    result = run(*IRRADIANCE, "--jobs", "1", "--quiet")
    assert result.code == 1
    assert "p3.exr" in result.err
    return folder


def test_what_failed_is_told_and_logged_and_done_again(made):
    assert not (made / "out/p3.exr").exists()
    (failed,) = [line for line in log_lines(made / "batch.jsonl") if line["status"] == "failed"]
    assert failed["probe"] == "probes/p3.exr"
    write_exr(made / "probes/p3.exr", noise())
    result = run(*IRRADIANCE, "--jobs", "1", "--json")
    assert (result.code, result.err) == (0, "")
    totals = json.loads(result.out)
    assert (totals["made"], totals["skipped"], totals["failed"]) == (1, 4, 0)
    last = log_lines(made / "batch.jsonl")[-5:]
    assert {line["output"]: line["status"] for line in last}["out/p3.exr"] == "made"


def test_json_names_the_failures(made):
    result = run(*IRRADIANCE, "--jobs", "1", "--json")
    assert result.code == 1
    totals = json.loads(result.out)
    assert (totals["jobs"], totals["failed"], totals["not_done"]) == (5, 1, 0)
    assert totals["failures"][0]["probe"] == "probes/p3.exr"


def test_a_dry_run_tells_what_would_be_made_and_makes_nothing(made):
    before = sorted(made.rglob("*"))
    result = run(
        *IRRADIANCE, "--to", "shrm", "--brdf", "phong:exponent=8", "-o", "out/{probe}{brdf}.exr",
        "--jobs", "1", "--dry-run",
    )  # fmt: skip
    assert sorted(made.rglob("*")) == before
    assert "waiting  out/p0phong-exponent-8.exr  (not there)" in result.err
    assert "skipped  out/p0.exr  (there already)" in result.err
    order = prefilter("probes/p0.exr", "phong:exponent=8").info.order_f
    assert f"5 of shrm, phong:exponent=8: F = {order}, P = 0, " in result.out
    assert "10 outputs: 4 to make, 4 there already, 2 failed" in result.out
    assert result.code == 1


def test_a_dry_run_tells_of_forms_without_texels_or_orders(folder, here):
    names = ("--jobs", "1", "--dry-run", "-o", "out/{to}.exr")
    fitted = run("batch", "probes/p0.exr", "--to", "she", *names)
    assert "1 of she: F = 33, at most 198 bytes each (as of probes/p0.exr)" in fitted.out
    textured = run("batch", "probes/p0.exr", "--to", "product", "--brdf", "phong", *names)
    assert "1 of product, phong: 128 texels, at most " in textured.out
    assert (fitted.code, textured.code) == (0, 0)


def test_the_manifest_of_the_page_is_made(folder, here):
    """An entry inherits `eps` there, says its own `error`, and failed."""
    write_probes(folder / "night", 1)
    page = (Path(__file__).parents[2] / "docs" / "batch.md").read_text()
    text = page.split("```toml\n")[1].split("```")[0]
    (folder / "bake.toml").write_text(text.replace("measured/paint.bsdf", "phong"))
    result = run("batch", "bake.toml", "--jobs", "1")
    assert (result.code, "27 outputs: 27 made" in result.out) == (0, True), result.err


def test_a_dry_run_counts_what_is_refused_whatever_the_probe_as_failed(folder, here):
    """These were to be made, with exit code 0."""
    options = ("--to", "irradiance", "--to", "shrm", "--brdf", "phong", "--split", "--jobs", "1")
    result = run("batch", "probes/*.exr", *options, "--dry-run")
    assert result.code == 1
    assert "10 outputs: 5 to make, 5 failed" in result.out
    assert "p0.phong.shrm.exr: --split applies to sums" in result.err
    assert "waiting  p0.phong.shrm.exr" not in result.err
    real = run("batch", "probes/*.exr", *options)
    assert (real.code, "10 outputs: 5 made, 5 failed" in real.out) == (1, True)


@pytest.mark.slow
def test_predicted_sizes_and_orders_are_those_of_the_files(folder, here):
    options = ("--to", "shrm", "--brdf", "microfacet:sigma=0.4", "-o", "{probe}.exr", "--jobs", "1")
    told = json.loads(run("batch", "probes/p0.exr", *options, "--dry-run", "--json").out)
    assert run("batch", "probes/p0.exr", *options, "--quiet").code == 0
    (record,) = log_lines(folder / "batch.jsonl")
    (predicted,) = told["predictions"]
    for name in ("size", "order_f", "order_p", "order_carried", "predicted_error"):
        assert predicted[name] == record[name]
    values = open_map("p0.exr").planes()
    assert predicted["bytes"] == 2 * sum(plane.size for plane in values)
    assert record["bytes"] < 1.2 * predicted["bytes"]


def test_errors_of_lamps_beside_a_map_are_told(folder, here):
    """In the log, and among what is predicted, where all that counts is in one number."""
    light = np.ones((64, 128, 3), dtype=np.float32)
    light[20, 40:44] = 300
    write_exr("tube.exr", light)
    options = "--brdf", "phong:exponent=32", "--to", "shrm", "--sun", "split", "-o", "{probe}.d.exr"
    dry = run("batch", "tube.exr", *options, "--dry-run").out
    assert run("batch", "tube.exr", *options, "--jobs", "1", "--quiet").code == 0
    (record,) = log_lines(folder / "batch.jsonl")
    made = open_map("tube.d.exr").summary()
    assert record["lamp_error"] == pytest.approx(made["lamp_error"], rel=1e-6)
    whole = np.hypot(made["lamp_error"], made["predicted_error"])
    told = float(re.search(r"RMS error ([\d.]+)%", dry)[1])
    assert told == pytest.approx(100 * whole, abs=0.006)
    assert made["lamp_error"] > 0.01


@pytest.mark.slow
def test_a_manifest(folder):
    (folder / "bake.toml").write_text(
        """
        probes = ["probes/*.exr"]
        to = ["irradiance"]
        output = "out/{probe}.{to}.exr"

        [[entry]]
        [[entry]]
        probes = ["probes/p0.exr"]
        to = "shrm"
        brdfs = ["phong:exponent=8"]
        eps = 0.2
        """
    )
    result = run("batch", "bake.toml", "--jobs", "1")
    assert (result.code, result.err) == (0, "")
    assert len(list((folder / "out").iterdir())) == 6
    assert open_map("out/p0.shrm.exr").info.eps == pytest.approx(0.2)
    assert_refused(run("batch", "bake.toml", "--eps", "0.1"), 2, "--eps", "manifest")
    assert_refused(run("batch", "bake.toml", "probes/p0.exr"), 2, "nothing beside it")


def test_a_light_file_is_a_probe(folder, here):
    (folder / "lamp.toml").write_text(
        "[[disc]]\nazimuth = 10\nelevation = 40\nradius = 20\nradiance = [1, 1, 1]\n"
    )
    result = run("batch", "lamp.toml", "--to", "irradiance", "--jobs", "1")
    assert (result.code, result.err) == (0, "")
    assert open_map("lamp.irradiance.exr").info.probe == "lamp.toml"


def test_gathered_coefficients(made):
    result = run("batch", "probes/*.exr", "--collect", "light.npz", "--collect-order", "3")
    assert result.code == 1
    assert "probes/p3.exr" in result.err
    assert result.out.startswith("light.npz: radiance of 4 probes\n")
    found = read_collection("light.npz")
    assert list(found.names) == [f"probes/p{k}.exr" for k in (0, 1, 2, 4)]
    for name, digest, coefficients in zip(
        found.names, found.digests, found.coefficients, strict=True
    ):
        probe = open_probe(name)
        assert digest == probe.digest()
        np.testing.assert_array_equal(coefficients, project(probe, 3).coefficients)
    assert not list(made.glob("*.shrm.exr"))  # no maps were asked for


@pytest.mark.slow
def test_what_holds_all_probes_holds_one_part_with_shares(folder, here):
    line = (*IRRADIANCE[:2], "--jobs", "1", "--collect", "l.npz")
    assert "it will hold this part alone" in run(*line, "--share", "1/3").err
    assert "part alone" not in run(*line, "--share", "1-3/3").err + run(*line).err


def test_a_share_of_no_probes_says_so(folder, here):
    line = (*IRRADIANCE, "--jobs", "1", "--dry-run", "--share")
    shares = [run(*line, f"{k}/7").err for k in range(1, 8)]
    empty = [each for each in shares if "has none of 5 probes" in each]
    assert len(empty) >= 2
    assert all("out/p" in each for each in shares if each not in empty)


def test_shares_are_all_of_a_batch(folder, here):
    found = []
    for share in ("1/3", "2-3/3"):
        assert run(*IRRADIANCE, "--jobs", "1", "--share", share, "--log", "l.jsonl").code == 0
    found = statuses(log_lines(folder / "l.jsonl"))
    assert found == {f"out/p{k}.exr": "made" for k in range(5)}
    assert len(log_lines(folder / "l.jsonl")) == 5  # each in one share only


def test_command_lines_for_farms(folder):
    result = run(*IRRADIANCE, "--chunk", "2", "--commands", "lines.txt", "--openjd=job.json")
    assert (result.code, result.err) == (0, "")
    lines = (folder / "lines.txt").read_text().splitlines()
    assert lines == [
        f"shrm batch --share {k}/3 'probes/*.exr' --to irradiance -o 'out/{{probe}}.exr'"
        for k in (1, 2, 3)
    ]
    job = json.loads((folder / "job.json").read_text())
    assert job["specificationVersion"] == "jobtemplate-2023-09"
    assert not (folder / "out").exists()
    printed = run(*IRRADIANCE, "--chunk", "2", "--commands", "-")
    assert (printed.code, printed.err) == (0, "")
    assert printed.out.splitlines() == lines
    template = run(*IRRADIANCE, "--chunk", "2", "--openjd", "-")
    assert (template.code, template.err) == (0, "")
    assert json.loads(template.out) == job
    assert not (folder / "-").exists()


def test_a_probe_that_cannot_be_read_is_told_of_once(folder):
    """Not for each of its outputs; the log has each."""
    (folder / "bad.exr").write_bytes(b"no image")
    forms = ("--to", "irradiance", "--to", "splitsum", "--log", "l.jsonl")
    result = run("batch", "bad.exr", *forms, "-o", "{probe}.{to}.exr")
    assert result.code == 1
    (line,) = result.err.splitlines()
    assert re.match(r"Failed: bad\.(irradiance|splitsum)\.exr: bad\.exr: not an image", line)
    failed = [each["output"] for each in log_lines(folder / "l.jsonl") if "error" in each]
    assert sorted(failed) == ["bad.irradiance.exr", "bad.splitsum.exr"]


def test_a_second_run_beside_its_own_outputs(folder, here, monkeypatch):
    """Patterns pass over what the first run wrote, and a line says how much that is."""
    monkeypatch.chdir(folder / "probes")
    command = ("batch", "*.exr", "--to", "irradiance")
    assert run(*command).out.startswith("5 outputs: 5 made")
    result = run(*command)
    assert (result.code, result.out.split(";")[0]) == (0, "5 outputs: 5 there already")
    assert result.err == (
        "5 files that shrm made, or that hold no light, such as p0.irradiance.exr: left out of "
        "the patterns\n"
    )
    assert run(*command, "--quiet").err == ""
    assert run("batch", "*", "--to", "she").out.startswith("5 outputs: 5 made")
    assert run("batch", "p0*", "--collect", "l.npz").out == "l.npz: radiance of 1 probe\n"
    assert run("batch", "p0*", "--collect", "l.npz", "--dry-run").out == "0 outputs: none\n"
    both = run("batch", "p0.exr", "p0.irradiance.exr", "--to", "irradiance")
    assert_refused(both, 1, "p0.irradiance.exr: shrm made it", "leave it out")
    named = run("batch", "p0.she.exr", "--to", "irradiance", "-o", "x.exr")
    assert named.code == 1
    assert "a map that shrm made, not a light probe" in named.err
    assert_refused(run("batch", "*.irradiance.exr", "--to", "she"), 1, "no probe, only 5 files")


@pytest.mark.parametrize("left", [0, 100])
def test_an_output_that_is_cut_off_is_no_probe(folder, here, monkeypatch, left):
    """Nothing in it says that it was an output, and its name does."""
    monkeypatch.chdir(folder / "probes")
    command = ("batch", "./*.exr", "--to", "irradiance")
    assert run(*command).code == 0
    path = folder / "probes/p1.irradiance.exr"
    path.write_bytes(path.read_bytes()[:left])
    result = run(*command)
    assert (result.code, result.out.split(", 9,")[0][:34]) == (
        0,
        "5 outputs: 1 made, 4 there already",
    )


def test_farms_take_probes_beside_their_outputs(folder, here, monkeypatch):
    """Each task matches the pattern anew, among the outputs of those before it."""
    monkeypatch.chdir(folder / "probes")
    assert run("batch", "*.exr", "--to", "irradiance", "--chunk", "1", "--commands", "c").code == 0
    tasks = [shlex.split(line)[1:] for line in (folder / "probes/c").read_text().splitlines()]
    assert len(tasks) == 5
    for _ in range(2):
        assert {run(*task).code for task in tasks} == {0}
    found = [line["status"] for line in log_lines(folder / "probes/batch.jsonl")]
    assert found == ["made"] * 5 + ["skipped"] * 5


def test_why_outputs_are_made_anew_is_told(folder, here):
    assert run(*IRRADIANCE).code == 0
    for k in (0, 1):
        path = folder / f"out/p{k}.exr"
        path.write_bytes(path.read_bytes()[:-300] + bytes(300))
    edit(folder / "out/p2.exr")
    looked = run(*IRRADIANCE, "--dry-run")
    assert looked.err.count("(it is damaged)\n") == 2
    result = run(*IRRADIANCE)
    assert result.code == 1
    assert result.out.splitlines()[0].startswith("5 outputs: 2 made, 2 there already, 1 failed")
    assert result.out.splitlines()[1:] == ["  2 anew: it is damaged"]
    assert "out/p2.exr: exists, and it was changed since shrm made it; give --force" in result.err
    told = json.loads(run(*IRRADIANCE, "--window", "hann", "--json").out)
    assert list(told["anew"].values()) == [4]
    assert run(*IRRADIANCE, "--force").out.splitlines()[1:] == ["  5 anew: asked for by --force"]


def test_split_sums_are_known_by_the_brdf_that_they_were_made_for(folder, here):
    asked = ["batch", "probes/p0.exr", "--to", "splitsum", "--levels", "2", "-o", "out/{probe}.exr"]
    said = "1 output: 1 made", "  1 anew: it is for another BRDF"
    for words in (["--brdf", "charlie"], ["--brdf", "charlie:color=0.5"], []):
        made = run(*asked, *words)
        assert made.code == 0
        assert made.out.startswith(said[0])
        assert made.out.splitlines()[1:] == list(said[1:] if words != ["--brdf", "charlie"] else [])
        assert run(*asked, *words).out.startswith("1 output: 1 there already")


@pytest.mark.parametrize("form", ["--commands", "--openjd"])
def test_a_farm_takes_command_lines_that_end_their_options(folder, here, form):
    """Behind ``--`` every word is a name, so that the part must stand before it."""
    (folder / "probes/p0.exr").rename(folder / "--commands.exr")
    words = ["--to", "irradiance", "-o", "out/{probe}.exr", "--jobs", "1", "--chunk", "2"]
    assert run("batch", *words, form, "farm", "--", "--commands.exr", "probes/p*.exr").code == 0
    text = (folder / "farm").read_text()
    if form == "--commands":
        tasks = [shlex.split(line)[1:] for line in text.splitlines()]
    else:
        action = json.loads(text)["steps"][0]["script"]["actions"]["onRun"]
        tasks = [
            [word.replace("{{Task.Param.Part}}", str(k)) for word in action["args"]]
            for k in (1, 2, 3)
        ]
    assert len(tasks) == 3
    for task in tasks:
        assert run(*task).code == 0
    found = [line["probe"] for line in log_lines(folder / "batch.jsonl")]
    assert sorted(found) == ["--commands.exr", *(f"probes/p{k}.exr" for k in range(1, 5))]


def test_a_folder_that_nobody_may_write_fails_before_the_work(folder, here, monkeypatch):
    """All maps were made first, which took half a minute for three probes."""

    def make(*_):
        raise AssertionError("there is nowhere to put it")

    for module, name in (("work", "make"), ("exports", "packaged")):
        monkeypatch.setattr(import_module(f"shrm_cli.batch.{module}"), name, make)
    monkeypatch.setattr("os.access", lambda path, mode: "out" not in str(path))
    (folder / "out").mkdir()
    assert "p0.exr: no permission to write in out; name another" in run(*IRRADIANCE).err
    engines = ("batch", "probes/*.exr", "--for", "three", "-o", "out/{engine}/{probe}")
    said = run(*engines).err
    assert "out/three/p0: no permission to write in out; name another" in said
    assert not any((folder / "out").iterdir())
    (folder / "out/three/p0").mkdir(parents=True)
    assert "no permission to write in out/three/p0; name another" in run(*engines).err


@pytest.mark.parametrize("option", ["--commands", "--openjd", "--log"])
@pytest.mark.parametrize("name", ["sky.exr", "face_+X.exr", "matte.exr", "bake.toml", "link"])
def test_what_a_batch_reads_is_not_overwritten(folder, here, option, name):
    """Not by what it writes besides maps either: the probe, a face, a table and a manifest."""
    for probe in ("sky", *(f"face_{face}" for face in ("+X", "-X", "+Y", "-Y", "+Z", "-Z"))):
        write_exr(f"{probe}.exr", np.ones((8, 8 if "_" in probe else 16, 3), np.float32))
    assert run("brdf", "lambertian", "--save", "matte.exr").code == 0
    (folder / "bake.toml").write_text('probes = ["sky.exr"]\nto = "irradiance"\n')
    (folder / "link").symlink_to("sky.exr")
    words = ["sky.exr", "face_%.exr", "--brdf", "matte.exr"]
    before = (folder / name).read_bytes()
    result = run("batch", *(["bake.toml"] if name == "bake.toml" else words), option, name)
    assert_refused(result, 1, f"{name}: would overwrite the input; name another output")
    assert (folder / name).read_bytes() == before


def test_no_two_files_of_a_run_are_one(folder, here):
    made = run(*IRRADIANCE, "--log", "out/p0.exr")
    assert_refused(made, 1, "out/p0.exr: is another output of this run; name each differently")
    both = run(*IRRADIANCE, "--contact", "a.html", "--log", "./a.html")
    assert_refused(both, 1, "is another output of this run")
    assert not (folder / "out").exists()


def test_a_log_is_appended_to_logs_alone(folder, here):
    (folder / "mine").write_text("my notes\n")
    refused = run(*IRRADIANCE, "--log", "mine")
    assert_refused(refused, 1, "mine: exists, and is no log of a batch; name another --log")
    assert (folder / "mine").read_text() == "my notes\n"
    for begun in ("", '{"ti'):  # as after a full disk
        (folder / "log").write_text(begun)
        assert run(*IRRADIANCE, "--log", "log").code == 0


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--share", "1/2"], "--share"),
        (["--dry-run"], "--dry-run"),
        (["--collect", "light.npz"], "--collect"),
        (["--contact", "page.html"], "--contact"),
    ],
)
def test_command_lines_of_farms_say_nothing_that_holds_for_a_whole_run(folder, words, said):
    """Each would have made the same share, nothing, or the one file of all again."""
    result = run(*IRRADIANCE, *words, "--commands", "lines.txt")
    assert_refused(result, 2, f"leave out {said}, ")
    assert not (folder / "lines.txt").exists()


def test_values_of_options_are_no_options_of_farms(folder):
    for value in ("--", "--chunk"):
        words = ["--log", value, "--brdf", "phong", "--to", "irradiance", "--to", "shrm"]
        result = run("batch", "probes/*.exr", *words, "--commands", "lines.txt", "--chunk=5")
        assert (result.code, result.err) == (0, "")
        assert shlex.split((folder / "lines.txt").read_text()) == [
            "shrm", "batch", "--share", "1/1", "probes/*.exr", *words,
        ]  # fmt: skip
        (folder / "lines.txt").unlink()


@pytest.mark.parametrize(
    ("arguments", "code", "said"),
    [
        (["probes", "--to", "irradiance"], 1, ["probes: a folder", "'probes/*.exr'"]),
        (["none/*.exr", "--to", "irradiance"], 1, ["none/*.exr", "matches no file"]),
        (["probes/*.exr"], 2, ["--brdf", "is missing"]),
        (["probes/*.exr", "--to", "irradiance", "--levels", "3"], 2, ["--levels", "splitsum"]),
        (["probes/*.exr", "--to", "irradiance", "-o", "x.exr"], 1, ["{probe}"]),
        (["probes/*.exr", "--to", "irradiance", "--share", "3/2"], 2, ["--share", "3/10"]),
        (["probes/*.exr", "--to", "irradiance", "--collect-order", "3"], 2, ["--collect"]),
        (["probes/*.exr", "--to", "irradiance", "--collect", "a.txt"], 1, [".parquet"]),
        (["probes/*.exr", "--to", "irradiance", "--log", "no/log"], 1, ["no/log", "--log"]),
        (["probes/*.exr", "--to", "irradiance", "--scheduler", "nonsense"], 1, ["nonsense"]),
    ],
)
def test_what_cannot_be_asked_for(folder, arguments, code, said):
    if "nonsense" in arguments:
        pytest.importorskip("distributed")
    assert_refused(run("batch", *arguments), code, *said)


@pytest.mark.slow
def test_lines_tell_the_progress_where_there_is_no_terminal(folder, here, monkeypatch):
    monkeypatch.setattr("shrm_cli.cli.terminal._EVERY", 0.0)
    result = run(*IRRADIANCE, "--jobs", "1")
    assert re.search(r"baking: 3 of 5, [\d.]+ a second, \d+ s left", result.err)
    assert run(*IRRADIANCE, "--jobs", "1", "--quiet").err == ""


def test_predictions_are_of_the_first_sound_probe(folder, here):
    (folder / "probes/p0.exr").write_bytes(b"damaged")
    result = run(*IRRADIANCE, "--jobs", "1", "--dry-run", "--json")
    (told,) = json.loads(result.out)["predictions"]
    assert told["probe"] == "probes/p1.exr"
    assert (told["outputs"], told["order_f"], told["size"]) == (5, 2, 16)


def test_a_manifest_that_is_not_there_is_missed_first(folder):
    """What was missed was --brdf, which a manifest may say."""
    assert_refused(run("batch", "bake.toml", "--dry-run"), 1, "bake.toml", "no such file")
    assert_refused(run("batch", "lights/*.toml", "--to", "irradiance"), 1, "matches no file")
