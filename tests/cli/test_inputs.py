"""No command overwrites a file that it reads: every command, every kind of input, every link."""

import numpy as np
import pytest

from tests.cli.helpers import assert_refused, done, run, snapshot, write_exr

QUICK = ("--size", "16", "--source-height", "4")
FACES = ("+X", "-X", "+Y", "-Y", "+Z", "-Z")


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A folder with one file of each kind that commands read."""
    folder = tmp_path_factory.mktemp("inputs")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        write_exr("light.exr", np.ones((8, 16, 3), np.float32))
        for face in FACES:
            write_exr(f"sky_{face}.exr", np.ones((4, 4, 3), np.float32))
        done("brdf", "lambertian", "--save", "matte.exr")
        (folder / "mine.exr").write_text("")
        done("prefilter", "light.exr", "--brdf", "0.5*matte.exr+0.5*phong", "-o", "map.exr")
        done("prefilter", "light.exr", "--to", "irradiance", "-o", "light.irradiance.exr")
    return folder


SUM = "0.5*phong+0.5*matte.exr"
CASES = {
    "prefilter a probe": ("light.exr", "prefilter light.exr --brdf phong -o"),
    "prefilter six faces": ("sky_-Y.exr", "prefilter sky_%.exr --brdf phong -o"),
    "prefilter for a table": ("matte.exr", "prefilter light.exr --brdf matte.exr -o"),
    "prefilter for a sum": ("matte.exr", f"prefilter light.exr --brdf {SUM} -o"),
    "render a map": ("map.exr", "render map.exr -o"),
    "render before a probe": ("light.exr", "render map.exr --background light.exr -o"),
    "render before faces": ("sky_+Z.exr", "render map.exr --background sky_%.exr -o"),
    "compare maps": ("light.irradiance.exr", "compare map.exr light.irradiance.exr -o"),
    "compare under a probe": ("light.exr", "compare map.exr --probe light.exr -o"),
    "compare as a table": ("matte.exr", "compare map.exr --probe light.exr --brdf matte.exr -o"),
    "compare as a sum": ("matte.exr", f"compare map.exr --probe light.exr --brdf {SUM} -o"),
    "compare as the map says": ("matte.exr", "compare map.exr --probe light.exr -o"),
    "compare representations": ("light.exr", "compare light.exr --representations -o"),
    "convert a map": ("map.exr", "convert map.exr --to cabral -o"),
    "convert a probe": ("light.exr", "convert light.exr --to strip -o"),
    "refer to a probe": ("light.exr", "reference light.exr --brdf phong -o"),
    "refer to a table": ("matte.exr", "reference light.exr --brdf matte.exr -o"),
    "refer to a sum": ("matte.exr", f"reference light.exr --brdf {SUM} -o"),
    "save a table": ("matte.exr", "brdf matte.exr --save"),
    "save a sum": ("matte.exr", f"brdf {SUM} --save"),
}


@pytest.mark.slow
@pytest.mark.parametrize("way", ["itself", "a symbolic link", "a hard link"])
@pytest.mark.parametrize("case", CASES)
def test_what_is_read_is_not_overwritten(made, monkeypatch, case, way):
    monkeypatch.chdir(made)
    source, command = CASES[case]
    target = made / source
    if way != "itself":
        target = made / "other.exr"
        target.unlink(missing_ok=True)
        (target.symlink_to if way == "a symbolic link" else target.hardlink_to)(made / source)
    before = snapshot(made)
    result = run(*command.split(), target.name)
    assert_refused(result, 1, f"{target.name}: would overwrite the input; name another output")
    assert snapshot(made) == before
    if way != "itself":
        target.unlink()


@pytest.mark.parametrize("command", ["convert six to six", "analyze", "analyze several"])
def test_outputs_of_several_files_overwrite_no_input(made, monkeypatch, command):
    monkeypatch.chdir(made)
    linked = {"convert six to six": None, "analyze": "a.accuracy.png"}.get(command, "a.energy.png")
    if linked is not None:
        (made / linked).symlink_to("light.exr" if command == "analyze" else "matte.exr")
    before = snapshot(made)
    arguments = {
        "convert six to six": "convert sky_%.exr --to faces -o sky_%.exr",
        "analyze": "analyze --brdf phong --probe light.exr -o a",
        "analyze several": "analyze --brdf phong matte.exr -o a",
    }[command]
    assert_refused(run(*arguments.split()), 1, "would overwrite the input; name another output")
    assert snapshot(made) == before
    if linked is not None:
        (made / linked).unlink()


def test_python_files_are_not_overwritten(made, monkeypatch):
    monkeypatch.chdir(made)
    code = (
        "from shrm_cli.brdf.models.phong import Phong\n\n\nclass Mine(Phong):\n    name = 'mine'\n"
    )
    (made / "mine.py").write_text(code)
    (made / "link.exr").symlink_to("mine.py")
    for command in ("prefilter light.exr --brdf mine.py:Mine -o", "brdf mine.py:Mine --save"):
        assert_refused(run(*command.split(), "link.exr"), 1, "link.exr: would overwrite the input")
    assert (made / "mine.py").read_text() == code


def test_a_file_that_is_found_to_be_read_while_working_is_kept(made, monkeypatch):
    """Writing asks again, so that no command can forget an input."""
    monkeypatch.chdir(made)
    monkeypatch.setattr("shrm_cli.cli.usage.check_outputs", lambda *_, **__: None)
    before = snapshot(made)
    arguments = ["reference", "light.exr", "--brdf", SUM, *QUICK, "-o", "matte.exr"]
    assert_refused(run(*arguments), 1, "matte.exr: would overwrite the input; name another output")
    assert snapshot(made) == before


def test_a_command_does_not_know_the_inputs_of_the_last(made, monkeypatch):
    monkeypatch.chdir(made)
    done("prefilter", "light.exr", "--brdf", "phong", "-o", "again.exr")
    done("render", "again.exr", "--size", "16", "-o", "again.png")
    done("prefilter", "light.exr", "--brdf", "phong", "-o", "again.exr")
