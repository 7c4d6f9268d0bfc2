"""`make`: in a copy of the project whose .venv holds a stand-in for `shrm`, or the real one."""

import shlex
import shutil
import signal
import subprocess
import sys
import time

import numpy as np
import OpenEXR
import pytest

from tests.benchmarks.__main__ import MODULES
from tests.cli.helpers import ROOT, WRONG_PICTURE, snapshot
from tests.make_project import BRDFS, REAL, STAND_IN, Project

LABELS = ("microfacet-sigma-0.3", "phong-exponent-8")

pytestmark = pytest.mark.skipif(shutil.which("make") is None, reason="make is not installed")


@pytest.fixture
def project(tmp_path):
    return Project(tmp_path)


SHARED = "-o build/{probe}.{brdf}.{to}.exr --log build/batch.jsonl"
PAGE = "contact build --quiet --title make batch -o build/index.html"


def baking(asked, more="", probes="probes/a.exr probes/b.exr"):
    """The call that bakes what is asked for of some probes."""
    return " ".join(f"batch {asked} {SHARED} {more} -- {probes}".split())


OF_BRDFS = "--brdf microfacet:sigma=0.3 --brdf phong:exponent=8"


def outputs(*names):
    """Maps and pictures of probes with each BRDF."""
    stems = [f"{name}.{label}.auto" for name in names for label in LABELS]
    return sorted(f"{stem}.{suffix}" for stem in stems for suffix in ("exr", "png"))


def test_variables_for_batch_mean_nothing_to_benchmarks():
    """The makefile hands them to all that it starts."""
    shown = subprocess.run(
        ["make", "--no-print-directory", "--eval", "shown: ; @env -0", "shown"],
        cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True,
    ).stdout  # fmt: skip
    environment = dict(line.split("=", 1) for line in shown.split("\0") if "=" in line)
    assert "BATCH_PROBES" in environment
    code = "from importlib import import_module; from tests.benchmarks.__main__ import MODULES; "
    code += "print(*(import_module(module).__name__ for module in MODULES))"
    found = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, env=environment, capture_output=True, text=True,
    )  # fmt: skip
    assert (found.returncode, found.stderr) == (0, "")
    assert found.stdout.split() == MODULES


def test_help_is_what_make_does_by_itself(project):
    result = project.make()
    assert (result.returncode, result.stderr) == (0, "")
    for target in ("demo", "test", "bench", "probes", "batch", "install", "clean"):
        assert f"make {target} " in result.stdout
    assert project.make("help").stdout == result.stdout
    assert project.calls() == []


def test_batch_bakes_every_pair_and_each_form(project):
    given = ("FORMS=irradiance she", "FLAGS_irradiance=--form zh3", "PREFILTER_FLAGS=--size 64")
    assert project.batch(*given, "-j3").returncode == 0
    assert project.calls() == sorted([
        baking(f"{OF_BRDFS} --size 64", "--jobs 3"),
        baking("--to irradiance --form zh3", "--jobs 3"),
        baking("--to she", "--jobs 3"),
    ])  # fmt: skip


def test_a_tolerance_asks_for_shrms(project):
    assert project.batch(eps="0.03").returncode == 0
    assert project.calls() == [baking(f"{OF_BRDFS} --eps 0.03")]


def test_everything_is_made_again_when_make_is_told_so(project):
    # Make sets the project up again, too, which takes long.
    stand_in = '#!/bin/sh\ncase "$*" in *batch.py) exec python3 "$@";; esac\n'
    (project.folder / ".venv" / "bin" / "python").write_text(stand_in)
    (project.folder / ".venv" / "bin" / "python").chmod(0o755)
    assert project.batch("-B", "-j4", "PYTHON=.venv/bin/python").returncode == 0
    assert baking(OF_BRDFS, "--jobs 4 --force") in project.calls()


def test_pictures_are_drawn_of_what_changed(project):
    (project.folder / "build").mkdir()
    stems = ["build/a.phong.auto", "build/b.phong.shrm"]
    for stem in stems:
        project.write(f"{stem}.exr", "map")

    def drawn(*flags, is_new=False):
        assert project.batch(*flags).returncode == 0
        calls = project.calls()
        assert (PAGE in calls) == is_new
        return [call for call in calls if call.startswith("render ")]

    assert drawn(is_new=True) == [f"render {stem}.exr -o {stem}.png" for stem in stems]
    assert drawn() == []
    (project.folder / f"{stems[1]}.png").unlink()
    assert drawn() == [f"render {stems[1]}.exr -o {stems[1]}.png"]
    project.write(f"{stems[0]}.exr", "another")
    assert drawn(is_new=True) == [f"render {stems[0]}.exr -o {stems[0]}.png"]
    project.write(f"{stems[0]}.png", "damaged")
    assert drawn() == [f"render {stems[0]}.exr -o {stems[0]}.png"]
    flags = "--exposure 1"
    assert drawn(f"RENDER_FLAGS={flags}") == [
        f"render {stem}.exr {flags} -o {stem}.png" for stem in stems
    ]


@pytest.mark.parametrize("broken", ["probes/b.exr", "build/a.shrm.exr"])
def test_what_fails_fails_the_run_but_not_what_follows(project, broken):
    (project.folder / "build").mkdir()
    for name in "ab":
        project.write(f"build/{name}.shrm.exr", "map")
    project.write(broken, "broken")
    result = project.batch()
    assert result.returncode != 0
    assert f"Error: {broken}: broken; mend it" in result.stderr
    assert "Some jobs failed" in result.stdout
    assert "Maps and pictures are in" not in result.stdout
    assert "render build/b.shrm.exr -o build/b.shrm.png" in project.calls()
    project.write(broken, "mended")
    assert project.batch().returncode == 0


HOSTILE = ["my probe", "it's", "p%q", "a$b$(HOME)", 'say "hi"', "x#y", "a:b", "50% ~grey", "ü*"]


@pytest.mark.parametrize("name", HOSTILE)
def test_names_are_handed_over_as_they_are(project, name):
    probes, brdfs = shlex.quote(f"probes/{name}.exr"), shlex.quote(f"../{name}.bsdf")
    assert project.batch(probes=probes, brdfs=brdfs).returncode == 0
    asked = f"batch --brdf ../{name}.bsdf {SHARED} -- probes/{name}.exr"
    assert project.calls() == [asked]


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ({"probes": "'probes/a.exr"}, "PROBES: No closing quotation; quote names as in a shell"),
        ({"eps": "'0.1"}, "EPS: No closing quotation; quote names as in a shell"),
        ({"probes": ""}, "nothing to bake"),
        ({"brdfs": ""}, "nothing to bake"),
    ],
)
def test_what_cannot_be_baked_is_said_in_a_line(project, asked, words):
    result = project.batch(**asked)
    assert result.returncode != 0
    assert result.stderr.startswith("Error: ")
    assert words in result.stderr.splitlines()[0]
    assert project.calls() == []


@pytest.mark.parametrize("option", ["-n", "-q", "-t", "-nk", "--just-print"])
def test_a_dry_run_prints_the_commands_and_does_nothing(project, option):
    before = snapshot(project.folder)
    said = project.batch(option, "-j2", "FORMS=she")
    assert (said.returncode, said.stderr) == (0, "")
    lines = [shlex.split(line) for line in said.stdout.splitlines()[-3:]]
    assert [" ".join(words) for words in lines] == [
        f".venv/bin/shrm {baking(OF_BRDFS, '--jobs 2')}",
        f".venv/bin/shrm {baking('--to she', '--jobs 2')}",
        f".venv/bin/shrm {PAGE}",
    ]
    assert snapshot(project.folder) == before


def test_a_dry_run_of_a_clean_clone_says_that_it_is_set_up_first(project):
    shutil.rmtree(project.folder / ".venv")
    before = snapshot(project.folder)
    said = project.batch("-n")
    assert (said.returncode, said.stderr) == (0, "")
    assert "-m venv .venv" in said.stdout
    assert said.stdout.count(".venv/bin/shrm batch") == 1
    assert snapshot(project.folder) == before


def test_the_project_may_lie_in_a_folder_of_any_name(tmp_path):
    (tmp_path / "it's my folder").mkdir()
    project = Project(tmp_path / "it's my folder")
    result = project.batch()
    assert (result.returncode, result.stderr) == (0, "")
    assert f"Maps and pictures are in {project.folder}/build/" in result.stdout
    demo = project.make("demo")
    assert (demo.returncode, demo.stderr) == (0, "")
    assert f"The picture is {project.folder}/build/demo/lacquer.png" in demo.stdout


# Says that it has begun, and goes on until it is told to end, which it says too.
ENDLESS = """#!/bin/sh
trap 'echo >"ended.$$"; exit 143' TERM
echo >"begun.$$"
for try in $(seq 500); do sleep 0.02; done
"""


@pytest.mark.skipif(sys.platform == "win32", reason="has no such signals")
def test_a_make_that_is_stopped_ends_its_jobs(project):
    def count(what):
        return len(list(project.folder.glob(f"{what}.*")))

    project.install(ENDLESS)
    with project.begin("batch", "PROBES=probes/*.exr", f"BRDFS={BRDFS}") as make:
        wait_until(lambda: count("begun") == 1)
        make.send_signal(signal.SIGTERM)
        out, _ = make.communicate(timeout=30)
    assert make.returncode not in (0, 1)
    assert "Maps and pictures are in" not in out
    wait_until(lambda: count("ended") == 1)
    project.install(STAND_IN)
    assert project.batch().returncode == 0
    assert project.calls() == [baking(OF_BRDFS)]


def wait_until(is_true):
    end = time.monotonic() + 30
    while not is_true():
        assert time.monotonic() < end
        time.sleep(0.02)


def test_defaults_are_every_shipped_probe_and_four_brdfs(project):
    assert project.make("batch").returncode == 0
    (call,) = project.calls()
    assert call.count("--brdf ") == 4
    assert call.endswith("-- probes/*.exr")


def test_clean_removes_what_was_built(project):
    assert project.batch().returncode == 0
    for name in ("examples", "research", "shrm_cli", "tests"):
        (project.folder / name / "part" / "__pycache__").mkdir(parents=True)
    assert project.make("clean").returncode == 0
    assert not (project.folder / "build").exists()
    assert not list(project.folder.rglob("__pycache__"))
    assert (project.folder / ".venv").exists()
    assert (project.folder / "probes" / "a.exr").exists()
    assert project.make("distclean").returncode == 0
    assert not (project.folder / ".venv").exists()


@pytest.mark.parametrize("failing", ["ruff", "mypy", "python", None])
def test_what_is_checked_beside_the_tests_fails_them_too(project, failing):
    """Types are checked in the background, and may be ready before the tests or after them."""
    for name in ("ruff", "mypy", "python"):
        command = project.folder / ".venv" / "bin" / name
        command.write_text(f"#!/bin/sh\nsleep 0.0{len(name)}\nexit {int(name == failing)}\n")
        command.chmod(0o755)
    (project.folder / ".venv" / ".dev").touch()
    assert (project.make("test").returncode == 0) == (failing is None)


def test_an_old_python_is_refused_with_what_to_do(project):
    shutil.rmtree(project.folder / ".venv")
    result = project.make("install", "PYTHON=false")
    assert result.returncode != 0
    assert "shrm needs Python 3.11 or newer; name one: make PYTHON=" in result.stdout
    assert not (project.folder / ".venv").exists()


@pytest.mark.proof
@pytest.mark.slow
def test_demo_and_batch_with_the_real_command(project):
    project.install(REAL)
    light = np.random.default_rng(0).uniform(0, 1, (8, 16)).astype(np.float32)
    for name in ("a", "b"):
        header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
        path = project.folder / "probes" / f"{name}.exr"
        OpenEXR.File(header, dict.fromkeys("RGB", light)).write(str(path))
    demo = project.make("demo", "DEMO_FLAGS=--size 32")
    assert (demo.returncode, demo.stderr) == (0, "")
    picture = project.folder / "build" / "demo" / "lacquer.png"
    assert f"The picture is {picture}" in demo.stdout
    assert picture.read_bytes().startswith(b"\x89PNG")
    for _ in range(2):
        result = project.batch("-j2", "RENDER_FLAGS=--size 32", probes="probes/*.exr")
        told = [line for line in result.stderr.splitlines() if WRONG_PICTURE not in line]
        assert (result.returncode, told) == (0, [])
        assert project.built() == sorted(["demo", *outputs("a", "b")])
    assert "4 outputs: 4 there already" in result.stdout
    with OpenEXR.File(str(project.folder / "build" / "b.phong-exponent-8.auto.exr")) as file:
        assert "exponent" in file.header()["shrm:brdf"]
    result = project.batch(probes="probes/a.exr probes/no.exr", brdfs="lambertian")
    assert result.returncode != 0
    assert "probes/no.exr" in result.stderr
    assert "a.lambertian.auto.png" in project.built()
