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
from tests.cli.helpers import ROOT, WRONG_PICTURE, mounted, snapshot
from tests.make_project import BRDFS, REAL, STAND_IN, Project

LABELS = ("microfacet-sigma-0.3", "phong-exponent-8")

pytestmark = pytest.mark.skipif(shutil.which("make") is None, reason="make is not installed")

# The same, but no call returns before a second one has begun.
SIDE_BY_SIDE = """#!/bin/sh
for output; do :; done
echo >"started.$$"
for try in $(seq 500); do
    if [ "$(ls started.* | wc -l)" -gt 1 ]; then
        echo >"$output"
        exit 0
    fi
    sleep 0.01
done
echo 'Error: alone for five seconds' >&2
exit 1
"""


@pytest.fixture
def project(tmp_path):
    return Project(tmp_path)


@pytest.fixture
def baked(project):
    """All four pairs are there, and their calls forgotten."""
    assert project.batch().returncode == 0
    project.calls()
    return project


def outputs(*names, labels=LABELS):
    """Maps and pictures of probes with each BRDF."""
    stems = [f"{name}.{label}.shrm" for name in names for label in labels]
    return sorted(f"{stem}.{suffix}" for stem in stems for suffix in ("exr", "png"))


def prefilter(name, brdf, label, eps="0.03"):
    target = f"build/{name}.{label}.shrm.exr"
    return f"prefilter probes/{name}.exr --brdf {brdf} --eps {eps} -o {target}"


def pairs(names, brdfs=BRDFS):
    return [(name, *each) for name in names for each in zip(brdfs.split(), LABELS, strict=True)]


def render(name, label, flags=""):
    stem = f"build/{name}.{label}.shrm"
    return " ".join(f"render {stem}.exr {flags} -o {stem}.png".split())


def both(names, eps="0.03"):
    """The calls that bake and render every pair of some probes."""
    calls = [prefilter(name, brdf, label, eps) for name, brdf, label in pairs(names)]
    calls += [render(name, label) for name, _, label in pairs(names)]
    return sorted(calls)


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


def test_batch_bakes_and_renders_every_pair(project):
    result = project.batch()
    assert result.returncode == 0
    assert project.calls() == both("ab")
    assert project.built() == outputs("a", "b")


def test_a_page_shows_all_maps(project):
    assert project.batch().returncode == 0
    contact = [line for line in project.all_calls() if line.startswith("contact ")]
    files = " ".join(f"build/{name}" for name in outputs("a", "b") if name.endswith(".exr"))
    title = "--quiet --title make batch"
    assert contact == [f"contact {files} {title} -o build/index.html"]
    (project.folder / "build" / "index.html").unlink()
    assert project.batch().returncode == 0
    assert project.all_calls() == contact


def test_what_killed_processes_left_is_not_shown(project):
    (project.folder / "build").mkdir()
    (project.folder / "build" / ".a.shrm-host-1-ab.exr").write_text("half")
    assert project.batch().returncode == 0
    (contact,) = (line for line in project.all_calls() if line.startswith("contact "))
    assert "/.a" not in contact
    assert project.batch("-n").stdout.count("shrm-host") == 0


def test_running_again_does_nothing(baked):
    before = baked.times()
    assert baked.batch().returncode == 0
    assert baked.all_calls() == []
    assert baked.times() == before


def test_a_changed_probe_is_baked_again_alone(baked):
    baked.write("probes/a.exr", "other light")
    assert baked.batch().returncode == 0
    assert baked.calls() == both("a")


def test_another_state_of_the_program_bakes_everything_again(project):
    """A default that is changed, for example, is no change of any command."""
    package = project.folder / "shrm_cli"
    (package / "__init__.py").write_text('__version__ = "1"\n')
    shutil.copy(ROOT / "shrm_cli" / "sources.py", package)
    project.write("shrm_cli/vocabulary.py", "DEFAULT_EPS = 0.03\n")
    assert project.batch().returncode == 0
    assert project.calls() == both("ab")
    assert project.batch().returncode == 0
    assert project.calls() == []
    project.write("shrm_cli/vocabulary.py", "DEFAULT_EPS = 0.05\n")
    assert project.batch().returncode == 0
    assert project.calls() == both("ab")


def test_a_damaged_output_is_made_again(baked):
    path = baked.folder / "build" / f"b.{LABELS[0]}.shrm.exr"
    path.write_bytes(path.read_bytes()[:-5])
    assert baked.batch().returncode == 0
    label, brdf = LABELS[0], BRDFS.split()[0]
    assert baked.calls() == [prefilter("b", brdf, label), render("b", label)]
    picture = path.with_suffix(".png")
    picture.write_bytes(bytes(picture.stat().st_size))
    assert baked.batch().returncode == 0
    assert baked.calls() == [render("b", label)]


def test_maps_that_a_pattern_matches_are_no_probes(project):
    header = b"\x76\x2f\x31\x01\x02\0\0\0shrm:representation\0string\0"
    (project.folder / "probes" / "a.irradiance.exr").write_bytes(header)
    recipe = b"\x76\x2f\x31\x01\x02\0\0\0shrm:recipe\0string\0\x20\0\0\0"
    (project.folder / "probes" / "a.picture.exr").write_bytes(recipe + b'{"render": ["a.exr"]}')
    (project.folder / "probes" / "b.exr").write_bytes(recipe + b'{"probe": "sky"}')
    assert project.batch(probes="probes/*.exr").returncode == 0
    assert project.built() == outputs("a", "b")
    refused = project.batch(probes="probes/*.irr*.exr")
    assert refused.returncode != 0
    assert "matches maps and pictures alone" in refused.stderr


def test_a_missing_picture_is_rendered_again_alone(baked):
    (baked.folder / "build" / f"b.{LABELS[0]}.shrm.png").unlink()
    assert baked.batch().returncode == 0
    assert baked.calls() == [render("b", LABELS[0])]


def test_another_brdf_adds_its_pairs(baked):
    assert baked.batch(brdfs=f"{BRDFS} lambertian").returncode == 0
    assert {call.split(" -o ")[1] for call in baked.calls()} == {
        f"build/{name}" for name in outputs("a", "b", labels=["lambertian"])
    }


def test_another_tolerance_bakes_everything_again(baked):
    assert baked.batch(eps="0.1").returncode == 0
    assert baked.calls() == both("ab", eps="0.1")
    assert baked.batch(eps="0.1").returncode == 0
    assert baked.calls() == []


def test_other_flags_of_prefilter_bake_everything_again(baked):
    assert baked.batch("PREFILTER_FLAGS=--size 64").returncode == 0
    calls = baked.calls()
    assert len(calls) == 8
    assert sum("--eps 0.03 --size 64 -o" in call for call in calls) == 4


def test_other_flags_of_render_only_render_again(baked):
    assert baked.batch("RENDER_FLAGS=--exposure 1").returncode == 0
    expected = [render(name, label, "--exposure 1") for name, _, label in pairs("ab")]
    assert baked.calls() == sorted(expected)


@pytest.mark.parametrize("jobs", ["-j1", "-j4"])
def test_a_broken_probe_fails_the_run_but_not_the_others(project, jobs):
    project.write("probes/a.exr", "broken")
    result = project.batch(jobs)
    assert result.returncode != 0
    assert result.stderr.count("Error: probes/a.exr: broken; mend it") == 2
    assert "Some jobs failed" in result.stdout
    assert "Maps and pictures are in" not in result.stdout
    assert project.built() == outputs("b")
    project.calls()
    project.write("probes/a.exr", "light")
    assert project.batch(jobs).returncode == 0
    assert project.calls() == both("a")


def test_a_job_whose_failure_is_ignored_is_not_done(baked):
    baked.write("probes/a.exr", "broken")
    assert baked.batch("-i").stderr.count("Error: probes/a.exr: broken; mend it") == 2
    assert baked.built() == outputs("a", "b")
    baked.calls()
    result = baked.batch()
    assert result.returncode != 0
    assert result.stderr.count("Error: probes/a.exr: broken; mend it") == 2


@pytest.mark.parametrize("size", ["4k", "12k", "24k", "48k"])
def test_a_disk_that_is_full_fails_the_run_and_loses_nothing(project, size):
    """For the list of jobs, for maps, for stamps; with room for all the next run makes the rest."""
    with mounted(project.folder / "build", f"size={size}") as build:
        full = project.batch()
        assert full.returncode != 0
        assert "No space left on device" in full.stderr
        assert "Traceback" not in full.stderr
        assert "Maps and pictures are in" not in full.stdout
        subprocess.run(["mount", "-o", "remount,size=1m", str(build)], check=True)
        done = project.batch()
        assert (done.returncode, done.stderr) == (0, "")
        assert project.built() == outputs("a", "b")
        for name in [*project.built(), "index.html"]:
            assert (build / name).read_text().endswith(f"-o build/{name}\n")
        project.calls()
        assert project.batch().returncode == 0
        assert project.calls() == []


def test_everything_is_made_again_when_make_is_told_so(project):
    # Make sets the project up again, too, which takes long.
    stand_in = '#!/bin/sh\ncase "$*" in *batch.py) exec python3 "$@";; esac\n'
    (project.folder / ".venv" / "bin" / "python").write_text(stand_in)
    (project.folder / ".venv" / "bin" / "python").chmod(0o755)
    for _ in range(2):
        assert project.batch("-B", "-j4", "PYTHON=.venv/bin/python").returncode == 0
        assert project.calls() == both("ab")
    assert project.batch().returncode == 0
    assert project.calls() == []


def test_a_missing_probe_fails_the_run_but_not_the_others(project):
    result = project.batch(probes="probes/a.exr probes/no.exr")
    assert result.returncode != 0
    assert "probes/no.exr" in result.stderr
    assert project.built() == outputs("a")


def test_jobs_run_side_by_side(project):
    project.install(SIDE_BY_SIDE)
    result = project.batch("-j4")
    assert (result.returncode, result.stderr) == (0, "")
    assert project.built() == outputs("a", "b")


def test_probes_of_the_same_name_are_refused(project):
    (project.folder / "more").mkdir()
    project.write("more/a.exr", "light")
    result = project.batch(probes="probes/a.exr more/a.exr")
    assert result.returncode != 0
    assert "same name" in result.stderr
    assert project.calls() == []


def test_wildcards_name_probes(project):
    assert project.batch(probes="probes/*.exr").returncode == 0
    assert project.calls() == both("ab")


def test_forms_are_baked_of_every_probe(project):
    forms = "FORMS=irradiance she"
    assert project.batch(forms, brdfs="").returncode == 0
    calls = [
        f"prefilter probes/{probe}.exr --to {form} -o build/{probe}.{form}.exr"
        for probe in "ab"
        for form in ("irradiance", "she")
    ]
    assert project.calls() == calls
    assert project.batch(forms, brdfs="").returncode == 0
    assert project.calls() == []
    assert project.batch(forms, "FLAGS_irradiance=--window auto", brdfs="").returncode == 0
    assert project.calls() == [
        f"prefilter probes/{probe}.exr --to irradiance --window auto "
        f"-o build/{probe}.irradiance.exr"
        for probe in "ab"
    ]


HOSTILE = ["my probe", "it's", "p%q", "a$b$(HOME)", 'say "hi"', "x#y", "a:b", "50% ~grey", "ü*"]


@pytest.mark.slow
@pytest.mark.parametrize("name", HOSTILE[:4])
def test_probes_of_any_name_are_baked(project, name):
    project.write(f"probes/{name}.exr", "light")
    asked = {"probes": shlex.quote(f"probes/{name}.exr"), "brdfs": "phong:exponent=8"}
    result = project.batch("FORMS=she", **asked)
    assert (result.returncode, result.stderr) == (0, "")
    made = outputs(name, labels=["phong-exponent-8"])
    assert project.built() == sorted([*made, f"{name}.she.exr"])
    assert len(project.calls()) == 3
    assert project.batch("FORMS=she", **asked).returncode == 0
    assert project.calls() == []
    project.write(f"probes/{name}.exr", "broken light")
    assert project.batch("FORMS=she", **asked).returncode != 0
    assert f"Error: probes/{name}.exr: broken" in project.batch("FORMS=she", **asked).stderr
    assert (project.folder / "build" / f"{name}.she.exr").exists()


def test_patterns_find_probes_of_any_name(project):
    for name in HOSTILE:
        project.write(f"probes/{name}.exr", "light")
    assert project.batch("-j4", probes="probes/*.exr", brdfs="phong:exponent=8").returncode == 0
    assert project.built() == outputs("a", "b", *HOSTILE, labels=["phong-exponent-8"])


@pytest.mark.parametrize(
    ("spec", "label"),
    [
        ("../more/x.bsdf", "x"),
        ("../more/my paint's.brdf", "my-paint-s"),
        ("../more/a$b.brdf", "a-b"),
        ("lambertian:albedo=0.8/0.1/0.05", "lambertian-albedo-0.8-0.1-0.05"),
        ("0.5*lambertian + 0.5*phong", "0.5-lambertian-+-0.5-phong"),
    ],
)
def test_specifications_of_any_form_are_baked(tmp_path, spec, label):
    (tmp_path / "more").mkdir()
    (tmp_path / "project").mkdir()
    project = Project(tmp_path / "project")
    if spec.startswith("../"):
        project.write(spec, "measured")
    result = project.batch(probes="probes/a.exr", brdfs=shlex.quote(spec))
    assert (result.returncode, result.stderr) == (0, "")
    assert project.built() == outputs("a", labels=[label])
    assert f"--brdf {spec} --eps" in "".join(project.calls())
    assert project.batch(probes="probes/a.exr", brdfs=shlex.quote(spec)).returncode == 0
    assert project.calls() == []
    if spec.startswith("../"):
        project.write(spec, "measured again")
        assert project.batch(probes="probes/a.exr", brdfs=shlex.quote(spec)).returncode == 0
        assert len(project.calls()) == 2


def test_long_sums_have_short_names_of_their_own(project):
    sums = ["+".join([first, *["0.1*phong:exponent=8"] * 20]) for first in ("ggx", "ward")]
    assert project.batch(probes="probes/a.exr", brdfs=" ".join(sums)).returncode == 0
    assert len(project.built()) == 4
    assert max(map(len, project.built())) < 120


def test_six_faces_are_one_probe(project):
    for face in ("+X", "-X", "+Y", "-Y", "+Z", "-Z"):
        project.write(f"probes/sky_{face}.exr", "light")
    asked = {"probes": "probes/sky_%.exr", "brdfs": "phong:exponent=8"}
    assert project.batch(**asked).returncode == 0
    assert project.built() == outputs("sky_%", labels=["phong-exponent-8"])
    project.calls()
    project.write("probes/sky_-Y.exr", "other light")
    assert project.batch(**asked).returncode == 0
    assert len(project.calls()) == 2


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ({"probes": "'probes/a.exr"}, "PROBES: No closing quotation; quote names as in a shell"),
        ({"eps": "'0.1"}, "EPS: No closing quotation; quote names as in a shell"),
        ({"brdfs": "x/p.brdf y/p.brdf"}, "must differ; rename one of the same name"),
    ],
)
def test_what_cannot_be_baked_is_said_in_a_line(project, asked, words):
    for folder in "xy":
        (project.folder / folder).mkdir()
        project.write(f"{folder}/p.brdf", "measured")
    result = project.batch(**asked)
    assert result.returncode != 0
    assert result.stderr.startswith("Error: ")
    assert words in result.stderr.splitlines()[0]
    assert project.calls() == []


@pytest.mark.parametrize("option", ["-n", "-q", "-t", "-nk", "--just-print"])
def test_a_dry_run_says_what_is_due_and_does_nothing(project, option):
    asked = {"probes": "probes/a.exr", "brdfs": "phong:exponent=8"}
    before = snapshot(project.folder)
    said = project.batch(option, **asked)
    assert (said.returncode, said.stderr) == (0, "")
    stem = "build/a.phong-exponent-8.shrm"
    commands = [
        f"prefilter probes/a.exr --brdf phong:exponent=8 --eps 0.03 -o {stem}.exr",
        f"render {stem}.exr -o {stem}.png",
        f"contact {stem}.exr --quiet --title 'make batch' -o build/index.html",
    ]
    lines = said.stdout.splitlines()[-3:]
    assert lines == [f".venv/bin/shrm {command}" for command in commands]
    assert snapshot(project.folder) == before


def test_a_dry_run_of_a_clean_clone_says_that_it_is_set_up_first(project):
    shutil.rmtree(project.folder / ".venv")
    before = snapshot(project.folder)
    said = project.batch("-n")
    assert (said.returncode, said.stderr) == (0, "")
    assert "-m venv .venv" in said.stdout
    assert said.stdout.count(".venv/bin/shrm prefilter") == 4
    assert snapshot(project.folder) == before


def test_a_dry_run_after_the_run_has_nothing_to_say(baked):
    said = baked.batch("-n", "-j4")
    assert (said.returncode, said.stderr) == (0, "")
    assert ".venv/bin/shrm" not in said.stdout
    baked.write("probes/a.exr", "other light")
    before = snapshot(baked.folder)
    assert baked.batch("-n").stdout.count(".venv/bin/shrm") == len(both("a")) + 1
    assert "probes/no.exr: no such file" in baked.batch("-n", probes="probes/no.exr").stderr
    assert snapshot(baked.folder) == before
    assert baked.all_calls() == []


def test_the_project_may_lie_in_a_folder_of_any_name(tmp_path):
    (tmp_path / "it's my folder").mkdir()
    project = Project(tmp_path / "it's my folder")
    result = project.batch()
    assert (result.returncode, result.stderr) == (0, "")
    assert f"Maps and pictures are in {project.folder}/build/" in result.stdout
    demo = project.make("demo")
    assert (demo.returncode, demo.stderr) == (0, "")
    assert f"The picture is {project.folder}/build/demo/lacquer.png" in demo.stdout


def test_a_name_that_no_makefile_can_hold_fails_alone(project):
    project.write("probes/new\nline.exr", "light")
    result = project.batch(probes="probes/*.exr")
    assert result.returncode != 0
    assert "Error: 'probes/new\\nline.exr': names with control characters" in result.stderr
    assert "Some jobs failed" in result.stdout
    assert project.built() == outputs("a", "b")


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
    with project.begin("batch", "-j4", "PROBES=probes/*.exr", f"BRDFS={BRDFS}") as make:
        wait_until(lambda: count("begun") == 4)
        make.send_signal(signal.SIGTERM)
        out, _ = make.communicate(timeout=30)
    assert make.returncode not in (0, 1)
    assert "Maps and pictures are in" not in out
    wait_until(lambda: count("ended") == 4)
    project.install(STAND_IN)
    assert project.batch().returncode == 0
    assert project.calls() == both("ab")


def wait_until(is_true):
    end = time.monotonic() + 30
    while not is_true():
        assert time.monotonic() < end
        time.sleep(0.02)


@pytest.mark.parametrize("nothing", [{"probes": ""}, {"brdfs": ""}, {"probes": "no/*.exr"}])
def test_no_pair_is_no_success(project, nothing):
    result = project.batch(**nothing)
    assert result.returncode != 0
    assert result.stderr != ""
    assert project.calls() == []


def test_defaults_are_every_shipped_probe_and_four_brdfs(project):
    assert project.make("batch").returncode == 0
    calls = [call.split() for call in project.calls()]
    baked = {(call[1], call[3]) for call in calls if call[0] == "prefilter"}
    assert {probe for probe, _ in baked} == {"probes/a.exr", "probes/b.exr"}
    assert len(baked) == 8


def test_clean_removes_what_was_built(baked):
    assert baked.make("clean").returncode == 0
    assert not (baked.folder / "build").exists()
    assert (baked.folder / ".venv").exists()
    assert (baked.folder / "probes" / "a.exr").exists()
    assert baked.make("distclean").returncode == 0
    assert not (baked.folder / ".venv").exists()


def test_an_old_python_is_refused_with_what_to_do(project):
    shutil.rmtree(project.folder / ".venv")
    result = project.make("install", "PYTHON=false")
    assert result.returncode != 0
    assert "shrm needs Python 3.11 or newer; name one: make PYTHON=" in result.stdout
    assert not (project.folder / ".venv").exists()


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
    result = project.batch("-j4", "RENDER_FLAGS=--size 32")
    told = [line for line in result.stderr.splitlines() if WRONG_PICTURE not in line]
    assert (result.returncode, told) == (0, [])
    assert project.built() == sorted(["demo", *outputs("a", "b")])
    with OpenEXR.File(str(project.folder / "build" / "b.phong-exponent-8.shrm.exr")) as file:
        assert "exponent" in file.header()["shrm:brdf"]
